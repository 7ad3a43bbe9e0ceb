//! When something set in: mechanisms that begin in flight.
//!
//! From the base every mechanism is tried from the edge of every block of time on, in the linear view:
//! before the onset its columns are nil. From the most promising onsets the search goes on with the filter
//! itself, which flies one aircraft before the onset and another one after it; the onset is where the
//! filter's log score, gone through second by second and then finer, is largest. A beginning in flight has to
//! pay for its onset, which could be any time of the flight: by the part of the flight in which the
//! score says that it is.

use super::evidence::{Model, Word, sum};
use super::noise::Noise;
use super::normal::Block;
use super::study::{Linear, Onset, STEP, Study};
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
    let mut best: Option<(Study<'a>, Linear)> = None;
    for promise in promises(&study, &first) {
        let least = best.as_ref().map_or(&last, |b| &b.1).with_noise_prior();
        let found = descend(&study, &first, &promise);
        best = found.filter(|f| f.1.with_noise_prior() > least).or(best);
    }
    match best {
        Some((with, view)) => {
            let first = with.linearise(extended(&with, &first.theta), first.noise);
            (with, first, view)
        }
        None => (study, first, last),
    }
}

/// Departures of the question without an onset where nothing sets in.
fn extended(with: &Study<'_>, theta: &[f64]) -> Vec<f64> {
    let mut out = theta.to_vec();
    out.resize(with.width(), 0.0);
    out
}

