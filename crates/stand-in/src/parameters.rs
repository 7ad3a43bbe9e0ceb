//! The parameters that the stand-in shares with an ArduPlane, by the same names.

pub(crate) use mav_bridge::arduplane::SYSID_MYGCS;
use mav_bridge::arduplane::{FS_GCS_ENABL, FS_LONG_ACTN, TKOFF_ALT};
use mav_bridge::dialect::MavParamType;

/// Names and values, in ArduPlane's units. The defaults are those of a careful owner: unlike
/// ArduPlane's own, they bring the vehicle home when the ground station falls silent.
#[derive(Debug, Clone, PartialEq)]
pub struct AutopilotParameters {
    values: [(&'static str, f32); 9],
}

pub(crate) const FS_LONG_TIMEOUT: &str = "FS_LONG_TIMEOUT";
pub(crate) const RTL_ALTITUDE: &str = "RTL_ALTITUDE";
pub(crate) const WP_LOITER_RAD: &str = "WP_LOITER_RAD";
pub(crate) const AIRSPEED_MIN: &str = "AIRSPEED_MIN";
pub(crate) const AIRSPEED_MAX: &str = "AIRSPEED_MAX";

impl AutopilotParameters {
    /// Those of an airframe that flies between two equivalent airspeeds, m/s.
    pub fn new(airspeed_min_m_s: f64, airspeed_max_m_s: f64, loiter_radius_m: f64) -> Self {
        Self {
            values: [
                (AIRSPEED_MAX, airspeed_max_m_s as f32),
                (AIRSPEED_MIN, airspeed_min_m_s as f32),
                (FS_GCS_ENABL, 1.0),
                (FS_LONG_ACTN, 1.0),
                (FS_LONG_TIMEOUT, 5.0),
                (RTL_ALTITUDE, 100.0),
                (SYSID_MYGCS, 255.0),
                (TKOFF_ALT, 50.0),
                (WP_LOITER_RAD, loiter_radius_m as f32),
            ],
        }
    }

    /// Position and value of a parameter.
    pub fn find(&self, name: &str) -> Option<(usize, f32)> {
        let index = self.values.iter().position(|(n, _)| *n == name)?;
        Some((index, self.values[index].1))
    }

    /// Sets a parameter; false if there is none of that name or the value is not finite.
    pub fn set(&mut self, name: &str, value: f32) -> bool {
        match self.values.iter_mut().find(|(n, _)| *n == name) {
            Some((_, old)) if value.is_finite() => {
                *old = value;
                true
            }
            _ => false,
        }
    }

    /// All of them, in order of name.
    pub fn all(&self) -> &[(&'static str, f32)] {
        &self.values
    }

    /// The type that ArduPlane has for the parameter of this name.
    pub(crate) fn kind(name: &str) -> MavParamType {
        match name {
            FS_GCS_ENABL | FS_LONG_ACTN => MavParamType::MAV_PARAM_TYPE_INT8,
            SYSID_MYGCS | TKOFF_ALT => MavParamType::MAV_PARAM_TYPE_INT16,
            _ => MavParamType::MAV_PARAM_TYPE_REAL32,
        }
    }

    /// A value that is known to be there.
    pub(crate) fn get(&self, name: &str) -> f64 {
        self.find(name).map_or(0.0, |(_, value)| f64::from(value))
    }
}
