//! What is known of the logs of certain instruments, as mapping files.

use crate::ImportError;
use crate::map::{LogMap, Map, Names};
use crate::recognise::Header;

/// An instrument's or program's log.
#[derive(Debug, Clone, Copy)]
pub struct Preset {
    /// Its name for `--as`.
    pub name: &'static str,
    /// What it is, in words.
    pub what: &'static str,
    /// Sets of columns by which its versions are recognised: a log has all columns of one set, in the same case.
    has: &'static [&'static [&'static str]],
    /// Text with which it begins, if that tells it.
    begins: &'static str,
    /// Sets of time columns of its versions: the first set that a log has completely counts.
    times: &'static [&'static [&'static str]],
    /// What is stated of it: the table of a log in a mapping file.
    states: &'static str,
}

/// All presets. Their headers are those of the instruments' manuals and of public logs.
pub static PRESETS: [Preset; 10] = [
    Preset {
        name: "airdata",
        what: "a DJI flight by AirData UAV",
        has: &[&["time(millisecond)", "datetime(utc)"]],
        begins: "",
        times: &[&["datetime(utc)"]],
        states: "zone = \"UTC\"\n",
    },
    Preset {
        name: "dji",
        what: "a DJI flight record as CSV",
        has: &[&["OSD.latitude", "OSD.longitude"]],
        begins: "",
        times: &[&["CUSTOM.date [local]", "CUSTOM.updateTime [local]"]],
        // Dates are in the order of the computer's language: the cells or the user tell it.
        states: "",
    },
    Preset {
        name: "datcon",
        what: "a DJI aircraft's log (.DAT) as CSV by DatCon or CsvView",
        // Versions 3 and 4 of the format (datfile.net, *V3 .CSV column format*), with or without units.
        has: &[
            &["Clock:offsetTime", "IMU_ATTI(0):roll"],
            &["Clock:offsetTime", "GPS:Long"],
            &["Clock:offsetTime", "GPS(0):Long"],
            &["Clock:offsetTime", "IMU_ATTI(0):Longitude"],
            &["offsetTime", "GPS(0):Long"],
            &["offsetTime", "GPS(0):Long[degrees]"],
            &["offsetTime", "IMU_ATTI(0):Longitude"],
            &["offsetTime", "IMU_ATTI(0):Longitude[degrees [-180;180]]"],
        ],
        begins: "",
        times: &[
            &["GPS:dateTimeStamp"],
            &["GPS(0):dateTimeStamp"],
            &["GPS:Date", "GPS:Time"],
            &["GPS(0):Date", "GPS(0):Time"],
            &["Clock:offsetTime"],
            &["offsetTime"],
        ],
        // Zeros stand for an unknown position. The IMU's temperatures are not those of the air.
        states: "zone = \"UTC\"
time_unit = \"s\"
[column.lat_deg]
from = [\"GPS:Lat\", \"GPS(0):Lat\", \"GPS(0):Lat[degrees]\", \"IMU_ATTI(0):Latitude\", \"IMU_ATTI(0):Latitude[degrees [-180;180]]\"]
unit = \"deg\"
missing = [\"0\", \"0.0\"]
[column.lon_deg]
from = [\"GPS:Long\", \"GPS(0):Long\", \"GPS(0):Long[degrees]\", \"IMU_ATTI(0):Longitude\", \"IMU_ATTI(0):Longitude[degrees [-180;180]]\"]
unit = \"deg\"
missing = [\"0\", \"0.0\"]
[column.alt_amsl_m]
from = [\"GPS:heightMSL\", \"GPS(0):heightMSL\", \"GPS(0):heightMSL[meters]\", \"General:absoluteHeight\", \"General:absoluteHeight[meters]\"]
unit = \"m\"
[column.roll_deg]
from = [\"IMU_ATTI(0):roll\", \"IMU_ATTI(0):roll:C\", \"IMU_ATTI(0):roll[degrees [-180;180]]\"]
unit = \"deg\"
[column.pitch_deg]
from = [\"IMU_ATTI(0):pitch\", \"IMU_ATTI(0):pitch:C\", \"IMU_ATTI(0):pitch[degrees [-180;180]]\"]
unit = \"deg\"
[column.yaw_deg]
from = [\"IMU_ATTI(0):yaw\", \"IMU_ATTI(0):yaw:C\", \"IMU_ATTI(0):yaw[degrees [-180;180]]\"]
unit = \"deg\"
[column.vel_north_m_s]
from = [\"IMU_ATTI(0):velN\", \"IMU_ATTI(0):velN[meters/Sec]\"]
unit = \"m/s\"
[column.vel_east_m_s]
from = [\"IMU_ATTI(0):velE\", \"IMU_ATTI(0):velE[meters/Sec]\"]
unit = \"m/s\"
[column.vel_down_m_s]
from = [\"IMU_ATTI(0):velD\", \"IMU_ATTI(0):velD[meters/Sec]\"]
unit = \"m/s\"
",
    },
    Preset {
        name: "sniffer4d",
        what: "a gas log of Sniffer4D Mapper",
        has: &[],
        begins: "#Created by: Sniffer4DMapper",
        times: &[],
        states: "",
    },
    Preset {
        name: "picarro",
        what: "a Picarro analyser's log",
        has: &[&["ALARM_STATUS", "INST_STATUS", "CavityPressure"]],
        begins: "",
        times: &[&["EPOCH_TIME"]],
        states: "[column.lat_deg]
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
        has: &[&["SECONDS", "NANOSECONDS", "DIAG"]],
        begins: "",
        times: &[&["SECONDS", "NANOSECONDS"]],
        states: "[column.pressure_hpa]\nskip = true\n",
    },
    Preset {
        name: "licor-850",
        what: "a LI-COR LI-830 or LI-850 analyser's log",
        has: &[&["System_Date_(Y-M-D)", "System_Time_(h:m:s)"]],
        begins: "",
        times: &[&["System_Date_(Y-M-D)", "System_Time_(h:m:s)"]],
        states: "",
    },
    Preset {
        name: "aeris",
        what: "an Aeris MIRA analyser's log",
        has: &[&["Time Stamp", "Inlet Number"]],
        begins: "",
        times: &[&["Time Stamp"]],
        // The stamps are MM/DD/YYYY hh:mm:ss.sss.
        states: "date_order = \"mdy\"\n",
    },
    Preset {
        name: "ndbc",
        what: "standard meteorological data of the National Data Buoy Center",
        has: &[&["YY", "MM", "DD", "hh", "WDIR", "WSPD"]],
        begins: "",
        times: &[&["YY", "MM", "DD", "hh", "mm"]],
        // ndbc.noaa.gov, Measurement Descriptions: MM, or nines, for none.
        states: "zone = \"UTC\"
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
        has: &[&["TIMESTAMP", "RECORD"]],
        begins: "",
        times: &[&["TIMESTAMP"]],
        states: "",
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
        PRESETS.iter().find(|p| {
            let by_columns = p.has.iter().any(|names| are_there(names, headers));
            by_columns || (!p.begins.is_empty() && head.starts_with(p.begins.as_bytes()))
        })
    }

    /// The time columns of a log with these headers; none where its version has other ones.
    pub fn time(&self, headers: &[Header]) -> Option<Names> {
        let mut times = self.times.iter();
        let there = times.find(|names| are_there(names, headers))?;
        Some(match there {
            [one] => Names::One((*one).to_owned()),
            many => Names::Many(many.iter().map(|n| (*n).to_owned()).collect()),
        })
    }

    /// The preset as a mapping; `time` lists the columns of all versions.
    ///
    /// # Errors
    /// A table that is none, which the tests exclude.
    pub fn states(&self) -> Result<LogMap, ImportError> {
        let text = self.states.replace("[column.", "[log.column.");
        let map = Map::parse(self.name, &format!("[[log]]\n{text}"))?;
        let names = self.times.concat();
        let time = names.iter().map(|n| (*n).to_owned()).collect();
        Ok(LogMap {
            time: (!names.is_empty()).then_some(Names::Many(time)),
            ..map.log.into_iter().next().unwrap_or_default()
        })
    }
}

/// Whether all of `names` are among `headers`.
fn are_there(names: &[&str], headers: &[Header]) -> bool {
    let is_there = |name: &&str| headers.iter().any(|h| h.is(name));
    names.iter().all(is_there)
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
