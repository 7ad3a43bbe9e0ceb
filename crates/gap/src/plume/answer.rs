//! The answer as `gap.json` has it, and in words.

use ::plume::Gas;
use ::plume::mechanism::{Coordinate, MechanismId};
use air::geo::wrap_deg;
use formats::number::plus_minus;
use nalgebra::DMatrix;
use scenario::observations::Observations;

use infer::{AXIS_DRIFT, Along, Cause as Named, FittedSet, InferError, RestKind};

use super::catalogue::Hypothesis;
use super::data::{Data, Setup, mean_transport};
use super::gain::{Gained, gain};
use super::meander::Meander;
use super::model::{PlumeModel, Unknown, fitted};
use super::report::{GapReport, report};
use super::sensor_calibration::HELD;
use super::{
    Analysis, Considered, FEWEST_READINGS, FOLLOWED, Labelled, NamedSet, ONE_DIRECTION_DEG,
    Options, Study, gate, residual, wind,
};
use crate::verdict::{
    BaseParameter, Candidate, Cause, Contact, DETECTABLE_NATS, DataQuality, Detectable,
    Discrepancy, Evidence, GapJson, Insufficient, Measured, Noise, Parameter, Ranked, SCHEMA,
    Unexplained, UnexplainedKind, Verdict,
};

/// The plume was not met where its strength stays unknown to more than this factor's logarithm: a
/// factor e.
const UNKNOWN_LN_STRENGTH: f64 = 1.0;

/// The answer of a study.
pub(crate) fn stated(
    study: &Study<'_>,
    mut quality: Vec<DataQuality>,
    options: &Options,
) -> Result<Analysis, InferError> {
    let inflation = &study.base.fit().inflation;
    let spikes: Vec<usize> = (0..inflation.len())
        .filter(|i| inflation[*i] > 1.0)
        .collect();
    quality.extend(gate::spikes(study.data, &spikes));
    let judged = &study.judged;
    let named = !judged.causes.is_empty() && follows(study);
    let gained = if options.complete && named {
        Some(gain(study, options.seed)?)
    } else {
        None
    };
    let detectable = if options.complete {
        detectable(study)?
    } else {
        Vec::new()
    };
    let causes = if named { causes(study)? } else { Vec::new() };
    let unexplained = unexplained(study, named)?;
    let insufficient = if causes.is_empty() && unexplained.is_none() {
        insufficient(study)?
    } else {
        None
    };
    let verdict = match (&insufficient, Verdict::of(&causes, unexplained.is_some())) {
        (Some(_), _) => Verdict::Insufficient,
        (None, verdict) => verdict,
    };
    let set = if named { &judged.set } else { &study.base };
    let base = base_parameters(study, set)?;
    let contact = contact(study);
    let mut notices = study.data.notices.clone();
    notices.push(format!(
        "the plume is carried by {}",
        wind::describe(study.carried)
    ));
    let gas = study.setup.gas();
    let json = GapJson {
        schema: SCHEMA,
        gas: Some(gas),
        readings: None,
        verdict,
        summary: summary(
            gas,
            verdict,
            &causes,
            unexplained.as_ref(),
            insufficient.as_ref(),
            contact.as_ref(),
            gained.as_ref(),
        ),
        causes,
        ranking: ranking(study),
        residual: residual::bins(study),
        gain: gained.as_ref().map(|g| g.gain),
        detectable,
        next_flight: super::next_flight::proposed(study, options)?,
        base: base.clone(),
        unexplained,
        insufficient,
        contact,
        pairs: Vec::new(),
        discrepancy: Some(discrepancy(study)),
        noise: Some(noise(set)),
        applied: None,
        data_quality: quality,
        notices,
    };
    let sure = sure_set(study, named);
    let parts = sure.model.parts(sure.at());
    let extension = parts[study.setup.priors.len()..].to_vec();
    Ok(Analysis {
        json,
        extension: sure.model.mechanisms(&extension),
        base: base
            .into_iter()
            .filter(|b| b.platform.is_none())
            .map(|b| (b.name, b.value, b.sd))
            .collect(),
        logged_wind: study.data.on_board_wind.then(|| met_wind(study, set)),
        report: report(study, gained.as_ref()),
        named: (!sure.mechanisms.is_empty()).then(|| NamedSet {
            names: sure.mechanisms.clone(),
            fit: sure.fit().clone(),
        }),
        considered: considered(study),
    })
}

