//! Gases, the units of their mole fractions, and mass per volume against mole fraction.

use air::isa::Air;

/// A gas that a source emits and a sensor reads.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    serde::Serialize,
    serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Gas {
    /// Carbon dioxide.
    #[default]
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
    /// Hydrogen sulphide.
    H2s,
    /// Sulphur hexafluoride.
    Sf6,
}

/// What is known of a gas.
struct Facts {
    name: &'static str,
    formula: &'static str,
    columns: [&'static str; 2],
    species: &'static str,
    digits: usize,
    molar_mass_kg_mol: f64,
}

impl Gas {
    /// All gases known.
    pub const ALL: [Gas; 8] = [
        Gas::Co2,
        Gas::So2,
        Gas::Ch4,
        Gas::Co,
        Gas::No2,
        Gas::Nh3,
        Gas::H2s,
        Gas::Sf6,
    ];

    const fn facts(self) -> Facts {
        let (name, formula, columns, species, digits, molar_mass_kg_mol) = match self {
            Gas::Co2 => (
                "co2",
                "CO2",
                ["co2_ppm", "co2_ppb"],
                "carbon_dioxide",
                0,
                0.044_009,
            ),
            Gas::So2 => (
                "so2",
                "SO2",
                ["so2_ppm", "so2_ppb"],
                "sulfur_dioxide",
                3,
                0.064_058,
            ),
            Gas::Ch4 => (
                "ch4",
                "CH4",
                ["ch4_ppm", "ch4_ppb"],
                "methane",
                3,
                0.016_043,
            ),
            Gas::Co => (
                "co",
                "CO",
                ["co_ppm", "co_ppb"],
                "carbon_monoxide",
                3,
                0.028_010,
            ),
            Gas::No2 => (
                "no2",
                "NO2",
                ["no2_ppm", "no2_ppb"],
                "nitrogen_dioxide",
                3,
                0.046_005,
            ),
            Gas::Nh3 => (
                "nh3",
                "NH3",
                ["nh3_ppm", "nh3_ppb"],
                "ammonia",
                3,
                0.017_031,
            ),
            Gas::H2s => (
                "h2s",
                "H2S",
                ["h2s_ppm", "h2s_ppb"],
                "hydrogen_sulfide",
                4,
                0.034_076,
            ),
            Gas::Sf6 => (
                "sf6",
                "SF6",
                ["sf6_ppm", "sf6_ppb"],
                "sulfur_hexafluoride",
                6,
                0.146_050,
            ),
        };
        Facts {
            name,
            formula,
            columns,
            species,
            digits,
            molar_mass_kg_mol,
        }
    }

    /// Name in scenario files: "co2", "so2" and so on.
    pub const fn as_str(self) -> &'static str {
        self.facts().name
    }

    /// The gas of a name, either case.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|gas| gas.as_str().eq_ignore_ascii_case(name.trim()))
    }

    /// Formula: "CO2", "CH4" and so on. Its name in MAVLink too.
    pub const fn formula(self) -> &'static str {
        self.facts().formula
    }

    /// Standard name of its mole fraction (CF conventions): "mole_fraction_of_methane_in_air".
    pub fn standard_name(self) -> String {
        format!("mole_fraction_of_{}_in_air", self.facts().species)
    }

    /// Name of the column, or of the key, of its mole fraction in a unit: "ch4_ppb".
    pub const fn column(self, unit: Unit) -> &'static str {
        let [ppm, ppb] = self.facts().columns;
        match unit {
            Unit::Ppm => ppm,
            Unit::Ppb => ppb,
        }
    }

    /// The gas and unit whose [`Gas::column`] is `name`.
    pub fn of_column(name: &str) -> Option<(Self, Unit)> {
        let all = Self::ALL.into_iter();
        all.flat_map(|gas| Unit::ALL.map(|unit| (gas, unit)))
            .find(|(gas, unit)| gas.column(*unit) == name)
    }

    /// Digits after the point with which a mole fraction of it in ppm is shown: as many as its usual
    /// sensors tell apart, and its air holds, so that 2.034 ppm of methane are not "2".
    pub const fn digits(self) -> usize {
        self.facts().digits
    }

    /// Molar mass, kg/mol (IUPAC 2021 abridged atomic weights).
    pub const fn molar_mass_kg_mol(self) -> f64 {
        self.facts().molar_mass_kg_mol
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

impl std::str::FromStr for Gas {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = || Self::ALL.map(Self::as_str).join(", ");
        Self::from_name(name).ok_or_else(|| format!("expected one of {}", known()))
    }
}

/// A unit of mole fractions in files. Inside they are in ppm.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Unit {
    /// Parts per million.
    #[default]
    Ppm,
    /// Parts per billion, 1e-9.
    Ppb,
}

impl Unit {
    /// Both.
    pub const ALL: [Unit; 2] = [Unit::Ppm, Unit::Ppb];

    /// Its name: "ppm" or "ppb".
    pub fn as_str(self) -> &'static str {
        match self {
            Unit::Ppm => "ppm",
            Unit::Ppb => "ppb",
        }
    }

    /// How many of it are a ppm.
    pub fn per_ppm(self) -> f64 {
        match self {
            Unit::Ppm => 1.0,
            Unit::Ppb => 1000.0,
        }
    }

    /// `value` of this unit in ppm.
    pub fn to_ppm(self, value: f64) -> f64 {
        value / self.per_ppm()
    }

    /// `ppm` in this unit.
    pub fn of_ppm(self, ppm: f64) -> f64 {
        ppm * self.per_ppm()
    }

    /// `ppm` in this unit, as a file has it: without the last digit that the change of unit adds.
    pub fn text(self, ppm: f64) -> String {
        match self {
            Unit::Ppm => ppm.to_string(),
            Unit::Ppb => ((self.of_ppm(ppm) * 1e9).round() / 1e9).to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // 1 ppm of SO2 at 25 °C and 1013.25 hPa is 2.62 mg/m³, of CO2 1.80 mg/m³, of CH4 0.656,
    // of H2S 1.39 (US EPA conversion: mg/m³ = ppm M / 24.45).
    #[test]
    fn textbook_conversion() {
        let air = Air {
            temperature_k: 298.15,
            pressure_pa: 101_325.0,
        };
        for (gas, mg) in [
            (Gas::So2, 2.62),
            (Gas::Co2, 1.80),
            (Gas::Ch4, 0.656),
            (Gas::H2s, 1.39),
        ] {
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
        assert!("xenon".parse::<Gas>().unwrap_err().contains("co2, so2"));
    }

    #[test]
    fn columns_say_gas_and_unit() {
        for gas in Gas::ALL {
            for unit in Unit::ALL {
                let column = gas.column(unit);
                assert_eq!(column, format!("{}_{}", gas.as_str(), unit.as_str()));
                assert_eq!(Gas::of_column(column), Some((gas, unit)));
            }
            assert_eq!(gas.formula().to_lowercase(), gas.as_str());
        }
        assert_eq!(Gas::of_column("ch4_ppt"), None);
        // 1950 ppb and 1.95 ppm are one number.
        assert_eq!(Unit::Ppb.to_ppm(1950.0), 1.95);
        assert_eq!(Unit::Ppb.of_ppm(1.95), 1950.0);
        assert_eq!(Unit::Ppb.text(2.034), "2034");
    }
}
