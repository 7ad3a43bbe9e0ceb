//! Height of the ground: flat, or an SRTM `.hgt` tile.

use crate::AirError;
use crate::geo::Geodetic;
use srtm_reader::{Resolution, Tile};

/// Heights in a tile at or below this are voids, m: SRTM writes -32768, and no land is so low.
const VOID_M: i16 = -1000;

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
}

impl Terrain {
    /// Reads an SRTM tile from the bytes of a file named by its south-west corner, such as
    /// `N43W008.hgt`.
    ///
    /// # Errors
    /// A name that gives no corner, or bytes that are no 1- or 3-arc-second tile.
    pub fn from_hgt(name: &str, bytes: &[u8], fallback_amsl_m: f64) -> Result<Self, AirError> {
        let refuse = |why: String| AirError::Terrain(format!("{name}: {why}"));
        let (lat, lon) = Tile::get_lat_lon(name)
            .map_err(|_| refuse("expected a name like N43W008.hgt".to_owned()))?;
        let resolution = Resolution::try_from(bytes.len() as u64).map_err(|_| {
            refuse(format!(
                "{} bytes; expected 25934402 (1 arc-second) or 2884802 (3 arc-seconds)",
                bytes.len()
            ))
        })?;
        let data = Tile::parse_hgt(bytes, resolution).map_err(|e| refuse(e.to_string()))?;
        Ok(Self::Srtm {
            tile: Box::new(Tile::new(lat, lon, resolution, data)),
            fallback_amsl_m,
        })
    }

    /// Height of the ground at `at`, m above mean sea level, bilinear between the tile's posts.
    pub fn ground_amsl_m(&self, at: Geodetic) -> f64 {
        match self {
            Self::Flat(height) => *height,
            Self::Srtm {
                tile,
                fallback_amsl_m,
            } => bilinear(tile, at).unwrap_or(*fallback_amsl_m),
        }
    }
}

fn bilinear(tile: &Tile, at: Geodetic) -> Option<f64> {
    // A tile is a square of posts, rows from north to south, with both edges included.
    let side = (tile.data.len() as f64).sqrt() as usize;
    let steps = (side - 1) as f64;
    let column = (at.lon_deg - f64::from(tile.longitude)) * steps;
    let row = (f64::from(tile.latitude) + 1.0 - at.lat_deg) * steps;
    if !(0.0..=steps).contains(&column) || !(0.0..=steps).contains(&row) {
        return None;
    }
    let post = |r: usize, c: usize| -> Option<f64> {
        let height = *tile.data.get(r.min(side - 1) * side + c.min(side - 1))?;
        (height > VOID_M).then(|| f64::from(height))
    };
    let (r, c) = (row as usize, column as usize);
    let (dr, dc) = (row - r as f64, column - c as f64);
    let north = post(r, c)? * (1.0 - dc) + post(r, c + 1)? * dc;
    let south = post(r + 1, c)? * (1.0 - dc) + post(r + 1, c + 1)? * dc;
    Some(north * (1.0 - dr) + south * dr)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 3-arc-second tile that rises one metre a row southwards and two a column eastwards.
    fn ramp() -> Vec<u8> {
        (0..1201i32 * 1201)
            .flat_map(|k| ((k / 1201 + 2 * (k % 1201)) as i16).to_be_bytes())
            .collect()
    }

    #[test]
    fn bilinear_on_a_ramp_is_exact() {
        let terrain = Terrain::from_hgt("N43W008.hgt", &ramp(), 12.0).unwrap();
        // 0.25 of the tile south of its north edge is row 300, 0.1 east is column 120.
        let at = Geodetic {
            lat_deg: 43.75 - 0.5 / 1200.0,
            lon_deg: -7.9 + 0.25 / 1200.0,
        };
        assert!((terrain.ground_amsl_m(at) - (300.5 + 2.0 * 120.25)).abs() < 1e-6);
        let outside = Geodetic {
            lat_deg: 50.0,
            lon_deg: -7.9,
        };
        assert_eq!(terrain.ground_amsl_m(outside), 12.0);
    }

    #[test]
    fn voids_fall_back() {
        let mut bytes = ramp();
        bytes[..2].copy_from_slice(&i16::MIN.to_be_bytes());
        let terrain = Terrain::from_hgt("N43W008.hgt", &bytes, 12.0).unwrap();
        assert_eq!(
            terrain.ground_amsl_m(Geodetic {
                lat_deg: 44.0,
                lon_deg: -8.0
            }),
            12.0
        );
    }

    #[test]
    fn wrong_size_and_name_are_refused() {
        assert!(Terrain::from_hgt("N43W008.hgt", &[0; 100], 0.0).is_err());
        assert!(Terrain::from_hgt("galicia.hgt", &ramp(), 0.0).is_err());
    }
}
