//! Tracks: GPX, and KML's `gx:Track`.

use super::{Collected, Known, SeriesLog};
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

fn broken(name: &str, position: u64, what: impl std::fmt::Display) -> ImportError {
    ImportError::log(
        format!("{name}: byte {position}"),
        format!("not valid XML: {what}"),
        "give the file as it was exported",
    )
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
    let mut reader = Reader::from_reader(BufReader::new(bytes));
    let mut series = Collected::default();
    let (mut buffer, mut text) = (Vec::new(), String::new());
    let mut point: Option<Point> = None;
    let (mut points, mut timeless) = (0_usize, 0_usize);
    loop {
        buffer.clear();
        let event = reader.read_event_into(&mut buffer);
        let event = event.map_err(|e| broken(name, reader.error_position(), e))?;
        match event {
            Event::Eof => break,
            Event::Start(tag) => {
                text.clear();
                if tag.local_name().as_ref() == b"trkpt" {
                    point = Some(begun(&tag));
                }
            }
            Event::Text(t) => text += &t.decode().unwrap_or_default(),
            Event::End(tag) => {
                let local = tag.local_name();
                let local = String::from_utf8_lossy(local.as_ref()).into_owned();
                match (local.as_str(), &mut point) {
                    ("trkpt", done) => {
                        points += 1;
                        timeless +=
                            usize::from(!done.take().is_some_and(|p| take(&mut series, &p)));
                    }
                    ("time", Some(point)) => point.time_s = utc_s(text.trim()),
                    (_, Some(point)) => {
                        if let Ok(value) = text.trim().parse() {
                            point.more.push((local, value));
                        }
                    }
                    (_, None) => {}
                }
                text.clear();
            }
            _ => {}
        }
    }
    let said = vec![
        format!("{} points of a GPX track", points - timeless),
        "assumed: <ele> is above mean sea level, as GPX 1.1 has it; some receivers write heights above the ellipsoid \
         (then state datum = \"ellipsoid\")"
            .to_owned(),
    ];
    finish(name, "a GPX track", series, points, timeless, said)
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
    mut said: Vec<String>,
) -> Result<SeriesLog, ImportError> {
    if points == timeless {
        return Err(ImportError::log(
            name,
            format!("{kind} without times ({points} points)"),
            "export it with times; without them readings cannot be placed along the track",
        ));
    }
    if timeless > 0 {
        said.push(format!(
            "{timeless} of {points} points have no time and are skipped"
        ));
    }
    Ok(SeriesLog {
        kind,
        series: series.finish(0.0),
        is_absolute: true,
        said,
    })
}

/// The series of a KML file's `gx:Track`s.
///
/// # Errors
/// No XML, or nothing with times: a `LineString` has none.
pub fn kml(name: &str, bytes: Box<dyn Read + '_>) -> Result<SeriesLog, ImportError> {
    let mut reader = Reader::from_reader(BufReader::new(bytes));
    let mut series = Collected::default();
    let (mut buffer, mut text) = (Vec::new(), String::new());
    let (mut times, mut places): (Vec<Option<f64>>, Vec<[f64; 3]>) = (Vec::new(), Vec::new());
    let (mut mode, mut lines, mut points, mut timeless) =
        (String::new(), 0_usize, 0_usize, 0_usize);
    loop {
        buffer.clear();
        let event = reader.read_event_into(&mut buffer);
        let event = event.map_err(|e| broken(name, reader.error_position(), e))?;
        match event {
            Event::Eof => break,
            Event::Start(_) => text.clear(),
            Event::Text(t) => text += &t.decode().unwrap_or_default(),
            Event::End(tag) => {
                match tag.local_name().as_ref() {
                    b"when" => times.push(utc_s(text.trim())),
                    b"coord" => places.push(coord(&text)),
                    b"altitudeMode" => text.trim().clone_into(&mut mode),
                    b"LineString" => lines += 1,
                    b"Track" => {
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
                }
                text.clear();
            }
            _ => {}
        }
    }
    if points == 0 && lines > 0 {
        return Err(ImportError::log(
            name,
            format!("{lines} lines (LineString) and no track with times (gx:Track)"),
            "export the track with times, as gx:Track or GPX; without them readings cannot be placed along it",
        ));
    }
    let said = vec![format!("{} points of a KML track", points - timeless)];
    finish(name, "a KML track", series, points, timeless, said)
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
