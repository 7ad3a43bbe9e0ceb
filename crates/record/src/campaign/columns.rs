//! The rows of a campaign as CSV and as Parquet: one mission a row, the same columns in both.

use super::{MissionRow, PEAK, Stated};
use crate::summary::CORRECTED;
use crate::text::status;
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;
use protocol::message::FluxMethod;
use std::sync::Arc;

/// A number of each mission, where it is known.
type NumberOf = Box<dyn Fn(&MissionRow) -> Option<f64>>;

/// What stands in a column.
enum Cells {
    Text(fn(&MissionRow) -> String),
    Whole(fn(&MissionRow) -> i64),
    Number(NumberOf),
}

struct Column {
    name: String,
    cells: Cells,
}

fn text(name: &str, of: fn(&MissionRow) -> String) -> Column {
    Column {
        name: name.to_owned(),
        cells: Cells::Text(of),
    }
}

fn whole(name: &str, of: fn(&MissionRow) -> i64) -> Column {
    Column {
        name: name.to_owned(),
        cells: Cells::Whole(of),
    }
}

fn number(name: impl Into<String>, of: impl Fn(&MissionRow) -> Option<f64> + 'static) -> Column {
    Column {
        name: name.into(),
        cells: Cells::Number(Box::new(of)),
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
        text("status", |r| status(r.status).to_owned()),
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
    all.push(number("flown_km", |r| Some(r.flown_km)));
    all.push(whole("landed", |r| r.landed as i64));
    all.push(text("digest", |r| r.digest.clone()));
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
        out.write_record(columns.iter().map(|c| match &c.cells {
            Cells::Text(of) => of(row),
            Cells::Whole(of) => of(row).to_string(),
            Cells::Number(of) => of(row).map_or(String::new(), |v| v.to_string()),
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
    let fields: Result<Vec<_>, ParquetError> = columns.iter().map(field).collect();
    let schema = Type::group_type_builder("mission")
        .with_fields(fields?)
        .build()?;
    let mut bytes = Vec::new();
    let properties = Arc::new(WriterProperties::builder().build());
    let mut file = SerializedFileWriter::new(&mut bytes, Arc::new(schema), properties)?;
    let mut group = file.next_row_group()?;
    for column in &columns {
        write(&mut group, &column.cells, rows)?;
    }
    group.close()?;
    file.close()?;
    Ok(bytes)
}

/// A column in the schema.
fn field(column: &Column) -> Result<Arc<Type>, ParquetError> {
    let (physical, logical, repetition) = match column.cells {
        Cells::Text(_) => (
            Physical::BYTE_ARRAY,
            Some(LogicalType::String),
            Repetition::REQUIRED,
        ),
        Cells::Whole(_) => (Physical::INT64, None, Repetition::REQUIRED),
        Cells::Number(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
    };
    let field = Type::primitive_type_builder(&column.name, physical)
        .with_logical_type(logical)
        .with_repetition(repetition);
    Ok(Arc::new(field.build()?))
}

/// The next column of a group.
fn write(
    group: &mut SerializedRowGroupWriter<'_, &mut Vec<u8>>,
    cells: &Cells,
    rows: &[MissionRow],
) -> Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else {
        return Ok(());
    };
    match cells {
        Cells::Text(of) => {
            let texts = rows.iter().map(|row| ByteArray::from(of(row).as_str()));
            let texts: Vec<ByteArray> = texts.collect();
            column
                .typed::<ByteArrayType>()
                .write_batch(&texts, None, None)?;
        }
        Cells::Whole(of) => {
            let wholes: Vec<i64> = rows.iter().map(of).collect();
            column
                .typed::<Int64Type>()
                .write_batch(&wholes, None, None)?;
        }
        Cells::Number(of) => {
            let numbers: Vec<Option<f64>> = rows.iter().map(of).collect();
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
