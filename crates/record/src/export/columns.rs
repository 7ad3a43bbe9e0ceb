//! One row a reading: the table of CSV and Parquet. Also one row a state of a vehicle, and one a model.

use super::{Flown, Read};
use crate::summary::ModelNumbers;
use crate::text;
use formats::table::{Cells, Column};
use protocol::message::{Estimate, Model, Peak, State};

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

/// A number of something, by the name of its column.
type Named<T, N> = (&'static str, fn(&T) -> N);

/// Numbers of a state.
const OF_STATE: [Named<State, f64>; 11] = [
    ("lat_deg", |s| s.lat_deg),
    ("lon_deg", |s| s.lon_deg),
    ("alt_amsl_m", |s| s.alt_amsl_m),
    ("vel_north_m_s", |s| s.vel_ned_m_s[0]),
    ("vel_east_m_s", |s| s.vel_ned_m_s[1]),
    ("vel_down_m_s", |s| s.vel_ned_m_s[2]),
    ("roll_deg", |s| s.roll_deg),
    ("pitch_deg", |s| s.pitch_deg),
    ("heading_deg", |s| s.heading_deg),
    ("airspeed_m_s", |s| s.airspeed_m_s),
    ("throttle", |s| s.throttle),
];

/// How the vehicles moved, one row a state.
pub fn of_motions(flown: &Flown) -> Vec<Column> {
    let motions = &flown.motions;
    let names = motions
        .iter()
        .map(|m| flown.vehicles[m.vehicle].name.clone());
    let times = motions.iter().map(|m| Some(m.time_s));
    let mut columns = vec![
        Column::new("time_s", Cells::Number(times.collect())),
        Column::new("platform", Cells::Text(names.collect())),
    ];
    for (name, of) in OF_STATE {
        let cells = motions.iter().map(|m| Some(of(&m.state)));
        columns.push(Column::new(name, Cells::Number(cells.collect())));
    }
    let airborne = motions.iter().map(|m| i64::from(m.state.airborne));
    columns.push(Column::new("airborne", Cells::Whole(airborne.collect())));
    columns
}

/// Numbers of a model, each with its standard deviation in a column of its own, `…_sd`.
const OF_MODEL: [Named<ModelNumbers, Estimate>; 7] = [
    ("background_ppm", |m| m.background_ppm),
    ("effective_height_agl_m", |m| m.effective_height_agl_m),
    ("axis_deg", |m| m.axis_deg),
    ("c_max_ppm", |m| m.c_max_ppm),
    ("c_max_distance_m", |m| m.c_max_distance_m),
    ("sigma_y_scale", |m| m.sigma_y_scale),
    ("sigma_z_scale", |m| m.sigma_z_scale),
];

/// Numbers of a peak, where there is one.
const OF_PEAK: [Named<Peak, f64>; 5] = [
    ("peak_ppm", |p| p.co2_ppm),
    ("peak_ppm_sd", |p| p.sd_ppm),
    ("peak_lat_deg", |p| p.lat_deg),
    ("peak_lon_deg", |p| p.lon_deg),
    ("peak_alt_amsl_m", |p| p.alt_amsl_m),
];

/// What was known of the plume, one row a model.
pub fn of_models(flown: &Flown) -> Vec<Column> {
    let models = &flown.models;
    let numbers = |of: &dyn Fn(&Model) -> Option<f64>| {
        Cells::Number(models.iter().map(|(_, model)| of(model)).collect())
    };
    let times = models.iter().map(|(time_s, _)| Some(*time_s));
    let mut columns = vec![Column::new("time_s", Cells::Number(times.collect()))];
    for (name, of) in OF_MODEL {
        let value = numbers(&|model| Some(of(&model.into()).value));
        let sd = numbers(&|model| Some(of(&model.into()).sd));
        columns.push(Column::new(name, value));
        columns.push(Column::new(format!("{name}_sd"), sd));
    }
    columns.push(Column::new(
        "wind_speed_m_s",
        numbers(&|m| Some(m.wind_speed_m_s)),
    ));
    let readings = models.iter().map(|(_, model)| model.observations as i64);
    columns.push(Column::new("readings", Cells::Whole(readings.collect())));
    for (name, of) in OF_PEAK {
        columns.push(Column::new(
            name,
            numbers(&|model| model.peak.as_ref().map(of)),
        ));
    }
    let status = |model: &Model| model.peak.map_or("", |peak| peak.status.words());
    let status = models.iter().map(|(_, model)| status(model).to_owned());
    columns.push(Column::new("peak_status", Cells::Text(status.collect())));
    columns
}
