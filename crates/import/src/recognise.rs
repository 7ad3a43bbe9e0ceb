//! What a column's header says: which quantity, in which unit, from which datum.

use crate::height::Datum;
use crate::quantity::{Dimension, Quantity};
use crate::unit::{self, Unit};
use std::borrow::Cow;

/// The place of `name` among `names` that blanks separate.
pub(crate) fn rank_in(names: &str, name: &str) -> Option<usize> {
    names.split_ascii_whitespace().position(|n| n == name)
}

/// Words in headers that say nothing about the quantity.
const NOISE: &str =
    "gps gnss avg mean sync smp value val reading sensor measured current osd filtered";

/// Names of heights by what they are counted from; small letters and digits.
const HEIGHTS: [(Datum, &str); 4] = [
    (
        Datum::Home,
        "height heightabovetakeoff relativealtitude relalt altrel relativeheight heightabovehome \
        altitudeabovetakeoff heightrelative altituderelative relheight generalrelativeheight \
        imuattirelativeheight imuattirelativeheightc 相对高度",
    ),
    (
        Datum::Ground,
        "agl heightagl altagl altitudeagl heightaboveground heightabovegroundatdronelocation \
        altitudeaboveground measurementheight inletheight",
    ),
    (
        Datum::Ellipsoid,
        "hae heightaboveellipsoid ellipsoidalheight ellipsoidheight altellipsoid altitudehae althae \
        altwgs84 altitudewgs84 heightabovereferenceellipsoid heightellipsoid ellipsoidalaltitude \
        altitudeellipsoidal",
    ),
    (
        Datum::PressureAltitude,
        "pressurealtitude pressalt palt barometricaltitude baroaltitude altbaro pressurealt",
    ),
];

/// Names of heights that do not say from what they are counted.
const UNCLEAR_HEIGHTS: &str = "höhe hoehe altitud alt altitude elevation elev ele z";

/// Words beside a height's name that say from what it is counted.
const DATUM_WORDS: [(&str, Datum); 8] = [
    ("asl", Datum::Amsl),
    ("amsl", Datum::Amsl),
    ("msl", Datum::Amsl),
    ("hae", Datum::Ellipsoid),
    ("ellipsoid", Datum::Ellipsoid),
    ("ellipsoidal", Datum::Ellipsoid),
    ("agl", Datum::Ground),
    ("ato", Datum::Home),
];

/// Names of columns with times or dates; small letters and digits.
const TIMES: &str = "gpstime gpsdatetime gpsdate utctime utcdatetime utcdate datetimeutc timeutc millis datum uhrzeit \
    zeit zeitstempel datumuhrzeit fecha hora fechahora heure horodatage time datetime timestamp \
    timedate dateandtime epoch epochtime epochtimestamp unixtime unixtimestamp unix posixtime \
    timeepoch systemtime recordtime samplingtime sampletime logtime secs seconds sec elapsedtime \
    elapsed timesincestart timeelapsed tmstamp measurementtime updatetime customupdatetime \
    customdate date day systemdate hhmmss timeofday ts t clock pctime pcdatetime recordedat \
    createdat isotime datetimestamp flytime offsettime clockoffsettime 采样点时间 时间 采样时间 日期";

/// Names of columns with platforms.
const PLATFORMS: &str = "platform drone vehicle uav station site stationid sensorid instrument";

/// What a header says of its clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Clock {
    /// UTC.
    Utc,
    /// A clock that is so many seconds ahead of UTC.
    Ahead(f64),
    /// Local time of an unstated place.
    Local,
}

/// A header, taken apart.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Header {
    /// As it stands in the log.
    pub text: String,
    words: Vec<String>,
    bracket: Option<String>,
}

impl Header {
    /// Takes a header apart.
    pub fn new(text: &str) -> Self {
        let text = text
            .trim()
            .trim_matches('"')
            .trim_start_matches(['#', '\u{feff}'])
            .trim();
        let without_index = without_index(text);
        let (name, bracket) = split_bracket(&without_index);
        let words = name
            .split(|c: char| !c.is_alphanumeric() && c != '%')
            .filter(|w| !w.is_empty())
            .map(str::to_lowercase)
            .collect();
        Self {
            text: text.to_owned(),
            words,
            bracket: bracket.map(str::to_owned),
        }
    }

    /// The header of a series that is called `topic.field`, of which only gases are recognised: the fields of an
    /// autopilot's log have the names of everything. Other names are headers.
    pub fn of_series(name: &str) -> Self {
        let Some((_, field)) = name.rsplit_once('.') else {
            return Self::new(name);
        };
        let field = Self::new(field);
        let is_gas = |q: &&Quantity| q.is_gas() && field.quantity(q).is_some();
        let is_gas = crate::quantity::OBSERVATION.iter().any(|q| is_gas(&q));
        Self {
            text: name.to_owned(),
            ..if is_gas { field } else { Self::default() }
        }
    }

