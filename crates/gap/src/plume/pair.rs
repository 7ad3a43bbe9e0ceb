//! Two sensors on one platform held against each other, before any plume is asked: whether one follows the
//! other, how late and how slowly, and what gain and zero lie between them.
//!
//! The follower's reading is z + g L(t − d), with L what the leader read through a first-order lag. What is left
//! is an Ornstein-Uhlenbeck process; its memory, the lag τ and the delay d are those of the highest likelihood,
//! and z and g follow by generalised least squares (Aitken 1935). Standard deviations are those of the linearised
//! law in all of them. What a noisy leader is to a quiet sensor is its average to both sides of each time, which is no
//! lag: a follower has to be likelier than that. No tolerance is a concentration.

use ::plume::score::correlation;
use ::plume::{Mechanism, MechanismId, lag_step};
use air::geo::{Enu, Geodetic, LocalFrame, Position};
use infer::Policy;
use nalgebra::{DMatrix, DVector};
use scenario::observations::{ObservationRow, Observations};

use super::{Analysis, Setup};
use crate::verdict::{Cause, Evidence, Measured, Pair, Parameter, Verdict};

/// Two sensors are on one platform where their logged places are so near at the same times, m, along the ground
/// and in height: what two position fixes of one aircraft differ by, and less than steps of a mast.
const NEAR_M: f64 = 5.0;
const NEAR_HEIGHT_M: f64 = 3.0;
/// Fewest rows of the follower at which the leader is known, and what part of all its rows they are at least.
const LEAST_ROWS: usize = 60;
const LEAST_PART: f64 = 0.8;
/// A time without readings of the leader longer than this many of its usual steps is not bridged.
const BRIDGED_STEPS: f64 = 5.0;
/// Where the search for lag, delay and memory begins, s.
const LAGS_S: [f64; 9] = [0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0];
const DELAYS_S: [f64; 6] = [0.0, 2.0, 4.0, 8.0, 16.0, 32.0];
const MEMORIES_S: [f64; 6] = [0.1, 1.0, 3.0, 10.0, 30.0, 100.0];
/// Steps of the refinement, of the logarithm of times and, this many seconds of it, of the delay: from the first to
/// the last.
const DELAY_STEP_S: f64 = 8.0;
const FIRST_STEP: f64 = 0.5;
const LAST_STEP: f64 = 0.005;
/// Longest lag that is looked for, s: the catalogue's.
const LONGEST_S: f64 = 600.0;
/// A lag or delay of fewer standard deviations is none.
const SURE_SD: f64 = 2.0;
/// Parameters that a follower has beyond gain and zero: lag, delay, and where the lag begins.
const MORE_PARAMETERS: f64 = 3.0;

/// The pairs of platforms that are one, with what their sensors differ by; of each pair the one that follows
/// is first.
pub(super) fn pairs(observations: &Observations, frame: &LocalFrame) -> Vec<Pair> {
    let series: Vec<Series> = (0..observations.platforms.len())
        .map(|k| Series::of(observations, frame, k))
        .collect();
    let mut found = Vec::new();
    for (k, a) in series.iter().enumerate() {
        for b in &series[k + 1..] {
            let ways = [Way::new(a, b), Way::new(b, a)];
            let fits = ways.iter().flatten().filter_map(Way::best);
            found.extend(fits.max_by(|a, b| a.evidence_nats.total_cmp(&b.evidence_nats)));
        }
    }
    found
}

/// What one sensor read.
struct Series {
    name: String,
    time_s: Vec<f64>,
    ppm: Vec<f64>,
    at: Vec<Position>,
}

fn is_near(a: Position, b: Position) -> bool {
    a.at.distance_m(b.at) <= NEAR_M && (a.height_m - b.height_m).abs() <= NEAR_HEIGHT_M
}

