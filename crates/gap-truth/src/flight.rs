//! Hidden cases of flight: an aircraft that differs from its file in a known way, flown through
//! turbulence by an autopilot of its own, and what its sensors logged.
//!
//! Nothing is shared with the flight model that the finder runs: body-axis velocities and Euler
//! angles instead of NED velocities and quaternions, servos as differential equations, Heun's
//! method with a step of 2.5 ms, Dryden turbulence in body axes with rotary gusts, sensors with
//! noise, quantisation and sample-and-hold.

mod airframe;
mod effect;
mod gusts;
mod pilot;
mod sensors;

use std::collections::VecDeque;

use airframe::{Airframe, STATES};
pub use effect::{FLIGHT_CATALOGUE, FLIGHT_OUTSIDE, FlightEffect, FlightLaw};

use crate::random::{between, stream};
use effect::InjectedEffects;
use gusts::Gusts;
use pilot::CaseAutopilot;
use sensors::Sensors;

/// Step of the integration, s.
const STEP_S: f64 = 0.0025;
/// Interval of the log and of the autopilot, s.
const LOG_S: f64 = 0.04;

/// Form of the noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlightNoise {
    /// White sensor noise and Dryden turbulence.
    Usual,
    /// Heavy tails, coarse quantisation, missing cells, drifting attitude.
    Unusual,
}

/// What a case is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightSpec {
    /// Seed of everything that is drawn.
    pub seed: u64,
    /// Length, s.
    pub duration_s: f64,
    /// What is hidden, with strengths in typical sizes.
    pub hidden: Vec<(FlightEffect, f64)>,
    /// When what is hidden sets in, s; from the beginning if not given. What changes with time by its
    /// own law does so from the beginning.
    pub onset_s: Option<f64>,
    /// Whether laws differ from the catalogue's.
    pub law: FlightLaw,
    /// Noise.
    pub noise: FlightNoise,
    /// Whether manoeuvres are flown (else cruise and turns only).
    pub manoeuvres: bool,
}

impl FlightSpec {
    /// A flight of 90 s with nothing hidden.
    pub fn none(seed: u64) -> Self {
        Self {
            seed,
            duration_s: 90.0,
            hidden: Vec::new(),
            onset_s: None,
            law: FlightLaw::Catalogue,
            noise: FlightNoise::Usual,
            manoeuvres: true,
        }
    }
}

/// A parameter of a hidden effect, as the catalogue has it.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueValue {
    /// Mechanism.
    pub mechanism: &'static str,
    /// Parameter.
    pub name: &'static str,
    /// Value that was hidden.
    pub value: f64,
    /// Value that the flight has: the same with the workmanship of sensors and servos in it.
    pub whole: f64,
}

/// A case: the flight file, and the truth.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightCase {
    /// The flight file.
    pub csv: String,
    /// What was hidden, in the catalogue's words.
    pub truth: Vec<TrueValue>,
    /// Whether it stayed in the air and in control.
    pub flown: bool,
}

