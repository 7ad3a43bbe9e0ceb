//! Raster tiles under the map: loaded by the browser from a given URL, or served from a file.

use crate::mbtiles::Archive;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;

/// Finest zoom that is asked of a server of tiles, whose own is not known: that of OpenStreetMap.
const FINEST_ZOOM: u8 = 19;
/// Where the page serves the tiles of a file.
const SERVED: &str = "tiles/{z}/{x}/{y}";

/// Raster tiles (web mercator, 256 pixels): an address with `{z}`, `{x}` and `{y}`, such as
/// `https://tile.openstreetmap.org/{z}/{x}/{y}.png`, or a file that ends in `.mbtiles`.
#[derive(Debug, Clone)]
pub enum Tiles {
    /// From a server.
    Server(Template),
    /// From a file.
    File(Arc<Archive>),
}

/// The addresses of the tiles of a server.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Template {
    text: String,
    /// Length of its scheme and host.
    origin: usize,
}

impl Tiles {
    /// The template of their addresses for the page.
    pub(crate) fn template(&self) -> &str {
        match self {
            Self::Server(template) => &template.text,
            Self::File(_) => SERVED,
        }
    }

    /// Coarsest and finest zoom that there are tiles of.
    pub(crate) fn zooms(&self) -> (u8, u8) {
        match self {
            Self::Server(_) => (1, FINEST_ZOOM),
            Self::File(archive) => archive.zooms(),
        }
    }

    /// Scheme, host and port, which the page lets the browser load pictures from; empty where that is its own.
    pub(crate) fn origin(&self) -> &str {
        match self {
            Self::Server(template) => template.text.get(..template.origin).unwrap_or_default(),
            Self::File(_) => "",
        }
    }
}

impl FromStr for Tiles {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let path = Path::new(text);
        if !text.contains("://") && path.extension().is_some_and(|e| e == "mbtiles") {
            return Ok(Self::File(Arc::new(Archive::open(path)?)));
        }
        let refused = |what: &str| {
            Err(format!(
                "{what}: expected an address with {{z}}, {{x}} and {{y}}, such as \
                 https://tile.openstreetmap.org/{{z}}/{{x}}/{{y}}.png, or a file that ends in .mbtiles"
            ))
        };
        let Some((scheme, rest)) = text.split_once("://") else {
            return refused("no address");
        };
        if !matches!(scheme, "http" | "https") {
            return refused("neither http nor https");
        }
        if let Some(missing) = ["{z}", "{x}", "{y}"].iter().find(|p| !rest.contains(*p)) {
            return refused(&format!("{missing} is missing"));
        }
        let host = rest.find('/').unwrap_or(rest.len());
        // It goes into a header, in which these would begin something else.
        let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | ':' | '[' | ']');
        if host == 0 || !rest.chars().take(host).all(plain) {
            return refused("no host");
        }
        Ok(Self::Server(Template {
            text: text.to_owned(),
            origin: scheme.len() + 3 + host,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(not(feature = "mbtiles"))]
    #[test]
    fn without_the_feature_a_file_is_rejected_with_how_to_build_it() {
        let rejected = "area.mbtiles".parse::<Tiles>().unwrap_err();
        assert!(rejected.contains("--features mbtiles"), "{rejected}");
    }

    /// The format's own example of a row: of the four tiles of zoom 1 that in the north-west is row 1 of the file.
    #[cfg(feature = "mbtiles")]
    #[test]
    fn a_file_is_read_from_the_north_and_one_that_is_none_is_refused() {
        let path = std::env::temp_dir().join(format!("plumage-{}.mbtiles", std::process::id()));
        let write = |format: &str, picture: &[u8]| {
            let _ = std::fs::remove_file(&path);
            let file = rusqlite::Connection::open(&path).unwrap();
            file.execute_batch(
                "CREATE TABLE metadata (name text, value text);
                 CREATE TABLE tiles (zoom_level integer, tile_column integer, tile_row integer, tile_data blob);",
            )
            .unwrap();
            file.execute("INSERT INTO metadata VALUES ('format', ?)", [format])
                .unwrap();
            file.execute("INSERT INTO tiles VALUES (1, 0, 1, ?)", [picture])
                .unwrap();
        };
        write("png", b"\x89PNG north-west");
        let Tiles::File(archive) = path.to_str().unwrap().parse().unwrap() else {
            panic!("a file")
        };
        assert_eq!(archive.media_type(), "image/png");
        assert_eq!(archive.zooms(), (1, 1));
        assert_eq!(archive.tile(1, 0, 0).unwrap(), b"\x89PNG north-west");
        for (z, x, y) in [(1, 0, 1), (1, 1, 0), (0, 0, 0), (1, 0, 2), (255, 0, 0)] {
            assert_eq!(archive.tile(z, x, y), None, "{z}/{x}/{y}");
        }
        write("pbf", b"\x1f\x8b");
        let vectors = path.to_str().unwrap().parse::<Tiles>().unwrap_err();
        assert!(
            vectors.starts_with("its tiles are pbf: expected"),
            "{vectors}"
        );
        std::fs::write(
            &path,
            "no database, but long enough to be taken for one".repeat(20),
        )
        .unwrap();
        let text = path.to_str().unwrap().parse::<Tiles>().unwrap_err();
        assert!(
            text.starts_with("file is not a database: expected"),
            "{text}"
        );
        std::fs::remove_file(&path).unwrap();
        let missing = "nowhere.mbtiles".parse::<Tiles>().unwrap_err();
        assert!(
            missing.starts_with("unable to open database file"),
            "{missing}"
        );
    }

    #[test]
    fn a_template_says_where_it_is_from_and_others_are_refused() {
        let tiles: Tiles = "https://tiles.example:444/a/{z}/{x}/{y}.png?key=1"
            .parse()
            .unwrap();
        assert_eq!(tiles.origin(), "https://tiles.example:444");
        for (text, why) in [
            ("tiles/{z}/{x}/{y}.png", "no address"),
            ("ftp://tiles.example/{z}/{x}/{y}", "neither http nor https"),
            ("https://tiles.example/{z}/{x}.png", "{y} is missing"),
            ("https:///{z}/{x}/{y}", "no host"),
            ("https://a; script-src */{z}/{x}/{y}", "no host"),
            ("Cargo.mbtiles/{z}", "no address"),
        ] {
            let refused = text.parse::<Tiles>().unwrap_err();
            assert!(refused.starts_with(why), "{text}: {refused}");
        }
    }
}
