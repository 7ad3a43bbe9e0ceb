//! The filter-error method (Maine & Iliff 1985; Jategaonkar 2015, ch. 5): an extended Kalman
//! filter follows the flight with the measured commands as input; its innovations have the
//! likelihood of the parameters, and their derivatives with fixed gains the information.
//!
//! With the gains held, the derivative of an innovation is a function of the past alone, so the
//! score of a true parameter has mean zero; angles and speeds enter as predicted, never as
//! measured, so noise in them does not bias a slope.

use air::geo::wrap_signed_rad;
use fdm::dynamics::{Controls, euler, rotation};

use super::channel::{CHANNELS, at};
use super::gate::Segment;
use super::gradient::SLOWEST_M_S;
use super::motion::{
    Around, FORCE, Felt, GUST, LEAN, Mean, PUSHED, SMOOTHED_LATERAL, SPIN, STATES, World,
    correlation_s, start, towards,
};
use super::noise::Noise;
use super::normal::Normal;
use super::rival::{Meeting, Terms};
use super::sensitivity::Sensitivity;
use super::transition::{Error, Matrix, Transition, propagate, take_off, times};

/// Innovation, in standard deviations, beyond which it counts linearly (Huber 1964).
const HUBER: f64 = 3.0;
/// Step of differences for derivatives: m/s and rad/s.
const DIFFERENCE: f64 = 1e-5;
/// Least cosine of the pitch angle that roll and yaw are told by.
const LEAST_LEVEL: f64 = 1e-3;

/// What of a pass is kept besides its sums.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Keep {
    /// Nothing.
    Nothing,
    /// Innovations and states.
    States,
    /// What a derivative by the sizes of the noise is made from.
    Steps,
}

/// What a pass without derivatives leaves.
#[derive(Default)]
pub struct Pass {
    /// Log likelihood, nats.
    pub log_score: f64,
    /// Innovations in standard deviations, sample by sample.
    pub standardised: Vec<[f64; CHANNELS]>,
    /// States after each sample's update.
    pub means: Vec<Mean>,
    /// What the filter did, sample by sample.
    pub steps: Vec<Step>,
}

/// A world in which one parameter is a step aside.
pub struct Aside {
    /// The parameter's column.
    pub column: usize,
    /// The world.
    pub world: World,
    /// The step.
    pub step: f64,
}

/// Columns whose derivatives a pass takes.
pub struct Columns<'a> {
    /// Number of columns.
    pub count: usize,
    /// Worlds of the parameters.
    pub worlds: Vec<Aside>,
    /// Nameless terms.
    pub terms: &'a Terms,
    /// Column of the first of them.
    pub first_term: usize,
}

/// The filter at one sample.
struct Filter<'a> {
    segment: &'a Segment,
    world: &'a World,
    noise: &'a Noise,
    mean: Mean,
    p: Matrix,
}

/// One reading as the filter took it.
pub struct Taken {
    /// Which channel.
    pub channel: usize,
    /// Its derivatives by the error states that it tells of, each with its place.
    pub told: Vec<(usize, f64)>,
    /// What a departure moves the state by, before it is divided by `used`.
    pub gain: Error,
    /// Variance that the gain is divided by.
    pub used: f64,
    /// What an innovation is multiplied by to count in standard deviations, Huber's weight in it.
    pub scale: f64,
    /// Innovation.
    pub away: f64,
    /// Variance of the sensor's noise, larger for an outlier.
    pub noise: f64,
    /// Innovation in standard deviations.
    nu: f64,
    log_score: f64,
}

/// What the filter did with one sample and on the way to the next.
pub struct Step {
    /// The readings, in their order.
    pub taken: Vec<Taken>,
    /// What errors are after the way; nil where the filter began anew.
    pub keep: Matrix,
    /// Variances that the way added.
    pub process: Error,
}

