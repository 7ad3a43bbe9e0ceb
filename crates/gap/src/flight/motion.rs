//! The aircraft between two samples, and what its sensors then read: the flight model of the
//! simulator with gusts and disturbances as further states.

use fdm::dynamics::{AirState, Body, Controls, Dynamics, Flow, euler, flow, rotation};
use fdm::extended::SensorErrors;
use fdm::servo::{LagStep, Servo};
use fdm::{Aircraft, SurfaceCommand};

use super::channel::{CHANNELS, at};
use super::gate::Segment;
use super::gradient::Gradient;
use super::parameters::{Parameter, applied};
use super::rival::{Meeting, Nameless};

/// Number of error states: velocity, attitude, rate, gust, disturbing angular acceleration and
/// specific force, three of each; two slow errors of the logged roll and pitch angle; and two
/// smoothed gusts.
pub const STATES: usize = 22;
/// The first of the slow errors of angles.
pub const LEAN: usize = 18;
/// The lateral gust as smoothed.
pub const SMOOTHED_LATERAL: usize = 20;
/// The vertical gust as smoothed.
pub const SMOOTHED_VERTICAL: usize = 21;
/// Correlation times of gusts (horizontal, vertical), s, and of the disturbances.
pub const GUST_S: [f64; 3] = [12.0, 12.0, 5.0];
/// Correlation time of the errors of logged angles, s: those of an attitude reference that
/// takes turns for gravity.
pub const LEAN_S: f64 = 15.0;
/// Correlation time of the disturbances, s.
pub const DISTURBANCE_S: f64 = 0.4;

/// The state between samples.
#[derive(Debug, Clone, Copy)]
pub struct Mean {
    /// Rigid body.
    pub body: Body,
    /// Gust, NED, m/s.
    pub gust: [f64; 3],
    /// Angular acceleration that the model does not have, rad/s².
    pub spin: [f64; 3],
    /// Specific force that the model does not have, body axes, m/s².
    pub push: [f64; 3],
    /// Slow error of the logged roll and pitch angle, rad.
    pub lean: [f64; 2],
    /// Lateral and vertical gust as smoothed over the aircraft, body axes, m/s.
    pub smoothed: [f64; 2],
}

/// Surfaces and motor at the beginning, middle and end of each substep of one sample interval.
type Substeps = Vec<[Controls; 3]>;

/// The air around the aircraft at one instant.
struct Around {
    flow: Flow,
    /// Lateral and vertical gust, body axes, m/s.
    gust: [f64; 2],
    /// Rates relative to the air, rad/s.
    rate: [f64; 3],
}

/// One flight under one set of parameters.
#[derive(Debug, Clone)]
pub struct World {
    dynamics: Dynamics,
    sensors: SensorErrors,
    /// How gusts turn the aircraft.
    gradient: Gradient,
    /// Mean wind sample by sample, NED, m/s.
    wind: Vec<[f64; 3]>,
    /// Surfaces through each interval.
    controls: std::rc::Rc<Vec<Substeps>>,
    /// Smooth disturbances without a name.
    nameless: Option<Nameless>,
}

impl World {
    /// The flight of `segment` with departures `theta`. `like` lends its surfaces where the
    /// parameters that move them are the same.
    pub fn new(
        aircraft: &Aircraft,
        parameters: &[Parameter],
        theta: &[f64],
        segment: &Segment,
        like: Option<&Self>,
    ) -> Self {
        let applied = applied(aircraft, parameters, theta, segment.log + 1);
        let extended = applied.extended;
        let dynamics = Dynamics::new(&extended.aircraft);
        let bias = extended.wind_bias_ned_m_s;
        let added = applied.winds[segment.log];
        let wind = (0..segment.len())
            .map(|i| {
                let logged = segment.wind_ned.as_ref().map_or([0.0; 3], |w| w[i]);
                [
                    logged[0] + bias[0] + added[0],
                    logged[1] + bias[1] + added[1],
                    logged[2],
                ]
            })
            .collect();
        let controls = like.map_or_else(
            || std::rc::Rc::new(surfaces(&dynamics, segment)),
            |like| like.controls.clone(),
        );
        Self {
            dynamics,
            sensors: extended.sensors,
            gradient: Gradient {
                share: applied.gust_shares,
                span_m: aircraft.wing.span_m,
            },
            wind,
            controls,
            nameless: None,
        }
    }

    /// The same with smooth disturbances, if there are any.
    pub fn with(mut self, nameless: Option<Nameless>) -> Self {
        self.nameless = nameless;
        self
    }