impl Series {
    fn of(observations: &Observations, frame: &LocalFrame, platform: usize) -> Self {
        let mut own: Vec<(&ObservationRow, f64)> = observations
            .rows
            .iter()
            .filter(|r| r.platform == platform)
            .filter_map(|r| Some((r, r.co2_ppm?)))
            .collect();
        own.sort_by(|a, b| a.0.time_s.total_cmp(&b.0.time_s));
        own.dedup_by(|b, a| a.0.time_s == b.0.time_s);
        let place = |row: &ObservationRow| Position {
            at: frame.to_enu(Geodetic {
                lat_deg: row.lat_deg,
                lon_deg: row.lon_deg,
            }),
            height_m: row.alt_amsl_m,
        };
        Self {
            name: observations.platforms[platform].clone(),
            time_s: own.iter().map(|r| r.0.time_s).collect(),
            ppm: own.iter().map(|r| r.1).collect(),
            at: own.iter().map(|r| place(r.0)).collect(),
        }
    }

    /// The row at or before a time and the part of the way to the next, where the time is bridged.
    fn between(&self, time_s: f64, longest_s: f64) -> Option<(usize, f64)> {
        let after = self.time_s.partition_point(|t| *t <= time_s);
        let k = after.checked_sub(1)?;
        if self.time_s[k] == time_s {
            return Some((k, 0.0));
        }
        let step_s = self.time_s.get(after)? - self.time_s[k];
        (step_s <= longest_s).then(|| (k, (time_s - self.time_s[k]) / step_s))
    }

    /// Where it was between two rows.
    fn place(&self, at: (usize, f64)) -> Position {
        let of = |value: fn(&Position) -> f64| {
            let values = [at.0, (at.0 + 1).min(self.at.len() - 1)].map(|k| value(&self.at[k]));
            values[0] + at.1 * (values[1] - values[0])
        };
        Position {
            at: Enu {
                east_m: of(|p| p.at.east_m),
                north_m: of(|p| p.at.north_m),
            },
            height_m: of(|p| p.height_m),
        }
    }

    /// Longest time between two readings that is bridged, s.
    fn bridged_s(&self) -> f64 {
        let mut steps: Vec<f64> = self.time_s.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_by(f64::total_cmp);
        BRIDGED_STEPS * steps.get(steps.len() / 2).copied().unwrap_or(0.0)
    }
}

fn mix(values: &[f64], (k, part): (usize, f64)) -> f64 {
    let next = values.get(k + 1).copied().unwrap_or(values[k]);
    values[k] + part * (next - values[k])
}

/// One sensor as the follower of another on its platform.
struct Way<'a> {
    leader: &'a Series,
    follower: &'a Series,
    /// Rows of the follower that are compared.
    rows: Vec<usize>,
    longest_s: f64,
}

/// What the follower reads of the leader's readings, and the memory of what is left, s.
#[derive(Clone, Copy)]
struct Shape {
    form: Form,
    memory_s: f64,
}

#[derive(Clone, Copy)]
enum Form {
    /// Late by a first-order lag and by a delay, s.
    Late { lag_s: f64, delay_s: f64 },
    /// At once, as averages of so many seconds to both sides.
    Averaged { over_s: f64 },
}

/// A fit for a shape.
struct Fit {
    /// Zero, gain, and what the lag began with beyond the leader's first reading.
    linear: DVector<f64>,
    ln_likelihood: f64,
    sd_ppm: f64,
}

impl<'a> Way<'a> {
    /// None where the two were not on one platform for long enough.
    fn new(leader: &'a Series, follower: &'a Series) -> Option<Self> {
        let longest_s = leader.bridged_s();
        let near = |k: &usize| {
            let at = leader.between(follower.time_s[*k], longest_s);
            at.is_some_and(|at| is_near(leader.place(at), follower.at[*k]))
        };
        let rows: Vec<usize> = (0..follower.time_s.len()).filter(near).collect();
        let enough = rows.len() >= LEAST_ROWS
            && rows.len() as f64 >= LEAST_PART * follower.time_s.len() as f64;
        enough.then_some(Self {
            leader,
            follower,
            rows,
            longest_s,
        })
    }
}

