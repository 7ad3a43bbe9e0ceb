//! Tracer trials: fixed samplers on arcs around a release, over many trials, against the
//! Gaussian plume with Briggs' open-country spread.
//!
//! Each arc is split into its crosswind-integrated concentration, which knows of vertical
//! spread, transport and loss, and its width, which knows of lateral spread; towers show
//! vertical spread itself. Trials in unstable (1/L below 0) and in stable air are two questions
//! of their own, vertical and lateral each. Models are fitted with the errors that trials share
//! ([`evidence`]), ranked by evidence and by their scores on trials left out; predictions of a
//! trial left out are the mean over models by their probability given the others.
//!
//! Pure: texts in, report out.

mod apply;
pub mod arcs;
mod checks;
mod detail;
pub mod evidence;
mod extension;
mod findings;
pub mod ladder;
mod leftover;
pub mod model;
mod parameters;
mod scores;
pub mod surface_layer;
pub mod table;
mod trial_scores;
pub(crate) mod tried;

use serde::Serialize;

use crate::GapError;
use crate::verdict::{
    Cause, DataQuality, Detectable, Flaw, Gain, GapJson, NextFlight, Ranked, ResidualBin, SCHEMA,
    Unexplained, UnexplainedKind, Verdict,
};
pub use apply::apply;
use arcs::TrialArcs;
use checks::Suspicions;
pub use detail::{ArcDetail, ClassLimit};
use findings::{Finding, judge};
use ladder::{Group, LateralModel, Tried, VerticalModel, Widths};
use table::Tables;
use trial_scores::{Scored, score};
pub use tried::{GroupDetail, TriedModel};

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

/// Fewest trials of a kind of air for a fit.
pub const LEAST_TRIALS: usize = 4;

/// Kinds of air by the sign of the Obukhov length.
const GROUPS: [(&str, f64); 2] = [("unstable", -1.0), ("stable", 1.0)];

/// A question: what was tried on it, and what it came to.
struct Question {
    scored: Vec<(usize, Scored)>,
    finding: Finding,
}

/// A kind of air with everything that was tried on it.
struct Answer<'a> {
    name: &'static str,
    group: Group<'a>,
    vertical: Question,
    lateral: Vec<(Widths, Question)>,
    leftover: Option<Unexplained>,
}

impl Answer<'_> {
    fn questions(&self) -> impl Iterator<Item = &Question> {
        std::iter::once(&self.vertical).chain(self.lateral.iter().map(|l| &l.1))
    }

    /// The question about widths of that kind.
    fn lateral_of(&self, widths: Widths) -> Option<&Question> {
        self.lateral.iter().find(|l| l.0 == widths).map(|l| &l.1)
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
    let (trials, mut notices) = arcs::trials(tables);
    notices.splice(0..0, tables.notices.iter().cloned());
    let mut answers = Vec::new();
    for (k, (name, sign)) in GROUPS.into_iter().enumerate() {
        let of_kind = |t: &&TrialArcs| t.weather.obukhov_length_m * sign > 0.0;
        let chosen: Vec<&TrialArcs> = trials.iter().filter(of_kind).collect();
        match answer(name, chosen) {
            Ok(answer) => answers.push(answer),
            Err(notice) => notices.push(notice),
        }
        progress(0.45 + 0.45 * k as f64);
    }
    if answers.is_empty() {
        return Err(GapError::Data {
            what: "tracer trials".into(),
            problem: format!(
                "{} trials have wind, Obukhov length and arcs, {} of them whole ones: {}",
                trials.len(),
                trials
                    .iter()
                    .filter(|t| t.arcs.iter().any(|a| a.whole))
                    .count(),
                arcs::lacking(tables)
            ),
            expected: format!("at least {LEAST_TRIALS} in unstable or in stable air"),
        });
    }
    let suspicions = checks::suspicions(&trials);
    if suspicions.amounts {
        // The numbers stand; what they are put down to does not.
        for answer in &mut answers {
            answer.vertical.finding.causes.clear();
            let lateral = answer.lateral.iter_mut();
            lateral.for_each(|l| l.1.finding.causes.clear());
        }
    }
    let arcs = detail::arcs(&answers);
    let gain = scores::gain(&answers, &arcs, seed)?;
    progress(1.0);
    let roughness_m = trials[0].weather.roughness_m;
    let (gap, relative_to) = gap_json(&answers, &arcs, gain, notices, suspicions);
    let report = TracerReport {
        extended_toml: extension::scenario(&answers),
        gap,
        tracer: TracerDetail {
            class_limits: detail::class_limits(roughness_m),
            relative_to,
            roughness_m,
            groups: answers.iter().map(detail::group).collect(),
            arcs,
        },
    };
    Ok(report)
}

