//! What a report shows, as plain data, and the answer in words.

use ::plume::mechanism::{Coordinate, MechanismId};
use serde::Serialize;

use super::accepted::Accepted;
use super::answer::SD_FACTOR;
use super::data::Setup;
use super::fit::{Context, Fitted};
use super::held_out::Gained;
use super::model::defaults;
use super::naming::Named;
use super::residual::wind_axes;
use super::screen::Scored;
use crate::verdict::{BaseParameter, Detectable, Verdict};

/// Log score at which an effect counts as detectable, nats.
const DETECTABLE_NATS: f64 = 20.0;
/// How far from its prior's centre a parameter is remarkable, standard deviations.
const UNLIKELY_SD: f64 = 2.0;

/// Measured and predicted readings of one platform.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Series {
    /// Platform.
    pub platform: String,
    /// Times, s.
    pub time_s: Vec<f64>,
    /// Places, m east, north of the site's origin and above its ground.
    pub east_m: Vec<f64>,
    /// North, m.
    pub north_m: Vec<f64>,
    /// Height above ground, m.
    pub height_agl_m: Vec<f64>,
    /// Distance along the wind from the first source, m.
    pub along_wind_m: Vec<f64>,
    /// Distance across the wind in σy.
    pub across_wind_sigma: Vec<f64>,
    /// Readings, ppm; null where missing.
    pub measured_ppm: Vec<f64>,
    /// Whether the fit used them.
    pub used: Vec<bool>,
    /// Predicted by the base, ppm.
    pub before_ppm: Vec<f64>,
    /// Predicted by the extended model, ppm.
    pub after_ppm: Vec<f64>,
    /// Residual of the base in standard deviations of its noise.
    pub before_standardised: Vec<f64>,
    /// Residual of the extended model in standard deviations of its noise.
    pub after_standardised: Vec<f64>,
}

/// All that a report shows besides `gap.json`.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct GapReport {
    /// Track, readings and predictions of every platform.
    pub series: Vec<Series>,
    /// Autocorrelation of raw residuals of the base at lags of 0, 1, 2 … rows.
    pub autocorrelation_raw: Vec<f64>,
    /// The same of the standardised residuals of the base.
    pub autocorrelation_before: Vec<f64>,
    /// The same of the extended model.
    pub autocorrelation_after: Vec<f64>,
    /// Noise of the base: name, value, unit.
    pub noise: Vec<(String, f64, String)>,
    /// Blocks left out: from, to, s, and gain of log score, nats.
    pub blocks: Vec<(f64, f64, f64)>,
    /// Source, m east and north.
    pub source_m: (f64, f64),
}

/// What the report shows.
pub(crate) fn report(
    ctx: &Context<'_>,
    before: &Fitted,
    named: &Named,
    gain: Option<&Gained>,
) -> GapReport {
    let (along, across) = wind_axes(ctx, before);
    let track = &ctx.data.track;
    let after = &named.last;
    let series = track
        .platforms()
        .iter()
        .zip(ctx.data.ranges())
        .map(|(platform, r)| {
            let take = |v: &[f64]| v[r.clone()].to_vec();
            let place = |f: &dyn Fn(usize) -> f64| r.clone().map(f).collect::<Vec<f64>>();
            Series {
                platform: platform.clone(),
                time_s: take(track.time_s()),
                east_m: place(&|i| track.place(i).east_m),
                north_m: place(&|i| track.place(i).north_m),
                height_agl_m: place(&|i| track.place(i).height_agl_m),
                along_wind_m: take(&along),
                across_wind_sigma: take(&across),
                measured_ppm: take(&ctx.data.reading_ppm),
                used: ctx.data.used[r.clone()].to_vec(),
                before_ppm: take(&before.prediction.reading),
                after_ppm: take(&after.prediction.reading),
                before_standardised: take(&before.residual),
                after_standardised: take(&after.residual),
            }
        })
        .collect();
    let raw = ctx.data.residual(&before.prediction.reading);
    let source = ctx.setup.base.sources[0].place;
    GapReport {
        series,
        autocorrelation_raw: autocorrelation(ctx, &raw),
        autocorrelation_before: autocorrelation(ctx, &before.residual),
        autocorrelation_after: autocorrelation(ctx, &after.residual),
        noise: noise_words(before),
        blocks: gain.map_or_else(Vec::new, |g| g.blocks.clone()),
        source_m: (source.east_m, source.north_m),
    }
}

