//! The site on the map, and the plume on a grid of it.

use air::geo::{Enu, Geodetic, LocalFrame};
use protocol::message::Model;
use record::colour::Shown;
use record::kml::StackMarker;
use record::summary::PlaceOfPeak;
use record::tracks::Tracks;
use scenario::bounds::Bounds;
use serde_json::{Value, json};
use std::sync::Arc;

/// A place at which a plume is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapPoint {
    /// Metres east and north of the site's origin.
    pub at: Enu,
    /// Altitude, m above mean sea level.
    pub alt_amsl_m: f64,
}

/// Mean mole fraction in ppm, background included, that a model has at some points; one value a point.
pub type ModelField = Arc<dyn Fn(&Model, &[MapPoint]) -> Vec<f64> + Send + Sync>;
/// Mean mole fraction in ppm, background included, of the stand-in's reality at some points.
pub type RealityField = Arc<dyn Fn(&[MapPoint]) -> Vec<f64> + Send + Sync>;

/// Height of the ground at a place, m above mean sea level; none beyond what terrain is known.
pub type GroundHeight = Arc<dyn Fn(Enu) -> Option<f64> + Send + Sync>;

/// What stands on the map whatever the mission does.
#[derive(Clone)]
pub struct SiteMap {
    /// Name of the mission.
    pub mission: String,
    /// How readings are shown.
    pub shown: Shown,
    /// Under what conditions it is flown, as the report tells them: what, and how much of it.
    pub conditions: Vec<(String, String)>,
    /// Planned length of the mission, s.
    pub duration_s: f64,
    /// The site's frame.
    pub frame: LocalFrame,
    /// The stacks.
    pub stacks: Vec<StackMarker>,
    /// Corners of the fence, latitude and longitude in degrees; none for no fence.
    pub fence: Vec<(f64, f64)>,
    /// Lowest and highest altitude at which vehicles fly, m above mean sea level.
    pub height_band_amsl_m: (f64, f64),
    /// Where each vehicle may be sent, by its id.
    pub bounds: Vec<(String, Bounds)>,
    /// Radius around each stack into which no vehicle flies, m.
    pub keep_out_radius_m: f64,
    /// The ground as far as it is known; flat without terrain.
    pub known_ground_amsl_m: GroundHeight,
    /// Whether the ground is that of a terrain tile or grid.
    pub has_terrain: bool,
    /// The plume of a model, for contours and predictions.
    pub field: ModelField,
    /// The stand-in's reality, where it is known: for the report, never for the page.
    pub reality: Option<RealityField>,
    /// The true peak of the stand-in's reality at the mission's beginning, where it is known.
    pub true_peak: Option<PlaceOfPeak>,
}

/// A rectangle of the map, metres east and north.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Area {
    pub(crate) low: Enu,
    pub(crate) high: Enu,
}

impl Area {
    fn empty() -> Self {
        let at = |m: f64| Enu {
            east_m: m,
            north_m: m,
        };
        Self {
            low: at(f64::INFINITY),
            high: at(f64::NEG_INFINITY),
        }
    }

    pub(crate) fn include(&mut self, at: Enu) {
        self.low.east_m = self.low.east_m.min(at.east_m);
        self.low.north_m = self.low.north_m.min(at.north_m);
        self.high.east_m = self.high.east_m.max(at.east_m);
        self.high.north_m = self.high.north_m.max(at.north_m);
    }

    pub(crate) fn widened(mut self, by_m: f64) -> Self {
        self.low = Enu {
            east_m: self.low.east_m - by_m,
            north_m: self.low.north_m - by_m,
        };
        self.high = Enu {
            east_m: self.high.east_m + by_m,
            north_m: self.high.north_m + by_m,
        };
        self
    }
}

impl Area {
    /// West, south, east and north ends, m.
    pub(crate) fn ends(self) -> [f64; 4] {
        let Self { low, high } = self;
        [low.east_m, low.north_m, high.east_m, high.north_m]
    }
}

/// A level grid of concentrations.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Grid {
    pub(crate) east_m: Vec<f64>,
    pub(crate) north_m: Vec<f64>,
    pub(crate) alt_amsl_m: f64,
    /// Row by row from south, west to east in a row, ppm.
    pub(crate) ppm: Vec<f64>,
}

impl Grid {
    /// A grid of `columns` by about as many rows at `alt_amsl_m` over `area`, filled by `field`.
    pub(crate) fn fill(
        area: Area,
        columns: usize,
        alt_amsl_m: f64,
        field: impl FnOnce(&[MapPoint]) -> Vec<f64>,
    ) -> Self {
        let axis = |low: f64, high: f64, step: f64| -> Vec<f64> {
            let n = ((high - low) / step).round().clamp(1.0, 400.0) as usize;
            (0..=n).map(|i| low + step * i as f64).collect()
        };
        let width = (area.high.east_m - area.low.east_m).max(100.0);
        let step = width / columns.max(2) as f64;
        let east_m = axis(area.low.east_m, area.high.east_m, step);
        let north_m = axis(area.low.north_m, area.high.north_m, step);
        let points: Vec<MapPoint> = north_m
            .iter()
            .flat_map(|&north_m| {
                east_m.iter().map(move |&east_m| MapPoint {
                    at: Enu { east_m, north_m },
                    alt_amsl_m,
                })
            })
            .collect();
        let ppm = field(&points);
        Self {
            east_m,
            north_m,
            alt_amsl_m,
            ppm,
        }
    }
}

