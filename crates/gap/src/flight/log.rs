//! The flight file: columns by name, each with its unit in it; missing cells are NaN.

use formats::delimited::{Column, Header, Table};

use crate::GapError;

/// A column of numbers up to the largest magnitude that a small aircraft can reach at all.
const fn number(name: &'static str, largest: f64) -> Column {
    Column::optional(name).of((-largest, largest, ""))
}

/// Every column that is read, time first.
const COLUMNS: [Column; 29] = [
    Column::optional("time_s").of((-1e9, 1e9, "a time in seconds in every row")),
    number("airspeed_m_s", 120.0),
    number("angle_of_attack_deg", 180.0),
    number("sideslip_deg", 180.0),
    number("roll_deg", 360.0),
    number("pitch_deg", 180.0),
    number("yaw_deg", 1e5),
    number("roll_rate_deg_s", 2000.0),
    number("pitch_rate_deg_s", 2000.0),
    number("yaw_rate_deg_s", 2000.0),
    number("accel_x_m_s2", 500.0),
    number("accel_y_m_s2", 500.0),
    number("accel_z_m_s2", 500.0),
    number("elevator_deg", 90.0),
    number("aileron_left_deg", 90.0),
    number("aileron_right_deg", 90.0),
    number("rudder_deg", 90.0),
    number("elevon_left_deg", 90.0),
    number("elevon_right_deg", 90.0),
    number("throttle", 1.05),
    number("lat_deg", 90.0),
    number("lon_deg", 360.0),
    number("alt_amsl_m", 9000.0),
    number("vel_north_m_s", 200.0),
    number("vel_east_m_s", 200.0),
    number("vel_down_m_s", 200.0),
    number("baro_height_m", 9000.0),
    number("wind_speed_m_s", 100.0),
    number("wind_from_deg", 720.0),
];

/// Columns of a flight file that are known and not needed.
const UNUSED: [&str; 5] = [
    "roll_cmd_deg",
    "pitch_cmd_deg",
    "airspeed_cmd_m_s",
    "height_cmd_m",
    "platform",
];

/// Columns without which no flight can be analysed.
const NEEDED: [&str; 7] = [
    "time_s",
    "airspeed_m_s",
    "roll_deg",
    "pitch_deg",
    "roll_rate_deg_s",
    "pitch_rate_deg_s",
    "yaw_rate_deg_s",
];
/// The control surfaces of a conventional aircraft and of a flying wing, one of which is needed too.
const SURFACES: [&[&str]; 2] = [
    &["elevator_deg", "aileron_left_deg", "aileron_right_deg"],
    &["elevon_left_deg", "elevon_right_deg"],
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

impl FlightLog {
    /// Reads the text of a flight file; `name` is for messages.
    ///
    /// # Errors
    /// [`GapError::Data`] with file, line and column: an empty file, a missing or doubled column,
    /// a cell that is no number or beyond what an aircraft can do, times that stand or run back.
    pub fn parse(name: &str, text: &str) -> Result<Self, GapError> {
        let mut table = Table::unchecked(name, text, &COLUMNS, true);
        let mut notices = check(&table.header)?;
        let found: Vec<usize> = (0..COLUMNS.len())
            .filter(|k| table.header.has(*k))
            .collect();
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); found.len()];
        while let Some(row) = table.next_row()? {
            let time_s = row.needed(0)?;
            if let Some(before_s) = values[0].last().filter(|b| time_s <= **b) {
                let problem = if time_s == *before_s {
                    format!("the time {time_s} s is repeated")
                } else {
                    format!("{time_s} s after {before_s} s")
                };
                let expected = "increasing times";
                return Err(row.error("time_s", problem, expected).into());
            }
            for (k, values) in found.iter().zip(&mut values) {
                values.push(row.number(*k)?.unwrap_or(f64::NAN));
            }
        }
        if values[0].len() < 2 {
            return Err(GapError::Data {
                what: name.to_owned(),
                problem: format!("{} rows below the header", values[0].len()),
                expected: "a flight of at least 20 s".to_owned(),
            });
        }
        let names: Vec<&'static str> = found.iter().map(|k| COLUMNS[*k].name).collect();
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

/// Rejects a header without the columns that a flight needs; returns notices about columns that are not known.
fn check(header: &Header) -> Result<Vec<String>, GapError> {
    header.check()?;
    let has = |name: &&str| header.names().iter().any(|n| n == name);
    let missing: Vec<&str> = NEEDED.into_iter().filter(|n| !has(n)).collect();
    if !missing.is_empty() || !SURFACES.iter().any(|set| set.iter().all(has)) {
        let problem = if missing.is_empty() {
            "no control surfaces".to_owned()
        } else {
            format!("columns missing: {}", missing.join(", "))
        };
        let sets = SURFACES.map(|set| set.join(", ")).join(" or ");
        let expected = format!("a header with {}, and {sets}", NEEDED.join(", "));
        return Err(header.error("", problem, expected).into());
    }
    let others = header.others().map(|(_, name)| name);
    let unknown: Vec<&str> = others.filter(|name| !UNUSED.contains(name)).collect();
    let list = unknown.join(", ");
    let notice = format!("{}: unknown columns are not used: {list}", header.file());
    Ok((!unknown.is_empty())
        .then_some(notice)
        .into_iter()
        .collect())
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
            (&format!("{good}1,18\n"), "line 3"),
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
