//! A flight plan for an aircraft that Plumage does not command, in the formats of ground stations and maps.
//!
//! | format | heights by default | file |
//! |---|---|---|
//! | QGroundControl | above take-off | `.plan` |
//! | ArduPilot | above take-off | `.waypoints` |
//! | KML | above mean sea level | `.kml` |
//! | CSV | both | `.csv` |
//! | DJI WPML | above take-off | `.kmz` |

mod qgroundcontrol;
mod waypoints;
mod wpml;

use crate::kml::xml::Xml;
use crate::{RecordError, kmz};
use std::fmt::Write as _;

/// How long an aircraft waits where it stops, s.
const STOP_S: f64 = 2.0;

/// From which datum the heights of a plan count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Heights {
    /// Above the place of take-off.
    TakeOff,
    /// Above mean sea level.
    Amsl,
}

/// The format of a plan, by the ending of its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// QGroundControl's JSON.
    Plan,
    /// ArduPilot's table of mission items.
    Waypoints,
    /// A line for map viewers.
    Kml,
    /// A table.
    Csv,
    /// DJI's WPML, as Pilot 2 imports it.
    Wpml,
}

impl Format {
    /// The format of a file with that ending; none of another.
    pub fn of_ending(ending: &str) -> Option<Self> {
        Some(match ending {
            "plan" => Self::Plan,
            "waypoints" => Self::Waypoints,
            "kml" => Self::Kml,
            "csv" => Self::Csv,
            "kmz" => Self::Wpml,
            _ => return None,
        })
    }

    /// The datum of its heights where none is asked for.
    pub fn usual_heights(self) -> Heights {
        match self {
            Self::Plan | Self::Waypoints | Self::Wpml => Heights::TakeOff,
            Self::Kml | Self::Csv => Heights::Amsl,
        }
    }
}

/// A place on the way.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanPoint {
    /// Latitude, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude, degrees (WGS84).
    pub lon_deg: f64,
    /// Height above mean sea level, m.
    pub alt_amsl_m: f64,
    /// Whether the aircraft stops there.
    pub stops: bool,
    /// What it is for, in a word or two.
    pub purpose: String,
}

/// A flight from take-off to landing at the same place.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightPlan {
    /// Its name.
    pub name: String,
    /// Place of take-off and landing: latitude and longitude, degrees, and ground above mean sea level, m.
    pub home: (f64, f64, f64),
    /// Height above take-off to which it climbs first, m.
    pub take_off_height_m: f64,
    /// The places, in order.
    pub points: Vec<PlanPoint>,
    /// Speed over ground, of a fixed wing airspeed, m/s.
    pub speed_m_s: f64,
    /// Whether it flies a multirotor.
    pub multirotor: bool,
    /// Corners of the fence: latitude and longitude, degrees; empty: none.
    pub fence: Vec<(f64, f64)>,
    /// Highest height, m above mean sea level; none: unlimited.
    pub ceiling_amsl_m: Option<f64>,
}

impl FlightPlan {
    /// Length of the way from take-off along all places and back, m: great circles and climbs.
    pub fn length_m(&self) -> f64 {
        let (lat_deg, lon_deg, ground_m) = self.home;
        let home = (lat_deg, lon_deg, ground_m + self.take_off_height_m);
        let places = self
            .points
            .iter()
            .map(|p| (p.lat_deg, p.lon_deg, p.alt_amsl_m));
        let way: Vec<_> = std::iter::once(home).chain(places).chain([home]).collect();
        let legs = way.windows(2);
        legs.map(|ends| leg_m(ends[0], ends[1])).sum::<f64>() + 2.0 * self.take_off_height_m
    }

    /// The shortest flight time, s: at the plan's speed all the way, plus its waits. An autopilot slows down at corners.
    pub fn least_s(&self) -> f64 {
        let stops = self.points.iter().filter(|p| p.stops).count();
        self.length_m() / self.speed_m_s + STOP_S * stops as f64
    }

    /// The height of a place over a datum, m.
    fn height_m(&self, alt_amsl_m: f64, heights: Heights) -> f64 {
        match heights {
            Heights::TakeOff => alt_amsl_m - self.home.2,
            Heights::Amsl => alt_amsl_m,
        }
    }

    /// The plan in a format, as the bytes of a file. `made_ms` is the time at which it is made, ms since 1970 (WPML states
    /// it).
    ///
    /// # Errors
    /// [`RecordError::Plan`] for heights that the format cannot hold.
    pub fn encode(
        &self,
        format: Format,
        heights: Heights,
        made_ms: u64,
    ) -> Result<Vec<u8>, RecordError> {
        Ok(match format {
            Format::Plan => qgroundcontrol::encode(self, heights).into_bytes(),
            Format::Waypoints => waypoints::encode(self, heights).into_bytes(),
            Format::Kml => self.kml()?.into_bytes(),
            Format::Csv => self.csv().into_bytes(),
            Format::Wpml if heights == Heights::Amsl => {
                return Err(RecordError::Plan(
                    "WPML has heights above take-off or above the ellipsoid, whose distance from mean sea level \
                     depends on a geoid; expected --heights takeoff"
                        .to_owned(),
                ));
            }
            Format::Wpml => {
                let [template, waylines] = wpml::encode(self, made_ms);
                kmz::archive(&[
                    ("wpmz/template.kml", &template),
                    ("wpmz/waylines.wpml", &waylines),
                ])?
            }
        })
    }

