//! Heights in an ESRI ASCII grid (`.asc`), as `gdal_translate -of AAIGrid` writes them of any elevation model in
//! degrees of WGS84: small enough to lie beside a scenario.

use crate::geo::Geodetic;
use crate::terrain::of_land;

/// Most posts of a grid: a tile of one arc-second has 12 967 201.
const MOST_POSTS: usize = 13_000_000;

/// A grid of heights.
#[derive(Debug, Clone, PartialEq)]
pub struct AsciiGrid {
    columns: usize,
    rows: usize,
    /// Centre of the south-west post, and step from post to post, degrees.
    west_deg: f64,
    south_deg: f64,
    step_deg: f64,
    /// Row by row from the north, m above mean sea level; not a number where there is none.
    heights_amsl_m: Vec<f32>,
}

impl AsciiGrid {
    /// Reads the text of a grid.
    ///
    /// # Errors
    /// What is missing or is no number, in words.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut words = text.split_ascii_whitespace().peekable();
        let mut header: Vec<(String, f64)> = Vec::new();
        while let Some(name) = words.next_if(|w| w.starts_with(|c: char| c.is_ascii_alphabetic())) {
            let name = name.to_ascii_lowercase();
            let value = words.next().and_then(|w| w.parse().ok());
            let may_be_nan = name == "nodata_value";
            let value = value.filter(|v: &f64| v.is_finite() || (may_be_nan && v.is_nan()));
            header.push((
                name.clone(),
                value.ok_or(format!("{name}: expected a number"))?,
            ));
        }
        let key = |wanted: &str| header.iter().find(|(name, _)| name == wanted).map(|h| h.1);
        let needed = |name: &str| key(name).ok_or(format!("no {name} in the header; expected one"));
        let count = |name: &str| -> Result<usize, String> {
            let value = needed(name)?;
            let fits = value.fract() == 0.0 && (2.0..=MOST_POSTS as f64).contains(&value);
            let refused = || format!("{name} {value}; expected a whole number from 2");
            fits.then_some(value as usize).ok_or_else(refused)
        };
        let (columns, rows, step_deg) = (count("ncols")?, count("nrows")?, needed("cellsize")?);
        if !(step_deg > 0.0 && step_deg <= 1.0) {
            return Err(format!(
                "cellsize {step_deg}; expected degrees, above 0 to 1"
            ));
        }
        // By the corner of the post's cell, or by its centre.
        let edge = |axis: char| match key(&format!("{axis}llcenter")) {
            Some(centre) => Ok(centre),
            None => needed(&format!("{axis}llcorner")).map(|corner| corner + 0.5 * step_deg),
        };
        let (west_deg, south_deg) = (edge('x')?, edge('y')?);
        // As grids hold them: header and cells may print the same number with different digits.
        let none = key("nodata_value").unwrap_or(-9999.0) as f32;
        let height = |word: &str| {
            let value: f32 = word
                .parse()
                .map_err(|_| format!("\"{word}\" among the heights; expected numbers"))?;
            let is_land = value != none && of_land(f64::from(value)).is_some();
            Ok(if is_land { value } else { f32::NAN })
        };
        let heights_amsl_m: Vec<f32> = words.map(height).collect::<Result<_, String>>()?;
        let wanted = columns.saturating_mul(rows);
        if heights_amsl_m.len() != wanted || wanted > MOST_POSTS {
            let found = heights_amsl_m.len();
            return Err(format!(
                "{found} heights; expected {wanted}, {rows} rows of {columns}, and {MOST_POSTS} at most"
            ));
        }
        Ok(Self {
            columns,
            rows,
            west_deg,
            south_deg,
            step_deg,
            heights_amsl_m,
        })
    }

    /// Row from the north and column of a place among the posts; none outside them.
    pub(crate) fn post_of(&self, at: Geodetic) -> Option<(f64, f64)> {
        let column = (at.lon_deg - self.west_deg) / self.step_deg;
        let last = (self.rows - 1) as f64;
        let row = last - (at.lat_deg - self.south_deg) / self.step_deg;
        let inside =
            (0.0..=(self.columns - 1) as f64).contains(&column) && (0.0..=last).contains(&row);
        inside.then_some((row, column))
    }

    /// Height of a post; the last ones stand in for those beyond.
    pub(crate) fn height_amsl_m(&self, row: usize, column: usize) -> Option<f64> {
        let (row, column) = (row.min(self.rows - 1), column.min(self.columns - 1));
        let height = *self.heights_amsl_m.get(row * self.columns + column)?;
        (!height.is_nan()).then_some(f64::from(height))
    }

    /// Latitude and longitude of the south-west and the north-east post, degrees.
    pub(crate) fn corners_deg(&self) -> [(f64, f64); 2] {
        let span = |count: usize| (count - 1) as f64 * self.step_deg;
        let north_east = (
            self.south_deg + span(self.rows),
            self.west_deg + span(self.columns),
        );
        [(self.south_deg, self.west_deg), north_east]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TEXT: &str = "ncols 3\nnrows 2\nxllcorner 7.5\nyllcorner 45.5\ncellsize 1\nNODATA_value -1\n\
        10 20 30\n40 -1 60\n";

    #[test]
    fn posts_stand_in_the_middle_of_their_cells() {
        let grid = AsciiGrid::parse(TEXT).unwrap();
        assert_eq!(grid.corners_deg(), [(46.0, 8.0), (47.0, 10.0)]);
        let at = |lat_deg, lon_deg| grid.post_of(Geodetic::new(lat_deg, lon_deg));
        assert_eq!(at(47.0, 8.0), Some((0.0, 0.0)));
        assert_eq!(at(46.0, 10.0), Some((1.0, 2.0)));
        assert_eq!(at(45.9, 9.0), None);
        assert_eq!(grid.height_amsl_m(0, 2), Some(30.0));
        assert_eq!(grid.height_amsl_m(1, 1), None);
        let by_centre = TEXT
            .replace("corner 7.5", "center 8")
            .replace("corner 45.5", "center 46");
        let by_centre = AsciiGrid::parse(&by_centre).unwrap();
        assert_eq!(by_centre.corners_deg(), grid.corners_deg());
    }

    // Pairs of header and cell as GDAL, WindNinja and others print one number; the last cells are heights of no land.
    #[test]
    fn a_post_without_a_height_is_none_however_it_is_written() {
        for (header, cell) in [
            ("-9999", "-9999.000"),
            ("-3.3999999521443642e+38", "-3.39999999999999996e+38"),
            ("-3.4028234663852886e+38", "-3.402823e+38"),
            ("nan", "nan"),
            ("-9999", "nan"),
            ("-9999", "-32768"),
            ("-9999", "1e20"),
            ("-9999", "-3.4e38"),
            ("0", "0.0"),
        ] {
            let text = TEXT
                .replace("NODATA_value -1", &format!("NODATA_value {header}"))
                .replace(" -1 ", &format!(" {cell} "));
            let grid = AsciiGrid::parse(&text).unwrap();
            assert_eq!(grid.height_amsl_m(1, 1), None, "{header} {cell}");
            assert_eq!(grid.height_amsl_m(1, 2), Some(60.0));
        }
        let below_the_sea = TEXT.replace(" -1 ", " -430 ");
        let grid = AsciiGrid::parse(&below_the_sea).unwrap();
        assert_eq!(grid.height_amsl_m(1, 1), Some(-430.0));
    }

    #[test]
    fn what_is_no_grid_is_refused_in_words() {
        for (from, to, words) in [
            ("ncols 3", "ncols 4", "expected 8"),
            ("nrows 2", "", "no nrows"),
            ("cellsize 1", "cellsize 90", "degrees"),
            ("cellsize 1", "cellsize x", "cellsize: expected a number"),
            ("40", "forty", "forty"),
            ("ncols 3", "ncols 2.5", "whole number"),
        ] {
            let refused = AsciiGrid::parse(&TEXT.replacen(from, to, 1)).unwrap_err();
            assert!(refused.contains(words), "{refused}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "(ncols|nrows|cellsize|xllcorner|[0-9. eE-]{1,6}| |\n){0,40}") {
            let _ = AsciiGrid::parse(&text);
        }
    }
}
