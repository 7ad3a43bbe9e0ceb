//! The JSON of [Open-Meteo](https://open-meteo.com/en/docs): `current` and `hourly`, each with its units. Other
//! services that speak the same form are read too.

use super::report::{
    ReportedPressure, ReportedWind, TimeScale, WeatherError, WeatherReport, WeatherReports,
};
use air::geo::Geodetic;
use formats::calendar::iso_8601;
use serde_json::{Map, Value};

type Object = Map<String, Value>;

/// Units of speed, m/s. Open-Meteo's default is km/h.
const SPEEDS: [(&str, f64); 6] = [
    ("km/h", 1.0 / 3.6),
    ("m/s", 1.0),
    ("ms", 1.0),
    ("mp/h", 0.447_04),
    ("mph", 0.447_04),
    ("kn", 1852.0 / 3600.0),
];

/// Reads the wind at the height, of those that are there, which is nearest to `height_agl_m` by its ratio.
pub(super) fn parse(text: &str, height_agl_m: f64) -> Result<WeatherReports, WeatherError> {
    let whole: Object = serde_json::from_str(text).map_err(|e| {
        WeatherError::new("JSON", e.to_string(), "an object with current or hourly")
    })?;
    if let Some(reason) = whole.get("reason").and_then(Value::as_str) {
        return Err(WeatherError::new(
            "reason",
            format!("\"{reason}\""),
            "weather, not an error",
        ));
    }
    let offset_s = whole
        .get("utc_offset_seconds")
        .and_then(Value::as_f64)
        .unwrap_or(0.0);
    let block = |name: &'static str| Block::of(&whole, name, offset_s);
    let (current, hourly) = (block("current"), block("hourly"));
    let heights = [&current, &hourly]
        .into_iter()
        .flatten()
        .flat_map(Block::heights_m);
    let off = |h: f64| (h / height_agl_m).ln().abs();
    let height_m = heights
        .min_by(|a, b| off(*a).total_cmp(&off(*b)))
        .ok_or_else(|| {
            WeatherError::new(
                "current, hourly",
                "no wind",
                "wind_speed_10m and wind_direction_10m, or at 80, 100, 120 or 180 m",
            )
        })?;
    let mut reports = Vec::new();
    // What is current comes first, and so is kept beside an hour of the same time.
    for block in [&current, &hourly].into_iter().flatten() {
        reports.extend(block.reports(height_m)?);
    }
    let first = reports.first().map(|r: &WeatherReport| r.time_s);
    let of_current = current
        .as_ref()
        .and_then(|c| c.times_s().ok()?.first().copied());
    let Some(as_of_s) = of_current.or(first) else {
        return Err(WeatherError::new(
            "current, hourly",
            "no time with a wind",
            "at least one",
        ));
    };
    let degrees = |key: &str| whole.get(key).and_then(Value::as_f64);
    Ok(WeatherReports {
        place: degrees("latitude")
            .zip(degrees("longitude"))
            .map(|(lat_deg, lon_deg)| Geodetic { lat_deg, lon_deg }),
        scale: TimeScale::Unix,
        as_of_s,
        reports,
    })
}

/// `current` or `hourly` with its units.
struct Block<'a> {
    name: &'static str,
    values: &'a Object,
    units: Option<&'a Object>,
    utc_offset_s: f64,
}

impl<'a> Block<'a> {
    fn of(whole: &'a Object, name: &'static str, utc_offset_s: f64) -> Option<Self> {
        Some(Self {
            name,
            values: whole.get(name)?.as_object()?,
            units: whole
                .get(&format!("{name}_units"))
                .and_then(Value::as_object),
            utc_offset_s,
        })
    }

