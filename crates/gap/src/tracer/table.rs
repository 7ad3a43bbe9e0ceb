//! The three tables of a tracer experiment, from CSV text: header names fixed, order free,
//! empty cells missing, further columns ignored with a notice.

use csv::{ReaderBuilder, StringRecord, Trim};

use crate::GapError;

/// One sampler's mean over a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Receptor {
    /// Trial.
    pub trial: String,
    /// Metres east of the source.
    pub east_m: f64,
    /// Metres north of the source.
    pub north_m: f64,
    /// Height above ground, m.
    pub height_agl_m: f64,
    /// Concentration as sampled, mg/m³; 0 is below detection.
    pub concentration_mg_m3: Option<f64>,
    /// Factor that corrects the sampling loss.
    pub evaporation_factor: Option<f64>,
}

/// One trial's release and weather.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Its name.
    pub trial: String,
    /// Release, g/s.
    pub source_rate_g_s: f64,
    /// Height of the release above ground, m.
    pub source_height_agl_m: f64,
    /// Wind speed, m/s, at `wind_height_m`.
    pub wind_speed_m_s: Option<f64>,
    /// Height of the wind speed, m.
    pub wind_height_m: Option<f64>,
    /// Direction from which the wind blows, degrees.
    pub wind_from_deg: Option<f64>,
    /// Obukhov length, m.
    pub obukhov_length_m: Option<f64>,
    /// Mixing height, m.
    pub mixing_height_m: Option<f64>,
    /// Standard deviation of the wind's azimuth, degrees.
    pub sigma_azimuth_deg: Option<f64>,
    /// Roughness length, m.
    pub roughness_length_m: Option<f64>,
}

/// All tables.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tables {
    /// Samplers on arcs.
    pub receptors: Vec<Receptor>,
    /// Trials.
    pub trials: Vec<Trial>,
    /// Samplers on towers.
    pub towers: Vec<Receptor>,
    /// What a user should know.
    pub notices: Vec<String>,
}

impl Tables {
    /// Reads the tables from (name, text) pairs; the names serve the messages only.
    ///
    /// # Errors
    /// A missing column, a cell that is no number, a table without rows: file, line, column and
    /// what would be right.
    pub fn parse(
        receptors: (&str, &str),
        trials: (&str, &str),
        towers: Option<(&str, &str)>,
    ) -> Result<Self, GapError> {
        let mut notices = Vec::new();
        let tables = Self {
            receptors: samplers(receptors, &mut notices)?,
            trials: trial_rows(trials, &mut notices)?,
            towers: towers.map_or(Ok(Vec::new()), |t| samplers(t, &mut notices))?,
            notices,
        };
        Ok(tables)
    }
}

const SAMPLER_COLUMNS: [&str; 5] = [
    "trial",
    "east_m",
    "north_m",
    "height_agl_m",
    "concentration_mg_m3",
];

fn samplers(file: (&str, &str), notices: &mut Vec<String>) -> Result<Vec<Receptor>, GapError> {
    let known = ["averaging_time_s", "evaporation_factor"];
    let table = Table::read(file, &SAMPLER_COLUMNS, &known, notices)?;
    table
        .rows()
        .map(|row| {
            let (east_m, north_m) = (
                row.number("east_m", A_PLACE)?,
                row.number("north_m", A_PLACE)?,
            );
            if east_m.hypot(north_m) < LEAST_DISTANCE_M {
                let found = format!("{east_m}, {north_m}");
                return Err(row.wrong("east_m", &found, "a sampler away from the source at 0, 0"));
            }
            Ok(Receptor {
                trial: row.text("trial")?,
                east_m,
                north_m,
                height_agl_m: row.number("height_agl_m", A_HEIGHT)?,
                concentration_mg_m3: row.maybe("concentration_mg_m3", NOT_NEGATIVE)?,
                evaporation_factor: row.maybe("evaporation_factor", A_SHARE)?,
            })
        })
        .collect()
}

fn trial_rows(file: (&str, &str), notices: &mut Vec<String>) -> Result<Vec<Trial>, GapError> {
    let required = [
        "trial",
        "source_rate_g_s",
        "source_height_agl_m",
        "wind_speed_m_s",
    ];
    let known = [
        "wind_height_m",
        "wind_from_deg",
        "obukhov_length_m",
        "mixing_height_m",
        "sigma_azimuth_deg",
        "roughness_length_m",
        "friction_velocity_m_s",
        "date",
        "local_time",
    ];
    let table = Table::read(file, &required, &known, notices)?;
    let mut trials: Vec<Trial> = Vec::new();
    for row in table.rows() {
        let trial = row.text("trial")?;
        if trials.iter().any(|t| t.trial == trial) {
            return Err(row.wrong("trial", &trial, "every trial once"));
        }
        trials.push(Trial {
            trial,
            source_rate_g_s: row.number("source_rate_g_s", POSITIVE)?,
            source_height_agl_m: row.number("source_height_agl_m", A_HEIGHT)?,
            wind_speed_m_s: row.maybe("wind_speed_m_s", A_SPEED)?,
            wind_height_m: row.maybe("wind_height_m", POSITIVE)?,
            wind_from_deg: row.maybe("wind_from_deg", AN_ANGLE)?,
            obukhov_length_m: row.maybe("obukhov_length_m", A_LENGTH)?,
            mixing_height_m: row.maybe("mixing_height_m", POSITIVE)?,
            sigma_azimuth_deg: row.maybe("sigma_azimuth_deg", A_SPREAD)?,
            roughness_length_m: row.maybe("roughness_length_m", POSITIVE)?,
        });
    }
    Ok(trials)
}

