//! A made-up mission for tests: six vehicles weaving across a made-up plume, with every kind of
//! message that the files and views use. Its numbers claim nothing.
#![allow(dead_code, missing_docs, clippy::unwrap_used)]

use air::geo::{Enu, LocalFrame};
use protocol::key::Name;
use protocol::message::*;
use protocol::{AgentId, Envelope, Message, SimTime, Topic};

pub const TICK_NS: i64 = 100_000_000;
pub const REAL: &str = "6";

pub fn frame() -> LocalFrame {
    LocalFrame::new(43.4417, -7.8631, 340.0).unwrap()
}

/// The scenario that the team of this mission starts from, with a background of `background_ppm`.
pub fn scenario(background_ppm: f64) -> scenario::Scenario {
    let text = format!(
        "[site]\nlat_deg = 43.4417\nlon_deg = -7.8631\nground_amsl_m = 340.0\n\
         [weather]\nwind_from_deg = 310.0\nwind_speed_m_s = 7.0\n\
         [background]\nco2_ppm = {background_ppm}\n\
         [[source]]\nlat_deg = 43.4417\nlon_deg = -7.8631\neffective_height_m = 450.0\nc_max_ppm = 330.0\n\
         c_max_distance_m = 2400.0\n"
    );
    scenario::Scenario::parse("synthetic.toml", &text).unwrap()
}

pub fn estimate(value: f64, sd: f64) -> Estimate {
    Estimate { value, sd }
}

/// A model with its axis towards `axis_deg` and its height `height_m`.
pub fn model(axis_deg: f64, height_m: f64, c_max_ppm: f64, observations: u64) -> Model {
    let known = 1.0 / (1.0 + observations as f64 / 200.0);
    Model {
        background_ppm: estimate(449.0, 2.0 * known),
        effective_height_agl_m: estimate(height_m, 30.0 * known),
        axis_deg: estimate(axis_deg, 10.0 * known),
        c_max_ppm: estimate(c_max_ppm, 80.0 * known),
        c_max_distance_m: estimate(2400.0, 0.0),
        sigma_y_scale: estimate(1.0 + 0.2 * (1.0 - known), 0.3 * known),
        sigma_z_scale: estimate(1.0 - 0.1 * (1.0 - known), 0.3 * known),
        wind_speed_m_s: 7.0,
        observations,
        mechanisms: Vec::new(),
        peak: None,
        flux: Vec::new(),
    }
}

/// Concentration in ppm of `model` at a place of [`frame`].
pub fn field(model: &Model, at: Enu, alt_amsl_m: f64) -> f64 {
    let (sin, cos) = model.axis_deg.value.to_radians().sin_cos();
    let along = at.east_m * sin + at.north_m * cos;
    let across = at.east_m * cos - at.north_m * sin;
    if along < 50.0 {
        return model.background_ppm.value;
    }
    let sigma_y = 0.08 * along / (1.0 + 1e-4 * along).sqrt() * model.sigma_y_scale.value;
    let sigma_z = 0.06 * along / (1.0 + 1.5e-3 * along).sqrt() * model.sigma_z_scale.value;
    let above = alt_amsl_m - 340.0 - model.effective_height_agl_m.value;
    let on_axis = model.c_max_ppm.value * (2400.0 / along).powf(1.5);
    model.background_ppm.value
        + on_axis * (-0.5 * (across / sigma_y).powi(2) - 0.5 * (above / sigma_z).powi(2)).exp()
}

/// All that is said in tick `n`, in the order in which it is handled.
pub fn tick(n: u64) -> Vec<(Topic, Envelope)> {
    let time = SimTime::of_tick(n, TICK_NS);
    let t = time.s();
    let mut said: Vec<(Topic, Message)> = Vec::new();
    let reality = model(118.0, 486.0, 410.0, 0);
    let share = (t / 600.0).min(1.0);
    let now = Model {
        peak: peak(t),
        ..model(
            130.0 - 12.0 * share,
            450.0 + 35.0 * share,
            330.0 + 78.0 * share,
            n,
        )
    };
    if n.is_multiple_of(10) {
        said.push((Topic::Plan, Message::Plan(plan(t))));
    }
    if n.is_multiple_of(50) {
        said.push((Topic::Population, Message::Population(population(n))));
    }
    let real = vehicle(6, t, &reality);
    said.push((
        Topic::Observation,
        Message::Observation(Observation {
            vehicle: REAL.to_owned(),
            time_ns: time.ns(),
            reading: real.1,
        }),
    ));
    for k in 1..=6u32 {
        let name = Name::new(&k.to_string()).unwrap();
        let world = if k == 6 { &reality } else { &now };
        let (state, reading) = vehicle(k, t, world);
        said.push((Topic::State(name.clone()), Message::State(state)));
        said.push((Topic::Reading(name.clone()), Message::Reading(reading)));
        if n.is_multiple_of(100) {
            said.push((Topic::Mode(name), Message::Mode(mode(k, t))));
        }
    }
    if n.is_multiple_of(10) {
        said.push((Topic::Model, Message::Model(Box::new(now))));
    }
    let mut said: Vec<(Topic, Envelope)> = said
        .into_iter()
        .enumerate()
        .map(|(i, (topic, message))| {
            let sender = topic.writer();
            let sequence = n * 100 + i as u64 + 1;
            (
                topic,
                Envelope {
                    sender,
                    sequence,
                    time,
                    message,
                },
            )
        })
        .collect();
    said.sort_by(|a, b| a.1.order().cmp(&b.1.order()));
    said
}