/// Runs the filter over `segment`; adds what the innovations say of `columns` to normal equations.
pub fn run(
    segment: &Segment,
    world: &World,
    noise: &Noise,
    keep: Keep,
    columns: Option<(&Columns<'_>, &mut Normal)>,
) -> Pass {
    let (mean, sd) = start(segment, world.at(0), 0);
    let mut filter = Filter {
        segment,
        world,
        noise,
        mean,
        p: uncertain(&sd, noise),
    };
    let mut out = Pass::default();
    let mut columns = columns.map(|(columns, normal)| (Sensitivity::new(columns), normal));
    for i in 0..segment.len() {
        let seen = Seen::of(segment, world, i, filter.mean, false);
        let taken = filter.update(&seen);
        if let Some((sensitivity, normal)) = columns.as_mut() {
            normal.begin_sample(segment.log, segment.time_s[i]);
            sensitivity.look(&seen);
            sensitivity.take(&taken, |row, t| normal.add_row(row, t.away * t.scale));
        }
        out.log_score += taken.iter().map(|t| t.log_score).sum::<f64>();
        if keep == Keep::States {
            let mut standardised = [f64::NAN; CHANNELS];
            for t in &taken {
                standardised[t.channel] = t.nu;
            }
            out.standardised.push(standardised);
            out.means.push(filter.mean);
        }
        let (after, process) = if i + 1 < segment.len() {
            filter.predict(i, columns.as_mut().map(|of| &mut of.0))
        } else {
            NOTHING_LEFT
        };
        if keep == Keep::Steps {
            out.steps.push(Step {
                taken,
                keep: after,
                process,
            });
        }
    }
    out
}

/// What is left of errors where the filter begins anew, and what the way adds.
const NOTHING_LEFT: (Matrix, Error) = ([[0.0; STATES]; STATES], [0.0; STATES]);

/// Covariance of a state that the sensors have just told.
fn uncertain(sd: &Error, noise: &Noise) -> Matrix {
    let mut p = NOTHING_LEFT.0;
    for k in 0..STATES {
        let sd = if k < GUST { sd[k] } else { noise.stationary(k) };
        p[k][k] = sd * sd;
    }
    p
}

/// Huber's loss of a standardised innovation, and the weight it leaves.
pub fn huber(nu: f64) -> (f64, f64) {
    let size = nu.abs();
    if size <= HUBER {
        (nu * nu, 1.0)
    } else {
        (2.0 * HUBER * size - HUBER * HUBER, HUBER / size)
    }
}

impl Filter<'_> {
    /// Takes the readings of a sample.
    fn update(&mut self, seen: &Seen<'_>) -> Vec<Taken> {
        let (expected, h) = (seen.expected(), seen.observation());
        let mut d = [0.0; STATES];
        let mut all = Vec::with_capacity(CHANNELS);
        for c in 0..CHANNELS {
            let away = self.segment.measured[seen.i][c] - expected[c];
            if !away.is_nan() {
                let away = if is_angle(c) {
                    wrap_signed_rad(away)
                } else {
                    away
                };
                all.push(self.take(c, &h[c], away, &mut d));
            }
        }
        self.mean = self.mean.moved(&d);
        all
    }

    /// Takes the reading of channel `c`, whose derivatives are `h` and whose departure from what
    /// was expected before this sample is `away`: moves `d` and the covariance.
    fn take(&mut self, c: usize, h: &Error, away: f64, d: &mut Error) -> Taken {
        let e = away - dot(h, d);
        let gain = times(&self.p, h);
        let r = self.noise.sensor(c).powi(2);
        let known = dot(h, &gain).max(0.0);
        let variance = known + r;
        let nu = e / variance.sqrt();
        let (loss, weight) = huber(nu);
        // An outlier counts as one with a larger noise.
        let noise = r / (weight * weight);
        let used = known + noise;
        for k in 0..STATES {
            d[k] += gain[k] * e / used;
        }
        take_off(&mut self.p, &gain, used);
        let mut told = Vec::with_capacity(STATES);
        told.extend((0..STATES).map(|k| (k, h[k])).filter(|of| of.1 != 0.0));
        Taken {
            channel: c,
            told,
            gain,
            used,
            away: e,
            noise,
            scale: (weight / variance).sqrt(),
            nu,
            log_score: -0.5 * (loss + (std::f64::consts::TAU * variance).ln()),
        }
    }

    /// Goes on to the next sample: what errors are then, and variances that the way adds.
    fn predict(
        &mut self,
        i: usize,
        sensitivity: Option<&mut Sensitivity<'_, '_>>,
    ) -> (Matrix, Error) {
        let dt = self.segment.time_s[i + 1] - self.segment.time_s[i];
        let next = self.world.at(i).step(self.segment, i, &self.mean);
        // Derivatives in the middle of the step hold to its second order.
        let between = self.mean.midway(&next);
        let middle = Seen::of(self.segment, self.world, i, between, true);
        let parts = self.world.at(i).parts_of(i);
        let step = Transition::of(&middle.slopes(), dt, parts);
        if let Some(s) = sensitivity {
            s.predict(&middle, &step);
        }
        let process = std::array::from_fn(|k| self.noise.process(k, dt));
        propagate(&mut self.p, &step.keep, &process);
        self.mean = next;
        let finite = self.p.iter().flatten().all(|v| v.is_finite());
        if !(self.mean.is_sane() && finite) {
            // The model has lost the flight: it begins anew from what the sensors tell.
            let (mean, sd) = start(self.segment, self.world.at(i + 1), i + 1);
            self.mean = mean;
            self.p = uncertain(&sd, self.noise);
            return NOTHING_LEFT;
        }
        (step.keep, process)
    }
}