/// The most promising onsets, the best first, with gains over the best model without one.
fn promises(study: &Study<'_>, first: &Linear) -> Vec<Promise> {
    let (blocks, _) = study.blocks(&first.theta, &first.noise, edge_s(study));
    let (a, b) = sum(&blocks);
    let whole = Word::new(&a, &b, &study.tolerances(), first.word.dispersion);
    let plain = &whole.search(&study.candidates)[0];
    let tried = infer::parallel_map(&onsets(study, &blocks), |onset| {
        promise(study, &blocks, *onset, first.word.dispersion, plain)
    });
    let mut out: Vec<Promise> = tried.into_iter().flatten().collect();
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

/// The beginnings of blocks at which something may set in.
fn onsets(study: &Study<'_>, blocks: &[Block]) -> Vec<Onset> {
    let of = |b: &Block| Onset {
        log: b.log,
        at_s: b.from_s,
    };
    let is_inside = |onset: &Onset| {
        let [from_s, to_s] = study.onsets_s(onset.log, LEAST_SIDE_S);
        onset.at_s > from_s && onset.at_s < to_s
    };
    blocks.iter().map(of).filter(is_inside).collect()
}

/// What an onset promises; none where it is too little.
fn promise(
    study: &Study<'_>,
    blocks: &[Block],
    onset: Onset,
    dispersion: f64,
    plain: &Model,
) -> Option<Promise> {
    let with = study.with_onset(onset);
    let places: Vec<usize> = (0..with.of_mechanisms()).collect();
    let sets_in = |b: &Block| f64::from(b.from_s >= onset.at_s);
    let word = word_of(&with, blocks, dispersion, &places, sets_in);
    let mut sets = vec![Vec::new(), plain.set.clone()];
    sets.extend(plain.set.iter().map(|out| {
        let rest = plain.set.iter().filter(|k| *k != out);
        rest.copied().collect()
    }));
    let charge = word.charge(&with.candidates);
    let late = (0..with.candidates.len()).filter(|k| with.has_late(&[*k]));
    let tried = late.flat_map(|late| sets.iter().map(move |set| [&set[..], &[late]].concat()));
    let best = tried
        .map(|set| word.model(&with.candidates, set, charge))
        .max_by(|a, b| a.log_posterior.total_cmp(&b.log_posterior))?;
    let nats = best.log_posterior - plain.log_posterior;
    let set = best.set;
    (nats > PROMISING_NATS).then_some(Promise { onset, set, nats })
}

/// Whether the candidate `late` of the best set began at once: as a change that takes some time the data are less
/// probable.
fn is_sudden(with: &Study<'_>, now: &Linear, late: usize) -> bool {
    let Some(onset) = with.onset else {
        return false;
    };
    let block_s = edge_s(with);
    let (blocks, _) = with.blocks(&now.theta, &now.noise, block_s);
    let mut candidates = with.candidates.clone();
    let grown = &mut candidates[late].columns;
    let places: Vec<usize> = grown.iter().map(|j| j - with.first_late()).collect();
    *grown = (with.width()..with.width() + places.len()).collect();
    let value = |grown: &dyn Fn(f64) -> f64| {
        let weight = |b: &Block| grown(0.5 * (b.from_s + b.to_s)).clamp(0.0, 1.0);
        let word = word_of(with, &blocks, now.word.dispersion, &places, weight);
        let set = now.models[0].set.clone();
        word.model(&candidates, set, 0.0).log_evidence
    };
    let sudden = value(&|t| (t - onset.at_s) / block_s + 0.5);
    let [from_s, to_s] = with.onsets_s(onset.log, 0.5 * block_s);
    let end = |k: usize| from_s + (to_s - from_s) * k as f64 / (RAMP_ENDS - 1) as f64;
    let pairs = (0..RAMP_ENDS).flat_map(|i| (i + 1..RAMP_ENDS).map(move |j| (end(i), end(j))));
    let ramps: Vec<(f64, f64)> = pairs.filter(|(a, b)| b - a >= GRADUAL_S).collect();
    let gradual = infer::parallel_map(&ramps, |(a, b)| value(&|t| (t - a) / (b - a)));
    gradual.into_iter().all(|g| sudden - g >= SUDDEN_NATS)
}

/// The data's word with further columns: those of the parameters at `places` from when they have grown to a part of their
/// size in each block of the onset's log.
fn word_of(
    with: &Study<'_>,
    blocks: &[Block],
    dispersion: f64,
    places: &[usize],
    grown: impl Fn(&Block) -> f64,
) -> Word {
    // Sums of the blocks, of their parts, and of the parts of their parts.
    let width = blocks.first().map_or(0, |b| b.b.len());
    let mut sums = [0; 3].map(|_| (DMatrix::zeros(width, width), DVector::zeros(width)));
    for block in blocks {
        let is_late = with.onset.is_some_and(|o| o.log == block.log);
        let grown = if is_late { grown(block) } else { 0.0 };
        for ((a, b), power) in sums.iter_mut().zip(0..) {
            let part = grown.powi(power);
            if part != 0.0 {
                a.zip_apply(&block.a, |sum, own| *sum += part * own);
                b.axpy(part, &block.b, 1.0);
            }
        }
    }
    // Each column's own in the blocks, and whether it counts by its part.
    let own = |j: usize| {
        if j < width {
            (j, 0)
        } else {
            (places[j - width], 1)
        }
    };
    let n = width + places.len();
    let a = DMatrix::from_fn(n, n, |i, j| {
        let ((i, i_part), (j, j_part)) = (own(i), own(j));
        sums[i_part + j_part].0[(i, j)]
    });
    let b = DVector::from_fn(n, |j, _| sums[own(j).1].1[own(j).0]);
    Word::new(&a, &b, &with.tolerances(), dispersion)
}

/// Goes with the filter where an onset leads, moving the onset on the way; none where nothing that sets in is
/// left at the end.
fn descend<'a>(
    study: &Study<'a>,
    first: &Linear,
    promise: &Promise,
) -> Option<(Study<'a>, Linear)> {
    let mut with = study.with_onset(promise.onset);
    let mut now = with.linearise(extended(&with, &first.theta), first.noise.clone());
    let mut set = promise.set.clone();
    for _ in 0..ROUNDS {
        let theta = with.step_towards(&now, &set, STEP);
        let noise = with.noise(&theta, now.noise.clone(), NOISE_STEPS);
        let moved = moved(&with, &theta, &noise, now.word.dispersion);
        let shift_s = (moved.onset.at_s - with.onset?.at_s).abs();
        with = study.with_onset(moved.onset);
        with.pay(moved.at_s, moved.log_price);
        let next = with.linearise(theta, noise);
        if !next.log_score.is_finite() {
            return None;
        }
        let gained = next.with_noise_prior() - now.with_noise_prior();
        now = next;
        let best = now.models.iter().find(|m| with.has_late(&m.set))?;
        let stays = best.set == set;
        set.clone_from(&best.set);
        if stays && shift_s < 2.0 * STEPS_S[1] && gained < 1.0 {
            break;
        }
    }
    now = with.refitted(now);
    let set = now.models[0].set.iter().copied();
    let late: Vec<usize> = set.filter(|k| with.has_late(&[*k])).collect();
    let sets_in = !late.is_empty() && late.iter().all(|k| is_sudden(&with, &now, *k));
    sets_in.then_some((with, now))
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
