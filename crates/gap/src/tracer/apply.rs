//! Models found on some trials, held against others. Nothing is fitted: the other trials are predicted by
//! the mean over the earlier models by their probability, with the earlier parameters.

use std::collections::BTreeSet;

use super::arcs::{self, Arc, TrialArcs, Weather};
use super::detail::{self, ArcDetail};
use super::model::{self, Lateral, Vertical};
use super::table::Tables;
use super::tried::{GroupDetail, TriedModel};
use super::{GROUPS, TracerDetail, TracerReport, checks, odd_data, parameters, residual, scores};
use crate::GapError;
use crate::applied::{Applied, AppliedScore, Earlier, Outcome, scores_in_words};
use crate::verdict::{DataQuality, Gain, GapJson, SCHEMA};
use plume::score::Pair;

/// Fewest trials whose scatter says how sure a score is.
const LEAST_FOR_INTERVALS: usize = 4;

/// A model of the earlier finding: its changes, their numbers and its probability.
struct Weighted<C> {
    changes: Vec<C>,
    theta: Vec<f64>,
    probability: f64,
}

/// The earlier models of one kind of air.
struct Models {
    vertical: Vec<Weighted<Vertical>>,
    /// Of the width, where the deviation of azimuth is known.
    lateral: Vec<Weighted<Lateral>>,
    /// The same where it is not.
    lateral_without_azimuth: Vec<Weighted<Lateral>>,
}

/// Holds the models of `earlier` against the trials of `tables`; `seed` is for the bootstrap of the
/// scores.
///
/// # Errors
/// [`GapError::Data`] for a finding of another kind or one with a model that is not known here, and where
/// no trial has wind, Obukhov length, arcs and a kind of air of which the finding has models.
pub fn apply(tables: &Tables, earlier: &Earlier, seed: u64) -> Result<TracerReport, GapError> {
    let found = earlier.tracer()?;
    let (trials, mut notices) = arcs::trials(tables);
    notices.splice(0..0, tables.notices.iter().cloned());
    notices.extend(said(&trials, &found.groups));
    let mut predicted = Vec::new();
    for (name, sign) in GROUPS {
        let of_kind = |t: &&TrialArcs| t.weather.obukhov_length_m * sign > 0.0;
        let chosen: Vec<&TrialArcs> = trials.iter().filter(of_kind).collect();
        match found.groups.iter().find(|g| g.group == name) {
            Some(group) => {
                let models = models(group, &earlier.name)?;
                predicted.extend(chosen.iter().flat_map(|t| predict(t, name, &models)));
            }
            None if chosen.is_empty() => {}
            None => notices.push(format!(
                "{} trials are in {name} air, for which {} has no models; they are ignored",
                chosen.len(),
                earlier.name
            )),
        }
    }
    if predicted.is_empty() {
        return Err(GapError::Data {
            what: "tracer trials".into(),
            problem: format!("none can be predicted: {}", arcs::lacking(tables)),
            expected: format!(
                "trials with wind, Obukhov length and arcs, in air of which {} has models",
                earlier.name
            ),
        });
    }
    let gain = scores::gain_on(&predicted, &(Vec::new(), Vec::new()), seed)?;
    let applied = applied(&predicted, &gain, &earlier.name, seed)?;
    let suspicions = checks::suspicions(&trials);
    let odd = notices.iter().filter_map(|n| odd_data(n));
    let data_quality: Vec<DataQuality> = suspicions.flaws.iter().cloned().chain(odd).collect();
    notices.splice(0..0, suspicions.flaws.into_iter().map(|f| f.message));
    let roughness_m = trials[0].weather.roughness_m;
    Ok(TracerReport {
        gap: GapJson {
            schema: SCHEMA,
            gas: None,
            readings: None,
            verdict: earlier.verdict,
            summary: applied.says.clone(),
            causes: earlier.causes.clone(),
            ranking: Vec::new(),
            residual: residual(&predicted),
            gain: Some(gain),
            detectable: Vec::new(),
            next_flight: None,
            base: Vec::new(),
            unexplained: None,
            insufficient: None,
            contact: None,
            pairs: Vec::new(),
            discrepancy: None,
            noise: None,
            applied: Some(applied),
            data_quality,
            notices,
        },
        tracer: TracerDetail {
            class_limits: detail::class_limits(roughness_m),
            relative_to: found.relative_to.clone(),
            roughness_m,
            groups: found.groups.clone(),
            arcs: predicted,
        },
        extended_toml: String::new(),
    })
}