fn autocorrelation(ctx: &Context<'_>, values: &[f64]) -> Vec<f64> {
    const LAGS: usize = 60;
    let at = |lag: usize| {
        let (mut sum, mut own) = (0.0, 0.0);
        for r in ctx.data.ranges() {
            for i in r.clone() {
                own += values[i] * values[i];
                if i + lag < r.end {
                    sum += values[i] * values[i + lag];
                }
            }
        }
        sum / own.max(1e-300)
    };
    (0..=LAGS).map(at).collect()
}

fn noise_words(fitted: &Fitted) -> Vec<(String, f64, String)> {
    let n = &fitted.noise;
    let word = |name: &str, value: f64, unit: &str| (name.to_string(), value, unit.to_string());
    vec![
        word("white noise of a reading", n.white_ppm(), "ppm"),
        word("slow wander", n.slow().0, "ppm"),
        word("slow wander, time constant", n.slow().1, "s"),
        word("intermittency", 100.0 * n.gust().0, "% of the excess"),
        word("intermittency, time constant", n.gust().1, "s"),
        word("swing of the plume", n.swing().0, "deg"),
        word("swing of the plume, time constant", n.swing().1, "s"),
        word(
            "swing of the plume that all platforms share",
            n.shared_swing_deg(),
            "deg",
        ),
    ]
}

/// The scenario's uncertain keys, fitted; the wind's direction is that of the wind against which it
/// was fitted, from `wind_from_deg`, and the turn.
pub(crate) fn base_parameters(
    setup: &Setup,
    fitted: &Fitted,
    wind_from_deg: f64,
) -> Vec<BaseParameter> {
    setup
        .priors
        .iter()
        .enumerate()
        .map(|(part, prior)| {
            let found = fitted.model.free.iter().position(|f| f.part == part);
            let value = fitted.model.parts[part].values[0];
            let log = prior.id.spec().parameters[0].coordinate == Coordinate::Log;
            // No data make known less than was.
            let sd = found.map_or(f64::NAN, |k| {
                let own = SD_FACTOR * fitted.posterior.covariance[(k, k)].sqrt();
                own.min(fitted.model.free[k].sd)
            });
            let (value, sd) = match (log, prior.id) {
                (true, _) => (prior.value * value, prior.value * value * sd),
                (false, MechanismId::SensorLag) => (value, sd),
                (false, MechanismId::WindDirectionOffset) => (wind_from_deg + value, sd),
                (false, _) => (prior.value + value, sd),
            };
            BaseParameter {
                name: prior.key.clone(),
                value,
                sd,
                prior: prior.sd,
            }
        })
        .collect()
}

/// The scenario's uncertain keys as they stand before any data.
pub(crate) fn prior_parameters(setup: &Setup) -> Vec<BaseParameter> {
    setup
        .priors
        .iter()
        .map(|p| BaseParameter {
            name: p.key.clone(),
            value: p.value,
            sd: p.sd,
            prior: p.sd,
        })
        .collect()
}

/// The smallest effect of every mechanism that these data could have shown. Of a lid or a limit,
/// which do nothing at infinity, it is the highest of those tried that would show.
pub(crate) fn detectable(named: &Named) -> Vec<Detectable> {
    let first = &named.first;
    let mut out: Vec<(f64, Detectable)> = Vec::new();
    // Of several starts the one whose step is about as long as what it finds is the straightest.
    let mut put = |id: MechanismId, which: usize, value: f64, bend: f64| {
        let p = &id.spec().parameters[which];
        let mechanism = id.as_str().to_string();
        let known = out.iter().position(|d| d.1.mechanism == mechanism);
        if !value.is_finite() || known.is_some_and(|k| out[k].0 <= bend) {
            return;
        }
        let entry = Detectable {
            mechanism,
            parameter: p.name.to_string(),
            value,
            unit: p.unit.to_string(),
        };
        match known {
            Some(k) => out[k] = (bend, entry),
            None => out.push((bend, entry)),
        }
    };
    for (id, s) in first.screened.iter().filter(|(_, s)| s.platform.is_none()) {
        let start = &first.starts[s.start];
        let amplitude = detectable_amplitude(s);
        let which = if *id == MechanismId::SecondSource {
            2
        } else {
            0
        };
        if id.spec().parameters[which].neutral.is_finite() {
            let reached = start.part(None, &vec![amplitude; start.ends.len()]).values[which];
            let size = (reached - defaults(*id)[which]).abs();
            put(*id, which, size, amplitude.ln().abs());
        } else if amplitude <= 1.0 {
            let limit = start.ends[0][which];
            put(*id, which, limit, -limit);
        }
    }
    for s in first.equations.score_widened() {
        let spec = named.base.model.spec_of(s.start);
        let departure = detectable_amplitude(&s);
        let size = match spec.coordinate {
            Coordinate::Log => departure.exp() - 1.0,
            Coordinate::Linear => departure,
        };
        put(named.base.model.id_of(s.start), 0, size, 0.0);
    }
    out.into_iter().map(|(_, entry)| entry).collect()
}

