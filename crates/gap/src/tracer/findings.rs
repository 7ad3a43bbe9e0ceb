//! From scored models to causes: which changes the data ask for, which they cannot tell apart, how sure that is over
//! trials, and what is left without a name.

use super::fit::{Scored, Trials, difference};
use super::model::{AZIMUTH, CONTINUUM, Model, PLUME_WIND, Quantity, factor_in, same_distance};
use super::{LEAST_TRIALS, TriedModel};
use crate::verdict::{Cause, Evidence, Parameter, Unexplained, UnexplainedKind};

/// Changes that stand for a choice of input and not for a cause. The width by the measured deviation of azimuth
/// ([`AZIMUTH`]) is a choice of input too, but one that is asked for.
const INPUTS: [&str; 2] = [PLUME_WIND, CONTINUUM];
/// Nats of evidence over the base below which nothing is found: some thirty models are tried.
/// A factor at one distance needs them too, before what its search and laws not quite right may cost.
const LEAST_NATS: f64 = 5.0;
/// Probability that a set of causes must hold.
const SET_PROBABILITY: f64 = infer::NAMED;
/// Probability of some cause below which no set is stated.
pub const LIKELY: f64 = 0.5;
/// Nats of score that a change must be worth to be a part of a model at all.
const LEAST_SHOWN: f64 = 1.0;
/// Part of the gain in evidence that a law not quite right may cost.
const LAW_ERROR: f64 = 0.1;
/// The same at one distance: the ends of the arcs bend away first.
const LAW_ERROR_AT_ONE_DISTANCE: f64 = 0.2;
/// Standard errors of a one-sided test at the 5 % level.
const ONE_SIDED: f64 = 1.645;
/// Scatter of arcs about their trial's line, ln, that no sampling explains: a factor of 1.8.
const LARGEST_SCATTER: f64 = 0.6;

/// What a question (vertical or lateral, in one kind of air) came to.
pub struct Finding {
    /// All models, the most probable first.
    pub scored: Vec<Scored>,
    /// The same models, each with its gain over the base.
    pub tried: Vec<TriedModel>,
    /// The causes; none where the base does.
    pub causes: Vec<Cause>,
    /// Inputs of the model behind the first cause, or of the most probable: what the numbers are
    /// relative to.
    pub relative_to: Vec<String>,
    /// Gain of that model over the base on trials left out and its standard error, nats.
    pub held_out_gain: (f64, f64),
    /// Probability of any cause, whether stated or not.
    pub some_cause: f64,
}

type Ids = Vec<&'static str>;

/// Briggs' plume with the wind as measured, if it was fitted.
pub fn base(scored: &[Scored]) -> Option<&Scored> {
    scored.iter().find(|s| s.model.ids.is_empty())
}

/// Judges the scored models of one question, the most probable first; `group` names the kind of air.
pub fn judge(mut scored: Vec<Scored>, group: &str) -> Option<Finding> {
    let causes: Vec<Ids> = scored.iter().map(|s| causes_in(&scored, s)).collect();
    for (model, causes) in scored.iter_mut().zip(causes) {
        model.causes = causes;
    }
    let (models, base) = (&scored, base(&scored)?);
    let gain = models[0].fit.log_evidence - base.fit.log_evidence;
    let sets = match gain > LEAST_NATS {
        true => answer_sets(models, gain),
        false => Vec::new(),
    };
    let behind = sets.first().map_or(&models[0], |set| model_of(models, set));
    let inputs = behind.model.ids.iter();
    let inputs = inputs.filter(|id| INPUTS.contains(id) || **id == AZIMUTH);
    let causes = sets
        .iter()
        .map(|set| cause(models, set, &sets, base, group));
    Some(Finding {
        tried: scored.iter().map(|s| tried(s, base)).collect(),
        causes: causes.collect(),
        relative_to: inputs.map(|id| (*id).to_owned()).collect(),
        held_out_gain: difference(&behind.held_out, &base.held_out),
        some_cause: probability(models, |m| !m.causes.is_empty()),
        scored,
    })
}

fn tried(model: &Scored, base: &Scored) -> TriedModel {
    let (gain, error) = difference(&model.held_out, &base.held_out);
    TriedModel {
        mechanisms: model.model.ids.iter().map(|id| (*id).to_owned()).collect(),
        delta_log_score: model.fit.log_score - base.fit.log_score,
        delta_log_evidence: model.fit.log_evidence - base.fit.log_evidence,
        probability: model.probability,
        held_out_gain: gain,
        held_out_gain_se: error,
        parameters: model.parameters(),
    }
}