/// What a user should know of these trials: names that the finding knows, and arcs of one sampler.
fn said(trials: &[TrialArcs], groups: &[GroupDetail]) -> Vec<String> {
    let known: BTreeSet<&str> = groups
        .iter()
        .flat_map(|g| g.trials.iter().map(String::as_str))
        .collect();
    let same: Vec<&str> = trials
        .iter()
        .map(|t| t.weather.trial.as_str())
        .filter(|t| known.contains(t))
        .collect();
    let mut out = Vec::new();
    if !same.is_empty() {
        out.push(format!(
            "{} trials have names of trials that the extension was found on: where they are the same ones, these \
             scores are no hold-out ({})",
            same.len(),
            arcs::listed(&same)
        ));
    }
    let arcs = || trials.iter().flat_map(|t| &t.arcs);
    let single = arcs().filter(|a| a.samplers == 1).count();
    if single > 0 {
        out.push(format!(
            "{single} of {} arcs have one sampler: its reading is used as the arc's maximum; such an arc gives \
             no integral or width",
            arcs().count()
        ));
    }
    out
}

fn models(group: &GroupDetail, name: &str) -> Result<Models, GapError> {
    let lateral = |tried| weighted(tried, &Lateral::ALL, Lateral::id, name);
    Ok(Models {
        vertical: weighted(&group.vertical, &Vertical::ALL, Vertical::id, name)?,
        lateral: lateral(&group.lateral)?,
        lateral_without_azimuth: lateral(&group.lateral_without_azimuth)?,
    })
}

fn weighted<C: Copy>(
    tried: &[TriedModel],
    all: &[C],
    id: impl Fn(C) -> &'static str,
    name: &str,
) -> Result<Vec<Weighted<C>>, GapError> {
    let one = |model: &TriedModel| {
        let known = |m: &String| all.iter().copied().find(|c| id(*c) == m.as_str());
        let changes: Option<Vec<C>> = model.mechanisms.iter().map(known).collect();
        let theta = parameters::fitted(&model.mechanisms, &model.parameters);
        match (changes, theta) {
            (Some(changes), Some(theta)) => Ok(Weighted {
                changes,
                theta,
                probability: model.probability,
            }),
            _ => Err(GapError::Data {
                what: name.to_owned(),
                problem: format!(
                    "a model of tracer.groups has unknown changes or parameters: {}",
                    model.mechanisms.join(", ")
                ),
                expected: "models and parameters of plumage gap tracer of this version".into(),
            }),
        }
    };
    tried.iter().map(one).collect()
}

/// Mean of what the models say by their probability; those that say nothing pass their share on.
fn averaged<C>(
    models: &[Weighted<C>],
    predict: impl Fn(&Weighted<C>) -> Option<f64>,
) -> Option<f64> {
    let said = models
        .iter()
        .filter_map(|m| Some((m.probability, predict(m)?)));
    let (sum, weight) = said.fold((0.0, 0.0), |s, (p, v)| (s.0 + p * v, s.1 + p));
    (weight > 0.0).then(|| sum / weight)
}

fn predict(trial: &TrialArcs, name: &str, models: &Models) -> Vec<ArcDetail> {
    let w = &trial.weather;
    let of = |arc: &Arc| {
        let vertical = averaged(&models.vertical, |m| {
            Some(model::log_integrated(w, arc, &m.changes, &m.theta))
        });
        let base = model::log_integrated(w, arc, &[], &[]);
        let width = log_width(w, arc.distance_m, models);
        let integrated = vertical.unwrap_or(base);
        detail::arc(w, name, arc, integrated, width)
    };
    trial.arcs.iter().map(of).collect()
}

