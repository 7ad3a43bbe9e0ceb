//! Rivals without a name: smooth disturbances that describe a misfit along time, airspeed or
//! angle of attack without saying what causes it. They compete with the mechanisms.

use fdm::Aircraft;
use serde::Serialize;

use super::channel::{ALL, CHANNELS, at};
use super::gate::{Gated, Segment};

/// Along what a misfit lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Coordinate {
    /// Time of flight.
    Time,
    /// Airspeed.
    Airspeed,
    /// Angle of attack.
    AngleOfAttack,
}

impl Coordinate {
    /// As in `gap.json`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Airspeed => "airspeed",
            Self::AngleOfAttack => "angle_of_attack",
        }
    }
}

const ALL_COORDINATES: [Coordinate; 3] = [
    Coordinate::Time,
    Coordinate::Airspeed,
    Coordinate::AngleOfAttack,
];

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

/// A group of columns that stand for one nameless cause.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Along what it varies.
    pub coordinate: Coordinate,
    /// What it acts on.
    pub target: Target,
    /// Number of columns.
    pub columns: usize,
    /// Size of one standard deviation of its prior, SI.
    pub scale: f64,
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

impl Group {
    /// The term in words.
    pub fn words(&self) -> String {
        let along = self.coordinate.as_str().replace('_', " ");
        format!("{}, smooth in {along}", self.target.words())
    }
}

/// What an aircraft meets at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Meeting {
    /// Time, s.
    pub time_s: f64,
    /// Airspeed, m/s.
    pub airspeed: f64,
    /// Angle of attack, rad.
    pub alpha: f64,
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
    ranges: Ranges,
    power: [f64; 3],
    /// Columns along airspeed where the published numbers hold.
    at_cruise: [f64; 4],
}

impl Terms {
    /// Every group for these data.
    pub fn of(aircraft: &Aircraft, gated: &Gated) -> Self {
        let ranges = Ranges::of(&gated.segments);
        let cruise = aircraft.limits.airspeed_cruise_m_s;
        Self {
            groups: groups(aircraft, gated, &ranges),
            power: surface_power(aircraft),
            at_cruise: ranges.basis(Coordinate::Airspeed, 0.0, cruise, 0.0),
            ranges,
        }
    }

    /// Number of columns.
    pub fn count(&self) -> usize {
        self.groups.iter().map(|g| g.columns).sum()
    }

    /// What one standard deviation of each column is at an instant, SI, with what it acts on.
    pub fn at(&self, met: &Meeting) -> impl Iterator<Item = (Target, f64)> {
        let met = *met;
        let along = |coordinate| {
            let basis = self
                .ranges
                .basis(coordinate, met.time_s, met.airspeed, met.alpha);
            (coordinate, basis)
        };
        let bases = ALL_COORDINATES.map(along);
        self.groups.iter().flat_map(move |group| {
            let along = bases.iter().find(|b| b.0 == group.coordinate);
            let mut basis = along.map_or([0.0; 4], |b| b.1);
            let mut power = 1.0;
            if let Target::Surface(k) = group.target {
                power = self.power[k] * met.pressure * met.angles[k];
                if group.coordinate == Coordinate::Airspeed {
                    // A surface turns the aircraft as published at cruise.
                    for (b, there) in basis.iter_mut().zip(self.at_cruise) {
                        *b -= there;
                    }
                }
            }
            (0..group.columns).map(move |k| (group.target, basis[k] * group.scale * power))
        })
    }
}

/// Nameless terms at work, in standard deviations of their priors.
#[derive(Debug, Clone)]
pub struct Nameless {
    terms: std::sync::Arc<Terms>,
    values: Vec<f64>,
}

impl Nameless {
    /// The terms with these values; none where all are nil.
    pub fn new(terms: &std::sync::Arc<Terms>, values: &[f64]) -> Option<Self> {
        values.iter().any(|v| *v != 0.0).then(|| Self {
            terms: terms.clone(),
            values: values.to_vec(),
        })
    }