impl Way<'_> {
    /// What the leader read in a form, at its own times.
    fn formed(&self, form: Form) -> Vec<f64> {
        let (time_s, ppm) = (&self.leader.time_s, &self.leader.ppm);
        match form {
            Form::Late { lag_s, .. } => lagged(time_s, ppm, lag_s),
            Form::Averaged { over_s } => {
                let back = |values: &[f64]| values.iter().rev().copied().collect::<Vec<f64>>();
                let once = back(&lagged(time_s, ppm, over_s));
                let times: Vec<f64> = time_s.iter().rev().map(|t| -t).collect();
                back(&lagged(&times, &once, over_s))
            }
        }
    }

    /// Rows of the linear law from `from_s` on.
    fn law(&self, form: Form, from_s: f64) -> Vec<Row> {
        let formed = self.formed(form);
        let first_s = self.leader.time_s[0];
        let (lag_s, delay_s) = match form {
            Form::Late { lag_s, delay_s } => (lag_s, delay_s),
            Form::Averaged { .. } => (0.0, 0.0),
        };
        let row = |k: &usize| {
            let time_s = self.follower.time_s[*k];
            let at = self.leader.between(time_s - delay_s, self.longest_s)?;
            // What a lag began with it forgets.
            let begun = if lag_s > 0.0 {
                (-(time_s - delay_s - first_s) / lag_s).exp()
            } else {
                0.0
            };
            Some(Row {
                time_s,
                read: self.follower.ppm[*k],
                law: [1.0, mix(&formed, at), begun],
            })
        };
        let rows = self
            .rows
            .iter()
            .filter(|k| self.follower.time_s[**k] >= from_s);
        rows.filter_map(row).collect()
    }

    /// The fit of a shape over the rows from `from_s` on, which all shapes that are compared have.
    fn fit(&self, shape: Shape, from_s: f64) -> Option<Fit> {
        let rows = self.law(shape.form, from_s);
        let n = rows.len();
        if n < LEAST_ROWS / 2 {
            return None;
        }
        let (white, ln_det) = whitened(&rows, shape.memory_s);
        let columns = match shape.form {
            Form::Late { lag_s, .. } if lag_s > 0.0 => 3,
            _ => 2,
        };
        let law = DMatrix::from_fn(n, columns, |i, j| white[i].law[j]);
        let read = DVector::from_iterator(n, white.iter().map(|r| r.read));
        let linear = (law.transpose() * &law)
            .cholesky()?
            .solve(&(law.transpose() * &read));
        let variance = (&read - &law * &linear).norm_squared() / n as f64;
        (variance > 0.0).then(|| Fit {
            linear,
            ln_likelihood: -0.5 * (n as f64 * variance.ln() + ln_det),
            sd_ppm: variance.sqrt(),
        })
    }

    /// The likeliest of these forms with any memory, refined.
    fn likeliest(&self, forms: &[Form], from_s: f64) -> Option<(Shape, Fit)> {
        let shapes = forms
            .iter()
            .flat_map(|&form| MEMORIES_S.map(|memory_s| Shape { form, memory_s }));
        let fits = shapes.filter_map(|s| Some((s, self.fit(s, from_s)?)));
        let best = fits.max_by(|a, b| a.1.ln_likelihood.total_cmp(&b.1.ln_likelihood));
        best.map(|(shape, fit)| self.refined(shape, fit, from_s))
    }

    /// The likeliest follower, with its evidence over a sensor that differs by gain, zero and noise alone; none
    /// where it does not follow at all.
    fn best(&self) -> Option<Pair> {
        // A delay takes rows at the beginning; all shapes are compared on the rest.
        let from_s = self.leader.time_s[0] + DELAYS_S[DELAYS_S.len() - 1];
        let at_once = LAGS_S.map(|over_s| Form::Averaged { over_s });
        let (_, plain) = self.likeliest(&at_once, from_s)?;
        // Lag and delay do much the same, and readings between rows are made up: the likelihood has several tops.
        let tops: Vec<(Shape, Fit)> = DELAYS_S
            .into_iter()
            .filter_map(|delay_s| {
                let late = LAGS_S.map(|lag_s| Form::Late { lag_s, delay_s });
                self.likeliest(&late, from_s)
            })
            .collect();
        let likelier =
            |a: &&(Shape, Fit), b: &&(Shape, Fit)| a.1.ln_likelihood.total_cmp(&b.1.ln_likelihood);
        let (best, fit) = tops.iter().max_by(likelier)?;
        let nats = fit.ln_likelihood - plain.ln_likelihood;
        self.pair(*best, fit, nats, from_s, spread(&tops, *best, fit))
    }

    /// The fit where no step to either side is better, by steps that shrink.
    fn refined(&self, mut shape: Shape, mut fit: Fit, from_s: f64) -> (Shape, Fit) {
        let latest_s = (from_s - self.leader.time_s[0]).min(LONGEST_S);
        let mut step = FIRST_STEP;
        while step > LAST_STEP {
            let better = shape.beside(step, latest_s).into_iter().find_map(|next| {
                let found = self.fit(next, from_s)?;
                (found.ln_likelihood > fit.ln_likelihood).then_some((next, found))
            });
            match better {
                Some(found) => (shape, fit) = found,
                None => step *= 0.5,
            }
        }
        (shape, fit)
    }

    fn pair(
        &self,
        shape: Shape,
        fit: &Fit,
        nats: f64,
        from_s: f64,
        spread_s: [f64; 2],
    ) -> Option<Pair> {
        let Form::Late { lag_s, delay_s } = shape.form else {
            return None;
        };
        // What follows another is of its sign.
        let gain = fit.linear[1];
        if gain <= 0.0 {
            return None;
        }
        let sd = self.standard_deviations((lag_s, delay_s), shape.memory_s, fit, from_s)?;
        let rows = self.law(shape.form, from_s);
        let said = rows.iter().map(|r| (r.law[1], r.read));
        let plain = self.law(AT_ONCE, from_s);
        let before = plain.iter().map(|r| (r.law[1], r.read));
        Some(Pair {
            platforms: [self.follower.name.clone(), self.leader.name.clone()],
            rows: rows.len(),
            time_constant_s: measured(lag_s, sd[3].hypot(spread_s[0])),
            delay_s: measured(delay_s, sd[4].hypot(spread_s[1])),
            gain: measured(gain, sd[1]),
            zero_ppm: measured(fit.linear[0], sd[0]),
            correlation_before: correlation(before).unwrap_or(f64::NAN),
            correlation_after: correlation(said).unwrap_or(f64::NAN),
            evidence_nats: nats - 0.5 * MORE_PARAMETERS * (rows.len() as f64).ln(),
        })
    }

    /// Of zero, gain, what the lag began with, lag and delay, by the law linearised in all of them.
    fn standard_deviations(
        &self,
        (lag_s, delay_s): (f64, f64),
        memory_s: f64,
        fit: &Fit,
        from_s: f64,
    ) -> Option<[f64; 5]> {
        let steps = [(0.02 * lag_s).max(0.05), 0.25];
        let at = |more: [f64; 2]| {
            let form = Form::Late {
                lag_s: lag_s + more[0],
                delay_s: (delay_s - more[1]).max(0.0),
            };
            self.law(form, from_s)
        };
        let [here, lag, delay] = [at([0.0, 0.0]), at([steps[0], 0.0]), at([0.0, steps[1]])];
        if lag.len() != here.len() || delay.len() != here.len() {
            return None;
        }
        let law = |r: &Row| -> f64 {
            r.law
                .iter()
                .zip(fit.linear.iter())
                .map(|(l, b)| l * b)
                .sum()
        };
        let slope = |more: &[Row], i: usize, step: f64| (law(&more[i]) - law(&here[i])) / step;
        let of_row = |i: usize| {
            let [one, gain, begun] = here[i].law;
            [
                one,
                gain,
                begun,
                slope(&lag, i, steps[0]),
                slope(&delay, i, steps[1]),
            ]
        };
        let mut slopes = DMatrix::from_fn(here.len(), 5, |i, j| {
            let Some(b) = i.checked_sub(1) else {
                return of_row(i)[j];
            };
            let (by, size) = step_of((here[i].time_s - here[b].time_s) / memory_s);
            (of_row(i)[j] - by * of_row(b)[j]) / size
        });
        let norms: [f64; 5] = std::array::from_fn(|j| slopes.column(j).norm());
        for (j, norm) in norms.iter().enumerate().filter(|n| *n.1 > 0.0) {
            slopes.column_mut(j).scale_mut(1.0 / norm);
        }
        // A pseudo-inverse: what is not there, as the beginning of no lag, has no deviation.
        let inverse = (slopes.transpose() * &slopes).pseudo_inverse(1e-10).ok()?;
        let sd = |j: usize| fit.sd_ppm * inverse[(j, j)].max(0.0).sqrt() / norms[j];
        Some(std::array::from_fn(|j| {
            if norms[j] > 0.0 { sd(j) } else { 0.0 }
        }))
    }
}

