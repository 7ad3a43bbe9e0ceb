//! Messages of ROS 2 in bytes, read by their definitions and written.
//!
//! Formats: design.ros2.org, *ROS 2 Message definition*; OMG, *DDS X-Types 1.3*, 7.4.3 (XCDR1: values are aligned to
//! their own size, behind four bytes that say which end comes first).

use crate::binary::Kind;
use std::collections::BTreeMap;

/// Longer arrays are images and clouds.
const LONGEST_ARRAY: usize = 16;
/// Types within types at most: definitions that hold themselves are damage.
const DEEPEST: usize = 12;

/// The fields of the types of a definition, by the types' names without package.
#[derive(Debug, Default)]
pub struct Definitions(BTreeMap<String, Vec<Field>>);

#[derive(Debug, Clone)]
struct Field {
    name: String,
    kind: String,
    array: Option<Array>,
}

#[derive(Debug, Clone, Copy)]
enum Array {
    Fixed(usize),
    Counted,
}

/// A type's name without its package.
pub fn short(kind: &str) -> &str {
    kind.rsplit('/').next().unwrap_or(kind)
}

impl Definitions {
    /// Those of the definition `text` of the type `root`.
    pub fn parse(root: &str, text: &str) -> Self {
        let mut all = Self::default();
        let mut current = short(root).to_owned();
        all.0.insert(current.clone(), Vec::new());
        for line in text.lines() {
            let line = line.split('#').next().unwrap_or("").trim();
            if line.is_empty() || line.starts_with("===") {
                continue;
            }
            if let Some(kind) = line.strip_prefix("MSG:") {
                short(kind.trim()).clone_into(&mut current);
                all.0.entry(current.clone()).or_default();
                continue;
            }
            // A constant has a sign of equality and no place in the bytes.
            let mut words = line.split_whitespace();
            if let (Some(kind), Some(name)) = (words.next(), words.next())
                && !name.contains('=')
                && words.next() != Some("=")
            {
                let (kind, array) = array_of(kind);
                let field = Field {
                    name: name.to_owned(),
                    kind: short(kind.split("<=").next().unwrap_or(kind)).to_owned(),
                    array,
                };
                all.0.entry(current.clone()).or_default().push(field);
            }
        }
        for kind in ["Time", "Duration"] {
            let part = |name: &str, kind: &str| Field {
                name: name.to_owned(),
                kind: kind.to_owned(),
                array: None,
            };
            let parts = || vec![part("sec", "int32"), part("nanosec", "uint32")];
            all.0.entry(kind.to_owned()).or_insert_with(parts);
        }
        all
    }
}

fn array_of(kind: &str) -> (&str, Option<Array>) {
    let Some((kind, count)) = kind.split_once('[') else {
        return (kind, None);
    };
    let count = count.trim_end_matches(']').parse();
    (kind, Some(count.map_or(Array::Counted, Array::Fixed)))
}

/// Reads a message's bytes.
#[derive(Debug)]
pub struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    little: bool,
}

impl<'a> Cdr<'a> {
    /// A message; none without its first four bytes.
    pub fn new(data: &'a [u8]) -> Option<Self> {
        let (head, bytes) = data.split_at_checked(4)?;
        Some(Self {
            bytes,
            at: 0,
            little: head[1] & 1 == 1,
        })
    }

    fn number(&mut self, kind: &str) -> Option<f64> {
        self.read(match kind {
            "bool" | "uint8" | "byte" | "char" => Kind::U8,
            "int8" => Kind::I8,
            "int16" => Kind::I16,
            "uint16" => Kind::U16,
            "int32" => Kind::I32,
            "uint32" => Kind::U32,
            "int64" => Kind::I64,
            "uint64" => Kind::U64,
            "float32" => Kind::F32,
            "float64" => Kind::F64,
            _ => return None,
        })
    }

    /// The next number, aligned to its own size.
    fn read(&mut self, kind: Kind) -> Option<f64> {
        self.at = self.at.next_multiple_of(kind.width());
        let bytes = self.bytes.get(self.at..self.at + kind.width())?;
        self.at += kind.width();
        Some(match self.little {
            true => kind.little_endian(bytes),
            false => kind.big_endian(bytes),
        })
    }

    fn count(&mut self) -> Option<usize> {
        let count = self.read(Kind::U32)? as usize;
        (count <= self.bytes.len()).then_some(count)
    }