/// The set of what is sure enough to extend a scenario: of the causes that are stated those with a probability of .95
/// by which held-out passes gain. The base where there is none.
fn sure_set<'s, 'a>(study: &'s Study<'a>, named: bool) -> &'s FittedSet<PlumeModel<'a>> {
    let judged = &study.judged;
    let is_sure = |c: &&Named<Hypothesis>| named && c.is_sure(study.question.policy);
    let sure: Vec<Hypothesis> = judged
        .causes
        .iter()
        .filter(is_sure)
        .map(|c| c.mechanisms[0].0.clone())
        .collect();
    if sure.len() == judged.set.mechanisms.len() {
        return &judged.set;
    }
    let found = study.found.iter().find(|f| f.is_same_set(&sure));
    found.unwrap_or(&study.base)
}

/// The sets that were judged, by the names of files.
fn considered(study: &Study<'_>) -> Considered {
    let labelled = |c: &Named<Hypothesis>| c.named_by(|t| label(study, t));
    let sets = study.judged.considered.iter();
    Considered {
        sets: sets.map(|set| set.iter().map(labelled).collect()).collect(),
        passes: study.judged.passes.len(),
        readings: study.data.used_count(),
    }
}

/// Whether the readings follow the plume well enough that a name means something: they do, or lie in
/// one direction, to which a name turns the wind.
pub(crate) fn follows(study: &Study<'_>) -> bool {
    let turns =
        |c: &Named<Hypothesis>| c.mechanisms[0].0.part.id == MechanismId::WindDirectionOffset;
    let turned = study.judged.causes.iter().any(turns);
    let contact = study.contact.as_ref();
    contact.is_none_or(|c| c.share >= FOLLOWED || (turned && c.turn_deg.sd < ONE_DIRECTION_DEG))
}

fn label(study: &Study<'_>, tried: &Hypothesis) -> Labelled {
    let platform = tried
        .part
        .platform
        .map(|p| study.data.track.platforms()[p].clone());
    (tried.part.id.as_str().to_string(), platform)
}

fn causes(study: &Study<'_>) -> Result<Vec<Cause>, InferError> {
    let judged = &study.judged;
    let posterior = study.question.posterior(&judged.set)?;
    let (mean, covariance) = (posterior.mean(), posterior.covariance());
    let cause = |(k, named): (usize, &Named<Hypothesis>)| {
        let first = &named.mechanisms[0].0;
        Cause {
            mechanisms: distinct(named.mechanisms.iter().map(|n| label(study, &n.0).0)),
            probability: named.probability,
            evidence: Evidence {
                delta_log_score: named.hold_out.0,
                delta_log_evidence: named.gain,
                p_value: f64::NAN,
            },
            parameters: parameters(study, &judged.set, k, mean.as_slice(), |i, j| {
                covariance[(i, j)]
            }),
            platforms: label(study, first).1.into_iter().collect(),
            settings: settings(first),
            onset_s: None,
            nats_to_next: named.nats_to_next,
        }
    };
    Ok(judged.causes.iter().enumerate().map(cause).collect())
}

/// Settings of a name: numbers of its mechanism that are not fitted.
fn settings(tried: &Hypothesis) -> Vec<Parameter> {
    let id = tried.part.id;
    let all = id.spec().parameters.iter().zip(&tried.part.values);
    all.filter(|(p, _)| p.default.is_some())
        .map(|(p, value)| Parameter {
            mechanism: id.as_str().to_string(),
            name: p.name.to_string(),
            value: *value,
            sd: 0.0,
            unit: p.unit.to_string(),
        })
        .collect()
}

