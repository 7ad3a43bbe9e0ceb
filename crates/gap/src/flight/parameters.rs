//! What may differ between the aircraft of the file and the one that flew: the mechanisms of the
//! catalogue, and tolerances of everything else, since nothing real is exactly as published.

use fdm::Aircraft;
use fdm::extended::ExtendedAircraft;
use fdm::mechanism::CATALOGUE;

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
    /// What a parameter of a mechanism changes by at an onset: its place among the parameters, and those
    /// in the catalogue.
    Later(usize, usize, usize),
    /// Place in `COEFFICIENTS`.
    Coefficient(usize),
    /// Mean wind of one log towards north (0) or east (1).
    Wind(usize, usize),
    /// Share of the gusts' gradients that turns the aircraft: pitch (0) or yaw (1).
    GustShare(usize),
}

impl Effect {
    /// Of what a parameter of a mechanism changes by at an onset, the place of that parameter.
    pub fn later_than(self) -> Option<usize> {
        match self {
            Self::Later(place, ..) => Some(place),
            _ => None,
        }
    }
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
    /// Whether it changes how the aircraft moves (else only what sensors tell).
    pub moves: bool,
    /// Whether it changes the surfaces' motion.
    pub servo: bool,
}

/// A coefficient of the base: name, relative and absolute part of its tolerance, and where it is.
struct Coefficient {
    name: &'static str,
    relative: f64,
    absolute: f64,
    /// Standard deviation before any flight of an aircraft without published coefficients: relative and absolute
    /// part; none for what is weighed and measured on the ground.
    unknown: Option<(f64, f64)>,
    place: fn(&mut Aircraft) -> &mut f64,
}

