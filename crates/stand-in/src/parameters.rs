//! The parameters that the stand-in shares with an ArduPlane, by the same names.

use mav_bridge::arducopter::{
    BATT_FS_LOW_ACT, EK3_DRAG_MCOEF, FS_GCS_ENABLE, FS_GCS_TIMEOUT, FS_THR_ENABLE, RTL_ALT,
};
pub(crate) use mav_bridge::ardupilot::{FENCE_ACTION, FENCE_ENABLE, MAV_GCS_SYSID};
pub(crate) use mav_bridge::arduplane::{AIRSPEED_MAX, AIRSPEED_MIN, RTL_ALTITUDE, RTL_AUTOLAND};
use mav_bridge::arduplane::{FS_GCS_ENABL, FS_LONG_ACTN, TKOFF_ALT};
use mav_bridge::dialect::MavParamType;

/// Names and values, in ArduPlane's units. The defaults are those of a careful owner: unlike
/// ArduPlane's own, they bring the vehicle home when the ground station falls silent.
#[derive(Debug, Clone, PartialEq)]
pub struct AutopilotParameters {
    values: Vec<(&'static str, f32)>,
}

pub(crate) const FS_LONG_TIMEOUT: &str = "FS_LONG_TIMEOUT";
/// Its own system id; SYSID_THISMAV before ArduPlane 4.7.
const MAV_SYSID: &str = "MAV_SYSID";
pub(crate) const WP_LOITER_RAD: &str = "WP_LOITER_RAD";
/// Distance at which a waypoint counts as reached, m.
pub(crate) const WP_RADIUS: &str = "WP_RADIUS";
/// Ground speed below which airspeed is added, m/s; 0: off.
pub(crate) const MIN_GROUNDSPEED: &str = "MIN_GROUNDSPEED";
/// How many items of each kind are on board; not to be set by hand.
pub(crate) const TOTALS: [&str; 3] = ["MIS_TOTAL", "FENCE_TOTAL", "RALLY_TOTAL"];

impl AutopilotParameters {
    /// Those of an airframe that flies between two equivalent airspeeds, m/s.
    pub fn new(airspeed_min_m_s: f64, airspeed_max_m_s: f64, loiter_radius_m: f64) -> Self {
        Self {
            values: vec![
                (AIRSPEED_MAX, airspeed_max_m_s as f32),
                (AIRSPEED_MIN, airspeed_min_m_s as f32),
                (FENCE_ACTION, 1.0),
                (FENCE_ENABLE, 0.0),
                (TOTALS[1], 0.0),
                (FS_GCS_ENABL, 1.0),
                (FS_LONG_ACTN, 1.0),
                (FS_LONG_TIMEOUT, 5.0),
                (MAV_GCS_SYSID, 255.0),
                (MAV_SYSID, 1.0),
                (MIN_GROUNDSPEED, 0.0),
                (TOTALS[0], 0.0),
                (TOTALS[2], 0.0),
                (RTL_ALTITUDE, 100.0),
                (RTL_AUTOLAND, 3.0),
                (TKOFF_ALT, 50.0),
                (WP_LOITER_RAD, loiter_radius_m as f32),
                (WP_RADIUS, 90.0),
            ],
        }
    }

    /// Those of a multirotor, in ArduCopter's units.
    pub fn of_multirotor() -> Self {
        Self {
            values: vec![
                (BATT_FS_LOW_ACT, 2.0),
                // Not 0, because the stand-in sends a wind estimate.
                (EK3_DRAG_MCOEF, 0.1),
                (FENCE_ACTION, 1.0),
                (FENCE_ENABLE, 0.0),
                (TOTALS[1], 0.0),
                (FS_GCS_ENABLE, 1.0),
                (FS_GCS_TIMEOUT, 5.0),
                (FS_THR_ENABLE, 1.0),
                (MAV_GCS_SYSID, 255.0),
                (MAV_SYSID, 1.0),
                (TOTALS[0], 0.0),
                (TOTALS[2], 0.0),
                (RTL_ALT, 10_000.0),
            ],
        }
    }

    /// Altitude above home at which it returns, m.
    pub(crate) fn return_above_home_m(&self) -> f64 {
        let plane_m = self.find(RTL_ALTITUDE).map(|(_, m)| f64::from(m));
        plane_m.unwrap_or_else(|| 0.01 * self.get(RTL_ALT))
    }

    /// Silence of the ground station after which its failsafe acts, s; none where that is off.
    pub(crate) fn gcs_failsafe_s(&self) -> Option<f64> {
        let of = |enable: &str, timeout: &str| (self.get(enable) > 0.0).then(|| self.get(timeout));
        of(FS_GCS_ENABL, FS_LONG_TIMEOUT).or_else(|| of(FS_GCS_ENABLE, FS_GCS_TIMEOUT))
    }

    /// Whether that failsafe brings it home.
    pub(crate) fn gcs_failsafe_returns(&self) -> bool {
        self.get(FS_LONG_ACTN) == 1.0 || self.get(FS_GCS_ENABLE) == 1.0
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

    /// Those of the system of this id.
    pub(crate) fn of_system(mut self, system_id: u8) -> Self {
        self.set(MAV_SYSID, f32::from(system_id));
        self
    }

    /// Whether a ground station may set the parameter of this name.
    pub(crate) fn is_open(name: &str) -> bool {
        name != MAV_SYSID && !TOTALS.contains(&name)
    }

    /// All of them, in order of name.
    pub fn all(&self) -> &[(&'static str, f32)] {
        &self.values
    }

    /// The type that ArduPlane has for the parameter of this name.
    pub(crate) fn kind(name: &str) -> MavParamType {
        match name {
            FS_GCS_ENABL | FS_LONG_ACTN | RTL_AUTOLAND | FENCE_ENABLE | FENCE_ACTION => {
                MavParamType::MAV_PARAM_TYPE_INT8
            }
            MAV_GCS_SYSID | MAV_SYSID | TKOFF_ALT | WP_RADIUS | MIN_GROUNDSPEED => {
                MavParamType::MAV_PARAM_TYPE_INT16
            }
            name if TOTALS.contains(&name) => MavParamType::MAV_PARAM_TYPE_INT16,
            _ => MavParamType::MAV_PARAM_TYPE_REAL32,
        }
    }

    /// A value that is known to be there.
    pub(crate) fn get(&self, name: &str) -> f64 {
        self.find(name).map_or(0.0, |(_, value)| f64::from(value))
    }
}