/// A sampler nearer than this is at the source, m.
const LEAST_DISTANCE_M: f64 = 0.01;

type Range = (f64, f64, &'static str);
const A_PLACE: Range = (-1e5, 1e5, "metres from the source, at most 100 km");
const A_HEIGHT: Range = (0.0, 2000.0, "metres above ground, 0 to 2000");
const NOT_NEGATIVE: Range = (0.0, 1e9, "a number of 0 or more, or an empty cell");
const POSITIVE: Range = (f64::MIN_POSITIVE, 1e9, "a number above 0");
const A_SHARE: Range = (0.0, 10.0, "a factor from 0 to 10, or an empty cell");
const A_SPEED: Range = (
    0.05,
    80.0,
    "a wind speed from 0.05 to 80 m/s, or an empty cell",
);
const AN_ANGLE: Range = (-360.0, 720.0, "degrees, or an empty cell");
const A_LENGTH: Range = (-1e6, 1e6, "metres, not 0, or an empty cell");
const A_SPREAD: Range = (0.01, 120.0, "degrees from 0.01 to 120, or an empty cell");

/// A name that a header has twice.
fn twice(header: &StringRecord) -> Option<&str> {
    let before = |k: usize, name: &str| header.iter().take(k).any(|h| h == name);
    let mut names = header.iter().enumerate();
    names.find(|(k, name)| before(*k, name)).map(|n| n.1)
}

struct Table<'a> {
    file: &'a str,
    header: StringRecord,
    records: Vec<StringRecord>,
}

impl<'a> Table<'a> {
    fn read(
        (file, text): (&'a str, &str),
        required: &[&str],
        known: &[&str],
        notices: &mut Vec<String>,
    ) -> Result<Self, GapError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut reader = ReaderBuilder::new()
            .trim(Trim::All)
            .from_reader(text.as_bytes());
        let broken = |e: csv::Error| GapError::Data {
            what: format!(
                "{file}: line {}",
                e.position().map_or(1, csv::Position::line)
            ),
            problem: e.to_string(),
            expected: "comma-separated values with as many cells as the header".into(),
        };
        let header = reader.headers().map_err(broken)?.clone();
        for name in required {
            if !header.iter().any(|h| h == *name) {
                return Err(GapError::Data {
                    what: format!("{file}: line 1, column {name}"),
                    problem: "missing".into(),
                    expected: format!("a header with {}", required.join(", ")),
                });
            }
        }
        if let Some(name) = twice(&header) {
            return Err(GapError::Data {
                what: format!("{file}: line 1, column {name}"),
                problem: "occurs twice".into(),
                expected: "every column once".into(),
            });
        }
        for name in header
            .iter()
            .filter(|h| !required.contains(h) && !known.contains(h))
        {
            notices.push(format!("{file}: column \"{name}\" is not used"));
        }
        let records = reader
            .records()
            .collect::<Result<Vec<_>, _>>()
            .map_err(broken)?;
        if records.is_empty() {
            return Err(GapError::Data {
                what: format!("{file}: line 2"),
                problem: "no rows below the header".into(),
                expected: "at least one".into(),
            });
        }
        Ok(Self {
            file,
            header,
            records,
        })
    }

    fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.records.iter().map(|record| Row {
            table: self,
            record,
        })
    }
}

struct Row<'a> {
    table: &'a Table<'a>,
    record: &'a StringRecord,
}

impl Row<'_> {
    fn cell(&self, column: &str) -> &str {
        let at = self.table.header.iter().position(|h| h == column);
        at.and_then(|i| self.record.get(i)).unwrap_or("")
    }

    fn wrong(&self, column: &str, found: &str, expected: &str) -> GapError {
        let line = self.record.position().map_or(0, csv::Position::line);
        GapError::Data {
            what: format!("{}: line {line}, column {column}", self.table.file),
            problem: format!("found \"{found}\""),
            expected: expected.into(),
        }
    }

    fn text(&self, column: &str) -> Result<String, GapError> {
        let cell = self.cell(column);
        if cell.is_empty() {
            return Err(self.wrong(column, cell, "a name"));
        }
        Ok(cell.to_owned())
    }

    fn maybe(&self, column: &str, (low, high, expected): Range) -> Result<Option<f64>, GapError> {
        let cell = self.cell(column);
        if cell.is_empty() || cell.eq_ignore_ascii_case("nan") {
            return Ok(None);
        }
        match cell.parse::<f64>() {
            Ok(v) if v >= low && v <= high => Ok(Some(v)),
            _ => Err(self.wrong(column, cell, expected)),
        }
    }

    fn number(&self, column: &str, range: Range) -> Result<f64, GapError> {
        self.maybe(column, range)?
            .ok_or_else(|| self.wrong(column, "", range.2))
    }
}
