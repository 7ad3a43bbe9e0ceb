//! What the wander of an axis does to numbers that hold in the mean.
//!
//! A fit follows the axis as it drifts, so that its spread is that of the plume about the axis of the moment, and its axis and
//! height are as sure as if the plume lay still. A scenario holds the plume in the mean, which is wider, σ² = σ_r² + σ_m²
//! (Gifford 1959), and weaker on its axis by as much.

use ::plume::{MechanismId, Strength};
use infer::{AxisTurn, ClosestModel, Estimate, ForwardModel, InferError, Posterior};
use statrs::distribution::{ContinuousCDF as _, StudentsT};

use super::model::PlumeModel;

/// Neighbouring states of an axis drift hang together: its basis functions overlap.
const STATES_TOLD_TWICE: f64 = 2.0;
/// A plume meanders if its axis wanders by this part of its width or more. A fit leaves 1 % in steady air, 20 % and more in
/// unsteady air.
const WANDERS: f64 = 0.03;
/// What a normal distribution holds below two standard deviations.
const WITHIN_2_SD: f64 = 0.977_25;

/// The wander of the axis about its mean in one direction.
#[derive(Debug, Clone, Copy, Default)]
struct Wander {
    /// Variance, degrees².
    deg2: f64,
    /// Width of the plume about the axis of the moment as seen from its source, degrees.
    width_deg: f64,
}

impl Wander {
    /// Logarithm of the mean plume's spread over that about the axis of the moment, and its standard deviation where the
    /// wander is that of so many independent states.
    fn ln_wider(self, states: f64) -> Estimate {
        let part = self.deg2 / self.width_deg.powi(2);
        // A standard deviation of n values is known to 1/√2n of itself.
        Estimate {
            value: 0.5 * part.ln_1p(),
            sd: few(states) * part / (1.0 + part) / (2.0 * states).sqrt(),
        }
    }

    /// How far the mean of so many independent states may be off, degrees.
    fn of_mean_deg(self, states: f64) -> f64 {
        few(states) * (self.deg2 / states).sqrt()
    }

    /// Whether it is too little to tell from a steady axis.
    fn is_still(self) -> bool {
        self.deg2 < (WANDERS * self.width_deg).powi(2)
    }

    /// A wander by more than the plume is wide is a wind that turns, whose plume in the mean is none of the scenario's.
    fn unless_it_turns(self) -> Self {
        if self.deg2 > self.width_deg.powi(2) {
            Self { deg2: 0.0, ..self }
        } else {
            self
        }
    }
}

/// The wander of a fitted axis where the plume was met.
#[derive(Debug, Clone, Copy)]
pub struct Meander {
    sideways: Wander,
    upward: Wander,
    /// Independent states of the axis.
    states: f64,
    /// Distance from the source, m.
    distance_m: f64,
}

/// The plume met while the axis had one state.
struct State {
    time_s: f64,
    plume: f64,
}

impl Meander {
    /// The wander of the axis of the plume with the unknowns `at`; none where the plume was not met.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn of(
        model: &PlumeModel<'_>,
        at: &[f64],
        believed: &Posterior,
    ) -> Result<Option<Self>, InferError> {
        let time_s = model.track().time_s();
        let turns: Vec<AxisTurn> = time_s.iter().map(|t| believed.turn(*t)).collect();
        let met = model.predict(at, &turns)?.plume;
        let met: Vec<f64> = met.iter().map(|plume| plume.max(0.0)).collect();
        let all: f64 = met.iter().sum();
        let Some(distance_m) = model.met_distance_m(at, &met)? else {
            return Ok(None);
        };
        let states = states(time_s, &met, believed.axis_drift_width_s());
        let noise = &believed.fit().noise;
        let seen_deg = |height_m: f64| (height_m / distance_m).atan().to_degrees();
        let (sigma_y_m, sigma_z_m) = model.world(at)?.sigmas_m(distance_m);
        let squares: f64 = states.iter().map(|s| s.plume * s.plume).sum();
        let sideways = Wander {
            deg2: variance_deg2(&states, &|times| believed.mean_turn(times, None))
                + noise.wander_deg.powi(2),
            width_deg: seen_deg(sigma_y_m),
        };
        let width_deg = seen_deg(sigma_z_m);
        let upward = Wander {
            deg2: variance_deg2(&states, &|times| believed.mean_rise(times))
                + (noise.wander_sigma_z * width_deg).powi(2),
            width_deg,
        };
        Ok(Some(Self {
            sideways: sideways.unless_it_turns(),
            upward,
            states: (all * all / squares / STATES_TOLD_TWICE).max(1.0),
            distance_m,
        }))
    }

    /// Whether the axis wanders so little that the plume is as good as steady.
    pub fn is_still(&self) -> bool {
        [self.sideways, self.upward].iter().all(|w| w.is_still())
    }

    /// The unknowns in the mean over the wander, of which `index` gives the place of each; `strength` is how the scenario
    /// states that of its source.
    pub fn in_the_mean(
        &self,
        index: impl Fn(MechanismId) -> Option<usize>,
        strength: Strength,
        stated: &mut ClosestModel,
    ) {
        use MechanismId as M;
        let [across, up] = [self.sideways, self.upward].map(|w| w.ln_wider(self.states));
        // The axis of the moment is as strong as its plume is narrow.
        let weaker = match strength {
            Strength::CMax { .. } => across.value + up.value,
            Strength::EmissionKgS(_) => 0.0,
        };
        let height_m = self.upward.of_mean_deg(self.states).to_radians().tan() * self.distance_m;
        for (id, shift, sd) in [
            (
                M::WindDirectionOffset,
                0.0,
                self.sideways.of_mean_deg(self.states),
            ),
            (M::EffectiveHeightOffset, 0.0, height_m),
            (M::SigmaYScale, across.value, across.sd),
            (M::SigmaZScale, up.value, up.sd),
            (M::EmissionScale, -weaker, across.sd.hypot(up.sd)),
        ] {
            if let Some(k) = index(id) {
                stated.mean[k] += shift;
                stated.covariance[(k, k)] += sd * sd;
                stated.prior[k] += sd * sd;
            }
        }
    }
}