    /// Heights of which it has speed and direction, m above ground.
    fn heights_m(&self) -> impl Iterator<Item = f64> + '_ {
        let of = |key: &str| {
            key.strip_prefix("wind_speed_")?
                .strip_suffix('m')?
                .parse::<u16>()
                .ok()
        };
        let heights = self.values.keys().filter_map(move |key| of(key));
        heights
            .filter(|h| *h > 0 && self.values.contains_key(&format!("wind_direction_{h}m")))
            .map(f64::from)
    }

    fn at(&self, key: &str) -> String {
        format!("{}.{key}", self.name)
    }

    /// All values of a key, in order: of `current` one.
    fn all(&self, key: &str) -> Vec<&'a Value> {
        match self.values.get(key) {
            None => Vec::new(),
            Some(Value::Array(all)) => all.iter().collect(),
            Some(one) => vec![one],
        }
    }

    /// All numbers of a key, times a factor by its unit; a null is none.
    fn numbers(&self, key: &str, units: &[(&str, f64)]) -> Result<Vec<Option<f64>>, WeatherError> {
        let values = self.all(key);
        if values.is_empty() {
            return Ok(Vec::new());
        }
        let unit = self.units.and_then(|u| u.get(key)).and_then(Value::as_str);
        let known = |name: &str| units.iter().find(|(n, _)| *n == name).map(|(_, f)| *f);
        let factor = unit.and_then(known).ok_or_else(|| {
            let names: Vec<&str> = units.iter().map(|(n, _)| *n).collect();
            let at = format!("{}_units.{key}", self.name);
            let found = unit.map_or("no unit".to_owned(), |u| format!("\"{u}\""));
            WeatherError::new(at, found, names.join(", "))
        })?;
        let number = |v: &&Value| match v {
            Value::Null => Ok(None),
            v => v
                .as_f64()
                .map(|n| Some(n * factor))
                .ok_or_else(|| WeatherError::new(self.at(key), v.to_string(), "a number")),
        };
        values.iter().map(number).collect()
    }

    fn times_s(&self) -> Result<Vec<f64>, WeatherError> {
        let time = |v: &Value| match v {
            Value::String(text) => iso_8601(text).map(|t| t - self.utc_offset_s),
            v => v.as_f64(),
        };
        let read = |v: &&Value| {
            time(v).ok_or_else(|| {
                WeatherError::new(
                    self.at("time"),
                    v.to_string(),
                    "a time such as 2026-11-27T12:30",
                )
            })
        };
        self.all("time").iter().map(read).collect()
    }

    /// Its times with a wind at a height; none where it does not have that height.
    fn reports(&self, height_m: f64) -> Result<Vec<WeatherReport>, WeatherError> {
        let speeds = self.numbers(&format!("wind_speed_{height_m}m"), &SPEEDS)?;
        let directions = self.numbers(&format!("wind_direction_{height_m}m"), &[("°", 1.0)])?;
        let temperatures = self.numbers("temperature_2m", &[("°C", 1.0)])?;
        let ground = self.numbers("surface_pressure", &[("hPa", 1.0)])?;
        let sea_level = self.numbers("pressure_msl", &[("hPa", 1.0)])?;
        let at = |values: &[Option<f64>], k: usize| values.get(k).copied().flatten();
        let report = |(k, time_s): (usize, f64)| {
            let of_ground = at(&ground, k).map(ReportedPressure::Ground);
            Some(WeatherReport {
                time_s,
                wind: ReportedWind {
                    speed_m_s: at(&speeds, k)?,
                    from_deg: Some(at(&directions, k)?),
                    height_agl_m: Some(height_m),
                },
                temperature_c: at(&temperatures, k),
                pressure: of_ground.or(at(&sea_level, k).map(ReportedPressure::SeaLevel)),
                stability: None,
            })
        };
        Ok(self
            .times_s()?
            .into_iter()
            .enumerate()
            .filter_map(report)
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In the form of the documentation's example, with the variables that its builder of addresses offers.
    const ANSWER: &str = r#"{"latitude":43.44,"longitude":-7.86,"generationtime_ms":0.09,"utc_offset_seconds":3600,
        "timezone":"Europe/Madrid","timezone_abbreviation":"GMT+1","elevation":352.0,
        "current_units":{"time":"iso8601","interval":"seconds","temperature_2m":"°C","surface_pressure":"hPa",
        "wind_speed_10m":"km/h","wind_direction_10m":"°"},
        "current":{"time":"2026-11-27T13:45","interval":900,"temperature_2m":11.2,"surface_pressure":976.4,
        "wind_speed_10m":18.0,"wind_direction_10m":238},
        "hourly_units":{"time":"iso8601","wind_speed_10m":"km/h","wind_direction_10m":"°","wind_speed_180m":"km/h",
        "wind_direction_180m":"°"},
        "hourly":{"time":["2026-11-27T13:00","2026-11-27T14:00","2026-11-27T15:00"],"wind_speed_10m":[18.0,20.0,21.0],
        "wind_direction_10m":[238,240,241],"wind_speed_180m":[36.0,null,45.0],"wind_direction_180m":[244,245,246]}}"#;

    #[test]
    fn the_height_that_is_nearest_is_taken_in_m_s_and_utc() {
        let low = parse(ANSWER, 10.0).unwrap();
        let first = low.reports[0];
        assert_eq!(first.time_s, iso_8601("2026-11-27T12:45").unwrap());
        assert_eq!(low.as_of_s, first.time_s);
        assert!(
            (first.wind.speed_m_s - 5.0).abs() < 1e-12,
            "18 km/h are 5 m/s"
        );
        assert_eq!(
            (first.wind.from_deg, first.wind.height_agl_m),
            (Some(238.0), Some(10.0))
        );
        assert_eq!(first.temperature_c, Some(11.2));
        assert_eq!(first.pressure, Some(ReportedPressure::Ground(976.4)));
        assert_eq!(low.reports.len(), 4);
        // Only the hours have 180 m, one of them nothing; the answer is of 12:45 UTC all the same.
        let high = parse(ANSWER, 486.0).unwrap();
        let speeds: Vec<f64> = high
            .reports
            .iter()
            .map(|r| r.wind.speed_m_s.round())
            .collect();
        assert_eq!((speeds, high.as_of_s), (vec![10.0, 13.0], low.as_of_s));
    }

    #[test]
    fn other_units_and_times_are_read_or_refused() {
        let knots = ANSWER
            .replace("km/h", "kn")
            .replace("\"2026-11-27T13:45\"", "1795783500");
        let first = parse(&knots, 10.0).unwrap().reports[0];
        assert!((first.wind.speed_m_s - 9.26).abs() < 1e-9 && first.time_s == 1_795_783_500.0);
        for (from, to, words) in [
            (
                "km/h",
                "Bft",
                "current_units.wind_speed_10m: \"Bft\"; expected km/h, m/s",
            ),
            (
                "°C",
                "°F",
                "current_units.temperature_2m: \"°F\"; expected °C",
            ),
            (
                "2026-11-27T13:45",
                "noon",
                "current.time: \"noon\"; expected a time",
            ),
            ("18.0,", "\"calm\",", "\"calm\"; expected a number"),
            ("wind_direction", "direction", "no wind"),
        ] {
            let why = parse(&ANSWER.replace(from, to), 10.0)
                .unwrap_err()
                .to_string();
            assert!(why.contains(words), "{why}");
        }
        let cut = parse(&ANSWER[..400], 10.0).unwrap_err().to_string();
        assert!(cut.starts_with("JSON: EOF"), "{cut}");
    }
}