fn distinct(names: impl Iterator<Item = String>) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for name in names {
        if !out.contains(&name) {
            out.push(name);
        }
    }
    out
}

/// Parameters of the `k`-th name of a set. What is unknown of the base and a name move the same
/// thing: their sum is stated.
fn parameters(
    study: &Study<'_>,
    set: &FittedSet<PlumeModel<'_>>,
    k: usize,
    mean: &[f64],
    covariance: impl Fn(usize, usize) -> f64,
) -> Vec<Parameter> {
    let unknowns = study.setup.unknowns();
    let part = unknowns.len() + k;
    let own: Vec<usize> = set.model.unknowns_of(part).collect();
    let tried = &set.mechanisms[k];
    let id = tried.part.id;
    let moves_it = |u: &Unknown| u.id == id && u.platform == tried.part.platform;
    let stated = unknowns.iter().position(moves_it);
    let base: Vec<usize> = stated.map_or_else(Vec::new, |p| set.model.unknowns_of(p).collect());
    let mut out = Vec::new();
    for (n, parameter) in fitted(id).enumerate() {
        let spec = &id.spec().parameters[parameter];
        let all: Vec<usize> = own.get(n).into_iter().chain(base.get(n)).copied().collect();
        let at: f64 = all.iter().map(|i| mean[*i]).sum();
        let variance: f64 = all
            .iter()
            .flat_map(|i| all.iter().map(|j| covariance(*i, *j)))
            .sum();
        let value = spec.from_coordinate(at);
        let sd = variance.max(0.0).sqrt();
        out.push(Parameter {
            mechanism: id.as_str().to_string(),
            name: spec.name.to_string(),
            value: value.clamp(spec.low, spec.high),
            sd: spec.sd_of(value, sd),
            unit: spec.unit.to_string(),
        });
    }
    out
}

fn ranking(study: &Study<'_>) -> Vec<Ranked> {
    let base = study.base.ln_score();
    let top = study.found[0].ln_score();
    let all: f64 = study.found.iter().map(|f| (f.ln_score() - top).exp()).sum();
    let ranked = |f: &FittedSet<PlumeModel<'_>>| Ranked {
        mechanisms: f.mechanisms.iter().map(|n| label(study, n).0).collect(),
        platform: f.mechanisms.iter().find_map(|n| label(study, n).1),
        delta_log_score: f.ln_evidence() - study.base.ln_evidence(),
        log_evidence: f.ln_score() - base,
        probability: (f.ln_score() - top).exp() / all,
    };
    let named = study.found.iter().filter(|f| !f.mechanisms.is_empty());
    named.map(ranked).collect()
}

