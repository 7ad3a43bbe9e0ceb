//! The rows of a campaign as CSV and as Parquet: one mission a row, the same columns in both.

use super::{MissionRow, PEAK, Stated};
use crate::summary::CORRECTED;
use formats::table::{self, Cells};
use parquet::errors::ParquetError;
use protocol::message::FluxMethod;

/// A number of each mission, where it is known.
type NumberOf = Box<dyn Fn(&MissionRow) -> Option<f64>>;

/// What stands in a column.
enum Of {
    Text(fn(&MissionRow) -> String),
    Whole(fn(&MissionRow) -> i64),
    Number(NumberOf),
}

struct Column {
    name: String,
    cells: Of,
}

fn text(name: &str, of: fn(&MissionRow) -> String) -> Column {
    Column {
        name: name.to_owned(),
        cells: Of::Text(of),
    }
}

fn whole(name: &str, of: fn(&MissionRow) -> i64) -> Column {
    Column {
        name: name.to_owned(),
        cells: Of::Whole(of),
    }
}

fn number(name: impl Into<String>, of: impl Fn(&MissionRow) -> Option<f64> + 'static) -> Column {
    Column {
        name: name.into(),
        cells: Of::Number(Box::new(of)),
    }
}

/// A column of an error and one of the standard deviation that was stated with it.
fn errors(
    name: &str,
    unit: &str,
    find: impl Fn(&MissionRow) -> Option<&Stated> + Copy + 'static,
) -> [Column; 2] {
    [
        number(format!("{name}_error{unit}"), move |row| {
            find(row).map(|s| s.error)
        }),
        number(format!("{name}_sd{unit}"), move |row| {
            find(row).and_then(|s| s.sd)
        }),
    ]
}

/// Names and units in headers of the numbers that are corrected, in the order of [`CORRECTED`].
const NUMBERS: [(&str, &str); 6] = [
    ("axis", "_deg"),
    ("effective_height", "_m"),
    ("c_max", "_ppm"),
    ("sigma_y_scale", ""),
    ("sigma_z_scale", ""),
    ("background", "_ppm"),
];

fn columns() -> Vec<Column> {
    let mut all = vec![
        text("reality", |r| r.key.reality.clone()),
        text("strategy", |r| r.key.strategy.clone()),
        whole("vehicles", |r| r.key.vehicles as i64),
        whole("real", |r| r.real as i64),
        whole("seed", |r| r.key.seed.cast_signed()),
        text("status", |r| r.status.words().to_owned()),
        number("near_s", |r| r.near.map(|m| m.time_s)),
        number("near_km", |r| r.near.map(|m| m.flown_km)),
        number("known_s", |r| r.known.map(|m| m.time_s)),
        number("known_km", |r| r.known.map(|m| m.flown_km)),
        number("peak_off_m", |r| r.peak_off_m),
        number("map_rmse_ppm", |r| r.map.map(|m| m.rmse_ppm)),
        number("plume_rms_ppm", |r| r.map.map(|m| m.plume_rms_ppm)),
    ];
    all.extend(errors("peak", "_ppm", |r| r.stated_of(PEAK)));
    for ((name, unit), number) in NUMBERS.into_iter().zip(&CORRECTED) {
        all.extend(errors(name, unit, |r| r.stated_of(number.name)));
    }
    let (inference, balance) = (FluxMethod::Inference, FluxMethod::MassBalance);
    all.extend(errors("flux_inference", "_pct", move |r| {
        r.flux_by(inference)
    }));
    all.extend(errors("flux_mass_balance", "_pct", move |r| {
        r.flux_by(balance)
    }));
    all.extend(errors("flux_combined", "_pct", |r| {
        r.flux_by(FluxMethod::Combined)
    }));
    all.push(number("confirmed_s", |r| r.confirmed.map(|m| m.time_s)));
    all.push(number("confirmed_km", |r| r.confirmed.map(|m| m.flown_km)));
    all.push(number("flown_km", |r| Some(r.flown_km)));
    all.push(whole("landed", |r| r.landed as i64));
    all.push(text("digest", |r| r.digest.clone()));
    all
}

/// The columns filled with what the rows say.
fn filled(rows: &[MissionRow]) -> Vec<table::Column> {
    let filled = columns().into_iter().map(|column| {
        let cells = match column.cells {
            Of::Text(of) => Cells::Text(rows.iter().map(of).collect()),
            Of::Whole(of) => Cells::Whole(rows.iter().map(of).collect()),
            Of::Number(of) => Cells::Number(rows.iter().map(of).collect()),
        };
        table::Column::new(column.name, cells)
    });
    filled.collect()
}

/// The rows as CSV; what is not known is empty.
///
/// # Errors
/// None that is not a defect: the rows are in memory.
pub fn csv(rows: &[MissionRow]) -> Result<Vec<u8>, csv::Error> {
    table::csv(&filled(rows))
}

/// The rows as Parquet; what is not known is null.
///
/// # Errors
/// None that is not a defect: the rows are in memory.
pub fn parquet(rows: &[MissionRow]) -> Result<Vec<u8>, ParquetError> {
    table::parquet("mission", &filled(rows))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::made_up;

    fn rows() -> Vec<MissionRow> {
        let known = [Some(300.0), None, Some(420.5), Some(90.0)];
        let missions = made_up::question().missions().into_iter();
        missions
            .zip(known)
            .map(|(key, s)| made_up::row(key, s))
            .collect()
    }

    #[test]
    fn csv_has_a_row_a_mission_and_leaves_the_unknown_empty() {
        let text = String::from_utf8(csv(&rows()).unwrap()).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 5);
        assert!(
            lines[0]
                .starts_with("reality,strategy,vehicles,real,seed,status,near_s,near_km,known_s")
        );
        assert!(
            lines[1].starts_with("own,cs-ea,6,1,1,confirmed,150,3,300,6,30,20,80,,,1.5,1,"),
            "{}",
            lines[1]
        );
        assert!(
            lines[2].starts_with("own,cs-ea,6,1,2,doubtful,,,,,,20,80,"),
            "{}",
            lines[2]
        );
    }

    #[test]
    fn parquet_reads_back_as_what_csv_says() {
        use parquet::file::reader::{FileReader as _, SerializedFileReader};
        use parquet::record::Field;
        let bytes = parquet(&rows()).unwrap();
        let reader = SerializedFileReader::new(bytes::Bytes::from(bytes)).unwrap();
        let text = csv(&rows()).unwrap();
        let mut table = csv::Reader::from_reader(text.as_slice());
        let mut count = 0;
        for (there, here) in reader.get_row_iter(None).unwrap().zip(table.records()) {
            let there = there.unwrap();
            let said = there.get_column_iter().map(|(_, field)| match field {
                Field::Null => String::new(),
                Field::Str(text) => text.clone(),
                Field::Long(whole) => whole.to_string(),
                Field::Double(number) => number.to_string(),
                other => panic!("{other:?}"),
            });
            let here = here.unwrap();
            assert_eq!(said.collect::<Vec<_>>(), here.iter().collect::<Vec<_>>());
            count += 1;
        }
        assert_eq!(count, 4);
    }
}
