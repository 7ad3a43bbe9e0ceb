//! Height of the ground: flat, an SRTM `.hgt` tile, or an ESRI ASCII grid.

use crate::AirError;
use crate::ascii_grid::AsciiGrid;
use crate::geo::Geodetic;
use srtm_reader::{Resolution, Tile};

/// Heights outside this range are no land, m: the shore of the Dead Sea is at -440, Everest at 8849, and mines and errors
/// of a model get some room. Files write voids as -32768, -9999, -3.4e38 or 1e20, whatever their header says.
const LAND_M: std::ops::RangeInclusive<f64> = -1000.0..=9000.0;

/// A height in a file, m above mean sea level; none where it is a void.
pub(crate) fn of_land(height_m: f64) -> Option<f64> {
    LAND_M.contains(&height_m).then_some(height_m)
}

/// The ground of a site.
#[derive(Debug, Clone, PartialEq)]
pub enum Terrain {
    /// The same height everywhere, m above mean sea level.
    Flat(f64),
    /// An SRTM tile; outside it and in its voids the fallback height holds.
    Srtm {
        /// The tile.
        tile: Box<Tile>,
        /// Height used where the tile has none, m above mean sea level.
        fallback_amsl_m: f64,
    },
    /// A grid of heights; elsewhere the fallback height holds.
    Grid {
        /// The grid.
        grid: Box<AsciiGrid>,
        /// Height used where the grid has none, m above mean sea level.
        fallback_amsl_m: f64,
    },
}

impl Terrain {
    /// Reads the ground from the bytes of a file: an ESRI ASCII grid where its name ends in `.asc`, else an SRTM
    /// tile as [`Terrain::from_hgt`] does.
    ///
    /// # Errors
    /// A file that is neither, or that does not hold the site.
    pub fn read(
        name: &str,
        bytes: &[u8],
        site: Geodetic,
        fallback_amsl_m: f64,
    ) -> Result<Self, AirError> {
        if !name.to_ascii_lowercase().ends_with(".asc") {
            return Self::from_hgt(name, bytes, site, fallback_amsl_m);
        }
        let refuse = |why: String| AirError::Terrain(format!("{name}: {why}"));
        let grid = AsciiGrid::parse(&String::from_utf8_lossy(bytes)).map_err(refuse)?;
        if grid.post_of(site).is_none() {
            let [(south, west), (north, east)] = grid.corners_deg();
            return Err(refuse(format!(
                "a grid from {south:.4}, {west:.4} to {north:.4}, {east:.4}, which does not contain the site at \
                 {:.4}, {:.4}; expected a grid around it",
                site.lat_deg, site.lon_deg
            )));
        }
        Ok(Self::Grid {
            grid: Box::new(grid),
            fallback_amsl_m,
        })
    }

    /// Reads an SRTM tile from the bytes of a file named by its south-west corner, such as
    /// `N43W008.hgt`, `n43w008.hgt` or `N43W008.SRTMGL1.hgt`, for a site at `site`.
    ///
    /// # Errors
    /// A name that gives no corner, bytes that are no 1- or 3-arc-second tile, or a tile that does
    /// not hold the site.
    pub fn from_hgt(
        name: &str,
        bytes: &[u8],
        site: Geodetic,
        fallback_amsl_m: f64,
    ) -> Result<Self, AirError> {
        let refuse = |why: String| AirError::Terrain(format!("{name}: {why}"));
        let (lat, lon) = corner_of(name).ok_or_else(|| {
            refuse(
                "expected a name that begins with the tile's south-west corner, such as \
                 N43W008.hgt or N43W008.SRTMGL1.hgt"
                    .to_owned(),
            )
        })?;
        let resolution = Resolution::try_from(bytes.len() as u64).map_err(|_| {
            refuse(format!(
                "{} bytes; expected 25934402 (1 arc-second) or 2884802 (3 arc-seconds)",
                bytes.len()
            ))
        })?;
        let data = Tile::parse_hgt(bytes, resolution).map_err(|e| refuse(e.to_string()))?;
        let tile = Tile::new(lat, lon, resolution, data);
        if post_of(&tile, site).is_none() {
            return Err(refuse(format!(
                "a tile from {} to the next degree north and east, which does not contain the site at {:.4}, \
                 {:.4}; expected {}.hgt",
                corner_name(f64::from(lat), f64::from(lon)),
                site.lat_deg,
                site.lon_deg,
                corner_name(site.lat_deg.floor(), site.lon_deg.floor()),
            )));
        }
        Ok(Self::Srtm {
            tile: Box::new(tile),
            fallback_amsl_m,
        })
    }