/// Variance of the axis over its states, of which `turn` gives the mean turn at some times, degrees². What is not known of all
/// of them together is no wander.
fn variance_deg2(states: &[State], turn: &dyn Fn(&[f64]) -> Estimate) -> f64 {
    let times_s: Vec<f64> = states.iter().map(|s| s.time_s).collect();
    let known = turn(&times_s).sd.powi(2);
    let turns: Vec<Estimate> = times_s.iter().map(|t| turn(&[*t])).collect();
    let all: f64 = states.iter().map(|s| s.plume).sum();
    let in_the_mean = |of: &dyn Fn(&Estimate) -> f64| {
        let parts = turns.iter().zip(states).map(|(t, s)| s.plume * of(t));
        parts.sum::<f64>() / all
    };
    let mean = in_the_mean(&|t| t.value);
    in_the_mean(&|t| (t.value - mean).powi(2) + (t.sd.powi(2) - known).max(0.0))
}

/// By what a standard deviation that rests on so few squares is larger than that of a normal distribution, so that two of
/// them hold as much (Student 1908).
fn few(squares: f64) -> f64 {
    let student = StudentsT::new(0.0, 1.0, squares);
    student.map_or(1.0, |t| t.inverse_cdf(WITHIN_2_SD) / 2.0)
}

/// The states of an axis that keeps each for `width_s`: the plume that was met in each, and when on the average.
fn states(time_s: &[f64], met: &[f64], width_s: f64) -> Vec<State> {
    let mut rows: Vec<(f64, f64)> = time_s.iter().copied().zip(met.iter().copied()).collect();
    rows.retain(|(_, plume)| *plume > 0.0);
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_same =
        |a: &(f64, f64), b: &(f64, f64)| (a.0 / width_s).floor() == (b.0 / width_s).floor();
    let state = |rows: &[(f64, f64)]| {
        let plume: f64 = rows.iter().map(|r| r.1).sum();
        State {
            time_s: rows.iter().map(|r| r.0 * r.1).sum::<f64>() / plume,
            plume,
        }
    };
    rows.chunk_by(is_same).map(state).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Variances of plume and meander add (Gifford 1959).
    #[test]
    fn a_meander_as_wide_as_the_plume_doubles_its_variance() {
        let wander = Wander {
            deg2: 9.0,
            width_deg: 3.0,
        };
        let wider = wander.ln_wider(1e6);
        assert!((wider.value.exp().powi(2) - 2.0).abs() < 1e-12);
        assert!(wider.sd < 1e-3);
    }

    /// The quantile p of Student's distribution with two degrees of freedom is (2p - 1) / sqrt(2 p (1 - p)).
    #[test]
    fn few_states_tell_less() {
        let p = WITHIN_2_SD;
        let quantile = (2.0 * p - 1.0) / (2.0 * p * (1.0 - p)).sqrt();
        assert!((few(2.0) - quantile / 2.0).abs() < 1e-6, "{}", few(2.0));
        assert!((few(1e6) - 1.0).abs() < 1e-3);
    }

    /// Turns of 2, -2 and 2 degrees, known to 1 degree each, of which the mean is known exactly.
    #[test]
    fn what_is_not_known_of_each_state_counts_as_wander() {
        let time_s = [0.0, 10.0, 100.0, 200.0, 210.0];
        let all = states(&time_s, &[1.0, 1.0, 2.0, 3.0, 0.0], 60.0);
        assert_eq!(all.len(), 3);
        assert!((all[0].time_s - 5.0).abs() < 1e-12);
        let turn = |times: &[f64]| Estimate {
            value: if times == [100.0] { -2.0 } else { 2.0 },
            sd: if times.len() == 1 { 1.0 } else { 0.0 },
        };
        // Weights 2, 2 and 3 of 7: mean 6/7, variance 4 - 36/49.
        let variance = variance_deg2(&all, &turn);
        assert!(
            (variance - (4.0 - 36.0 / 49.0 + 1.0)).abs() < 1e-12,
            "{variance}"
        );
    }
}