/// What no name explains, where its evidence is beyond what is tolerated, or where what would be
/// named does not stand.
fn unexplained(study: &Study<'_>, named: bool) -> Result<Option<Unexplained>, InferError> {
    let judged = &study.judged;
    let astray = !follows(study);
    // Where the readings do not follow the plume, and no turn of the wind that they ask for is named,
    // the model does not hold, however small a rest a wandering zero leaves.
    let elsewhere = study.contact.as_ref().is_some_and(|c| c.share < FOLLOWED);
    let holds = judged.rest.nats <= study.question.policy.rest_nats && !judged.is_doubted;
    if holds && !astray && (named || !elsewhere) {
        return Ok(None);
    }
    let mut candidates: Vec<Candidate> = Vec::new();
    let unstated = judged.causes.iter().filter(|_| !named);
    for cause in unstated.chain(&judged.dropped) {
        let own = dropped(study, cause);
        if candidates.iter().all(|c| c.mechanisms != own.mechanisms) {
            candidates.push(own);
        }
    }
    for (found, probability) in &judged.candidates {
        let own = candidate(study, found, *probability, judged.set.mechanisms.len())?;
        match candidates
            .iter_mut()
            .find(|c| c.mechanisms == own.mechanisms)
        {
            Some(same) => *same = own,
            None => candidates.push(own),
        }
    }
    candidates.truncate(study.question.policy.most_candidates);
    let (from_s, to_s, platforms) = stretch(study);
    let sizes = judged.set.likeliest_sizes();
    let of_form = sizes
        .iter()
        .zip(["along_wind", "height", "across_wind", "time"]);
    let largest = of_form.max_by(|a, b| a.0.total_cmp(b.0));
    let coordinate = match judged.rest.kind {
        RestKind::Background(Along::Height) => "height",
        RestKind::Discrepancy => largest.map_or("time", |(_, coordinate)| coordinate),
        _ => "time",
    };
    let kind = if astray || (elsewhere && !named) {
        UnexplainedKind::NoContact
    } else {
        judged.rest.kind.into()
    };
    Ok(Some(Unexplained {
        kind,
        coordinate: coordinate.to_string(),
        term: kind.words().to_string(),
        from_s,
        to_s,
        platforms,
        delta_log_evidence: judged.rest.nats,
        candidates,
    }))
}

fn candidate(
    study: &Study<'_>,
    found: &FittedSet<PlumeModel<'_>>,
    probability: f64,
    known: usize,
) -> Result<Candidate, InferError> {
    let posterior = study.question.posterior(found)?;
    let (mean, covariance) = (posterior.mean(), posterior.covariance());
    let own = known.min(found.mechanisms.len().saturating_sub(1))..found.mechanisms.len();
    Ok(Candidate {
        mechanisms: own
            .clone()
            .map(|k| label(study, &found.mechanisms[k]).0)
            .collect(),
        probability,
        log_evidence: found.ln_evidence() - study.base.ln_evidence(),
        parameters: own
            .flat_map(|k| parameters(study, found, k, mean.as_slice(), |i, j| covariance[(i, j)]))
            .collect(),
    })
}

fn dropped(study: &Study<'_>, cause: &Named<Hypothesis>) -> Candidate {
    Candidate {
        mechanisms: vec![label(study, &cause.mechanisms[0].0).0],
        probability: cause.probability,
        log_evidence: cause.gain,
        parameters: Vec::new(),
    }
}

/// The pass in which the base's misfit is largest, and the platforms that show it.
fn stretch(study: &Study<'_>) -> (f64, f64, Vec<String>) {
    let of = &study.base;
    let whitened = study.question.whitened(of, &of.fit().misfit);
    let times = study.data.track.time_s();
    let square = |pass: &&Vec<std::ops::Range<usize>>| -> f64 {
        let rows = pass.iter().cloned().flatten();
        let (sum, n) = rows.fold((0.0, 0.0), |(s, n), i| {
            (s + whitened[i] * whitened[i], n + 1.0)
        });
        sum / f64::max(n, 1.0)
    };
    let passes = &study.judged.passes;
    let Some(worst) = passes.iter().max_by(|a, b| square(a).total_cmp(&square(b))) else {
        return (f64::NAN, f64::NAN, Vec::new());
    };
    let rows = || worst.iter().cloned().flatten().map(|i| times[i]);
    let platforms = study.data.ranges().iter().zip(study.data.track.platforms());
    let shows = platforms.filter(|(r, _)| worst.iter().any(|w| r.contains(&w.start)));
    (
        rows().fold(f64::INFINITY, f64::min),
        rows().fold(f64::NEG_INFINITY, f64::max),
        shows.map(|(_, p)| p.clone()).collect(),
    )
}

fn noise(set: &FittedSet<PlumeModel<'_>>) -> Noise {
    let found = set.fit().noise;
    Noise {
        white_ppm: found.white,
        slow_ppm: found.slow,
        slow_s: found.slow_s,
        fluctuation: found.fluctuation,
        fluctuation_s: found.fluctuation_s,
        axis_wander_deg: found.wander_deg,
        axis_wander_sigma_z: found.wander_sigma_z,
    }
}

