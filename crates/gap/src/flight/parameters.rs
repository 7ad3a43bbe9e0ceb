//! What may differ between the aircraft of the file and the one that flew: the mechanisms of the
//! catalogue, and tolerances of everything else, since nothing real is exactly as published.

use std::collections::BTreeMap;
use std::sync::Arc;

use fdm::Aircraft;
use fdm::extended::ExtendedAircraft;
use fdm::mechanism::{ActsOn, CATALOGUE};

use super::channel::at;
use super::gate::Gated;
use super::gradient::{SHARE_SD, USUAL_SHARE};

/// Prior of the mean wind where none was logged, m/s.
const WIND_SD_M_S: f64 = 12.0;
/// Tolerance of a logged wind, m/s.
const LOGGED_WIND_SD_M_S: f64 = 0.3;
/// Tolerance of a catalogue parameter, as a part of the catalogue's prior: sizes below this are
/// workmanship, not a cause.
const TOLERANCE_PART: f64 = 0.04;
/// Part of the usual step of numerical derivatives where a coefficient may be off by its own size: the laws are not
/// linear so far.
const WIDE_STEP_PART: f64 = 0.1;

/// What a parameter changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Effect {
    /// Parameter of a mechanism: places in the catalogue.
    Mechanism(usize, usize),
    /// Place in `COEFFICIENTS`.
    Coefficient(usize),
    /// Mean wind of one log towards north (0) or east (1).
    Wind(usize, usize),
    /// Share of the gusts' gradients that turns the aircraft: pitch (0) or yaw (1).
    GustShare(usize),
}

/// One parameter, as a departure from its neutral value.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Dotted name.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// What it changes.
    pub effect: Effect,
    /// Prior standard deviation while no mechanism is at work: tolerance.
    pub tolerance: f64,
    /// What its estimate is off by beside noise, since the simulator's law of it is not exact.
    pub law_sd: f64,
    /// Prior standard deviation of the mechanism; none for what only has a tolerance.
    pub prior_sd: Option<f64>,
    /// Step of numerical derivatives.
    pub step: f64,
    /// Whether it changes what sensors tell, and not how the aircraft moves.
    pub of_sensors: bool,
    /// Whether it changes the surfaces' motion.
    pub servo: bool,
}

impl Parameter {
    /// One that has a tolerance only.
    fn new(name: String, unit: &'static str, effect: Effect, tolerance: f64, step: f64) -> Self {
        Self {
            name,
            unit,
            effect,
            tolerance,
            law_sd: 0.0,
            prior_sd: None,
            step,
            of_sensors: false,
            servo: false,
        }
    }
}

/// A coefficient of the base.
struct Coefficient {
    name: &'static str,
    /// Relative and absolute part of its tolerance.
    tolerance: (f64, f64),
    /// The same of its standard deviation before any flight of an aircraft without published coefficients; nil for
    /// what is weighed and measured on the ground.
    unknown: (f64, f64),
    place: fn(&mut Aircraft) -> &mut f64,
}

/// Declares `COEFFICIENTS`: where each is, relative and absolute part of its tolerance, and of what is unknown of it.
macro_rules! coefficients {
    ($($table:ident.$field:ident $relative:literal $absolute:literal $unknown:expr;)*) => {
        const COEFFICIENTS: &[Coefficient] = &[$(Coefficient {
            name: concat!(stringify!($table), ".", stringify!($field)),
            tolerance: ($relative, $absolute),
            unknown: $unknown,
            place: |a| &mut a.$table.$field,
        }),*];
    };
}

