//! What tells causes apart that no flight does: another instrument, or a check on the ground.

use ::plume::mechanism::MechanismId;

/// Advice for the members of a set that no flight tried is likely to take apart; `best` is the one
/// that comes nearest.
pub(super) fn instead(set: impl Iterator<Item = MechanismId>, best: &str) -> String {
    let mut checks: Vec<&str> = set.filter_map(|id| id.spec().check).collect();
    checks.sort_unstable();
    checks.dedup();
    let advice = if checks.is_empty() {
        "another instrument".to_string()
    } else {
        checks.join("; ")
    };
    format!(
        "none of the tried flights is likely to tell them apart; the best of them: {best}. Data that would \
         decide: {advice}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_check_is_said_once() {
        let set = [MechanismId::SensorGain, MechanismId::SensorSaturation];
        let words = instead(set.into_iter(), "legs");
        assert_eq!(words.matches("span gas").count(), 1, "{words}");
        let none = instead([MechanismId::SigmaYScale].into_iter(), "legs");
        assert!(none.contains("another instrument"), "{none}");
    }
}