fn mode(k: u32, t: f64) -> Mode {
    let pilot = k == 6 && (200.0..240.0).contains(&t);
    Mode {
        level: if pilot {
            ControlLevel::Pilot
        } else {
            ControlLevel::Automatic
        },
        reason: if pilot {
            "the pilot took over".to_owned()
        } else {
            "in the team".to_owned()
        },
        setpoints_obeyed: !pilot,
    }
}

fn vehicle(k: u32, t: f64, world: &Model) -> (State, Reading) {
    let phase = f64::from(k) * 1.047;
    let along = 1300.0 + 1100.0 * (0.5 - 0.5 * (t / 170.0 + phase).cos());
    let across = 520.0 * (t / 31.0 + 2.0 * phase).sin() * (1.0 - 0.6 * (t / 900.0).min(1.0));
    let climb = 70.0 * (t / 83.0 + phase).sin();
    let (sin, cos) = 120.0_f64.to_radians().sin_cos();
    let at = Enu {
        east_m: along * sin + across * cos,
        north_m: along * cos - across * sin,
    };
    let speed_across = 520.0 / 31.0 * (t / 31.0 + 2.0 * phase).cos();
    let vel = [-speed_across * sin, speed_across * cos, 0.0];
    let place = frame().to_geodetic(at);
    let alt_amsl_m = 826.0 + climb;
    let kind = if k == 6 {
        VehicleKind::Real
    } else {
        VehicleKind::Simulated
    };
    // A made-up noise of 3 ppm that is the same in every run.
    let noise = 3.0 * (t * 977.0 + phase).sin() * (t * 131.0).cos();
    let state = State {
        kind,
        lat_deg: place.lat_deg,
        lon_deg: place.lon_deg,
        alt_amsl_m,
        vel_ned_m_s: vel,
        roll_deg: 10.0,
        pitch_deg: 2.0,
        heading_deg: air::geo::wrap_deg(vel[1].atan2(vel[0]).to_degrees()),
        airspeed_m_s: 18.0 + (t / 7.0 + phase).sin(),
        throttle: 0.3,
        airborne: true,
    };
    let reading = Reading {
        kind,
        lat_deg: place.lat_deg,
        lon_deg: place.lon_deg,
        alt_amsl_m,
        co2_ppm: field(world, at, alt_amsl_m) + noise,
        wind_speed_m_s: (k == 6).then_some(7.1),
        wind_from_deg: (k == 6).then_some(297.0),
        temperature_c: Some(11.0),
        pressure_hpa: Some(918.0),
        time_ns: None,
    };
    (state, reading)
}

fn plan(t: f64) -> Plan {
    let at = frame().to_geodetic(Enu::default().displaced(118.0, 1220.0));
    let phase = match t {
        t if t < 60.0 => Phase::TakeOff,
        t if t < 180.0 => Phase::Preliminary,
        t if t < 480.0 => Phase::Search,
        t if t < 560.0 => Phase::Characterise,
        _ => Phase::Home,
    };
    Plan {
        phase,
        assignments: (1..=6)
            .map(|k| Assignment {
                vehicle: k.to_string(),
                lat_deg: at.lat_deg,
                lon_deg: at.lon_deg,
                alt_amsl_m: 826.0,
                purpose: "promising point".to_owned(),
            })
            .collect(),
        peak: peak(t),
    }
}

fn peak(t: f64) -> Option<Peak> {
    let at = frame().to_geodetic(Enu::default().displaced(118.0, 1220.0));
    (t > 100.0).then_some(Peak {
        lat_deg: at.lat_deg,
        lon_deg: at.lon_deg,
        alt_amsl_m: 826.0,
        co2_ppm: 1020.0,
        sd_ppm: 14.0,
        time_s: t,
        status: PeakStatus::Confirmed,
    })
}

fn population(n: u64) -> Population {
    let points = (0..40)
        .map(|i| {
            let spread = 30.0 / (1.0 + n as f64 / 2000.0);
            let bearing = 118.0 + spread * (f64::from(i) * 2.4).sin();
            let at = Enu::default().displaced(bearing, 1200.0 + 28.0 * f64::from(i));
            let place = frame().to_geodetic(at);
            PromisingPoint {
                lat_deg: place.lat_deg,
                lon_deg: place.lon_deg,
                alt_amsl_m: 826.0,
                fitness_ppm: 480.0 + 9.0 * f64::from(i),
            }
        })
        .collect();
    Population {
        generation: n / 50,
        points,
    }
}

/// The mission's first `ticks` ticks.
pub fn mission(ticks: u64) -> impl Iterator<Item = (Topic, Envelope)> {
    (0..ticks).flat_map(tick)
}

/// An event of the squadron controller.
pub fn event(n: u64, text: &str) -> (Topic, Envelope) {
    let envelope = Envelope {
        sender: AgentId::sc(),
        sequence: n * 100 + 99,
        time: SimTime::of_tick(n, TICK_NS),
        message: Message::event(Severity::Info, "note", text),
    };
    (Topic::Event(AgentId::sc()), envelope)
}