/// Steps of a start, or units of a parameter's coordinate, that count as detectable.
fn detectable_amplitude(scored: &Scored) -> f64 {
    (2.0 * DETECTABLE_NATS / scored.information).sqrt()
}

/// What is said of parameters that the scenario marks uncertain and that stand farther from its
/// values than it thinks likely, but are not named.
pub(crate) fn unlikely(ctx: &Context<'_>, named: &Named) -> Vec<String> {
    let model = &named.last.model;
    let stated = ctx.setup.priors.len();
    let is_named = |part: usize| named.accepted.iter().any(|a| a.part == part);
    let far = (0..model.dimension()).filter(|k| {
        let part = model.free[*k].part;
        part < stated && !is_named(part) && model.departure_sd(*k).abs() > UNLIKELY_SD
    });
    let words = |k: usize| {
        format!(
            "{} stands {:.1} of its prior's standard deviations from the scenario's value",
            ctx.setup.priors[model.free[k].part].key,
            model.departure_sd(k).abs()
        )
    };
    far.map(words).collect()
}

/// What is said of faults that may be another platform's instead.
pub(crate) fn elsewhere(ctx: &Context<'_>, named: &Named) -> Vec<String> {
    let platforms = ctx.data.track.platforms();
    let on = |p: Option<usize>| p.map_or("all platforms together", |p| platforms[p].as_str());
    let words = |a: &Accepted| {
        let there: Vec<String> = a
            .elsewhere
            .iter()
            .map(|(p, probability)| format!("{} (probability {probability:.2})", on(*p)))
            .collect();
        format!(
            "{} is stated for {}; it may be that of {} instead",
            a.id.as_str(),
            on(a.platform),
            there.join(" or ")
        )
    };
    let unsure = named.accepted.iter().filter(|a| !a.elsewhere.is_empty());
    unsure.map(words).collect()
}

/// The answer in one or two sentences.
pub(crate) fn summary(verdict: Verdict, named: &Named, gain: Option<&Gained>) -> String {
    let causes: Vec<String> = named
        .causes
        .iter()
        .map(|c| {
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
        })
        .collect();
    let gained = gain.map_or_else(String::new, |g| {
        let h = &g.gain.held_out;
        format!(
            " On data left out the log score gains {:.1} nats and the RMSE goes from {:.2} to {:.2} ppm.",
            h.log_score_after - h.log_score_before, h.rmse_before, h.rmse_after
        )
    });
    match (verdict, &named.unexplained) {
        (Verdict::None, _) => "The base and its noise explain the data.".to_string(),
        (Verdict::Unexplained, Some(u)) if named.rest.is_none() && !causes.is_empty() => {
            format!(
                "The data ask for {}, or for something that no mechanism of the catalogue explains: {} (in {}).{gained}",
                causes.join("; "),
                u.term,
                u.coordinate
            )
        }
        (Verdict::Unexplained, Some(u)) => {
            let something = if causes.is_empty() {
                "Something".to_string()
            } else {
                format!("Besides {}, something", causes.join("; "))
            };
            format!(
                "{something} is there that no mechanism of the catalogue explains: {} (in {}).{gained}",
                u.term, u.coordinate
            )
        }
        (Verdict::Ambiguous, _) => {
            format!(
                "The data ask for {}, and cannot tell some of these apart.{gained}",
                causes.join("; ")
            )
        }
        _ => format!("The data ask for {}.{gained}", causes.join("; ")),
    }
}