    /// The flow at sample `i`, what turns the body, and the dynamic pressure (Pa).
    pub fn meets(&self, segment: &Segment, i: usize, mean: &Mean) -> Meeting {
        let flow = self.around(i, mean).flow;
        let controls = self.controls_at(i);
        Meeting {
            time_s: segment.time_s[i],
            airspeed: flow.airspeed,
            alpha: flow.alpha,
            angles: [controls.aileron, controls.elevator, controls.rudder],
            pressure: 0.5 * segment.density[i] * flow.airspeed * flow.airspeed,
        }
    }

    /// The air around the aircraft at sample `i`.
    fn around(&self, i: usize, mean: &Mean) -> Around {
        let axes = rotation(&mean.body.attitude);
        let wind = std::array::from_fn(|k| self.wind[i][k] + mean.gust[k]);
        let flow = flow(&axes, &mean.body.vel_ned, &wind);
        // Lateral and vertical gust in body axes.
        let gust = std::array::from_fn(|k| {
            (0..3)
                .map(|row| axes[row][k + 1] * mean.gust[row])
                .sum::<f64>()
        });
        let turn = self.gradient.turn(mean.smoothed, gust, flow.airspeed);
        Around {
            flow,
            gust,
            rate: std::array::from_fn(|k| mean.body.rate[k] + turn[k]),
        }
    }

    /// What the air's own turning adds: angular acceleration (rad/s²) and specific force (m/s²).
    fn turned(
        &self,
        around: &Around,
        rate: &[f64; 3],
        controls: &Controls,
        density: f64,
    ) -> ([f64; 3], [f64; 3]) {
        let load = |rate| self.dynamics.load(&around.flow, rate, controls, density);
        let ((force, moment), (calm_force, calm_moment)) = (load(&around.rate), load(rate));
        let moment = std::array::from_fn(|k| moment[k] - calm_moment[k]);
        (
            self.dynamics.angular_acceleration(&[0.0; 3], &moment),
            std::array::from_fn(|k| (force[k] - calm_force[k]) / self.dynamics.mass_kg()),
        )
    }

    /// The state at sample `i + 1` from that at `i`.
    pub fn step(&self, segment: &Segment, i: usize, mean: &Mean) -> Mean {
        let dt = segment.time_s[i + 1] - segment.time_s[i];
        let wind = self.wind[i];
        let air = AirState {
            wind_ned: std::array::from_fn(|k| wind[k] + mean.gust[k]),
            density: segment.density[i],
        };
        let mut next = *mean;
        let substeps = &self.controls[i];
        let part = dt / substeps.len() as f64;
        let around = self.around(i, mean);
        let (mut spin, mut push) =
            self.turned(&around, &mean.body.rate, &substeps[0][0], air.density);
        for k in 0..3 {
            spin[k] += mean.spin[k];
            push[k] += mean.push[k];
        }
        if let Some(nameless) = &self.nameless {
            nameless.disturb(&self.meets(segment, i, mean), &mut spin, &mut push);
        }
        for controls in substeps {
            next.body = self.dynamics.rk4(&next.body, controls, &air, part).0;
            let m = rotation(&next.body.attitude);
            for k in 0..3 {
                next.body.rate[k] += part * spin[k];
                next.body.vel_ned[k] +=
                    part * (m[k][0] * push[0] + m[k][1] * push[1] + m[k][2] * push[2]);
            }
        }
        let keep = (-dt / DISTURBANCE_S).exp();
        for k in 0..3 {
            next.gust[k] *= (-dt / GUST_S[k]).exp();
            next.spin[k] *= keep;
            next.push[k] *= keep;
        }
        next.lean = mean.lean.map(|l| l * (-dt / LEAN_S).exp());
        let airspeed = around.flow.airspeed;
        next.smoothed = self
            .gradient
            .smoothed(mean.smoothed, around.gust, airspeed, dt);
        next
    }

    /// What the sensors read at sample `i`, SI.
    pub fn sense(&self, segment: &Segment, i: usize, mean: &Mean) -> [f64; CHANNELS] {
        let body = &mean.body;
        let Around { flow, rate, .. } = self.around(i, mean);
        let controls = self.controls_at(i);
        let (force, _) = self
            .dynamics
            .load(&flow, &rate, &controls, segment.density[i]);
        let mass = self.dynamics.mass_kg();
        let s = &self.sensors;
        let mut read = [0.0; CHANNELS];
        read[at::AIRSPEED] = flow.airspeed * s.airspeed_factor;
        read[at::ALPHA] = flow.alpha * s.alpha_factor + s.alpha_offset_rad;
        read[at::BETA] = flow.beta;
        let attitude = euler(&rotation(&body.attitude));
        read[at::ROLL..at::ROLL_RATE].copy_from_slice(&attitude);
        for k in 0..2 {
            read[at::ROLL + k] += mean.lean[k];
        }
        for k in 0..3 {
            read[at::ROLL_RATE + k] = body.rate[k] + s.gyro_bias_rad_s[k];
            read[at::FORCE + k] = force[k] / mass + mean.push[k] + s.accelerometer_bias_m_s2[k];
            read[at::VELOCITY + k] = body.vel_ned[k];
        }
        if let Some(nameless) = &self.nameless {
            nameless.misread(&self.meets(segment, i, mean), &mut read);
        }
        read
    }