/// ln of the width in m: by the models of trials like this one, or else by Briggs'.
fn log_width(w: &Weather, x_m: f64, models: &Models) -> f64 {
    let (first, second) = match w.sigma_azimuth_rad {
        Some(_) => (&models.lateral, &models.lateral_without_azimuth),
        None => (&models.lateral_without_azimuth, &models.lateral),
    };
    let by = |models: &[Weighted<Lateral>]| {
        averaged(models, |m| model::log_width(w, x_m, &m.changes, &m.theta))
    };
    let briggs = || model::log_width(w, x_m, &[], &[]);
    by(first)
        .or_else(|| by(second))
        .or_else(briggs)
        .unwrap_or(f64::NAN)
}

fn applied(arcs: &[ArcDetail], gain: &Gain, from: &str, seed: u64) -> Result<Applied, GapError> {
    let h = &gain.held_out;
    let change = [h.rmse_change_low, h.rmse_change_high];
    let outcome = if gain.blocks < LEAST_FOR_INTERVALS {
        Outcome::Undecided
    } else {
        Outcome::of(&[change, scores::log_square_change(arcs, seed)])
    };
    let says = format!(
        "{}: arc maxima of {} trials, {} arcs: {}.{}",
        outcome.says(),
        gain.blocks,
        arcs.len(),
        scores_in_words(h, "mg/m³", 1),
        if gain.blocks < LEAST_FOR_INTERVALS {
            format!(" An interval needs at least {LEAST_FOR_INTERVALS} trials.")
        } else {
            String::new()
        }
    );
    Ok(Applied {
        from: from.to_owned(),
        outcome,
        says,
        fitted: Vec::new(),
        scores: parts(arcs)?,
    })
}

/// Scores of maxima, integrals and widths, of all trials and of each kind of air.
fn parts(arcs: &[ArcDetail]) -> Result<Vec<AppliedScore>, GapError> {
    type Taken = fn(&ArcDetail) -> Option<[f64; 3]>;
    let quantities: [(&str, Taken); 3] = [
        ("maximum", |a| {
            Some([a.max_mg_m3, a.base_max_mg_m3, a.held_out_max_mg_m3])
        }),
        ("integral", |a| {
            a.whole.then_some([
                a.integrated_mg_m2,
                a.base_integrated_mg_m2,
                a.held_out_integrated_mg_m2,
            ])
        }),
        ("width", |a| {
            a.whole
                .then_some([a.width_m, a.base_width_m, a.held_out_width_m])
        }),
    ];
    let mut out = Vec::new();
    for (what, taken) in quantities {
        for air in std::iter::once(None).chain(GROUPS.map(|g| Some(g.0))) {
            let own = arcs
                .iter()
                .filter(|a| air.is_none_or(|name| a.group == name));
            let each: Vec<[f64; 3]> = own.filter_map(taken).collect();
            out.extend(score(what, air, &each)?);
        }
    }
    Ok(out)
}

/// Scores of measured, base's and extension's values; none where there are none.
fn score(
    what: &str,
    air: Option<&str>,
    each: &[[f64; 3]],
) -> Result<Option<AppliedScore>, GapError> {
    if each.is_empty() {
        return Ok(None);
    }
    let lowest = each.iter().map(|v| v[0]).fold(f64::MAX, f64::min);
    let of = |k: usize| {
        let pairs: Vec<Pair> = each.iter().map(|v| (v[0], v[k])).collect();
        plume::score::scores(&pairs, scores::FLOOR_PART * lowest)
    };
    let (before, after) = (of(1)?, of(2)?);
    let rms_ln = |vg: f64| vg.ln().max(0.0).sqrt();
    Ok(Some(AppliedScore {
        what: what.to_owned(),
        of: air.map(str::to_owned),
        count: each.len(),
        fac2_before: before.fac2,
        fac2_after: after.fac2,
        nmse_before: before.nmse,
        nmse_after: after.nmse,
        rms_ln_before: rms_ln(before.vg),
        rms_ln_after: rms_ln(after.vg),
    }))
}
