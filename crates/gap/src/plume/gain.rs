//! The gain on passes that the fit did not see.

use ::plume::score::{Pair, with_interval};
use infer::{Expected, InferError};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use super::Study;
use crate::statistics::central_95;
use crate::verdict::{Gain, HeldOut};

/// Number of bootstrap resamples.
const RESAMPLES: usize = 400;
/// An excess counts in ratios from so many standard deviations of the noise on.
const FLOOR_SDS: f64 = 3.0;

/// The gain, and start and end of each pass, s, with its part of it, nats.
pub(crate) struct Gained {
    pub gain: Gain,
    pub blocks: Vec<(f64, f64, f64)>,
}

/// What the extended model gains over the base.
pub(crate) fn gain(study: &Study<'_>, seed: u64) -> Result<Gained, InferError> {
    let passes = &study.judged.passes;
    let (base, set) = (&study.base, &study.judged.set);
    let [before, after] = study.question.compared(base, set, passes)?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let square = |of: &Expected, k: usize| -> (f64, f64) {
        let used = passes[k]
            .iter()
            .cloned()
            .flatten()
            .filter(|i| study.data.used[*i]);
        used.fold((0.0, 0.0), |(sum, n), i| {
            (
                sum + (study.data.reading_ppm[i] - of.reading[i]).powi(2),
                n + 1.0,
            )
        })
    };
    let n = passes.len();
    let old: Vec<(f64, f64)> = (0..n).map(|k| square(&before, k)).collect();
    let new: Vec<(f64, f64)> = (0..n).map(|k| square(&after, k)).collect();
    let rmse = |of: &[(f64, f64)]| {
        let (sum, n) = of.iter().fold((0.0, 0.0), |s, o| (s.0 + o.0, s.1 + o.1));
        (sum / f64::max(n, 1.0)).sqrt()
    };
    let (mut gains, mut changes) = (Vec::new(), Vec::new());
    for _ in 0..RESAMPLES {
        let drawn: Vec<usize> = (0..n).map(|_| rng.random_range(0..n)).collect();
        let pick = |of: &[(f64, f64)]| drawn.iter().map(|k| of[*k]).collect::<Vec<_>>();
        gains.push(drawn.iter().map(|k| after.ln[*k] - before.ln[*k]).sum());
        changes.push(rmse(&pick(&new)) - rmse(&pick(&old)));
    }
    let [gain_low, gain_high] = central_95(gains);
    let [change_low, change_high] = central_95(changes);
    let was = scores_of_excess(study, &before, &before, &mut rng);
    let is = scores_of_excess(study, &before, &after, &mut rng);
    let held_out = HeldOut {
        log_score_before: before.ln.iter().sum(),
        log_score_after: after.ln.iter().sum(),
        log_score_gain_low: gain_low,
        log_score_gain_high: gain_high,
        rmse_before: rmse(&old),
        rmse_after: rmse(&new),
        rmse_change_low: change_low,
        rmse_change_high: change_high,
        fac2_before: was.0[0],
        fac2_after: is.0[0],
        fb_before: was.0[1],
        fb_after: is.0[1],
        nmse_before: was.0[2],
        nmse_after: is.0[2],
        mg_before: was.0[3],
        mg_after: is.0[3],
        vg_before: was.0[4],
        vg_after: is.0[4],
        intervals_before: was.1,
        intervals_after: is.1,
    };
    let span = |k: usize| {
        let times = study.data.track.time_s();
        let of = passes[k].iter().cloned().flatten().map(|i| times[i]);
        of.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| {
            (a.min(t), b.max(t))
        })
    };
    Ok(Gained {
        gain: Gain {
            blocks: n,
            held_out,
        },
        blocks: (0..n)
            .map(|k| (span(k).0, span(k).1, after.ln[k] - before.ln[k]))
            .collect(),
    })
}

/// Scores of the excess over the air without a plume, where either side has one, and their intervals
/// over passes.
fn scores_of_excess(
    study: &Study<'_>,
    base: &Expected,
    of: &Expected,
    rng: &mut ChaCha8Rng,
) -> ([f64; 5], [[f64; 2]; 5]) {
    let floor = FLOOR_SDS * study.base.fit().noise.white;
    let pairs = |pass: &Vec<std::ops::Range<usize>>| -> Vec<Pair> {
        let used = pass
            .iter()
            .cloned()
            .flatten()
            .filter(|i| study.data.used[*i]);
        let pair = used.map(|i| {
            let clean = base.reading[i] - base.plume[i];
            (study.data.reading_ppm[i] - clean, of.reading[i] - clean)
        });
        pair.filter(|(m, c)| m.max(*c) > floor).collect()
    };
    let kept: Vec<Vec<Pair>> = study.judged.passes.iter().map(pairs).collect();
    let groups: Vec<&[Pair]> = kept.iter().map(Vec::as_slice).collect();
    match with_interval(&groups, floor, RESAMPLES, rng) {
        Ok(s) => {
            let list = |s: &::plume::score::Scores| [s.fac2, s.fb, s.nmse, s.mg, s.vg];
            let (low, high) = (list(&s.low), list(&s.high));
            (list(&s.value), std::array::from_fn(|k| [low[k], high[k]]))
        }
        Err(_) => ([f64::NAN; 5], [[f64::NAN; 2]; 5]),
    }
}
