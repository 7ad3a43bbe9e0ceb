//! Readings, tracks and what stands on the map as GeoJSON (RFC 7946): WGS84, longitude first, lines cut at the
//! antimeridian. Altitudes are above mean sea level, as the property `alt_amsl_m` says once more.

use super::{Flown, Read};
use crate::antimeridian::{Corner, areas, pieces};
use crate::contour::PlumeLine;
use crate::kml::MapFeatures;
use crate::text;
use formats::calendar::rfc_3339;
use serde_json::{Map, Value, json};

/// The collection of all features; each has a property `what`.
pub fn collection(flown: &Flown, around: Option<&MapFeatures>, plume: &[PlumeLine]) -> String {
    let mut features: Vec<Value> = (0..flown.vehicles.len())
        .filter_map(|k| track(flown, k))
        .collect();
    features.extend(plume.iter().map(|line| {
        let properties = json!({"what": "plume", "excess_ppm": line.excess_ppm});
        feature(lines(&line.corners), properties)
    }));
    features.extend(
        around
            .into_iter()
            .flat_map(|around| surroundings(flown, around)),
    );
    features.extend(flown.readings.iter().map(|read| reading(flown, read)));
    json!({"type": "FeatureCollection", "features": features}).to_string()
}

fn feature(geometry: Value, properties: Value) -> Value {
    json!({"type": "Feature", "geometry": geometry, "properties": properties})
}

fn point(at: Corner) -> Value {
    json!({"type": "Point", "coordinates": at})
}

fn lines(corners: &[Corner]) -> Value {
    json!({"type": "MultiLineString", "coordinates": pieces(corners)})
}

fn track(flown: &Flown, vehicle: usize) -> Option<Value> {
    let of_vehicle = flown.readings.iter().filter(|r| r.vehicle == vehicle);
    let corners: Vec<Corner> = of_vehicle
        .map(|r| [r.lon_deg, r.lat_deg, r.alt_amsl_m])
        .collect();
    let own = &flown.vehicles[vehicle];
    let properties = json!({
        "what": "track",
        "platform": own.name,
        "vehicle_kind": own.kind.map(text::vehicle_kind),
    });
    (corners.len() > 1).then(|| feature(lines(&corners), properties))
}

fn reading(flown: &Flown, read: &Read) -> Value {
    let mut properties = Map::new();
    let mut say = |name: &str, value: Value| {
        if !value.is_null() {
            properties.insert(name.to_owned(), value);
        }
    };
    say("what", json!("reading"));
    say("platform", json!(flown.vehicles[read.vehicle].name));
    say("time_s", json!(read.time_s));
    let dated = flown.start_unix_ns.is_some();
    say(
        "time_utc",
        json!(dated.then(|| rfc_3339(flown.unix_ns(read.time_s)))),
    );
    say("alt_amsl_m", json!(read.alt_amsl_m));
    say(&format!("{}_ppm", flown.gas.as_str()), json!(read.ppm));
    say("wind_speed_m_s", json!(read.wind_speed_m_s));
    say("wind_from_deg", json!(read.wind_from_deg));
    say("temperature_c", json!(read.temperature_c));
    say("pressure_hpa", json!(read.pressure_hpa));
    feature(
        point([read.lon_deg, read.lat_deg, read.alt_amsl_m]),
        Value::Object(properties),
    )
}

fn surroundings(flown: &Flown, around: &MapFeatures) -> Vec<Value> {
    let ppm = format!("{}_ppm", flown.gas.as_str());
    let peak = around.peak.as_ref().map(|peak| {
        let properties = json!({
            "what": "peak",
            &ppm: peak.co2_ppm,
            "sd_ppm": peak.sd_ppm,
            "status": peak.status.words(),
            "time_s": peak.time_s,
            "alt_amsl_m": peak.alt_amsl_m,
        });
        feature(
            point([peak.lon_deg, peak.lat_deg, peak.alt_amsl_m]),
            properties,
        )
    });
    let stacks = around.stacks.iter().map(|stack| {
        let at = json!({"type": "Point", "coordinates": [stack.lon_deg, stack.lat_deg]});
        feature(
            at,
            json!({"what": "stack", "name": stack.name, "height_agl_m": stack.height_m}),
        )
    });
    let fence = (around.fence.len() >= 3).then(|| fence(around));
    peak.into_iter().chain(stacks).chain(fence).collect()
}

fn fence(around: &MapFeatures) -> Value {
    let corners = around.fence.iter();
    let corners: Vec<Corner> = corners
        .map(|&(lat, lon)| [lon, lat, around.fence_top_amsl_m])
        .collect();
    let closed = areas(&corners).into_iter().map(|mut ring| {
        // Outer rings run anticlockwise.
        if area(&ring) < 0.0 {
            ring.reverse();
        }
        ring.extend(ring.first().copied());
        vec![ring]
    });
    let polygons: Vec<Vec<Vec<Corner>>> = closed.collect();
    let geometry = json!({"type": "MultiPolygon", "coordinates": polygons});
    feature(
        geometry,
        json!({"what": "fence", "top_amsl_m": around.fence_top_amsl_m}),
    )
}

/// Twice the area of a ring, above 0 if it runs anticlockwise.
fn area(ring: &[Corner]) -> f64 {
    let next = ring.iter().cycle().skip(1);
    ring.iter()
        .zip(next)
        .map(|(a, b)| a[0] * b[1] - b[0] * a[1])
        .sum()
}
