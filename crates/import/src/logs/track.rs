//! Tracks: GPX, and KML's `gx:Track`.

use super::series_log::{Collected, Known, SeriesLog};
use crate::ImportError;
use crate::time;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use std::io::{BufReader, Read};

/// What the series of tracks are.
pub const KNOWN: &[Known] = &[
    ("lat_deg", "lat", "deg"),
    ("lon_deg", "lon", "deg"),
    ("alt_amsl_m", "ele coord_alt", "m"),
    ("temperature_c", "atemp", "C"),
];

/// A point of a GPX track.
#[derive(Debug, Default)]
struct Point {
    lat_deg: f64,
    lon_deg: f64,
    time_s: Option<f64>,
    more: Vec<(String, f64)>,
}

/// A tag of XML.
enum Tag<'t> {
    /// An opening one.
    Begin(&'t BytesStart<'t>),
    /// The local name of a closing one, and the text before it.
    End(&'t str, &'t str),
}

/// Hands all tags of an XML file to `take`.
fn each_tag(
    name: &str,
    bytes: Box<dyn Read + '_>,
    mut take: impl FnMut(Tag<'_>),
) -> Result<(), ImportError> {
    let mut reader = Reader::from_reader(BufReader::new(bytes));
    let (mut buffer, mut text) = (Vec::new(), String::new());
    loop {
        buffer.clear();
        let event = reader.read_event_into(&mut buffer).map_err(|e| {
            ImportError::log(
                format!("{name}: byte {}", reader.error_position()),
                format!("not valid XML: {e}"),
                "give the file as it was exported",
            )
        })?;
        match event {
            Event::Eof => return Ok(()),
            Event::Start(tag) => {
                text.clear();
                take(Tag::Begin(&tag));
            }
            Event::Text(t) => text += &t.decode().unwrap_or_default(),
            Event::End(tag) => {
                let local = tag.local_name();
                take(Tag::End(
                    &String::from_utf8_lossy(local.as_ref()),
                    text.trim(),
                ));
                text.clear();
            }
            _ => {}
        }
    }
}

/// An attribute's number.
fn number(tag: &BytesStart<'_>, name: &str) -> Option<f64> {
    let attribute = tag.try_get_attribute(name).ok()??;
    std::str::from_utf8(&attribute.value)
        .ok()?
        .trim()
        .parse()
        .ok()
}

fn utc_s(text: &str) -> Option<f64> {
    let stamp = time::stamp(text.as_bytes(), None)?;
    Some(stamp.clock_s - stamp.ahead_s.unwrap_or(0.0))
}

/// The series of a GPX file's track points.
///
/// # Errors
/// No XML, or no points with times.
pub fn gpx(name: &str, bytes: Box<dyn Read + '_>) -> Result<SeriesLog, ImportError> {
    let mut series = Collected::default();
    let mut point: Option<Point> = None;
    let (mut points, mut timeless) = (0_usize, 0_usize);
    each_tag(name, bytes, |tag| match tag {
        Tag::Begin(tag) if tag.local_name().as_ref() == b"trkpt" => point = Some(begun(tag)),
        Tag::Begin(_) => {}
        Tag::End("trkpt", _) => {
            points += 1;
            let is_timed = point.take().is_some_and(|p| take(&mut series, &p));
            timeless += usize::from(!is_timed);
        }
        Tag::End(local, text) => match (local, &mut point) {
            ("time", Some(point)) => point.time_s = utc_s(text),
            (_, Some(point)) => {
                let value = text.parse().ok();
                point.more.extend(value.map(|v| (local.to_owned(), v)));
            }
            (_, None) => {}
        },
    })?;
    let notices = vec![
        format!("{} points of a GPX track", points - timeless),
        "assumed: <ele> is above mean sea level, as GPX 1.1 has it; some receivers write heights above the ellipsoid \
         (then state datum = \"ellipsoid\")"
            .to_owned(),
    ];
    finish(name, "a GPX track", series, points, timeless, notices)
}

fn begun(tag: &BytesStart<'_>) -> Point {
    Point {
        lat_deg: number(tag, "lat").unwrap_or(f64::NAN),
        lon_deg: number(tag, "lon").unwrap_or(f64::NAN),
        ..Point::default()
    }
}

/// Takes a point in; false without a time.
fn take(series: &mut Collected, point: &Point) -> bool {
    let Some(time_s) = point.time_s else {
        return false;
    };
    series.push("lat", time_s, point.lat_deg);
    series.push("lon", time_s, point.lon_deg);
    for (name, value) in &point.more {
        series.push(name, time_s, *value);
    }
    true
}

fn finish(
    name: &str,
    kind: &'static str,
    series: Collected,
    points: usize,
    timeless: usize,
    mut notices: Vec<String>,
) -> Result<SeriesLog, ImportError> {
    if points == timeless {
        return Err(ImportError::log(
            name,
            format!("{kind} without times ({points} points)"),
            "export it with times; without them readings cannot be placed along the track",
        ));
    }
    if timeless > 0 {
        notices.push(format!(
            "{timeless} of {points} points have no time and are skipped"
        ));
    }
    Ok(SeriesLog {
        kind,
        series: series.finish(0.0),
        is_absolute: true,
        notices,
        ..SeriesLog::default()
    })
}

/// The series of a KML file's `gx:Track`s.
///
/// # Errors
/// No XML, or nothing with times: a `LineString` has none.
pub fn kml(name: &str, bytes: Box<dyn Read + '_>) -> Result<SeriesLog, ImportError> {
    let mut series = Collected::default();
    let (mut times, mut places): (Vec<Option<f64>>, Vec<[f64; 3]>) = (Vec::new(), Vec::new());
    let (mut mode, mut lines, mut points, mut timeless) =
        (String::new(), 0_usize, 0_usize, 0_usize);
    each_tag(name, bytes, |tag| match tag {
        Tag::End("when", text) => times.push(utc_s(text)),
        Tag::End("coord", text) => places.push(coord(text)),
        Tag::End("altitudeMode", text) => text.clone_into(&mut mode),
        Tag::End("LineString", _) => lines += 1,
        Tag::End("Track", _) => {
            points += places.len();
            timeless += places.len() - times.iter().flatten().count().min(places.len());
            for (time_s, [lon, lat, alt]) in times.drain(..).zip(places.drain(..)) {
                let Some(time_s) = time_s else { continue };
                series.push("lat", time_s, lat);
                series.push("lon", time_s, lon);
                series.push(alt_name(&mode), time_s, alt);
            }
        }
        _ => {}
    })?;
    if points == 0 && lines > 0 {
        return Err(ImportError::log(
            name,
            format!("{lines} lines (LineString) and no track with times (gx:Track)"),
            "export the track with times, as gx:Track or GPX; without them readings cannot be placed along it",
        ));
    }
    let notices = vec![format!("{} points of a KML track", points - timeless)];
    finish(name, "a KML track", series, points, timeless, notices)
}

/// The series of heights of this altitude mode.
fn alt_name(mode: &str) -> &'static str {
    match mode {
        "absolute" => "coord_alt",
        // Heights that are drawn on the ground whatever they say are none.
        "relativeToGround" => "height_above_ground",
        _ => "not_a_height",
    }
}

fn coord(text: &str) -> [f64; 3] {
    let mut numbers = text.split([' ', ',']).filter_map(|n| n.trim().parse().ok());
    let mut next = || numbers.next().unwrap_or(f64::NAN);
    [next(), next(), next()]
}
