//! Tiles in a file, in a program that is built without them: no file can be opened.

use std::path::Path;

/// A file of tiles, of which there is none.
#[derive(Debug)]
pub enum Archive {}

impl Archive {
    /// Rejects every file.
    ///
    /// # Errors
    /// Always, with how to build a program that reads such files.
    pub fn open(_: &Path) -> Result<Self, String> {
        Err(
            "this program was built without MBTiles files: expected an address with {z}, {x} and {y}, or a program built \
             by cargo build --release -p bins --features mbtiles"
                .to_owned(),
        )
    }

    pub(crate) fn media_type(&self) -> &'static str {
        match *self {}
    }

    pub(crate) fn zooms(&self) -> (u8, u8) {
        match *self {}
    }

    pub(crate) fn tile(&self, _: u8, _: u32, _: u32) -> Option<Vec<u8>> {
        match *self {}
    }
}
