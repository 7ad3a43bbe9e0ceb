//! One case: what the finder says of it, held against the truth.

use gap::plume::{Analysis, Likeness, Options, analyse};
use gap::verdict::{Cause, Verdict};
use gap_truth::case::DamageKind;
use gap_truth::mutation::mutate;
use gap_truth::{Case, Forward, FurtherFlight, PlumeEffect, TrueEffect, Truth, further};

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

use crate::plan::{Kind, Task};
use crate::tune::{self, Tuned};

/// What became of one case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The task.
    pub task: Task,
    /// No scene tried shows the effect as strongly as asked; nothing else is set.
    pub unreachable: bool,
    /// What the finder or the reader refused.
    pub error: Option<String>,
    /// Forward model of the truth; none where no case was made.
    pub forward: Option<Forward>,
    /// Visibility reached, nats.
    pub nats: f64,
    /// The verdict.
    pub verdict: Option<Verdict>,
    /// Mechanisms of each cause.
    pub sets: Vec<Vec<String>>,
    /// How many of the hidden effects are in some set.
    pub in_sets: usize,
    /// How many of the hidden effects are named alone, on the right platforms where one has it.
    pub named: usize,
    /// Mean size of the sets that hold a hidden effect.
    pub whole_size: Option<f64>,
    /// The same, what cannot be told from it not counted.
    pub set_size: Option<f64>,
    /// Of two effects: how probable it is at most that data such as these let anyone name each of
    /// them alone at 95 %.
    pub nameable: Option<f64>,
    /// A cause of a single name that is not a hidden effect, nor one that cannot be told from it,
    /// in a verdict that does not say that something is unexplained.
    pub confidently_wrong: bool,
    /// The stated probability of the first cause, and whether it holds a hidden effect.
    pub stated: Option<(f64, bool)>,
    /// For each fitted parameter of a named hidden effect: whether 1.96 sd cover the truth.
    pub covered: Vec<bool>,
    /// Of a single effect of the catalogue: gain of log score on data left out, nats, of what was
    /// found and of the true extension at its true parameters.
    pub held_out_gains: Option<(f64, f64)>,
    /// Coordinate of what is unexplained.
    pub coordinate: Option<String>,
    /// Where the answer is ambiguous: the next flight.
    pub next_flight: Option<FlownOn>,
    /// Kinds of flaws of the raw data that were said, with their platforms.
    pub flaws: Vec<(String, String)>,
}

/// A next flight: what it promised, and what came of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FlownOn {
    /// Separation that it promised, nats.
    pub expected_nats: f64,
    /// Probability of settling the matter that it promised.
    pub settles_probability: f64,
    /// Whether it settled the matter.
    pub settled: bool,
}

impl Outcome {
    fn new(task: &Task) -> Self {
        Self {
            task: task.clone(),
            unreachable: false,
            error: None,
            forward: None,
            nats: 0.0,
            verdict: None,
            sets: Vec::new(),
            in_sets: 0,
            named: 0,
            whole_size: None,
            set_size: None,
            nameable: None,
            confidently_wrong: false,
            stated: None,
            covered: Vec::new(),
            held_out_gains: None,
            coordinate: None,
            next_flight: None,
            flaws: Vec::new(),
        }
    }

    /// Whether anything was found.
    pub fn detected(&self) -> bool {
        self.verdict.is_some_and(|v| v != Verdict::None)
    }
}

/// Makes the case of `task`, gives its files to the finder, and judges the answer.
pub fn judge(task: &Task) -> Outcome {
    match tune::tune(task) {
        Ok(Some(tuned)) => judge_tuned(task, tuned),
        Ok(None) => Outcome {
            unreachable: true,
            ..Outcome::new(task)
        },
        Err(error) => Outcome {
            error: Some(error),
            ..Outcome::new(task)
        },
    }
}

