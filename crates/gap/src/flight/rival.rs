//! Rivals without a name: smooth disturbances that describe a misfit along time, airspeed or
//! angle of attack without saying what causes it. They compete with the mechanisms.

use std::f64::consts::PI;
use std::sync::Arc;

use fdm::Aircraft;

use super::channel::{ALL, CHANNELS, at};
use super::gate::{Gated, Segment};

/// Along what a misfit lives: its name in `gap.json`, and the number of columns.
const COORDINATES: [(&str, usize); 3] = [("time", 4), ("airspeed", 2), ("angle_of_attack", 3)];
/// Places of these.
const TIME: usize = 0;
const AIRSPEED: usize = 1;
const ANGLE_OF_ATTACK: usize = 2;
/// Prior standard deviation of a force without a name, m/s².
const PUSH_M_S2: [f64; 3] = [0.3, 0.3, 0.8];
/// The same of an angular acceleration: what so much of the surface makes of it at cruise.
const SPIN_DEG: f64 = 2.0;
/// The same of a reading, in usual noises.
const READING_NOISES: f64 = 3.0;
/// Part of a surface's effect that comes and goes with time.
const SURFACE_PART: f64 = 0.25;
/// Standard deviations of a coordinate beyond which a term stays as it is.
const FARTHEST_SD: f64 = 3.0;

/// What a smooth term acts on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// Angular acceleration about an axis.
    Spin(usize),
    /// Angular acceleration in proportion to the surface that turns about this axis.
    Surface(usize),
    /// Specific force along an axis.
    Push(usize),
    /// What a sensor reads.
    Sensor(usize),
}

impl Target {
    /// In words.
    pub fn words(self) -> String {
        let axis = |k: usize| ["roll", "pitch", "yaw"][k];
        match self {
            Self::Spin(k) => format!("{} acceleration", axis(k)),
            Self::Surface(k) => format!("{} acceleration by its surface", axis(k)),
            Self::Push(k) => ALL[at::FORCE + k].label.to_owned(),
            Self::Sensor(k) => format!("reading of {}", ALL[k].label),
        }
    }
}

/// A group of columns that stand for one nameless cause.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Along what it varies.
    along: usize,
    /// What it acts on.
    target: Target,
    /// Number of columns.
    pub columns: usize,
    /// Size of one standard deviation of its prior, SI.
    scale: f64,
}

impl Group {
    fn new(along: usize, target: Target, scale: f64) -> Self {
        Self {
            along,
            target,
            columns: COORDINATES[along].1,
            scale,
        }
    }

    /// Along what it varies, as in `gap.json`.
    pub fn coordinate(&self) -> &'static str {
        COORDINATES[self.along].0
    }

    /// The term in words.
    pub fn words(&self) -> String {
        let along = self.coordinate().replace('_', " ");
        format!("{}, smooth in {along}", self.target.words())
    }
}

/// What an aircraft meets at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Meeting {
    /// Time (s), airspeed (m/s) and angle of attack (rad).
    pub along: [f64; 3],
    /// Aileron, elevator, rudder: the surface that turns about each axis, rad.
    pub angles: [f64; 3],
    /// Dynamic pressure, Pa.
    pub pressure: f64,
}

/// All groups of a study, and what their columns are made from.
#[derive(Debug, Clone)]
pub struct Terms {
    /// The groups.
    pub groups: Vec<Group>,
    /// First value and length of time, mean and standard deviation of the others.
    ranges: [(f64, f64); 3],
    /// Angular acceleration by one radian of each surface and unit dynamic pressure.
    power: [f64; 3],
    /// Columns along airspeed where the published numbers hold.
    at_cruise: [f64; 4],
}

impl Terms {
    /// Every group for these data.
    pub fn of(aircraft: &Aircraft, gated: &Gated) -> Self {
        let ranges = ranges(&gated.segments);
        let cruise = aircraft.limits.airspeed_cruise_m_s;
        Self {
            groups: groups(aircraft, gated, &ranges),
            power: surface_power(aircraft, 0.0),
            at_cruise: basis(AIRSPEED, ranges[AIRSPEED], cruise),
            ranges,
        }
    }

    /// Number of columns.
    pub fn count(&self) -> usize {
        self.groups.iter().map(|g| g.columns).sum()
    }

    /// What one standard deviation of each column is at an instant, SI, with what it acts on.
    pub fn at(&self, met: Meeting) -> impl Iterator<Item = (Target, f64)> {
        let bases: [_; 3] = std::array::from_fn(|c| basis(c, self.ranges[c], met.along[c]));
        self.groups.iter().flat_map(move |group| {
            let (mut basis, mut power) = (bases[group.along], 1.0);
            if let Target::Surface(k) = group.target {
                power = self.power[k] * met.pressure * met.angles[k];
                if group.along == AIRSPEED {
                    // A surface turns the aircraft as published at cruise.
                    basis = std::array::from_fn(|k| basis[k] - self.at_cruise[k]);
                }
            }
            (0..group.columns).map(move |k| (group.target, basis[k] * group.scale * power))
        })
    }
}

/// Nameless terms at work, in standard deviations of their priors.
#[derive(Debug, Clone)]
pub struct Nameless {
    terms: Arc<Terms>,
    values: Vec<f64>,
}

