//! Motor and propeller by momentum theory.

use serde::{Deserialize, Serialize};

use crate::scalar::larger;

/// How the slipstream follows throttle δt at airspeed V.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PropellerLaw {
    /// Thrust ½ρ A Vd (Vd − V) with Vd = V + δt (V_exit − V) (Coates et al. 2019): nil at δt = 0.
    #[default]
    Blended,
    /// Thrust ½ρ A ((δt V_exit)² − V²) (Beard & McLain 2012), not below 0: the propeller gives
    /// nothing until its slipstream is faster than the flight.
    Proportional,
}

/// Motor and propeller by momentum.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Propulsion {
    /// How the slipstream follows the throttle.
    #[serde(default)]
    pub law: PropellerLaw,
    /// Effective swept area A (area times efficiency), m².
    pub swept_area_m2: f64,
    /// Speed of the slipstream at full throttle, m/s.
    pub exit_speed_m_s: f64,
    /// Time constant of the motor, s.
    pub lag_s: f64,
}

impl Propulsion {
    /// Speed of the slipstream at a true airspeed and throttle (0 to 1), m/s.
    #[inline(always)]
    pub fn slipstream_m_s(&self, airspeed_m_s: f64, throttle: f64) -> f64 {
        match self.law {
            PropellerLaw::Blended => airspeed_m_s + throttle * (self.exit_speed_m_s - airspeed_m_s),
            PropellerLaw::Proportional => throttle * self.exit_speed_m_s,
        }
    }

    /// Thrust at a true airspeed, throttle (0 to 1) and air density, N.
    #[inline(always)]
    pub fn thrust_n(&self, airspeed_m_s: f64, throttle: f64, density_kg_m3: f64) -> f64 {
        let slipstream = self.slipstream_m_s(airspeed_m_s, throttle);
        let square = match self.law {
            PropellerLaw::Blended => slipstream * (slipstream - airspeed_m_s),
            PropellerLaw::Proportional => {
                larger(slipstream * slipstream - airspeed_m_s * airspeed_m_s, 0.0)
            }
        };
        density_kg_m3 * 0.5 * square * self.swept_area_m2
    }
}
