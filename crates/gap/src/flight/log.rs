//! The flight file: columns by name, each with its unit in it; missing cells are NaN.

use crate::GapError;

/// What stands in a column: name in files, and what a plausible value of it is.
struct Column {
    name: &'static str,
    largest: f64,
}

const fn column(name: &'static str, largest: f64) -> Column {
    Column { name, largest }
}

/// Every column that is read; others are kept aside with a notice. The largest magnitude is what
/// a small aircraft can reach at all.
const COLUMNS: [Column; 30] = [
    column("time_s", 1e9),
    column("airspeed_m_s", 120.0),
    column("angle_of_attack_deg", 180.0),
    column("sideslip_deg", 180.0),
    column("roll_deg", 360.0),
    column("pitch_deg", 180.0),
    column("yaw_deg", 1e5),
    column("roll_rate_deg_s", 2000.0),
    column("pitch_rate_deg_s", 2000.0),
    column("yaw_rate_deg_s", 2000.0),
    column("accel_x_m_s2", 500.0),
    column("accel_y_m_s2", 500.0),
    column("accel_z_m_s2", 500.0),
    column("elevator_deg", 90.0),
    column("aileron_left_deg", 90.0),
    column("aileron_right_deg", 90.0),
    column("rudder_deg", 90.0),
    column("elevon_left_deg", 90.0),
    column("elevon_right_deg", 90.0),
    column("throttle", 1.05),
    column("lat_deg", 90.0),
    column("lon_deg", 360.0),
    column("alt_amsl_m", 9000.0),
    column("vel_north_m_s", 200.0),
    column("vel_east_m_s", 200.0),
    column("vel_down_m_s", 200.0),
    column("baro_height_m", 9000.0),
    column("wind_speed_m_s", 100.0),
    column("wind_from_deg", 720.0),
    column("platform", f64::INFINITY),
];

/// Columns of a flight file that are known and not needed.
const ASIDE: [&str; 5] = [
    "roll_cmd_deg",
    "pitch_cmd_deg",
    "airspeed_cmd_m_s",
    "height_cmd_m",
    "platform",
];

/// Columns without which nothing can be told.
const NEEDED: [&str; 7] = [
    "time_s",
    "airspeed_m_s",
    "roll_deg",
    "pitch_deg",
    "roll_rate_deg_s",
    "pitch_rate_deg_s",
    "yaw_rate_deg_s",
];

/// One flight as its file has it.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightLog {
    /// The file's name.
    pub name: String,
    /// Names of the columns that are there.
    names: Vec<&'static str>,
    /// Their values, row by row order; NaN where missing.
    values: Vec<Vec<f64>>,
    /// What a user should know.
    pub notices: Vec<String>,
}

fn refusal(what: String, problem: impl Into<String>, expected: impl Into<String>) -> GapError {
    GapError::Data {
        what,
        problem: problem.into(),
        expected: expected.into(),
    }
}

impl FlightLog {
    /// Reads the text of a flight file; `name` is for messages.
    ///
    /// # Errors
    /// [`GapError::Data`] with file, line and column: an empty file, a missing or doubled column,
    /// a cell that is no number or beyond what an aircraft can do, times that stand or run back.
    pub fn parse(name: &str, text: &str) -> Result<Self, GapError> {
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .from_reader(text.as_bytes());
        let broken = |error: csv::Error| {
            refusal(
                name.to_owned(),
                error.to_string(),
                "lines with as many cells as the header",
            )
        };
        let header = reader.headers().map_err(broken)?.clone();
        let (places, mut notices) = places(name, &header)?;
        let mut values = vec![Vec::new(); places.len()];
        let mut row = csv::StringRecord::new();
        while reader.read_record(&mut row).map_err(broken)? {
            let line = row.position().map_or(0, csv::Position::line);
            for ((at, column), values) in places.iter().zip(&mut values) {
                values.push(cell(name, line, column, row.get(*at).unwrap_or(""))?);
            }
            in_order(name, line, &values[0])?;
        }
        if values[0].len() < 2 {
            return Err(refusal(
                name.to_owned(),
                format!("{} rows below the header", values[0].len()),
                "a flight of at least 20 s",
            ));
        }
        let names: Vec<&'static str> = places.iter().map(|(_, c)| c.name).collect();
        for (name, values) in names.iter().zip(&values) {
            if values.iter().all(|v| v.is_nan()) {
                notices.push(format!("column {name} is empty"));
            }
        }
        Ok(Self {
            name: name.to_owned(),
            names,
            values,
            notices,
        })
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values[0].len()
    }

    /// Whether there are no rows (never for a log that was read).
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Times, s, ascending.
    pub fn time_s(&self) -> &[f64] {
        &self.values[0]
    }

    /// A column by its name in files, if it is there and holds anything.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        let at = self.names.iter().position(|n| *n == name)?;
        let values = &self.values[at];
        values.iter().any(|v| v.is_finite()).then_some(values)
    }
}

