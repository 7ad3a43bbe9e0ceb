//! Raster tiles in a file: MBTiles 1.3 (Mapbox, 2018), an SQLite database of pictures, as QGIS, GDAL and MapTiler
//! write it.

use rusqlite::{Connection, OpenFlags, OptionalExtension as _};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Pictures that a browser shows, by the format's name in the file and by their first bytes.
const PICTURES: [(&str, &str, &[u8]); 4] = [
    ("png", "image/png", b"\x89PNG"),
    ("jpg", "image/jpeg", b"\xff\xd8\xff"),
    ("jpeg", "image/jpeg", b"\xff\xd8\xff"),
    ("webp", "image/webp", b"RIFF"),
];

/// A file of tiles, open to be read.
#[derive(Debug)]
pub struct Archive {
    connection: Mutex<Connection>,
    media_type: &'static str,
    zooms: (u8, u8),
}

impl Archive {
    /// Opens a file.
    ///
    /// # Errors
    /// What is wrong with it, and what was expected.
    pub fn open(path: &Path) -> Result<Self, String> {
        let expected = "expected an MBTiles file with png, jpg or webp tiles";
        let unreadable = |e: rusqlite::Error| format!("{e}: {expected}");
        let only_read = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let connection = Connection::open_with_flags(path, only_read).map_err(unreadable)?;
        let zooms = connection
            .query_row(
                "SELECT min(zoom_level), max(zoom_level) FROM tiles",
                [],
                |row| Ok((row.get::<_, Option<u8>>(0)?, row.get::<_, Option<u8>>(1)?)),
            )
            .map_err(unreadable)?;
        let (Some(coarsest), Some(finest)) = zooms else {
            return Err(format!("it has no tiles: {expected}"));
        };
        let format = connection
            .query_row(
                "SELECT value FROM metadata WHERE name = 'format'",
                [],
                |row| row.get::<_, String>(0),
            )
            .optional()
            .ok()
            .flatten();
        let first = connection
            .query_row("SELECT tile_data FROM tiles LIMIT 1", [], |row| {
                row.get::<_, Vec<u8>>(0)
            })
            .map_err(unreadable)?;
        // Files older than the format's third version do not say what their pictures are.
        let picture = PICTURES.iter().find(|(name, _, begins)| match &format {
            Some(format) => name == format,
            None => first.starts_with(begins),
        });
        let Some((_, media_type, _)) = picture else {
            let found = format.as_deref().unwrap_or("unknown");
            return Err(format!("its tiles are {found}: {expected}"));
        };
        Ok(Self {
            connection: Mutex::new(connection),
            media_type,
            zooms: (coarsest, finest),
        })
    }

    /// Media type of the pictures.
    pub(crate) fn media_type(&self) -> &'static str {
        self.media_type
    }

    /// Coarsest and finest zoom that it has tiles of.
    pub(crate) fn zooms(&self) -> (u8, u8) {
        self.zooms
    }

    /// The picture of a tile, counted from the north-west corner as web maps do; None where the file has none.
    pub(crate) fn tile(&self, z: u8, x: u32, y: u32) -> Option<Vec<u8>> {
        // Rows of the file count from the south, as the Tile Map Service does.
        let row = (1_u32.checked_shl(z.into())?)
            .checked_sub(1)?
            .checked_sub(y)?;
        // A reader that panicked has left nothing half written.
        let connection = self
            .connection
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        connection
            .prepare_cached(
                "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?",
            )
            .ok()?
            .query_row((z, x, row), |row| row.get(0))
            .ok()
    }
}
