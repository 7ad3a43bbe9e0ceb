//! The strength that makes an effect as visible as wanted.

use super::{CHORDS, Worth};
use crate::case::CaseSpec;

/// A case whose effects are as visible as wanted.
#[derive(Debug, Clone, PartialEq)]
pub struct Tuned {
    /// What to make.
    pub spec: CaseSpec,
    /// D of each effect beside the others, nats.
    pub nats: Vec<f64>,
}

/// Strength beyond which an effect is given up as not to be seen in a scene.
const STRONGEST: f64 = 300.0;
/// The strength tried first for [`WEAK_NATS`].
const WEAK: f64 = 2.0;
/// The visibility that most effects have about at the strength [`WEAK`], nats.
const WEAK_NATS: f64 = 20.0;
/// Part of the wanted D by which the reached one may differ.
const WITHIN: f64 = 0.1;
/// The same where an effect jumps (a lid, a limit).
const WITHIN_AT_WORST: f64 = 0.3;
/// Trials for one strength.
const TRIALS: usize = 10;
/// How often several effects are tuned, each beside the others.
const ROUNDS: usize = 3;

/// `spec` with strengths that make each effect as visible as wanted beside the others, to within a
/// tenth or, where it jumps, three; `None` where the scene does not show one so strongly.
pub fn tuned(spec: &CaseSpec, wanted: &[f64]) -> Option<Tuned> {
    let worth = Worth::new(spec);
    let first = |d: &f64| WEAK * (d / WEAK_NATS).sqrt();
    let mut strengths: Vec<f64> = wanted.iter().map(first).collect();
    let nats = if let [target] = wanted {
        let (strength, nats) = worth.strength_for(*target, &strengths, 0)?;
        strengths[0] = strength;
        vec![nats]
    } else {
        worth.together(wanted, &mut strengths)?
    };
    let mut spec = spec.clone();
    for (hidden, strength) in spec.hidden.iter_mut().zip(strengths) {
        hidden.strength = strength;
    }
    Some(Tuned { spec, nats })
}

impl Worth<'_> {
    /// D of each effect once each is about as visible beside the others as wanted.
    fn together(&self, wanted: &[f64], strengths: &mut [f64]) -> Option<Vec<f64>> {
        let mut nats = Vec::new();
        for _ in 0..ROUNDS {
            for which in 0..wanted.len() {
                strengths[which] = self.strength_for(wanted[which], strengths, which)?.0;
            }
            nats = (0..wanted.len())
                .map(|which| self.nats(strengths, which, CHORDS))
                .collect();
            if nats.iter().zip(wanted).all(|(n, w)| near(*n, *w)) {
                return Some(nats);
            }
        }
        // What hides each other wholly is given up; what is seen counts as what it is.
        nats.iter().all(|n| *n > WEAK_NATS).then_some(nats)
    }

    /// The strength of the effect `which` at which its D is about `target`, and that D.
    fn strength_for(&self, target: f64, strengths: &[f64], which: usize) -> Option<(f64, f64)> {
        let mut at = self.nats_by_strength(strengths, which);
        let mut strength = strengths[which];
        // Linearly first, which is quick, and again if that misleads.
        for chords in [0, 1] {
            strength = bracketed(target, strength, |s| at(s, chords))?;
            let nats = at(strength, CHORDS);
            if near(nats, target) {
                return Some((strength, nats));
            }
        }
        None
    }
}

/// Whether a D is about as wanted.
fn near(nats: f64, target: f64) -> bool {
    (nats / target - 1.0).abs() < WITHIN_AT_WORST
}

/// Where `nats` is about `target`: growing steps from `first` until it is bracketed, then regula falsi
/// in the logarithms (D grows about as the square of strength).
fn bracketed(target: f64, first: f64, mut nats: impl FnMut(f64) -> f64) -> Option<f64> {
    let mut strength = first;
    let mut low: Option<(f64, f64)> = None;
    let mut high: Option<(f64, f64)> = None;
    let mut last = (strength, f64::NAN);
    for _ in 0..TRIALS {
        last = (strength, nats(strength));
        let reached = last.1;
        if (reached / target - 1.0).abs() < WITHIN {
            return Some(strength);
        }
        *if reached < target {
            &mut low
        } else {
            &mut high
        } = Some(last);
        let by_square = strength * (target / reached.max(0.05 * target)).sqrt();
        strength = match (low, high) {
            (Some(l), Some(h)) => {
                let log = |n: f64| n.max(0.02 * target).ln();
                let share = (log(target) - log(l.1)) / (log(h.1) - log(l.1));
                (l.0.ln() + share.clamp(0.1, 0.9) * (h.0 / l.0).ln()).exp()
            }
            _ => by_square.clamp(strength / 5.0, strength * 4.0),
        };
        if strength > STRONGEST {
            return None;
        }
    }
    near(last.1, target).then_some(last.0)
}
