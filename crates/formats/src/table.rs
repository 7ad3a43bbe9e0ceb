//! A table of columns, as CSV and as Parquet.

use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
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

/// The table as Parquet; what is not known is null.
///
/// # Errors
/// None that is not a defect: the columns are in memory and of one length.
pub fn parquet(name: &str, columns: &[Column]) -> Result<Vec<u8>, ParquetError> {
    let fields: Result<Vec<_>, ParquetError> = columns.iter().map(field).collect();
    let schema = Type::group_type_builder(name)
        .with_fields(fields?)
        .build()?;
    let mut bytes = Vec::new();
    let properties = Arc::new(WriterProperties::builder().build());
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
