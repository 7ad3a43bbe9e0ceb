//! The aircraft between two samples, and what its sensors then read: the flight model of the
//! simulator with gusts and disturbances as further states.

use std::sync::Arc;

use fdm::dynamics::{AirState, Body, Controls, Dynamics, Flow, flow, rotation};
use fdm::extended::SensorErrors;
use fdm::servo::{LagStep, Servo};
use fdm::{Aircraft, SurfaceCommand};

use super::channel::{CHANNELS, at};
use super::gate::Segment;
use super::gradient::Gradient;
use super::parameters::{Applied, Parameter, applied};
use super::rival::{Meeting, Nameless};

/// Number of error states: velocity, attitude, rate, gust, disturbing angular acceleration and
/// specific force, three of each; two slow errors of the logged roll and pitch angle; two smoothed
/// gusts; and two that are always nil, so that a row fills whole registers.
pub const STATES: usize = 24;
/// The first of the states beside those of the rigid body, that is of the gusts, NED, m/s.
pub const GUST: usize = 9;
/// The first of the angular accelerations that the model does not have, rad/s².
const SPUN: usize = 12;
/// The first of the specific forces that the model does not have, body axes, m/s².
pub const PUSHED: usize = 15;
/// The first of the slow errors of the logged roll and pitch angle, rad.
pub const LEAN: usize = 18;
/// The lateral gust as smoothed over the aircraft, body axes, m/s.
pub const SMOOTHED_LATERAL: usize = 20;
/// The vertical gust as smoothed.
pub const SMOOTHED_VERTICAL: usize = 21;
/// Correlation times of gusts (horizontal, vertical), s.
const GUST_S: [f64; 3] = [12.0, 12.0, 5.0];
/// Correlation time of the errors of logged angles, s: those of an attitude reference that
/// takes turns for gravity.
const LEAN_S: f64 = 15.0;
/// Correlation time of the disturbances, s.
const DISTURBANCE_S: f64 = 0.4;

/// Correlation time of a state that remembers and is driven, s.
pub fn correlation_s(state: usize) -> f64 {
    match state {
        ..SPUN => GUST_S[state - GUST],
        SPUN..LEAN => DISTURBANCE_S,
        _ => LEAN_S,
    }
}

/// The state between samples.
#[derive(Debug, Clone, Copy)]
pub struct Mean {
    /// Rigid body.
    pub body: Body,
    /// The states beside it, in their order.
    more: [f64; STATES - GUST],
}

impl Mean {
    /// A body in still air.
    pub fn of(body: Body) -> Self {
        Self {
            body,
            more: [0.0; STATES - GUST],
        }
    }

    /// Some of the states beside those of the body, from place `from` on.
    pub fn some<const N: usize>(&self, from: usize) -> [f64; N] {
        std::array::from_fn(|k| self.more[from - GUST + k])
    }

    /// The same without the disturbances that the filter adds to the model.
    pub fn undisturbed(mut self) -> Self {
        self.more[SPUN - GUST..LEAN - GUST].fill(0.0);
        self
    }

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
        body.attitude = normalised(body.attitude);
        halve(&mut middle.more, &next.more);
        middle
    }

    /// The state moved by `d`.
    pub fn moved(&self, d: &[f64; STATES]) -> Self {
        let mut m = *self;
        let [w, x, y, z] = m.body.attitude;
        let [p, q, r] = [0.5 * d[3], 0.5 * d[4], 0.5 * d[5]];
        m.body.attitude = normalised([
            w - x * p - y * q - z * r,
            x + w * p + y * r - z * q,
            y + w * q - x * r + z * p,
            z + w * r + x * q - y * p,
        ]);
        for k in 0..3 {
            m.body.vel_ned[k] += d[k];
            m.body.rate[k] += d[6 + k];
        }
        for (own, d) in m.more.iter_mut().zip(&d[GUST..]) {
            *own += d;
        }
        m
    }

    /// Whether the state is one that an aircraft can have.
    pub fn is_sane(&self) -> bool {
        let rate = self.body.rate.iter().all(|r| r.abs() < 20.0);
        let speed = self.body.vel_ned.iter().all(|v| v.abs() < 300.0);
        rate && speed && self.some::<3>(GUST).iter().all(|g| g.abs() < 60.0)
    }
}