impl Nameless {
    /// The terms with these values; none where all are nil.
    pub fn new(terms: &Arc<Terms>, values: &[f64]) -> Option<Self> {
        values.iter().any(|v| *v != 0.0).then(|| Self {
            terms: terms.clone(),
            values: values.to_vec(),
        })
    }

    fn each(&self, met: &Meeting) -> impl Iterator<Item = (Target, f64)> {
        let terms = self.terms.at(*met).zip(&self.values);
        let at_work = terms.filter(|(_, v)| **v != 0.0);
        at_work.map(|((target, one), v)| (target, one * v))
    }

    /// Adds angular acceleration (rad/s²) and specific force (m/s²).
    pub fn disturb(&self, met: &Meeting, spin: &mut [f64; 3], push: &mut [f64; 3]) {
        for (target, value) in self.each(met) {
            match target {
                Target::Spin(k) | Target::Surface(k) => spin[k] += value,
                Target::Push(k) => push[k] += value,
                Target::Sensor(_) => {}
            }
        }
    }

    /// Adds what is wrong in what sensors read.
    pub fn misread(&self, met: &Meeting, read: &mut [f64; CHANNELS]) {
        for (target, value) in self.each(met) {
            if let Target::Sensor(c) = target {
                read[c] += value;
            }
        }
    }
}

/// Every group for these data.
fn groups(aircraft: &Aircraft, gated: &Gated, ranges: &[(f64, f64); 3]) -> Vec<Group> {
    let pressure = 0.5 * 1.225 * aircraft.limits.airspeed_cruise_m_s.powi(2);
    // A rudder of little effect is no measure of what turns an aircraft.
    let spin = surface_power(aircraft, 0.3 * aircraft.yaw.beta)
        .map(|p| p.abs() * pressure * SPIN_DEG.to_radians());
    let mut all = Vec::new();
    for along in [TIME, AIRSPEED, ANGLE_OF_ATTACK] {
        // Along airspeed half of the effect is lost at twice the dynamic pressure.
        let (mean, sd) = ranges[AIRSPEED];
        let surface_part = if along == AIRSPEED {
            sd / mean
        } else {
            SURFACE_PART
        };
        for k in 0..3 {
            all.push(Group::new(along, Target::Spin(k), spin[k]));
            all.push(Group::new(along, Target::Push(k), PUSH_M_S2[k]));
            if along != ANGLE_OF_ATTACK && (k < 2 || gated.has_rudder) {
                all.push(Group::new(along, Target::Surface(k), surface_part));
            }
        }
    }
    let told = |k: &usize| gated.present[*k] && *k != at::BETA && *k != at::ROLL + 2;
    let sensor = |k: usize| {
        Group::new(
            TIME,
            Target::Sensor(k),
            READING_NOISES * ALL[k].usual_noise * ALL[k].si,
        )
    };
    all.extend((0..at::VELOCITY).filter(told).map(sensor));
    all
}

/// Angular acceleration by one radian of each surface and unit dynamic pressure, with a derivative of the rudder of at
/// least `yaw`.
fn surface_power(a: &Aircraft, yaw: f64) -> [f64; 3] {
    let rudder = if yaw > a.yaw.rudder.abs() {
        yaw
    } else {
        a.yaw.rudder
    };
    let turn = |length_m, derivative, inertia| a.wing.area_m2 * length_m * derivative / inertia;
    [
        turn(a.wing.span_m, a.roll.aileron, a.body.ixx_kg_m2),
        turn(a.wing.chord_m, a.pitch.elevator, a.body.iyy_kg_m2),
        turn(a.wing.span_m, rudder, a.body.izz_kg_m2),
    ]
}

/// Where the coordinates of all segments lie: what the smooth terms are scaled by.
fn ranges(segments: &[Segment]) -> [(f64, f64); 3] {
    let times = || segments.iter().flat_map(|s| s.time_s.iter().copied());
    let first = times().fold(f64::MAX, f64::min);
    let last = times().fold(f64::MIN, f64::max);
    let spread = |k: usize, usual: (f64, f64)| {
        let readings = segments
            .iter()
            .flat_map(|s| s.measured.iter().map(|m| m[k]));
        let known: Vec<f64> = readings.filter(|v| v.is_finite()).collect();
        if known.len() < 10 {
            return usual;
        }
        let n = known.len() as f64;
        let mean = known.iter().sum::<f64>() / n;
        let sd = (known.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
        (mean, sd.max(1e-3))
    };
    [
        (first, last - first),
        spread(at::AIRSPEED, (18.0, 1.0)),
        spread(at::ALPHA, (0.05, 0.03)),
    ]
}

/// The columns of a coordinate at one of its values: waves of time, Hermite polynomials of the others.
fn basis(along: usize, (from, scale): (f64, f64), value: f64) -> [f64; 4] {
    let x = (value - from) / scale;
    if along == TIME {
        return std::array::from_fn(|k| (PI * x * (k + 1) as f64).cos());
    }
    let x = x.clamp(-FARTHEST_SD, FARTHEST_SD);
    [x, 0.7 * (x * x - 1.0), 0.4 * (x * x * x - 3.0 * x), 0.0]
}
