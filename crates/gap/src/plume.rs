//! The gap of plume and sensors: concentrations along tracks against the plume model.
//!
//! The order of work: gate the raw data, smooth the logged wind, fit the base and its noise,
//! screen every mechanism, fit the best fully, hold nameless rivals against them, accept one at
//! a time until the data ask for no more, and measure the gain on data left out. The method,
//! with its equations, sources and limits, is in `docs/gap.md`.

mod accepted;
mod answer;
mod candidate;
mod ceiling;
mod chance;
mod data;
mod delay;
mod early;
mod explore;
mod fit;
mod fixes;
mod followed;
mod freedom;
mod gate;
mod heights;
mod held_out;
mod lee;
mod lid;
mod linear;
mod logged;
mod model;
mod nameless;
mod naming;
mod next_flight;
mod noise;
mod nuisance;
mod pair;
mod parallel;
mod report;
mod residual;
mod rival;
mod rival_terms;
mod screen;
mod shown;
mod start;
mod tested;
mod transport;
mod visibility;
mod ways;
mod wind_series;
mod zero;

pub use data::{Prior, Setup};
pub use noise::NoiseModel;
pub use report::{GapReport, Series};
pub use visibility::{Known, Likeness, PlumeChange, Visibility};

use ::plume::effects::HOUR_S;
use ::plume::mechanism::MechanismId;
use scenario::observations::Observations;

use crate::GapError;
use crate::verdict::{DataQuality, GapJson, SCHEMA, Verdict};
use data::Data;
use fit::Context;

/// How the analysis is run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Seed of the bootstrap; the same seed gives the same answer.
    pub seed: u64,
    /// Threads; the answer does not depend on them.
    pub threads: usize,
    /// Most causes that are named one after the other.
    pub most_causes: usize,
    /// Whether to measure the gain on data left out, what was detectable, and the next flight.
    pub complete: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 1,
            threads: 2,
            most_causes: 4,
            complete: true,
        }
    }
}

