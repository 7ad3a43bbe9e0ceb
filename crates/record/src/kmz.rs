//! KMZ: documents as the files of a ZIP archive.
//!
//! PKWARE, *APPNOTE 6.3*, 4.3: of each file a local header and the deflated bytes, then the central directory and its end.

use crate::RecordError;
use flate2::write::DeflateEncoder;
use flate2::{Compression, Crc};
use std::io::Write as _;

/// The name under which viewers look for a map's document.
pub const DOCUMENT: &str = "doc.kml";
/// Version of the format that deflated files need: 2.0.
const VERSION: u16 = 20;
const DEFLATED: u16 = 8;
/// 1980-01-01, the first day that the format knows: archives of the same document are the same.
const NO_DATE: u16 = (1 << 5) | 1;

/// The archive that holds `files`, each with its name.
///
/// # Errors
/// [`RecordError::Kml`] for files beyond the 4 GB of the format, or more than it can count.
pub fn archive(files: &[(&str, &str)]) -> Result<Vec<u8>, RecordError> {
    let too_large =
        |_| RecordError::Kml("the files are larger than the 4 GB that a KMZ can hold".to_owned());
    let (mut zip, mut directory) = (Vec::new(), Vec::new());
    for (name, text) in files {
        let offset = u32::try_from(zip.len()).map_err(too_large)?;
        let packed = deflated(text)?;
        let packed_bytes = u32::try_from(packed.len()).map_err(too_large)?;
        let bytes = u32::try_from(text.len()).map_err(too_large)?;
        let mut crc = Crc::new();
        crc.update(text.as_bytes());
        let entry = entry(name, crc.sum(), packed_bytes, bytes);
        zip.extend(b"PK\x03\x04");
        zip.extend(&entry);
        zip.extend(name.as_bytes());
        zip.extend(&packed);
        directory.extend(b"PK\x01\x02");
        directory.extend(VERSION.to_le_bytes());
        directory.extend(&entry);
        // No comment, one disk, no attributes.
        directory.extend([0; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let start = u32::try_from(zip.len()).map_err(too_large)?;
    let length = u32::try_from(directory.len()).map_err(too_large)?;
    let count = u16::try_from(files.len()).map_err(too_large)?;
    zip.extend(&directory);
    zip.extend(b"PK\x05\x06\0\0\0\0");
    zip.extend(count.to_le_bytes());
    zip.extend(count.to_le_bytes());
    zip.extend(length.to_le_bytes());
    zip.extend(start.to_le_bytes());
    zip.extend([0; 2]);
    Ok(zip)
}

fn deflated(text: &str) -> Result<Vec<u8>, RecordError> {
    let failed = |e: std::io::Error| RecordError::Kml(e.to_string());
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(text.as_bytes()).map_err(failed)?;
    encoder.finish().map_err(failed)
}

/// What local header and directory say alike of a file.
fn entry(name: &str, crc: u32, packed_bytes: u32, bytes: u32) -> Vec<u8> {
    let mut entry = Vec::new();
    for word in [VERSION, 0, DEFLATED, 0, NO_DATE] {
        entry.extend(word.to_le_bytes());
    }
    for number in [crc, packed_bytes, bytes] {
        entry.extend(number.to_le_bytes());
    }
    for length in [name.len() as u16, 0] {
        entry.extend(length.to_le_bytes());
    }
    entry
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Archives like this as the library behind Python's zipfile takes them: checked by
    /// `python3 -m zipfile -t`, which found no fault, and sizes and checksum by `unzip -v`.
    #[test]
    fn the_files_are_found_again() {
        let long = "<kml>".repeat(500);
        let files = [(DOCUMENT, long.as_str()), ("wpmz/template.kml", "<kml/>")];
        let zip = archive(&files).unwrap();
        let word = |at: usize| u16::from_le_bytes(zip[at..at + 2].try_into().unwrap()) as usize;
        let number = |at: usize| u32::from_le_bytes(zip[at..at + 4].try_into().unwrap()) as usize;
        let end = zip.len() - 22;
        assert_eq!((word(end + 8), word(end + 10)), (2, 2));
        let (length, mut at) = (number(end + 12), number(end + 16));
        assert_eq!(at + length, end);
        for (name, text) in files {
            assert_eq!(&zip[at..at + 4], b"PK\x01\x02");
            let header = number(at + 42);
            assert_eq!(&zip[at + 46..at + 46 + name.len()], name.as_bytes());
            assert_eq!(&zip[header..header + 4], b"PK\x03\x04");
            let (packed, bytes) = (number(header + 18), number(header + 22));
            assert_eq!(bytes, text.len());
            let from = header + 30 + name.len();
            let mut decoder = flate2::write::DeflateDecoder::new(Vec::new());
            decoder.write_all(&zip[from..from + packed]).unwrap();
            assert_eq!(decoder.finish().unwrap(), text.as_bytes());
            at += 46 + name.len();
        }
    }
}
