//! Sensors at rest with a wind logged beside them: a parked car, a mast, a network round a site.
//!
//! Such a sensor sees the plume only while the wind carries it there, so the readings over the logged wind are the plume's
//! profile across. An axis that is free to turn beyond the log would put each reading on the axis or beside it, and
//! leave nothing of the profile to tell the rate by. The mean plume is therefore wider than the spread of its class by
//! the part of the meander that the log does not show, and each reading differs from that mean by a fluctuation.

use ::plume::mechanism::MechanismId;
use ::plume::track::Row;
use infer::{Noise, Policy};

use super::model::Unknown;
use super::sensor_calibration::stands_at;

/// Standard deviation of the wind's speed across that meanders at any stability, m/s (Hanna 1983, J. Climate Appl. Meteor.
/// 22:1424).
const MEANDER_M_S: f64 = 0.5;
/// It is known to this part.
const MEANDER_PART: f64 = 0.5;
/// The axis turns no further beyond the logged wind than this, degrees, and not upwards: the rest is meander.
const AXIS_DRIFT_DEG: f64 = 0.1;
/// Standard deviation of one reading about the mean plume, as a part of it: crossings of a plume within a hundred metres
/// differ by more than a factor of two, and most readings beside it hold nothing.
const FLUCTUATION: f64 = 1.0;
const FLUCTUATION_LN_SD: f64 = 0.5;
/// Memory of the fluctuation, s: that of eddies near the ground.
const FLUCTUATION_S: f64 = 20.0;

/// The air at sensors that all stand still.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtRest {
    /// Mean speed of the logged wind, m/s.
    speed_m_s: f64,
}

impl AtRest {
    /// That of the rows with readings of so many platforms; none where one of these moves.
    pub(super) fn of(platforms: usize, read: &[Row]) -> Option<Self> {
        let of = |platform: usize| read.iter().filter(move |r| r.platform == platform);
        let stands = |platform| of(platform).next().is_none() || stands_at(of(platform)).is_some();
        let speeds: Vec<f64> = read.iter().filter_map(|r| Some(r.wind?.0)).collect();
        let speed_m_s = speeds.iter().sum::<f64>() / speeds.len() as f64;
        (!speeds.is_empty() && (0..platforms).all(stands)).then_some(Self { speed_m_s })
    }

    /// How far the plume meanders about the logged wind.
    pub(super) fn meander(self) -> Unknown {
        let mean = (MEANDER_M_S / self.speed_m_s.max(MEANDER_M_S)).to_degrees();
        Unknown {
            id: MechanismId::Meander,
            platform: None,
            setting: None,
            prior: infer::Prior {
                mean,
                sd: MEANDER_PART * mean,
            },
        }
    }

    /// The rules in this air.
    pub(super) fn bind(self, policy: &mut Policy) {
        policy.axis_drift_sizes_deg = [0.5, 1.0, 2.0].map(|part| part * AXIS_DRIFT_DEG);
        policy.upward_over_sideways = 0.0;
        policy.noise_median = Noise {
            fluctuation: FLUCTUATION,
            fluctuation_s: FLUCTUATION_S,
            wander_deg: AXIS_DRIFT_DEG,
            ..policy.noise_median
        };
        policy.noise_ln_sd[3] = FLUCTUATION_LN_SD;
        policy.noise_tolerated.fluctuation =
            policy.noise_tolerated.fluctuation.max(2.0 * FLUCTUATION);
    }
}