/// Coefficients: those that no mechanism changes are known to a few per cent at best, the others, last, have no
/// tolerance beside their mechanisms'. How far they may be off where nothing is published is about their own size, as
/// small aircraft differ (Beard and McLain 2012, appendix E; Gryte et al. 2018; Paw 2009).
const COEFFICIENTS: [Coefficient; 32] = [
    coefficient("lift.zero", 0.0, 0.004, Some((0.0, 0.3)), |a| {
        &mut a.lift.zero
    }),
    coefficient("lift.q", 0.05, 0.1, Some((1.0, 3.0)), |a| &mut a.lift.q),
    coefficient("lift.elevator", 0.03, 0.005, Some((0.7, 0.2)), |a| {
        &mut a.lift.elevator
    }),
    coefficient("drag.alpha", 0.02, 0.002, Some((1.0, 0.2)), |a| {
        &mut a.drag.alpha
    }),
    coefficient("drag.alpha_squared", 0.03, 0.02, Some((1.0, 0.5)), |a| {
        &mut a.drag.alpha_squared
    }),
    coefficient("side.beta", 0.03, 0.005, Some((1.0, 0.2)), |a| {
        &mut a.side.beta
    }),
    coefficient("side.p", 0.05, 0.01, Some((1.0, 0.2)), |a| &mut a.side.p),
    coefficient("side.r", 0.05, 0.01, Some((1.0, 0.2)), |a| &mut a.side.r),
    coefficient("side.aileron", 0.05, 0.005, Some((1.0, 0.1)), |a| {
        &mut a.side.aileron
    }),
    coefficient("side.rudder", 0.03, 0.002, Some((1.0, 0.1)), |a| {
        &mut a.side.rudder
    }),
    coefficient("roll.beta", 0.03, 0.002, Some((1.0, 0.05)), |a| {
        &mut a.roll.beta
    }),
    coefficient("roll.r", 0.05, 0.003, Some((1.0, 0.1)), |a| &mut a.roll.r),
    coefficient("pitch.zero", 0.0, 0.0008, Some((0.0, 0.1)), |a| {
        &mut a.pitch.zero
    }),
    coefficient("pitch.alpha", 0.01, 0.0, Some((1.0, 0.2)), |a| {
        &mut a.pitch.alpha
    }),
    coefficient("yaw.beta", 0.03, 0.001, Some((1.0, 0.03)), |a| {
        &mut a.yaw.beta
    }),
    coefficient("yaw.p", 0.05, 0.002, Some((1.0, 0.03)), |a| &mut a.yaw.p),
    coefficient("yaw.r", 0.03, 0.002, Some((1.0, 0.05)), |a| &mut a.yaw.r),
    coefficient("yaw.aileron", 0.05, 0.001, Some((1.0, 0.02)), |a| {
        &mut a.yaw.aileron
    }),
    coefficient("body.ixx_kg_m2", 0.01, 0.0, None, |a| &mut a.body.ixx_kg_m2),
    coefficient("body.iyy_kg_m2", 0.01, 0.0, None, |a| &mut a.body.iyy_kg_m2),
    coefficient("body.izz_kg_m2", 0.01, 0.0, None, |a| &mut a.body.izz_kg_m2),
    coefficient("body.ixz_kg_m2", 0.03, 0.0, None, |a| &mut a.body.ixz_kg_m2),
    coefficient("drag.zero", 0.01, 0.0, Some((1.0, 0.02)), |a| {
        &mut a.drag.zero
    }),
    coefficient("lift.alpha", 0.0, 0.0, Some((0.5, 0.5)), |a| {
        &mut a.lift.alpha
    }),
    coefficient("roll.p", 0.0, 0.0, Some((0.7, 0.1)), |a| &mut a.roll.p),
    coefficient("roll.aileron", 0.0, 0.0, Some((0.7, 0.05)), |a| {
        &mut a.roll.aileron
    }),
    coefficient("roll.rudder", 0.0, 0.0, Some((1.0, 0.02)), |a| {
        &mut a.roll.rudder
    }),
    coefficient("pitch.q", 0.0, 0.0, Some((1.0, 3.0)), |a| &mut a.pitch.q),
    coefficient("pitch.elevator", 0.0, 0.0, Some((0.7, 0.2)), |a| {
        &mut a.pitch.elevator
    }),
    coefficient("yaw.rudder", 0.0, 0.0, Some((0.7, 0.05)), |a| {
        &mut a.yaw.rudder
    }),
    coefficient("drag.beta_squared", 0.0, 0.0, Some((1.0, 0.2)), |a| {
        &mut a.drag.beta_squared
    }),
    coefficient(
        "propulsion.exit_speed_m_s",
        0.0,
        0.0,
        Some((0.3, 0.0)),
        |a| &mut a.propulsion.exit_speed_m_s,
    ),
];

const fn coefficient(
    name: &'static str,
    relative: f64,
    absolute: f64,
    unknown: Option<(f64, f64)>,
    place: fn(&mut Aircraft) -> &mut f64,
) -> Coefficient {
    Coefficient {
        name,
        relative,
        absolute,
        unknown,
        place,
    }
}

/// All parameters for these data: mechanisms first, then tolerances, then gusts and winds.
pub fn all(aircraft: &Aircraft, gated: &Gated, logs: usize) -> Vec<Parameter> {
    let mut parameters = mechanisms(gated);
    let tolerance = |c: &Coefficient, value: f64| c.relative * value.abs() + c.absolute;
    parameters.extend(coefficients(aircraft, gated, &tolerance));
    parameters.extend(of_the_air(gated, logs));
    parameters
}

/// What is estimated of an aircraft without published coefficients: these with all that they may be off by, and the
/// surfaces' delay; the errors of its sensors as usual.
pub fn unknown(aircraft: &Aircraft, gated: &Gated, logs: usize) -> Vec<Parameter> {
    let is_delay = |p: &Parameter| p.name.starts_with("actuator-delay");
    let of_mechanism = |p: Parameter| {
        let tolerance = p.prior_sd.filter(|_| is_delay(&p)).unwrap_or(p.tolerance);
        Parameter {
            tolerance,
            prior_sd: None,
            ..p
        }
    };
    let judged = mechanisms(gated)
        .into_iter()
        .filter(|p| !p.moves || is_delay(p));
    let mut parameters: Vec<Parameter> = judged.map(of_mechanism).collect();
    let sd = |c: &Coefficient, value: f64| {
        let thrust = ["drag.", "propulsion."]
            .iter()
            .any(|of| c.name.starts_with(of));
        let told = c.unknown.filter(|_| gated.has_throttle || !thrust);
        told.map_or(0.0, |(relative, absolute)| {
            relative * value.abs() + absolute
        })
    };
    parameters.extend(coefficients(aircraft, gated, &sd).map(|p| Parameter {
        step: p.step * WIDE_STEP_PART,
        ..p
    }));
    parameters.extend(of_the_air(gated, logs));
    parameters
}

