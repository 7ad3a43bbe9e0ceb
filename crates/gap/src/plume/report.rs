//! What a report shows, as plain data.

use infer::FittedSet;
use serde::Serialize;

use super::Study;
use super::answer::carried_from_deg;
use super::gain::Gained;
use super::model::PlumeModel;
use super::residual::wind_axes;

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
    /// Blocks held out: from, to, s, and gain of log score, nats.
    pub blocks: Vec<(f64, f64, f64)>,
    /// Source, m east and north.
    pub source_m: (f64, f64),
    /// Direction from which the wind carries the plume, in the mean where it was met, degrees: by the base and by
    /// the extended model.
    pub wind_from_deg: [f64; 2],
}

/// A set's predictions.
struct Shown {
    reading: Vec<f64>,
    standardised: Vec<f64>,
}

fn shown(study: &Study<'_>, of: &FittedSet<PlumeModel<'_>>) -> Shown {
    let fit = of.fit();
    let used = &study.data.used;
    let reading = fit.misfit.iter().zip(&study.data.reading_ppm).zip(used);
    let turns = study.question.turns(of);
    let predicted = infer::ForwardModel::predict(&of.model, of.at(), &turns);
    let predicted = predicted.map(|p| p.reading).unwrap_or_default();
    Shown {
        // With its discrepancy, as the misfit has it; without where nothing was read.
        reading: reading
            .enumerate()
            .map(|(i, ((misfit, read), used))| {
                if *used {
                    read - misfit
                } else {
                    predicted.get(i).copied().unwrap_or(f64::NAN)
                }
            })
            .collect(),
        standardised: study.question.whitened(of, &fit.misfit),
    }
}

/// What the report shows.
pub(crate) fn report(study: &Study<'_>, gain: Option<&Gained>) -> GapReport {
    let (along, across) = wind_axes(study);
    let data = study.data;
    let track = &data.track;
    let (before, after) = (shown(study, &study.base), shown(study, &study.judged.set));
    let series = track
        .platforms()
        .iter()
        .zip(data.ranges())
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
                measured_ppm: take(&data.reading_ppm),
                used: data.used[r.clone()].to_vec(),
                before_ppm: take(&before.reading),
                after_ppm: take(&after.reading),
                before_standardised: take(&before.standardised),
                after_standardised: take(&after.standardised),
            }
        })
        .collect();
    let source = study.setup.base.sources[0].place;
    GapReport {
        series,
        autocorrelation_raw: autocorrelation(study, &study.base.fit().misfit),
        autocorrelation_before: autocorrelation(study, &before.standardised),
        autocorrelation_after: autocorrelation(study, &after.standardised),
        noise: noise_words(&study.base.fit().noise),
        blocks: gain.map_or_else(Vec::new, |g| g.blocks.clone()),
        source_m: (source.east_m, source.north_m),
        wind_from_deg: [&study.base, &study.judged.set].map(|of| carried_from_deg(study, of)),
    }
}

fn autocorrelation(study: &Study<'_>, values: &[f64]) -> Vec<f64> {
    const LAGS: usize = 60;
    let at = |lag: usize| {
        let (mut sum, mut own) = (0.0, 0.0);
        for r in study.data.ranges() {
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

fn noise_words(n: &infer::Noise) -> Vec<(String, f64, String)> {
    let word = |name: &str, value: f64, unit: &str| (name.to_string(), value, unit.to_string());
    vec![
        word("white noise of a reading", n.white, "ppm"),
        word("slow wander of the zero", n.slow, "ppm"),
        word("slow wander, time constant", n.slow_s, "s"),
        word("fluctuation of the plume", 100.0 * n.fluctuation, "% of it"),
        word("fluctuation, time constant", n.fluctuation_s, "s"),
        word("wander of the axis", n.wander_deg, "deg"),
        word("wander of the axis up and down", n.wander_sigma_z, "σz"),
        word("wander of the axis, time constant", n.wander_s, "s"),
    ]
}
