//! What tells causes apart that no flight does: another instrument, or a check on the ground.

use ::plume::mechanism::MechanismId;

/// Advice for the members of a set that no flight tried is likely to take apart; `best` is the one
/// that comes nearest.
pub(super) fn instead(set: impl Iterator<Item = MechanismId>, best: &str) -> String {
    let mut checks: Vec<&str> = set.filter_map(check).collect();
    checks.sort_unstable();
    checks.dedup();
    let advice = if checks.is_empty() {
        "another instrument".to_string()
    } else {
        checks.join("; ")
    };
    format!(
        "no flight of those tried is likely to tell them apart; the one that comes nearest: {best}. \
         What would tell: {advice}"
    )
}

/// What decides whether a mechanism is at work, without a flight.
fn check(id: MechanismId) -> Option<&'static str> {
    use MechanismId as M;
    let words = match id {
        M::SensorGain | M::SensorSaturation => "the sensors read in span gas on the ground",
        M::SensorOffset => "the sensors read in zero gas on the ground",
        M::SensorDrift => "the sensors read in zero gas before and after the flight",
        M::SensorLag => "a step of gas given to the sensor on the ground, and its response timed",
        M::CrossSensitivityHumidity | M::CrossSensitivityTemperature => {
            "the sensors read in zero gas that is warmed, cooled and moistened"
        }
        M::CrossSensitivityPressure => "the sensors read in zero gas at the pressures flown",
        M::ClockOffset => "the aircraft's clock held against that of its position fixes",
        M::PositionOffset => "the aircraft's position logged on a surveyed point",
        M::AltitudeOffset => "the aircraft's altitude logged on a surveyed point",
        M::SourcePositionOffset => "the source's position surveyed",
        M::EffectiveHeightOffset => "the plume's height seen by a lidar or cameras",
        M::WindDirectionOffset | M::WindDirectionDrift => {
            "a second wind vane at the plume's height"
        }
        M::WindSpeedScale => "a second anemometer at the plume's height",
        M::Meander => "the direction's standard deviation by a wind vane at the plume's height",
        M::EmissionScale | M::EmissionTrend => "the emission by the plant's own monitor",
        M::FirstOrderDecay => "the gas's lifetime in a bag of the plume's air",
        M::DryDeposition => "the flux into the ground by a chamber or by eddy covariance",
        M::BackgroundOffset | M::BackgroundDrift | M::BackgroundGradient => {
            "a monitor upwind of the source"
        }
        _ => return None,
    };
    Some(words)
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