fn normalised(attitude: [f64; 4]) -> [f64; 4] {
    let norm = attitude.iter().map(|c| c * c).sum::<f64>().sqrt();
    attitude.map(|c| c / norm)
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
    /// What is wrong with the sensors.
    pub sensors: SensorErrors,
    /// How gusts turn the aircraft.
    pub gradient: Gradient,
    /// Mean wind sample by sample, NED, m/s.
    wind: Vec<[f64; 3]>,
    /// Surfaces through each interval.
    controls: Arc<Vec<Substeps>>,
    /// Smooth disturbances without a name.
    pub nameless: Option<Nameless>,
    /// What flies from this sample on.
    later: Option<(usize, Arc<Self>)>,
}

impl World {
    /// The flight of `segment` with departures `theta` and smooth disturbances, if there are any. `like` lends its
    /// surfaces where the parameters that move them are the same.
    pub fn new(
        aircraft: &Aircraft,
        parameters: &[Parameter],
        theta: &[f64],
        nameless: Option<Nameless>,
        segment: &Segment,
        like: Option<&Self>,
    ) -> Self {
        let Applied {
            extended,
            wind,
            gust_shares,
        } = applied(aircraft, parameters, theta, segment.log);
        let dynamics = Dynamics::new(&extended.aircraft);
        let bias = extended.wind_bias_ned_m_s;
        let added = [wind[0] + bias[0], wind[1] + bias[1], 0.0];
        let wind = |i: usize| {
            let logged = segment.wind_ned.as_ref().map_or([0.0; 3], |w| w[i]);
            std::array::from_fn(|k| logged[k] + added[k])
        };
        let own = || Arc::new(surfaces(&dynamics, segment));
        Self {
            controls: like.map_or_else(own, |like| like.controls.clone()),
            dynamics,
            sensors: extended.sensors,
            gradient: Gradient {
                share: gust_shares,
                span_m: aircraft.wing.span_m,
            },
            wind: (0..segment.len()).map(wind).collect(),
            nameless,
            later: None,
        }
    }

    /// The same until sample `from`, and `later` from there on.
    pub fn until(mut self, from: usize, later: Self) -> Self {
        self.later = Some((from, Arc::new(later)));
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
        self.at(usize::MAX)
    }

