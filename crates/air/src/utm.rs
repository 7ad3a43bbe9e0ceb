//! Universal Transverse Mercator: metres east and north in a zone to WGS84 latitude and longitude.
//!
//! Krüger's series to the fourth order of the third flattening (Karney 2011, *Transverse Mercator with an accuracy of a
//! few nanometers*, eqs. 14, 36 and A6): exact to a millimetre within the zones.

use crate::geo::{FLATTENING, Geodetic, SEMI_MAJOR_M};

/// Scale on the central meridian.
const SCALE: f64 = 0.9996;
/// Easting of the central meridian, and northing of the equator in southern zones, m.
const FALSE_EASTING_M: f64 = 500_000.0;
const FALSE_NORTHING_SOUTH_M: f64 = 10_000_000.0;
/// Eastings and northings within the zones with room for neighbours, m.
const EASTINGS_M: std::ops::RangeInclusive<f64> = 0.0..=1_000_000.0;
const NORTHINGS_M: std::ops::RangeInclusive<f64> = 0.0..=10_000_000.0;

/// A zone of UTM.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UtmZone {
    number: u8,
    south: bool,
}

impl UtmZone {
    /// The zone of a text: its number, 1 to 60, and its hemisphere as `N` or `S`, or its band of latitude, of which those from
    /// `N` on are north: `29N`, `13 S`, `31T`. `S` alone means south, as programs write it; none where it is no zone.
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        let letter = text.chars().last()?.to_ascii_uppercase();
        let number: u8 = text[..text.len() - letter.len_utf8()].trim().parse().ok()?;
        let south = match letter {
            'S' | 'C'..='H' | 'J'..='M' => true,
            'N' | 'P'..='R' | 'T'..='X' => false,
            _ => return None,
        };
        (1..=60).contains(&number).then_some(Self { number, south })
    }

    /// The place at an easting and a northing, m; none outside the zone's range.
    pub fn to_geodetic(self, easting_m: f64, northing_m: f64) -> Option<Geodetic> {
        if !EASTINGS_M.contains(&easting_m) || !NORTHINGS_M.contains(&northing_m) {
            return None;
        }
        let n = FLATTENING / (2.0 - FLATTENING);
        let (n2, n3, n4) = (n * n, n.powi(3), n.powi(4));
        let rectifying_m = SEMI_MAJOR_M / (1.0 + n) * (1.0 + n2 / 4.0 + n4 / 64.0);
        let north_m = northing_m
            - if self.south {
                FALSE_NORTHING_SOUTH_M
            } else {
                0.0
            };
        let xi = north_m / (SCALE * rectifying_m);
        let eta = (easting_m - FALSE_EASTING_M) / (SCALE * rectifying_m);
        let beta = [
            n / 2.0 - 2.0 / 3.0 * n2 + 37.0 / 96.0 * n3 - n4 / 360.0,
            n2 / 48.0 + n3 / 15.0 - 437.0 / 1440.0 * n4,
            17.0 / 480.0 * n3 - 37.0 / 840.0 * n4,
            4397.0 / 161_280.0 * n4,
        ];
        let (mut xi_sphere, mut eta_sphere) = (xi, eta);
        for (twice, beta) in [2.0, 4.0, 6.0, 8.0].into_iter().zip(beta) {
            xi_sphere -= beta * (twice * xi).sin() * (twice * eta).cosh();
            eta_sphere -= beta * (twice * xi).cos() * (twice * eta).sinh();
        }
        let conformal = (xi_sphere.sin() / eta_sphere.cosh()).asin();
        let delta = [
            2.0 * n - 2.0 / 3.0 * n2 - 2.0 * n3 + 116.0 / 45.0 * n4,
            7.0 / 3.0 * n2 - 8.0 / 5.0 * n3 - 227.0 / 45.0 * n4,
            56.0 / 15.0 * n3 - 136.0 / 35.0 * n4,
            4279.0 / 630.0 * n4,
        ];
        let terms = [2.0, 4.0, 6.0, 8.0].into_iter().zip(delta);
        let lat = conformal + terms.map(|(t, d)| d * (t * conformal).sin()).sum::<f64>();
        let from_meridian = eta_sphere.sinh().atan2(xi_sphere.cos());
        let meridian_deg = f64::from(self.number) * 6.0 - 183.0;
        Some(Geodetic::new(
            lat.to_degrees(),
            meridian_deg + from_meridian.to_degrees(),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // pyproj 3.7 (PROJ 9): pyproj.Proj(proj="utm", zone=38, ellps="WGS84")(444140.54, 3684706.36, inverse=True), with
    // south=True in the third; the first is the example of GeographicLib's GeoConvert, 33.3 44.4.
    #[test]
    fn places_are_those_of_proj() {
        for (zone, easting_m, northing_m, lat_deg, lon_deg) in [
            (
                "38N",
                444_140.54,
                3_684_706.36,
                33.300_000_040,
                44.399_999_947,
            ),
            (
                "13 N",
                680_000.0,
                3_618_000.0,
                32.685_037_291,
                -103.080_075_743,
            ),
            (
                "56S",
                334_000.0,
                6_251_000.0,
                -33.868_276_387,
                151.205_326_028,
            ),
            (
                "29T",
                592_000.0,
                4_810_500.0,
                43.441_750_430,
                -7.863_107_011,
            ),
            ("31n", 166_021.4, 0.0, 0.0, -0.000_000_387),
        ] {
            let at = UtmZone::parse(zone)
                .unwrap()
                .to_geodetic(easting_m, northing_m);
            let at = at.unwrap();
            assert!((at.lat_deg - lat_deg).abs() < 2e-9, "{zone}: {at:?}");
            assert!((at.lon_deg - lon_deg).abs() < 2e-9, "{zone}: {at:?}");
        }
    }

    #[test]
    fn what_is_no_zone_or_no_place_in_it_is_none() {
        for text in ["", "N", "61N", "0N", "29", "29I", "29Ä", "north"] {
            assert_eq!(UtmZone::parse(text), None, "{text}");
        }
        let zone = UtmZone::parse("29N").unwrap();
        assert_eq!(zone.to_geodetic(-1.0, 0.0), None);
        assert_eq!(zone.to_geodetic(500_000.0, f64::NAN), None);
    }
}