/// The causes of a model that show: one that costs less than a nat of score when it is taken
/// out again is none (a loss fitted as 0, a decay whose prior lets it do nothing), and a growth
/// that a factor does as well as is that factor.
fn causes_in(scored: &[Scored], model: &Scored) -> Ids {
    let mut now = model;
    loop {
        let ids = now.model.ids.iter().copied();
        let causes = ids.clone().filter(|id| !INPUTS.contains(id));
        let with = |ids: Ids| scored.iter().find(|p| p.model.ids == ids);
        let plainer = causes.clone().flat_map(|id| {
            let others = ids.clone().filter(|i| *i != id).collect();
            let as_factor = |to| ids.clone().map(|i| if i == id { to } else { i }).collect();
            let growth = factor_in(id).and_then(|factor| with(as_factor(factor)));
            with(others).into_iter().chain(growth)
        });
        let nearest = plainer.max_by(|a, b| a.fit.log_score.total_cmp(&b.fit.log_score));
        match nearest {
            Some(p) if now.fit.log_score - p.fit.log_score < LEAST_SHOWN => now = p,
            _ => return causes.collect(),
        }
    }
}

fn has(model: &Scored, id: &str) -> bool {
    model.causes.contains(&id)
}

fn probability(models: &[Scored], which: impl Fn(&Scored) -> bool) -> f64 {
    let which = models.iter().filter(|m| which(m));
    which.map(|m| m.probability).sum()
}

/// Whether the data cannot do without `id`: it has a part with probability .95, and every model
/// without it has much less evidence than the best and is worse on trials left out, at the 5 %
/// level. Much less is 5 nats and a tenth of what the best gains over the base: the laws of
/// spread and loss are not known so well that a rival which gains nine tenths is out.
fn certain(models: &[Scored], gain: f64, id: &str) -> bool {
    let best = &models[0];
    probability(models, |m| has(m, id)) >= SET_PROBABILITY
        && models.iter().filter(|m| !has(m, id)).all(|m| {
            let (held_out, error) = difference(&best.held_out, &m.held_out);
            let behind = best.fit.log_evidence - m.fit.log_evidence;
            behind > LEAST_NATS + LAW_ERROR * gain && held_out > ONE_SIDED * error
        })
}

/// The sets of the answer. Where all parts of the most probable combination are such that the
/// data cannot do without them, each stands alone. Else one set: the union of the fewest
/// combinations that hold .95 of what is not "no cause", if some cause is likelier than none and
/// there is more than one member; one member that is not certain is left to the ranking.
/// The deviation of azimuth, once certain, is no rival of the corrections on top of it.
fn answer_sets(models: &[Scored], gain: f64) -> Vec<Ids> {
    let mut sets = Vec::new();
    let azimuth = certain(models, gain, AZIMUTH);
    if azimuth {
        sets.push(vec![AZIMUTH]);
    }
    // Combinations of causes with their probabilities, the most probable first.
    let mut combinations: Vec<(Ids, f64)> = Vec::new();
    for model in models {
        let mut causes = model.causes.clone();
        causes.retain(|id| !(azimuth && *id == AZIMUTH));
        match combinations.iter_mut().find(|c| c.0 == causes) {
            Some(known) => known.1 += model.probability,
            None => combinations.push((causes, model.probability)),
        }
    }
    combinations.retain(|c| !c.0.is_empty());
    combinations.sort_by(|a, b| b.1.total_cmp(&a.1));
    let some: f64 = combinations.iter().map(|c| c.1).sum();
    if some <= LIKELY {
        return sets;
    }
    let best = &combinations[0].0;
    if best.iter().all(|id| certain(models, gain, id)) {
        sets.extend(best.iter().map(|id| vec![*id]));
        return sets;
    }
    let mut held = 0.0;
    let mut set = Ids::new();
    for (causes, p) in &combinations {
        // One member alone would be a name.
        if held >= SET_PROBABILITY * some && (set.len() > 1 || some < SET_PROBABILITY) {
            break;
        }
        held += p;
        let new = causes.iter().filter(|id| !set.contains(id));
        set.extend(new.copied().collect::<Ids>());
    }
    if set.len() > 1 {
        let inclusion = |id: &str| probability(models, |m| has(m, id));
        set.sort_by(|a, b| inclusion(b).total_cmp(&inclusion(a)));
        sets.push(set);
    }
    sets
}

