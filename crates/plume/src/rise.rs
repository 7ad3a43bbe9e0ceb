//! Plume rise: how far above its stack a hot plume levels off (Briggs 1969–1975, as in the
//! ISC3 model, US EPA-454/B-95-003b, section 1.1.4).

use air::STANDARD_GRAVITY_M_S2;

use crate::stability::Stability;
use crate::{PlumeError, in_range};

/// What leaves the stack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stack {
    /// Height of the mouth above ground, m.
    pub height_m: f64,
    /// Inner diameter of the mouth, m.
    pub diameter_m: f64,
    /// Exit velocity, m/s.
    pub exit_velocity_m_s: f64,
    /// Exit temperature, K.
    pub exit_temperature_k: f64,
}

/// Below this wind the rise formulas, which divide by it, use this value, m/s (ISC3).
const LEAST_WIND_M_S: f64 = 1.0;
/// Potential temperature gradient of classes E and F, K/m (ISC3 defaults).
const GRADIENT_E_K_M: f64 = 0.020;
const GRADIENT_F_K_M: f64 = 0.035;

impl Stack {
    /// Buoyancy flux F = g v d²/4 (Ts − Ta)/Ts, m⁴/s³; zero for a plume colder than the air.
    pub fn buoyancy_flux_m4_s3(&self, air_temperature_k: f64) -> f64 {
        let excess = (self.exit_temperature_k - air_temperature_k) / self.exit_temperature_k;
        STANDARD_GRAVITY_M_S2 * self.exit_velocity_m_s * self.diameter_m.powi(2) / 4.0
            * excess.max(0.0)
    }

    /// Final rise above the mouth in m: the larger of buoyant and momentum rise
    /// (Briggs; ISC3 equations 1-9 to 1-20).
    ///
    /// # Errors
    /// A stack or air outside what chimneys and the troposphere have.
    pub fn final_rise_m(
        &self,
        wind_m_s: f64,
        air_temperature_k: f64,
        class: Stability,
    ) -> Result<f64, PlumeError> {
        in_range("stack height_m", self.height_m, 0.0, 1000.0)?;
        in_range("stack diameter_m", self.diameter_m, 0.01, 50.0)?;
        in_range("exit velocity, m/s", self.exit_velocity_m_s, 0.0, 200.0)?;
        in_range(
            "exit temperature, K",
            self.exit_temperature_k,
            200.0,
            3000.0,
        )?;
        in_range("wind at the stack's mouth, m/s", wind_m_s, 0.0, 80.0)?;
        in_range("air temperature, K", air_temperature_k, 200.0, 340.0)?;
        let wind = wind_m_s.max(LEAST_WIND_M_S);
        let flux = self.buoyancy_flux_m4_s3(air_temperature_k);
        let momentum = 3.0 * self.diameter_m * self.exit_velocity_m_s / wind;
        let gradient = match class {
            Stability::E => GRADIENT_E_K_M,
            Stability::F => GRADIENT_F_K_M,
            _ => return Ok(neutral_rise_m(flux, wind).max(momentum)),
        };
        let s = STANDARD_GRAVITY_M_S2 * gradient / air_temperature_k;
        let bent_over = 2.6 * (flux / (wind * s)).cbrt();
        let calm = 4.0 * flux.powf(0.25) * s.powf(-0.375);
        // Momentum flux, m⁴/s².
        let flux_m = self.exit_velocity_m_s.powi(2) * self.diameter_m.powi(2) * air_temperature_k
            / (4.0 * self.exit_temperature_k);
        let stable_momentum = 1.5 * (flux_m / (wind * s.sqrt())).cbrt();
        // In light wind the bent-over formula, which divides by it, rises without bound: the calm one
        // limits it.
        Ok(bent_over.min(calm).max(stable_momentum.min(momentum)))
    }

    /// Effective height H above ground, m: mouth plus final rise.
    ///
    /// # Errors
    /// As [`Stack::final_rise_m`].
    pub fn effective_height_m(
        &self,
        wind_m_s: f64,
        air_temperature_k: f64,
        class: Stability,
    ) -> Result<f64, PlumeError> {
        Ok(self.height_m + self.final_rise_m(wind_m_s, air_temperature_k, class)?)
    }
}

/// Neutral and unstable: 21.425 F^(3/4)/u below F = 55, 38.71 F^(3/5)/u above.
fn neutral_rise_m(flux: f64, wind_m_s: f64) -> f64 {
    if flux < 55.0 {
        21.425 * flux.powf(0.75) / wind_m_s
    } else {
        38.71 * flux.powf(0.6) / wind_m_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STACK: Stack = Stack {
        height_m: 100.0,
        diameter_m: 4.0,
        exit_velocity_m_s: 15.0,
        exit_temperature_k: 400.0,
    };

    // By hand: F = 9.80665*15*4*(400-288)/400 = 164.752; neutral at 5 m/s:
    // 38.71*164.752^0.6/5 = 165.558; class F: s = 9.80665*0.035/288,
    // 2.6*(164.752/(5 s))^(1/3) = 78.619 (python3).
    #[test]
    fn by_hand() {
        assert!((STACK.buoyancy_flux_m4_s3(288.0) - 164.752).abs() < 1e-3);
        let neutral = STACK.final_rise_m(5.0, 288.0, Stability::D).unwrap();
        assert!((neutral - 165.558).abs() < 1e-3, "{neutral}");
        let stable = STACK.final_rise_m(5.0, 288.0, Stability::F).unwrap();
        assert!((stable - 78.619).abs() < 1e-3, "{stable}");
        let effective = STACK.effective_height_m(5.0, 288.0, Stability::D).unwrap();
        assert_eq!(effective, 100.0 + neutral);
    }

    // The two branches of ISC3 meet at F = 55: 21.425*55^.75 = 432.7, 38.71*55^.6 = 428.7.
    #[test]
    fn branches_meet() {
        let (below, above) = (neutral_rise_m(54.999, 1.0), neutral_rise_m(55.0, 1.0));
        assert!((below / above - 1.0).abs() < 0.01);
    }

    #[test]
    fn bad_stack_is_refused() {
        let bad = Stack {
            diameter_m: -4.0,
            ..STACK
        };
        assert!(bad.final_rise_m(5.0, 288.0, Stability::D).is_err());
        assert!(STACK.final_rise_m(f64::NAN, 288.0, Stability::D).is_err());
        assert!(
            STACK
                .final_rise_m(0.0, 288.0, Stability::D)
                .unwrap()
                .is_finite()
        );
    }

    proptest::proptest! {
        #[test]
        fn falls_with_wind(u in 1.0f64..20.0, by in 0.1f64..5.0, class in 0usize..6) {
            let class = Stability::ALL[class];
            let here = STACK.final_rise_m(u, 288.0, class).unwrap();
            let windier = STACK.final_rise_m(u + by, 288.0, class).unwrap();
            proptest::prop_assert!(windier <= here && windier > 0.0);
        }
    }
}