    /// What the aircraft meets at sample `i` in this flow.
    pub fn meets(&self, segment: &Segment, i: usize, flow: &Flow) -> Meeting {
        let controls = self.controls(i, false);
        Meeting {
            along: [segment.time_s[i], flow.airspeed, flow.alpha],
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
        let gust: [f64; 3] = mean.some(GUST);
        let through = std::array::from_fn(|k| mean.body.vel_ned[k] - self.wind[i][k] - gust[k]);
        let (gust, smoothed) = (into(&gust), mean.some::<2>(SMOOTHED_LATERAL));
        let fresh = std::array::from_fn(|k| gust[k + 1] - smoothed[k]);
        let turn = self.gradient.turn(fresh);
        Around {
            air: into(&through),
            gust,
            fresh,
            rate: std::array::from_fn(|k| mean.body.rate[k] + turn[k]),
        }
    }

    /// The flow of this velocity through the air, body axes.
    pub fn flow(air: &[f64; 3]) -> Flow {
        const BODY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        flow(&BODY, air, &[0.0; 3])
    }

    /// The state at sample `i + 1` from that at `i`.
    pub fn step(&self, segment: &Segment, i: usize, mean: &Mean) -> Mean {
        let dt = segment.time_s[i + 1] - segment.time_s[i];
        let gust: [f64; 3] = mean.some(GUST);
        let air = AirState {
            wind_ned: std::array::from_fn(|k| self.wind[i][k] + gust[k]),
            density: segment.density[i],
        };
        let substeps = &self.controls[i];
        let part = dt / substeps.len() as f64;
        let around = self.around(i, mean);
        let felt = |rate: [f64; 3]| {
            let around = Around { rate, ..around };
            self.felt(segment, i, &mean.body.rate, &around, &substeps[0][0])
        };
        let (turned, calm) = (felt(around.rate), felt(mean.body.rate));
        // What a disturbance that fades is in the mean of the interval.
        let through = DISTURBANCE_S * (1.0 - (-dt / DISTURBANCE_S).exp()) / dt;
        // What the air's own turning adds, and disturbances.
        let added = |place: usize, disturbance: [f64; 3]| -> [f64; 3] {
            let of = |k: usize| turned[place + k] - calm[place + k] + through * disturbance[k];
            std::array::from_fn(of)
        };
        let (mut spin, mut push) = (
            added(SPIN, mean.some(SPUN)),
            added(FORCE, mean.some(PUSHED)),
        );
        if let Some(nameless) = &self.nameless {
            let met = self.meets(segment, i, &Self::flow(&around.air));
            nameless.disturb(&met, &mut spin, &mut push);
        }
        let mut next = *mean;
        for controls in substeps {
            // Half before and half after the rigid body's step (Strang 1968): of second order.
            kick(&mut next.body, &spin, &push, 0.5 * part);
            next.body = self.dynamics.rk4(&next.body, controls, &air, part).0;
            kick(&mut next.body, &spin, &push, 0.5 * part);
        }
        for state in GUST..SMOOTHED_LATERAL {
            next.more[state - GUST] *= (-dt / correlation_s(state)).exp();
        }
        let kept = self.gradient.kept(Self::flow(&around.air).airspeed, dt);
        for k in 0..2 {
            next.more[SMOOTHED_LATERAL - GUST + k] = around.gust[k + 1] - around.fresh[k] * kept[k];
        }
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

    /// What the sensors read of what is felt, but for angles, velocity and nameless errors, SI.
    pub fn read(&self, mean: &Mean, felt: &Felt) -> [f64; CHANNELS] {
        let (s, pushed) = (&self.sensors, mean.some::<3>(PUSHED));
        let mut read = [0.0; CHANNELS];
        read[at::AIRSPEED] = felt[0] * s.airspeed_factor;
        read[at::ALPHA] = felt[1] * s.alpha_factor + s.alpha_offset_rad;
        read[at::BETA] = felt[2];
        for k in 0..3 {
            read[at::ROLL_RATE + k] = mean.body.rate[k] + s.gyro_bias_rad_s[k];
            read[at::FORCE + k] = felt[FORCE + k] + pushed[k] + s.accelerometer_bias_m_s2[k];
        }
        read
    }

    /// Parts in which the interval after sample `i` is integrated.
    pub fn parts_of(&self, i: usize) -> usize {
        self.controls[i].len()
    }

    /// Surfaces and motor at sample `i`, or in the middle of the way after it.
    pub fn controls(&self, i: usize, on_the_way: bool) -> Controls {
        let Some(substeps) = self.controls.get(i) else {
            return self.controls[i - 1][self.controls[i - 1].len() - 1][2];
        };
        match (on_the_way, substeps.len()) {
            (false, _) => substeps[0][0],
            (true, count) if count % 2 == 1 => substeps[count / 2][1],
            (true, count) => substeps[count / 2][0],
        }
    }

    /// Moment that the model gives for measured airspeed, angles of flow and rates at sample `i` (equation error), N m.
    pub fn moment(
        &self,
        segment: &Segment,
        i: usize,
        [speed, alpha, beta]: [f64; 3],
        rate: [f64; 3],
    ) -> [f64; 3] {
        let flow = Self::flow(&through_air(speed, alpha, beta));
        let controls = self.controls(i, false);
        let density = segment.density[i];
        self.dynamics.load(&flow, &rate, &controls, density).1
    }
}

/// Velocity through the air, body axes, m/s.
pub fn through_air(speed: f64, alpha: f64, beta: f64) -> [f64; 3] {
    let across = speed * beta.cos();
    [
        across * alpha.cos(),
        speed * beta.sin(),
        across * alpha.sin(),
    ]
}

/// A vector in body axes as one in those of the Earth.
pub fn towards(axes: &[[f64; 3]; 3], v: &[f64; 3]) -> [f64; 3] {
    axes.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Moves `body` by an angular acceleration (rad/s²) and a specific force (body axes, m/s²) for
/// `dt_s`.
fn kick(body: &mut Body, spin: &[f64; 3], push: &[f64; 3], dt_s: f64) {
    let push = towards(&rotation(&body.attitude), push);
    for k in 0..3 {
        body.rate[k] += dt_s * spin[k];
        body.vel_ned[k] += dt_s * push[k];
    }
}

/// What the surfaces do when told what the log tells, after delay and servo.
fn surfaces(dynamics: &Dynamics, segment: &Segment) -> Vec<Substeps> {
    let plan = dynamics.aircraft();
    let told = Told::new(segment, plan.surfaces.delay_s);
    let first = dynamics.servo_angles(&told.mean(segment.time_s[0], segment.time_s[0] + 1e-3));
    let mut servos = first.map(|angle| Servo { angle, rate: 0.0 });
    let mut motor = segment.command[0].throttle;
    let mut lag: Option<(f64, LagStep)> = None;
    let mut now: Option<Controls> = None;
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
            let [middle, end] = [drive(0.0), drive(1.0)];
            substeps.push([now.unwrap_or(middle), middle, end]);
            now = Some(end);
        }
        all.push(substeps);
    }
    all
}

/// Commands as they come to the servos: held between samples, late by a delay.
struct Told<'a> {
    time_s: &'a [f64],
    delay_s: f64,
    /// Elevator, aileron and rudder sample by sample, and their integrals up to it.
    angles: Vec<[[f64; 3]; 2]>,
}

