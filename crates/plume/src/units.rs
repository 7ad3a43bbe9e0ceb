//! Gases, and mass per volume against mole fraction.

use air::isa::Air;

/// A gas that a source emits and a sensor reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Gas {
    /// Carbon dioxide.
    Co2,
    /// Sulphur dioxide.
    So2,
    /// Methane.
    Ch4,
    /// Carbon monoxide.
    Co,
    /// Nitrogen dioxide.
    No2,
    /// Ammonia.
    Nh3,
    /// Sulphur hexafluoride.
    Sf6,
}

impl Gas {
    /// All gases known.
    pub const ALL: [Gas; 7] = [
        Gas::Co2,
        Gas::So2,
        Gas::Ch4,
        Gas::Co,
        Gas::No2,
        Gas::Nh3,
        Gas::Sf6,
    ];

    /// Name in scenario files: "co2", "so2" and so on.
    pub fn as_str(self) -> &'static str {
        match self {
            Gas::Co2 => "co2",
            Gas::So2 => "so2",
            Gas::Ch4 => "ch4",
            Gas::Co => "co",
            Gas::No2 => "no2",
            Gas::Nh3 => "nh3",
            Gas::Sf6 => "sf6",
        }
    }

    /// The gas of a name, either case.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|gas| gas.as_str().eq_ignore_ascii_case(name.trim()))
    }

    /// Molar mass, kg/mol (IUPAC 2021 abridged atomic weights).
    pub fn molar_mass_kg_mol(self) -> f64 {
        match self {
            Gas::Co2 => 0.044_009,
            Gas::So2 => 0.064_058,
            Gas::Ch4 => 0.016_043,
            Gas::Co => 0.028_010,
            Gas::No2 => 0.046_005,
            Gas::Nh3 => 0.017_031,
            Gas::Sf6 => 0.146_050,
        }
    }

    /// Mole fraction in ppm of `mass_kg_m3` of this gas in `air`.
    pub fn ppm(self, mass_kg_m3: f64, air: Air) -> f64 {
        mass_kg_m3 * self.ppm_per_kg_m3(air)
    }

    /// Mass per volume in kg/m³ of a mole fraction of `ppm` in `air`.
    pub fn kg_m3(self, ppm: f64, air: Air) -> f64 {
        ppm / self.ppm_per_kg_m3(air)
    }

    /// ppm per kg/m³ in `air`, by the ideal gas law.
    pub fn ppm_per_kg_m3(self, air: Air) -> f64 {
        1e6 / (self.molar_mass_kg_mol() * air.molar_density_mol_m3())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // 1 ppm of SO2 at 25 °C and 1013.25 hPa is 2.62 mg/m³, of CO2 1.80 mg/m³ (US EPA
    // conversion: mg/m³ = ppm M / 24.45).
    #[test]
    fn textbook_conversion() {
        let air = Air {
            temperature_k: 298.15,
            pressure_pa: 101_325.0,
        };
        for (gas, mg) in [(Gas::So2, 2.62), (Gas::Co2, 1.80), (Gas::Ch4, 0.656)] {
            let kg = gas.kg_m3(1.0, air);
            assert!((kg * 1e6 / mg - 1.0).abs() < 3e-3, "{gas:?} {kg}");
            assert!((gas.ppm(kg, air) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn names() {
        for gas in Gas::ALL {
            assert_eq!(Gas::from_name(gas.as_str()), Some(gas));
        }
        assert_eq!(Gas::from_name("CO2"), Some(Gas::Co2));
        assert_eq!(Gas::from_name("xenon"), None);
    }
}
