//! Bytes of text in the encodings in which instruments and spreadsheets write it.

use std::io::{self, Read};

/// Reads UTF-16 as UTF-8. What is no pair of surrogates becomes U+FFFD.
struct Utf16<R> {
    inner: R,
    big_endian: bool,
    raw: Vec<u8>,
    ready: Vec<u8>,
    given: usize,
    ended: bool,
}

/// Bytes that are read at a time.
const PIECE: usize = 64 * 1024;

impl<R: Read> Utf16<R> {
    fn refill(&mut self) -> io::Result<()> {
        let kept = self.raw.len();
        self.raw.resize(kept + PIECE, 0);
        let got = self.inner.read(&mut self.raw[kept..])?;
        self.raw.truncate(kept + got);
        self.ended = got == 0;
        let pair = |b: &[u8]| match self.big_endian {
            true => u16::from_be_bytes([b[0], b[1]]),
            false => u16::from_le_bytes([b[0], b[1]]),
        };
        let mut units: Vec<u16> = self.raw.chunks_exact(2).map(pair).collect();
        // The first half of a pair waits for its second.
        if !self.ended && units.last().is_some_and(|u| (0xD800..0xDC00).contains(u)) {
            units.pop();
        }
        self.raw.drain(..units.len() * 2);
        self.ready.clear();
        self.given = 0;
        let mut buffer = [0; 4];
        for c in char::decode_utf16(units) {
            let c = c.unwrap_or(char::REPLACEMENT_CHARACTER);
            self.ready
                .extend_from_slice(c.encode_utf8(&mut buffer).as_bytes());
        }
        Ok(())
    }
}

impl<R: Read> Read for Utf16<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.given == self.ready.len() && !self.ended {
            self.refill()?;
        }
        let count = out.len().min(self.ready.len() - self.given);
        out[..count].copy_from_slice(&self.ready[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}

/// `inner` as text that is UTF-8, or of one byte a letter, and how that is called where it is not UTF-8.
///
/// # Errors
/// `inner`'s.
pub fn text<'a>(
    mut inner: Box<dyn Read + 'a>,
) -> io::Result<(Box<dyn Read + 'a>, Option<&'static str>)> {
    let mut first = Vec::new();
    inner.by_ref().take(4).read_to_end(&mut first)?;
    let rest = |from: usize, first: &[u8], inner| -> Box<dyn Read + 'a> {
        Box::new(io::Cursor::new(first[from..].to_vec()).chain(inner))
    };
    let utf16 = |inner, big_endian| -> Box<dyn Read + 'a> {
        Box::new(Utf16 {
            inner,
            big_endian,
            raw: Vec::new(),
            ready: Vec::new(),
            given: 0,
            ended: false,
        })
    };
    Ok(match first[..] {
        [0xEF, 0xBB, 0xBF, ..] => (rest(3, &first, inner), None),
        [0xFF, 0xFE, ..] => (utf16(rest(2, &first, inner), false), Some("UTF-16")),
        [0xFE, 0xFF, ..] => (utf16(rest(2, &first, inner), true), Some("UTF-16")),
        // Two letters of ASCII in UTF-16 without a mark.
        [a, 0, b, 0] if a != 0 && b != 0 => (utf16(rest(0, &first, inner), false), Some("UTF-16")),
        [0, a, 0, b] if a != 0 && b != 0 => (utf16(rest(0, &first, inner), true), Some("UTF-16")),
        _ => (rest(0, &first, inner), None),
    })
}

/// A cell's or line's text: UTF-8, or else Latin-1, in which every byte is a letter.
pub fn letters(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|b| char::from(*b)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> (String, Option<&'static str>) {
        let (mut reader, name) = text(Box::new(bytes)).unwrap();
        let mut out = Vec::new();
        reader.read_to_end(&mut out).unwrap();
        (letters(&out), name)
    }

    #[test]
    fn every_encoding_gives_the_same_text() {
        // python3: "T (°C);é😀\n".encode("utf-16-le") and so on; long, so that pieces end within letters.
        let text = "T (°C);é😀\n".repeat(20_000);
        let mut little = vec![0xFF, 0xFE];
        little.extend(text.encode_utf16().flat_map(u16::to_le_bytes));
        let mut big = vec![0xFE, 0xFF];
        big.extend(text.encode_utf16().flat_map(u16::to_be_bytes));
        assert_eq!(read(&little), (text.clone(), Some("UTF-16")));
        assert_eq!(read(&big), (text.clone(), Some("UTF-16")));
        assert_eq!(read(&little[2..]).0, text);
        let marked = [&[0xEF, 0xBB, 0xBF], text.as_bytes()].concat();
        assert_eq!(read(&marked), (text, None));
        assert_eq!(read(b"T (\xB0C)").0, "T (°C)");
        assert_eq!(read(b"").0, "");
    }
}
