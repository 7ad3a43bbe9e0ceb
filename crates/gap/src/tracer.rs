//! Tracer trials: fixed samplers on arcs around a release, over many trials, against the
//! Gaussian plume with Briggs' open-country spread.
//!
//! Each arc is split into its crosswind-integrated concentration, which knows of vertical
//! spread, transport and loss, and its width, which knows of lateral spread; towers show
//! vertical spread itself. Trials in unstable (1/L below 0) and in stable air are two questions
//! of their own, vertical and lateral each. Models are fitted with the errors that trials share
//! (`fit`), ranked by evidence and by their scores on trials left out; predictions of a
//! trial left out are the mean over models by their probability given the others.
//!
//! Pure: texts in, report out.

mod apply;
mod arcs;
mod checks;
mod extension;
mod findings;
mod fit;
mod gain;
mod model;
mod predicted;
pub mod table;
mod words;

use plume::stability::Stability;
use serde::{Deserialize, Serialize};

use crate::GapError;
use crate::applied::EarlierTracer;
use crate::verdict::{
    Cause, DETECTABLE_NATS, Detectable, Gain, GapJson, NextFlight, Parameter, Ranked, SCHEMA,
    Unexplained, UnexplainedKind, Verdict, number_or_null,
};
pub use apply::apply;
use arcs::{Arc, TrialArcs};
use checks::Read;
use findings::Finding;
use fit::{Trials, without};
use model::{DEPOSITION, Datum, Model, Quantity};
pub use predicted::ArcDetail;
use table::Tables;

/// What `gap tracer` found: `gap.json` with a further field `tracer`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TracerReport {
    /// The fields that all of `gap.json` has.
    #[serde(flatten)]
    pub gap: GapJson,
    /// Arcs, models and limits behind them.
    pub tracer: TracerDetail,
    /// A scenario with the extension of the kind of air in which the cause is clearest.
    #[serde(skip)]
    pub extended_toml: String,
}

impl TracerReport {
    /// The text of `gap.json`, indented.
    ///
    /// # Errors
    /// Only if serialisation itself fails.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self)
    }
}

/// What stands behind a tracer verdict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TracerDetail {
    /// Limits of 1/L between classes at the trials' roughness.
    pub class_limits: Vec<ClassLimit>,
    /// For each of `causes`, in their order, the inputs that its numbers are relative to; none
    /// for Briggs' class curve and the wind as measured.
    pub relative_to: Vec<Vec<String>>,
    /// Roughness length of those limits, m.
    pub roughness_m: f64,
    /// Kinds of air with the models tried.
    pub groups: Vec<GroupDetail>,
    /// Every arc, measured and predicted.
    pub arcs: Vec<ArcDetail>,
}

/// Where one stability class ends and the next begins.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClassLimit {
    /// The class, "A" to "F".
    pub class: char,
    /// It begins at this 1/L, 1/m; null for A.
    pub from_per_m: f64,
    /// It ends at this 1/L, 1/m; null for F.
    pub to_per_m: f64,
}

/// One kind of air.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GroupDetail {
    /// "unstable" or "stable".
    pub group: String,
    /// Its trials.
    pub trials: Vec<String>,
    /// Models of the crosswind-integrated concentration, the most probable first.
    pub vertical: Vec<TriedModel>,
    /// Models of the width, the most probable first: of the trials with a deviation of azimuth.
    pub lateral: Vec<TriedModel>,
    /// The same of the trials without, or of all where too few measured it.
    pub lateral_without_azimuth: Vec<TriedModel>,
}

/// A model that was tried on a group of trials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TriedModel {
    /// Its changes; empty for Briggs with the wind as measured.
    pub mechanisms: Vec<String>,
    /// Gain of the log score over the base, nats.
    #[serde(deserialize_with = "number_or_null")]
    pub delta_log_score: f64,
    /// Gain of the log evidence over the base, nats.
    #[serde(deserialize_with = "number_or_null")]
    pub delta_log_evidence: f64,
    /// Probability among the models tried.
    pub probability: f64,
    /// Gain over the base on trials left out, nats.
    #[serde(deserialize_with = "number_or_null")]
    pub held_out_gain: f64,
    /// Its standard error over trials, nats.
    #[serde(deserialize_with = "number_or_null")]
    pub held_out_gain_se: f64,
    /// Fitted parameters.
    pub parameters: Vec<Parameter>,
}

