//! The numbers of the autopilot that a user may tune.

use serde::{Deserialize, Serialize};

use crate::error::FdmError;
use crate::range::within;

macro_rules! gains {
    ($($(#[$doc:meta])* $name:ident = $default:literal, $low:literal..=$high:literal;)+) => {
        /// Gains of the autopilot as bandwidths, times and limits (the `[control]` table of an aircraft
        /// file). What is left out has the value that suits small aircraft of 1 to 20 kg.
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct ControlGains {
            $($(#[$doc])* pub $name: f64,)+
        }

        impl Default for ControlGains {
            fn default() -> Self {
                Self { $($name: $default,)+ }
            }
        }

        impl ControlGains {
            /// Checks every gain for sign and range.
            ///
            /// # Errors
            /// [`FdmError::Refused`] with the range that makes sense.
            pub fn check(&self) -> Result<(), FdmError> {
                $(within(concat!("control.", stringify!($name)), self.$name, $low, $high)?;)+
                Ok(())
            }
        }
    };
}

// Each with its default and its range.
gains! {
    /// Bandwidth of the roll-angle loop, rad/s.
    roll_bandwidth_rad_s = 4.0, 0.1..=30.0;
    /// Damping added to the roll rate, 1/s.
    roll_damping_rad_s = 4.0, 0.0..=100.0;
    /// Integral of the roll-angle error, 1/s: trims a crooked aircraft.
    roll_integral_rad_s = 0.5, 0.0..=10.0;
    /// Bandwidth of the pitch-angle loop, rad/s.
    pitch_bandwidth_rad_s = 3.0, 0.1..=30.0;
    /// Damping added to the pitch rate, 1/s.
    pitch_damping_rad_s = 3.0, 0.0..=100.0;
    /// Integral of the pitch-angle error, 1/s.
    pitch_integral_rad_s = 1.5, 0.0..=10.0;
    /// Damping of the yaw rate by the rudder, 1/s.
    yaw_damping_rad_s = 1.5, 0.0..=30.0;
    /// Bandwidth of the heading loop, rad/s.
    heading_bandwidth_rad_s = 0.9, 0.05..=5.0;
    /// How fast an orbit is joined: slope of the course by relative distance.
    orbit_gain = 3.0, 0.1..=20.0;
    /// Time in which an altitude error is worked off, s.
    height_time_s = 4.0, 0.5..=60.0;
    /// Time in which an airspeed error is worked off, s.
    airspeed_time_s = 3.0, 0.5..=60.0;
    /// Proportional part of the energy rates (throttle and pitch).
    energy_damping = 0.5, 0.0..=3.0;
    /// Time of the integrals of the energy rates, s.
    energy_integral_s = 5.0, 0.5..=100.0;
    /// Largest bank, degrees.
    bank_max_deg = 40.0, 5.0..=75.0;
    /// Fastest change of the commanded bank, degrees per second.
    bank_rate_max_deg_s = 60.0, 5.0..=360.0;
    /// Lowest commanded pitch, degrees (below 0).
    pitch_min_deg = -20.0, -60.0..=-3.0;
    /// Highest commanded pitch, degrees.
    pitch_max_deg = 25.0, 3.0..=60.0;
    /// Fastest commanded pitch rate, degrees per second.
    pitch_rate_max_deg_s = 45.0, 5.0..=180.0;
    /// Fastest commanded climb, m/s.
    climb_max_m_s = 4.0, 0.3..=50.0;
    /// Fastest commanded descent, m/s.
    sink_max_m_s = 3.0, 0.3..=50.0;
    /// Radius at which a point is circled when reached, m.
    loiter_radius_m = 100.0, 5.0..=5000.0;
    /// Slope of the final approach, degrees.
    approach_slope_deg = 4.0, 1.0..=15.0;
    /// Height above ground at which the final approach begins, m.
    approach_height_m = 40.0, 10.0..=300.0;
}
