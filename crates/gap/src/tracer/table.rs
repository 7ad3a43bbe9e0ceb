//! The three tables of a tracer experiment, from CSV text: header names fixed, order free,
//! empty cells missing, further columns ignored with a notice.

use formats::delimited::{Column, Row, Table};

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

const SAMPLER_COLUMNS: [Column; 7] = [
    Column::required("trial"),
    Column::required("east_m").of(A_PLACE),
    Column::required("north_m").of(A_PLACE),
    Column::required("height_agl_m").of(A_HEIGHT),
    Column::required("concentration_mg_m3").of(NOT_NEGATIVE),
    Column::optional("evaporation_factor").of(A_SHARE),
    Column::optional("averaging_time_s"),
];

fn samplers(file: (&str, &str), notices: &mut Vec<String>) -> Result<Vec<Receptor>, GapError> {
    rows(file, &SAMPLER_COLUMNS, notices, |_, row| {
        let (east_m, north_m) = (row.needed(1)?, row.needed(2)?);
        if east_m.hypot(north_m) < LEAST_DISTANCE_M {
            let problem = format!("found \"{east_m}, {north_m}\"");
            let expected = "a sampler away from the source at 0, 0";
            return Err(row.error("east_m", problem, expected).into());
        }
        Ok(Receptor {
            trial: row.name(0)?.to_owned(),
            east_m,
            north_m,
            height_agl_m: row.needed(3)?,
            concentration_mg_m3: row.number(4)?,
            evaporation_factor: row.number(5)?,
        })
    })
}

const TRIAL_COLUMNS: [Column; 13] = [
    Column::required("trial"),
    Column::required("source_rate_g_s").of(POSITIVE),
    Column::required("source_height_agl_m").of(A_HEIGHT),
    Column::required("wind_speed_m_s").of(A_SPEED),
    Column::optional("wind_height_m").of(POSITIVE),
    Column::optional("wind_from_deg").of(AN_ANGLE),
    Column::optional("obukhov_length_m").of(A_LENGTH),
    Column::optional("mixing_height_m").of(POSITIVE),
    Column::optional("sigma_azimuth_deg").of(A_SPREAD),
    Column::optional("roughness_length_m").of(POSITIVE),
    Column::optional("friction_velocity_m_s"),
    Column::optional("date"),
    Column::optional("local_time"),
];

fn trial_rows(file: (&str, &str), notices: &mut Vec<String>) -> Result<Vec<Trial>, GapError> {
    rows(file, &TRIAL_COLUMNS, notices, |trials: &[Trial], row| {
        let trial = row.name(0)?.to_owned();
        if trials.iter().any(|t| t.trial == trial) {
            return Err(row.wrong(0, "every trial once").into());
        }
        Ok(Trial {
            trial,
            source_rate_g_s: row.needed(1)?,
            source_height_agl_m: row.needed(2)?,
            wind_speed_m_s: row.number(3)?,
            wind_height_m: row.number(4)?,
            wind_from_deg: row.number(5)?,
            obukhov_length_m: row.number(6)?,
            mixing_height_m: row.number(7)?,
            sigma_azimuth_deg: row.number(8)?,
            roughness_length_m: row.number(9)?,
        })
    })
}

/// A sampler nearer than this is at the source, m.
const LEAST_DISTANCE_M: f64 = 0.01;

type Range = (f64, f64, &'static str);
const A_PLACE: Range = (-1e5, 1e5, "metres from the source, at most 100 km");
const A_HEIGHT: Range = (0.0, 2000.0, "metres above ground, 0 to 2000");
const NOT_NEGATIVE: Range = (0.0, 1e9, "a number of 0 or more");
const POSITIVE: Range = (f64::MIN_POSITIVE, 1e9, "a number above 0");
const A_SHARE: Range = (0.0, 10.0, "a factor from 0 to 10");
const A_SPEED: Range = (0.05, 80.0, "a wind speed from 0.05 to 80 m/s");
const AN_ANGLE: Range = (-360.0, 720.0, "degrees");
const A_LENGTH: Range = (-1e6, 1e6, "metres, not 0");
const A_SPREAD: Range = (0.01, 120.0, "degrees from 0.01 to 120");

/// The rows of a file, each made by `read` with those before it; at least one.
fn rows<T>(
    (file, text): (&str, &str),
    columns: &[Column],
    notices: &mut Vec<String>,
    read: impl Fn(&[T], &Row<'_>) -> Result<T, GapError>,
) -> Result<Vec<T>, GapError> {
    let mut table = Table::open(file, text, columns, false)?;
    table.header.distinct(|_| true)?;
    let others = table.header.others();
    notices.extend(others.map(|(_, name)| format!("{file}: column \"{name}\" is not used")));
    let mut rows = Vec::new();
    while let Some(row) = table.next_row()? {
        rows.push(read(&rows, &row)?);
    }
    if rows.is_empty() {
        return Err(table.no_rows().into());
    }
    Ok(rows)
}
