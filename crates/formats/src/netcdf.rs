//! NetCDF in its classic form: what readers and writers share, and the writer.
//!
//! Layout: Unidata, *NetCDF Classic Format Specification*. Numbers are big endian; names, attributes and values are
//! padded to four bytes. Written is version 2, whose places in the file have eight bytes.

use crate::binary::Kind;

/// Tags of the lists in a file's head.
const DIMENSIONS: u32 = 0x0A;
const VARIABLES: u32 = 0x0B;
const ATTRIBUTES: u32 = 0x0C;
/// Types of values.
/// Letters.
pub const CHAR: u32 = 2;
const INT: u32 = 4;
const DOUBLE: u32 = 6;

/// The numbers that values of a type are, letters too; none of a type that does not exist.
pub fn kind(of: u32) -> Option<Kind> {
    Some(match of {
        1 => Kind::I8,
        CHAR | 7 => Kind::U8,
        3 => Kind::I16,
        8 => Kind::U16,
        INT => Kind::I32,
        9 => Kind::U32,
        5 => Kind::F32,
        DOUBLE => Kind::F64,
        10 => Kind::I64,
        11 => Kind::U64,
        _ => return None,
    })
}

/// Values of a variable or an attribute.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Letters.
    Char(Vec<u8>),
    /// Whole numbers.
    Int(Vec<i32>),
    /// Numbers.
    Double(Vec<f64>),
}

impl From<&str> for Values {
    fn from(text: &str) -> Self {
        Self::Char(text.as_bytes().to_vec())
    }
}

impl Values {
    fn kind(&self) -> u32 {
        match self {
            Self::Char(_) => CHAR,
            Self::Int(_) => INT,
            Self::Double(_) => DOUBLE,
        }
    }

    fn count(&self) -> usize {
        match self {
            Self::Char(values) => values.len(),
            Self::Int(values) => values.len(),
            Self::Double(values) => values.len(),
        }
    }

    /// The values in bytes, padded.
    fn bytes(&self) -> Vec<u8> {
        let mut bytes: Vec<u8> = match self {
            Self::Char(values) => values.clone(),
            Self::Int(values) => values.iter().flat_map(|v| v.to_be_bytes()).collect(),
            Self::Double(values) => values.iter().flat_map(|v| v.to_be_bytes()).collect(),
        };
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes
    }
}

/// A name with what it says.
pub type Attribute = (&'static str, Values);

/// A dimension: its name and length, 1 or more.
pub type Dimension = (&'static str, usize);

/// A variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Numbers of its dimensions, the slowest first.
    pub over: Vec<usize>,
    /// What is said of it.
    pub attributes: Vec<Attribute>,
    /// Its values, as many as its dimensions have places.
    pub values: Values,
}

/// The bytes of a file.
pub fn file(dimensions: &[Dimension], about: &[Attribute], variables: &[Variable]) -> Vec<u8> {
    // The places of the values follow from the length of the head, which does not depend on them.
    let begin = head(dimensions, about, variables, 0).len();
    let mut bytes = head(dimensions, about, variables, begin as u64);
    for variable in variables {
        bytes.extend(variable.values.bytes());
    }
    bytes
}

fn head(
    dimensions: &[Dimension],
    about: &[Attribute],
    variables: &[Variable],
    begin: u64,
) -> Vec<u8> {
    // No records: no dimension is unlimited.
    let mut head = b"CDF\x02\0\0\0\0".to_vec();
    list(&mut head, DIMENSIONS, dimensions, |head, (name, length)| {
        text(head, name);
        number(head, *length);
    });
    attributes(&mut head, about);
    let mut at = begin;
    list(&mut head, VARIABLES, variables, |head, variable| {
        text(head, &variable.name);
        number(head, variable.over.len());
        variable.over.iter().for_each(|d| number(head, *d));
        attributes(head, &variable.attributes);
        head.extend(variable.values.kind().to_be_bytes());
        let bytes = variable.values.bytes().len();
        number(head, bytes);
        head.extend(at.to_be_bytes());
        at += bytes as u64;
    });
    head
}

fn attributes(head: &mut Vec<u8>, all: &[Attribute]) {
    list(head, ATTRIBUTES, all, |head, (name, values)| {
        text(head, name);
        head.extend(values.kind().to_be_bytes());
        number(head, values.count());
        head.extend(values.bytes());
    });
}

/// A list behind its tag; of an empty one both are 0.
fn list<T>(head: &mut Vec<u8>, tag: u32, all: &[T], mut each: impl FnMut(&mut Vec<u8>, &T)) {
    head.extend(if all.is_empty() { 0 } else { tag }.to_be_bytes());
    number(head, all.len());
    all.iter().for_each(|one| each(head, one));
}

fn text(head: &mut Vec<u8>, text: &str) {
    number(head, text.len());
    head.extend(Values::from(text).bytes());
}

/// A count in four bytes; what has more is told by its largest value, as the format asks.
fn number(head: &mut Vec<u8>, number: usize) {
    head.extend(u32::try_from(number).unwrap_or(u32::MAX).to_be_bytes());
}
