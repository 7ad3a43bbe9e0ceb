//! Places of a log that has them as metres east and north: of UTM, or of a place.

use super::layout::Layout;
use crate::ImportError;
use crate::map::PositionMap;
use air::geo::{Enu, Geodetic, LocalFrame};
use air::utm::UtmZone;
use formats::delimited::{Cells, number};

/// What metres count from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Origin {
    Zone(UtmZone),
    Place(LocalFrame),
}

/// How metres become latitude and longitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MetricPosition {
    east: usize,
    north: usize,
    origin: Origin,
    decimal_comma: bool,
}

impl MetricPosition {
    /// The position of the log `name` as `map` states it.
    ///
    /// # Errors
    /// An invalid zone or origin, or a missing column.
    pub fn find(name: &str, layout: &Layout, map: &PositionMap) -> Result<Self, ImportError> {
        let error = |what: String, todo: &str| {
            ImportError::log(name, format!("[log.position]: {what}"), todo)
        };
        let origin = match (&map.utm_zone, map.origin_lat_deg, map.origin_lon_deg) {
            (Some(zone), None, None) => {
                UtmZone::parse(zone).map(Origin::Zone).ok_or_else(|| {
                    error(
                        format!("utm_zone = \"{zone}\""),
                        "state the number, 1 to 60, and the hemisphere, such as 29N",
                    )
                })?
            }
            (None, Some(lat_deg), Some(lon_deg)) => LocalFrame::new(lat_deg, lon_deg, 0.0)
                .map(Origin::Place)
                .map_err(|e| error(e.to_string(), "state the place that the metres count from"))?,
            _ => {
                return Err(error(
                    "what the metres count from is not clear".to_owned(),
                    "state utm_zone, or origin_lat_deg and origin_lon_deg",
                ));
            }
        };
        Ok(Self {
            east: layout.column(name, &map.east)?,
            north: layout.column(name, &map.north)?,
            origin,
            decimal_comma: layout.decimal_comma,
        })
    }

    /// Latitude and longitude of a row, degrees; NaN where it has no place.
    pub fn of_row(&self, cells: &Cells) -> (f64, f64) {
        let value = |cell| number(cells.get(cell), self.decimal_comma);
        let at = value(self.east).zip(value(self.north));
        let at = at.and_then(|(east_m, north_m)| match self.origin {
            Origin::Zone(zone) => zone.to_geodetic(east_m, north_m),
            Origin::Place(frame) => Some(frame.to_geodetic(Enu::new(east_m, north_m))),
        });
        let Geodetic { lat_deg, lon_deg } = at.unwrap_or(Geodetic::new(f64::NAN, f64::NAN));
        (lat_deg, lon_deg)
    }

    /// The cells that it reads.
    pub fn cells(&self) -> [usize; 2] {
        [self.east, self.north]
    }
}
