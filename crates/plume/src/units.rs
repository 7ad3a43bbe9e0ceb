//! Gases, the units of their mole fractions, and mass per volume against mole fraction.

use air::isa::Air;
use std::sync::{Mutex, PoisonError};

/// A gas that a source emits and a sensor reads: one of the table, or another with a name and a molar mass of its own.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
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
    /// Nitrous oxide.
    N2o,
    /// Ethane.
    C2h6,
    /// Ethyne (acetylene).
    C2h2,
    /// Hydrogen chloride.
    Hcl,
    /// Hydrogen.
    H2,
    /// A gas that the table does not have.
    Other(OtherGas),
}

/// What is known of a gas.
#[derive(Debug, Clone, Copy)]
struct Facts {
    name: &'static str,
    formula: &'static str,
    columns: [&'static str; 2],
    species: &'static str,
    digits: usize,
    molar_mass_kg_mol: f64,
}

/// A gas of a name that the table does not have. Two of one name are equal.
#[derive(Debug, Clone, Copy)]
pub struct OtherGas {
    names: &'static Names,
    molar_mass_kg_mol: f64,
}

/// The names of a gas that the table does not have.
#[derive(Debug, Clone, Copy)]
struct Names {
    name: &'static str,
    formula: &'static str,
    columns: [&'static str; 2],
}

impl PartialEq for OtherGas {
    fn eq(&self, other: &Self) -> bool {
        self.names.name == other.names.name
    }
}

impl Eq for OtherGas {}

impl PartialOrd for OtherGas {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for OtherGas {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.names.name.cmp(other.names.name)
    }
}

impl std::hash::Hash for OtherGas {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        self.names.name.hash(state);
    }
}

/// Longest name of a gas, so that its column fits into a table and its name into a message.
const LONGEST_NAME: usize = 16;

/// Names that live as long as the program: a gas is copied everywhere and says its name as text. Each is made once.
fn names_of(name: &str) -> &'static Names {
    static KNOWN: Mutex<Vec<&'static Names>> = Mutex::new(Vec::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(names) = known.iter().find(|n| n.name == name) {
        return names;
    }
    let lasting = |text: String| -> &'static str { Box::leak(text.into_boxed_str()) };
    let names: &'static Names = Box::leak(Box::new(Names {
        name: lasting(name.to_owned()),
        formula: lasting(name.to_ascii_uppercase()),
        columns: ["ppm", "ppb"].map(|unit| lasting(format!("{name}_{unit}"))),
    }));
    known.push(names);
    names
}

impl Gas {
    /// The gases of the table.
    pub const ALL: [Gas; 13] = [
        Gas::Co2,
        Gas::So2,
        Gas::Ch4,
        Gas::Co,
        Gas::No2,
        Gas::Nh3,
        Gas::H2s,
        Gas::Sf6,
        Gas::N2o,
        Gas::C2h6,
        Gas::C2h2,
        Gas::Hcl,
        Gas::H2,
    ];

    #[rustfmt::skip]
    const fn facts(self) -> Facts {
        match self {
            Gas::Co2 => facts("co2", "CO2", ["co2_ppm", "co2_ppb"], "carbon_dioxide", 0, 0.044_009),
            Gas::So2 => facts("so2", "SO2", ["so2_ppm", "so2_ppb"], "sulfur_dioxide", 3, 0.064_058),
            Gas::Ch4 => facts("ch4", "CH4", ["ch4_ppm", "ch4_ppb"], "methane", 3, 0.016_043),
            Gas::Co => facts("co", "CO", ["co_ppm", "co_ppb"], "carbon_monoxide", 3, 0.028_010),
            Gas::No2 => facts("no2", "NO2", ["no2_ppm", "no2_ppb"], "nitrogen_dioxide", 3, 0.046_005),
            Gas::Nh3 => facts("nh3", "NH3", ["nh3_ppm", "nh3_ppb"], "ammonia", 3, 0.017_031),
            Gas::H2s => facts("h2s", "H2S", ["h2s_ppm", "h2s_ppb"], "hydrogen_sulfide", 4, 0.034_076),
            Gas::Sf6 => facts("sf6", "SF6", ["sf6_ppm", "sf6_ppb"], "sulfur_hexafluoride", 6, 0.146_050),
            Gas::N2o => facts("n2o", "N2O", ["n2o_ppm", "n2o_ppb"], "nitrous_oxide", 4, 0.044_013),
            Gas::C2h6 => facts("c2h6", "C2H6", ["c2h6_ppm", "c2h6_ppb"], "ethane", 4, 0.030_070),
            Gas::C2h2 => facts("c2h2", "C2H2", ["c2h2_ppm", "c2h2_ppb"], "ethyne", 4, 0.026_038),
            Gas::Hcl => facts("hcl", "HCl", ["hcl_ppm", "hcl_ppb"], "hydrogen_chloride", 4, 0.036_458),
            Gas::H2 => facts("h2", "H2", ["h2_ppm", "h2_ppb"], "molecular_hydrogen", 3, 0.002_016),
            Gas::Other(gas) => gas.facts(),
        }
    }

