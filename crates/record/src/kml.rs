//! Tracks as KML for map viewers: of each vehicle a track that moves with the time slider and lines coloured by
//! what was read, the plume as lines of one concentration at several heights, the peak, the stacks and the fence.
//!
//! KML wants dates: a mission whose scenario says no start begins at 2000-01-01T00:00:00Z.
//!
//! OGC 07-147r2, *KML 2.2*, whose schema fixes the order of elements; tracks and their readings are Google's
//! extension of it (`gx`).

pub(crate) mod xml;

use crate::RecordError;
use crate::antimeridian::{Corner, OnLine, areas, pieces};
use crate::colour::Shown;
use crate::contour::PlumeLine;
use crate::text;
use crate::tracks::{TrackPoint, Tracks, VehicleTrack};
use formats::calendar::rfc_3339;
use formats::number::plus_minus;
use protocol::message::Peak;
use std::fmt::Write as _;
use xml::{Written, Xml};

/// Number of colours of the lines: KML has no gradients, every colour is a style and every change of
/// colour a placemark.
const COLOURS: usize = 24;
/// Longest segment of a line of one colour, s: so that the time slider moves smoothly.
const MAX_SEGMENT_S: f64 = 10.0;
/// The beginning of missions that say none, ns since 1970: 2000-01-01T00:00:00Z.
pub const NO_START_NS: i64 = 946_684_800_000_000_000;
/// Rows of the legend.
const LEGEND_ROWS: usize = 6;
/// Id of the description of a track's readings.
const READINGS: &str = "readings";

/// A stack on the map.
#[derive(Debug, Clone, PartialEq)]
pub struct StackMarker {
    /// Its name.
    pub name: String,
    /// Latitude, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude, degrees (WGS84).
    pub lon_deg: f64,
    /// Height above ground, m.
    pub height_m: f64,
}

/// What stands on the map beside the tracks.
#[derive(Debug, Clone)]
pub struct MapFeatures {
    /// Name of the mission.
    pub mission: String,
    /// How readings are shown.
    pub shown: Shown,
    /// The stacks.
    pub stacks: Vec<StackMarker>,
    /// Corners of the fence, latitude and longitude in degrees; none for no fence.
    pub fence: Vec<(f64, f64)>,
    /// Top of the fence, m above mean sea level.
    pub fence_top_amsl_m: f64,
    /// The peak that was found.
    pub peak: Option<Peak>,
}

/// All that is on a map.
#[derive(Debug, Clone, Copy)]
pub struct Map<'a> {
    /// When the mission began, ns since 1970, where that is said.
    pub start_unix_ns: Option<i64>,
    /// The tracks.
    pub tracks: &'a Tracks,
    /// What stands beside them.
    pub around: &'a MapFeatures,
    /// The plume as the model has it.
    pub plume: &'a [PlumeLine],
}

/// The KML text of `map`.
///
/// # Errors
/// [`RecordError::Kml`] if the writer fails.
pub fn document(map: &Map<'_>) -> Result<String, RecordError> {
    let mut xml = Xml::new();
    let written = xml.document(|xml| map.write(xml));
    written.map_err(|e| RecordError::Kml(e.to_string()))?;
    xml.finish().map_err(|e| RecordError::Kml(e.to_string()))
}

