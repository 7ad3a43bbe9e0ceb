//! What is known of the logs of certain instruments, as mapping files.

use crate::ImportError;
use crate::map::{LogMap, Map};
use crate::recognise::Header;

/// An instrument's or program's log.
#[derive(Debug, Clone, Copy)]
pub struct Preset {
    /// Its name for `--as`.
    pub name: &'static str,
    /// What it is, in words.
    pub what: &'static str,
    /// Columns by which it is recognised: it has all of them, in these letters.
    has: &'static [&'static str],
    /// Text with which it begins, if that tells it.
    begins: &'static str,
    /// What is stated of it: the table of a log in a mapping file.
    states: &'static str,
}

/// All presets. Their headers are those of the instruments' manuals and of public logs.
pub static PRESETS: [Preset; 9] = [
    Preset {
        name: "airdata",
        what: "a DJI flight by AirData UAV",
        has: &["time(millisecond)", "datetime(utc)"],
        begins: "",
        states: "time = \"datetime(utc)\"\nzone = \"UTC\"\n",
    },
    Preset {
        name: "dji",
        what: "a DJI flight record as CSV",
        has: &["OSD.latitude", "OSD.longitude"],
        begins: "",
        // Dates are in the order of the computer's language: the cells or the user tell it.
        states: "time = [\"CUSTOM.date [local]\", \"CUSTOM.updateTime [local]\"]\n",
    },
    Preset {
        name: "sniffer4d",
        what: "a gas log of Sniffer4D Mapper",
        has: &[],
        begins: "#Created by: Sniffer4DMapper",
        states: "",
    },
    Preset {
        name: "picarro",
        what: "a Picarro analyser's log",
        has: &["ALARM_STATUS", "INST_STATUS", "CavityPressure"],
        begins: "",
        states: "time = \"EPOCH_TIME\"
[column.lat_deg]
from = [\"GPS_ABS_LAT\"]
unit = \"deg\"
[column.lon_deg]
from = [\"GPS_ABS_LONG\"]
unit = \"deg\"
[column.co2_ppm]
from = [\"CO2_dry_sync\", \"CO2_dry\", \"CO2_sync\", \"CO2\"]
unit = \"ppm\"
[column.ch4_ppm]
from = [\"CH4_dry_sync\", \"CH4_dry\", \"CH4_sync\", \"CH4\", \"HP_12CH4_dry\", \"HP_12CH4\", \"12CH4_dry\"]
unit = \"ppm\"
[column.co_ppm]
from = [\"CO_dry_sync\", \"CO_dry\", \"CO_sync\", \"CO\"]
unit = \"ppm\"
[column.nh3_ppb]
from = [\"NH3_dry\", \"NH3_sync\", \"NH3\"]
unit = \"ppb\"
[column.h2s_ppb]
from = [\"H2S_dry\", \"H2S\"]
unit = \"ppb\"
",
    },
    Preset {
        name: "licor-7810",
        what: "a LI-COR trace gas analyser's .data file (LI-7810, LI-7815, LI-7820)",
        has: &["SECONDS", "NANOSECONDS", "DIAG"],
        begins: "",
        states: "time = [\"SECONDS\", \"NANOSECONDS\"]\n[column.pressure_hpa]\nskip = true\n",
    },
    Preset {
        name: "licor-850",
        what: "a LI-COR LI-830 or LI-850 analyser's log",
        has: &["System_Date_(Y-M-D)", "System_Time_(h:m:s)"],
        begins: "",
        states: "time = [\"System_Date_(Y-M-D)\", \"System_Time_(h:m:s)\"]\n",
    },
    Preset {
        name: "aeris",
        what: "an Aeris MIRA analyser's log",
        has: &["Time Stamp", "Inlet Number"],
        begins: "",
        // The stamps are MM/DD/YYYY hh:mm:ss.sss.
        states: "time = \"Time Stamp\"\ndate_order = \"mdy\"\n",
    },
    Preset {
        name: "ndbc",
        what: "standard meteorological data of the National Data Buoy Center",
        has: &["YY", "MM", "DD", "hh", "WDIR", "WSPD"],
        begins: "",
        // ndbc.noaa.gov, Measurement Descriptions: MM, or nines, for none.
        states: "time = [\"YY\", \"MM\", \"DD\", \"hh\", \"mm\"]
zone = \"UTC\"
[column.wind_from_deg]
from = [\"WDIR\"]
unit = \"deg\"
missing = [\"999\"]
[column.wind_speed_m_s]
from = [\"WSPD\"]
unit = \"m/s\"
missing = [\"99.0\"]
[column.pressure_hpa]
from = [\"PRES\", \"BAR\"]
unit = \"hPa\"
missing = [\"9999.0\"]
[column.temperature_c]
from = [\"ATMP\"]
unit = \"C\"
missing = [\"999.0\", \"99.0\"]
",
    },
    Preset {
        name: "toa5",
        what: "a Campbell Scientific TOA5 table",
        has: &["TIMESTAMP", "RECORD"],
        begins: "",
        states: "time = \"TIMESTAMP\"\n",
    },
];

impl Preset {
    /// The preset of this name.
    ///
    /// # Errors
    /// There is none; the message names all.
    pub fn named(name: &str) -> Result<&'static Self, String> {
        let names: Vec<&str> = PRESETS.iter().map(|p| p.name).collect();
        let found = PRESETS.iter().find(|p| p.name == name);
        found.ok_or_else(|| format!("preset \"{name}\": expected one of {}", names.join(", ")))
    }

    /// The preset that a log with these columns and this beginning has, if there is one.
    pub fn of(headers: &[Header], head: &[u8]) -> Option<&'static Self> {
        let has = |name: &&&str| headers.iter().any(|h| h.is(name));
        PRESETS.iter().find(|p| {
            let by_columns = !p.has.is_empty() && p.has.iter().all(|n| has(&n));
            by_columns || (!p.begins.is_empty() && head.starts_with(p.begins.as_bytes()))
        })
    }

    /// What it states.
    ///
    /// # Errors
    /// A table that is none, which the tests exclude.
    pub fn states(&self) -> Result<LogMap, ImportError> {
        let text = self.states.replace("[column.", "[log.column.");
        let map = Map::parse(self.name, &format!("[[log]]\n{text}"))?;
        Ok(map.log.into_iter().next().unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_presets_are_mappings() {
        for preset in &PRESETS {
            assert!(preset.states().is_ok(), "{}", preset.name);
            assert!(std::ptr::eq(Preset::named(preset.name).unwrap(), preset));
        }
        assert!(
            Preset::named("x")
                .unwrap_err()
                .contains("picarro, licor-7810")
        );
    }
}