    fn each(&self, met: &Meeting) -> impl Iterator<Item = (Target, f64)> {
        let values = self.values.iter();
        let terms = self.terms.at(met).zip(values);
        terms
            .filter(|(_, v)| **v != 0.0)
            .map(|((target, one), v)| (target, one * v))
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

/// Waves of a smooth term in time.
const TIME_TERMS: usize = 4;
/// Terms along airspeed.
const AIRSPEED_TERMS: usize = 2;
/// Terms along the angle of attack.
const ALPHA_TERMS: usize = 3;

/// Every group for these data.
fn groups(aircraft: &Aircraft, gated: &Gated, ranges: &Ranges) -> Vec<Group> {
    let spin = control_spin(aircraft);
    let push = [0.3, 0.3, 0.8];
    let mut all = Vec::new();
    for coordinate in ALL_COORDINATES {
        let columns = match coordinate {
            Coordinate::Time => TIME_TERMS,
            Coordinate::Airspeed => AIRSPEED_TERMS,
            Coordinate::AngleOfAttack => ALPHA_TERMS,
        };
        let surface_part = match coordinate {
            // Half of the effect lost at twice the dynamic pressure.
            Coordinate::Airspeed => ranges.airspeed_m_s.1 / ranges.airspeed_m_s.0,
            _ => 0.25,
        };
        for k in 0..3 {
            let mut push_group = |target, scale| {
                all.push(Group {
                    coordinate,
                    target,
                    columns,
                    scale,
                });
            };
            push_group(Target::Spin(k), spin[k]);
            push_group(Target::Push(k), push[k]);
            if coordinate != Coordinate::AngleOfAttack && (k < 2 || gated.has_rudder) {
                push_group(Target::Surface(k), surface_part);
            }
        }
    }
    for k in 0..at::VELOCITY {
        if gated.present[k] && k != at::BETA && k != at::ROLL + 2 {
            all.push(Group {
                coordinate: Coordinate::Time,
                target: Target::Sensor(k),
                columns: TIME_TERMS,
                scale: 3.0 * ALL[k].usual_noise * ALL[k].si,
            });
        }
    }
    all
}

/// Angular acceleration by two degrees of each surface at cruise, rad/s².
fn control_spin(a: &Aircraft) -> [f64; 3] {
    let load = 0.5 * 1.225 * a.limits.airspeed_cruise_m_s.powi(2) * a.wing.area_m2;
    let angle = 2f64.to_radians();
    let yaw = a.yaw.rudder.abs().max(0.3 * a.yaw.beta);
    [
        load * a.wing.span_m * a.roll.aileron / a.body.ixx_kg_m2 * angle,
        load * a.wing.chord_m * a.pitch.elevator.abs() / a.body.iyy_kg_m2 * angle,
        load * a.wing.span_m * yaw / a.body.izz_kg_m2 * angle,
    ]
}

/// Angular acceleration by one radian of each surface and unit dynamic pressure.
fn surface_power(a: &Aircraft) -> [f64; 3] {
    let s = a.wing.area_m2;
    [
        s * a.wing.span_m * a.roll.aileron / a.body.ixx_kg_m2,
        s * a.wing.chord_m * a.pitch.elevator / a.body.iyy_kg_m2,
        s * a.wing.span_m * a.yaw.rudder / a.body.izz_kg_m2,
    ]
}

/// Where the coordinates of all segments lie: what the smooth terms are scaled by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ranges {
    /// First time and length of the data, s.
    pub time_s: (f64, f64),
    /// Mean and standard deviation of airspeed, m/s.
    pub airspeed_m_s: (f64, f64),
    /// Mean and standard deviation of the angle of attack, rad.
    pub alpha_rad: (f64, f64),
}

impl Ranges {
    /// The ranges of `segments`.
    pub fn of(segments: &[Segment]) -> Self {
        let first = segments
            .iter()
            .map(|s| s.time_s[0])
            .fold(f64::MAX, f64::min);
        let last = segments
            .iter()
            .map(|s| s.time_s[s.len() - 1])
            .fold(f64::MIN, f64::max);
        let spread = |k: usize, default: (f64, f64)| {
            let values: Vec<f64> = segments
                .iter()
                .flat_map(|s| s.measured.iter().map(|m| m[k]))
                .filter(|v| v.is_finite())
                .collect();
            if values.len() < 10 {
                return default;
            }
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let sd = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
            (mean, sd.max(1e-3))
        };
        Self {
            time_s: (first, last - first),
            airspeed_m_s: spread(at::AIRSPEED, (18.0, 1.0)),
            alpha_rad: spread(at::ALPHA, (0.05, 0.03)),
        }
    }

    /// The columns of a coordinate at one instant.
    pub fn basis(
        &self,
        coordinate: Coordinate,
        time_s: f64,
        airspeed: f64,
        alpha: f64,
    ) -> [f64; 4] {
        let hermite = |x: f64| {
            let x = x.clamp(-3.0, 3.0);
            [x, 0.7 * (x * x - 1.0), 0.4 * (x * x * x - 3.0 * x), 0.0]
        };
        match coordinate {
            Coordinate::Time => {
                let phase = std::f64::consts::PI * (time_s - self.time_s.0) / self.time_s.1;
                std::array::from_fn(|k| (phase * (k + 1) as f64).cos())
            }
            Coordinate::Airspeed => hermite((airspeed - self.airspeed_m_s.0) / self.airspeed_m_s.1),
            Coordinate::AngleOfAttack => hermite((alpha - self.alpha_rad.0) / self.alpha_rad.1),
        }
    }
}