impl Map<'_> {
    fn write(&self, xml: &mut Xml) -> Written {
        let shown = &self.around.shown;
        xml.text("name", &format!("Plumage: {}", self.around.mission))?;
        xml.text("description", &self.legend())?;
        styles(xml, shown)?;
        schema(xml, shown)?;
        for (id, track) in self.tracks.by_vehicle() {
            self.vehicle(xml, id, track)?;
        }
        plume(xml, shown, self.plume)?;
        if let Some(found) = &self.around.peak {
            peak(xml, shown, found)?;
        }
        for marker in &self.around.stacks {
            stack(xml, marker)?;
        }
        if self.around.fence.len() >= 3 {
            fence(xml, self.around)?;
        }
        Ok(())
    }

    /// The date of a simulated time.
    fn date(&self, time_s: f64) -> String {
        let since_ns = (time_s * 1e3).round() as i64 * 1_000_000;
        rfc_3339(
            self.start_unix_ns
                .unwrap_or(NO_START_NS)
                .saturating_add(since_ns),
        )
    }

    /// What the colours mean, and where the dates are from.
    fn legend(&self) -> String {
        let shown = &self.around.shown;
        let mut said = format!("<p>Readings: {}</p><table>", shown.axis());
        for row in 0..LEGEND_ROWS {
            let along = row as f64 / (LEGEND_ROWS - 1) as f64;
            let ppm = shown.grey_ppm + along * (shown.red_ppm - shown.grey_ppm);
            let [r, g, b] = shown.colour(ppm);
            let end = match row {
                0 => " or less",
                _ if row + 1 == LEGEND_ROWS => " or more",
                _ => "",
            };
            let _ = write!(
                said,
                "<tr><td bgcolor=\"#{r:02x}{g:02x}{b:02x}\">&nbsp;&nbsp;&nbsp;</td><td>{}{end}</td></tr>",
                shown.number(ppm)
            );
        }
        said += "</table>";
        if !self.plume.is_empty() {
            said +=
                "<p>Lines of the plume: concentration above background by the model at the end</p>";
        }
        if self.start_unix_ns.is_none() {
            said += "<p>The scenario has no start; dates count from 2000-01-01</p>";
        }
        said
    }

    fn vehicle(&self, xml: &mut Xml, id: &str, track: &VehicleTrack) -> Written {
        let shown = &self.around.shown;
        let name = format!("Vehicle {id} ({})", text::vehicle_kind(track.kind));
        let points = track.points.items();
        xml.folder(&name, |xml| {
            xml.placemark(&format!("Track of {id}"), |xml| {
                xml.text("styleUrl", "#track")?;
                self.track(xml, &pieces(points))
            })?;
            xml.folder(&format!("Readings of {id}"), |xml| {
                for (index, points) in segments(shown, points) {
                    for piece in pieces(points) {
                        self.segment(xml, index, &piece)?;
                    }
                }
                Ok(())
            })
        })
    }

    /// The track with times and readings: one, or several where it is cut.
    fn track(&self, xml: &mut Xml, pieces: &[Vec<TrackPoint>]) -> Written {
        if let [whole] = pieces {
            return self.piece_of_track(xml, whole);
        }
        xml.within("gx:MultiTrack", &[], |xml| {
            xml.text("altitudeMode", "absolute")?;
            xml.text("gx:interpolate", "0")?;
            pieces
                .iter()
                .try_for_each(|piece| self.piece_of_track(xml, piece))
        })
    }

    fn piece_of_track(&self, xml: &mut Xml, points: &[TrackPoint]) -> Written {
        let shown = &self.around.shown;
        xml.within("gx:Track", &[], |xml| {
            xml.text("altitudeMode", "absolute")?;
            for point in points {
                xml.text("when", &self.date(point.time_s))?;
            }
            for point in points {
                xml.text("gx:coord", &coordinates(&corner(point), ' '))?;
            }
            let schema = format!("#{READINGS}");
            xml.within("ExtendedData", &[], |xml| {
                xml.within("SchemaData", &[("schemaUrl", &schema)], |xml| {
                    let field = field(shown);
                    xml.within("gx:SimpleArrayData", &[("name", &field)], |xml| {
                        let mut values = points.iter().map(|p| shown.number(p.co2_ppm));
                        values.try_for_each(|value| xml.text("gx:value", &value))
                    })
                })
            })
        })
    }

    fn segment(&self, xml: &mut Xml, index: usize, points: &[TrackPoint]) -> Written {
        let shown = &self.around.shown;
        let highest = points.iter().map(|p| p.co2_ppm).fold(f64::NAN, f64::max);
        let (Some(first), Some(last)) = (points.first(), points.last()) else {
            return Ok(());
        };
        xml.placemark(&said(shown, highest), |xml| {
            xml.within("TimeSpan", &[], |xml| {
                xml.text("begin", &self.date(first.time_s))?;
                xml.text("end", &self.date(last.time_s))
            })?;
            xml.text("styleUrl", &format!("#{}", style(shown, index)))?;
            xml.data(&[
                (&format!("highest_{}", field(shown)), &shown.number(highest)),
                ("from_s", &format!("{:.1}", first.time_s)),
                ("to_s", &format!("{:.1}", last.time_s)),
            ])?;
            let corners: Vec<Corner> = points.iter().map(corner).collect();
            line(xml, &corners)
        })
    }
}

/// KML writes colours as alpha, blue, green, red.
fn kml_colour(alpha: u8, [r, g, b]: [u8; 3]) -> String {
    format!("{alpha:02x}{b:02x}{g:02x}{r:02x}")
}

/// Id of the style of a colour: "co2-3".
fn style(shown: &Shown, index: usize) -> String {
    format!("{}-{index}", shown.gas.as_str())
}