impl SiteMap {
    /// Why a vehicle does not go to a place, by the rule by which it refuses setpoints; nothing where it may.
    pub(crate) fn refuses(&self, vehicle: &str, to: &MapPoint) -> Option<String> {
        let (_, bounds) = self.bounds.iter().find(|(id, _)| id == vehicle)?;
        bounds.refuses(self.frame.to_geodetic(to.at), to.alt_amsl_m)
    }

    /// Metres east and north of a place.
    pub(crate) fn enu(&self, lat_deg: f64, lon_deg: f64) -> Enu {
        self.frame.to_enu(Geodetic { lat_deg, lon_deg })
    }

    /// The area of the keep-out cylinders and the tracks; of the fence while nothing has flown.
    pub(crate) fn area(&self, tracks: &Tracks) -> Area {
        let mut area = Area::empty();
        let radius = self.keep_out_radius_m.max(200.0);
        for stack in &self.stacks {
            let at = self.enu(stack.lat_deg, stack.lon_deg);
            for bearing in [0.0, 90.0, 180.0, 270.0] {
                area.include(at.displaced(bearing, radius));
            }
        }
        for track in tracks.by_vehicle().values() {
            for p in track.points.items() {
                area.include(self.enu(p.lat_deg, p.lon_deg));
            }
        }
        if tracks.by_vehicle().is_empty() {
            for &(lat, lon) in &self.fence {
                area.include(self.enu(lat, lon));
            }
        }
        if area.low.east_m > area.high.east_m {
            area.include(Enu::default());
            area = area.widened(2000.0);
        }
        area
    }

    /// Altitude of the model's axis at the first source, m above mean sea level.
    pub(crate) fn axis_amsl_m(&self, model: &Model) -> f64 {
        self.frame.ground_amsl_m + model.effective_height_agl_m.value
    }

    /// Height of the ground, m above mean sea level: that of the site where it is not known.
    pub fn ground_amsl_m(&self, at: Enu) -> f64 {
        (self.known_ground_amsl_m)(at).unwrap_or(self.frame.ground_amsl_m)
    }

    /// Contour lines of the page, ppm above background: those of the report and more between and above.
    fn levels_ppm(&self) -> [f64; 6] {
        let [low, _, high] = self.shown.levels_ppm();
        [low, 2.5 * low, 5.0 * low, 0.5 * high, high, 2.0 * high]
    }

    /// What the page's script needs once.
    pub(crate) fn json(&self) -> Value {
        let origin = self.frame.origin();
        json!({
            "mission": self.mission,
            "duration_s": self.duration_s,
            "lat": origin.lat_deg,
            "lon": origin.lon_deg,
            "ground_amsl_m": self.frame.ground_amsl_m,
            "has_terrain": self.has_terrain,
            "band_amsl_m": [self.height_band_amsl_m.0, self.height_band_amsl_m.1],
            "keep_out_radius_m": self.keep_out_radius_m,
            "stacks": self.stacks.iter().map(|s| {
                let at = self.enu(s.lat_deg, s.lon_deg);
                json!({"name": s.name, "e": at.east_m, "n": at.north_m, "height_m": s.height_m})
            }).collect::<Vec<_>>(),
            "fence": self.fence.iter().map(|&(lat, lon)| {
                let at = self.enu(lat, lon);
                [at.east_m, at.north_m]
            }).collect::<Vec<_>>(),
            "area": self.area(&Tracks::new(2, 1.0)).ends(),
            "colours": record::colour::stops(),
            "gas": self.shown.gas.formula(),
            "digits": self.shown.gas.digits(),
            "grey_ppm": self.shown.grey_ppm,
            "red_ppm": self.shown.red_ppm,
            "levels_ppm": self.levels_ppm(),
            "darkest_ppm": self.shown.darkest_ppm(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_covers_its_area_row_by_row_from_south() {
        let area = Area {
            low: Enu {
                east_m: -100.0,
                north_m: 0.0,
            },
            high: Enu {
                east_m: 300.0,
                north_m: 200.0,
            },
        };
        let grid = Grid::fill(area, 4, 800.0, |points| {
            points
                .iter()
                .map(|s| s.at.east_m + 1000.0 * s.at.north_m)
                .collect()
        });
        assert_eq!(grid.east_m, [-100.0, 0.0, 100.0, 200.0, 300.0]);
        assert_eq!(grid.north_m, [0.0, 100.0, 200.0]);
        assert_eq!(grid.ppm[5 + 2], 100.0 + 1000.0 * 100.0);
    }
}
