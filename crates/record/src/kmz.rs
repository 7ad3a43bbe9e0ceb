//! KMZ: a KML document as the only file of a ZIP archive.
//!
//! PKWARE, *APPNOTE 6.3*, 4.3: a local header, the deflated bytes, the central directory of one entry and its end.

use crate::RecordError;
use flate2::write::DeflateEncoder;
use flate2::{Compression, Crc};
use std::io::Write as _;

/// The name under which viewers look for the document.
const NAME: &[u8] = b"doc.kml";
/// Version of the format that deflated files need: 2.0.
const VERSION: u16 = 20;
const DEFLATED: u16 = 8;
/// 1980-01-01, the first day that the format knows: archives of the same document are the same.
const NO_DATE: u16 = (1 << 5) | 1;

/// The archive that holds `document`.
///
/// # Errors
/// [`RecordError::Kml`] for a document beyond the 4 GB of the format.
pub fn archive(document: &str) -> Result<Vec<u8>, RecordError> {
    let failed = |e: std::io::Error| RecordError::Kml(e.to_string());
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(document.as_bytes()).map_err(failed)?;
    let packed = encoder.finish().map_err(failed)?;
    let too_large =
        |_| RecordError::Kml("the document is larger than the 4 GB that a KMZ can hold".to_owned());
    let packed_bytes = u32::try_from(packed.len()).map_err(too_large)?;
    let bytes = u32::try_from(document.len()).map_err(too_large)?;
    let mut crc = Crc::new();
    crc.update(document.as_bytes());
    let entry = entry(crc.sum(), packed_bytes, bytes);
    let mut zip = b"PK\x03\x04".to_vec();
    zip.extend(&entry);
    zip.extend(NAME);
    zip.extend(&packed);
    let directory = u32::try_from(zip.len()).map_err(too_large)?;
    zip.extend(b"PK\x01\x02");
    zip.extend(VERSION.to_le_bytes());
    zip.extend(&entry);
    // No comment, one disk, no attributes, and the local header at the beginning.
    zip.extend([0; 14]);
    zip.extend(NAME);
    let length = zip.len() as u32 - directory;
    zip.extend(b"PK\x05\x06\0\0\0\0\x01\0\x01\0");
    zip.extend(length.to_le_bytes());
    zip.extend(directory.to_le_bytes());
    zip.extend([0; 2]);
    Ok(zip)
}

/// What local header and directory say alike of the document.
fn entry(crc: u32, packed_bytes: u32, bytes: u32) -> Vec<u8> {
    let mut entry = Vec::new();
    for word in [VERSION, 0, DEFLATED, 0, NO_DATE] {
        entry.extend(word.to_le_bytes());
    }
    for number in [crc, packed_bytes, bytes] {
        entry.extend(number.to_le_bytes());
    }
    for length in [NAME.len() as u16, 0] {
        entry.extend(length.to_le_bytes());
    }
    entry
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The archive of "<kml/>" as the library behind Python's zipfile takes it: checked by
    /// `python3 -m zipfile -t`, which found no fault, and its sizes and checksum by `unzip -v`.
    #[test]
    fn the_document_is_found_again() {
        let text = "<kml>".repeat(500);
        let zip = archive(&text).unwrap();
        let number = |at: usize| u32::from_le_bytes(zip[at..at + 4].try_into().unwrap()) as usize;
        let end = zip.len() - 22;
        let (length, directory) = (number(end + 12), number(end + 16));
        assert_eq!(directory + length, end);
        assert_eq!(&zip[directory..directory + 4], b"PK\x01\x02");
        assert_eq!(&zip[end - NAME.len()..end], NAME);
        assert_eq!(number(directory + 42), 0);
        let (packed, bytes) = (number(18), number(22));
        assert_eq!(bytes, text.len());
        let from = 30 + NAME.len();
        assert_eq!(from + packed, directory);
        let mut decoder = flate2::write::DeflateDecoder::new(Vec::new());
        decoder.write_all(&zip[from..from + packed]).unwrap();
        assert_eq!(decoder.finish().unwrap(), text.as_bytes());
    }
}
