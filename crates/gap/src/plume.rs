//! The gap of plume and sensors: concentrations along tracks against the plume model.
//!
//! The order of work: gate the raw data, choose the wind that carried the plume, fit the base with its
//! discrepancy and its noise, ask whether the readings follow the plume at all, search the
//! mechanisms of the catalogue for sets that explain more, judge what stands of them on passes left
//! out and drawn anew, and measure the gain. All of it but the forward model is [`infer`]'s. The
//! method, with its equations, sources and limits, is in `docs/gap.md`.

mod answer;
mod apply;
mod averaged;
mod catalogue;
pub(crate) mod data;
mod fixes;
mod gain;
mod gate;
mod known_noise;
mod logged;
mod meander;
mod model;
mod next_flight;
mod pair;
mod records;
mod report;
mod residual;
mod rest;
mod second_source;
mod sensor_calibration;
mod wind;
pub(crate) mod zero;

pub use apply::apply;
pub use averaged::{Averaging, averaged};
pub use data::{Prior, Setup};
pub use meander::Meander;
pub use model::{PlumeModel, Unknown, at_coordinates, plume_place, priors_about};
pub use records::{Records, sensor_sd};
pub use report::{GapReport, Series};
pub use sensor_calibration::HELD;
pub use wind::Carried;

use std::borrow::Cow;

use ::plume::mechanism::MechanismId;
use ::plume::stability::Stability;
use infer::{Contact, FittedSet, ForwardModel, InferError, Judgement, Policy, Question};
use scenario::observations::{Observations, checks};

use crate::GapError;
use crate::verdict::{GapJson, Readings, Verdict};
use catalogue::Hypothesis;
use data::Data;

/// How the analysis is run.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Seed of the draws of passes; the same seed gives the same answer.
    pub seed: u64,
    /// Whether to try all winds of a log, measure the gain on data held out, say what could be seen and propose
    /// a next flight.
    pub complete: bool,
    /// About how many rows are enough to find the plume and the wind that carries it, from where all are
    /// fitted.
    pub rows_of_a_search: usize,
    /// The numbers by which is decided.
    pub policy: Policy,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 1,
            complete: true,
            rows_of_a_search: ROWS_OF_A_SEARCH,
            policy: Policy::default(),
        }
    }
}

impl Options {
    /// A lighter run for use during a mission: at most two names, no scores on data held out.
    pub fn live() -> Self {
        let policy = Policy {
            most_names: 2,
            ..Policy::default()
        };
        Self {
            complete: false,
            rows_of_a_search: ROWS_OF_A_LIVE_SEARCH,
            policy,
            ..Self::default()
        }
    }
}

/// How far an analysis has come.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Part done, 0 to 1.
    pub part: f64,
    /// What is being done.
    pub doing: &'static str,
}

/// The answer, the model that follows from it, and all that a report shows.
#[derive(Debug, Clone)]
pub struct Analysis {
    /// `gap.json`.
    pub json: GapJson,
    /// Extensions to add to the scenario, with their fitted parameters.
    pub extension: Vec<::plume::Mechanism>,
    /// Fitted values of the scenario's uncertain keys: dotted key, value, standard deviation.
    pub base: Vec<(String, f64, f64)>,
    /// The logged wind in the mean, as it carried the plume, where there is a log: direction from, in
    /// degrees, and speed at the scenario's height of the wind, m/s.
    pub logged_wind: Option<(f64, f64)>,
    /// Series, tables and maps for a report.
    pub report: GapReport,
    /// The set that was named, from which an analysis of more readings may go on.
    pub named: Option<NamedSet>,
    /// What was judged, whether it stands or not.
    pub considered: Considered,
}

/// Mechanisms that were named, with their fit.
#[derive(Debug, Clone)]
pub struct NamedSet {
    names: Vec<Hypothesis>,
    fit: infer::Fit,
}

/// A mechanism, and its platform where it acts on one alone.
pub type Labelled = (String, Option<String>);

/// The sets that were judged, by which the probability of a cause is calibrated.
#[derive(Debug, Clone, Default)]
pub struct Considered {
    /// The causes of each set, in the order of judging.
    pub sets: Vec<Vec<infer::Cause<Labelled>>>,
    /// Passes by which they were judged.
    pub passes: usize,
    /// Readings in use.
    pub readings: usize,
}

/// Fewest readings from which anything can be told.
const FEWEST_READINGS: usize = 30;
/// About how many rows are enough to find the plume and its wander.
pub const ROWS_OF_A_SEARCH: usize = 800;
/// Most rows that are fitted: what more of them would tell, months of them, costs time and memory in proportion.
const MOST_ROWS: usize = 20_000;
/// The same where little time is to be had.
const ROWS_OF_A_LIVE_SEARCH: usize = 200;
/// Readings follow the plume where passes gain at least this part there of what they gain in
/// whatever direction: half.
const FOLLOWED: f64 = 0.5;
/// Passes point in one direction where their scatter is no more than that of the wind in the most
/// unsteady air, degrees.
const ONE_DIRECTION_DEG: f64 = Stability::A.sigma_theta_deg();