/// Gives the files of a case made for `task` to the finder, and judges the answer.
pub fn judge_tuned(task: &Task, tuned: Tuned) -> Outcome {
    let mut outcome = Outcome::new(task);
    outcome.nats = tuned.nats;
    outcome.forward = Some(tuned.case.truth.forward);
    match answer(task, &tuned.case) {
        Ok(analysis) => {
            let two = matches!(task.kind, Kind::Two(..));
            let alike = Alike::new(&tuned, &analysis, two);
            if two {
                outcome.nameable = alike.nameable(&tuned.case.truth.effects);
            }
            compare(&mut outcome, &tuned.case.truth, &analysis, &alike);
            if matches!(task.kind, Kind::One(_)) {
                outcome.held_out_gains = held_out_gains(&tuned, &analysis);
                if outcome.verdict == Some(Verdict::Ambiguous) {
                    outcome.next_flight = fly_on(task, &tuned, &analysis);
                }
            }
        }
        Err(error) => outcome.error = Some(error),
    }
    outcome
}

/// What the extension and the truth gain on data left out; nothing where nothing was extended.
fn held_out_gains(tuned: &Tuned, analysis: &Analysis) -> Option<(f64, f64)> {
    let mechanisms = tune::mechanisms(&tuned.case.truth).ok()?;
    let (base, truth) = tuned.fitted.as_ref()?.held_out_scores(&mechanisms);
    let gain = analysis.json.gain.as_ref();
    let own = gain.map_or(0.0, |g| g.held_out.log_score_after - base);
    Some((own, truth - base))
}

/// What the next flight promises, and whether the matter is settled once it is flown: a cause
/// holds the effect, and no longer both it and what the flight was to separate.
fn fly_on(task: &Task, tuned: &Tuned, analysis: &Analysis) -> Option<FlownOn> {
    let next = analysis.json.next_flight.as_ref()?;
    let waypoint = |w: &gap::verdict::Waypoint| further::TrackWaypoint {
        time_s: w.time_s,
        lat_deg: w.lat_deg,
        lon_deg: w.lon_deg,
        alt_amsl_m: w.alt_amsl_m,
    };
    let flight = FurtherFlight {
        platform: next.platform.clone().unwrap_or_else(|| "uav1".to_owned()),
        waypoints: next.waypoints.iter().map(waypoint).collect(),
    };
    let spec = task.spec(tuned.scene_seed, &tuned.strengths);
    let files = Case::flown_on(&spec, &flight);
    let after = find(task, &tuned.case.scenario_toml, &files).ok()?;
    let truth = tuned.case.truth.effects.first()?;
    let (first, others) = next.separates.split_first()?;
    let settled = after.json.causes.iter().any(|c| {
        let has = |id: &String| c.mechanisms.contains(id);
        holds(c, truth) && !(has(first) && others.iter().any(has))
    });
    Some(FlownOn {
        expected_nats: next.expected_nats,
        settles_probability: next.settles_probability,
        settled,
    })
}

fn answer(task: &Task, case: &Case) -> Result<Analysis, String> {
    let mut files = case.observations.clone();
    if let Kind::Mutated(mutation) = task.kind {
        for (_, text) in &mut files {
            *text = mutate(text, mutation, task.seed);
        }
    }
    find(task, &case.scenario_toml, &files)
}

/// The finder's answer to files.
fn find(task: &Task, scenario_toml: &str, files: &[(String, String)]) -> Result<Analysis, String> {
    let read = tune::read(scenario_toml, files)?;
    let options = Options {
        seed: task.seed,
        threads: 1,
        ..Options::default()
    };
    analyse(&read.setup, &read.observations, &options, &mut |_| {}).map_err(|e| e.to_string())
}

/// Nats of expected difference below which no method could state one of two at 95 %: ln 19.
const APART_NATS: f64 = 2.944;