/// Flies the case of `spec` with the aircraft whose file has the text `aircraft_toml`; none if
/// the text lacks a number.
pub fn make(spec: &FlightSpec, aircraft_toml: &str) -> Option<FlightCase> {
    let published = Airframe::read(aircraft_toml)?;
    let mut plain = published.clone();
    plain.vary_within_tolerance(&mut stream(spec.seed, "flight/scatter"));
    let mut hidden = InjectedEffects::new(spec, &published);
    let mut frame = plain.clone();
    hidden.apply(&mut frame);
    let sound = FlightSpec {
        hidden: Vec::new(),
        ..spec.clone()
    };
    let sound = InjectedEffects::new(&sound, &published);
    let onset_s = spec.onset_s.unwrap_or(f64::NEG_INFINITY);
    let mut scene = stream(spec.seed, "flight/scene");
    let height = between(&mut scene, 80.0, 400.0);
    let heading = between(&mut scene, -3.0, 3.0);
    let speed = published.cruise_m_s * between(&mut scene, 0.98, 1.08);
    let (blow, towards) = (
        between(&mut scene, 1.0, 6.0),
        between(&mut scene, -3.1, 3.1),
    );
    let wind = [blow * towards.cos(), blow * towards.sin()];
    let intensity = between(&mut scene, 0.2, 0.6);
    let rho = 1.225 * (1.0 - 2.2558e-5 * height).powf(4.2559);
    let mut gusts = Gusts::new(height, intensity, speed, published.span_m, spec.seed);
    let mut pilot = CaseAutopilot::new(spec, &published, speed, height, rho);
    let mut sensors = Sensors::new(spec);
    let (first, first_hidden) = if onset_s > 0.0 {
        (&plain, &sound)
    } else {
        (&frame, &hidden)
    };
    let mut x = initial_state(first, first_hidden, speed, height, heading, wind, rho);
    let mut csv = sensors.header(&published);
    let mut commands = Commands::default();
    let mut gust = gusts.step(STEP_S, speed);
    let mut flown = true;
    for k in 0..(spec.duration_s / LOG_S) as usize {
        let time = k as f64 * LOG_S;
        let (frame, hidden) = if time < onset_s {
            (&mut plain, &sound)
        } else {
            (&mut frame, &hidden)
        };
        hidden.now(frame, time);
        let flow = frame.flow(&x, &gust, wind);
        let command = pilot.command(time, &x, &flow);
        commands.queued.push_back((time, command));
        let force = frame.derivatives(&x, &gust, wind, rho, &command).force;
        sensors.log(
            &mut csv, time, &x, &flow, &force, &command, &published, hidden,
        );
        for step in 0..(LOG_S / STEP_S).round() as usize {
            let now = time + (step as f64 + 0.5) * STEP_S;
            let standing = commands.standing(now, &command, hidden);
            x = frame.step(&x, &gust, wind, rho, &standing, STEP_S);
            if step % 2 == 1 {
                gust = gusts.step(2.0 * STEP_S, speed);
            }
        }
        let in_control = x.iter().all(|v| v.is_finite())
            && x[6].abs() < 1.3
            && x[7].abs() < 0.7
            && flow.alpha.abs() < 0.23
            && (x[9] - height).abs() < 60.0;
        if !in_control {
            flown = false;
            break;
        }
    }
    Some(FlightCase {
        csv,
        truth: hidden.truth,
        flown,
    })
}

/// Commands on their way to the servos.
#[derive(Default)]
struct Commands {
    queued: VecDeque<(f64, [f64; 4])>,
    lagged: Option<[f64; 3]>,
}

impl Commands {
    /// What the servos are told at `now`, and what the motor is told at once (`command`), with the
    /// delay, lag and trim that are hidden.
    fn standing(&mut self, now: f64, command: &[f64; 4], hidden: &InjectedEffects) -> [f64; 4] {
        while self.queued.len() > 1 && self.queued[1].0 <= now - hidden.delay_s {
            self.queued.pop_front();
        }
        let late = self.queued[0].1;
        let mut surface = [late[0], late[1], late[2]];
        // A first-order lag before the servo.
        let before = self.lagged.unwrap_or(surface);
        if hidden.lag_s > 0.0 {
            for s in 0..3 {
                let part = 1.0 - (-STEP_S / hidden.lag_s).exp();
                surface[s] = before[s] + part * (surface[s] - before[s]);
            }
        }
        self.lagged = Some(surface);
        [
            surface[0] + hidden.trim[0],
            surface[1] + hidden.trim[1],
            surface[2] + hidden.trim[2],
            command[3],
        ]
    }
}

/// Level flight at the beginning.
fn initial_state(
    frame: &Airframe,
    hidden: &InjectedEffects,
    speed: f64,
    height: f64,
    heading: f64,
    wind: [f64; 2],
    rho: f64,
) -> [f64; STATES] {
    let [alpha, elevator, throttle] = frame.trim(speed, rho);
    let mut x = [0.0; STATES];
    (x[7], x[8], x[9], x[16]) = (alpha, heading, height, throttle);
    let r = airframe::to_ned(0.0, alpha, heading);
    let air = [speed * alpha.cos(), 0.0, speed * alpha.sin()];
    for k in 0..3 {
        x[k] = air[k] + r[0][k] * wind[0] + r[1][k] * wind[1];
    }
    let standing = frame.to_servos([elevator + hidden.trim[0], 0.0, 0.0]);
    x[10..13].copy_from_slice(&standing);
    x
}
