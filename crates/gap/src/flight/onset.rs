//! When something set in: mechanisms that begin in flight.
//!
//! From the base every mechanism is tried from the edge of every block of time on, in the linear view:
//! before the onset its columns are nil. From the most promising onsets the search goes on with the filter
//! itself, which flies one aircraft before the onset and another one after it; the onset is where the
//! filter's log score, gone through second by second and then finer, is largest. A beginning in flight has to
//! pay for its onset, which could be any time of the flight: by the part of the flight in which the
//! score says that it is.

use super::evidence::{Candidate, Fit, Model, Word, sum};
use super::noise::Noise;
use super::normal::Block;
use super::study::{Linear, Onset, Study};
use crate::verdict::Measured;
use nalgebra::{DMatrix, DVector};

/// Most blocks of time from which on mechanisms are tried: each costs a small linear problem a mechanism, and the filter
/// moves the onset by more than a block of a flight of 20 minutes ([`REACH_S`]).
const MOST_EDGES: f64 = 240.0;
/// Shortest of them, s: the filter tells what lies within.
const EDGE_S: f64 = 1.0;
/// Time before and after an onset that must have been flown, s: less tells of no before and after.
const LEAST_SIDE_S: f64 = 5.0;
/// Nats that an onset must promise over the best model without one to be looked at with the filter: odds of 20.
const PROMISING_NATS: f64 = 3.0;
/// Most onsets that are looked at, as each costs a search with the filter, and how far apart they are at least, s: nearer ones
/// lie within its reach of each other. What promises less than this part of the best is not looked at: so far the linear view
/// may be off.
const LOOKED_AT: usize = 3;
const APART_S: f64 = 5.0;
const PROMISING_PART: f64 = 0.7;
/// Shortest change that is told from a sudden one, s: speed and height answer a change of force over seconds, which the
/// linear view, whose answer is that of the whole flight, does not have. And nats by which a sudden one must be more probable than
/// any gradual one: about what a mechanism has to pay beforehand, as being sudden is a statement of its own.
const GRADUAL_S: f64 = 20.0;
const SUDDEN_NATS: f64 = 5.0;
/// Times at which a gradual change may begin and end.
const RAMP_ENDS: usize = 12;
/// Rounds of going to the best point and moving the onset.
const ROUNDS: usize = 3;
/// How far to both sides the onset is looked for, s, and steps: coarse, then fine.
const REACH_S: [f64; 2] = [6.0, 1.5];
const STEPS_S: [f64; 2] = [1.0, 0.1];
/// Steps of the noise's fit at each point.
const NOISE_STEPS: usize = 4;

/// An onset and the set of causes that goes with it, as the linear view has them.
struct Promise {
    onset: Onset,
    set: Vec<usize>,
    nats: f64,
}

