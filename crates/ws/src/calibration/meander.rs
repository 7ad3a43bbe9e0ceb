//! What a meander does to numbers that hold in the mean.
//!
//! The fit follows the axis from crossing to crossing, so that its spread is that of the plume about an axis that
//! wanders, and its axis and height are as sure as if it lay still. In the mean over meanders the plume is wider,
//! σ² = σ_r² + σ_m² (Gifford 1959), and axis and height are those of a few crossings that stand for all. Across,
//! crossings show the meander; in height they show a plume that is now strong and now weak. It is
//! taken for as large there, over the plume's spread, as across: eddies that move a plume are wider than it in
//! both directions.

use super::parameters::Unknowns;
use super::peak::{AtCrossing, Predicted};
use infer::ClosestModel;
use plume::{DispersionSpec, MechanismId, Strength};
use statrs::distribution::{ContinuousCDF as _, StudentsT};

/// Crossings below which no meander can be told.
pub(super) const LEAST_CROSSINGS: usize = 4;
/// Of a series a mean and a slope are taken, so that fewer independent crossings than these would leave nothing.
const LEAST_INDEPENDENT: f64 = 3.0;

/// Where a plume meanders, its meander is expected to be about as large as the plume itself (Gifford 1959;
/// [`plume::puffs::UnsteadySpec`]); that is worth so many independent squares: it may be twice or half.
const WORTH: f64 = 2.0;
/// What a normal distribution holds below two standard deviations.
const WITHIN_2_SD: f64 = 0.977_25;

/// A plume meanders if its axis wanders within a crossing by this part of its width or more, however few crossings show it.
/// A fit leaves 1 % in steady air, 8 % to 20 % in unsteady air.
const WANDERS: f64 = 0.03;

/// A slope that is not zero by so many standard deviations is a wind that turns.
const TURNS_SD: f64 = 3.0;

/// The straight line through the turns of the axis at crossings, by least squares.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    mean_s: f64,
    mean_deg: f64,
    deg_s: f64,
    deg_s_sd: f64,
    /// Number of crossings, and the sum of the squares of what their turns are off it.
    count: f64,
    off_sq_deg2: f64,
}

impl Line {
    pub fn through(crossings: &[AtCrossing]) -> Self {
        let n = crossings.len() as f64;
        let mean = |of: fn(&AtCrossing) -> f64| crossings.iter().map(of).sum::<f64>() / n;
        let (mean_s, mean_deg) = (mean(|c| c.time_s), mean(|c| c.turn_deg));
        let sum = |of: &dyn Fn(&AtCrossing) -> f64| crossings.iter().map(of).sum::<f64>();
        let square = sum(&|c| (c.time_s - mean_s).powi(2)).max(f64::MIN_POSITIVE);
        let deg_s = sum(&|c| (c.time_s - mean_s) * (c.turn_deg - mean_deg)) / square;
        let mut line = Self {
            mean_s,
            mean_deg,
            deg_s,
            deg_s_sd: 0.0,
            count: n,
            off_sq_deg2: 0.0,
        };
        line.off_sq_deg2 = sum(&|c| line.off_deg(c).powi(2));
        line.deg_s_sd = (line.off_sq_deg2 / (n - 2.0).max(1.0) / square).sqrt();
        line
    }

    /// How far the line has turned from its middle until a time, degrees.
    pub fn turned_deg(&self, time_s: f64) -> f64 {
        self.deg_s * (time_s - self.mean_s)
    }

    /// Whether it is more than chance makes of a meander.
    pub fn is_a_turn(&self) -> bool {
        self.deg_s.abs() > TURNS_SD * self.deg_s_sd
    }

    /// How many of the crossings are as good as independent ones, as a part of them: a meander that lasts from one to
    /// the next is met twice. That of an autoregressive process, (1 − r) / (1 + r) (Bayley and Hammersley
    /// 1946), with the correlation of neighbours, of which short series show too little (Marriott and Pope 1954).
    /// At least three remain.
    fn independent_part(&self, crossings: &[AtCrossing]) -> f64 {
        let off: Vec<f64> = crossings.iter().map(|c| self.off_deg(c)).collect();
        let product: f64 = off.windows(2).map(|pair| pair[0] * pair[1]).sum();
        let seen = product / self.off_sq_deg2.max(f64::MIN_POSITIVE);
        let r = (seen + (1.0 + 4.0 * seen) / self.count).clamp(0.0, 1.0);
        ((1.0 - r) / (1.0 + r)).max(LEAST_INDEPENDENT / self.count)
    }

