//! The numbers of the autopilot that a user may tune.

use serde::{Deserialize, Serialize};

use crate::error::FdmError;
use crate::range::within;

/// Gains of the autopilot as bandwidths, times and limits (the `[control]` table of an aircraft
/// file). What is left out has the value that suits small aircraft of 1 to 20 kg.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControlGains {
    /// Bandwidth of the roll-angle loop, rad/s.
    pub roll_bandwidth_rad_s: f64,
    /// Damping added to the roll rate, 1/s.
    pub roll_damping_rad_s: f64,
    /// Integral of the roll-angle error, 1/s: trims a crooked aircraft.
    pub roll_integral_rad_s: f64,
    /// Bandwidth of the pitch-angle loop, rad/s.
    pub pitch_bandwidth_rad_s: f64,
    /// Damping added to the pitch rate, 1/s.
    pub pitch_damping_rad_s: f64,
    /// Integral of the pitch-angle error, 1/s.
    pub pitch_integral_rad_s: f64,
    /// Damping of the yaw rate by the rudder, 1/s.
    pub yaw_damping_rad_s: f64,
    /// Bandwidth of the heading loop, rad/s.
    pub heading_bandwidth_rad_s: f64,
    /// How fast an orbit is joined: slope of the course by relative distance.
    pub orbit_gain: f64,
    /// Time in which an altitude error is worked off, s.
    pub height_time_s: f64,
    /// Time in which an airspeed error is worked off, s.
    pub airspeed_time_s: f64,
    /// Proportional part of the energy rates (throttle and pitch).
    pub energy_damping: f64,
    /// Time of the integrals of the energy rates, s.
    pub energy_integral_s: f64,
    /// Largest bank, degrees.
    pub bank_max_deg: f64,
    /// Fastest change of the commanded bank, degrees per second.
    pub bank_rate_max_deg_s: f64,
    /// Lowest commanded pitch, degrees (below 0).
    pub pitch_min_deg: f64,
    /// Highest commanded pitch, degrees.
    pub pitch_max_deg: f64,
    /// Fastest commanded pitch rate, degrees per second.
    pub pitch_rate_max_deg_s: f64,
    /// Fastest commanded climb, m/s.
    pub climb_max_m_s: f64,
    /// Fastest commanded descent, m/s.
    pub sink_max_m_s: f64,
    /// Radius at which a point is circled when reached, m.
    pub loiter_radius_m: f64,
    /// Slope of the final approach, degrees.
    pub approach_slope_deg: f64,
    /// Height above ground at which the final approach begins, m.
    pub approach_height_m: f64,
}

impl Default for ControlGains {
    fn default() -> Self {
        Self {
            roll_bandwidth_rad_s: 4.0,
            roll_damping_rad_s: 4.0,
            roll_integral_rad_s: 0.5,
            pitch_bandwidth_rad_s: 3.0,
            pitch_damping_rad_s: 3.0,
            pitch_integral_rad_s: 1.5,
            yaw_damping_rad_s: 1.5,
            heading_bandwidth_rad_s: 0.9,
            orbit_gain: 3.0,
            height_time_s: 4.0,
            airspeed_time_s: 3.0,
            energy_damping: 0.5,
            energy_integral_s: 5.0,
            bank_max_deg: 40.0,
            bank_rate_max_deg_s: 60.0,
            pitch_min_deg: -20.0,
            pitch_max_deg: 25.0,
            pitch_rate_max_deg_s: 45.0,
            climb_max_m_s: 4.0,
            sink_max_m_s: 3.0,
            loiter_radius_m: 100.0,
            approach_slope_deg: 4.0,
            approach_height_m: 40.0,
        }
    }
}

impl ControlGains {
    /// Checks every gain for sign and range.
    ///
    /// # Errors
    /// [`FdmError::Refused`] with the range that makes sense.
    pub fn check(&self) -> Result<(), FdmError> {
        for (key, value, low, high) in [
            ("roll_bandwidth_rad_s", self.roll_bandwidth_rad_s, 0.1, 30.0),
            ("roll_damping_rad_s", self.roll_damping_rad_s, 0.0, 100.0),
            ("roll_integral_rad_s", self.roll_integral_rad_s, 0.0, 10.0),
            (
                "pitch_bandwidth_rad_s",
                self.pitch_bandwidth_rad_s,
                0.1,
                30.0,
            ),
            ("pitch_damping_rad_s", self.pitch_damping_rad_s, 0.0, 100.0),
            ("pitch_integral_rad_s", self.pitch_integral_rad_s, 0.0, 10.0),
            ("yaw_damping_rad_s", self.yaw_damping_rad_s, 0.0, 30.0),
            (
                "heading_bandwidth_rad_s",
                self.heading_bandwidth_rad_s,
                0.05,
                5.0,
            ),
            ("orbit_gain", self.orbit_gain, 0.1, 20.0),
            ("height_time_s", self.height_time_s, 0.5, 60.0),
            ("airspeed_time_s", self.airspeed_time_s, 0.5, 60.0),
            ("energy_damping", self.energy_damping, 0.0, 3.0),
            ("energy_integral_s", self.energy_integral_s, 0.5, 100.0),
            ("bank_max_deg", self.bank_max_deg, 5.0, 75.0),
            ("bank_rate_max_deg_s", self.bank_rate_max_deg_s, 5.0, 360.0),
            ("pitch_min_deg", self.pitch_min_deg, -60.0, -3.0),
            ("pitch_max_deg", self.pitch_max_deg, 3.0, 60.0),
            (
                "pitch_rate_max_deg_s",
                self.pitch_rate_max_deg_s,
                5.0,
                180.0,
            ),
            ("climb_max_m_s", self.climb_max_m_s, 0.3, 50.0),
            ("sink_max_m_s", self.sink_max_m_s, 0.3, 50.0),
            ("loiter_radius_m", self.loiter_radius_m, 5.0, 5000.0),
            ("approach_slope_deg", self.approach_slope_deg, 1.0, 15.0),
            ("approach_height_m", self.approach_height_m, 10.0, 300.0),
        ] {
            within(&format!("control.{key}"), value, low, high)?;
        }
        Ok(())
    }
}