/// Name of the field of readings: "co2_ppm".
fn field(shown: &Shown) -> String {
    format!("{}_ppm", shown.gas.as_str())
}

fn styles(xml: &mut Xml, shown: &Shown) -> Written {
    for index in 0..COLOURS {
        let along = index as f64 / (COLOURS - 1) as f64;
        let ppm = shown.grey_ppm + along * (shown.red_ppm - shown.grey_ppm);
        xml.line_style(
            &style(shown, index),
            &kml_colour(0xff, shown.colour(ppm)),
            3,
        )?;
    }
    for (index, excess) in shown.levels_ppm().into_iter().enumerate() {
        let colour = shown.colour(shown.grey_ppm + excess);
        xml.line_style(&plume_style(index), &kml_colour(0x90, colour), 1)?;
    }
    xml.within("Style", &[("id", "fence")], |xml| {
        xml.line("ffc08040", 2)?;
        xml.within("PolyStyle", &[], |xml| xml.text("color", "18c08040"))
    })?;
    xml.within("Style", &[("id", "track")], |xml| {
        xml.icon(
            "ffffffff",
            0.7,
            "http://maps.google.com/mapfiles/kml/shapes/airports.png",
        )?;
        xml.line("60ffffff", 1)
    })?;
    let star = "http://maps.google.com/mapfiles/kml/shapes/star.png";
    for (id, colour, scale) in [("peak", "ff00d7ff", 1.3), ("stack", "ff606060", 1.0)] {
        xml.within("Style", &[("id", id)], |xml| xml.icon(colour, scale, star))?;
    }
    Ok(())
}

fn plume_style(level: usize) -> String {
    format!("plume-{level}")
}

fn schema(xml: &mut Xml, shown: &Shown) -> Written {
    xml.within("Schema", &[("name", READINGS), ("id", READINGS)], |xml| {
        let field = [("type", "float"), ("name", &*field(shown))];
        xml.within("gx:SimpleArrayField", &field, |xml| {
            xml.text("displayName", &shown.axis())
        })
    })
}

fn colour_index(shown: &Shown, ppm: f64) -> usize {
    (shown.along(ppm) * (COLOURS - 1) as f64).round() as usize
}

/// The track in segments of one colour that share their ends, so that no gap shows between them. A
/// segment's colour is that of the readings at which its legs end.
fn segments<'a>(shown: &Shown, points: &'a [TrackPoint]) -> Vec<(usize, &'a [TrackPoint])> {
    let mut segments = Vec::new();
    let mut from = 0;
    for end in 1..points.len() {
        let index = colour_index(shown, points[end].co2_ppm);
        let last = end + 1 == points.len();
        let changes = !last && colour_index(shown, points[end + 1].co2_ppm) != index;
        let long = points[end].time_s - points[from].time_s >= MAX_SEGMENT_S;
        if last || changes || long {
            segments.push((index, &points[from..=end]));
            from = end;
        }
    }
    segments
}

fn corner(point: &TrackPoint) -> Corner {
    [point.lon_deg, point.lat_deg, point.alt_amsl_m]
}

/// A tenth of a metre (1e-6 of a degree) is finer than any position here and keeps the file small.
fn coordinates([lon_deg, lat_deg, alt_m]: &Corner, apart: char) -> String {
    let round = |value: f64, per_unit: f64| (value * per_unit).round() / per_unit;
    format!(
        "{}{apart}{}{apart}{}",
        round(*lon_deg, 1e6),
        round(*lat_deg, 1e6),
        round(*alt_m, 10.0)
    )
}

fn all_coordinates(corners: &[Corner]) -> String {
    let each: Vec<String> = corners.iter().map(|c| coordinates(c, ',')).collect();
    each.join(" ")
}

fn line(xml: &mut Xml, corners: &[Corner]) -> Written {
    xml.within("LineString", &[], |xml| {
        xml.text("altitudeMode", "absolute")?;
        xml.text("coordinates", &all_coordinates(corners))
    })
}

/// One folder a level, outermost first.
fn plume(xml: &mut Xml, shown: &Shown, lines: &[PlumeLine]) -> Written {
    if lines.is_empty() {
        return Ok(());
    }
    xml.folder("Plume", |xml| {
        for (index, level) in shown.levels_ppm().into_iter().enumerate() {
            let name = format!("{} above background", said(shown, level));
            xml.placemark(&name, |xml| {
                xml.text("styleUrl", &format!("#{}", plume_style(index)))?;
                xml.data(&[(&format!("excess_{}", field(shown)), &shown.number(level))])?;
                xml.within("MultiGeometry", &[], |xml| {
                    let of_level = lines.iter().filter(|l| l.excess_ppm == level);
                    let mut cut = of_level.flat_map(|l| pieces(&l.corners));
                    cut.try_for_each(|piece| line(xml, &piece))
                })
            })?;
        }
        Ok(())
    })
}