    fn csv(&self) -> String {
        let mut out =
            "number,purpose,lat_deg,lon_deg,alt_amsl_m,height_above_takeoff_m,speed_m_s,stops\n"
                .to_owned();
        for (k, p) in self.points.iter().enumerate() {
            let above_m = self.height_m(p.alt_amsl_m, Heights::TakeOff);
            let _ = writeln!(
                out,
                "{},{},{:.7},{:.7},{:.1},{above_m:.1},{:.1},{}",
                k + 1,
                p.purpose,
                p.lat_deg,
                p.lon_deg,
                p.alt_amsl_m,
                self.speed_m_s,
                u8::from(p.stops)
            );
        }
        out
    }

    fn kml(&self) -> Result<String, RecordError> {
        let line = |(lat, lon, alt): (f64, f64, f64)| format!("{lon:.7},{lat:.7},{alt:.1}");
        let places = self
            .points
            .iter()
            .map(|p| (p.lat_deg, p.lon_deg, p.alt_amsl_m));
        let way: Vec<String> = std::iter::once(self.home)
            .chain(places)
            .chain([self.home])
            .map(line)
            .collect();
        let ring = self.fence.iter().chain(self.fence.first());
        let ring: Vec<String> = ring
            .map(|(lat, lon)| format!("{lon:.7},{lat:.7},0"))
            .collect();
        let mut xml = Xml::new();
        let written = xml.document(|xml| {
            xml.text("name", &self.name)?;
            if !ring.is_empty() {
                xml.placemark("fence", |xml| {
                    xml.within("Polygon", &[], |xml| {
                        xml.within("outerBoundaryIs", &[], |xml| {
                            xml.within("LinearRing", &[], |xml| {
                                xml.text("coordinates", &ring.join(" "))
                            })
                        })
                    })
                })?;
            }
            xml.placemark(&format!("flight at {:.1} m/s", self.speed_m_s), |xml| {
                xml.within("LineString", &[], |xml| {
                    xml.text("altitudeMode", "absolute")?;
                    xml.text("coordinates", &way.join(" "))
                })
            })
        });
        let failed = |e: String| RecordError::Kml(e);
        written.map_err(|e| failed(e.to_string()))?;
        xml.finish().map_err(|e| failed(e.to_string()))
    }
}

/// Distance between two places with heights, m, on a sphere of the Earth's mean radius.
fn leg_m(a: (f64, f64, f64), b: (f64, f64, f64)) -> f64 {
    const RADIUS_M: f64 = 6_371_008.8;
    let (lat_a, lat_b) = (a.0.to_radians(), b.0.to_radians());
    let half = |x: f64| (0.5 * x).sin().powi(2);
    let h = half(lat_b - lat_a) + lat_a.cos() * lat_b.cos() * half((b.1 - a.1).to_radians());
    (2.0 * RADIUS_M * h.sqrt().min(1.0).asin()).hypot(b.2 - a.2)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn plan() -> FlightPlan {
        let point = |k: usize| PlanPoint {
            lat_deg: 43.44 + 1e-4 * k as f64,
            lon_deg: -7.86,
            alt_amsl_m: 370.0 + 10.0 * k as f64,
            stops: k != 1,
            purpose: "curtain".to_owned(),
        };
        FlightPlan {
            name: "stack <1>".to_owned(),
            home: (43.4395, -7.861, 340.0),
            take_off_height_m: 20.0,
            points: (0..3).map(point).collect(),
            speed_m_s: 5.0,
            multirotor: true,
            fence: vec![(43.43, -7.87), (43.43, -7.85), (43.45, -7.85)],
            ceiling_amsl_m: Some(450.0),
        }
    }

    #[test]
    fn a_table_has_both_heights() {
        let csv = plan().csv();
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines.len(), 4);
        assert_eq!(lines[2], "2,curtain,43.4401000,-7.8600000,380.0,40.0,5.0,0");
    }

    #[test]
    fn a_map_has_absolute_heights_and_the_fence() {
        let kml = plan().kml().unwrap();
        assert!(kml.contains("<name>stack &lt;1&gt;</name>"));
        assert!(kml.contains("<altitudeMode>absolute</altitudeMode>"));
        assert!(kml.contains("-7.8610000,43.4395000,340.0 -7.8600000,43.4400000,370.0"));
        assert!(kml.contains("-7.8700000,43.4300000,0 -7.8500000,43.4300000,0"));
    }

    /// By hand: 1e-4° of latitude are 11.12 m.
    #[test]
    fn the_length_counts_climbs() {
        let leg = leg_m((43.44, -7.86, 370.0), (43.4401, -7.86, 380.0));
        assert!((leg - 11.119_f64.hypot(10.0)).abs() < 0.01, "{leg}");
    }

    /// Two of the three places are stops, of 2 s each.
    #[test]
    fn the_time_counts_waits() {
        let plan = plan();
        assert_eq!(plan.least_s(), plan.length_m() / 5.0 + 4.0);
    }

    #[test]
    fn sea_level_heights_are_refused_for_wpml() {
        let error = plan().encode(Format::Wpml, Heights::Amsl, 0).unwrap_err();
        assert!(error.to_string().contains("--heights takeoff"), "{error}");
        let zip = plan().encode(Format::Wpml, Heights::TakeOff, 0).unwrap();
        assert_eq!(&zip[..4], b"PK\x03\x04");
    }
}