// Those that no mechanism changes are known to a few per cent at best; the others, last, have no tolerance beside
// their mechanisms'. How far they may be off where nothing is published is about their own size, as small aircraft
// differ (Beard and McLain 2012, appendix E; Gryte et al. 2018; Paw 2009).
coefficients! {
    lift.zero 0.0 0.004 (0.0, 0.3);
    lift.q 0.05 0.1 (1.0, 3.0);
    lift.elevator 0.03 0.005 (0.7, 0.2);
    drag.alpha 0.02 0.002 (1.0, 0.2);
    drag.alpha_squared 0.03 0.02 (1.0, 0.5);
    side.beta 0.03 0.005 (1.0, 0.2);
    side.p 0.05 0.01 (1.0, 0.2);
    side.r 0.05 0.01 (1.0, 0.2);
    side.aileron 0.05 0.005 (1.0, 0.1);
    side.rudder 0.03 0.002 (1.0, 0.1);
    roll.beta 0.03 0.002 (1.0, 0.05);
    roll.r 0.05 0.003 (1.0, 0.1);
    pitch.zero 0.0 0.0008 (0.0, 0.1);
    pitch.alpha 0.01 0.0 (1.0, 0.2);
    yaw.beta 0.03 0.001 (1.0, 0.03);
    yaw.p 0.05 0.002 (1.0, 0.03);
    yaw.r 0.03 0.002 (1.0, 0.05);
    yaw.aileron 0.05 0.001 (1.0, 0.02);
    body.ixx_kg_m2 0.01 0.0 (0.0, 0.0);
    body.iyy_kg_m2 0.01 0.0 (0.0, 0.0);
    body.izz_kg_m2 0.01 0.0 (0.0, 0.0);
    body.ixz_kg_m2 0.03 0.0 (0.0, 0.0);
    drag.zero 0.01 0.0 (1.0, 0.02);
    lift.alpha 0.0 0.0 (0.5, 0.5);
    roll.p 0.0 0.0 (0.7, 0.1);
    roll.aileron 0.0 0.0 (0.7, 0.05);
    roll.rudder 0.0 0.0 (1.0, 0.02);
    pitch.q 0.0 0.0 (1.0, 3.0);
    pitch.elevator 0.0 0.0 (0.7, 0.2);
    yaw.rudder 0.0 0.0 (0.7, 0.05);
    drag.beta_squared 0.0 0.0 (1.0, 0.2);
    propulsion.exit_speed_m_s 0.0 0.0 (0.3, 0.0);
}

/// All parameters for these data: mechanisms first, then tolerances, then gusts and winds.
pub fn all(aircraft: &Aircraft, gated: &Gated, logs: usize) -> Vec<Parameter> {
    let mut parameters = mechanisms(gated);
    parameters.extend(coefficients(aircraft, gated, |c| c.tolerance));
    parameters.extend(of_the_air(gated, logs));
    parameters
}

/// What is estimated of an aircraft without published coefficients: these with all that they may be off by, and the
/// surfaces' delay; the errors of its sensors as usual.
pub fn unknown(aircraft: &Aircraft, gated: &Gated, logs: usize) -> Vec<Parameter> {
    let is_delay = |p: &Parameter| p.name.starts_with("actuator-delay");
    let mut parameters = mechanisms(gated);
    parameters.retain(|p| p.of_sensors || is_delay(p));
    for p in &mut parameters {
        let wide = p.prior_sd.take().filter(|_| is_delay(p));
        p.tolerance = wide.unwrap_or(p.tolerance);
    }
    let is_told = |c: &Coefficient| {
        let of_thrust = ["drag.", "propulsion."].iter();
        gated.has_throttle || !of_thrust.clone().any(|of| c.name.starts_with(of))
    };
    let sd = |c: &Coefficient| if is_told(c) { c.unknown } else { (0.0, 0.0) };
    parameters.extend(coefficients(aircraft, gated, sd).map(|p| Parameter {
        step: p.step * WIDE_STEP_PART,
        ..p
    }));
    parameters.extend(of_the_air(gated, logs));
    parameters
}

/// The coefficients that may be off by more than nothing, relative and absolute.
fn coefficients(
    aircraft: &Aircraft,
    gated: &Gated,
    off_by: impl Fn(&Coefficient) -> (f64, f64),
) -> impl Iterator<Item = Parameter> {
    COEFFICIENTS.iter().enumerate().filter_map(move |(k, c)| {
        let (relative, absolute) = off_by(c);
        let tolerance = relative * value_of(aircraft, k).abs() + absolute;
        let no_rudder = c.name.ends_with("rudder") && !gated.has_rudder;
        let effect = Effect::Coefficient(k);
        let parameter =
            || Parameter::new(c.name.to_owned(), "1", effect, tolerance, 0.2 * tolerance);
        (tolerance > 0.0 && !no_rudder).then(parameter)
    })
}