/// Shows what is wrong, names it, extends the model and measures the gain.
///
/// `progress` is called a few times with what is being done.
///
/// # Errors
/// No rows or no readings at all, or a base that the plume model refuses. Data that merely say
/// nothing give the verdict "insufficient".
pub fn analyse(
    setup: &Setup,
    observations: &Observations,
    options: &Options,
    progress: &mut dyn FnMut(Progress),
) -> Result<Analysis, GapError> {
    analyse_from(None, setup, observations, options, progress)
}

/// The same of more of the readings of an analysis before: a set that was named before is among those that are judged.
///
/// # Errors
/// As of [`analyse`].
pub fn analyse_from(
    named_before: Option<&NamedSet>,
    setup: &Setup,
    observations: &Observations,
    options: &Options,
    progress: &mut dyn FnMut(Progress),
) -> Result<Analysis, GapError> {
    // Two sensors that fly together tell of each other what no plume has to explain.
    let checked = checks::check(observations, &setup.base, &setup.frame).observations;
    let pairs = if options.complete {
        pair::pairs(&checked, &setup.frame)
    } else {
        Vec::new()
    };
    let late = pair::late(&pairs, &options.policy);
    let own = pair::with_late(setup, &late);
    let mut analysis = analyse_alone(named_before, &own, observations, options, progress)?;
    pair::told(&mut analysis, pairs, late);
    Ok(analysis)
}

/// The same for readings of which pairs of sensors have told what they tell.
fn analyse_alone(
    named_before: Option<&NamedSet>,
    setup: &Setup,
    observations: &Observations,
    options: &Options,
    progress: &mut dyn FnMut(Progress),
) -> Result<Analysis, GapError> {
    let readings = Readings::of(observations);
    let (observations, zero_s) = observations.counted_from_near_zero()?;
    let setup = setup.counted_from(zero_s);
    let mut analysis = analyse_once(&setup, &observations, named_before, options, progress)?;
    // Where two plumes were met, the base may follow both by turns, and in its valley nothing explains them. What was named
    // on the first half of the readings, which have led it less far, is tried on all.
    let is_alone = named_before.is_none() && options.complete;
    if is_alone && analysis.json.verdict == Verdict::Unexplained {
        let first = Options {
            complete: false,
            ..options.clone()
        };
        let half = first_half(&observations);
        let first = analyse_once(&setup, &half, None, &first, &mut |_| {});
        if let Some(named) = first.ok().and_then(|first| first.named) {
            let other = analyse_once(&setup, &observations, Some(&named), options, progress)?;
            let explains_more = other.json.causes.len() > analysis.json.causes.len();
            if other.json.verdict != Verdict::Unexplained || explains_more {
                analysis = other;
            }
        }
    }
    zero::told_from(&mut analysis, zero_s);
    analysis.json.readings = Some(readings);
    Ok(analysis)
}

/// The set with the second source alone that has the same two sources as `best`, where that moves the first one too.
fn with_second_alone<'a>(
    question: &Question<'_>,
    model: &PlumeModel<'a>,
    best: &FittedSet<PlumeModel<'a>>,
) -> Result<Option<FittedSet<PlumeModel<'a>>>, GapError> {
    let mut fit = best.fit().clone();
    let Some(at) = best.model.second_alone(&fit.point.at) else {
        return Ok(None);
    };
    fit.point.at = at;
    let is_second = |name: &&Hypothesis| name.part.id == MechanismId::SecondSource;
    let names: Vec<Hypothesis> = best.mechanisms.iter().filter(is_second).cloned().collect();
    let alone = names.iter().fold(model.clone(), |m, n| m.with(&n.part));
    Ok(Some(question.set_from(&alone, names, &fit)?))
}

/// The rows of the first half of the time.
fn first_half(observations: &Observations) -> Observations {
    let times = || observations.rows.iter().map(|r| r.time_s);
    let first_s = times().fold(f64::INFINITY, f64::min);
    let last_s = times().fold(f64::NEG_INFINITY, f64::max);
    let rows = observations.rows.iter().copied();
    Observations {
        rows: rows
            .filter(|r| r.time_s <= 0.5 * (first_s + last_s))
            .collect(),
        // One cell a row of all.
        extra: Vec::new(),
        ..observations.clone()
    }
}

/// What all parts of an answer are made from.
struct Study<'a> {
    setup: &'a Setup,
    data: &'a Data,
    question: Question<'a>,
    tried: Vec<Hypothesis>,
    base: FittedSet<PlumeModel<'a>>,
    contact: Option<Contact>,
    /// The sets that were fitted, the likeliest first.
    found: Vec<FittedSet<PlumeModel<'a>>>,
    /// What stands.
    judged: Judgement<PlumeModel<'a>>,
    /// What of the wind's log carries the plume; none without a log.
    carried: Option<wind::Carried>,
}