/// Tries everything on the trials of one kind of air; a notice where they do not allow it.
fn answer<'a>(name: &'static str, chosen: Vec<&'a TrialArcs>) -> Result<Answer<'a>, String> {
    if chosen.len() < LEAST_TRIALS {
        return Err(format!(
            "{} trials in {name} air are too few for a fit (at least {LEAST_TRIALS})",
            chosen.len()
        ));
    }
    let whole = |t: &&&TrialArcs| t.arcs.iter().any(|a| a.whole);
    let with_whole_arcs = chosen.iter().filter(whole).count();
    if with_whole_arcs < LEAST_TRIALS {
        return Err(format!(
            "{with_whole_arcs} trials in {name} air have an arc in which the plume ends and is \
             resolved: too few for a fit (at least {LEAST_TRIALS})"
        ));
    }
    let group = Group::new(chosen, LEAST_TRIALS);
    let impossible = || format!("{name} air: Briggs' spread cannot be fitted to these arcs");
    let models = VerticalModel::all();
    let vertical = question(&group, &models, name).ok_or_else(impossible)?;
    let mut lateral = Vec::new();
    for widths in [Widths::WithAzimuth, Widths::WithoutAzimuth] {
        if group.asks(widths) {
            let asked = question(&group, &LateralModel::all(widths), name);
            lateral.push((widths, asked.ok_or_else(impossible)?));
        }
    }
    let best = vertical.scored.iter().max_by(|a, b| {
        let evidence = |s: &Scored| s.fit.log_evidence;
        evidence(&a.1).total_cmp(&evidence(&b.1))
    });
    let leftover = best.and_then(|(m, s)| {
        let gain = vertical.finding.tried[0].delta_log_evidence;
        leftover::unexplained(&group, name, (&models[*m], &s.fit), gain)
    });
    Ok(Answer {
        leftover,
        name,
        group,
        vertical,
        lateral,
    })
}

fn question<T: Tried>(group: &Group<'_>, models: &[T], air: &str) -> Option<Question> {
    let scored = score(group, models);
    let finding = judge(&scored, air)?;
    Some(Question { scored, finding })
}