/// Where a known column stands in a row.
type Place = (usize, &'static Column);

/// Where the known columns stand, time first, and notices about the others.
fn places(name: &str, header: &csv::StringRecord) -> Result<(Vec<Place>, Vec<String>), GapError> {
    let mut found: Vec<Place> = Vec::new();
    let mut strange = Vec::new();
    for (at, cell) in header.iter().enumerate() {
        let cell = cell.trim_start_matches('\u{feff}');
        match COLUMNS.iter().find(|c| c.name == cell) {
            Some(column) if found.iter().any(|(_, c)| c.name == column.name) => {
                let what = format!("{name}: line 1, column {cell}");
                return Err(refusal(what, "the column occurs twice", "each column once"));
            }
            Some(column) if !ASIDE.contains(&column.name) => found.push((at, column)),
            _ if ASIDE.contains(&cell) => {}
            _ => strange.push(cell.to_owned()),
        }
    }
    let has = |name: &str| found.iter().any(|(_, c)| c.name == name);
    let missing: Vec<&str> = NEEDED.into_iter().filter(|n| !has(n)).collect();
    let surfaces = has("elevon_left_deg") && has("elevon_right_deg")
        || has("elevator_deg") && has("aileron_left_deg") && has("aileron_right_deg");
    if !missing.is_empty() || !surfaces {
        let problem = if missing.is_empty() {
            "no control surfaces".to_owned()
        } else {
            format!("columns missing: {}", missing.join(", "))
        };
        return Err(refusal(
            format!("{name}: line 1"),
            problem,
            format!(
                "a header with {}, and elevator_deg, aileron_left_deg, aileron_right_deg or \
                 elevon_left_deg, elevon_right_deg",
                NEEDED.join(", ")
            ),
        ));
    }
    found.sort_by_key(|(_, c)| c.name != "time_s");
    let mut notices = Vec::new();
    if !strange.is_empty() {
        let list = strange.join(", ");
        notices.push(format!("{name}: unknown columns are not used: {list}"));
    }
    Ok((found, notices))
}

fn cell(name: &str, line: u64, column: &Column, text: &str) -> Result<f64, GapError> {
    if text.is_empty() || text.eq_ignore_ascii_case("nan") {
        return Ok(f64::NAN);
    }
    let what = || format!("{name}: line {line}, column {}", column.name);
    let value: f64 = text.parse().map_err(|_| {
        refusal(
            what(),
            format!("found \"{text}\""),
            "a number or an empty cell",
        )
    })?;
    if !value.is_finite() || value.abs() > column.largest {
        return Err(refusal(
            what(),
            format!("found {value}"),
            format!("a magnitude of at most {} (units?)", column.largest),
        ));
    }
    Ok(value)
}

fn in_order(name: &str, line: u64, times: &[f64]) -> Result<(), GapError> {
    let [.., before, now] = times else {
        return match times {
            [first] if first.is_nan() => Err(refusal(
                format!("{name}: line {line}, column time_s"),
                "no time",
                "a time in every row",
            )),
            _ => Ok(()),
        };
    };
    if now > before {
        return Ok(());
    }
    let problem = if now == before {
        format!("the time {now} s is repeated")
    } else {
        format!("{now} s after {before} s")
    };
    Err(refusal(
        format!("{name}: line {line}, column time_s"),
        problem,
        "increasing times",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "time_s,airspeed_m_s,roll_deg,pitch_deg,roll_rate_deg_s,\
        pitch_rate_deg_s,yaw_rate_deg_s,elevon_left_deg,elevon_right_deg,throttle,colour";

    fn read(rows: &str) -> Result<FlightLog, GapError> {
        FlightLog::parse("f.csv", &format!("{HEADER}\n{rows}"))
    }

    #[test]
    fn columns_are_found_and_missing_cells_are_nan() {
        let log = read("0,18,0,,0,0,0,1,2,.5,red\n.02,18,0,1,0,0,0,1,2,.5,red\n").unwrap();
        assert_eq!(log.time_s(), [0.0, 0.02]);
        assert!(log.column("pitch_deg").unwrap()[0].is_nan());
        assert_eq!(log.column("elevon_right_deg").unwrap(), [2.0, 2.0]);
        assert!(log.column("rudder_deg").is_none());
        assert!(log.notices[0].contains("colour"));
    }

    #[test]
    fn what_is_wrong_is_said_with_its_place() {
        let good = "0,18,0,1,0,0,0,1,2,.5,x\n";
        for (rows, says) in [
            ("", "0 rows"),
            (good, "1 rows"),
            (&format!("{good}0,18,0,1,0,0,0,1,2,.5,x\n"), "repeated"),
            (&format!("{good}-1,18,0,1,0,0,0,1,2,.5,x\n"), "line 3"),
            (&format!("{good}1,18,zero,1,0,0,0,1,2,.5,x\n"), "\"zero\""),
            (&format!("{good}1,18,0,1,inf,0,0,1,2,.5,x\n"), "roll_rate"),
            (&format!("{good}1,18,0,1,0,0,0,1,2,50,x\n"), "throttle"),
            (&format!("{good}1,18\n"), "line: 3"),
        ] {
            let error = read(rows).unwrap_err().to_string();
            assert!(error.contains(says), "{says}: {error}");
        }
        let error = FlightLog::parse("f.csv", "").unwrap_err().to_string();
        assert!(error.contains("time_s"), "{error}");
        let without = HEADER.replace("elevon_left_deg", "elevon");
        let error = FlightLog::parse("f.csv", &without).unwrap_err().to_string();
        assert!(error.contains("no control surfaces"), "{error}");
        let twice = HEADER.replace("colour", "time_s");
        let error = FlightLog::parse("f.csv", &twice).unwrap_err().to_string();
        assert!(error.contains("twice"), "{error}");
    }
}