/// A sample as seen from a state.
pub struct Seen<'a> {
    /// The flight.
    pub segment: &'a Segment,
    /// Its world.
    pub world: &'a World,
    /// Which sample.
    pub i: usize,
    /// Whether it is the way after it.
    on_the_way: bool,
    /// The state.
    pub mean: Mean,
    /// Surfaces and motor.
    pub controls: Controls,
    /// The air there.
    pub around: Around,
    /// What is felt there.
    pub felt: Felt,
}

impl<'a> Seen<'a> {
    /// `mean` at sample `i`, or in the mean of the way after it.
    pub fn of(
        segment: &'a Segment,
        world: &'a World,
        i: usize,
        mean: Mean,
        on_the_way: bool,
    ) -> Self {
        let world = world.at(i);
        let controls = world.controls(i, on_the_way);
        let around = world.around(i, &mean);
        Seen {
            segment,
            world,
            i,
            on_the_way,
            mean,
            controls,
            around,
            felt: world.felt(segment, i, &mean.body.rate, &around, &controls),
        }
    }

    /// What nameless terms are made from.
    pub fn meets(&self) -> Meeting {
        let flow = World::flow(&self.around.air);
        self.world.meets(self.segment, self.i, &flow)
    }

    /// The same in another world.
    pub fn within(&self, world: &'a World) -> Self {
        Self::of(self.segment, world, self.i, self.mean, self.on_the_way)
    }

    /// What the sensors read, SI.
    pub fn expected(&self) -> [f64; CHANNELS] {
        let mut read = self.world.read(&self.mean, &self.felt);
        let body = &self.mean.body;
        read[at::ROLL..at::ROLL + 3].copy_from_slice(&euler(&rotation(&body.attitude)));
        read[at::VELOCITY..].copy_from_slice(&body.vel_ned);
        for (read, lean) in read[at::ROLL..].iter_mut().zip(self.mean.some::<2>(LEAN)) {
            *read += lean;
        }
        if let Some(nameless) = &self.world.nameless {
            nameless.misread(&self.meets(), &mut read);
        }
        read
    }

    /// Derivatives of what is felt by velocity through the air, rates relative to it and own rates.
    fn derivatives(&self) -> [Felt; 9] {
        std::array::from_fn(|k| {
            let (mut around, mut rate) = (self.around, self.mean.body.rate);
            match k {
                0..3 => around.air[k] += DIFFERENCE,
                3..6 => around.rate[k - 3] += DIFFERENCE,
                _ => rate[k - 6] += DIFFERENCE,
            }
            let there = self
                .world
                .felt(self.segment, self.i, &rate, &around, &self.controls);
            std::array::from_fn(|n| (there[n] - self.felt[n]) / DIFFERENCE)
        })
    }

    /// Derivatives by the error states of what is felt, and of the fresh part of the gusts.
    fn by_states(&self) -> ([Felt; STATES], [[f64; 2]; STATES]) {
        let (by, around) = (self.derivatives(), &self.around);
        let axes = rotation(&self.mean.body.attitude);
        let mut felt = [[0.0; 9]; STATES];
        let mut fresh = [[0.0; 2]; STATES];
        for state in (0..12).chain(SMOOTHED_LATERAL..SMOOTHED_LATERAL + 2) {
            let k = state % 3;
            let (mut air, mut gust, mut own) = ([0.0; 3], [0.0; 3], [0.0; 3]);
            let mut smoothed = [0.0; 2];
            match state {
                0..3 => air = axes[k],
                3..6 => (air, gust) = (turned(&around.air, k), turned(&around.gust, k)),
                6..9 => own[k] = 1.0,
                9..12 => (air, gust) = (axes[k].map(|v| -v), axes[k]),
                _ => smoothed[state - SMOOTHED_LATERAL] = 1.0,
            }
            fresh[state] = [gust[1] - smoothed[0], gust[2] - smoothed[1]];
            let turn = self.world.gradient.turn(fresh[state]);
            for k in 0..3 {
                for n in 0..9 {
                    felt[state][n] += by[k][n] * air[k]
                        + by[3 + k][n] * (own[k] + turn[k])
                        + by[6 + k][n] * own[k];
                }
            }
        }
        (felt, fresh)
    }

    /// Derivatives of the readings by the error states, row by row.
    fn observation(&self) -> [Error; CHANNELS] {
        let (felt, _) = self.by_states();
        let sensors = &self.world.sensors;
        let mut h = [[0.0; STATES]; CHANNELS];
        for (state, felt) in felt.iter().enumerate() {
            h[at::AIRSPEED][state] = sensors.airspeed_factor * felt[0];
            h[at::ALPHA][state] = sensors.alpha_factor * felt[1];
            h[at::BETA][state] = felt[2];
            for k in 0..3 {
                h[at::FORCE + k][state] = felt[FORCE + k];
            }
        }
        let of_angles = of_angles(&rotation(&self.mean.body.attitude));
        for k in 0..3 {
            h[at::ROLL + k][3..6].copy_from_slice(&of_angles[k]);
            h[at::ROLL_RATE + k][6 + k] = 1.0;
            h[at::VELOCITY + k][k] = 1.0;
            // Disturbing angular acceleration is felt later only, disturbing force at once.
            h[at::FORCE + k][PUSHED + k] = 1.0;
        }
        for k in 0..2 {
            h[at::ROLL + k][LEAN + k] = 1.0;
        }
        h
    }