    /// Height of the ground at `at` as far as it is known, m above mean sea level: none outside the
    /// tile and in its voids.
    pub fn known_amsl_m(&self, at: Geodetic) -> Option<f64> {
        match self {
            Self::Flat(height) => Some(*height),
            Self::Srtm { tile, .. } => bilinear(post_of(tile, at)?, |r, c| height_of(tile, r, c)),
            Self::Grid { grid, .. } => bilinear(grid.post_of(at)?, |r, c| grid.height_amsl_m(r, c)),
        }
    }

    /// Height of the ground at `at`, m above mean sea level, bilinear between the tile's posts.
    pub fn ground_amsl_m(&self, at: Geodetic) -> f64 {
        let fallback_amsl_m = match self {
            Self::Flat(height) => *height,
            Self::Srtm {
                fallback_amsl_m, ..
            }
            | Self::Grid {
                fallback_amsl_m, ..
            } => *fallback_amsl_m,
        };
        self.known_amsl_m(at).unwrap_or(fallback_amsl_m)
    }
}

/// South-west corner, degrees, in the name of a tile's file: in capitals or not, with or without
/// the product after it, as in NASA's `N43W008.SRTMGL1.hgt`.
fn corner_of(name: &str) -> Option<(i8, i16)> {
    let file = name.rsplit(['/', '\\']).next()?.to_ascii_uppercase();
    let (corner, rest) = (file.get(..7)?, file.get(7..)?);
    if !(rest.is_empty() || rest.starts_with('.')) {
        return None;
    }
    let signed = |part: &str, plus: char, minus: char| -> Option<i16> {
        let digits = part.get(1..)?;
        let value: i16 = digits.parse().ok()?;
        let all_digits = digits.bytes().all(|b| b.is_ascii_digit());
        match part.chars().next()? {
            sign if sign == plus && all_digits => Some(value),
            sign if sign == minus && all_digits => Some(-value),
            _ => None,
        }
    };
    let (lat, lon) = (
        signed(corner.get(..3)?, 'N', 'S')?,
        signed(corner.get(3..)?, 'E', 'W')?,
    );
    let on_earth = (-90..90).contains(&lat) && (-180..180).contains(&lon);
    on_earth.then_some((i8::try_from(lat).ok()?, lon))
}

/// How a tile with this south-west corner, degrees, is called.
fn corner_name(lat_deg: f64, lon_deg: f64) -> String {
    let ns = if lat_deg < 0.0 { 'S' } else { 'N' };
    let ew = if lon_deg < 0.0 { 'W' } else { 'E' };
    format!("{ns}{:02.0}{ew}{:03.0}", lat_deg.abs(), lon_deg.abs())
}

/// Row and column of `at` among the tile's posts, rows from north to south, with both edges
/// included; none outside the tile.
fn post_of(tile: &Tile, at: Geodetic) -> Option<(f64, f64)> {
    let steps = ((tile.data.len() as f64).sqrt() as usize - 1) as f64;
    let column = (at.lon_deg - f64::from(tile.longitude)) * steps;
    let row = (f64::from(tile.latitude) + 1.0 - at.lat_deg) * steps;
    let inside = (0.0..=steps).contains(&column) && (0.0..=steps).contains(&row);
    inside.then_some((row, column))
}

/// Height of a tile's post; the last ones stand in for those beyond.
fn height_of(tile: &Tile, row: usize, column: usize) -> Option<f64> {
    let side = (tile.data.len() as f64).sqrt() as usize;
    let height = *tile
        .data
        .get(row.min(side - 1) * side + column.min(side - 1))?;
    of_land(f64::from(height))
}