/// Probability that data tell the truth at 95 % from what it beats by `nats` on average: under
/// Gaussian noise the difference of two log likelihoods has twice its mean for variance.
fn told_apart(nats: f64) -> f64 {
    Normal::standard().cdf((nats - APART_NATS) / (2.0 * nats).sqrt())
}

/// What each hidden effect looks like on the tracks of its case.
struct Alike {
    of: Vec<Vec<Likeness>>,
}

impl Alike {
    /// Looked at of `all` effects, or only where some set that holds the effect holds others too.
    fn new(tuned: &Tuned, analysis: &Analysis, all: bool) -> Self {
        let effects = &tuned.case.truth.effects;
        let wider = |e: &TrueEffect| {
            let causes = analysis.json.causes.iter();
            causes
                .filter(|c| holds(c, e))
                .any(|c| c.mechanisms.iter().any(|id| !names(e, id)))
        };
        let mut of = vec![Vec::new(); effects.len()];
        let asked: Vec<usize> = (0..effects.len())
            .filter(|k| all || wider(&effects[*k]))
            .collect();
        // Without an answer nothing counts as alike.
        for (k, found) in asked.iter().zip(Self::look(tuned, &asked)) {
            of[*k] = found;
        }
        Self { of }
    }

    fn look(tuned: &Tuned, asked: &[usize]) -> Vec<Vec<Likeness>> {
        let effects = &tuned.case.truth.effects;
        let (Ok(mechanisms), Some(fitted)) = (tune::mechanisms(&tuned.case.truth), &tuned.fitted)
        else {
            return Vec::new();
        };
        if mechanisms.len() != effects.len() {
            return Vec::new();
        }
        let near = |k: &usize| fitted.likenesses(&mechanisms, *k);
        asked.iter().map(near).collect()
    }

    /// How probable it is at most that data such as these tell every effect, at 95 %, from what is
    /// most like it of what does not count as inseparable; none where nothing is known of one.
    fn nameable(&self, effects: &[TrueEffect]) -> Option<f64> {
        let mut all = 1.0;
        for (effect, likenesses) in effects.iter().zip(&self.of) {
            if likenesses.is_empty() {
                return None;
            }
            let others = likenesses
                .iter()
                .filter(|l| l.nats >= APART_NATS && !names(effect, l.id.as_str()));
            all *= others.map(|l| told_apart(l.nats)).fold(1.0, f64::min);
        }
        Some(all)
    }

    /// Whether nothing tells `id` from the effect `k`, here or anywhere.
    fn names(&self, k: usize, effect: &TrueEffect, id: &str) -> bool {
        names(effect, id)
            || self.of[k]
                .iter()
                .any(|l| l.nats < APART_NATS && l.id.as_str() == id)
    }
}

/// Whether `id` names the effect or what no such data tell from it.
fn names(truth: &TrueEffect, id: &str) -> bool {
    let like = truth.effect.inseparable_from(truth.platforms.is_empty());
    truth.effect.id() == id || like.iter().any(|e| e.id() == id)
}

/// Whether a cause holds the effect.
fn holds(cause: &Cause, truth: &TrueEffect) -> bool {
    cause.mechanisms.iter().any(|id| names(truth, id))
}