    fn off_deg(&self, crossing: &AtCrossing) -> f64 {
        crossing.turn_deg - self.mean_deg - self.turned_deg(crossing.time_s)
    }

    /// Root mean square of what the turns of its crossings are off it, degrees.
    pub fn rms_off_deg(&self) -> f64 {
        (self.off_sq_deg2 / self.count).sqrt()
    }
}

/// The meander that crossings show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Meander {
    /// Its variance over that of the plume's own width, as crossings show it.
    pub seen: f64,
    /// The same as it may be, beside what is expected of a meander.
    pub may_be: f64,
    /// The plume's own width as seen from the source, degrees.
    pub width_deg: f64,
    /// Whether the axis turns so far that it is stated as of its last moment.
    pub is_followed: bool,
    /// What it is known from, in independent squares.
    pub freedoms: f64,
    /// By what standard deviations that rest on so few are larger than those of a normal distribution, so that two of
    /// them hold as much.
    pub few: f64,
    /// How many crossings that follow each other after any time would tell as much of the axis as these do.
    pub independent: f64,
    /// The same of its height: the strength at a crossing tells of it in proportion to how far it was from the
    /// axis, and is off by as much.
    pub independent_in_height: f64,
    /// The plume's own height where it was crossed, one standard deviation, m.
    pub sigma_z_m: f64,
}

impl Meander {
    /// None where there are too few crossings, or where they may be those of a steady plume. Where they leave their line by
    /// more than the plume is wide, that is a wind that turns, and the plume is stated as of its last moment; in height
    /// it is expected to meander as much as it is high.
    pub fn of(predicted: &Predicted, width_deg: f64) -> Option<Self> {
        let crossings = predicted.axis();
        let n = crossings.len() as f64;
        if crossings.len() < LEAST_CROSSINGS {
            return None;
        }
        let line = Line::through(crossings);
        let part = line.independent_part(crossings);
        // A mean and a slope are taken from them, each as much as one independent crossing; what a turn is known
        // for leaves the rest of its variance to what it may be off.
        let freedoms = part * n - 2.0;
        let seen = line.off_sq_deg2 / (n - 2.0 / part);
        let known = crossings.iter().map(|c| c.turn_sd_deg.powi(2)).sum::<f64>() / n;
        // What is not known of the axis of all crossings is no meander of them.
        let own = (known - predicted.mean_axis_sd_deg().powi(2)).max(0.0);
        // What wanders within a crossing is no turn of it, and of the mean spread all the same.
        let seen = (seen + own + predicted.wander_deg().powi(2)) / width_deg.powi(2);
        // The plume may be steady if crossings deviate from their line by no more than the error of each by itself.
        let off = line.rms_off_deg();
        let is_steady = off.powi(2) <= own && predicted.wander_deg() < WANDERS * width_deg;
        let is_followed = off > width_deg;
        let seen = if is_followed { 0.0 } else { seen };
        (!is_steady).then_some(Self {
            seen,
            may_be: if is_followed {
                1.0
            } else {
                (freedoms * seen + WORTH) / (freedoms + WORTH)
            },
            is_followed,
            width_deg,
            freedoms: freedoms + WORTH,
            few: few(freedoms + WORTH),
            independent: part * n,
            independent_in_height: (part * off_axis(crossings)).max(1.0),
            sigma_z_m: predicted.sigma_z_m(),
        })
    }

