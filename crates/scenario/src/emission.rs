//! Emissions over time: the files that `emission_series` of a source names, read into its `emission_table`.

use formats::delimited::{Column, Table, TableError};
use plume::schedule::mean_kg_s;
use plume::{PlumeError, Schedule};
use toml::Value;

use crate::Scenario;
use crate::tables::SourceTable;

const COLUMNS: [Column; 2] = [
    Column::required("time_s"),
    Column::required("emission_kg_s"),
];

/// What is wrong with a file that a source names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SeriesRefused {
    /// The file.
    pub file: String,
    /// The key that names it.
    pub key: String,
    /// What is wrong, and what would be right.
    pub why: String,
}

impl SourceTable {
    /// Emission, kg/s: as stated, or the mean of the table; none for a strength that is no emission.
    pub fn mean_emission_kg_s(&self) -> Option<f64> {
        let of_table = || {
            let rows = pairs(self.emission_table.as_deref()?);
            let mean = mean_kg_s(&rows, self.emission_between.unwrap_or_default());
            mean.is_finite().then_some(mean)
        };
        self.emission_kg_s.or_else(of_table)
    }

    /// Its emission over time; none where it is steady.
    ///
    /// # Errors
    /// A table that is no schedule.
    pub(crate) fn schedule(&self) -> Result<Option<Schedule>, PlumeError> {
        let between = self.emission_between.unwrap_or_default();
        let of = |rows: &Vec<[f64; 2]>| Schedule::new(&pairs(rows), between);
        self.emission_table.as_ref().map(of).transpose()
    }
}

