//! Which topics of a recording belong to one platform.
//!
//! A recording may hold several receivers: vehicles, a base station, a receiver before and after a filter. Messages
//! are told apart by their topics, never by their type alone. Topics with the same first name (`/uav/fix`,
//! `/uav/co2`) are of one platform.

use crate::ImportError;
use crate::height::Datum;
use crate::logs::series_log::{SeriesLog, is_gas, known_column};
use crate::map::LogMap;
use crate::series::Series;
use std::collections::{BTreeMap, BTreeSet};

/// Messages of known meaning: type, field, column, unit; the message definitions of `sensor_msgs` state the units.
const SCALARS: [(&str, &str, &str, &str); 3] = [
    ("Temperature", "temperature", "temperature_c", "C"),
    (
        "RelativeHumidity",
        "relative_humidity",
        "relative_humidity_pct",
        "share",
    ),
    ("FluidPressure", "fluid_pressure", "pressure_hpa", "Pa"),
];
/// The type of positions.
pub(super) const FIX: &str = "NavSatFix";
/// Words in a topic's name of what is not the state of the air: MAVROS publishes the differential pressure of the
/// airspeed sensor and the temperature of the inertial sensor by the same types.
const NOT_AIR: [&str; 8] = [
    "diff",
    "differential",
    "imu",
    "battery",
    "cpu",
    "board",
    "motor",
    "esc",
];
/// A word in the name of a position that a filter has not seen (MAVROS: `global_position/raw/fix`).
const RAW: &str = "raw";

/// Whether a series of a topic of type `kind` has a known meaning.
pub(super) fn is_known(kind: &str, field: &str) -> bool {
    let of_fix = kind == FIX && ["latitude", "longitude", "altitude"].contains(&field);
    of_fix || SCALARS.iter().any(|(k, f, ..)| *k == kind && *f == field)
}

/// The first name of a topic: of `/uav/fix` it is `uav`.
fn group(topic: &str) -> &str {
    let names = topic.trim_start_matches('/');
    names.split(['/', '.']).next().unwrap_or(names)
}

fn words(topic: &str) -> impl Iterator<Item = &str> {
    topic.split(|c: char| !c.is_ascii_alphanumeric())
}

/// All series of a recording, with the types of its topics.
pub(super) struct Recorded<'a> {
    /// Name of the file.
    pub name: &'a str,
    /// The series.
    pub series: Vec<Series>,
    /// Type of each topic.
    pub kinds: &'a BTreeMap<String, String>,
    /// What was found, in words.
    pub notices: Vec<String>,
}

impl Recorded<'_> {
    fn has(&self, series: &str) -> bool {
        self.series.iter().any(|s| s.name == series)
    }

    /// Topics of the type `kind` that gave a series of `field`.
    fn topics(&self, kind: &str, field: &str) -> Vec<&str> {
        let of_kind = self.kinds.iter().filter(|(_, k)| *k == kind);
        of_kind
            .map(|(topic, _)| topic.as_str())
            .filter(|topic| self.has(&format!("{topic}.{field}")))
            .collect()
    }

    /// One log for each platform; `stated` is the series of the latitude that a mapping file names.
    ///
    /// # Errors
    /// Several positions, of which the gas has to be at one.
    pub(super) fn platforms(self, stated: Option<&str>) -> Result<Vec<SeriesLog>, ImportError> {
        let stated = stated.and_then(|s| s.strip_suffix(".latitude"));
        let fixes = match stated {
            Some(topic) => vec![topic],
            None => self.topics(FIX, "latitude"),
        };
        let mut of_group: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for fix in &fixes {
            of_group.entry(group(fix)).or_default().push(fix);
        }
        for alike in of_group.values_mut() {
            let filtered = |t: &&str| words(t).all(|w| w != RAW);
            if alike.iter().any(filtered) {
                alike.retain(filtered);
            }
        }
        let chosen: Vec<&str> = of_group.values().flatten().copied().collect();
        let gases = self.series.iter().filter(|s| is_gas(&s.name));
        let gas_groups: BTreeSet<&str> = gases.map(|s| group(&s.name)).collect();
        let one_a_group = of_group.values().all(|topics| topics.len() == 1);
        let groups: Vec<&str> = match chosen.len() {
            0 | 1 => Vec::new(),
            _ if one_a_group
                && !gas_groups.is_empty()
                && gas_groups.iter().all(|g| of_group.contains_key(g)) =>
            {
                gas_groups.into_iter().collect()
            }
            _ => return Err(self.ambiguous(&chosen)),
        };
        if groups.is_empty() {
            let log = self.of_platform(None, chosen.first().copied(), &fixes);
            return Ok(vec![log]);
        }
        let of = |group: &&str| self.of_platform(Some(group), Some(of_group[*group][0]), &fixes);
        Ok(groups.iter().map(of).collect())
    }

    fn ambiguous(&self, fixes: &[&str]) -> ImportError {
        ImportError::log(
            self.name,
            format!(
                "positions of several receivers ({}), and no gas beside one of them",
                fixes.join(", ")
            ),
            format!(
                "state the receiver at the gas sensor in a mapping file (--map): [[log]] and below it \
                 [log.column.lat_deg] with from = \"{}.latitude\"",
                fixes.first().copied().unwrap_or("/fix")
            ),
        )
    }

    /// The log of the platform whose topics begin with `own`, or of all topics, at the position of `fix`.
    fn of_platform(&self, own: Option<&str>, fix: Option<&str>, fixes: &[&str]) -> SeriesLog {
        let of_others = |name: &str| {
            own.is_some_and(|own| {
                let its = group(name);
                its != own && fixes.iter().any(|f| group(f) == its)
            })
        };
        let mut notices = self.notices.clone();
        let mut known = LogMap::default();
        let mut add = |column: &str, series: String, unit: &str, datum: Option<Datum>| {
            if self.has(&series) {
                let stated = known_column(vec![series], unit, datum);
                known.column.insert(column.to_owned(), stated);
            }
        };
        if let Some(fix) = fix {
            add("lat_deg", format!("{fix}.latitude"), "deg", None);
            add("lon_deg", format!("{fix}.longitude"), "deg", None);
            // The message's altitude is above the ellipsoid (sensor_msgs/NavSatFix).
            let datum = Some(Datum::Ellipsoid);
            add("alt_amsl_m", format!("{fix}.altitude"), "m", datum);
            let others: Vec<&str> = fixes.iter().copied().filter(|f| *f != fix).collect();
            if !others.is_empty() {
                notices.push(format!(
                    "the position is of {fix}, not of {}",
                    others.join(", ")
                ));
            }
        }
        for (kind, field, column, unit) in SCALARS {
            let is_air = |t: &&str| !of_others(t) && words(t).all(|w| !NOT_AIR.contains(&w));
            let topics: Vec<&str> = self
                .topics(kind, field)
                .into_iter()
                .filter(is_air)
                .collect();
            match topics[..] {
                [] => {}
                [topic] => add(column, format!("{topic}.{field}"), unit, None),
                _ => notices.push(format!(
                    "{column} is not used: {} have it (state one as from = \"{}.{field}\")",
                    topics.join(", "),
                    topics[0]
                )),
            }
        }
        let series = self.series.iter().filter(|s| !of_others(&s.name));
        SeriesLog {
            kind: "a recording of ROS 2",
            series: series.cloned().collect(),
            is_absolute: true,
            notices,
            platform: own.map(str::to_owned),
            known,
        }
    }
}