fn discrepancy(study: &Study<'_>) -> Discrepancy {
    let set = &study.judged.set;
    let sizes = set.likeliest_sizes();
    let square: f64 = sizes[..AXIS_DRIFT].iter().map(|s| s * s).sum();
    Discrepancy {
        size: square.sqrt(),
        wander_deg: sizes[AXIS_DRIFT].hypot(set.fit().noise.wander_deg),
        log_evidence: study.judged.rest.nats,
    }
}

/// Whether the readings follow the plume, in degrees of the wind and in words.
pub(super) fn contact(study: &Study<'_>) -> Option<Contact> {
    let Some(found) = &study.contact else {
        return Some(Contact {
            share: f64::NAN,
            passes: 0,
            best_wind_from_deg: None,
            says: "No pass shows a plume in any direction.".to_string(),
        });
    };
    let from_deg = wrap_deg(carried_from_deg(study, &study.base) + found.turn_deg.value);
    let says = if found.share >= FOLLOWED {
        "The readings follow the plume.".to_string()
    } else if found.turn_deg.sd < ONE_DIRECTION_DEG {
        format!(
            "The readings do not follow the modelled plume: {} passes show a plume that a wind from \
             {}° would have carried there.",
            found.passes,
            plus_minus(from_deg, found.turn_deg.sd)
        )
    } else {
        format!(
            "The readings do not follow the modelled plume: {} passes show one, each in another direction.",
            found.passes
        )
    };
    Some(Contact {
        share: found.share,
        passes: found.passes,
        best_wind_from_deg: Some(Measured {
            value: from_deg,
            sd: found.turn_deg.sd,
        }),
        says,
    })
}

/// Why the readings could not have shown anything, if so.
fn insufficient(study: &Study<'_>) -> Result<Option<Insufficient>, InferError> {
    let is_strength = |t: &&Hypothesis| t.part.id == MechanismId::EmissionScale;
    let Some(strength) = study.tried.iter().find(is_strength) else {
        return Ok(None);
    };
    let step = strength.start.ends[0][0].abs();
    let screened = study
        .question
        .screen(&study.base, std::slice::from_ref(strength))?;
    // What the readings tell of the strength beside what the scenario is unsure of: the information
    // that is left after the scenario's own prior has taken its part is the larger the less it knows.
    let own = study.base.model.unknown(MechanismId::EmissionScale);
    let prior_sd = own.map_or(0.0, |k| {
        infer::ForwardModel::priors(&study.base.model)[k].sd
    });
    let variance = step * step / screened[0].information - prior_sd * prior_sd;
    let sd = variance.max(0.0).sqrt();
    if sd < UNKNOWN_LN_STRENGTH {
        return Ok(None);
    }
    Ok(Some(Insufficient {
        reason: "no reading is inside the plume, so its strength would remain uncertain by more than a factor of \
                 2.7"
            .to_string(),
        would_do: would_do(study),
    }))
}

fn would_do(study: &Study<'_>) -> String {
    let height_m = study.setup.base.sources[0].effective_height_agl_m;
    format!(
        "crossings of the axis downwind of the source, at {height_m:.0} m above ground and at one or two further \
         distances"
    )
}

