//! Tracks as KML for map viewers: one folder a vehicle, lines coloured by what was read with time spans,
//! the peak, the stacks and the fence.
//!
//! KML wants dates and a mission has only simulated time: it starts at 2000-01-01T00:00:00Z.

use crate::RecordError;
use crate::colour::Shown;
use crate::text;
use crate::tracks::{TrackPoint, Tracks, VehicleTrack};
use ::kml::types::{
    AltitudeMode, Coord, Element, Folder, Geometry, Icon, IconStyle, KmlDocument, LineString,
    LineStyle, LinearRing, Placemark, Point, PolyStyle, Polygon, Style,
};
use ::kml::{Kml, KmlVersion, KmlWriter};
use protocol::message::Peak;
use std::collections::HashMap;

/// Number of colours of the lines: KML has no gradients, every colour is a style and every change of
/// colour a placemark.
const COLOURS: usize = 24;
/// Longest segment of a line of one colour, s: so that the time slider moves smoothly.
const MAX_SEGMENT_S: f64 = 10.0;

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

/// The KML text of `tracks`.
///
/// # Errors
/// [`RecordError::Kml`] if the writer fails.
pub fn document(tracks: &Tracks, features: &MapFeatures) -> Result<String, RecordError> {
    let mut elements = vec![text_element(
        "name",
        &format!("Plumage: {}", features.mission),
    )];
    let shown = &features.shown;
    elements.extend((0..COLOURS).map(|index| line_style(shown, index)));
    elements.push(fence_style());
    elements.extend([
        icon_style("peak", "ff00d7ff", 1.3),
        icon_style("stack", "ff606060", 1.0),
    ]);
    for (id, track) in tracks.by_vehicle() {
        elements.push(Kml::Folder(folder(shown, id, track)));
    }
    elements.extend(features.peak.as_ref().map(|found| peak(shown, found)));
    elements.extend(features.stacks.iter().map(stack));
    if features.fence.len() >= 3 {
        elements.push(fence(features));
    }
    let document = Kml::KmlDocument(KmlDocument {
        version: KmlVersion::V22,
        attrs: attribute("xmlns", "http://www.opengis.net/kml/2.2"),
        elements: vec![Kml::Document {
            attrs: HashMap::new(),
            elements,
        }],
    });
    let mut bytes = b"<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_vec();
    KmlWriter::from_writer(&mut bytes)
        .write(&document)
        .map_err(|e| RecordError::Kml(e.to_string()))?;
    String::from_utf8(bytes).map_err(|e| RecordError::Kml(e.to_string()))
}

fn attribute(name: &str, value: &str) -> HashMap<String, String> {
    HashMap::from([(name.to_owned(), value.to_owned())])
}

fn element(name: &str, content: Option<String>, children: Vec<Element>) -> Element {
    Element {
        name: name.to_owned(),
        attrs: HashMap::new(),
        content,
        children,
    }
}

fn text_element(name: &str, text: &str) -> Kml {
    Kml::Element(element(name, Some(text.to_owned()), Vec::new()))
}

/// KML writes colours as alpha, blue, green, red.
fn kml_colour([r, g, b]: [u8; 3]) -> String {
    format!("ff{b:02x}{g:02x}{r:02x}")
}

/// Id of the style of a colour: "co2-3".
fn style(shown: &Shown, index: usize) -> String {
    format!("{}-{index}", shown.gas.as_str())
}

fn line_style(shown: &Shown, index: usize) -> Kml {
    let along = index as f64 / (COLOURS - 1) as f64;
    let ppm = shown.grey_ppm + along * (shown.red_ppm - shown.grey_ppm);
    Kml::Style(Style {
        id: Some(style(shown, index)),
        line: Some(LineStyle {
            color: kml_colour(shown.colour(ppm)),
            width: 3.0,
            ..LineStyle::default()
        }),
        ..Style::default()
    })
}

fn fence_style() -> Kml {
    Kml::Style(Style {
        id: Some("fence".to_owned()),
        line: Some(LineStyle {
            color: "ffc08040".to_owned(),
            width: 2.0,
            ..LineStyle::default()
        }),
        poly: Some(PolyStyle {
            color: "18c08040".to_owned(),
            ..PolyStyle::default()
        }),
        ..Style::default()
    })
}

fn icon_style(id: &str, colour: &str, scale: f64) -> Kml {
    Kml::Style(Style {
        id: Some(id.to_owned()),
        icon: Some(IconStyle {
            color: colour.to_owned(),
            scale,
            icon: Icon {
                href: "http://maps.google.com/mapfiles/kml/shapes/star.png".to_owned(),
                attrs: HashMap::new(),
            },
            ..IconStyle::default()
        }),
        ..Style::default()
    })
}

