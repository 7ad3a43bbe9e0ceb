//! The rows of a campaign as CSV and as Parquet: one mission a row, the same columns in both.

use super::{MissionRow, PEAK, Stated};
use crate::summary::CORRECTED;
use crate::text;
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;
use protocol::message::FluxMethod;
use std::sync::Arc;

/// What stands in a column.
#[derive(Debug, Clone, PartialEq)]
enum Cell {
    Text(String),
    Whole(i64),
    Number(Option<f64>),
}

struct Column {
    name: String,
    of: Box<dyn Fn(&MissionRow) -> Cell>,
}

fn column(name: impl Into<String>, of: impl Fn(&MissionRow) -> Cell + 'static) -> Column {
    Column {
        name: name.into(),
        of: Box::new(of),
    }
}

/// A column of an error and one of the standard deviation that was stated with it.
fn errors(
    name: &str,
    unit: &str,
    find: impl Fn(&MissionRow) -> Option<&Stated> + Copy + 'static,
) -> [Column; 2] {
    [
        column(format!("{name}_error{unit}"), move |row| {
            Cell::Number(find(row).map(|s| s.error))
        }),
        column(format!("{name}_sd{unit}"), move |row| {
            Cell::Number(find(row).and_then(|s| s.sd))
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
    let number =
        |name, of: fn(&MissionRow) -> Option<f64>| column(name, move |row| Cell::Number(of(row)));
    let mut all = vec![
        column("reality", |r| Cell::Text(r.key.reality.clone())),
        column("strategy", |r| Cell::Text(r.key.strategy.clone())),
        column("vehicles", |r| Cell::Whole(r.key.vehicles as i64)),
        column("real", |r| Cell::Whole(r.real as i64)),
        column("seed", |r| Cell::Whole(r.key.seed.cast_signed())),
        column("status", |r| Cell::Text(text::status(r.status).to_owned())),
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
    all.push(column("flown_km", |r| Cell::Number(Some(r.flown_km))));
    all.push(column("landed", |r| Cell::Whole(r.landed as i64)));
    all.push(column("digest", |r| Cell::Text(r.digest.clone())));
    all
}

/// The rows as CSV; what is not known is empty.
///
/// # Errors
/// None that is not a defect: the rows are in memory.
pub fn csv(rows: &[MissionRow]) -> Result<Vec<u8>, csv::Error> {
    let columns = columns();
    let mut out = csv::Writer::from_writer(Vec::new());
    out.write_record(columns.iter().map(|c| &c.name))?;
    for row in rows {
        out.write_record(columns.iter().map(|c| match (c.of)(row) {
            Cell::Text(text) => text,
            Cell::Whole(whole) => whole.to_string(),
            Cell::Number(number) => number.map_or(String::new(), |v| v.to_string()),
        }))?;
    }
    out.into_inner().map_err(|e| e.into_error().into())
}

/// The rows as Parquet; what is not known is null.
///
/// # Errors
/// None that is not a defect: the rows are in memory.
pub fn parquet(rows: &[MissionRow]) -> Result<Vec<u8>, ParquetError> {
    let columns = columns();
    let cells: Vec<Vec<Cell>> = columns
        .iter()
        .map(|c| rows.iter().map(|row| (c.of)(row)).collect())
        .collect();
    let fields = columns.iter().zip(&cells).map(|(column, cells)| {
        let (physical, logical, repetition) = match cells.first() {
            Some(Cell::Text(_)) => (
                Physical::BYTE_ARRAY,
                Some(LogicalType::String),
                Repetition::REQUIRED,
            ),
            Some(Cell::Whole(_)) => (Physical::INT64, None, Repetition::REQUIRED),
            Some(Cell::Number(_)) | None => (Physical::DOUBLE, None, Repetition::OPTIONAL),
        };
        let field = Type::primitive_type_builder(&column.name, physical)
            .with_logical_type(logical)
            .with_repetition(repetition);
        Ok(Arc::new(field.build()?))
    });
    let fields = fields.collect::<Result<Vec<_>, ParquetError>>()?;
    let schema = Type::group_type_builder("mission")
        .with_fields(fields)
        .build()?;
    let mut bytes = Vec::new();
    let properties = Arc::new(WriterProperties::builder().build());
    let mut file = SerializedFileWriter::new(&mut bytes, Arc::new(schema), properties)?;
    let mut group = file.next_row_group()?;
    for cells in &cells {
        write(&mut group, cells)?;
    }
    group.close()?;
    file.close()?;
    Ok(bytes)
}

/// The next column of a group.
fn write(
    group: &mut SerializedRowGroupWriter<'_, &mut Vec<u8>>,
    cells: &[Cell],
) -> Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else {
        return Ok(());
    };
    match cells.first() {
        Some(Cell::Text(_)) => {
            let texts = cells.iter().filter_map(|c| match c {
                Cell::Text(text) => Some(ByteArray::from(text.as_str())),
                _ => None,
            });
            let texts: Vec<ByteArray> = texts.collect();
            column
                .typed::<ByteArrayType>()
                .write_batch(&texts, None, None)?;
        }
        Some(Cell::Whole(_)) => {
            let wholes = cells.iter().filter_map(|c| match c {
                Cell::Whole(whole) => Some(*whole),
                _ => None,
            });
            let wholes: Vec<i64> = wholes.collect();
            column
                .typed::<Int64Type>()
                .write_batch(&wholes, None, None)?;
        }
        Some(Cell::Number(_)) | None => {
            let number = |c: &Cell| match c {
                Cell::Number(number) => *number,
                _ => None,
            };
            let numbers: Vec<Option<f64>> = cells.iter().map(number).collect();
            let known: Vec<i16> = numbers.iter().map(|n| i16::from(n.is_some())).collect();
            let numbers: Vec<f64> = numbers.into_iter().flatten().collect();
            column
                .typed::<DoubleType>()
                .write_batch(&numbers, Some(&known), None)?;
        }
    }
    column.close()
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