/// The smallest effect of every mechanism that these data could have shown. Of a lid or a limit,
/// which do nothing at infinity, it is the highest of those tried that would show.
fn detectable(study: &Study<'_>) -> Result<Vec<Detectable>, InferError> {
    let screened = study.question.screen(&study.base, &study.tried)?;
    let mut out: Vec<(f64, Detectable)> = Vec::new();
    let of_all = screened
        .iter()
        .filter(|s| study.tried[s.tried].part.platform.is_none());
    for s in of_all {
        let tried = &study.tried[s.tried];
        let id = tried.part.id;
        let which = if id == MechanismId::SecondSource {
            2
        } else {
            0
        };
        let spec = &id.spec().parameters[which];
        let amplitude = (2.0 * DETECTABLE_NATS / s.information).sqrt();
        let (value, bend) = if spec.neutral.is_finite() {
            let at = tried.start.at(&vec![amplitude; tried.start.ends.len()]);
            let value = spec.from_coordinate(at[which.min(at.len() - 1)]);
            ((value - spec.neutral).abs(), amplitude.ln().abs())
        } else if amplitude <= 1.0 {
            let limit = spec.from_coordinate(tried.start.ends[0][0]);
            (limit, -limit)
        } else {
            continue;
        };
        let entry = Detectable {
            mechanism: id.as_str().to_string(),
            parameter: spec.name.to_string(),
            value,
            unit: spec.unit.to_string(),
        };
        // Of several starts the one whose step is about as long as what it finds is the straightest.
        match out.iter_mut().find(|d| d.1.mechanism == entry.mechanism) {
            _ if !value.is_finite() => {}
            Some(known) if known.0 <= bend => {}
            Some(known) => *known = (bend, entry),
            None => out.push((bend, entry)),
        }
    }
    Ok(out.into_iter().map(|(_, entry)| entry).collect())
}

/// Direction from which the wind carried the plume of a set where it was met, degrees.
pub(super) fn carried_from_deg(study: &Study<'_>, set: &FittedSet<PlumeModel<'_>>) -> f64 {
    wrap_deg(met_wind(study, set).0 + set.model.turned_deg(set.at()))
}

/// The wind in which the plume was met, before it is turned by what the scenario is unsure of:
/// direction from, in degrees, and speed at the scenario's height, m/s.
fn met_wind(study: &Study<'_>, set: &FittedSet<PlumeModel<'_>>) -> (f64, f64) {
    let spec = &study.setup.base;
    let turns = study.question.turns(set);
    let there = infer::ForwardModel::predict(&set.model, set.at(), &turns);
    let weight: Vec<f64> = there.map_or_else(
        |_| vec![1.0; study.data.len()],
        |p| p.plume.iter().map(|p| p.abs()).collect(),
    );
    let wind = mean_transport(set.model.track().transport(), &weight);
    let at_axis_m_s = spec
        .wind
        .speed_at_m_s(spec.sources[0].effective_height_agl_m);
    let carried = spec.wind.reference_speed_m_s() / at_axis_m_s;
    let finite = if carried.is_finite() { carried } else { 1.0 };
    let from_deg = air::wind::from_deg(wind.east, wind.north);
    (wrap_deg(from_deg), wind.speed_m_s * finite)
}

/// The scenario's uncertain keys, fitted, of the plume without a discrepancy: the extended scenario has
/// none. The wind's direction is that of the wind against which it was fitted, and the turn.
pub(super) fn base_parameters(
    study: &Study<'_>,
    set: &FittedSet<PlumeModel<'_>>,
) -> Result<Vec<BaseParameter>, InferError> {
    let believed = study.question.posterior(set)?;
    let nearest = study.question.nearest(set, &believed)?;
    let meander = Meander::of(&set.model, set.at(), &believed)?;
    let mut stated = set.model.stated(nearest, &believed, meander.is_some())?;
    if let Some(meander) = meander {
        let index = |id| set.model.unknown(id);
        meander.in_the_mean(index, set.model.strength(), &mut stated);
    }
    let infer::ClosestModel {
        mean, covariance, ..
    } = stated.known_beforehand(infer::ForwardModel::priors(&set.model));
    let wind_from_deg = met_wind(study, set).0;
    let of = |(part, prior): (usize, &super::Prior)| {
        let k = set.model.unknowns_of(part).next();
        // Of what is held nothing is told.
        let widened = if study.setup.is_held(prior.id) {
            1.0 / HELD
        } else {
            1.0
        };
        let (at, sd) = k.map_or((f64::NAN, f64::NAN), |k| {
            (mean[k], widened * covariance[(k, k)].sqrt())
        });
        let log = prior.id.spec().parameters[0].coordinate == Coordinate::Log;
        let (value, sd) = match (log, prior.id) {
            (true, _) => (prior.value * at.exp(), prior.value * at.exp() * sd),
            (false, MechanismId::SensorLag) => (at.max(0.0), sd),
            (false, MechanismId::WindDirectionOffset) => (wind_from_deg + at, sd),
            (false, _) => (prior.value + at, sd),
        };
        BaseParameter {
            name: prior.key.clone(),
            platform: None,
            value,
            sd,
            prior: prior.sd,
        }
    };
    let stated = study.setup.priors.iter().enumerate().map(of);
    let mut out: Vec<BaseParameter> = stated.collect();
    out.extend(own_parameters(study, set, mean.as_slice(), &covariance)?);
    Ok(out)
}