    /// All numbers of a `kind` under `path`; none where the bytes end or the type is not described.
    pub fn all(
        &mut self,
        definitions: &Definitions,
        kind: &str,
        path: &str,
        depth: usize,
        found: &mut Vec<(String, f64)>,
    ) -> Option<()> {
        if kind == "string" {
            let count = self.count()?;
            self.at = self.at.checked_add(count)?;
            return Some(());
        }
        if let Some(fields) = definitions.0.get(kind) {
            if depth == DEEPEST {
                return None;
            }
            for field in fields {
                let inner = if path.is_empty() {
                    field.name.clone()
                } else {
                    format!("{path}.{}", field.name)
                };
                match field.array {
                    None => self.all(definitions, &field.kind, &inner, depth + 1, found)?,
                    Some(array) => {
                        let count = match array {
                            Array::Fixed(count) => count,
                            Array::Counted => self.count()?,
                        };
                        for k in 0..count {
                            let at = format!("{inner}[{k}]");
                            let kept = found.len();
                            self.all(definitions, &field.kind, &at, depth + 1, found)?;
                            if k >= LONGEST_ARRAY {
                                found.truncate(kept);
                            }
                        }
                    }
                }
            }
            return Some(());
        }
        let value = self.number(kind)?;
        found.push((path.to_owned(), value));
        Some(())
    }
}

/// The bytes before a message whose numbers have their low end first.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Writes a message's bytes.
#[derive(Debug)]
pub struct CdrWriter(Vec<u8>);

impl Default for CdrWriter {
    fn default() -> Self {
        Self(LITTLE_ENDIAN.to_vec())
    }
}

impl CdrWriter {
    /// A value in its own bytes, low end first.
    fn put<const N: usize>(mut self, bytes: [u8; N]) -> Self {
        let begun = self.0.len() - LITTLE_ENDIAN.len();
        self.0
            .resize(begun.next_multiple_of(N) + LITTLE_ENDIAN.len(), 0);
        self.0.extend(bytes);
        self
    }

    /// A `uint8` or `int8`.
    pub fn byte(self, value: u8) -> Self {
        self.put([value])
    }

    /// A `uint16`.
    pub fn u16(self, value: u16) -> Self {
        self.put(value.to_le_bytes())
    }

    /// A `float64`.
    pub fn f64(self, value: f64) -> Self {
        self.put(value.to_le_bytes())
    }

    /// Several `float64` of a fixed number.
    pub fn f64s(self, values: &[f64]) -> Self {
        values.iter().fold(self, |cdr, value| cdr.f64(*value))
    }

    /// A `string`, which ends with a zero that is counted.
    pub fn string(self, text: &str) -> Self {
        let mut cdr = self.put((text.len() as u32 + 1).to_le_bytes());
        cdr.0.extend(text.bytes());
        cdr.0.push(0);
        cdr
    }

    /// A `std_msgs/Header`: ns since 1970 and a frame.
    pub fn header(self, unix_ns: i64, frame: &str) -> Self {
        let second = unix_ns.div_euclid(1_000_000_000) as i32;
        let rest_ns = unix_ns.rem_euclid(1_000_000_000) as u32;
        self.put(second.to_le_bytes())
            .put(rest_ns.to_le_bytes())
            .string(frame)
    }

    /// The message.
    pub fn finish(self) -> Vec<u8> {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_written_is_read(frame in "[a-z]{0,9}", byte: u8, word: u16, value in -1e9..1e9f64, ns in 0..1i64 << 60) {
            let definitions = Definitions::parse(
                "a/msg/M",
                "std_msgs/Header header\nuint8 byte\nstring text\nuint16 word\nfloat64[2] value\n\
                 ===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n",
            );
            let bytes = CdrWriter::default().header(ns, &frame).byte(byte).string(&frame).u16(word)
                .f64s(&[value, -value]).finish();
            let mut found = Vec::new();
            Cdr::new(&bytes).unwrap().all(&definitions, "M", "", 0, &mut found).unwrap();
            let found: Vec<(&str, f64)> = found.iter().map(|(n, v)| (n.as_str(), *v)).collect();
            let expected = [
                ("header.stamp.sec", (ns / 1_000_000_000) as f64),
                ("header.stamp.nanosec", (ns % 1_000_000_000) as f64),
                ("byte", f64::from(byte)),
                ("word", f64::from(word)),
                ("value[0]", value),
                ("value[1]", -value),
            ];
            prop_assert_eq!(found, expected);
        }
    }
}
