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

/// Step of differences for derivatives: m/s and rad/s.
const DIFFERENCE: f64 = 1e-5;

/// Number of error states: velocity, attitude, rate, gust, disturbing angular acceleration and
/// specific force, three of each; two slow errors of the logged roll and pitch angle; two smoothed
/// gusts; and two that are always nil, so that a row fills whole registers.
pub const STATES: usize = 24;
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

/// The air around the aircraft at one instant, body axes.
#[derive(Debug, Clone, Copy)]
pub struct Around {
    /// Velocity through the air, m/s.
    pub air: [f64; 3],
    /// Gust, m/s.
    pub gust: [f64; 3],
    /// How much of the lateral and the vertical gust is not yet in the smoothed one, m/s.
    pub fresh: [f64; 2],
    /// Rates relative to the air, rad/s.
    pub rate: [f64; 3],
}

/// What is felt at one instant: airspeed (m/s), angle of attack and sideslip (rad), specific force
/// (m/s²) and angular acceleration (rad/s²), each with a place here.
pub type Felt = [f64; 9];
/// Place of the specific force.
pub const FORCE: usize = 3;
/// Place of the angular acceleration.
pub const SPIN: usize = 6;

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
    controls: std::sync::Arc<Vec<Substeps>>,
    /// Smooth disturbances without a name.
    nameless: Option<Nameless>,
    /// What flies from this sample on.
    later: Option<(usize, std::sync::Arc<Self>)>,
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
        let applied = applied(aircraft, parameters, theta);
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
            || std::sync::Arc::new(surfaces(&dynamics, segment)),
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
            later: None,
        }
    }

    /// The same until sample `from`, and `later` from there on.
    pub fn until(mut self, from: usize, later: Self) -> Self {
        self.later = Some((from, std::sync::Arc::new(later)));
        self
    }

    /// What flies at sample `i`.
    pub fn at(&self, i: usize) -> &Self {
        match &self.later {
            Some((from, later)) if i >= *from => later,
            _ => self,
        }
    }

    /// What flies at the end.
    pub fn last(&self) -> &Self {
        self.later.as_ref().map_or(self, |(_, later)| later)
    }

    /// The same with smooth disturbances, if there are any.
    pub fn with(mut self, nameless: Option<Nameless>) -> Self {
        self.nameless = nameless;
        self
    }

    /// Whether both fly in the same air and feel its gusts alike.
    pub fn shares_air_with(&self, other: &Self) -> bool {
        let alike = |a: &Self, b: &Self| a.gradient == b.gradient && a.wind == b.wind;
        alike(self, other) && alike(self.last(), other.last())
    }

    /// What the aircraft meets at sample `i` in this flow.
    pub fn meets(&self, segment: &Segment, i: usize, flow: &Flow) -> Meeting {
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
    pub fn around(&self, i: usize, mean: &Mean) -> Around {
        let axes = rotation(&mean.body.attitude);
        let into = |v: &[f64; 3]| -> [f64; 3] {
            std::array::from_fn(|k| axes[0][k] * v[0] + axes[1][k] * v[1] + axes[2][k] * v[2])
        };
        let through: [f64; 3] =
            std::array::from_fn(|k| mean.body.vel_ned[k] - self.wind[i][k] - mean.gust[k]);
        let gust = into(&mean.gust);
        let fresh = std::array::from_fn(|k| gust[k + 1] - mean.smoothed[k]);
        let turn = self.gradient.turn(fresh);
        Around {
            air: into(&through),
            gust,
            fresh,
            rate: std::array::from_fn(|k| mean.body.rate[k] + turn[k]),
        }
    }

    /// How gusts turn the aircraft.
    pub fn gradient(&self) -> &Gradient {
        &self.gradient
    }

    /// The flow of this velocity through the air, body axes.
    pub fn flow(air: &[f64; 3]) -> Flow {
        const BODY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        flow(&BODY, air, &[0.0; 3])
    }

    /// What the air's own turning adds: angular acceleration (rad/s²) and specific force (m/s²).
    fn turned(
        &self,
        around: &Around,
        rate: &[f64; 3],
        controls: &Controls,
        density: f64,
    ) -> ([f64; 3], [f64; 3]) {
        let flow = Self::flow(&around.air);
        let load = |rate| self.dynamics.load(&flow, rate, controls, density);
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
        let keep = (-dt / DISTURBANCE_S).exp();
        // What a disturbance that fades is in the mean of the interval.
        let through = DISTURBANCE_S * (1.0 - keep) / dt;
        for k in 0..3 {
            spin[k] += through * mean.spin[k];
            push[k] += through * mean.push[k];
        }
        if let Some(nameless) = &self.nameless {
            let met = self.meets(segment, i, &Self::flow(&around.air));
            nameless.disturb(&met, &mut spin, &mut push);
        }
        for controls in substeps {
            // Half before and half after the rigid body's step (Strang 1968): of second order.
            kick(&mut next.body, &spin, &push, 0.5 * part);
            next.body = self.dynamics.rk4(&next.body, controls, &air, part).0;
            kick(&mut next.body, &spin, &push, 0.5 * part);
        }
        for k in 0..3 {
            next.gust[k] *= (-dt / GUST_S[k]).exp();
            next.spin[k] *= keep;
            next.push[k] *= keep;
        }
        next.lean = mean.lean.map(|l| l * (-dt / LEAN_S).exp());
        let kept = self.gradient.kept(Self::flow(&around.air).airspeed, dt);
        let [_, lateral, vertical] = around.gust;
        next.smoothed = [
            lateral - around.fresh[0] * kept[0],
            vertical - around.fresh[1] * kept[1],
        ];
        next
    }

    /// What the aircraft feels at sample `i`, which turns at `rate`, in the air `around` with
    /// surfaces at `controls`; without disturbances.
    pub fn felt(
        &self,
        segment: &Segment,
        i: usize,
        rate: &[f64; 3],
        around: &Around,
        controls: &Controls,
    ) -> Felt {
        let flow = Self::flow(&around.air);
        let density = segment.density[i];
        let (force, moment) = self.dynamics.load(&flow, &around.rate, controls, density);
        let mut force = force.map(|f| f / self.dynamics.mass_kg());
        let mut spin = self.dynamics.angular_acceleration(rate, &moment);
        if let Some(nameless) = &self.nameless {
            nameless.disturb(&self.meets(segment, i, &flow), &mut spin, &mut force);
        }
        let ([x, y, z], [l, m, n]) = (force, spin);
        [flow.airspeed, flow.alpha, flow.beta, x, y, z, l, m, n]
    }

    /// Derivatives of what is felt by the velocity through the air and by the rates relative to
    /// it; `here` is what is felt.
    pub fn derivatives(
        &self,
        segment: &Segment,
        i: usize,
        rate: &[f64; 3],
        around: &Around,
        controls: &Controls,
        here: &Felt,
    ) -> [Felt; 6] {
        std::array::from_fn(|k| {
            let mut aside = *around;
            if k < 3 {
                aside.air[k] += DIFFERENCE;
            } else {
                aside.rate[k - 3] += DIFFERENCE;
            }
            let there = self.felt(segment, i, rate, &aside, controls);
            std::array::from_fn(|n| (there[n] - here[n]) / DIFFERENCE)
        })
    }

    /// Angular acceleration of a body that turns at `rate` and is left alone, by that rate.
    pub fn gyroscopic(&self, rate: &[f64; 3]) -> [[f64; 3]; 3] {
        let free = |rate: &[f64; 3]| self.dynamics.angular_acceleration(rate, &[0.0; 3]);
        let here = free(rate);
        std::array::from_fn(|k| {
            let mut aside = *rate;
            aside[k] += DIFFERENCE;
            let there = free(&aside);
            std::array::from_fn(|n| (there[n] - here[n]) / DIFFERENCE)
        })
    }

    /// What the sensors read of what is felt: factors on airspeed and angle of attack.
    pub fn factors(&self) -> [f64; 2] {
        [self.sensors.airspeed_factor, self.sensors.alpha_factor]
    }

    /// What the sensors read of `felt`, but for angles, velocity and nameless errors, SI.
    pub fn read(&self, mean: &Mean, felt: &Felt) -> [f64; CHANNELS] {
        let s = &self.sensors;
        let mut read = [0.0; CHANNELS];
        read[at::AIRSPEED] = felt[0] * s.airspeed_factor;
        read[at::ALPHA] = felt[1] * s.alpha_factor + s.alpha_offset_rad;
        read[at::BETA] = felt[2];
        for k in 0..3 {
            read[at::ROLL_RATE + k] = mean.body.rate[k] + s.gyro_bias_rad_s[k];
            read[at::FORCE + k] = felt[FORCE + k] + mean.push[k] + s.accelerometer_bias_m_s2[k];
        }
        read
    }

    /// What the sensors read at sample `i`, SI.
    pub fn sense(&self, segment: &Segment, i: usize, mean: &Mean) -> [f64; CHANNELS] {
        let around = self.around(i, mean);
        let felt = self.felt(segment, i, &mean.body.rate, &around, &self.controls_at(i));
        self.sense_felt(segment, i, mean, &around, &felt)
    }

    /// The same of what is `felt` there.
    pub fn sense_felt(
        &self,
        segment: &Segment,
        i: usize,
        mean: &Mean,
        around: &Around,
        felt: &Felt,
    ) -> [f64; CHANNELS] {
        let mut read = self.read(mean, felt);
        let attitude = euler(&rotation(&mean.body.attitude));
        read[at::ROLL..at::ROLL + 3].copy_from_slice(&attitude);
        read[at::VELOCITY..].copy_from_slice(&mean.body.vel_ned);
        for k in 0..2 {
            read[at::ROLL + k] += mean.lean[k];
        }
        if let Some(nameless) = &self.nameless {
            let met = self.meets(segment, i, &Self::flow(&around.air));
            nameless.misread(&met, &mut read);
        }
        read
    }

    /// Whether the surfaces of both move alike.
    pub fn shares_controls_with(&self, other: &Self) -> bool {
        std::sync::Arc::ptr_eq(&self.controls, &other.controls)
    }

    /// Surfaces and motor at sample `i`, or in the mean of the way after it.
    pub fn controls(&self, i: usize, on_the_way: bool) -> Controls {
        if on_the_way {
            self.controls_through(i)
        } else {
            self.controls_at(i)
        }
    }

    fn controls_through(&self, i: usize) -> Controls {
        let substeps = &self.controls[i];
        let share = 1.0 / substeps.len() as f64;
        let mean = |of: fn(&Controls) -> f64| {
            // Simpson's rule, as in the step.
            let each = substeps
                .iter()
                .map(|[a, b, c]| (of(a) + 4.0 * of(b) + of(c)) / 6.0);
            share * each.sum::<f64>()
        };
        Controls {
            elevator: mean(|c| c.elevator),
            aileron: mean(|c| c.aileron),
            rudder: mean(|c| c.rudder),
            throttle: mean(|c| c.throttle),
        }
    }

    /// Parts in which the interval after sample `i` is integrated.
    pub fn parts_of(&self, i: usize) -> usize {
        self.controls[i].len()
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

/// Moves `body` by an angular acceleration (rad/s²) and a specific force (body axes, m/s²) for
/// `dt_s`.
fn kick(body: &mut Body, spin: &[f64; 3], push: &[f64; 3], dt_s: f64) {
    let m = rotation(&body.attitude);
    for k in 0..3 {
        body.rate[k] += dt_s * spin[k];
        body.vel_ned[k] += dt_s * (m[k][0] * push[0] + m[k][1] * push[1] + m[k][2] * push[2]);
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
    /// Half-way to `next`, a short step later.
    pub fn midway(&self, next: &Self) -> Self {
        let mut middle = *self;
        let halve = |a: &mut [f64], b: &[f64]| {
            for (a, b) in a.iter_mut().zip(b) {
                *a = 0.5 * (*a + b);
            }
        };
        let (body, there) = (&mut middle.body, &next.body);
        halve(&mut body.vel_ned, &there.vel_ned);
        halve(&mut body.rate, &there.rate);
        halve(&mut body.attitude, &there.attitude);
        let norm = body.attitude.iter().map(|c| c * c).sum::<f64>().sqrt();
        body.attitude = body.attitude.map(|c| c / norm);
        halve(&mut middle.gust, &next.gust);
        halve(&mut middle.spin, &next.spin);
        halve(&mut middle.push, &next.push);
        halve(&mut middle.smoothed, &next.smoothed);
        middle
    }

    /// At rest with this attitude, in still air.
    #[cfg(test)]
    pub fn still(attitude: [f64; 4]) -> Self {
        Self {
            body: Body {
                pos_ned: [0.0; 3],
                vel_ned: [0.0; 3],
                attitude,
                rate: [0.0; 3],
            },
            gust: [0.0; 3],
            spin: [0.0; 3],
            push: [0.0; 3],
            lean: [0.0; 2],
            smoothed: [0.0; 2],
        }
    }

    /// Whether the state is one that an aircraft can have.
    pub fn is_sane(&self) -> bool {
        let rate = self.body.rate.iter().all(|r| r.abs() < 20.0);
        let speed = self.body.vel_ned.iter().all(|v| v.abs() < 300.0);
        rate && speed && self.gust.iter().all(|g| g.abs() < 60.0)
    }
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
