//! A table of columns, as CSV and as Parquet.

use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;
use std::sync::Arc;

/// What stands in a column.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells {
    /// Text.
    Text(Vec<String>),
    /// Whole numbers.
    Whole(Vec<i64>),
    /// Numbers; what is not known is none.
    Number(Vec<Option<f64>>),
    /// Times, ns since 1970: in text by RFC 3339 in UTC.
    Time(Vec<i64>),
}

/// A column.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Its name, with the unit.
    pub name: String,
    /// What stands in it, row by row.
    pub cells: Cells,
}

impl Column {
    /// A column.
    pub fn new(name: impl Into<String>, cells: Cells) -> Self {
        Self {
            name: name.into(),
            cells,
        }
    }
}

impl Cells {
    fn len(&self) -> usize {
        match self {
            Self::Text(cells) => cells.len(),
            Self::Whole(cells) | Self::Time(cells) => cells.len(),
            Self::Number(cells) => cells.len(),
        }
    }

    /// A cell in text; what is not known is empty.
    fn text(&self, row: usize) -> String {
        match self {
            Self::Text(cells) => cells[row].clone(),
            Self::Whole(cells) => cells[row].to_string(),
            Self::Number(cells) => cells[row].map_or(String::new(), |v| v.to_string()),
            Self::Time(cells) => crate::calendar::rfc_3339(cells[row]),
        }
    }
}

/// The table as CSV.
///
/// # Errors
/// None that is not a defect: the columns are in memory and of one length.
pub fn csv(columns: &[Column]) -> Result<Vec<u8>, csv::Error> {
    let mut out = csv::Writer::from_writer(Vec::new());
    out.write_record(columns.iter().map(|c| &c.name))?;
    let rows = columns.iter().map(|c| c.cells.len()).min().unwrap_or(0);
    for row in 0..rows {
        out.write_record(columns.iter().map(|c| c.cells.text(row)))?;
    }
    out.into_inner().map_err(|e| e.into_error().into())
}

/// Ends of names of columns, longest first where one is the end of another, and the unit that they state (UDUNITS).
const UNITS: [(&str, &str); 10] = [
    ("_m_s", "m s-1"),
    ("_kg_s", "kg s-1"),
    ("_ppm", "1e-6"),
    ("_ppb", "1e-9"),
    ("_deg", "degree"),
    ("_hpa", "hPa"),
    ("_pct", "percent"),
    ("_c", "degree_Celsius"),
    ("_m", "m"),
    ("_s", "s"),
];

/// The unit that the name of a column of numbers, or of its standard deviation, states (UDUNITS); `1` for a number
/// without a unit.
fn unit(column: &str) -> &'static str {
    let quantity = column.strip_suffix("_sd").unwrap_or(column);
    let known = UNITS.iter().find(|(end, _)| quantity.ends_with(end));
    known.map_or("1", |(_, unit)| unit)
}

/// The units of all columns of numbers, as a JSON object by their names.
fn units(columns: &[Column]) -> String {
    let numbers = columns
        .iter()
        .filter(|column| matches!(column.cells, Cells::Number(_)));
    let pairs = numbers.map(|column| format!("\"{}\":\"{}\"", column.name, unit(&column.name)));
    format!("{{{}}}", pairs.collect::<Vec<_>>().join(","))
}

/// The table as Parquet; what is not known is null. The file's metadata have the columns' `units` as JSON.
///
/// # Errors
/// None that is not a defect: the columns are in memory and of one length.
pub fn parquet(name: &str, columns: &[Column]) -> Result<Vec<u8>, ParquetError> {
    let fields: Result<Vec<_>, ParquetError> = columns.iter().map(field).collect();
    let schema = Type::group_type_builder(name)
        .with_fields(fields?)
        .build()?;
    let mut bytes = Vec::new();
    let units = KeyValue::new("units".to_owned(), units(columns));
    let properties = WriterProperties::builder().set_key_value_metadata(Some(vec![units]));
    let properties = Arc::new(properties.build());
    let mut file = SerializedFileWriter::new(&mut bytes, Arc::new(schema), properties)?;
    let mut group = file.next_row_group()?;
    for column in columns {
        write(&mut group, &column.cells)?;
    }
    group.close()?;
    file.close()?;
    Ok(bytes)
}

/// A column in the schema.
fn field(column: &Column) -> Result<Arc<Type>, ParquetError> {
    let time = LogicalType::timestamp(true, TimeUnit::NANOS);
    let (physical, logical, repetition) = match column.cells {
        Cells::Text(_) => (
            Physical::BYTE_ARRAY,
            Some(LogicalType::String),
            Repetition::REQUIRED,
        ),
        Cells::Whole(_) => (Physical::INT64, None, Repetition::REQUIRED),
        Cells::Time(_) => (Physical::INT64, Some(time), Repetition::REQUIRED),
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
) -> Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else {
        return Ok(());
    };
    match cells {
        Cells::Text(texts) => {
            let texts: Vec<ByteArray> = texts.iter().map(|t| ByteArray::from(t.as_str())).collect();
            column
                .typed::<ByteArrayType>()
                .write_batch(&texts, None, None)?;
        }
        Cells::Whole(wholes) | Cells::Time(wholes) => {
            column
                .typed::<Int64Type>()
                .write_batch(wholes, None, None)?;
        }
        Cells::Number(numbers) => {
            let known: Vec<i16> = numbers.iter().map(|n| i16::from(n.is_some())).collect();
            let numbers: Vec<f64> = numbers.iter().flatten().copied().collect();
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
    use parquet::file::reader::{FileReader as _, SerializedFileReader};

    #[test]
    fn parquet_states_the_units_of_its_columns() {
        let number = |name: &str| Column::new(name, Cells::Number(vec![Some(1.0)]));
        let columns = [
            number("time_s"),
            Column::new("platform", Cells::Text(vec!["a".to_owned()])),
            number("co2_ppm"),
            number("wind_speed_m_s"),
            number("axis_deg_sd"),
            number("alt_amsl_m"),
            number("temperature_c"),
            number("throttle"),
        ];
        let bytes = bytes::Bytes::from(parquet("reading", &columns).unwrap());
        let read = SerializedFileReader::new(bytes).unwrap();
        let metadata = read.metadata().file_metadata().key_value_metadata();
        let units = metadata.unwrap().iter().find(|pair| pair.key == "units");
        assert_eq!(
            units.unwrap().value.as_deref().unwrap(),
            "{\"time_s\":\"s\",\"co2_ppm\":\"1e-6\",\"wind_speed_m_s\":\"m s-1\",\"axis_deg_sd\":\"degree\",\
             \"alt_amsl_m\":\"m\",\"temperature_c\":\"degree_Celsius\",\"throttle\":\"1\"}"
        );
    }
}
