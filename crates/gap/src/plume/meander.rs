//! Converts a fit about the moving axis to the mean plume that a scenario describes.
//!
//! The fit follows the axis, so its spread is that about the momentary axis, and its standard deviations of axis and height
//! leave out the sampling of the motion. The mean plume is wider, σ² = σ_r² + σ_m² (Gifford 1959), and c_MAX is smaller by the
//! same factor.

use ::plume::{MechanismId, Strength};
use infer::{AxisTurn, ClosestModel, Estimate, ForwardModel, InferError, Posterior};
use statrs::distribution::{ContinuousCDF as _, StudentsT};

use super::model::PlumeModel;

/// Number of adjacent states that count as one independent state: they are correlated, as basis functions overlap.
const CORRELATED_STATES: f64 = 2.0;
/// Ratio of the axis's standard deviation to the plume's width from which the plume meanders. Fits give 0.01 in steady air, and
/// 0.2 or more in unsteady air.
const MEANDERS: f64 = 0.03;
/// Probability of a normal variable below two standard deviations above its mean.
const WITHIN_2_SD: f64 = 0.977_25;

/// The motion of the axis about its mean in one direction: drift and wander.
#[derive(Debug, Clone, Copy, Default)]
struct AxisMotion {
    /// Variance, degrees².
    deg2: f64,
    /// Width of the plume about the axis of the moment as seen from its source, degrees.
    width_deg: f64,
}

impl AxisMotion {
    /// Logarithm of the mean plume's spread over that about the momentary axis, with its standard deviation after `states`
    /// independent states.
    fn ln_wider(self, states: f64) -> Estimate {
        let part = self.deg2 / self.width_deg.powi(2);
        // A standard deviation of n values is known to 1/√2n of itself.
        Estimate {
            value: 0.5 * part.ln_1p(),
            sd: few(states) * part / (1.0 + part) / (2.0 * states).sqrt(),
        }
    }

    /// Standard deviation of the axis's mean over `states` independent states, degrees.
    fn of_mean_deg(self, states: f64) -> f64 {
        few(states) * (self.deg2 / states).sqrt()
    }

    /// Whether it is too small to distinguish from a steady axis.
    fn is_steady(self) -> bool {
        self.deg2 < (MEANDERS * self.width_deg).powi(2)
    }

    /// The motion without variance where the axis moves by more than the plume's width: that is a change of the wind, and the
    /// scenario's plume is not its mean.
    fn unless_it_turns(self) -> Self {
        if self.deg2 > self.width_deg.powi(2) {
            Self { deg2: 0.0, ..self }
        } else {
            self
        }
    }
}

/// The motion of a fitted axis while vehicles were in the plume.
#[derive(Debug, Clone, Copy)]
pub struct Meander {
    sideways: AxisMotion,
    upward: AxisMotion,
    /// Independent states of the axis.
    states: f64,
    /// Distance from the source, m.
    distance_m: f64,
}

/// Sum of the plume's concentrations at the readings within one state of the axis, and their mean time.
struct State {
    time_s: f64,
    plume: f64,
}

impl Meander {
    /// The motion of the axis of the plume with the unknowns `at`; none where the axis is steady, or no reading was in the
    /// plume.
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
        let sideways = AxisMotion {
            deg2: variance_deg2(&states, &|times| believed.mean_turn(times, None))
                + noise.wander_deg.powi(2),
            width_deg: seen_deg(sigma_y_m),
        };
        let width_deg = seen_deg(sigma_z_m);
        let upward = AxisMotion {
            deg2: variance_deg2(&states, &|times| believed.mean_rise(times))
                + (noise.wander_sigma_z * width_deg).powi(2),
            width_deg,
        };
        let meander = Self {
            sideways: sideways.unless_it_turns(),
            upward,
            states: (all * all / squares / CORRELATED_STATES).max(1.0),
            distance_m,
        };
        Ok((!meander.is_steady()).then_some(meander))
    }

    fn is_steady(&self) -> bool {
        [self.sideways, self.upward].iter().all(|m| m.is_steady())
    }

    /// Converts `stated` to the mean plume. `index` is the position of an unknown; `strength` is the scenario's.
    pub fn in_the_mean(
        &self,
        index: impl Fn(MechanismId) -> Option<usize>,
        strength: Strength,
        stated: &mut ClosestModel,
    ) {
        use MechanismId as M;
        let [across, up] = [self.sideways, self.upward].map(|w| w.ln_wider(self.states));
        // c_MAX is on the axis, where the narrower plume is stronger; an emission is the same.
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

/// Variance of the axis over its states, degrees²; `turn` is the mean turn at some times. The uncertainty that all states share
/// does not count.
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

/// Factor on a standard deviation from `freedoms` degrees of freedom, so that ± 2 of them cover as much as of a normal
/// distribution (Student 1908).
fn few(freedoms: f64) -> f64 {
    let student = StudentsT::new(0.0, 1.0, freedoms);
    student.map_or(1.0, |t| t.inverse_cdf(WITHIN_2_SD) / 2.0)
}

/// The states of an axis that keeps each for `width_s`.
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
        let motion = AxisMotion {
            deg2: 9.0,
            width_deg: 3.0,
        };
        let wider = motion.ln_wider(1e6);
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
    fn what_is_not_known_of_each_state_counts_as_motion() {
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
