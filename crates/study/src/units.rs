//! The units in which people state an emission rate.

use air::isa::GAS_CONSTANT_J_MOL_K;
use plume::Gas;

/// Seconds of an hour and of a Julian year, which is that of annual inventories to 0.01 %.
const HOUR_S: f64 = 3600.0;
const YEAR_S: f64 = 365.25 * 86_400.0;
/// Standard conditions of the gas industry in the United States: 60 °F and 14.696 psi.
const STANDARD_K: f64 = 288.706;
const STANDARD_PA: f64 = 101_325.0;
const CUBIC_FOOT_M3: f64 = 0.028_316_85;

/// A unit of emission rates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RateUnit {
    /// Grams per second.
    GramPerSecond,
    /// Kilograms per hour.
    KilogramPerHour,
    /// Tonnes per year.
    TonnePerYear,
    /// Standard cubic feet per hour.
    Scfh,
}

impl RateUnit {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::GramPerSecond,
        Self::KilogramPerHour,
        Self::TonnePerYear,
        Self::Scfh,
    ];

    /// Its symbol.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::GramPerSecond => "g/s",
            Self::KilogramPerHour => "kg/h",
            Self::TonnePerYear => "t/a",
            Self::Scfh => "scfh",
        }
    }

    /// A rate of `gas` in kg/s in this unit.
    pub fn of_kg_s(self, kg_s: f64, gas: Gas) -> f64 {
        match self {
            Self::GramPerSecond => 1e3 * kg_s,
            Self::KilogramPerHour => HOUR_S * kg_s,
            Self::TonnePerYear => 1e-3 * YEAR_S * kg_s,
            Self::Scfh => {
                let mol_s = kg_s / gas.molar_mass_kg_mol();
                HOUR_S * mol_s * GAS_CONSTANT_J_MOL_K * STANDARD_K / STANDARD_PA / CUBIC_FOOT_M3
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1 scf of methane is 19.18 g (40 CFR 98.233: 0.0192 kg/scf).
    #[test]
    fn methane_in_standard_cubic_feet() {
        let scfh = RateUnit::Scfh.of_kg_s(0.0192 / 3600.0, Gas::Ch4);
        assert!((scfh - 1.0).abs() < 2e-3, "{scfh}");
        assert!((RateUnit::TonnePerYear.of_kg_s(1.0, Gas::Ch4) - 31_557.6).abs() < 1e-6);
        assert!((RateUnit::KilogramPerHour.of_kg_s(6e-4, Gas::Ch4) - 2.16).abs() < 1e-12);
    }
}