/// Fewest trials of a kind of air for a fit.
pub const LEAST_TRIALS: usize = 4;

/// Kinds of air by the sign of the Obukhov length.
const AIRS: [(&str, f64); 2] = [("unstable", -1.0), ("stable", 1.0)];

/// A kind of air with everything that was tried on it.
struct Answer<'a> {
    name: &'static str,
    trials: Vec<&'a TrialArcs>,
    /// Of integrals and towers, which there always are, of widths of trials that measured the deviation of azimuth, and
    /// of widths of the others.
    findings: [Option<Finding>; 3],
    leftover: Option<Unexplained>,
}

impl Answer<'_> {
    fn findings(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().flatten()
    }
}

/// Analyses tracer trials. `seed` is for the bootstrap of the scores; `progress` gets the part
/// done, 0 to 1.
///
/// # Errors
/// [`GapError::Data`] when fewer than [`LEAST_TRIALS`] trials of either kind of air have wind,
/// Obukhov length and arcs.
pub fn analyse(
    tables: &Tables,
    seed: u64,
    progress: &mut dyn FnMut(f64),
) -> Result<TracerReport, GapError> {
    let mut read = checks::read(tables);
    let trials = &read.trials;
    let mut answers = Vec::new();
    for (k, (name, sign)) in AIRS.into_iter().enumerate() {
        match answer(name, in_air(trials, sign)) {
            Ok(answer) => answers.push(answer),
            Err(notice) => read.notices.push(notice),
        }
        progress(0.45 + 0.45 * k as f64);
    }
    if answers.is_empty() {
        return Err(GapError::Data {
            what: "tracer trials".into(),
            problem: format!(
                "{} trials have wind, Obukhov length and arcs, {} of them whole ones: {}",
                trials.len(),
                trials.iter().filter(|t| t.whole().count() > 0).count(),
                arcs::lacking(tables)
            ),
            expected: format!("at least {LEAST_TRIALS} in unstable or in stable air"),
        });
    }
    let arcs: Vec<ArcDetail> = answers.iter().flat_map(predicted).collect();
    let logs = answers.iter().flat_map(Answer::findings);
    let logs: Vec<[f64; 2]> = logs.flat_map(|f| gain::log_scores(&f.scored)).collect();
    let (gain, _) = gain::gain(&arcs, &logs, seed)?;
    progress(1.0);
    let off = read.amounts.clone().map(|amounts| Unexplained {
        kind: UnexplainedKind::FailedCheck,
        coordinate: "map".into(),
        term: amounts,
        from_s: f64::NAN,
        to_s: f64::NAN,
        platforms: answers.iter().map(|a| a.name.to_owned()).collect(),
        delta_log_evidence: f64::NAN,
        candidates: Vec::new(),
    });
    if off.is_some() {
        // The numbers stand; what they are put down to does not.
        let findings = answers.iter_mut().flat_map(|a| &mut a.findings);
        findings.flatten().for_each(|f| f.causes.clear());
    }
    let (causes, relative_to) = causes(&answers);
    let found = EarlierTracer {
        relative_to,
        groups: answers.iter().map(group).collect(),
    };
    let summary = words::summary(&answers, &gain);
    let mut report = report(&read, found, arcs, gain);
    report.extended_toml = extension::scenario(&answers);
    let gap = &mut report.gap;
    let what = match off {
        Some(_) => "No cause can be named",
        None => "The data deviate from the model, and none of the changes accounts for it",
    };
    gap.unexplained = off.or_else(|| answers.iter().find_map(|a| a.leftover.clone()));
    gap.summary = match &gap.unexplained {
        Some(unexplained) => format!("{what}: {}. {summary}", unexplained.term),
        None => summary,
    };
    gap.verdict = Verdict::of(&causes, gap.unexplained.is_some());
    gap.next_flight = match gap.verdict {
        Verdict::Ambiguous => next_trials(&causes),
        _ => None,
    };
    gap.causes = causes;
    gap.ranking = answers.iter().flat_map(ranked).collect();
    gap.ranking
        .sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    gap.detectable = answers.iter().flat_map(detectable).collect();
    Ok(report)
}

/// The trials of which the Obukhov length has this sign.
fn in_air(trials: &[TrialArcs], sign: f64) -> Vec<&TrialArcs> {
    let is_in = |t: &&TrialArcs| t.weather.obukhov_length_m * sign > 0.0;
    trials.iter().filter(is_in).collect()
}

