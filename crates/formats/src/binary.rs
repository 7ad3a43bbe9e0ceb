//! Numbers in bytes, of either byte order.

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(
    missing_docs,
    reason = "the names say it: signed, unsigned or floating, and bits"
)]
pub enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Kind {
    /// Bytes of one.
    pub fn width(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number at the beginning of `bytes`, low byte first; NaN where they are too few.
    pub fn little_endian(self, bytes: &[u8]) -> f64 {
        self.number(bytes, false)
    }

    /// The same, high byte first.
    pub fn big_endian(self, bytes: &[u8]) -> f64 {
        self.number(bytes, true)
    }

    fn number(self, bytes: &[u8], big: bool) -> f64 {
        let width = self.width();
        let Some(own) = bytes.get(..width) else {
            return f64::NAN;
        };
        let mut all = [0; 8];
        all[..width].copy_from_slice(own);
        if big {
            all[..width].reverse();
        }
        let [a, b, c, d, ..] = all;
        match self {
            Self::I8 => i8::from_le_bytes([a]).into(),
            Self::U8 => a.into(),
            Self::I16 => i16::from_le_bytes([a, b]).into(),
            Self::U16 => u16::from_le_bytes([a, b]).into(),
            Self::I32 => i32::from_le_bytes([a, b, c, d]).into(),
            Self::U32 => u32::from_le_bytes([a, b, c, d]).into(),
            Self::I64 => i64::from_le_bytes(all) as f64,
            Self::U64 => u64::from_le_bytes(all) as f64,
            Self::F32 => f32::from_le_bytes([a, b, c, d]).into(),
            Self::F64 => f64::from_le_bytes(all),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // python3: struct.pack("<h", -2), struct.pack(">I", 3_000_000_000), struct.pack("<f", 1.5) and so on.
    #[test]
    fn numbers_are_those_of_python() {
        assert_eq!(Kind::I16.little_endian(b"\xfe\xff"), -2.0);
        assert_eq!(Kind::I16.big_endian(b"\xff\xfe"), -2.0);
        assert_eq!(Kind::U32.big_endian(b"\xb2\xd0\x5e\x00"), 3e9);
        assert_eq!(Kind::F32.little_endian(b"\x00\x00\xc0\x3f??"), 1.5);
        assert_eq!(Kind::F64.big_endian(b"\xc0\x04\0\0\0\0\0\0"), -2.5);
        assert_eq!(Kind::I64.little_endian(&[0xff; 8]), -1.0);
        assert!(Kind::U64.little_endian(&[0; 7]).is_nan());
    }
}