impl<'a> Told<'a> {
    fn new(segment: &'a Segment, delay_s: f64) -> Self {
        let time_s = &segment.time_s[..];
        let mut sum = [0.0; 3];
        let told = |(i, c): (usize, &SurfaceCommand)| {
            let (now, before) = ([c.elevator_rad, c.aileron_rad, c.rudder_rad], sum);
            let held_s = time_s.get(i + 1).map_or(0.0, |next| next - time_s[i]);
            sum = std::array::from_fn(|k| before[k] + held_s * now[k]);
            [now, before]
        };
        Self {
            time_s,
            delay_s,
            angles: segment.command.iter().enumerate().map(told).collect(),
        }
    }

    /// The integral up to a time.
    fn integral(&self, at_s: f64) -> [f64; 3] {
        let i = self
            .time_s
            .partition_point(|t| *t <= at_s)
            .saturating_sub(1);
        let [now, before] = self.angles[i];
        std::array::from_fn(|k| before[k] + (at_s - self.time_s[i]) * now[k])
    }

    /// The mean command from `from` to `to`, s: continuous in the delay, so that it can be fitted.
    fn mean(&self, from: f64, to: f64) -> SurfaceCommand {
        let [before, after] = [from, to].map(|t| self.integral(t - self.delay_s));
        let [elevator_rad, aileron_rad, rudder_rad] =
            std::array::from_fn(|k| (after[k] - before[k]) / (to - from));
        SurfaceCommand {
            elevator_rad,
            aileron_rad,
            rudder_rad,
            ..SurfaceCommand::default()
        }
    }
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
    let [speed, alpha] =
        [(at::AIRSPEED, 15.0), (at::ALPHA, 0.05)].map(|(k, usual)| first(k).unwrap_or(usual));
    let air = towards(&rotation(&attitude), &through_air(speed, alpha, 0.0));
    let mean = Mean::of(Body {
        pos_ned: [0.0; 3],
        vel_ned: std::array::from_fn(|k| world.wind[i][k] + air[k]),
        attitude,
        rate: std::array::from_fn(|k| first(at::ROLL_RATE + k).unwrap_or(0.0)),
    });
    let yaw = first(at::ROLL + 2).map_or(3.0, |_| 0.1);
    let mut sd = [0.0; STATES];
    sd[..GUST].copy_from_slice(&[3.0, 3.0, 2.0, 0.1, 0.1, yaw, 0.2, 0.2, 0.2]);
    (mean, sd)
}