/// How far lag and delay of other tops lie from those of the best, s, each top with its likelihood.
fn spread(tops: &[(Shape, Fit)], best: Shape, fit: &Fit) -> [f64; 2] {
    let late = |shape: Shape| match shape.form {
        Form::Late { lag_s, delay_s } => [lag_s, delay_s],
        Form::Averaged { .. } => [0.0; 2],
    };
    let weight = |top: &Fit| (top.ln_likelihood - fit.ln_likelihood).exp();
    let all: f64 = tops.iter().map(|(_, top)| weight(top)).sum();
    std::array::from_fn(|k| {
        let off = |shape: &Shape| late(*shape)[k] - late(best)[k];
        let squares = tops
            .iter()
            .map(|(shape, top)| weight(top) * off(shape).powi(2));
        (squares.sum::<f64>() / all).sqrt()
    })
}

/// A sensor that differs by gain and zero alone.
const AT_ONCE: Form = Form::Averaged { over_s: 0.0 };

impl Shape {
    /// The shapes a step to either side; delays up to `latest_s`.
    fn beside(self, step: f64, latest_s: f64) -> Vec<Self> {
        let memory = [step, -step].map(|s| Self {
            memory_s: self.memory_s * s.exp(),
            ..self
        });
        let form = |form| Self { form, ..self };
        let mut out = memory.to_vec();
        match self.form {
            Form::Averaged { over_s } => {
                let next = [step, -step].map(|s| over_s * s.exp());
                out.extend(next.map(|over_s| form(Form::Averaged { over_s })));
            }
            Form::Late { lag_s, delay_s } => {
                for s in [step, -step] {
                    let lag = (lag_s * s.exp()).min(LONGEST_S);
                    let delay = (delay_s + DELAY_STEP_S * s).clamp(0.0, latest_s);
                    out.push(form(Form::Late {
                        lag_s: lag,
                        delay_s,
                    }));
                    out.push(form(Form::Late {
                        lag_s,
                        delay_s: delay,
                    }));
                }
            }
        }
        out
    }
}