/// The most probable model in which the first of the set shows.
fn model_of<'a>(models: &'a [Scored], set: &Ids) -> &'a Scored {
    models.iter().find(|m| has(m, set[0])).unwrap_or(&models[0])
}

fn cause(models: &[Scored], set: &Ids, sets: &[Ids], base: &Scored, group: &str) -> Cause {
    let best = model_of(models, set);
    let shows = |m: &Scored| set.iter().any(|id| has(m, id));
    let outside = models.iter().filter(|m| !shows(m));
    let rival = outside.map(|m| m.fit.log_evidence).fold(f64::NAN, f64::max);
    let nats_to_next = best.fit.log_evidence - rival;
    // A parameter is stated once, with its own mechanism.
    let of_another = |p: &Parameter| {
        let mut others = sets.iter().filter(|other| *other != set).flatten();
        others.any(|id| *id == p.mechanism)
    };
    let parameters = best.parameters().into_iter();
    Cause {
        mechanisms: set.iter().map(|id| (*id).to_owned()).collect(),
        probability: probability(models, shows),
        evidence: Evidence {
            delta_log_score: best.fit.log_score - base.fit.log_score,
            delta_log_evidence: best.fit.log_evidence - base.fit.log_evidence,
            // By Markov's inequality a model without the cause gives evidence e times larger to one of
            // the others with a probability of 1/e at most.
            p_value: (models.len() as f64 * (-nats_to_next).exp()).min(1.0),
        },
        parameters: parameters.filter(|p| !of_another(p)).collect(),
        settings: Vec::new(),
        onset_s: None,
        platforms: vec![group.to_owned()],
        nats_to_next,
    }
}

/// What the best vertical model leaves in one kind of air, if anything: a factor on all arcs at one distance, or a
/// scatter of arcs far beyond the errors of measurement. Neither has a name.
pub fn leftover(trials: &Trials<'_>, scored: &[Scored], air: &str) -> Option<Unexplained> {
    let best = scored.first()?;
    let base = base(scored)?;
    let mut distances: Vec<(f64, usize)> = Vec::new();
    let integrals = trials.data.iter().flatten();
    for datum in integrals.filter(|d| d.quantity != Quantity::TowerSpread) {
        match distances.iter_mut().find(|d| same_distance(datum.x_m, d.0)) {
            Some(d) => d.1 += 1,
            None => distances.push((datum.x_m, 1)),
        }
    }
    distances.retain(|d| d.1 >= LEAST_TRIALS);
    let offset = |&(x_m, _): &(f64, usize)| {
        let fit = trials.fit(&best.model.with_offset_at(x_m), None)?;
        let factor = Model::offset(&fit.numbers);
        Some((x_m, factor, fit.log_evidence - best.fit.log_evidence))
    };
    let offsets = distances.iter().filter_map(offset);
    let strongest = offsets.max_by(|a, b| a.2.total_cmp(&b.2));
    let gain = best.fit.log_evidence - base.fit.log_evidence;
    let cost = (distances.len() as f64).ln() + LAW_ERROR_AT_ONE_DISTANCE * gain;
    let scatter = best.fit.sizes[0];
    // With two distances a factor at one is a growth.
    let (term, nats) = match strongest {
        Some((x, factor, nats)) if distances.len() > 2 && nats > LEAST_NATS + cost => {
            let term = format!(
                "crosswind integrals at {x:.0} m are {factor:.2} times what the best model gives, and no others are; \
                 check the samplers of that arc"
            );
            (term, nats)
        }
        _ if scatter > LARGEST_SCATTER => {
            let factor = scatter.exp();
            let term = format!(
                "crosswind integrals scatter about the best model by a factor of {factor:.1} from arc to arc"
            );
            (term, f64::NAN)
        }
        _ => return None,
    };
    Some(Unexplained {
        kind: UnexplainedKind::Discrepancy,
        coordinate: "along_wind".into(),
        term,
        from_s: f64::NAN,
        to_s: f64::NAN,
        platforms: vec![air.to_owned()],
        delta_log_evidence: nats,
        candidates: Vec::new(),
    })
}
