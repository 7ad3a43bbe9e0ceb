//! Recommends a check on the ground, or another instrument, for causes that no flight separates.

use ::plume::mechanism::MechanismId;

/// Returns a recommendation for the members of a set that no candidate flight is likely to separate; `best` is the
/// flight that comes closest.
pub(super) fn recommend_ground_check(set: impl Iterator<Item = MechanismId>, best: &str) -> String {
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
        let words = recommend_ground_check(set.into_iter(), "legs");
        assert_eq!(words.matches("span gas").count(), 1, "{words}");
        let none = recommend_ground_check([MechanismId::SigmaYScale].into_iter(), "legs");
        assert!(none.contains("another instrument"), "{none}");
    }
}