fn compare(outcome: &mut Outcome, truth: &Truth, analysis: &Analysis, alike: &Alike) {
    let json = &analysis.json;
    outcome.verdict = Some(json.verdict);
    outcome.sets = json.causes.iter().map(|c| c.mechanisms.clone()).collect();
    outcome.coordinate = json.unexplained.as_ref().map(|u| u.coordinate.clone());
    outcome.flaws = json
        .data_quality
        .iter()
        .map(|q| (format!("{:?}", q.kind).to_lowercase(), q.platform.clone()))
        .collect();
    let causes = &json.causes;
    let hidden: Vec<(usize, &TrueEffect)> = truth
        .effects
        .iter()
        .enumerate()
        .filter(|(_, e)| e.effect.in_catalogue())
        .collect();
    // Nothing but the effect and what cannot be told from it, on its platforms.
    let alone = |c: &Cause, k: usize, e: &TrueEffect| {
        holds(c, e)
            && c.mechanisms.iter().all(|id| alike.names(k, e, id))
            && (e.platforms.is_empty() || c.platforms == e.platforms)
    };
    let counted = |right: &dyn Fn(&Cause, usize, &TrueEffect) -> bool| {
        let said = |(k, e): &&(usize, &TrueEffect)| causes.iter().any(|c| right(c, *k, e));
        hidden.iter().filter(said).count()
    };
    outcome.in_sets = counted(&|c, _, e| holds(c, e));
    outcome.named = counted(&alone);
    // A ceiling is what saturation is, wherever it comes from.
    let clipped = outcome.task.kind == Kind::Damaged(DamageKind::Clipped);
    let is_right = |c: &Cause| {
        hidden.iter().any(|(_, e)| holds(c, e))
            || (clipped && c.mechanisms[0] == PlumeEffect::SensorSaturation.id())
    };
    outcome.confidently_wrong = json.verdict != Verdict::Unexplained
        && causes
            .iter()
            .any(|c| c.mechanisms.len() == 1 && !is_right(c));
    (outcome.whole_size, outcome.set_size) = sizes(causes, &hidden, alike).unzip();
    outcome.stated = causes
        .first()
        .map(|c| (c.probability, hidden.iter().any(|(_, e)| holds(c, e))));
    outcome.covered = coverage(truth, &json.causes);
}

/// Mean size of the sets that hold a hidden effect, and the same without what cannot be told
/// from it.
fn sizes(causes: &[Cause], hidden: &[(usize, &TrueEffect)], alike: &Alike) -> Option<(f64, f64)> {
    let sizes: Vec<(f64, f64)> = causes
        .iter()
        .filter_map(|c| {
            let (k, effect) = hidden.iter().find(|(_, e)| holds(c, e))?;
            let known = |id: &&String| alike.names(*k, effect, id);
            let others = c.mechanisms.len() - c.mechanisms.iter().filter(known).count();
            Some((c.mechanisms.len() as f64, 1.0 + others as f64))
        })
        .collect();
    let sum = |of: fn(&(f64, f64)) -> f64| sizes.iter().map(of).sum::<f64>();
    let n = sizes.len() as f64;
    (!sizes.is_empty()).then(|| (sum(|s| s.0) / n, sum(|s| s.1) / n))
}

/// Coverage of the parameters of hidden effects that are named alone.
fn coverage(truth: &Truth, causes: &[Cause]) -> Vec<bool> {
    let mut covered = Vec::new();
    if truth.other_laws {
        return covered;
    }
    for effect in &truth.effects {
        let id = effect.effect.id();
        // What is said of another platform says nothing of the truth's parameters.
        let right = |c: &&Cause| {
            c.mechanisms == [id] && (effect.platforms.is_empty() || c.platforms == effect.platforms)
        };
        for cause in causes.iter().filter(right) {
            for parameter in &effect.parameters {
                let fitted = cause
                    .parameters
                    .iter()
                    .find(|p| p.mechanism == id && p.name == parameter.name);
                // Settings such as a pivot come without a deviation.
                if let Some(p) = fitted.filter(|p| p.sd > 0.0) {
                    covered.push((p.value - parameter.value).abs() < 1.96 * p.sd);
                }
            }
        }
    }
    covered
}

#[cfg(test)]
mod tests {
    use super::*;

    // python3: statistics.NormalDist(9, 18**.5) beyond 2.944: 1 - NormalDist(9, 18**.5).cdf(2.944)
    #[test]
    fn what_is_inseparable_is_told_half_the_time_and_more_if_farther() {
        assert!((told_apart(APART_NATS) - 0.5).abs() < 1e-12);
        assert!(
            (told_apart(9.0) - 0.923_269).abs() < 1e-5,
            "{}",
            told_apart(9.0)
        );
    }
}