/// The question with an onset where one makes the data more probable, with the views of the base and from
/// where the search ended; as given where none does.
pub fn look<'a>(study: Study<'a>, first: Linear, last: Linear) -> (Study<'a>, Linear, Linear) {
    let promises = promises(&study, &first);
    let whole = |v: &Linear| v.log_posterior + v.noise.log_prior();
    let mut best: Option<(Study<'a>, Linear)> = None;
    for promise in promises {
        let least = best.as_ref().map_or(whole(&last), |b| whole(&b.1));
        if let Some(found) = descend(&study, &first, &promise)
            && whole(&found.1) > least
        {
            best = Some(found);
        }
    }
    match best {
        Some((with, view)) => {
            let theta = with.extended(&first.theta);
            let first = with.linearise(theta, first.noise);
            (with, first, view)
        }
        None => (study, first, last),
    }
}

/// The most promising onsets, the best first, with gains over the best model without one.
fn promises(study: &Study<'_>, first: &Linear) -> Vec<Promise> {
    let (blocks, _) = study.blocks(&first.theta, &first.noise, edge_s(study));
    let (a, b) = sum(&blocks, None);
    let whole = Word::new(&a, &b, &study.tolerances(), first.word.dispersion);
    let plain = super::evidence::search(&whole, &study.candidates);
    let mut out: Vec<Promise> = infer::parallel_map(&edges(&blocks), |edge| {
        promise(study, &blocks, *edge, first.word.dispersion, &plain)
    })
    .into_iter()
    .flatten()
    .collect();
    out.sort_by(|a, b| b.nats.total_cmp(&a.nats));
    let mut kept: Vec<Promise> = Vec::new();
    for promise in out {
        let near = |k: &Promise| {
            k.onset.log == promise.onset.log && (k.onset.at_s - promise.onset.at_s).abs() < APART_S
        };
        let top = kept.first().map_or(promise.nats, |k: &Promise| k.nats);
        let promising = promise.nats >= PROMISING_PART * top;
        if promising && kept.len() < LOOKED_AT && !kept.iter().any(near) {
            kept.push(promise);
        }
    }
    kept
}

/// How long the blocks of time are from which on mechanisms are tried, s.
fn edge_s(study: &Study<'_>) -> f64 {
    (study.flown_s() / MOST_EDGES).max(EDGE_S)
}

/// Blocks at whose beginning something may set in.
fn edges(blocks: &[Block]) -> Vec<usize> {
    let of_log = |k: usize| blocks.iter().filter(move |b| b.log == blocks[k].log);
    let inside = |k: &usize| {
        let from_s = of_log(*k).map(|b| b.from_s).fold(f64::INFINITY, f64::min);
        let to_s = of_log(*k).map(|b| b.to_s).fold(f64::NEG_INFINITY, f64::max);
        let at_s = blocks[*k].from_s;
        at_s > from_s + LEAST_SIDE_S && at_s < to_s - LEAST_SIDE_S
    };
    (0..blocks.len()).filter(inside).collect()
}

/// What an onset at the beginning of block `edge` promises; none where it is too little.
fn promise(
    study: &Study<'_>,
    blocks: &[Block],
    edge: usize,
    dispersion: f64,
    plain: &[Model],
) -> Option<Promise> {
    let onset = Onset {
        log: blocks[edge].log,
        at_s: blocks[edge].from_s,
    };
    let with = study.with_onset(onset);
    let after = blocks[edge..].iter().filter(|b| b.log == onset.log);
    let (a, b) = augmented(&with, blocks, after);
    let word = Word::new(&a, &b, &with.tolerances(), dispersion);
    let best = with.mapped(&plain[0].set);
    let mut sets = vec![Vec::new(), best.clone()];
    sets.extend((0..best.len()).map(|out| {
        let mut rest = best.clone();
        rest.remove(out);
        rest
    }));
    let charge = super::evidence::charge(&word, &with.candidates);
    let judged = |set: &Vec<usize>| -> f64 {
        let chosen: Vec<&Candidate> = set.iter().map(|&k| &with.candidates[k]).collect();
        let Fit { log_evidence, .. } = word.fit(&chosen);
        let prior: f64 = chosen.iter().map(|c| c.log_prior).sum();
        log_evidence + prior - charge * set.len().saturating_sub(1) as f64
    };
    let tried = with.late().flat_map(|late| {
        sets.iter().map(move |set| {
            let mut set = set.clone();
            set.push(late);
            set
        })
    });
    let (set, value) = tried
        .map(|set| {
            let value = judged(&set);
            (set, value)
        })
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    let nats = value - plain[0].log_posterior;
    (nats > PROMISING_NATS).then_some(Promise { onset, set, nats })
}

/// Whether the late candidate `late` of the best set began at once: as a change that takes some time the data
/// are less probable.
fn is_sudden(with: &Study<'_>, now: &Linear, late: usize) -> bool {
    let Some(onset) = with.onset else {
        return false;
    };
    let block_s = edge_s(with);
    let (blocks, _) = with.blocks(&now.theta, &now.noise, block_s);
    let rest: Vec<usize> = now.models[0]
        .set
        .iter()
        .copied()
        .filter(|k| *k != late)
        .collect();
    let value = |grown: &dyn Fn(f64) -> f64| {
        let weights: Vec<f64> = blocks
            .iter()
            .map(|b| {
                if b.log == onset.log {
                    grown(0.5 * (b.from_s + b.to_s))
                } else {
                    0.0
                }
            })
            .collect();
        grown_evidence(with, &blocks, &weights, late, &rest, now.word.dispersion)
    };
    let half_s = 0.5 * block_s;
    let sudden = value(&|t| ((t - onset.at_s) / block_s + 0.5).clamp(0.0, 1.0));
    let [from_s, to_s] = with.onsets_s(onset.log, half_s);
    let end = |k: usize| from_s + (to_s - from_s) * k as f64 / (RAMP_ENDS - 1) as f64;
    let pairs = (0..RAMP_ENDS).flat_map(|i| (i + 1..RAMP_ENDS).map(move |j| (i, j)));
    let ramps: Vec<(f64, f64)> = pairs
        .map(|(i, j)| (end(i), end(j)))
        .filter(|(a, b)| b - a >= GRADUAL_S)
        .collect();
    let gradual = infer::parallel_map(&ramps, |(a, b)| {
        value(&|t| ((t - a) / (b - a)).clamp(0.0, 1.0))
    });
    gradual.into_iter().all(|g| sudden - g >= SUDDEN_NATS)
}

/// Log evidence of the set `rest` with the mechanism of the candidate `late`, which has grown to the part
/// `weights` of its size in each block.
fn grown_evidence(
    with: &Study<'_>,
    blocks: &[Block],
    weights: &[f64],
    late: usize,
    rest: &[usize],
    dispersion: f64,
) -> f64 {
    let candidate = &with.candidates[late];
    let n = with.width();
    let places: Vec<usize> = candidate
        .columns
        .iter()
        .filter_map(|&j| with.parameters[j].effect.later_than())
        .collect();
    let p = places.len();
    let (mut a, mut b) = (DMatrix::zeros(n + p, n + p), DVector::zeros(n + p));
    for (block, w) in blocks.iter().zip(weights) {
        let mut part = a.view_mut((0, 0), (n, n));
        part += &block.a;
        let mut head = b.rows_mut(0, n);
        head += &block.b;
        for (i, &own) in places.iter().enumerate() {
            for j in 0..n {
                a[(n + i, j)] += w * block.a[(own, j)];
                a[(j, n + i)] += w * block.a[(j, own)];
            }
            for (j, &other) in places.iter().enumerate() {
                a[(n + i, n + j)] += w * w * block.a[(own, other)];
            }
            b[n + i] += w * block.b[own];
        }
    }
    let word = Word::new(&a, &b, &with.tolerances(), dispersion);
    let grown = Candidate {
        columns: (n..n + p).collect(),
        ..candidate.clone()
    };
    let chosen: Vec<&Candidate> = rest
        .iter()
        .map(|&k| &with.candidates[k])
        .chain([&grown])
        .collect();
    word.fit(&chosen).log_evidence
}

/// The normal equations with the columns of what sets in: those of the same parameters, but of the blocks
/// `after` alone.
fn augmented<'b>(
    with: &Study<'_>,
    blocks: &[Block],
    after: impl Iterator<Item = &'b Block>,
) -> (DMatrix<f64>, DVector<f64>) {
    let (a, b) = sum(blocks, None);
    let (mut late_a, mut late_b) = (DMatrix::zeros(b.len(), b.len()), DVector::zeros(b.len()));
    for block in after {
        late_a += &block.a;
        late_b += &block.b;
    }
    // Place of each column among the old ones, and whether it counts late.
    let late = with.parameters.iter().filter_map(|p| p.effect.later_than());
    let known = with.parameters.len() - late.clone().count();
    let columns: Vec<(usize, bool)> = (0..known)
        .map(|j| (j, false))
        .chain(late.map(|j| (j, true)))
        .chain((known..b.len()).map(|j| (j, false)))
        .collect();
    let n = columns.len();
    let matrix = DMatrix::from_fn(n, n, |i, j| {
        let ((p, p_late), (q, q_late)) = (columns[i], columns[j]);
        if p_late || q_late {
            late_a[(p, q)]
        } else {
            a[(p, q)]
        }
    });
    let vector = DVector::from_fn(n, |i, _| {
        let (p, late) = columns[i];
        if late { late_b[p] } else { b[p] }
    });
    (matrix, vector)
}