/// Values through a first-order lag that has settled on the first.
fn lagged(time_s: &[f64], values: &[f64], lag_s: f64) -> Vec<f64> {
    let mut out: Vec<f64> = values.first().copied().into_iter().collect();
    for k in 1..values.len() {
        let dt_s = time_s[k] - time_s[k - 1];
        out.push(lag_step(out[k - 1], values[k - 1], values[k], dt_s, lag_s));
    }
    out
}

fn measured(value: f64, sd: f64) -> Measured {
    Measured { value, sd }
}

/// A row of the linear law.
#[derive(Clone, Copy)]
struct Row {
    time_s: f64,
    read: f64,
    law: [f64; 3],
}

/// Rows of which what is left is white, and the logarithm of the determinant of its correlation.
fn whitened(rows: &[Row], memory_s: f64) -> (Vec<Row>, f64) {
    let mut out = Vec::with_capacity(rows.len());
    let mut ln_det = 0.0;
    for (k, row) in rows.iter().enumerate() {
        let Some(before) = k.checked_sub(1).map(|b| rows[b]) else {
            out.push(*row);
            continue;
        };
        let (by, size) = step_of((row.time_s - before.time_s) / memory_s);
        ln_det += 2.0 * size.ln();
        out.push(Row {
            time_s: row.time_s,
            read: (row.read - by * before.read) / size,
            law: std::array::from_fn(|j| (row.law[j] - by * before.law[j]) / size),
        });
    }
    (out, ln_det)
}

