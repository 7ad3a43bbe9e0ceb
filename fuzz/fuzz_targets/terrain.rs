//! Grids of the ground's height: no panic, and heights are numbers wherever they are asked for.
//!
//! The first byte chooses an ESRI grid or an SRTM tile, which is filled with what follows.

#![no_main]

use air::geo::Geodetic;
use air::terrain::Terrain;
use libfuzzer_sys::fuzz_target;

/// Posts of an SRTM tile of three seconds of arc.
const POSTS: usize = 1201 * 1201;

fuzz_target!(|data: &[u8]| {
    let Some((kind, data)) = data.split_first() else {
        return;
    };
    let site = Geodetic {
        lat_deg: 43.44,
        lon_deg: -7.86,
    };
    let terrain = match kind % 2 {
        0 => Terrain::read("grid.asc", data, site, 340.0),
        _ => {
            let filled: Vec<u8> = data.iter().copied().cycle().take(2 * POSTS).collect();
            Terrain::read("N43W008.hgt", &filled, site, 340.0)
        }
    };
    let Ok(terrain) = terrain else { return };
    for step in -20..=20 {
        let at = Geodetic {
            lat_deg: site.lat_deg + 0.05 * f64::from(step),
            lon_deg: site.lon_deg - 0.07 * f64::from(step),
        };
        assert!(terrain.ground_amsl_m(at).is_finite());
    }
});
