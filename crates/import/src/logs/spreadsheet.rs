//! Spreadsheets (xlsx, xlsb, xls, ods): the first sheet with rows, as the text that a spreadsheet program saves.
//!
//! The reader, `calamine`, needs some twenty more crates; the feature `spreadsheets`
//! builds it.

use crate::ImportError;
use std::io::Read;

/// Whether bytes are the beginning of a spreadsheet: of OLE, or of a packed file whose first names are those of Office Open
/// XML or OpenDocument.
pub fn is_spreadsheet(head: &[u8]) -> bool {
    const OLE: [u8; 8] = [0xD0, 0xCF, 0x11, 0xE0, 0xA1, 0xB1, 0x1A, 0xE1];
    const NAMES: [&[u8]; 5] = [
        b"[Content_Types].xml",
        b"_rels/.rels",
        b"xl/",
        b"docProps/",
        b"application/vnd.oasis.opendocument.spreadsheet",
    ];
    let has = |name: &&[u8]| head.windows(name.len()).any(|w| w == *name);
    head.starts_with(&OLE) || (head.starts_with(b"PK\x03\x04") && NAMES.iter().any(has))
}

/// The text of the spreadsheet `name`.
///
/// # Errors
/// A build that reads none, with what to do.
#[cfg(not(feature = "spreadsheets"))]
pub fn text(name: &str, _: Box<dyn Read + '_>) -> Result<Vec<u8>, ImportError> {
    Err(ImportError::log(
        name,
        "a spreadsheet, which this build does not read",
        "save the spreadsheet as CSV, or build Plumage with --features spreadsheets",
    ))
}

/// The text of the spreadsheet `name`.
///
/// # Errors
/// Bytes that are no spreadsheet, or one without rows.
#[cfg(feature = "spreadsheets")]
pub fn text(name: &str, mut bytes: Box<dyn Read + '_>) -> Result<Vec<u8>, ImportError> {
    use calamine::Reader as _;
    let mut all = Vec::new();
    bytes
        .read_to_end(&mut all)
        .map_err(ImportError::bytes(name))?;
    let unreadable = |what: String| ImportError::log(name, what, "save the spreadsheet as CSV");
    let mut book = calamine::open_workbook_auto_from_rs(std::io::Cursor::new(all))
        .map_err(|e| unreadable(format!("a spreadsheet that cannot be read: {e}")))?;
    for sheet in book.sheet_names() {
        let range = book
            .worksheet_range(&sheet)
            .map_err(|e| unreadable(format!("sheet {sheet}: {e}")))?;
        if range.height() > 1 {
            return Ok(sheet::text(&range));
        }
    }
    Err(unreadable("a spreadsheet without rows".to_owned()))
}

#[cfg(feature = "spreadsheets")]
mod sheet {
    use calamine::{Data, ExcelDateTime, Range};

    /// A sheet as lines of cells between commas.
    pub(super) fn text(range: &Range<Data>) -> Vec<u8> {
        // A column of dates stands beside one of times of day: then no time of day belongs to its cells.
        let holds_dates = |column: usize| {
            let mut cells = range.rows().filter_map(|row| row.get(column));
            cells.all(|cell| match cell {
                Data::DateTime(at) => at.as_f64().fract() == 0.0,
                _ => true,
            })
        };
        let dates: Vec<bool> = (0..range.width()).map(holds_dates).collect();
        let mut text = Vec::new();
        for row in range.rows() {
            for (column, cell) in row.iter().enumerate() {
                if column > 0 {
                    text.push(b',');
                }
                crate::sink::push_text(&mut text, &shown(cell, dates[column]));
            }
            text.push(b'\n');
        }
        text
    }

    fn shown(cell: &Data, is_date: bool) -> String {
        match cell {
            Data::Empty | Data::Error(_) => String::new(),
            Data::DateTime(at) => time(at, is_date),
            Data::Int(value) => value.to_string(),
            Data::Float(value) => value.to_string(),
            Data::Bool(value) => value.to_string(),
            Data::String(text) | Data::DateTimeIso(text) => text.clone(),
            Data::DurationIso(text) => time_of_day(text).unwrap_or_else(|| text.clone()),
        }
    }

    /// A time of day, which OpenDocument writes as a duration (PT10H00M05.25S).
    fn time_of_day(duration: &str) -> Option<String> {
        let (hour, rest) = duration.strip_prefix("PT")?.split_once('H')?;
        let (minute, rest) = rest.split_once('M')?;
        let (hour, minute): (u8, u8) = (hour.parse().ok()?, minute.parse().ok()?);
        let second: f64 = rest.strip_suffix('S')?.replace(',', ".").parse().ok()?;
        Some(format!("{hour:02}:{minute:02}:{second:06.3}"))
    }

    /// ISO 8601 without a zone, as a spreadsheet knows none; of the first day a time of day.
    fn time(at: &ExcelDateTime, is_date: bool) -> String {
        let (year, month, day, hour, minute, second, ms) = at.to_ymd_hms_milli();
        let date = format!("{year:04}-{month:02}-{day:02}");
        let of_day = format!("{hour:02}:{minute:02}:{second:02}.{ms:03}");
        match at.as_f64() {
            days if days < 1.0 => of_day,
            _ if is_date => date,
            _ => format!("{date} {of_day}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreadsheets_are_known_by_their_first_names() {
        assert!(is_spreadsheet(
            b"PK\x03\x04\x14\0\x08\x08\x08\0[Content_Types].xml"
        ));
        assert!(is_spreadsheet(
            b"PK\x03\x04\x14\0\0\0mimetypeapplication/vnd.oasis.opendocument.spreadsheetPK"
        ));
        assert!(is_spreadsheet(&[
            0xD0, 0xCF, 0x11, 0xE0, 0xA1, 0xB1, 0x1A, 0xE1
        ]));
        assert!(!is_spreadsheet(b"PK\x03\x04\x14\0doc.kml"));
    }
}