/// Tries everything on the trials of one kind of air; a notice where they do not allow it.
///
/// With fewer than [`LEAST_TRIALS`] trials that measured the deviation of azimuth the widths of all are taken together,
/// with fewer that did not theirs are not asked.
fn answer<'a>(name: &'static str, trials: Vec<&'a TrialArcs>) -> Result<Answer<'a>, String> {
    let count = trials.len();
    if count < LEAST_TRIALS {
        return Err(format!(
            "{count} trials in {name} air are too few for a fit (at least {LEAST_TRIALS})"
        ));
    }
    let whole = trials.iter().filter(|t| t.whole().count() > 0).count();
    if whole < LEAST_TRIALS {
        return Err(format!(
            "{whole} trials in {name} air have an arc in which the plume ends and is resolved: too few for a fit (at \
             least {LEAST_TRIALS})"
        ));
    }
    let of = |data: &dyn Fn(&TrialArcs) -> Vec<Datum>| Trials {
        trials: &trials,
        data: trials.iter().map(|t| data(t)).collect(),
    };
    let is_known = |t: &TrialArcs| t.weather.sigma_azimuth_rad.is_some();
    let known = trials.iter().filter(|t| is_known(t)).count();
    let (is_enough, are_others) = (known >= LEAST_TRIALS, count - known >= LEAST_TRIALS);
    let width = |a: &Arc| Datum::new(Quantity::Width, a.width_m, a.distance_m);
    let widths = |t: &TrialArcs, is_used: bool| t.whole().filter(|_| is_used).map(width).collect();
    let vertical = of(&vertical_data);
    let with_azimuth = of(&|t| widths(t, is_enough && is_known(t)));
    let without = of(&|t| widths(t, !is_enough || (are_others && !is_known(t))));
    let find = |trials: &Trials<'_>, models: &[Model]| {
        let impossible = || format!("{name} air: Briggs' spread cannot be fitted to these arcs");
        if trials.data.iter().all(Vec::is_empty) {
            return Ok(None);
        }
        let finding = findings::judge(trials.score(models), name);
        finding.ok_or_else(impossible).map(Some)
    };
    let findings = [
        find(&vertical, &Model::vertical())?,
        find(&with_azimuth, &Model::lateral(true))?,
        find(&without, &Model::lateral(false))?,
    ];
    let leftover = findings[0].as_ref();
    Ok(Answer {
        name,
        leftover: leftover.and_then(|f| findings::leftover(&vertical, &f.scored, name)),
        findings,
        trials,
    })
}

/// Crosswind integrals of the whole arcs, and vertical spreads at the towers.
fn vertical_data(trial: &TrialArcs) -> Vec<Datum> {
    let arcs = trial.whole().map(|a| {
        let quantity = Quantity::Integral {
            height_m: a.height_m,
        };
        Datum::new(quantity, a.integrated_mg_m2, a.distance_m)
    });
    let towers = trial.tower_spreads_m.iter();
    let towers = towers.map(|(x_m, sigma_m)| Datum::new(Quantity::TowerSpread, *sigma_m, *x_m));
    arcs.chain(towers).collect()
}

/// The arcs of each trial, predicted from the other trials.
fn predicted(answer: &Answer<'_>) -> Vec<ArcDetail> {
    let mut out = Vec::new();
    for (i, trial) in answer.trials.iter().enumerate() {
        let models = answer.findings.each_ref().map(|finding| {
            let scored = finding.as_ref().map_or(&[][..], |f| &f.scored);
            without(scored, i)
        });
        let arcs = trial.arcs.iter();
        out.extend(arcs.map(|a| predicted::arc(&trial.weather, answer.name, a, &models)));
    }
    out
}