/// The height at a row and column between posts.
fn bilinear((row, column): (f64, f64), post: impl Fn(usize, usize) -> Option<f64>) -> Option<f64> {
    let (r, c) = (row as usize, column as usize);
    let (dr, dc) = (row - r as f64, column - c as f64);
    let north = post(r, c)? * (1.0 - dc) + post(r, c + 1)? * dc;
    let south = post(r + 1, c)? * (1.0 - dc) + post(r + 1, c + 1)? * dc;
    Some(north * (1.0 - dr) + south * dr)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SITE: Geodetic = Geodetic::new(43.44, -7.86);

    /// A 3-arc-second tile that rises one metre a row southwards and two a column eastwards.
    fn ramp() -> Vec<u8> {
        (0..1201i32 * 1201)
            .flat_map(|k| ((k / 1201 + 2 * (k % 1201)) as i16).to_be_bytes())
            .collect()
    }

    #[test]
    fn bilinear_on_a_ramp_is_exact() {
        let terrain = Terrain::from_hgt("N43W008.hgt", &ramp(), SITE, 12.0).unwrap();
        // 0.25 of the tile south of its north edge is row 300, 0.1 east is column 120.
        let at = Geodetic::new(43.75 - 0.5 / 1200.0, -7.9 + 0.25 / 1200.0);
        assert!((terrain.ground_amsl_m(at) - (300.5 + 2.0 * 120.25)).abs() < 1e-6);
        let outside = Geodetic::new(50.0, -7.9);
        assert_eq!(terrain.ground_amsl_m(outside), 12.0);
    }

    #[test]
    fn a_grid_around_the_site_is_read_and_another_refused() {
        let text = "ncols 2\nnrows 2\nxllcenter -8\nyllcenter 43\ncellsize 1\n0 100\n200 300\n";
        let terrain = Terrain::read("site.asc", text.as_bytes(), SITE, 12.0).unwrap();
        // Bilinear: 200 at the south-west post, falling 200 a degree northwards, rising 100 eastwards.
        let expected = 200.0 - 200.0 * 0.44 + 100.0 * 0.14;
        assert!((terrain.ground_amsl_m(SITE) - expected).abs() < 1e-6);
        let elsewhere = Geodetic {
            lat_deg: 50.0,
            ..SITE
        };
        assert_eq!(terrain.ground_amsl_m(elsewhere), 12.0);
        let refused = Terrain::read("site.asc", text.as_bytes(), elsewhere, 12.0).unwrap_err();
        assert!(
            refused
                .to_string()
                .contains("43.0000, -8.0000 to 44.0000, -7.0000"),
            "{refused}"
        );
    }

    #[test]
    fn voids_fall_back() {
        let mut bytes = ramp();
        bytes[..2].copy_from_slice(&i16::MIN.to_be_bytes());
        let terrain = Terrain::from_hgt("N43W008.hgt", &bytes, SITE, 12.0).unwrap();
        assert_eq!(terrain.ground_amsl_m(Geodetic::new(44.0, -8.0)), 12.0);
    }

    #[test]
    fn wrong_size_and_name_are_refused() {
        assert!(Terrain::from_hgt("N43W008.hgt", &[0; 100], SITE, 0.0).is_err());
        for name in [
            "galicia.hgt",
            "N43W0080.hgt",
            "N4",
            "X43W008.hgt",
            "N43W190.hgt",
            "N+3W008.hgt",
            "Ñ43W008.hgt",
            "",
        ] {
            assert!(
                Terrain::from_hgt(name, &ramp(), SITE, 0.0).is_err(),
                "{name}"
            );
        }
    }

    #[test]
    fn names_in_small_letters_and_with_the_product_are_read() {
        let capitals = Terrain::from_hgt("N43W008.hgt", &ramp(), SITE, 0.0).unwrap();
        for name in [
            "n43w008.hgt",
            "N43W008.HGT",
            "N43W008.SRTMGL1.hgt",
            "tiles/n43w008.SRTMGL1.hgt",
        ] {
            let other = Terrain::from_hgt(name, &ramp(), SITE, 0.0).unwrap();
            assert_eq!(other, capitals, "{name}");
        }
        assert_eq!(corner_of("s05e010.hgt"), Some((-5, 10)));
    }

    #[test]
    fn a_tile_that_does_not_hold_the_site_is_refused_with_the_one_that_does() {
        let message = Terrain::from_hgt("N43W009.hgt", &ramp(), SITE, 0.0)
            .unwrap_err()
            .to_string();
        for part in ["N43W009.hgt", "43.4400, -7.8600", "expected N43W008.hgt"] {
            assert!(message.contains(part), "{message}");
        }
        assert_eq!(corner_name(-5.0, 10.0), "S05E010");
    }
}