/// Goes with the filter where an onset leads, moving the onset on the way; none where nothing that sets in is
/// left at the end.
fn descend<'a>(
    study: &Study<'a>,
    first: &Linear,
    promise: &Promise,
) -> Option<(Study<'a>, Linear)> {
    let mut with = study.with_onset(promise.onset);
    let mut now = with.linearise(with.extended(&first.theta), first.noise.clone());
    let mut set = promise.set.clone();
    for _ in 0..ROUNDS {
        let theta = with.step_towards(&now, &set);
        let noise = with.noise(&theta, now.noise.clone(), NOISE_STEPS);
        let moved = moved(&with, &theta, &noise, now.word.dispersion);
        let shift_s = (moved.onset.at_s - with.onset?.at_s).abs();
        with = study.with_onset(moved.onset);
        with.pay(moved.at_s, moved.log_price);
        let next = with.linearise(theta, noise);
        if !next.log_score.is_finite() {
            return None;
        }
        let gained =
            next.log_posterior + next.noise.log_prior() - now.log_posterior - now.noise.log_prior();
        now = next;
        let models = now.models.iter();
        let best = models.into_iter().find(|m| with.has_late(&m.set))?;
        let stays = best.set == set;
        set.clone_from(&best.set);
        if stays && shift_s < 2.0 * STEPS_S[1] && gained < 1.0 {
            break;
        }
    }
    now = with.quieter(with.refitted(now));
    let set = &now.models[0].set;
    let late: Vec<usize> = set
        .iter()
        .copied()
        .filter(|k| with.late().contains(k))
        .collect();
    if !late.is_empty() && late.iter().all(|k| is_sudden(&with, &now, *k)) {
        Some((with, now))
    } else {
        None
    }
}

