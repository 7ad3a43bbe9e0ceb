//! Observations that come line by line while they are made.

use std::collections::VecDeque;

use air::geo::LocalFrame;
use formats::delimited::{Cells, Delimiter};
use plume::{DispersionSpec, Gas};

use super::read::{FileJoin, Layout, Progress};
use super::{DataQuality, ObservationError, ObservationRow, Observations, checks};

/// Rows that the checks of raw data look at together: ten minutes at one a second. What comes later
/// cannot be looked at, so that less is found than in a file.
const LOOKED_AT: usize = 600;

/// A line of a stream, read and checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Streamed {
    /// The row with what is left of it; none where it is left out.
    pub row: Option<ObservationRow>,
    /// Name of its platform.
    pub platform: String,
    /// What is wrong with it, if it was not before.
    pub flaws: Vec<DataQuality>,
}

/// Reads the lines of a stream with the reader of files, and holds each against those before with the
/// checks of files.
#[derive(Debug)]
pub struct ObservationStream {
    layout: Layout,
    join: FileJoin,
    progress: Progress,
    line: u64,
    recent: VecDeque<ObservationRow>,
    /// What was wrong with these rows.
    flaws: Vec<DataQuality>,
    base: DispersionSpec,
    frame: LocalFrame,
}

impl ObservationStream {
    /// A stream called `name` of readings of the gas of the first source of `base`, whose first line is `header`, checked against the world of a scenario: its
    /// `base` in its local `frame`.
    ///
    /// # Errors
    /// A header that lacks a column.
    pub fn new(
        name: &str,
        header: &str,
        base: DispersionSpec,
        frame: LocalFrame,
    ) -> Result<Self, ObservationError> {
        let mut join = FileJoin::of(base.sources.first().map_or_else(Gas::default, |s| s.gas));
        let header = join.header(name, &cells_of(header));
        Ok(Self {
            layout: join.layout(header)?,
            join,
            progress: Progress::default(),
            line: 1,
            recent: VecDeque::new(),
            flaws: Vec::new(),
            base,
            frame,
        })
    }

    /// What the reader should be told although it is no error.
    pub fn notices(&self) -> &[String] {
        &self.join.notices
    }

    /// Takes in the next line; nothing for an empty one, or one without a place.
    ///
    /// # Errors
    /// A line that is no row, with line and column. The stream goes on with the next.
    pub fn take(&mut self, line: &str) -> Result<Option<Streamed>, ObservationError> {
        self.line += 1;
        if line.trim().is_empty() {
            return Ok(None);
        }
        let cells = cells_of(line);
        let row = self.layout.header.row(self.line, &cells)?;
        let before = self.progress.clone();
        let read = self.join.row(&row, &self.layout, &mut self.progress);
        // A row that is rejected, or comes again, has not been.
        if read.is_err() {
            self.progress = before;
            return Ok(read.map(|_| None)?);
        }
        let again = |row: &ObservationRow| before.last_s.get(&row.platform) == Some(&row.time_s);
        Ok(read?.filter(|row| !again(row)).map(|row| self.checked(row)))
    }

    /// What the checks leave of a row, looked at with those before.
    fn checked(&mut self, row: ObservationRow) -> Streamed {
        self.recent.push_back(row);
        if self.recent.len() > LOOKED_AT {
            self.recent.pop_front();
        }
        let recent = Observations {
            gas: self.join.gas,
            unit: self.layout.unit,
            rows: self.recent.iter().copied().collect(),
            platforms: self.join.platforms.clone(),
            ..Observations::default()
        };
        let checked = checks::check(&recent, &self.base, &self.frame);
        let before = std::mem::replace(&mut self.flaws, checked.flaws);
        let same = |l: &ObservationRow| l.platform == row.platform && l.time_s == row.time_s;
        // Of what began before, that was said then.
        let new = |f: &&DataQuality| f.to_s >= row.time_s && !before.iter().any(|b| is_alike(b, f));
        Streamed {
            row: checked.observations.rows.into_iter().rev().find(same),
            platform: self.join.platforms[row.platform].clone(),
            flaws: self.flaws.iter().filter(new).cloned().collect(),
        }
    }
}