/// What an Ornstein-Uhlenbeck process keeps over a step of so many memories, and the size of what is new.
fn step_of(memories: f64) -> (f64, f64) {
    let kept = (-memories).exp();
    (kept, (-(-2.0 * memories).exp_m1()).sqrt())
}

/// What follows of the pairs for a scenario: who is late, by what.
pub(super) struct Late {
    mechanism: Mechanism,
    cause: Cause,
}

/// The lags and delays that are named, each platform's by the leader that it follows best.
pub(super) fn late(pairs: &[Pair], policy: &Policy) -> Vec<Late> {
    let probability = |p: &Pair| 1.0 / (1.0 + (-(p.evidence_nats + policy.ln_name)).exp());
    let best = |p: &&Pair| {
        let own = pairs.iter().filter(|q| q.platforms[0] == p.platforms[0]);
        own.fold(f64::NEG_INFINITY, |best, q| best.max(q.evidence_nats)) <= p.evidence_nats
    };
    let named = pairs
        .iter()
        .filter(best)
        .filter(|p| probability(p) >= policy.named);
    let of = |p: &Pair| {
        let found = [
            (MechanismId::SensorLag, p.time_constant_s),
            (MechanismId::ClockOffset, p.delay_s),
        ];
        let there = found.into_iter().filter(|(_, m)| m.value > SURE_SD * m.sd);
        there
            .map(|(id, m)| Late {
                mechanism: Mechanism::from_values(id, &[m.value]).for_platforms(&p.platforms[..1]),
                cause: cause(id, m, p, probability(p)),
            })
            .collect::<Vec<Late>>()
    };
    named.flat_map(of).collect()
}

fn cause(id: MechanismId, found: Measured, pair: &Pair, probability: f64) -> Cause {
    let parameter = &id.spec().parameters[0];
    Cause {
        mechanisms: vec![id.as_str().to_owned()],
        probability,
        evidence: Evidence {
            delta_log_score: f64::NAN,
            delta_log_evidence: pair.evidence_nats,
            p_value: f64::NAN,
        },
        parameters: vec![Parameter {
            mechanism: id.as_str().to_owned(),
            name: parameter.name.to_owned(),
            value: found.value,
            sd: found.sd,
            unit: parameter.unit.to_owned(),
        }],
        platforms: vec![pair.platforms[0].clone()],
        settings: Vec::new(),
        onset_s: None,
        nats_to_next: f64::NAN,
    }
}

/// The setup in which sensors are as late as they were found.
pub(super) fn with_late(setup: &Setup, late: &[Late]) -> Setup {
    let mut own = setup.clone();
    own.base
        .mechanisms
        .extend(late.iter().map(|l| l.mechanism.clone()));
    own
}

/// Tells of the pairs in an answer that was found with [`with_late`].
pub(super) fn told(analysis: &mut Analysis, pairs: Vec<Pair>, late: Vec<Late>) {
    let json = &mut analysis.json;
    if !late.is_empty() {
        let says: Vec<String> = pairs.iter().map(Pair::says).collect();
        json.summary = format!("{} With that: {}", says.join(" "), json.summary);
        if matches!(json.verdict, Verdict::None | Verdict::Insufficient) {
            json.verdict = Verdict::Named;
        }
    }
    for found in late.into_iter().rev() {
        json.causes.insert(0, found.cause);
        analysis.extension.insert(0, found.mechanism);
    }
    json.pairs = pairs;
}

#[cfg(test)]
#[path = "pair_tests.rs"]
mod tests;