/// All causes, the strongest first, and the inputs that each is relative to.
fn causes(answers: &[Answer<'_>]) -> (Vec<Cause>, Vec<Vec<String>>) {
    let mut each: Vec<(Cause, Vec<String>)> = Vec::new();
    for finding in answers.iter().flat_map(Answer::findings) {
        let relative_to = &finding.relative_to;
        each.extend(
            finding
                .causes
                .iter()
                .map(|c| (c.clone(), relative_to.clone())),
        );
    }
    let nats = |c: &Cause| c.evidence.delta_log_evidence;
    each.sort_by(|a, b| nats(&b.0).total_cmp(&nats(&a.0)));
    each.into_iter().unzip()
}

/// What an analysis and an application report alike.
fn report(read: &Read, found: EarlierTracer, arcs: Vec<ArcDetail>, gain: Gain) -> TracerReport {
    let flaws = read.flaws.iter().map(|f| &f.message);
    let roughness_m = read.trials[0].weather.roughness_m;
    TracerReport {
        gap: GapJson {
            schema: SCHEMA,
            residual: predicted::residual(&arcs),
            gain: Some(gain),
            data_quality: read.flaws.clone(),
            notices: flaws.chain(&read.notices).cloned().collect(),
            ..GapJson::default()
        },
        tracer: TracerDetail {
            class_limits: class_limits(roughness_m),
            relative_to: found.relative_to,
            roughness_m,
            groups: found.groups,
            arcs,
        },
        extended_toml: String::new(),
    }
}

fn class_limits(roughness_m: f64) -> Vec<ClassLimit> {
    let limits = Stability::limits_per_m(roughness_m);
    let limit = |class: &Stability| ClassLimit {
        class: class.letter(),
        from_per_m: class.index().checked_sub(1).map_or(f64::NAN, |k| limits[k]),
        to_per_m: limits.get(class.index()).copied().unwrap_or(f64::NAN),
    };
    Stability::ALL.iter().map(limit).collect()
}

fn group(answer: &Answer<'_>) -> GroupDetail {
    let tried = |f: &Option<Finding>| f.as_ref().map_or(Vec::new(), |f| f.tried.clone());
    let [vertical, lateral, lateral_without_azimuth] = answer.findings.each_ref().map(tried);
    GroupDetail {
        group: answer.name.to_owned(),
        trials: answer
            .trials
            .iter()
            .map(|t| t.weather.trial.clone())
            .collect(),
        vertical,
        lateral,
        lateral_without_azimuth,
    }
}

fn ranked(answer: &Answer<'_>) -> Vec<Ranked> {
    let tried = answer.findings().flat_map(|f| &f.tried);
    let ranked = tried.map(|t| Ranked {
        mechanisms: t.mechanisms.clone(),
        platform: Some(answer.name.to_owned()),
        delta_log_score: t.delta_log_score,
        log_evidence: t.delta_log_evidence,
        probability: t.probability,
    });
    ranked.collect()
}

/// The smallest single vertical changes that would have shown.
fn detectable(answer: &Answer<'_>) -> Vec<Detectable> {
    let tried = answer.findings[0].iter().flat_map(|f| &f.tried);
    let single = tried.filter(|t| t.mechanisms.len() == 1);
    let own = single.flat_map(|t| {
        let own = move |p: &&Parameter| p.mechanism == t.mechanisms[0] && p.sd > 0.0;
        t.parameters.iter().filter(own)
    });
    let seen = own.map(|p| Detectable {
        // Gain = (effect / sd)² / 2.
        value: (2.0 * DETECTABLE_NATS).sqrt() * p.sd,
        mechanism: p.mechanism.clone(),
        parameter: p.name.clone(),
        unit: p.unit.clone(),
    });
    seen.collect()
}

/// What would tell the rivals of a set apart: towers where the arcs are.
fn next_trials(causes: &[Cause]) -> Option<NextFlight> {
    let cause = causes.iter().find(|c| c.mechanisms.len() > 1)?;
    let is_vertical = |m: &String| m.starts_with("sigma-z") || m == DEPOSITION;
    let description = if cause.mechanisms.iter().any(is_vertical) {
        "samplers on towers at the farthest arcs: spread changes the profile there, a loss at the \
         ground only its lowest part and its sum; or a tracer that the ground does not take up"
    } else {
        "wind vanes at two heights, and more samplers inside the plume at the farthest arcs"
    };
    Some(NextFlight::in_words(&cause.mechanisms, description))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_follow_each_other_and_agree_with_the_classes() {
        let limits = class_limits(0.006);
        assert_eq!(limits.len(), 6);
        for pair in limits.windows(2) {
            assert!((pair[0].to_per_m - pair[1].from_per_m).abs() < 1e-12);
            assert!(pair[1].to_per_m.is_nan() || pair[1].to_per_m > pair[1].from_per_m);
        }
        let d = &limits[3];
        assert_eq!(
            Stability::from_obukhov(1.0 / (d.to_per_m - 1e-6), 0.006),
            Stability::D
        );
        assert_eq!(
            Stability::from_obukhov(1.0 / (d.to_per_m + 1e-6), 0.006),
            Stability::E
        );
    }
}