/// Where an onset went.
struct Moved {
    onset: Onset,
    at_s: Measured,
    log_price: f64,
}

/// The onset at which the filter's log score is largest, what it may be off by, and the logarithm of the part
/// of the flight in which the score has it.
fn moved(with: &Study<'_>, theta: &[f64], noise: &Noise, dispersion: f64) -> Moved {
    let mut onset = with.onset.unwrap_or(Onset { log: 0, at_s: 0.0 });
    let range = with.onsets_s(onset.log, LEAST_SIDE_S);
    // Time, log score and the time that it stands for.
    let mut scored: Vec<[f64; 3]> = Vec::new();
    for (reach_s, step_s) in REACH_S.into_iter().zip(STEPS_S) {
        let count = (reach_s / step_s).round() as i32;
        let mut times: Vec<f64> = (-count..=count)
            .map(|k| onset.at_s + f64::from(k) * step_s)
            .filter(|t| (range[0]..=range[1]).contains(t))
            .collect();
        if times.is_empty() {
            times.push(onset.at_s.clamp(range[0], range[1]));
        }
        let scores = infer::parallel_map(&times, |at_s| {
            let there = Onset {
                at_s: *at_s,
                ..onset
            };
            with.with_onset(there).log_score(theta, noise) / dispersion
        });
        let (from_s, to_s) = (times[0], times[times.len() - 1]);
        scored.retain(|s| s[0] < from_s - 0.5 * s[2] || s[0] > to_s + 0.5 * s[2]);
        scored.extend(times.into_iter().zip(scores).map(|(t, s)| [t, s, step_s]));
        let best = scored.iter().max_by(|a, b| a[1].total_cmp(&b[1]));
        onset.at_s = best.map_or(onset.at_s, |b| b[0]);
    }
    let top = scored
        .iter()
        .map(|s| s[1])
        .fold(f64::NEG_INFINITY, f64::max);
    let weight = |s: &[f64; 3]| (s[1] - top).exp() * s[2];
    let total: f64 = scored.iter().map(weight).sum();
    let mean =
        |of: &dyn Fn(f64) -> f64| scored.iter().map(|s| weight(s) * of(s[0])).sum::<f64>() / total;
    let value = mean(&|t| t);
    let spread = mean(&|t| (t - value).powi(2)).sqrt();
    Moved {
        onset,
        at_s: Measured {
            value,
            // Between two steps any time is as good.
            sd: spread.hypot(STEPS_S[1] / 12.0_f64.sqrt()),
        },
        log_price: (total / with.flown_s()).min(1.0).ln(),
    }
}