    /// Slopes of the error states in time by the error states, column by column.
    fn slopes(&self) -> Matrix {
        let (felt, fresh) = self.by_states();
        let axes = rotation(&self.mean.body.attitude);
        let towards = |f: &[f64; 3]| towards(&axes, f);
        let ways_m = self.world.gradient.ways_m();
        let airspeed = self.felt[0].max(SLOWEST_M_S);
        let mut a = [[0.0; STATES]; STATES];
        for state in 0..STATES {
            let felt = &felt[state];
            a[state][..3].copy_from_slice(&towards(&std::array::from_fn(|k| felt[FORCE + k])));
            a[state][6..9].copy_from_slice(&felt[SPIN..]);
            for k in 0..2 {
                let change = fresh[state][k] * airspeed + self.around.fresh[k] * felt[0];
                a[state][SMOOTHED_LATERAL + k] = change / ways_m[k];
            }
        }
        let pushed = self.mean.some::<3>(PUSHED);
        let force = std::array::from_fn(|k| self.felt[FORCE + k] + pushed[k]);
        for k in 0..3 {
            // An error of attitude, in body axes, turns the force and is carried round by the rates.
            let aside = towards(&turned(&force, k).map(|f| -f));
            for r in 0..3 {
                a[3 + k][r] += aside[r];
                a[15 + k][r] = axes[r][k];
            }
            a[3 + k][3..6].copy_from_slice(&turned(&self.mean.body.rate, k).map(|r| -r));
            a[6 + k][3 + k] = 1.0;
            a[12 + k][6 + k] = 1.0;
        }
        for state in GUST..SMOOTHED_LATERAL {
            a[state][state] = -1.0 / correlation_s(state);
        }
        a
    }
}

/// What a turn about the body's axis `k` makes of a vector fixed in space, in body axes and for
/// small angles: the vector crossed by the axis.
fn turned(v: &[f64; 3], k: usize) -> [f64; 3] {
    match k {
        0 => [0.0, v[2], -v[1]],
        1 => [-v[2], 0.0, v[0]],
        _ => [v[1], -v[0], 0.0],
    }
}

/// Derivatives of roll, pitch and yaw by small turns about the body's axes.
fn of_angles(axes: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let sin_pitch = -axes[2][0];
    let level = axes[2][1].hypot(axes[2][2]).max(LEAST_LEVEL);
    let (sin_roll, cos_roll) = (axes[2][1] / level, axes[2][2] / level);
    let steep = sin_pitch / level;
    [
        [1.0, steep * sin_roll, steep * cos_roll],
        [0.0, cos_roll, -sin_roll],
        [0.0, sin_roll / level, cos_roll / level],
    ]
}

fn is_angle(channel: usize) -> bool {
    (at::ROLL..at::ROLL_RATE).contains(&channel)
}

fn dot(a: &Error, b: &Error) -> f64 {
    let mut sum = [0.0; 2];
    for k in 0..STATES / 2 {
        sum[0] += a[2 * k] * b[2 * k];
        sum[1] += a[2 * k + 1] * b[2 * k + 1];
    }
    sum[0] + sum[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against small turns of the quaternion itself.
    #[test]
    fn derivatives_of_angles_are_those_of_small_turns() {
        let angles =
            |mean: &Mean| fdm::dynamics::euler(&fdm::dynamics::rotation(&mean.body.attitude));
        for (roll, pitch, yaw) in [(0.1, 0.2, -0.5), (-1.0, 0.9, 2.0), (2.5, -0.7, 0.0)] {
            let mean = Mean::of(fdm::dynamics::Body {
                pos_ned: [0.0; 3],
                vel_ned: [0.0; 3],
                attitude: fdm::quaternion(roll, pitch, yaw),
                rate: [0.0; 3],
            });
            let axes = fdm::dynamics::rotation(&mean.body.attitude);
            let told = of_angles(&axes);
            for k in 0..3 {
                let mut d = [0.0; STATES];
                d[3 + k] = 1e-6;
                let (there, here) = (angles(&mean.moved(&d)), angles(&mean));
                for c in 0..3 {
                    let seen = (there[c] - here[c]) / 1e-6;
                    assert!((told[c][k] - seen).abs() < 1e-4, "{c} {k}: {told:?} {seen}");
                }
            }
        }
    }
}