    /// The quantity's unit if this header names it: the inner none where it names no unit.
    fn names(&self, aliases: &str, dimension: Dimension) -> Option<(usize, Option<Unit>)> {
        let all: Vec<&str> = self.words.iter().map(String::as_str).collect();
        let plain: Vec<&str> = all
            .iter()
            .copied()
            .filter(|w| rank_in(NOISE, w).is_none())
            .collect();
        for words in [all, plain] {
            for tail in 0..=words.len().saturating_sub(1).min(3) {
                let (name, unit) = words.split_at(words.len() - tail);
                let name = name.concat();
                let Some(rank) = rank_in(aliases, &name) else {
                    continue;
                };
                if tail == 0 {
                    let unit = self.bracket.as_deref();
                    return Some((rank, unit.and_then(|u| Unit::parse(dimension, u))));
                }
                let unit = Unit::parse(dimension, &unit.concat())
                    .or_else(|| Unit::parse(dimension, &unit.join("/")));
                if unit.is_some() {
                    return Some((rank, unit));
                }
            }
        }
        None
    }

    /// How well it names `quantity` (0 is best), and in which unit if it says one.
    pub fn quantity(&self, quantity: &Quantity) -> Option<(usize, Option<Unit>)> {
        self.names(quantity.aliases, quantity.dimension)
    }

    /// Which height it names, whether it says from what that is counted, and in which unit if it says one.
    pub fn height(&self) -> Option<(Datum, bool, Option<Unit>)> {
        if let Some((datum, rest)) = self.without_datum() {
            let named = [UNCLEAR_HEIGHTS, HEIGHTS[0].1].join(" ");
            return rest
                .names(&named, Dimension::Length)
                .map(|(_, unit)| (datum, true, unit));
        }
        for (datum, aliases) in HEIGHTS {
            if let Some((_, unit)) = self.names(aliases, Dimension::Length) {
                return Some((datum, true, unit));
            }
        }
        let amsl = Quantity::named("alt_amsl_m")?;
        if let Some((_, unit)) = self.names(UNCLEAR_HEIGHTS, Dimension::Length) {
            return Some((Datum::Amsl, false, unit));
        }
        let (_, unit) = self.quantity(amsl)?;
        Some((Datum::Amsl, true, unit))
    }

    /// The datum that a word of it says, and the header without that word; none where none does, or where the
    /// word is part of a name that is known as a whole.
    fn without_datum(&self) -> Option<(Datum, Self)> {
        let bracket = self.bracket.as_deref().unwrap_or("").to_lowercase();
        let in_bracket = || bracket.split([' ', '_', ',', '.']);
        let (word, datum) = DATUM_WORDS.into_iter().find(|(word, _)| {
            self.words.iter().any(|w| w == word) || in_bracket().any(|w| w == *word)
        })?;
        let mut rest = self.clone();
        rest.words.retain(|w| w != word);
        let unit: Vec<&str> = in_bracket().filter(|w| *w != word).collect();
        rest.bracket = self.bracket.is_some().then(|| unit.concat());
        (!rest.words.is_empty()).then_some((datum, rest))
    }

    /// Whether it is of dry air: `CH4_dry`, `[CH4]d_ppm`.
    pub fn is_dry(&self) -> bool {
        let in_bracket = self.bracket.iter().map(String::as_str);
        let mut words = self.words.iter().map(String::as_str).chain(in_bracket);
        words.any(|w| w == "d" || w.to_lowercase().ends_with("dry"))
    }

    /// Its name as one word of small letters and digits.
    pub fn name(&self) -> String {
        self.words.concat()
    }

    /// What stands in its brackets.
    pub fn bracket(&self) -> Option<&str> {
        self.bracket.as_deref()
    }

    /// The zone that it says as `GMT+01:00`, what its clock is ahead of UTC in seconds, and what stands before that.
    fn zone(&self) -> Option<(f64, &str)> {
        let at = ["GMT", "UTC"].into_iter().find_map(|name| {
            let at = self.text.find(name)?;
            let sign = self.text.as_bytes().get(at + name.len())?;
            b"+-".contains(sign).then_some(at)
        })?;
        let zone = self.text[at..].trim_end_matches([')', ']', ' ']);
        Some((crate::time::zone(zone)?, &self.text[..at]))
    }