/// The coefficients that may be off by more than nothing.
fn coefficients(
    aircraft: &Aircraft,
    gated: &Gated,
    off_by: &dyn Fn(&Coefficient, f64) -> f64,
) -> impl Iterator<Item = Parameter> {
    let parameter = |(k, coefficient): (usize, &Coefficient)| {
        let tolerance = off_by(coefficient, value_of(aircraft, k));
        let no_rudder = coefficient.name.ends_with("rudder") && !gated.has_rudder;
        (tolerance > 0.0 && !no_rudder).then(|| Parameter {
            name: coefficient.name.to_owned(),
            unit: "1",
            effect: Effect::Coefficient(k),
            tolerance,
            law_sd: 0.0,
            prior_sd: None,
            step: 0.2 * tolerance,
            moves: true,
            servo: false,
        })
    };
    let each = COEFFICIENTS.iter().enumerate().filter_map(parameter);
    each.collect::<Vec<_>>().into_iter()
}

/// What the air does: the share of gusts that turns the aircraft, and the mean wind of each log.
fn of_the_air(gated: &Gated, logs: usize) -> impl Iterator<Item = Parameter> {
    let parameter = |name: String, unit, effect, tolerance, step| Parameter {
        name,
        unit,
        effect,
        tolerance,
        law_sd: 0.0,
        prior_sd: None,
        step,
        moves: true,
        servo: false,
    };
    let share = move |(axis, name): (usize, &str)| {
        let name = format!("gust.{name}_share");
        parameter(name, "1", Effect::GustShare(axis), SHARE_SD, 0.05)
    };
    let sd_m_s = if gated.has_wind {
        LOGGED_WIND_SD_M_S
    } else {
        WIND_SD_M_S
    };
    let wind = move |log: usize, axis: usize| {
        let name = format!("wind.{}[{log}]", ["north_m_s", "east_m_s"][axis]);
        parameter(name, "m/s", Effect::Wind(log, axis), sd_m_s, 0.02)
    };
    let winds = (0..logs).flat_map(move |log| [0, 1].map(|axis| wind(log, axis)));
    let shares = ["pitch", "yaw"].into_iter().enumerate().map(share);
    shares.chain(winds)
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
                "alpha-vane-scale" => gated.present[super::channel::at::ALPHA],
                "gyro-bias" => gated.present[super::channel::at::ROLL_RATE + k],
                "accelerometer-bias" => gated.present[super::channel::at::FORCE + k],
                _ => !p.name.starts_with("rudder") || gated.has_rudder,
            };
            if !judged {
                continue;
            }
            let servo = matches!(
                spec.id,
                "actuator-delay" | "actuator-lag" | "surface-trim-offset"
            );
            let workmanship = TOLERANCE_PART * p.prior_sd;
            // What rotary gusts do beyond the rough model of them looks like damping.
            let law_sd = match spec.id {
                "roll-damping" | "pitch-damping" => 3.0 * workmanship,
                _ => 0.0,
            };
            let sensor = spec.acts_on == fdm::mechanism::ActsOn::Sensors;
            parameters.push(Parameter {
                name: format!("{}.{}", spec.id, p.name),
                unit: p.unit,
                effect: Effect::Mechanism(m, k),
                tolerance: workmanship.max(law_sd),
                law_sd,
                prior_sd: Some(p.prior_sd),
                // A delay needs a secant over part of a sample; the rest is smooth.
                step: if spec.id == "actuator-delay" {
                    0.01
                } else {
                    0.02 * p.prior_sd
                },
                moves: !sensor,
                servo,
            });
        }
    }
    parameters
}