    /// Surfaces and motor at sample `i`.
    pub fn controls_at(&self, i: usize) -> Controls {
        match self.controls.get(i) {
            Some(substeps) => substeps[0][0],
            None => self.controls[i - 1][self.controls[i - 1].len() - 1][2],
        }
    }

    /// Force over mass and moment that the model gives for measured flow and rates at sample `i`
    /// (equation error): body axes, m/s² and N m.
    pub fn load(
        &self,
        segment: &Segment,
        i: usize,
        flow: &fdm::dynamics::Flow,
        rate: &[f64; 3],
    ) -> ([f64; 3], [f64; 3]) {
        let controls = self.controls_at(i);
        let (force, moment) = self
            .dynamics
            .load(flow, rate, &controls, segment.density[i]);
        let mass = self.dynamics.mass_kg();
        (force.map(|f| f / mass), moment)
    }

    /// Mean wind at sample `i`, NED, m/s.
    pub fn wind(&self, i: usize) -> [f64; 3] {
        self.wind[i]
    }
}

/// What the surfaces do when told what the log tells, after delay and servo.
fn surfaces(dynamics: &Dynamics, segment: &Segment) -> Vec<Substeps> {
    let plan = dynamics.aircraft();
    let delay = plan.surfaces.delay_s;
    let mut told = Told::new(segment, delay);
    let first = told.mean(segment.time_s[0], segment.time_s[0] + 1e-3);
    let mut servos = dynamics
        .servo_angles(&first)
        .map(|angle| Servo { angle, rate: 0.0 });
    let mut motor = segment.command[0].throttle;
    let mut lag: Option<(f64, LagStep)> = None;
    let mut all = Vec::with_capacity(segment.len());
    for i in 0..segment.len() - 1 {
        let dt = segment.time_s[i + 1] - segment.time_s[i];
        let count = (dt / dynamics.longest_step_s() - 1e-6).ceil().max(1.0);
        let half = 0.5 * dt / count;
        // Logged times are rounded; a new transition is needed for a new interval only.
        let step = match lag {
            Some((of, step)) if (of - half).abs() < 1e-4 * half => step,
            _ => LagStep::new(&plan.surfaces, plan.propulsion.lag_s, half),
        };
        lag = Some((half, step));
        let mut substeps = Vec::with_capacity(count as usize);
        for k in 0..count as usize {
            let mut drive = |part: f64| {
                let from = segment.time_s[i] + (2.0 * k as f64 + part) * half;
                let mut command = told.mean(from, from + half);
                // The motor is told without the servos' delay.
                command.throttle = segment.command[i].throttle;
                let angles = dynamics.servo_angles(&command);
                step.drive(&mut servos, &mut motor, &angles, command.throttle);
                dynamics.controls(&servos, motor)
            };
            let start = substeps.last().map(|last: &[Controls; 3]| last[2]);
            let start = start.or_else(|| all.last().and_then(|s: &Substeps| Some(s.last()?[2])));
            let middle = drive(0.0);
            let end = drive(1.0);
            substeps.push([start.unwrap_or(middle), middle, end]);
        }
        all.push(substeps);
    }
    all
}

/// Commands as they come to the servos: held between samples, late by a delay.
struct Told<'a> {
    segment: &'a Segment,
    delay: f64,
    at: usize,
}

impl<'a> Told<'a> {
    fn new(segment: &'a Segment, delay: f64) -> Self {
        Self {
            segment,
            delay,
            at: 0,
        }
    }

    /// The mean command from `from` to `to` (s, ascending from call to call): continuous in the
    /// delay, so that it can be fitted.
    fn mean(&mut self, from: f64, to: f64) -> SurfaceCommand {
        let time = &self.segment.time_s;
        let (from, to) = (from - self.delay, to - self.delay);
        while self.at + 1 < time.len() && time[self.at + 1] <= from {
            self.at += 1;
        }
        let mut sum = SurfaceCommand::default();
        let (mut k, mut start) = (self.at, from);
        loop {
            let end = time.get(k + 1).map_or(to, |next| next.min(to));
            let weight = (end - start) / (to - from);
            let c = &self.segment.command[k];
            sum.elevator_rad += weight * c.elevator_rad;
            sum.aileron_rad += weight * c.aileron_rad;
            sum.rudder_rad += weight * c.rudder_rad;
            if end >= to || k + 1 >= time.len() {
                return sum;
            }
            (k, start) = (k + 1, end);
        }
    }
}