/// Analyses observations whose times count from near zero. A set that was named before is among those that are judged.
fn analyse_once(
    setup: &Setup,
    observations: &Observations,
    named_before: Option<&NamedSet>,
    options: &Options,
    progress: &mut dyn FnMut(Progress),
) -> Result<Analysis, GapError> {
    let mut tell = |part: f64, doing: &'static str| progress(Progress { part, doing });
    tell(0.0, "checking the raw data");
    let (passed, quality) = gate::passed(setup, observations)?;
    let mut data = match passed {
        Some(data) if data.used_count() >= FEWEST_READINGS => data,
        left => {
            let answer = answer::nothing_to_tell(setup, observations, left.as_ref(), quality);
            return Ok(answer);
        }
    };
    let rows_before = data.len();
    if let Some(mut part) = data.thinned(setup, MOST_ROWS)? {
        part.notices.push(format!(
            "{} of {rows_before} rows are fitted, taken evenly from each platform",
            part.len()
        ));
        data = part;
    }
    let data = data;
    tell(0.05, "fitting the base");
    let in_flight = !options.complete;
    let whole = Cow::Borrowed(&data);
    let records = Records::new(
        setup,
        whole,
        options.rows_of_a_search,
        &options.policy,
        in_flight,
    )?;
    let (setup, scale) = (records.setup(), records.scale());
    let question = records.question();
    // Where the plume is and how it moves is seen in part of a long record as well.
    let first_question = records.first_question();
    let carried = records.carried(setup)?;
    let tracks = records.tracks(setup, carried);
    let first_model = PlumeModel::of(setup, &tracks[0], scale);
    let (first_base, axis_drift) = records.searched(&first_model, carried)?;
    let first_model = first_model.following(axis_drift);
    let model = PlumeModel::of(setup, &tracks[1], scale).following(axis_drift);
    let base = question.set_from(&model, Vec::new(), &first_base)?;
    tell(0.25, "testing whether the readings follow the plume");
    let contact = first_question.contact(&first_model, base.at())?;
    let mut named = match aimed(&first_question, &first_model, &model, contact.as_ref())? {
        Some((found, aimed)) => {
            vec![question.set_from(&aimed, found.mechanisms.clone(), found.fit())?]
        }
        None => Vec::new(),
    };
    if let Some(NamedSet { names, fit }) = named_before {
        let with_names = names.iter().fold(model.clone(), |m, n| m.with(&n.part));
        // Other readings may tell of other unknowns, as of zeros.
        if with_names.priors().len() == fit.point.at.len() {
            named.push(question.set_from(&with_names, names.clone(), fit)?);
        }
    }
    tell(0.35, "searching for causes");
    let here = base.model.predict(base.at(), &question.turns(&base))?;
    let world = base.model.world(base.at())?;
    let tried = catalogue::tried(setup, &model, &here, &world);
    let mut found = question.search(base.clone(), named, &tried)?;
    let alone = found
        .first()
        .map(|best| with_second_alone(&question, &model, best));
    if let Some(alone) = alone.transpose()?.flatten() {
        found.push(alone);
        found.sort_by(|a, b| b.ln_score().total_cmp(&a.ln_score()));
    }
    // A name may have led to a better base, beside which all sets were judged.
    let base = found
        .iter()
        .find(|f| f.mechanisms.is_empty())
        .unwrap_or(&base)
        .clone();
    tell(0.8, "testing the causes");
    let judged = question.judge(&found, &tried, options.seed)?;
    let study = Study {
        setup,
        data: &data,
        question,
        tried,
        base,
        contact,
        found,
        judged,
        carried,
    };
    tell(0.95, "writing the results");
    let analysis = answer::stated(&study, quality, options)?;
    tell(1.0, "done");
    Ok(analysis)
}

/// Whether readings do not follow the plume, but lie in one direction.
fn elsewhere(contact: &Contact) -> bool {
    contact.share < FOLLOWED && contact.turn_deg.sd < ONE_DIRECTION_DEG
}

/// The base with its wind turned to where the readings lie, where they do not follow it but lie in
/// one direction, as found on a part of the rows, and the model of all rows for it.
fn aimed<'a>(
    question: &Question<'_>,
    first: &PlumeModel<'a>,
    model: &PlumeModel<'a>,
    contact: Option<&Contact>,
) -> Result<Option<(FittedSet<PlumeModel<'a>>, PlumeModel<'a>)>, InferError> {
    let Some(contact) = contact.filter(|c| elsewhere(c)) else {
        return Ok(None);
    };
    let turn_deg = contact.turn_deg.value;
    let name = catalogue::aimed(turn_deg, model.scale());
    let found = question.named(&first.aimed(&name.part, turn_deg), &name)?;
    Ok(Some((found, model.aimed(&name.part, turn_deg))))
}

#[cfg(test)]
#[path = "plume/plume_tests.rs"]
mod tests;