/// A fault is larger than what differs between an aircraft and its file, by this factor: a surface may
/// come off.
const FAULT_FACTOR: f64 = 3.0;
/// Tolerance of what changes in flight, as a part of its prior: nothing does without a fault.
const LATE_TOLERANCE_PART: f64 = 1e-3;

/// What the mechanisms among `parameters` may change by at an onset.
pub fn later(parameters: &[Parameter]) -> Vec<Parameter> {
    let of = |(place, p): (usize, &Parameter)| {
        let (Effect::Mechanism(m, k), Some(sd)) = (p.effect, p.prior_sd) else {
            return None;
        };
        let prior_sd = FAULT_FACTOR * sd;
        Some(Parameter {
            name: format!("{} from the onset", p.name),
            effect: Effect::Later(place, m, k),
            tolerance: LATE_TOLERANCE_PART * prior_sd,
            prior_sd: Some(prior_sd),
            ..p.clone()
        })
    };
    parameters.iter().enumerate().filter_map(of).collect()
}

/// The departures from the onset on: what changes there on top of what was there before.
pub fn after_onset(parameters: &[Parameter], theta: &[f64]) -> Vec<f64> {
    let mut after = theta.to_vec();
    for (parameter, value) in parameters.iter().zip(theta) {
        if let Some(place) = parameter.effect.later_than() {
            after[place] += value;
        }
    }
    after
}

/// What flies with all departures at work.
pub struct Applied {
    /// The aircraft and its sensors.
    pub extended: ExtendedAircraft,
    /// Mean wind added to each log, north and east, m/s.
    pub winds: Vec<[f64; 2]>,
    /// Shares of the gusts' gradients that turn it, pitch and yaw.
    pub gust_shares: [f64; 2],
}

/// Number of logs whose winds are among the parameters.
fn logs(parameters: &[Parameter]) -> usize {
    let of_a_log = |p: &&Parameter| matches!(p.effect, Effect::Wind(_, 0));
    parameters.iter().filter(of_a_log).count()
}

/// The aircraft with all departures `theta`, and the winds of all logs.
pub fn applied(aircraft: &Aircraft, parameters: &[Parameter], theta: &[f64]) -> Applied {
    let mut base = aircraft.clone();
    base.mechanism.clear();
    let mut gust_shares = [USUAL_SHARE; 2];
    let mut winds = vec![[0.0; 2]; logs(parameters)];
    for (parameter, value) in parameters.iter().zip(theta) {
        match parameter.effect {
            Effect::Coefficient(k) => *(COEFFICIENTS[k].place)(&mut base) += value,
            Effect::Wind(log, axis) => winds[log][axis] += value,
            Effect::GustShare(axis) => gust_shares[axis] += value,
            Effect::Mechanism(..) | Effect::Later(..) => {}
        }
    }
    let mut extended = ExtendedAircraft {
        aircraft: base,
        sensors: fdm::extended::SensorErrors::default(),
        wind_bias_ned_m_s: [0.0; 3],
    };
    for (m, spec) in CATALOGUE.iter().enumerate() {
        let mut values = [0.0; 3];
        for (value, p) in values.iter_mut().zip(spec.parameters) {
            *value = p.neutral;
        }
        let mut touched = false;
        for (parameter, value) in parameters.iter().zip(theta) {
            if let Effect::Mechanism(_, k) = parameter.effect
                && parameter.effect == Effect::Mechanism(m, k)
                && *value != 0.0
            {
                let spec = &spec.parameters[k];
                values[k] = (spec.neutral + value).clamp(spec.low, spec.high);
                touched = true;
            }
        }
        if touched {
            extended.apply(spec.id, values);
        }
    }
    Applied {
        extended,
        winds,
        gust_shares,
    }
}