impl Options {
    /// A lighter run for use during a mission: at most two causes, no scores on data left out.
    pub fn live() -> Self {
        Self {
            most_causes: 2,
            complete: false,
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
    /// Noise fitted under the final model.
    pub noise: NoiseModel,
    /// Series, tables and maps for a report.
    pub report: GapReport,
}

/// Fewest readings from which anything can be told.
const FEWEST_READINGS: usize = 30;

/// Shows what is wrong, names it, extends the model and measures the gain.
///
/// `progress` is called a few times with what is being done.
///
/// # Errors
/// No rows or no readings at all, or a base that the plume model refuses. Data that merely say
/// nothing give the verdict "none" with a notice.
pub fn analyse(
    setup: &Setup,
    observations: &Observations,
    options: &Options,
    progress: &mut dyn FnMut(Progress),
) -> Result<Analysis, GapError> {
    let (observations, zero_s) = observations.counted_from_near_zero()?;
    let mut analysis = counted_from_near_zero(setup, &observations, options, progress)?;
    zero::told_from(&mut analysis, zero_s);
    Ok(analysis)
}

fn counted_from_near_zero(
    setup: &Setup,
    observations: &Observations,
    options: &Options,
    progress: &mut dyn FnMut(Progress),
) -> Result<Analysis, GapError> {
    let mut tell = |part: f64, doing: &'static str| progress(Progress { part, doing });
    tell(0.0, "looking at the raw data");
    let (passed, mut quality) = gate::passed(setup, observations)?;
    let enough = |data: &Data| data.used_count() >= FEWEST_READINGS;
    let mut data = match passed {
        Some(data) if enough(&data) => data,
        left => return Ok(nothing_to_tell(setup, observations, left.as_ref(), quality)),
    };
    tell(0.05, "fitting the base");
    let threads = options.threads.max(1);
    let started = start::start(setup, &mut data, threads);
    let ctx = Context {
        setup,
        data: &data,
        threads,
    };
    let mut named = naming::name(&ctx, started.fitted.clone(), options, &mut tell);
    let puffs = started.other_puffs(setup, ctx.data, &named.last);
    let mut ctx = ctx;
    if let Some(data) = &puffs {
        let there = Context { data, ..ctx };
        if let Some(again) = named_again(&there, &started.fitted, &named, options, &mut tell) {
            (named, ctx) = (again, there);
        }
    }
    let steady = if named.only(MechanismId::WindDirectionDrift) {
        started.in_steady_wind(setup, ctx.data, &named.last)
    } else {
        None
    };
    let mut started = &started;
    if let Some((there, data)) = &steady {
        (started, ctx) = (there, Context { data, ..ctx });
        named = naming::name(&ctx, started.fitted.clone(), options, &mut tell);
    }
    let doubted = heights::doubted(&ctx, observations, &started.fitted, &named.last);
    if let Some(message) = doubted {
        quality.extend(gate::mask_all(&mut data, &message));
        return Ok(nothing_to_tell(setup, observations, Some(&data), quality));
    }
    // What stands out of a plume that was flown at other heights is none.
    quality.extend(gate::spikes(&data, &started.fitted.metric.whitener.spikes));
    Ok(stated(&ctx, started, named, quality, options, &mut tell))
}

/// The answer that `named` gives, with its gain, the next flight, and the report.
fn stated(
    ctx: &Context<'_>,
    started: &start::Started,
    mut named: naming::Named,
    quality: Vec<DataQuality>,
    options: &Options,
    tell: &mut dyn FnMut(f64, &'static str),
) -> Analysis {
    named.conclude(ctx);
    tell(0.8, "measuring the gain on data left out");
    let extended = !named.accepted.is_empty();
    let gain = (options.complete && extended)
        .then(|| held_out::gain(ctx, &named.base_beside(ctx), &named.last, options.seed));
    let next_flight = if options.complete {
        next_flight::propose(ctx, &named)
    } else {
        None
    };
    tell(0.95, "writing it down");
    let wind = started.treatment().describe();
    let notices = notices(ctx, &named, &wind);
    let verdict = named.verdict();
    let met_wind = met_wind(ctx, &named);
    let base = report::base_parameters(ctx.setup, &named.last, met_wind.0);
    let json = GapJson {
        schema: SCHEMA,
        verdict,
        summary: report::summary(verdict, &named, gain.as_ref()),
        causes: named.causes.clone(),
        ranking: named.ranking.clone(),
        residual: residual::bins(ctx, &started.fitted),
        gain: gain.as_ref().map(|g| g.gain),
        detectable: report::detectable(&named),
        next_flight,
        base: base.clone(),
        unexplained: named.unexplained.clone(),
        data_quality: quality,
        notices,
    };
    let report = report::report(ctx, &started.fitted, &named, gain.as_ref());
    tell(1.0, "done");
    Analysis {
        extension: named.extension(ctx),
        base: base.into_iter().map(|b| (b.name, b.value, b.sd)).collect(),
        logged_wind: ctx.data.on_board_wind.then_some(met_wind),
        noise: named.last.noise,
        json,
        report,
    }
}

/// The wind in which the plume was met, as the base has it before it is turned by what the
/// scenario is unsure of: direction from, in degrees, and speed at the scenario's height, m/s. A
/// plume that lay still while its log swung is turned by the fit against the log of the times at
/// which it was seen, and a drift that is only tolerated is over with the record.
fn met_wind(ctx: &Context<'_>, named: &naming::Named) -> (f64, f64) {
    let (profile, base) = (&ctx.setup.base.wind, &ctx.setup.base);
    let last = &named.last;
    let met: Vec<f64> = last.prediction.plume.iter().map(|p| p.abs()).collect();
    let wind = ctx.data.mean_transport(&met);
    let at_axis_m_s = profile.speed_at_m_s(base.sources[0].effective_height_agl_m);
    let carried = profile.reference_speed_m_s() / at_axis_m_s;
    let finite = if carried.is_finite() { carried } else { 1.0 };
    let turned_deg = named.tolerated_drift_deg_per_h() * ctx.data.mean_time_s(&met) / HOUR_S;
    let from_deg = air::wind::from_deg(wind.east, wind.north) + turned_deg;
    (air::geo::wrap_deg(from_deg), wind.speed_m_s * finite)
}

/// What is named with the puffs of what was `named`, from the base that was fitted first, if that
/// is the more probable answer.
fn named_again(
    there: &Context<'_>,
    base: &fit::Fitted,
    named: &naming::Named,
    options: &Options,
    tell: &mut dyn FnMut(f64, &'static str),
) -> Option<naming::Named> {
    tell(0.4, "naming again with the puffs of what was named");
    let base = there.refine(&base.model, named.last.noise);
    let again = naming::name(there, base, options, tell);
    (again.last.score_with_prior() > named.last.score_with_prior()).then_some(again)
}

/// What a user should know besides the answer.
fn notices(ctx: &Context<'_>, named: &naming::Named, wind: &str) -> Vec<String> {
    let mut out = ctx.data.notices.clone();
    out.extend(report::elsewhere(ctx, named));
    out.extend(report::unlikely(ctx, named));
    out.push(format!("the plume is carried by {wind}"));
    out
}

fn nothing_to_tell(
    setup: &Setup,
    observations: &Observations,
    left: Option<&Data>,
    quality: Vec<DataQuality>,
) -> Analysis {
    let mut notices = left
        .map_or(&observations.notices, |data| &data.notices)
        .clone();
    let message = format!(
        "{} usable readings of {} rows: fewer than {FEWEST_READINGS}, from which nothing can be told",
        left.map_or(0, Data::used_count),
        observations.rows.len()
    );
    notices.push(message.clone());
    let json = GapJson {
        schema: SCHEMA,
        verdict: Verdict::None,
        summary: message,
        causes: Vec::new(),
        ranking: Vec::new(),
        residual: Vec::new(),
        gain: None,
        detectable: Vec::new(),
        next_flight: None,
        base: report::prior_parameters(setup),
        unexplained: None,
        data_quality: quality,
        notices,
    };
    Analysis {
        json,
        extension: Vec::new(),
        base: Vec::new(),
        logged_wind: None,
        noise: NoiseModel::prior(setup.base.sensor.noise_sd_ppm),
        report: GapReport::default(),
    }
}

#[cfg(test)]
#[path = "plume/plume_tests.rs"]
mod tests;