    /// Name in scenario files: "co2", "so2" and so on.
    pub const fn as_str(self) -> &'static str {
        self.facts().name
    }

    /// The gas of the table that has this name, either case.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|gas| gas.as_str().eq_ignore_ascii_case(name.trim()))
    }

    /// A gas that the table does not have, by its name (1 to 16 letters and digits, a letter first) and its molar mass,
    /// kg/mol. None where the name cannot be one, or is in the table.
    pub fn other(name: &str, molar_mass_kg_mol: f64) -> Option<Self> {
        let name = name.trim().to_ascii_lowercase();
        let is_name = (1..=LONGEST_NAME).contains(&name.len())
            && name.bytes().all(|b| b.is_ascii_alphanumeric())
            && name.starts_with(|c: char| c.is_ascii_alphabetic());
        (is_name && Self::from_name(&name).is_none()).then(|| {
            Self::Other(OtherGas {
                names: names_of(&name),
                molar_mass_kg_mol,
            })
        })
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

    /// The gas of the table and the unit whose [`Gas::column`] is `name`.
    pub fn of_column(name: &str) -> Option<(Self, Unit)> {
        Self::of_column_among(name, &[])
    }

    /// The same of the gases of the table and `others`.
    pub fn of_column_among(name: &str, others: &[Self]) -> Option<(Self, Unit)> {
        let all = Self::ALL.iter().chain(others).copied();
        all.flat_map(|gas| Unit::ALL.map(|unit| (gas, unit)))
            .find(|(gas, unit)| gas.column(*unit) == name)
    }

    /// Digits after the point with which a mole fraction of it in ppm is shown: as many as its usual
    /// sensors tell apart, and its air holds, so that 2.034 ppm of methane are not "2".
    pub const fn digits(self) -> usize {
        self.facts().digits
    }

    /// Molar mass, kg/mol (IUPAC 2021 abridged atomic weights). Not a number of a gas that the table does not have and
    /// whose molar mass nobody has stated.
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

const fn facts(
    name: &'static str,
    formula: &'static str,
    columns: [&'static str; 2],
    species: &'static str,
    digits: usize,
    molar_mass_kg_mol: f64,
) -> Facts {
    Facts {
        name,
        formula,
        columns,
        species,
        digits,
        molar_mass_kg_mol,
    }
}

impl OtherGas {
    /// Digits of a gas of which nothing is known: those of most gases of the table.
    const DIGITS: usize = 4;

    const fn facts(self) -> Facts {
        let Names {
            name,
            formula,
            columns,
        } = *self.names;
        let mass = self.molar_mass_kg_mol;
        facts(name, formula, columns, name, Self::DIGITS, mass)
    }
}

impl std::str::FromStr for Gas {
    type Err = String;

    /// The gas of this name. Its molar mass is not a number where the table does not have it.
    fn from_str(name: &str) -> Result<Self, String> {
        let known = || Self::ALL.map(Self::as_str).join(", ");
        Self::from_name(name)
            .or_else(|| Self::other(name, f64::NAN))
            .ok_or_else(|| {
                format!(
                    "expected one of {}, or another name of 1 to {LONGEST_NAME} letters and digits",
                    known()
                )
            })
    }
}

impl serde::Serialize for Gas {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> serde::Deserialize<'de> for Gas {
    /// As [`str::parse`]: the molar mass of a gas that the table does not have is not in its name.
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = <String as serde::Deserialize>::deserialize(deserializer)?;
        name.parse()
            .map_err(|expected| serde::de::Error::custom(format!("gas \"{name}\": {expected}")))
    }
}

/// Values from here on are written with a power of ten: nobody counts the zeros of 1e300.
const MOST_PLAIN: f64 = 1e9;

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
    pub const fn as_str(self) -> &'static str {
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

    /// `ppm` in this unit, as a file has it: without the last digit that the change of unit adds, and with a power of ten
    /// where it is a billion or more.
    pub fn text(self, ppm: f64) -> String {
        let value = match self {
            Unit::Ppm => ppm,
            Unit::Ppb => (self.of_ppm(ppm) * 1e9).round() / 1e9,
        };
        if value.abs() < MOST_PLAIN {
            value.to_string()
        } else {
            format!("{value:e}")
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
        assert!("x_e".parse::<Gas>().unwrap_err().contains("co2, so2"));
    }

    // Atomic weights 12.011 (C), 1.008 (H), 14.007 (N), 15.999 (O), 35.45 (Cl), IUPAC 2021, abridged.
    #[test]
    fn molar_masses_are_sums_of_atomic_weights() {
        for (gas, g_mol) in [
            (Gas::N2o, 2.0 * 14.007 + 15.999),
            (Gas::C2h6, 2.0 * 12.011 + 6.0 * 1.008),
            (Gas::C2h2, 2.0 * 12.011 + 2.0 * 1.008),
            (Gas::Hcl, 1.008 + 35.45),
            (Gas::H2, 2.0 * 1.008),
        ] {
            assert!(
                (gas.molar_mass_kg_mol() * 1e3 - g_mol).abs() < 1e-9,
                "{gas:?}"
            );
        }
    }

    #[test]
    fn another_gas_is_known_by_its_name() {
        let xenon = Gas::other("Xenon", 0.131_293).unwrap();
        assert_eq!(
            (xenon.as_str(), xenon.formula(), xenon.column(Unit::Ppb)),
            ("xenon", "XENON", "xenon_ppb")
        );
        assert_eq!("xenon".parse::<Gas>(), Ok(xenon));
        assert!("xenon".parse::<Gas>().unwrap().molar_mass_kg_mol().is_nan());
        let air = Air {
            temperature_k: 298.15,
            pressure_pa: 101_325.0,
        };
        // As above: 131.293 / 24.45 = 5.37 mg/m³ in a ppm.
        assert!((xenon.kg_m3(1.0, air) * 1e6 / 5.37 - 1.0).abs() < 3e-3);
        assert_eq!(Gas::of_column("xenon_ppm"), None);
        let found = Gas::of_column_among("xenon_ppm", &[xenon]);
        assert_eq!(found, Some((xenon, Unit::Ppm)));
        for name in ["", "co2", "2f", "a_b", "abcdefghijklmnopq"] {
            assert_eq!(Gas::other(name, 0.1), None, "{name}");
        }
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