impl Scenario {
    /// Puts what the files hold that `emission_series` of sources names, those of the reality too, into their
    /// `emission_table`; `read` gives a file's text.
    ///
    /// # Errors
    /// A file that cannot be read, or is no schedule.
    pub fn read_emission_series(
        &mut self,
        read: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<(), SeriesRefused> {
        for (k, source) in self.sources.iter_mut().enumerate() {
            let between = source.emission_between.unwrap_or_default();
            if let Some(file) = source.emission_series.take() {
                let rows = rows_of(&file, &format!("source.{k}"), read)?;
                let schedule = Schedule::new(&pairs(&rows), between);
                schedule.map_err(|e| refused(&file, &format!("source.{k}"), e.to_string()))?;
                source.emission_table = Some(rows);
            }
        }
        let of_reality = self.reality.iter_mut().flat_map(|r| r.get_mut("source"));
        let sources = of_reality.filter_map(Value::as_array_mut).flatten();
        for (k, source) in sources.filter_map(Value::as_table_mut).enumerate() {
            if let Some(Value::String(file)) = source.remove("emission_series") {
                let rows = rows_of(&file, &format!("reality.source.{k}"), read)?;
                let row = |r: &[f64; 2]| Value::Array(r.map(Value::Float).to_vec());
                let table = Value::Array(rows.iter().map(row).collect());
                source.insert("emission_table".to_owned(), table);
            }
        }
        Ok(())
    }

    /// The same scenario whose times count from `zero_s`.
    #[must_use]
    pub fn counted_from(&self, zero_s: f64) -> Self {
        let mut out = self.clone();
        let tables = out.sources.iter_mut().flat_map(|s| &mut s.emission_table);
        tables.flatten().for_each(|row| row[0] -= zero_s);
        out
    }
}

fn pairs(rows: &[[f64; 2]]) -> Vec<(f64, f64)> {
    rows.iter().map(|[time_s, kg_s]| (*time_s, *kg_s)).collect()
}

fn refused(file: &str, source: &str, why: String) -> SeriesRefused {
    SeriesRefused {
        file: file.to_owned(),
        key: format!("{source}.emission_series"),
        why,
    }
}

fn rows_of(
    file: &str,
    source: &str,
    read: &dyn Fn(&str) -> Result<String, String>,
) -> Result<Vec<[f64; 2]>, SeriesRefused> {
    let rows = read(file).and_then(|text| parsed(&text).map_err(|e| e.to_string()));
    rows.map_err(|why| refused(file, source, why))
}

/// Rows of `time_s,emission_kg_s`; other columns are ignored.
fn parsed(text: &str) -> Result<Vec<[f64; 2]>, TableError> {
    let mut table = Table::open("", text, &COLUMNS, false)?;
    let mut rows = Vec::new();
    while let Some(row) = table.next_row()? {
        rows.push([row.needed(0)?, row.needed(1)?]);
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use crate::Scenario;
    use plume::{DispersionModel, DispersionSpec};

    const TEXT: &str = "[site]\nlat_deg=43.4\nlon_deg=-7.8\nground_amsl_m=340\n\
        [[source]]\nlat_deg=43.4\nlon_deg=-7.8\n";
    const FILE: &str = "emission_kg_s,time_s\n8,100\n0,700\n4,1300\n0,1900\n";

    fn read(name: &str) -> Result<String, String> {
        match name {
            "q.csv" => Ok(FILE.to_owned()),
            "bad.csv" => Ok("time_s,emission_kg_s\n0,1\n1,x\n".to_owned()),
            _ => Err("no such file".to_owned()),
        }
    }

    fn factor(spec: &DispersionSpec, time_s: f64) -> f64 {
        spec.sources[0].schedule.as_ref().unwrap().at(time_s)
    }

    #[test]
    fn a_file_becomes_a_table_that_a_stated_emission_scales() {
        let with = |more: &str| {
            let text = format!("{TEXT}emission_series=\"q.csv\"\n{more}");
            let mut scenario = Scenario::parse("s.toml", &text).unwrap();
            assert!(scenario.dispersion_spec().is_err());
            scenario.read_emission_series(&read).unwrap();
            scenario
        };
        let own = with("");
        assert_eq!(own.sources[0].mean_emission_kg_s(), Some(4.0));
        let spec = own.dispersion_spec().unwrap();
        assert_eq!(
            [100.0, 700.0, 1300.0].map(|t| factor(&spec, t)),
            [2.0, 0.0, 1.0]
        );
        // It writes itself with its table, and is read again without the file.
        let again = Scenario::parse("again.toml", &own.to_toml()).unwrap();
        assert_eq!(again.dispersion_spec().unwrap(), spec);
        let scaled = with("emission_kg_s=6.0\n");
        assert_eq!(scaled.sources[0].mean_emission_kg_s(), Some(6.0));
        let shifted = own.counted_from(100.0).dispersion_spec().unwrap();
        assert_eq!(factor(&shifted, 0.0), 2.0);
        assert_eq!(factor(&shifted, 600.0), 0.0);
        assert!(DispersionModel::new(spec).is_ok());
    }

    #[test]
    fn a_reality_may_have_its_own() {
        let text =
            format!("{TEXT}emission_kg_s=3.0\n[[reality.source]]\nemission_series=\"q.csv\"\n");
        let mut scenario = Scenario::parse("s.toml", &text).unwrap();
        scenario.read_emission_series(&read).unwrap();
        assert!(
            scenario.dispersion_spec().unwrap().sources[0]
                .schedule
                .is_none()
        );
        let reality = scenario.in_reality();
        assert_eq!(reality.sources[0].mean_emission_kg_s(), Some(4.0));
        assert_eq!(factor(&reality.dispersion_spec().unwrap(), 1000.0), 0.0);
    }

    #[test]
    fn what_is_no_series_is_told_by_file_and_key() {
        for (file, says) in [
            ("bad.csv", "line 3, column emission_kg_s: found \"x\""),
            ("none.csv", "no such file"),
        ] {
            let text = format!("{TEXT}emission_series=\"{file}\"\n");
            let mut scenario = Scenario::parse("s.toml", &text).unwrap();
            let refused = scenario.read_emission_series(&read).unwrap_err();
            assert_eq!(refused.key, "source.0.emission_series");
            assert!(refused.why.contains(says), "{refused:?}");
        }
        let parse = |more: &str| Scenario::parse("s.toml", &format!("{TEXT}{more}"));
        let both = parse("c_max_ppm=9.0\nc_max_distance_m=500.0\nemission_series=\"q.csv\"\n");
        assert!(both.unwrap_err().to_string().contains("emission_series"));
        let none = parse("emission_table=[[0.0, 0.0], [1.0, 0.0]]\n");
        assert!(
            none.unwrap_err()
                .to_string()
                .contains("mean emission over its time is zero")
        );
    }
}
