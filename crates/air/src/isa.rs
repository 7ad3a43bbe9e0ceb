//! The International Standard Atmosphere (ISO 2533:1975), shifted to what a site reports.

use crate::{AirError, STANDARD_GRAVITY_M_S2, in_range};

/// Specific gas constant of dry air, J/(kg K) (ISO 2533).
pub const GAS_CONSTANT_AIR_J_KG_K: f64 = 287.052_87;
/// Universal gas constant, J/(mol K) (CODATA 2018).
pub const GAS_CONSTANT_J_MOL_K: f64 = 8.314_462_618;
/// Zero of the Celsius scale, K.
pub const ZERO_CELSIUS_K: f64 = 273.15;
/// Temperature gradient of the troposphere, K/m (ISO 2533).
const LAPSE_RATE_K_M: f64 = -0.0065;
/// Sea-level standard temperature, K (ISO 2533).
const SEA_LEVEL_TEMPERATURE_K: f64 = 288.15;
/// Sea-level standard pressure, Pa (ISO 2533).
const SEA_LEVEL_PRESSURE_PA: f64 = 101_325.0;

/// The state of the air at one height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Air {
    /// Temperature, K.
    pub temperature_k: f64,
    /// Static pressure, Pa.
    pub pressure_pa: f64,
}

impl Air {
    /// Density of dry air by the ideal gas law, kg/m³.
    pub fn density_kg_m3(self) -> f64 {
        self.pressure_pa / (GAS_CONSTANT_AIR_J_KG_K * self.temperature_k)
    }

    /// Equivalent over true airspeed: the square root of the density over that of the ISA at sea level.
    pub fn eas_over_tas(self) -> f64 {
        (self.density_kg_m3() / Atmosphere::standard().at(0.0).density_kg_m3()).sqrt()
    }

    /// Amount of air in a cubic metre, mol/m³: turns a gas's mol/m³ into a mole fraction.
    pub fn molar_density_mol_m3(self) -> f64 {
        self.pressure_pa / (GAS_CONSTANT_J_MOL_K * self.temperature_k)
    }
}

/// A troposphere with the standard lapse rate through a reported temperature and pressure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Atmosphere {
    reference_amsl_m: f64,
    reference: Air,
}

impl Atmosphere {
    /// The ISA itself: 15 °C and 1013.25 hPa at mean sea level.
    pub fn standard() -> Self {
        Self {
            reference_amsl_m: 0.0,
            reference: Air {
                temperature_k: SEA_LEVEL_TEMPERATURE_K,
                pressure_pa: SEA_LEVEL_PRESSURE_PA,
            },
        }
    }

    /// An atmosphere with `temperature_c` and `pressure_hpa` at `at_amsl_m`.
    ///
    /// # Errors
    /// A temperature outside −60…60 °C or a pressure outside 300…1100 hPa.
    pub fn through(
        at_amsl_m: f64,
        temperature_c: f64,
        pressure_hpa: f64,
    ) -> Result<Self, AirError> {
        in_range(
            "temperature_c",
            temperature_c,
            -60.0,
            60.0,
            "-60 to 60 degrees Celsius",
        )?;
        in_range(
            "pressure_hpa",
            pressure_hpa,
            300.0,
            1100.0,
            "300 to 1100 hPa",
        )?;
        Ok(Self {
            reference_amsl_m: at_amsl_m,
            reference: Air {
                temperature_k: temperature_c + ZERO_CELSIUS_K,
                pressure_pa: pressure_hpa * 100.0,
            },
        })
    }

    /// The air at `alt_amsl_m`, valid in the troposphere (to 11 km).
    pub fn at(&self, alt_amsl_m: f64) -> Air {
        let temperature_k =
            self.reference.temperature_k + LAPSE_RATE_K_M * (alt_amsl_m - self.reference_amsl_m);
        // Hydrostatic balance with a constant lapse rate β: p = p0 (T/T0)^(−g/Rβ) (ISO 2533, 2.7).
        let ratio = temperature_k / self.reference.temperature_k;
        let exponent = -STANDARD_GRAVITY_M_S2 / (GAS_CONSTANT_AIR_J_KG_K * LAPSE_RATE_K_M);
        Air {
            temperature_k,
            pressure_pa: self.reference.pressure_pa * ratio.powf(exponent),
        }
    }

    /// The altitude above mean sea level at which the pressure is `pressure_pa`, m: the inverse of [`at`](Self::at),
    /// valid in the troposphere.
    pub fn altitude_of_amsl_m(&self, pressure_pa: f64) -> f64 {
        let exponent = -GAS_CONSTANT_AIR_J_KG_K * LAPSE_RATE_K_M / STANDARD_GRAVITY_M_S2;
        let ratio = (pressure_pa / self.reference.pressure_pa).powf(exponent);
        self.reference_amsl_m + self.reference.temperature_k * (ratio - 1.0) / LAPSE_RATE_K_M
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // ISO 2533:1975 table: geopotential altitude, K, hPa, kg/m³.
    #[test]
    fn table_of_iso_2533() {
        for (alt, t, p, rho) in [
            (0.0, 288.15, 1013.25, 1.225),
            (1000.0, 281.65, 898.746, 1.111_64),
            (5000.0, 255.65, 540.199, 0.736_116),
            (11_000.0, 216.65, 226.320, 0.363_918),
        ] {
            let air = Atmosphere::standard().at(alt);
            assert!((air.temperature_k - t).abs() < 1e-9);
            assert!((air.pressure_pa / 100.0 / p - 1.0).abs() < 1e-5);
            assert!((air.density_kg_m3() / rho - 1.0).abs() < 1e-5);
            // The table's pressures have six digits: half a unit of the last is at most 0.05 m.
            let back = Atmosphere::standard().altitude_of_amsl_m(p * 100.0);
            assert!((back - alt).abs() < 0.06, "{p} hPa: {back} m");
        }
    }

    #[test]
    fn passes_through_the_reported_point() {
        let air = Atmosphere::through(340.0, 12.0, 970.0).unwrap().at(340.0);
        assert!((air.temperature_k - 285.15).abs() < 1e-9);
        assert!((air.pressure_pa - 97_000.0).abs() < 1e-6);
    }

    #[test]
    fn refuses_kelvin_and_pascal() {
        assert!(Atmosphere::through(0.0, 288.15, 1013.25).is_err());
        assert!(Atmosphere::through(0.0, 15.0, 101_325.0).is_err());
    }
}