/// Whether two flaws are of one kind, whatever their numbers.
fn is_alike(a: &DataQuality, b: &DataQuality) -> bool {
    let words =
        |f: &DataQuality| -> String { f.message.chars().filter(|c| !c.is_ascii_digit()).collect() };
    a.kind == b.kind && a.platform == b.platform && words(a) == words(b)
}

fn cells_of(line: &str) -> Cells {
    Cells::of(line.as_bytes(), Delimiter::Byte(b','))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scenario;

    const HEADER: &str =
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm,wind_speed_m_s,wind_from_deg";

    fn stream(header: &str) -> Result<ObservationStream, ObservationError> {
        let text = "[site]\nlat_deg=43.4\nlon_deg=-7.8\nground_amsl_m=340\n\
            [[source]]\nlat_deg=43.4\nlon_deg=-7.8\nemission_kg_s=300\n";
        let scenario = Scenario::parse("s.toml", text).unwrap();
        let (base, frame) = (
            scenario.dispersion_spec().unwrap(),
            scenario.frame().unwrap(),
        );
        ObservationStream::new("standard input", header, base, frame)
    }

    #[test]
    fn lines_read_as_the_rows_of_a_file() {
        let lines = [
            "0,drone,43.41,-7.8,700,421,5,270",
            "1,drone,43.4101,-7.8,700,423,,",
            "2,drone,43.4102,-7.8,700,,5,271",
        ];
        let text = format!("{HEADER}\n{}\n", lines.join("\n"));
        let file = super::super::parse(&[("f.csv", text.as_str())], Gas::Co2).unwrap();
        let mut stream = stream(HEADER).unwrap();
        for (line, row) in lines.iter().zip(&file.rows) {
            let streamed = stream.take(line).unwrap().unwrap();
            assert_eq!(
                (streamed.row, streamed.platform.as_str()),
                (Some(*row), "drone")
            );
            assert!(streamed.flaws.is_empty());
        }
    }

    #[test]
    fn what_a_file_would_lose_a_stream_loses_and_says_once() {
        let mut stream = stream(HEADER).unwrap();
        let mut told = 0;
        for t in 0..40 {
            // A receiver without a fix from 10 to 14 s, and a code for none in the wind at 20 s.
            let place = if (10..15).contains(&t) {
                "0,0"
            } else {
                "43.41,-7.8"
            };
            let wind = if t == 20 { "-999,-999" } else { "5,270" };
            let ppm = 421 + t % 5;
            let line = format!("{t},drone,{place},700,{ppm},{wind}");
            let streamed = stream.take(&line).unwrap().unwrap();
            assert_eq!(streamed.row.is_none(), (10..15).contains(&t), "at {t} s");
            let wind = streamed.row.and_then(|r| r.wind_speed_m_s);
            assert_eq!(wind.is_none(), t == 20 || (10..15).contains(&t), "at {t} s");
            told += streamed.flaws.len();
        }
        // The fix once, and the code in both columns of the wind.
        assert_eq!(told, 3);
    }

    #[test]
    fn a_line_that_is_no_row_is_told_by_its_number_and_the_next_is_read() {
        let mut stream = stream(HEADER).unwrap();
        let good = |t: u32| format!("{t},drone,43.41,-7.8,700,421,5,270");
        assert!(stream.take(&good(1)).unwrap().is_some());
        let told = |s: &mut ObservationStream, line: &str| s.take(line).unwrap_err().to_string();
        let cell = told(&mut stream, "2,drone,north,-7.8,700,421,5,270");
        assert!(
            cell.contains("line 3, column lat_deg: found \"north\""),
            "{cell}"
        );
        let cells = told(&mut stream, "2,drone,43.41");
        assert!(
            cells.contains("line 4: 3 cells; expected 8 cells"),
            "{cells}"
        );
        assert!(told(&mut stream, &good(0)).contains("increase"));
        // Said again, it is left out; later, it counts.
        assert_eq!(stream.take(&good(1)), Ok(None));
        assert_eq!(stream.take("  "), Ok(None));
        assert!(stream.take(&good(2)).unwrap().is_some());
        let header = super::tests::stream("time_s,platform")
            .unwrap_err()
            .to_string();
        assert!(header.contains("column lat_deg: missing"), "{header}");
    }
}
