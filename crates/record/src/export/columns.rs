//! One row a reading: the table of CSV and Parquet.

use super::{Flown, Read};
use crate::text;
use formats::table::{Cells, Column};
use protocol::message::State;

/// A number of a reading, where it is known.
type NumberOf = fn(&Read) -> Option<f64>;

fn of_state(read: &Read, of: fn(&State) -> f64) -> Option<f64> {
    read.state.as_ref().map(of)
}

/// Columns of what is not always known; those that nothing is known of are left out.
const OPTIONAL: [(&str, NumberOf); 12] = [
    ("wind_speed_m_s", |r| r.wind_speed_m_s),
    ("wind_from_deg", |r| r.wind_from_deg),
    ("temperature_c", |r| r.temperature_c),
    ("pressure_hpa", |r| r.pressure_hpa),
    ("vel_north_m_s", |r| of_state(r, |s| s.vel_ned_m_s[0])),
    ("vel_east_m_s", |r| of_state(r, |s| s.vel_ned_m_s[1])),
    ("vel_down_m_s", |r| of_state(r, |s| s.vel_ned_m_s[2])),
    ("roll_deg", |r| of_state(r, |s| s.roll_deg)),
    ("pitch_deg", |r| of_state(r, |s| s.pitch_deg)),
    ("heading_deg", |r| of_state(r, |s| s.heading_deg)),
    ("airspeed_m_s", |r| of_state(r, |s| s.airspeed_m_s)),
    ("throttle", |r| of_state(r, |s| s.throttle)),
];

/// The columns: those of observations, so that `gap plume`, `calibrate` and `feed` read them, and more.
pub fn columns(flown: &Flown) -> Vec<Column> {
    let readings = &flown.readings;
    let numbers = |of: NumberOf| Cells::Number(readings.iter().map(of).collect());
    let of_vehicle = |of: &dyn Fn(usize) -> String| {
        Cells::Text(readings.iter().map(|r| of(r.vehicle)).collect())
    };
    let mut columns = vec![
        Column::new("time_s", numbers(|r| Some(r.time_s))),
        Column::new("platform", of_vehicle(&|k| flown.vehicles[k].name.clone())),
        Column::new("lat_deg", numbers(|r| Some(r.lat_deg))),
        Column::new("lon_deg", numbers(|r| Some(r.lon_deg))),
        Column::new("alt_amsl_m", numbers(|r| Some(r.alt_amsl_m))),
        Column::new(format!("{}_ppm", flown.gas.as_str()), numbers(|r| r.ppm)),
    ];
    for (name, of) in OPTIONAL {
        if readings.iter().any(|r| of(r).is_some()) {
            columns.push(Column::new(name, numbers(of)));
        }
    }
    if flown.vehicles.iter().any(|v| v.kind.is_some()) {
        let kind = |k: usize| {
            flown.vehicles[k]
                .kind
                .map_or("", text::vehicle_kind)
                .to_owned()
        };
        columns.push(Column::new("vehicle_kind", of_vehicle(&kind)));
    }
    if flown.start_unix_ns.is_some() {
        let times = readings.iter().map(|r| flown.unix_ns(r.time_s));
        columns.push(Column::new("time_utc", Cells::Time(times.collect())));
    }
    columns
}