/// What each sensor of a network has of its own: what it reads in clean air, in the mean over its rows, and its
/// gain where the readings tell it.
fn own_parameters(
    study: &Study<'_>,
    set: &FittedSet<PlumeModel<'_>>,
    mean: &[f64],
    covariance: &DMatrix<f64>,
) -> Result<Vec<BaseParameter>, InferError> {
    let setup = study.setup;
    if setup.own.is_empty() {
        return Ok(Vec::new());
    }
    let levels = set.model.levels(mean)?;
    let mut slopes = DMatrix::zeros(levels.len(), mean.len());
    for k in 0..mean.len() {
        let step = STEP_SD * covariance[(k, k)].sqrt();
        if step > 0.0 {
            let mut aside = mean.to_vec();
            aside[k] += step;
            for (p, level) in set.model.levels(&aside)?.into_iter().enumerate() {
                slopes[(p, k)] = (level - levels[p]) / step;
            }
        }
    }
    let variances = &slopes * covariance * slopes.transpose();
    let mut out = Vec::new();
    for (k, own) in setup.own.iter().enumerate() {
        let Some(p) = own.platform else { continue };
        let k = setup.priors.len() + k;
        let parameter = |name: &str, value, sd| BaseParameter {
            name: name.to_string(),
            platform: Some(study.data.track.platforms()[p].clone()),
            value,
            sd,
            prior: own.prior.sd,
        };
        let sd = covariance[(k, k)].sqrt();
        match own.id {
            MechanismId::SensorOffset => {
                out.push(parameter("zero_ppm", levels[p], variances[(p, p)].sqrt()));
            }
            // What is told of a gain is told about as well by what was known beforehand.
            _ if sd < GAIN_TOLD * own.prior.sd => {
                out.push(parameter("gain", mean[k].exp(), mean[k].exp() * sd));
            }
            _ => {}
        }
    }
    Ok(out)
}

/// Difference by which slopes of levels are taken, in standard deviations.
const STEP_SD: f64 = 0.01;
/// A gain is told where the readings leave less than this part of the standard deviation that it had beforehand.
const GAIN_TOLD: f64 = 0.5;

/// The answer where too few readings are usable.
pub(crate) fn nothing_to_tell(
    setup: &Setup,
    observations: &Observations,
    left: Option<&Data>,
    quality: Vec<DataQuality>,
) -> Analysis {
    let mut notices = left
        .map_or(&observations.notices, |data| &data.notices)
        .clone();
    let reason = format!(
        "{} usable readings of {} rows, fewer than the {FEWEST_READINGS} that an analysis needs",
        left.map_or(0, Data::used_count),
        observations.rows.len()
    );
    notices.push(reason.clone());
    let prior = |p: &super::Prior| BaseParameter {
        name: p.key.clone(),
        platform: None,
        value: p.value,
        sd: p.sd,
        prior: p.sd,
    };
    let json = GapJson {
        schema: SCHEMA,
        gas: Some(setup.gas()),
        readings: None,
        verdict: Verdict::Insufficient,
        summary: reason.clone(),
        causes: Vec::new(),
        ranking: Vec::new(),
        residual: Vec::new(),
        gain: None,
        detectable: Vec::new(),
        next_flight: None,
        base: setup.priors.iter().map(prior).collect(),
        unexplained: None,
        insufficient: Some(Insufficient {
            reason,
            would_do: "a record of several crossings of the plume".to_string(),
        }),
        pairs: Vec::new(),
        contact: None,
        discrepancy: None,
        noise: None,
        applied: None,
        data_quality: quality,
        notices,
    };
    Analysis {
        json,
        extension: Vec::new(),
        base: Vec::new(),
        logged_wind: None,
        report: GapReport::default(),
        named: None,
        considered: Considered::default(),
    }
}