    /// Whether it may be a time or date: its rank, unit of time and clock, where it says them.
    pub fn time(&self) -> Option<(usize, Option<Unit>, Option<Clock>)> {
        if let Some((ahead_s, before)) = self.zone() {
            let (rank, unit, _) =
                Self::new(before.trim_end_matches(['(', '[', ' ', ','])).time()?;
            return Some((rank, unit, Some(Clock::Ahead(ahead_s))));
        }
        let mut clock = None;
        let mut rest = self.clone();
        let hints = rest.bracket.iter().map(|b| b.to_lowercase());
        for word in self.words.iter().cloned().chain(hints) {
            match word.as_str() {
                "utc" | "gmt" => clock = Some(Clock::Utc),
                "local" | "lst" | "lt" => clock = Some(Clock::Local),
                _ if word.starts_with("utc") || word.ends_with("utc") => clock = Some(Clock::Utc),
                _ => {}
            }
        }
        rest.words.retain(|w| {
            !["utc", "gmt", "local", "lst", "lt", "iso", "iso8601"].contains(&w.as_str())
        });
        if rest.words.is_empty() && clock.is_some() {
            return Some((usize::MAX, None, clock));
        }
        let (rank, unit) = rest.names(TIMES, Dimension::Duration)?;
        let unit = match rank_in(TIMES, "millis") {
            Some(millis) if millis == rank => Unit::parse(Dimension::Duration, "ms"),
            _ => unit,
        };
        Some((rank, unit, clock))
    }

    /// Whether it names platforms.
    pub fn is_platform(&self) -> bool {
        rank_in(PLATFORMS, &self.words.concat()).is_some()
    }

    /// Whether it says days as the unit of a time.
    pub fn is_in_days(&self) -> bool {
        let bracket = self.bracket.iter().map(String::as_str);
        let mut words = self.words.iter().map(String::as_str).chain(bracket);
        words.any(|w| ["days", "doy", "d"].contains(&w.to_lowercase().as_str()))
    }

    /// Whether this is the column that somebody calls `name`.
    pub fn is(&self, name: &str) -> bool {
        self.text == name.trim()
    }

    /// The same in any case of letters.
    pub fn is_nearly(&self, name: &str) -> bool {
        self.text.to_lowercase() == name.trim().to_lowercase()
    }

    /// Whether something is known of it.
    pub fn is_known(&self) -> bool {
        self.time().is_some()
            || self.height().is_some()
            || crate::quantity::OBSERVATION
                .iter()
                .chain(crate::quantity::FLIGHT.iter())
                .any(|q| self.quantity(q).is_some())
    }
}

/// A header without the sensor's index: `GPS:Lat[degrees]` for `GPS(0):Lat[degrees]`.
fn without_index(text: &str) -> Cow<'_, str> {
    let indexed = text.split_once('(').and_then(|(group, rest)| {
        let (index, name) = rest.split_once("):")?;
        let is_index = !index.is_empty() && index.bytes().all(|b| b.is_ascii_digit());
        is_index.then(|| format!("{group}:{name}"))
    });
    indexed.map_or(Cow::Borrowed(text), Cow::Owned)
}