fn folder(shown: &Shown, id: &str, track: &VehicleTrack) -> Folder {
    Folder {
        name: Some(format!("Vehicle {id} ({})", text::vehicle_kind(track.kind))),
        elements: segments(shown, track.points.items())
            .into_iter()
            .map(|(index, points)| Kml::Placemark(segment(shown, index, points)))
            .collect(),
        ..Folder::default()
    }
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

fn segment(shown: &Shown, index: usize, points: &[TrackPoint]) -> Placemark {
    let highest = points.iter().map(|p| p.co2_ppm).fold(f64::NAN, f64::max);
    let span = element(
        "TimeSpan",
        None,
        vec![
            element("begin", points.first().map(|p| date(p.time_s)), Vec::new()),
            element("end", points.last().map(|p| date(p.time_s)), Vec::new()),
        ],
    );
    let line = LineString {
        coords: points.iter().map(coordinate).collect(),
        altitude_mode: AltitudeMode::Absolute,
        ..LineString::default()
    };
    Placemark {
        name: Some(said(shown, highest)),
        style_url: Some(format!("#{}", style(shown, index))),
        geometry: Some(Geometry::LineString(line)),
        children: vec![span],
        ..Placemark::default()
    }
}

fn coordinate(point: &TrackPoint) -> Coord {
    // A tenth of a metre (1e-6 of a degree) is finer than any position here and keeps the file small.
    let round = |value: f64, per_unit: f64| (value * per_unit).round() / per_unit;
    Coord::new(
        round(point.lon_deg, 1e6),
        round(point.lat_deg, 1e6),
        Some(round(point.alt_amsl_m, 10.0)),
    )
}

fn point_placemark(
    name: String,
    style: &str,
    description: String,
    at: Coord,
    mode: AltitudeMode,
) -> Kml {
    let mut point = Point::from(at);
    point.altitude_mode = mode;
    point.extrude = true;
    Kml::Placemark(Placemark {
        name: Some(name),
        description: Some(description),
        style_url: Some(format!("#{style}")),
        geometry: Some(Geometry::Point(point)),
        ..Placemark::default()
    })
}

/// A reading with unit and gas.
fn said(shown: &Shown, ppm: f64) -> String {
    format!("{} ppm {}", shown.number(ppm), shown.gas.formula())
}

fn peak(shown: &Shown, peak: &Peak) -> Kml {
    point_placemark(
        format!("Peak: {}", said(shown, peak.co2_ppm)),
        "peak",
        format!(
            "{} ± {}, background included",
            shown.number(peak.co2_ppm),
            said(shown, peak.sd_ppm)
        ),
        Coord::new(peak.lon_deg, peak.lat_deg, Some(peak.alt_amsl_m)),
        AltitudeMode::Absolute,
    )
}

fn stack(stack: &StackMarker) -> Kml {
    point_placemark(
        stack.name.clone(),
        "stack",
        format!("{:.0} m high", stack.height_m),
        Coord::new(stack.lon_deg, stack.lat_deg, Some(stack.height_m)),
        AltitudeMode::RelativeToGround,
    )
}

fn fence(features: &MapFeatures) -> Kml {
    let corners = features.fence.iter().chain(features.fence.first());
    let outer = LinearRing {
        coords: corners
            .map(|&(lat, lon)| Coord::new(lon, lat, Some(features.fence_top_amsl_m)))
            .collect(),
        altitude_mode: AltitudeMode::Absolute,
        ..LinearRing::default()
    };
    let mut polygon = Polygon::new(outer, Vec::new());
    polygon.altitude_mode = AltitudeMode::Absolute;
    polygon.extrude = true;
    Kml::Placemark(Placemark {
        name: Some("Fence".to_owned()),
        style_url: Some("#fence".to_owned()),
        geometry: Some(Geometry::Polygon(polygon)),
        ..Placemark::default()
    })
}

/// The date (xsd:dateTime, as KML asks for it) of a simulated time; a mission longer than a month stays at its end.
fn date(time_s: f64) -> String {
    let ms = (time_s.max(0.0) * 1000.0).round() as u64;
    let (day, ms) = ((ms / 86_400_000).min(30), ms % 86_400_000);
    let (hour, minute, ms) = (ms / 3_600_000, ms / 60_000 % 60, ms % 60_000);
    format!(
        "2000-01-{:02}T{hour:02}:{minute:02}:{:06.3}Z",
        day + 1,
        ms as f64 / 1000.0
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates() {
        assert_eq!(date(0.0), "2000-01-01T00:00:00.000Z");
        assert_eq!(date(90_061.5), "2000-01-02T01:01:01.500Z");
    }

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