/// The answer in a few sentences: first whether the readings follow the plume at all.
fn summary(
    gas: Gas,
    verdict: Verdict,
    causes: &[Cause],
    unexplained: Option<&Unexplained>,
    insufficient: Option<&Insufficient>,
    contact: Option<&Contact>,
    gain: Option<&Gained>,
) -> String {
    let contact = contact.map_or("", |c| c.says.as_str());
    let named: Vec<String> = causes.iter().map(cause_words).collect();
    let named = named.join("; ");
    let digits = 2 + gas.digits();
    let gained = gain.map_or_else(String::new, |g| {
        let h = &g.gain.held_out;
        format!(
            " On hold-out passes the log score gains {:.1} nats and the RMSE changes from {:.digits$} to \
             {:.digits$} ppm{}.",
            h.log_score_after - h.log_score_before,
            h.rmse_before,
            h.rmse_after,
            if gas == Gas::Co2 {
                String::new()
            } else {
                format!(" of {}", gas.formula())
            }
        )
    });
    let said = match verdict {
        Verdict::None => "The base model and its noise explain the data.".to_string(),
        Verdict::Insufficient => insufficient.map_or_else(String::new, |i| {
            format!(
                "These data are too few or too weak to test the model: {}. Sufficient data: {}.",
                i.reason, i.would_do
            )
        }),
        Verdict::Unexplained => {
            let term = unexplained.map_or("", |u| u.term.as_str());
            let may: Vec<String> = unexplained
                .map(|u| {
                    u.candidates
                        .iter()
                        .map(|c| c.mechanisms.join(" and "))
                        .collect()
                })
                .unwrap_or_default();
            let may = if may.is_empty() {
                String::new()
            } else {
                format!(" Possible causes: {}.", may.join(", or "))
            };
            let next = unexplained.map_or(String::new(), |u| {
                format!(" Next step: {}.", u.kind.next_step())
            });
            if named.is_empty() {
                format!(
                    "The data deviate from the model, and no listed mechanism accounts for it: {term}.{may}{next}"
                )
            } else {
                format!(
                    "The data show {named}. No listed mechanism accounts for the remaining deviation: \
                         {term}.{may}{gained}{next}"
                )
            }
        }
        Verdict::Ambiguous if causes.iter().all(|c| c.mechanisms.len() == 1) => {
            format!("The data probably show {named}.{gained}")
        }
        Verdict::Ambiguous => {
            format!("The data probably show {named}, but cannot tell some of these apart.{gained}")
        }
        Verdict::Named => format!("The data show {named}.{gained}"),
    };
    format!("{contact} {said}").trim().to_string()
}

fn cause_words(c: &Cause) -> String {
    let values: Vec<String> = c
        .parameters
        .iter()
        .map(|p| {
            format!(
                "{} = {:.4} +/- {:.4}{}",
                p.name,
                p.value,
                p.sd,
                p.unit_after()
            )
        })
        .collect();
    let on = if c.platforms.is_empty() {
        String::new()
    } else {
        format!(" on {}", c.platforms.join(", "))
    };
    format!(
        "{}{on} ({}; probability {:.2})",
        c.mechanisms.join(" or "),
        values.join(", "),
        c.probability
    )
}
