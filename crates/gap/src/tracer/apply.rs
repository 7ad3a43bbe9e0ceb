//! Models found on some trials, held against others. Nothing is fitted: the other trials are predicted by
//! the mean over the earlier models by their probability, with the earlier parameters.

use std::collections::BTreeSet;

use formats::list::listed;

use super::arcs::{self, TrialArcs};
use super::gain::{self, Values, maximum};
use super::model::Model;
use super::predicted::{ArcDetail, Models, Weighted, arc};
use super::table::Tables;
use super::{AIRS, GroupDetail, TracerReport, TriedModel, checks, in_air, report};
use crate::GapError;
use crate::applied::{Applied, AppliedScore, Earlier, Outcome, scores_in_words};
use crate::verdict::Gain;

/// Fewest trials whose scatter says how sure a score is.
const LEAST_FOR_INTERVALS: usize = 4;

/// Holds the models of `earlier` against the trials of `tables`; `seed` is for the bootstrap of the
/// scores.
///
/// # Errors
/// [`GapError::Data`] for a finding of another kind or one with a model that is not known here, and where
/// no trial has wind, Obukhov length, arcs and a kind of air of which the finding has models.
pub fn apply(tables: &Tables, earlier: &Earlier, seed: u64) -> Result<TracerReport, GapError> {
    let found = earlier.tracer()?;
    let mut read = checks::read(tables);
    let trials = &read.trials;
    let mut notices = trial_notices(trials, &found.groups);
    let mut predicted = Vec::new();
    for (name, sign) in AIRS {
        let chosen = in_air(trials, sign);
        if let Some(group) = found.groups.iter().find(|g| g.group == name) {
            let models = models(group, &earlier.name)?;
            for trial in &chosen {
                let arcs = trial.arcs.iter();
                predicted.extend(arcs.map(|a| arc(&trial.weather, name, a, &models)));
            }
        } else if !chosen.is_empty() {
            notices.push(format!(
                "{} trials are in {name} air, for which {} has no models; they are ignored",
                chosen.len(),
                earlier.name
            ));
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
    let (gain, ln_square_change) = gain::gain(&predicted, &[], seed)?;
    let applied = applied(&predicted, &gain, ln_square_change, &earlier.name)?;
    read.notices.extend(notices);
    let mut report = report(&read, found.clone(), predicted, gain);
    report.gap.verdict = earlier.verdict;
    report.gap.causes = earlier.causes.clone();
    report.gap.summary = applied.says.clone();
    report.gap.applied = Some(applied);
    Ok(report)
}

/// What a user should know of these trials: names that the finding knows, and arcs of one sampler.
fn trial_notices(trials: &[TrialArcs], groups: &[GroupDetail]) -> Vec<String> {
    let known: BTreeSet<&String> = groups.iter().flat_map(|g| &g.trials).collect();
    let names = trials.iter().map(|t| &t.weather.trial);
    let same = names.filter(|t| known.contains(t)).map(String::as_str);
    let same: Vec<&str> = same.collect();
    let mut out = Vec::new();
    if !same.is_empty() {
        out.push(format!(
            "{} trials have names of trials that the extension was found on: where they are the same ones, these \
             scores are no hold-out ({})",
            same.len(),
            listed(&same, arcs::MOST_LISTED)
        ));
    }
    let arcs: Vec<_> = trials.iter().flat_map(|t| &t.arcs).collect();
    let single = arcs.iter().filter(|a| a.samplers == 1).count();
    if single > 0 {
        out.push(format!(
            "{single} of {} arcs have one sampler: its reading is used as the arc's maximum; such an arc gives \
             no integral or width",
            arcs.len()
        ));
    }
    out
}

/// The models of a finding; `name` is its file.
fn models(group: &GroupDetail, name: &str) -> Result<Models, GapError> {
    let one = |tried: &TriedModel| -> Result<Weighted, GapError> {
        let model = Model::of_finding(&tried.mechanisms, &tried.parameters);
        let (model, numbers) = model.ok_or_else(|| GapError::Data {
            what: name.to_owned(),
            problem: format!(
                "a model of tracer.groups has unknown changes or parameters: {}",
                tried.mechanisms.join(", ")
            ),
            expected: "models and parameters of plumage gap tracer of this version".into(),
        })?;
        Ok((tried.probability, model, numbers))
    };
    let all = |tried: &[TriedModel]| tried.iter().map(one).collect::<Result<Vec<_>, _>>();
    Ok([
        all(&group.vertical)?,
        all(&group.lateral)?,
        all(&group.lateral_without_azimuth)?,
    ])
}

fn applied(
    arcs: &[ArcDetail],
    gain: &Gain,
    ln_square_change: [f64; 2],
    from: &str,
) -> Result<Applied, GapError> {
    let h = &gain.held_out;
    let mut outcome = Outcome::of(&[[h.rmse_change_low, h.rmse_change_high], ln_square_change]);
    let mut hint = String::new();
    if gain.blocks < LEAST_FOR_INTERVALS {
        outcome = Outcome::Undecided;
        hint = format!(" An interval needs at least {LEAST_FOR_INTERVALS} trials.");
    }
    let says = format!(
        "{}: arc maxima of {} trials, {} arcs: {}.{hint}",
        outcome.says(),
        gain.blocks,
        arcs.len(),
        scores_in_words(h, "mg/m³", 1),
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
    type OfArc = fn(&ArcDetail) -> Values;
    let integral: OfArc = |a| {
        let (base, held_out) = (a.base_integrated_mg_m2, a.held_out_integrated_mg_m2);
        [a.integrated_mg_m2, base, held_out]
    };
    let width: OfArc = |a| [a.width_m, a.base_width_m, a.held_out_width_m];
    let quantities = [
        ("maximum", maximum as OfArc),
        ("integral", integral),
        ("width", width),
    ];
    let mut out = Vec::new();
    for (what, values) in quantities {
        for air in [None, Some(AIRS[0].0), Some(AIRS[1].0)] {
            let is_part = |a: &&ArcDetail| {
                (a.whole || what == "maximum") && air.is_none_or(|name| a.group == name)
            };
            let each: Vec<Values> = arcs.iter().filter(is_part).map(values).collect();
            if !each.is_empty() {
                out.push(gain::score(what, air, &each)?);
            }
        }
    }
    Ok(out)
}
