//! The start: which wind carries the plume, and the base with its noise at their best.

use ::plume::field::Transport;

use super::data::{Data, Setup};
use super::fit::{Context, Fitted};
use super::model::Model;
use super::noise::NoiseModel;
use super::parallel;
use super::transport::{Treatment, transports};

/// The base at its best.
pub(crate) struct Started {
    pub fitted: Fitted,
    /// The wind's treatment, in words.
    pub wind: String,
}

/// Chooses the wind's treatment, fits base and noise.
pub(crate) fn start(setup: &Setup, data: &mut Data, threads: usize) -> Started {
    let model = Model::base(setup);
    let noise = NoiseModel::prior(white_noise(setup, data));
    let wind = choose_wind(setup, data, &model, noise, threads);
    let ctx = Context {
        setup,
        data,
        threads,
    };
    let first = ctx.start(&model, noise, 8);
    Started {
        fitted: ctx.refine(first, 2, 6),
        wind,
    }
}

/// The base at its best under a given noise.
pub(crate) fn under(setup: &Setup, data: &mut Data, noise: NoiseModel) -> Fitted {
    let model = Model::base(setup);
    choose_wind(setup, data, &model, noise, 1);
    let ctx = Context {
        setup,
        data,
        threads: 1,
    };
    let mut fitted = ctx.start(&model, noise, 0);
    fitted.noise = noise;
    fitted
}

/// White noise as stated, or as neighbouring readings differ, whichever they agree on within a
/// factor of three, ppm.
fn white_noise(setup: &Setup, data: &Data) -> f64 {
    let mut steps = Vec::new();
    for range in data.ranges() {
        let rows: Vec<usize> = range.clone().filter(|i| data.used[*i]).collect();
        steps.extend(
            rows.windows(2)
                .map(|w| (data.reading_ppm[w[1]] - data.reading_ppm[w[0]]).abs()),
        );
    }
    steps.sort_by(f64::total_cmp);
    let middle = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    let mut positive = steps.iter().copied().filter(|s| *s > 0.0);
    // On a coarse grid half of the steps may be nil: the grid itself has a noise.
    let grid = positive.next().unwrap_or(0.0) * 0.29;
    // Median of |a - b| of two normal numbers is 0.954 standard deviations.
    let seen = (middle / 0.954).max(grid).max(1e-3);
    let stated = setup.base.sensor.noise_sd_ppm;
    if stated > 0.0 {
        seen.clamp(stated / 3.0, stated * 3.0)
    } else {
        seen
    }
}

/// Puts the transport under which the base fits best into `data`; says which it is.
fn choose_wind(
    setup: &Setup,
    data: &mut Data,
    model: &Model,
    noise: NoiseModel,
    threads: usize,
) -> String {
    let logged: Vec<Option<Transport>> = data
        .wind
        .iter()
        .zip(data.track.transport())
        .map(|(w, t)| w.map(|_| *t))
        .collect();
    let source = setup.base.sources[0].place;
    let distance: Vec<f64> = (0..data.len())
        .map(|i| {
            let p = data.track.place(i);
            (p.east_m - source.east_m).hypot(p.north_m - source.north_m)
        })
        .collect();
    let options: Vec<(Treatment, Vec<Transport>)> = Treatment::ALL
        .iter()
        .filter_map(|t| Some((*t, transports(data, &logged, &distance, *t)?)))
        .collect();
    if options.is_empty() {
        return "the scenario's wind".to_string();
    }
    let shared: &Data = data;
    let score = |transport: &[Transport], rounds: usize| {
        let mut own = shared.clone();
        own.track.transport_mut().copy_from_slice(transport);
        let ctx = Context {
            setup,
            data: &own,
            threads: 1,
        };
        let fitted = ctx.start(model, noise, 3);
        let fitted = ctx.refine(fitted, rounds, 4);
        fitted.log_score + fitted.model.ln_prior()
    };
    let quick = parallel::map(&options, threads, |o| score(&o.1, 0));
    let mut order: Vec<usize> = (0..options.len()).collect();
    order.sort_by(|a, b| quick[*b].total_cmp(&quick[*a]).then(a.cmp(b)));
    order.truncate(3);
    let full = parallel::map(&order, threads, |k| score(&options[*k].1, 1));
    let mut best = order[0];
    let mut most = f64::NEG_INFINITY;
    for (k, value) in order.iter().zip(full) {
        if value > most {
            (best, most) = (*k, value);
        }
    }
    let (treatment, transport) = &options[best];
    data.track.transport_mut().copy_from_slice(transport);
    treatment.describe()
}