impl Mean {
    /// Whether the state is one that an aircraft can have.
    pub fn is_sane(&self) -> bool {
        let rate = self.body.rate.iter().all(|r| r.abs() < 20.0);
        let speed = self.body.vel_ned.iter().all(|v| v.abs() < 300.0);
        rate && speed && self.gust.iter().all(|g| g.abs() < 60.0)
    }
}

/// The error between two states in the filter's coordinates, `b` minus `a`.
pub fn difference(a: &Mean, b: &Mean) -> [f64; STATES] {
    let [aw, ax, ay, az] = a.body.attitude;
    let [bw, bx, by, bz] = b.body.attitude;
    // Vector part of the quaternion from a to b, body axes of a.
    let turn = [
        aw * bx - ax * bw - ay * bz + az * by,
        aw * by + ax * bz - ay * bw - az * bx,
        aw * bz - ax * by + ay * bx - az * bw,
    ];
    let sign = if aw * bw + ax * bx + ay * by + az * bz < 0.0 {
        -2.0
    } else {
        2.0
    };
    let mut d = [0.0; STATES];
    for k in 0..3 {
        d[k] = b.body.vel_ned[k] - a.body.vel_ned[k];
        d[3 + k] = sign * turn[k];
        d[6 + k] = b.body.rate[k] - a.body.rate[k];
        d[9 + k] = b.gust[k] - a.gust[k];
        d[12 + k] = b.spin[k] - a.spin[k];
        d[15 + k] = b.push[k] - a.push[k];
    }
    for k in 0..2 {
        d[LEAN + k] = b.lean[k] - a.lean[k];
        d[SMOOTHED_LATERAL + k] = b.smoothed[k] - a.smoothed[k];
    }
    d
}

/// The state moved by `d`.
pub fn moved(mean: &Mean, d: &[f64; STATES]) -> Mean {
    let mut m = *mean;
    let [w, x, y, z] = m.body.attitude;
    let [p, q, r] = [0.5 * d[3], 0.5 * d[4], 0.5 * d[5]];
    let turned = [
        w - x * p - y * q - z * r,
        x + w * p + y * r - z * q,
        y + w * q - x * r + z * p,
        z + w * r + x * q - y * p,
    ];
    let norm = turned.iter().map(|c| c * c).sum::<f64>().sqrt();
    m.body.attitude = turned.map(|c| c / norm);
    for k in 0..3 {
        m.body.vel_ned[k] += d[k];
        m.body.rate[k] += d[6 + k];
        m.gust[k] += d[9 + k];
        m.spin[k] += d[12 + k];
        m.push[k] += d[15 + k];
    }
    for k in 0..2 {
        m.lean[k] += d[LEAN + k];
        m.smoothed[k] += d[SMOOTHED_LATERAL + k];
    }
    m
}

/// The state at sample `i`, as well as the sensors tell from there, and how well they do
/// (standard deviations).
pub fn start(segment: &Segment, world: &World, i: usize) -> (Mean, [f64; STATES]) {
    let first = |k: usize| {
        let near = segment.measured.iter().skip(i).take(25);
        near.map(|m| m[k]).find(|v| v.is_finite())
    };
    let angle = |k: usize| first(at::ROLL + k).unwrap_or(0.0);
    let attitude = fdm::quaternion(angle(0), angle(1), angle(2));
    let m = rotation(&attitude);
    let speed = first(at::AIRSPEED).unwrap_or(15.0);
    let alpha = first(at::ALPHA).unwrap_or(0.05);
    let air = [speed * alpha.cos(), 0.0, speed * alpha.sin()];
    let wind = world.wind(i);
    let vel_ned =
        std::array::from_fn(|k| wind[k] + m[k][0] * air[0] + m[k][1] * air[1] + m[k][2] * air[2]);
    let mean = Mean {
        body: Body {
            pos_ned: [0.0; 3],
            vel_ned,
            attitude,
            rate: std::array::from_fn(|k| first(at::ROLL_RATE + k).unwrap_or(0.0)),
        },
        gust: [0.0; 3],
        spin: [0.0; 3],
        push: [0.0; 3],
        lean: [0.0; 2],
        smoothed: [0.0; 2],
    };
    let yaw = if first(at::ROLL + 2).is_some() {
        0.1
    } else {
        3.0
    };
    let mut sd = [0.0; STATES];
    sd[..9].copy_from_slice(&[3.0, 3.0, 2.0, 0.1, 0.1, yaw, 0.2, 0.2, 0.2]);
    (mean, sd)
}