    /// The unknowns in the mean over meanders.
    pub fn in_the_mean(
        &self,
        unknowns: &Unknowns,
        base: &DispersionSpec,
        stated: &mut ClosestModel,
    ) {
        use MechanismId as M;
        let ln_wider = 0.5 * self.seen.ln_1p();
        let ratio = self.may_be.sqrt();
        // A standard deviation of n values is known to 1/√2n of itself.
        let ln_wider_sd =
            self.few * self.may_be / (1.0 + self.may_be) / (2.0 * self.freedoms).sqrt();
        // Across, the plume followed is as strong as it is narrow; in height, crossings have met its mean. What is
        // stated on the axis falls with the width across, and an emission holds what the height adds.
        let ln_strength = match base.sources[0].strength {
            Strength::CMax { .. } => -ln_wider,
            Strength::EmissionKgS(_) => ln_wider,
        };
        let of_mean = self.few / self.independent.sqrt();
        let of_height = self.few / self.independent_in_height.sqrt();
        for (id, shift, sd) in [
            (
                M::WindDirectionOffset,
                0.0,
                ratio * self.width_deg * of_mean,
            ),
            (
                M::EffectiveHeightOffset,
                0.0,
                ratio * self.sigma_z_m * of_height,
            ),
            (M::SigmaYScale, ln_wider, ln_wider_sd),
            (M::SigmaZScale, ln_wider, ln_wider_sd.hypot(ratio * of_mean)),
            (
                M::EmissionScale,
                ln_strength,
                ln_wider_sd.hypot(ratio * of_mean),
            ),
        ] {
            let is_across = matches!(id, M::WindDirectionOffset | M::SigmaYScale);
            if let Some(k) = unknowns
                .index(id, None)
                .filter(|_| !(self.is_followed && is_across))
            {
                stated.mean[k] += shift;
                stated.covariance[(k, k)] += sd * sd;
                stated.prior[k] += sd * sd;
            }
        }
    }
}

/// Student's factor for so many squares.
fn few(freedoms: f64) -> f64 {
    let student = StudentsT::new(0.0, 1.0, freedoms);
    student.map_or(1.0, |t| t.inverse_cdf(WITHIN_2_SD) / 2.0)
}

/// Weighted least squares of ln c = … + a δ/σz with a deviation a h/σz of each crossing: its variance is that of
/// h times Σa⁴ / (Σa²)².
fn off_axis(crossings: &[AtCrossing]) -> f64 {
    let sum = |power: i32| -> f64 { crossings.iter().map(|c| c.above_sigmas.powi(power)).sum() };
    sum(2).powi(2) / sum(4)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crossings(turns_deg: &[f64]) -> Vec<AtCrossing> {
        let of = |(k, turn_deg): (usize, &f64)| AtCrossing {
            time_s: 60.0 * k as f64,
            turn_deg: *turn_deg,
            ..AtCrossing::default()
        };
        turns_deg.iter().enumerate().map(of).collect()
    }

    /// 400 values of an autoregressive process with r = .6 have the mean of 100 independent ones:
    /// (1 − .6) / (1 + .6) = 1/4.
    #[test]
    fn a_meander_that_lasts_counts_for_fewer_crossings() {
        // Uniform noise of a linear congruential generator (Numerical Recipes, 1992, section 7.1).
        let mut state = 1u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state) / f64::from(u32::MAX) - 0.5
        };
        let mut turn = 0.0;
        let mut turns = |r: f64| -> Vec<f64> {
            (0..400)
                .map(|_| {
                    turn = r * turn + noise();
                    turn
                })
                .collect()
        };
        for (r, part) in [(0.0, 1.0), (0.6, 0.25)] {
            let all = crossings(&turns(r));
            let found = Line::through(&all).independent_part(&all);
            assert!((found / part - 1.0).abs() < 0.25, "{r}: {found}");
        }
    }

    #[test]
    fn a_steady_turn_is_told_from_a_meander() {
        let meander = [3.0, -2.0, 1.0, -3.0, 2.0, 0.0, -1.0, 2.0];
        let all = crossings(&meander);
        assert!(!Line::through(&all).is_a_turn());
        let turning: Vec<f64> = (0..8).map(|k| meander[k] + 4.0 * k as f64).collect();
        let all = crossings(&turning);
        let line = Line::through(&all);
        assert!(line.is_a_turn());
        assert!((line.turned_deg(420.0) - line.turned_deg(0.0) - 28.0).abs() < 3.0);
    }

    /// Three heights of one plume's own height apart: those on the axis tell nothing of its height.
    #[test]
    fn crossings_on_the_axis_do_not_tell_its_height() {
        let at = |above_sigmas| AtCrossing {
            above_sigmas,
            ..AtCrossing::default()
        };
        let all = [-1.0, 0.0, 1.0, -1.0, 0.0, 1.0].map(at);
        assert!((off_axis(&all) - 4.0).abs() < 1e-12);
    }
}
