//! Gains of a multirotor's cascaded loops.

use serde::{Deserialize, Serialize};

use crate::error::FdmError;
use crate::range::within;

macro_rules! gains {
    ($($(#[$doc:meta])* $name:ident = $default:literal, $low:literal..=$high:literal;)+) => {
        /// Gains of the autopilot as bandwidths and limits (the `[control]` table of a multirotor's file). A key that is
        /// left out has the value that suits aircraft of 1 to 5 kg.
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct MultirotorGains {
            $($(#[$doc])* pub $name: f64,)+
        }

        impl Default for MultirotorGains {
            fn default() -> Self {
                Self { $($name: $default,)+ }
            }
        }

        impl MultirotorGains {
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

gains! {
    /// Bandwidth of the position loop, 1/s.
    position_rad_s = 1.2, 0.1..=5.0;
    /// Bandwidth of the height loop, 1/s.
    height_rad_s = 1.5, 0.1..=5.0;
    /// Bandwidth of the horizontal velocity loop, 1/s.
    velocity_rad_s = 3.5, 0.2..=10.0;
    /// Bandwidth of the vertical velocity loop, 1/s.
    climb_rad_s = 5.0, 0.2..=15.0;
    /// Integral of the velocity error over its gain, 1/s: holds against wind.
    velocity_integral_rad_s = 1.0, 0.0..=5.0;
    /// Bandwidth of the tilt loop, 1/s.
    tilt_rad_s = 8.0, 0.5..=30.0;
    /// Bandwidth of the heading loop, 1/s.
    heading_rad_s = 2.0, 0.1..=10.0;
    /// Bandwidth of the rate loops of roll and pitch, 1/s.
    rate_rad_s = 25.0, 1.0..=100.0;
    /// Bandwidth of the yaw rate loop, 1/s.
    yaw_rate_rad_s = 8.0, 0.5..=50.0;
    /// Integral of the rate error over its gain, 1/s: trims uneven motors.
    rate_integral_rad_s = 2.0, 0.0..=20.0;
    /// Acceleration of the path that it follows, m/s².
    acceleration_m_s2 = 1.5, 0.2..=10.0;
}