/// A header's name and what stands in its last brackets, or behind its last space if that is a unit.
fn split_bracket(text: &str) -> (&str, Option<&str>) {
    for (open, close) in [('(', ')'), ('[', ']'), ('{', '}')] {
        if let Some(at) = text.find(open)
            && let Some(length) = text[at..].find(close)
            && at > 0
        {
            // Behind brackets that hold a maker or a place the unit may follow a stroke.
            let behind = text[at + length + close.len_utf8()..].trim();
            let unit = behind.strip_prefix('/').map(str::trim);
            let unit = unit.filter(|u| unit::Unit::is_any(u));
            return (
                &text[..at],
                Some(unit.unwrap_or(&text[at + 1..at + length])),
            );
        }
    }
    if let Some((name, unit)) = text.rsplit_once([' ', ',', '/'])
        && (unit.contains(['/', '°', 'µ', 'μ', '%', '℃']) && unit::Unit::is_any(unit))
    {
        return (name.trim_end_matches([' ', ',']), Some(unit));
    }
    (text, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quantity(header: &str) -> Option<(&'static str, Option<&'static str>)> {
        let header = Header::new(header);
        let mut found = crate::quantity::OBSERVATION.iter().filter_map(|q| {
            let (_, unit) = header.quantity(q)?;
            Some((q.name, unit.map(|u| u.name)))
        });
        found.next()
    }

    // Headers as AirData UAV, Aeris MIRA, LI-COR LI-850 and LI-7810, Picarro, Campbell Scientific, Sniffer4D Mapper
    // and Plumage write them.
    #[test]
    fn headers_of_instruments_are_known() {
        for (header, expected) in [
            ("latitude", Some(("lat_deg", None))),
            (
                "altitude_above_seaLevel(feet)",
                Some(("alt_amsl_m", Some("ft"))),
            ),
            ("CH4 (ppm)", Some(("ch4_ppm", Some("ppm")))),
            ("CO2 (smartGAS) / ppm", Some(("co2_ppm", Some("ppm")))),
            ("CO2_(µmol⁄mol)", Some(("co2_ppm", Some("ppm")))),
            ("CO2_(umol_mol-1)", Some(("co2_ppm", Some("ppm")))),
            ("CH4_dry_sync", Some(("ch4_ppm", None))),
            ("CH4_dry", Some(("ch4_ppm", None))),
            ("GPS_ABS_LAT", Some(("lat_deg", None))),
            ("WindDir", Some(("wind_from_deg", None))),
            ("wind_speed_m_s", Some(("wind_speed_m_s", Some("m/s")))),
            ("Wind Speed (km/h)", Some(("wind_speed_m_s", Some("km/h")))),
            ("AirTC_Avg", Some(("temperature_c", None))),
            ("SO2 μg/m3", Some(("so2_ppm", Some("ug/m3")))),
            ("温度 ℃", Some(("temperature_c", Some("C")))),
            ("pressure_hpa", Some(("pressure_hpa", Some("hPa")))),
            (
                "relative_humidity_pct",
                Some(("relative_humidity_pct", Some("%"))),
            ),
            ("CavityPressure", None),
            ("Cell_Temperature_(°C)", None),
            ("T0 (degC)", None),
            ("battery_temperature(f)", None),
            ("CO2_Absorption", None),
            ("GPS(0):Lat", Some(("lat_deg", None))),
            ("GPS(0):Long[degrees]", Some(("lon_deg", Some("deg")))),
            ("GPS:Long", Some(("lon_deg", None))),
            ("IMU_ATTI(0):temperature", None),
            ("AirSpeed:windSpeed", None),
        ] {
            assert_eq!(quantity(header), expected, "{header}");
        }
    }

    #[test]
    fn heights_say_from_what_they_count() {
        let height = |text| {
            Header::new(text)
                .height()
                .map(|(d, clear, u)| (d, clear, u.map(|u| u.name)))
        };
        assert_eq!(
            height("height_above_takeoff(feet)"),
            Some((Datum::Home, true, Some("ft")))
        );
        assert_eq!(
            height("OSD.height [ft]"),
            Some((Datum::Home, true, Some("ft")))
        );
        assert_eq!(height("alt_amsl_m"), Some((Datum::Amsl, true, Some("m"))));
        assert_eq!(height("Altitude"), Some((Datum::Amsl, false, None)));
        assert_eq!(height("HAE (m)"), Some((Datum::Ellipsoid, true, Some("m"))));
        assert_eq!(
            height("pressure_altitude_ft"),
            Some((Datum::PressureAltitude, true, Some("ft")))
        );
        assert_eq!(height("max_altitude(feet)"), None);
        assert_eq!(
            height("GPS(0):heightMSL[meters]"),
            Some((Datum::Amsl, true, Some("m")))
        );
        assert_eq!(
            height("General:relativeHeight"),
            Some((Datum::Home, true, None))
        );
        assert_eq!(height("alt_m_asl"), Some((Datum::Amsl, true, Some("m"))));
        assert_eq!(
            height("Height (m HAE)"),
            Some((Datum::Ellipsoid, true, Some("m")))
        );
        assert_eq!(
            height("height_agl_m"),
            Some((Datum::Ground, true, Some("m")))
        );
        assert_eq!(
            height("Höhe über NN [m]"),
            Some((Datum::Amsl, true, Some("m")))
        );
    }

    #[test]
    fn times_say_their_unit_and_clock() {
        let time = |text| {
            Header::new(text)
                .time()
                .map(|(_, u, c)| (u.map(|u| u.name), c))
        };
        assert_eq!(time("time(millisecond)"), Some((Some("ms"), None)));
        assert_eq!(time("datetime(utc)"), Some((None, Some(Clock::Utc))));
        assert_eq!(time("time_s"), Some((Some("s"), None)));
        assert_eq!(time("EPOCH_TIME"), Some((None, None)));
        assert_eq!(
            time("CUSTOM.updateTime [local]"),
            Some((None, Some(Clock::Local)))
        );
        assert_eq!(time("UTC"), Some((None, Some(Clock::Utc))));
        assert_eq!(time("System_Time_(h:m:s)"), Some((None, None)));
        assert_eq!(time("timezone"), None);
        assert_eq!(
            time("Date Time, GMT+01:00"),
            Some((None, Some(Clock::Ahead(3600.0))))
        );
        assert_eq!(time("UTCDateTime"), Some((None, Some(Clock::Utc))));
        assert_eq!(time("millis"), Some((Some("ms"), None)));
        assert_eq!(time("Uhrzeit"), Some((None, None)));
        assert_eq!(time("DasTemp"), None);
        assert_eq!(time("GPS(0):dateTimeStamp"), Some((None, None)));
        assert_eq!(time("Clock:offsetTime"), Some((None, None)));
    }
}