/// What the air does: the share of gusts that turns the aircraft, and the mean wind of each log.
fn of_the_air(gated: &Gated, logs: usize) -> impl Iterator<Item = Parameter> {
    let share = |axis: usize| {
        let name = format!("gust.{}_share", ["pitch", "yaw"][axis]);
        Parameter::new(name, "1", Effect::GustShare(axis), SHARE_SD, 0.05)
    };
    let sd_m_s = if gated.has_wind {
        LOGGED_WIND_SD_M_S
    } else {
        WIND_SD_M_S
    };
    let wind = move |log: usize, axis: usize| {
        let name = format!("wind.{}[{log}]", ["north_m_s", "east_m_s"][axis]);
        Parameter::new(name, "m/s", Effect::Wind(log, axis), sd_m_s, 0.02)
    };
    let winds = (0..logs).flat_map(move |log| [0, 1].map(|axis| wind(log, axis)));
    [0, 1].map(share).into_iter().chain(winds)
}

/// The value of a coefficient of an aircraft, by its place in `COEFFICIENTS`.
pub fn value_of(aircraft: &Aircraft, place: usize) -> f64 {
    *(COEFFICIENTS[place].place)(&mut aircraft.clone())
}

/// Parameters of the mechanisms that these data can judge.
fn mechanisms(gated: &Gated) -> Vec<Parameter> {
    let mut parameters = Vec::new();
    for (m, spec) in CATALOGUE.iter().enumerate() {
        for (k, p) in spec.parameters.iter().enumerate() {
            let judged = match spec.id {
                "actuator-delay" | "actuator-lag" => gated.tells_delays,
                "wind-bias" => gated.has_wind,
                "thrust-loss" | "drag-increase" => gated.has_throttle,
                "alpha-vane-scale" => gated.present[at::ALPHA],
                "gyro-bias" => gated.present[at::ROLL_RATE + k],
                "accelerometer-bias" => gated.present[at::FORCE + k],
                _ => !p.name.starts_with("rudder") || gated.has_rudder,
            };
            if !judged {
                continue;
            }
            let workmanship = TOLERANCE_PART * p.prior_sd;
            // What rotary gusts do beyond the rough model of them looks like damping.
            let is_damping = matches!(spec.id, "roll-damping" | "pitch-damping");
            let law_sd = if is_damping { 3.0 * workmanship } else { 0.0 };
            // A delay needs a secant over part of a sample; the rest is smooth.
            let is_delay = spec.id == "actuator-delay";
            let step = if is_delay { 0.01 } else { 0.02 * p.prior_sd };
            let name = format!("{}.{}", spec.id, p.name);
            let tolerance = workmanship.max(law_sd);
            parameters.push(Parameter {
                law_sd,
                prior_sd: Some(p.prior_sd),
                of_sensors: spec.acts_on == ActsOn::Sensors,
                servo: is_delay || matches!(spec.id, "actuator-lag" | "surface-trim-offset"),
                ..Parameter::new(name, p.unit, Effect::Mechanism(m, k), tolerance, step)
            });
        }
    }
    parameters
}

/// What flies with all departures at work.
pub struct Applied {
    /// The aircraft and its sensors.
    pub extended: ExtendedAircraft,
    /// Mean wind added, north and east, m/s.
    pub wind: [f64; 2],
    /// Shares of the gusts' gradients that turn it, pitch and yaw.
    pub gust_shares: [f64; 2],
}

/// The aircraft with all departures `theta`, in the wind of a log.
pub fn applied(
    aircraft: &Aircraft,
    parameters: &[Parameter],
    theta: &[f64],
    log: usize,
) -> Applied {
    let mut base = aircraft.clone();
    let (mut wind, mut gust_shares) = ([0.0; 2], [USUAL_SHARE; 2]);
    let mut changed: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
    for (parameter, value) in parameters.iter().zip(theta) {
        match parameter.effect {
            Effect::Coefficient(k) => *(COEFFICIENTS[k].place)(&mut base) += value,
            Effect::Wind(of, axis) if of == log => wind[axis] += value,
            Effect::GustShare(axis) => gust_shares[axis] += value,
            Effect::Mechanism(m, k) if *value != 0.0 => {
                let specs = CATALOGUE[m].parameters;
                let neutral = || std::array::from_fn(|k| specs.get(k).map_or(0.0, |p| p.neutral));
                let values = changed.entry(m).or_insert_with(neutral);
                values[k] = (specs[k].neutral + value).clamp(specs[k].low, specs[k].high);
            }
            Effect::Wind(..) | Effect::Mechanism(..) => {}
        }
    }
    let mut extended = ExtendedAircraft::without_mechanisms(&Arc::new(base));
    for (m, values) in changed {
        extended.apply(CATALOGUE[m].id, values);
    }
    Applied {
        extended,
        wind,
        gust_shares,
    }
}