/// All causes, the strongest first, and the inputs that each is relative to.
fn causes(answers: &[Answer<'_>]) -> (Vec<Cause>, Vec<Vec<String>>) {
    let questions = answers.iter().flat_map(Answer::questions);
    let mut each: Vec<(Cause, Vec<String>)> = questions
        .flat_map(|q| q.finding.causes.iter().map(|c| (c, &q.finding.relative_to)))
        .map(|(c, inputs)| (c.clone(), inputs.iter().map(|i| (*i).to_owned()).collect()))
        .collect();
    each.sort_by(|a, b| {
        let nats = |c: &Cause| c.evidence.delta_log_evidence;
        nats(&b.0).total_cmp(&nats(&a.0))
    });
    each.into_iter().unzip()
}

fn gap_json(
    answers: &[Answer<'_>],
    arcs: &[ArcDetail],
    gain: Gain,
    mut notices: Vec<String>,
    suspicions: Suspicions,
) -> (GapJson, Vec<Vec<String>>) {
    let (causes, relative_to) = causes(answers);
    let unexplained = if suspicions.amounts {
        Some(off_amounts(answers, &suspicions))
    } else {
        answers.iter().find_map(|a| a.leftover.clone())
    };
    let verdict = Verdict::of(&causes, unexplained.is_some());
    let mut ranking: Vec<Ranked> = answers.iter().flat_map(ranked).collect();
    ranking.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    let mut summary = detail::summary(answers, &gain);
    if let Some(u) = &unexplained {
        let what = if suspicions.amounts {
            "No cause can be named"
        } else {
            "The data deviate from the model, and none of the changes accounts for it"
        };
        summary = format!("{what}: {}. {summary}", u.term);
    }
    let odd = notices.iter().filter_map(|n| odd_data(n));
    let data_quality: Vec<DataQuality> = suspicions.flaws.iter().cloned().chain(odd).collect();
    notices.splice(0..0, suspicions.flaws.into_iter().map(|f| f.message));
    let json = GapJson {
        schema: SCHEMA,
        gas: None,
        readings: None,
        verdict,
        summary,
        ranking,
        residual: residual(arcs),
        gain: Some(gain),
        detectable: answers.iter().flat_map(detectable).collect(),
        next_flight: if verdict == Verdict::Ambiguous {
            next(&causes)
        } else {
            None
        },
        base: Vec::new(),
        unexplained,
        insufficient: None,
        pairs: Vec::new(),
        contact: None,
        discrepancy: None,
        noise: None,
        applied: None,
        data_quality,
        notices,
        causes,
    };
    (json, relative_to)
}

/// Amounts off by a factor, as the misfit without a name that they are.
fn off_amounts(answers: &[Answer<'_>], suspicions: &Suspicions) -> Unexplained {
    Unexplained {
        kind: UnexplainedKind::FailedCheck,
        coordinate: "map".into(),
        term: suspicions
            .flaws
            .first()
            .map_or_else(String::new, |f| f.message.clone()),
        from_s: f64::NAN,
        to_s: f64::NAN,
        platforms: answers.iter().map(|a| a.name.to_owned()).collect(),
        delta_log_evidence: f64::NAN,
        candidates: Vec::new(),
    }
}

/// A notice on implausible corrections is also one on the quality of the data.
fn odd_data(notice: &str) -> Option<DataQuality> {
    let trial = notice.strip_prefix("trial ")?.split(':').next()?;
    notice.contains("implausible").then(|| DataQuality {
        platform: trial.to_owned(),
        kind: Flaw::Outlier,
        from_s: f64::NAN,
        to_s: f64::NAN,
        message: notice.to_owned(),
    })
}

fn ranked(answer: &Answer<'_>) -> Vec<Ranked> {
    let questions = answer.questions();
    questions
        .flat_map(|q| &q.finding.tried)
        .map(|t| Ranked {
            mechanisms: t.mechanisms.clone(),
            platform: Some(answer.name.to_owned()),
            delta_log_score: t.delta_log_score,
            log_evidence: t.delta_log_evidence,
            probability: t.probability,
        })
        .collect()
}

/// Mean of ln(measured/predicted) of arc maxima by kind of air and distance, as standardised
/// means; concentrations in ppm are not known without the gas.
fn residual(arcs: &[ArcDetail]) -> Vec<ResidualBin> {
    let mut bins: Vec<(String, f64, f64, Vec<f64>)> = Vec::new();
    for arc in arcs {
        let log = (arc.max_mg_m3 / arc.base_max_mg_m3).ln();
        let near = |b: &&mut (String, f64, f64, Vec<f64>)| {
            b.0 == arc.group && (arc.distance_m / b.1 - 1.0).abs() < 0.1
        };
        match bins.iter_mut().find(near) {
            Some(bin) => {
                bin.2 = bin.2.max(arc.distance_m);
                bin.3.push(log);
            }
            None => bins.push((arc.group.clone(), arc.distance_m, arc.distance_m, vec![log])),
        }
    }
    bins.into_iter()
        .map(|(group, from, to, logs)| {
            let n = logs.len() as f64;
            let mean = logs.iter().sum::<f64>() / n;
            let sd = (logs.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
            ResidualBin {
                coordinate: "along_wind".into(),
                platform: Some(group),
                from,
                to,
                unit: "m".into(),
                count: logs.len(),
                mean_ppm: f64::NAN,
                standardised: mean / (sd / n.sqrt()),
            }
        })
        .collect()
}

/// Log score at which an effect counts as visible, nats.
const VISIBLE_NATS: f64 = 20.0;

/// The smallest single vertical changes that would have shown.
fn detectable(answer: &Answer<'_>) -> Vec<Detectable> {
    let single = answer.vertical.scored.iter();
    let single = single.filter(|s| s.1.ids.len() == 1);
    single
        .flat_map(|s| {
            parameters::parameters(&s.1).into_iter().filter(|p| {
                // Gain = (effect / sd)² / 2.
                p.mechanism == s.1.ids[0] && p.sd > 0.0
            })
        })
        .map(|p| Detectable {
            value: (2.0 * VISIBLE_NATS).sqrt() * p.sd,
            mechanism: p.mechanism,
            parameter: p.name,
            unit: p.unit,
        })
        .collect()
}

/// What would tell the rivals of a set apart: towers where the arcs are.
fn next(causes: &[Cause]) -> Option<NextFlight> {
    let cause = causes.iter().find(|c| c.mechanisms.len() > 1)?;
    let vertical = cause
        .mechanisms
        .iter()
        .any(|m| m.starts_with("sigma-z") || m == "dry-deposition");
    let description = if vertical {
        "samplers on towers at the farthest arcs: spread changes the profile there, a loss at the \
         ground only its lowest part and its sum; or a tracer that the ground does not take up"
    } else {
        "wind vanes at two heights, and more samplers inside the plume at the farthest arcs"
    };
    Some(NextFlight {
        separates: cause.mechanisms.clone(),
        platform: None,
        description: description.into(),
        waypoints: Vec::new(),
        expected_nats: f64::NAN,
        settles_probability: f64::NAN,
    })
}