fn point_placemark(
    xml: &mut Xml,
    (name, description, style): (&str, &str, &str),
    at: Corner,
    mode: &str,
) -> Written {
    xml.placemark(name, |xml| {
        xml.text("description", description)?;
        xml.text("styleUrl", &format!("#{style}"))?;
        xml.within("Point", &[], |xml| {
            xml.text("extrude", "1")?;
            xml.text("altitudeMode", mode)?;
            xml.text("coordinates", &coordinates(&at, ','))
        })
    })
}

/// A reading with unit and gas.
fn said(shown: &Shown, ppm: f64) -> String {
    format!("{} ppm {}", shown.number(ppm), shown.gas.formula())
}

fn peak(xml: &mut Xml, shown: &Shown, peak: &Peak) -> Written {
    let value = plus_minus(peak.co2_ppm, peak.sd_ppm);
    let name = format!("Peak: {value} ppm {}", shown.gas.formula());
    let description = format!("background included; {}", peak.status.words());
    let at = [peak.lon_deg, peak.lat_deg, peak.alt_amsl_m];
    point_placemark(xml, (&name, &description, "peak"), at, "absolute")
}

fn stack(xml: &mut Xml, stack: &StackMarker) -> Written {
    let description = format!("{:.0} m high", stack.height_m);
    let at = [stack.lon_deg, stack.lat_deg, stack.height_m];
    point_placemark(
        xml,
        (&stack.name, &description, "stack"),
        at,
        "relativeToGround",
    )
}

fn fence(xml: &mut Xml, features: &MapFeatures) -> Written {
    let corners = features.fence.iter();
    let corners: Vec<Corner> = corners
        .map(|&(lat, lon)| [lon, lat, features.fence_top_amsl_m])
        .collect();
    xml.placemark("Fence", |xml| {
        xml.text("styleUrl", "#fence")?;
        xml.within("MultiGeometry", &[], |xml| {
            areas(&corners).into_iter().try_for_each(|mut ring| {
                ring.extend(ring.first().copied());
                polygon(xml, &ring)
            })
        })
    })
}

fn polygon(xml: &mut Xml, ring: &[Corner]) -> Written {
    xml.within("Polygon", &[], |xml| {
        xml.text("extrude", "1")?;
        xml.text("altitudeMode", "absolute")?;
        xml.within("outerBoundaryIs", &[], |xml| {
            xml.within("LinearRing", &[], |xml| {
                xml.text("coordinates", &all_coordinates(ring))
            })
        })
    })
}

impl OnLine for TrackPoint {
    fn lon_deg(&self) -> f64 {
        self.lon_deg
    }

    fn between(&self, next: &Self, share: f64, lon_deg: f64) -> Self {
        let along = |of: fn(&Self) -> f64| of(self) + share * (of(next) - of(self));
        Self {
            time_s: along(|p| p.time_s),
            lat_deg: along(|p| p.lat_deg),
            lon_deg,
            alt_amsl_m: along(|p| p.alt_amsl_m),
            co2_ppm: along(|p| p.co2_ppm),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_share_their_ends_and_cover_the_track() {
        let points: Vec<TrackPoint> = (0..200)
            .map(|i| TrackPoint {
                time_s: f64::from(i),
                lat_deg: 43.0,
                lon_deg: -7.0,
                alt_amsl_m: 800.0,
                co2_ppm: 450.0 + 200.0 * (f64::from(i) / 9.0).sin().abs(),
            })
            .collect();
        let segments = segments(&Shown::CO2, &points);
        assert_eq!(segments[0].1[0], points[0]);
        assert_eq!(
            segments.last().map(|p| p.1[p.1.len() - 1]),
            points.last().copied()
        );
        for pair in segments.windows(2) {
            assert_eq!(pair[0].1.last(), pair[1].1.first());
            assert!(pair[0].1.len() >= 2);
        }
        assert!(count(&points[..1]) == 0 && count(&[]) == 0);
    }

    fn count(points: &[TrackPoint]) -> usize {
        segments(&Shown::CO2, points).len()
    }
}
