//! The start: which wind carries the plume, and the base with its noise at their best.

use ::plume::field::{Strength, Transport, World};

use super::data::{Data, Setup};
use super::fit::{Context, Effort, Fitted};
use super::model::Model;
use super::noise::NoiseModel;
use super::parallel;
use super::transport::{Carried, Treatment, carried};

/// The base at its best.
pub(crate) struct Started {
    pub fitted: Fitted,
    /// The wind's treatment.
    pub treatment: Treatment,
}

/// Chooses the wind's treatment, fits base and noise.
pub(crate) fn start(setup: &Setup, data: &mut Data, threads: usize) -> Started {
    let noise = NoiseModel::prior(white_noise(setup, data));
    let noise = if data.on_board_wind {
        noise.with_logged_wind()
    } else {
        noise
    };
    let (treatment, model, noise) = choose_wind(setup, data, noise, threads);
    let ctx = Context {
        setup,
        data,
        threads,
    };
    Started {
        fitted: ctx.refine(&model, noise),
        treatment,
    }
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

/// Puts the transport under which the data are most probable, whatever else may be wrong, into
/// `data`; says which it is, with the base and the noise there.
fn choose_wind(
    setup: &Setup,
    data: &mut Data,
    noise: NoiseModel,
    threads: usize,
) -> (Treatment, Model, NoiseModel) {
    let base = Model::base(setup);
    let stated_c_max = matches!(setup.base.sources[0].strength, Strength::CMax { .. });
    let logged = data.wind.iter().any(Option::is_some);
    let treatments: &[Treatment] = match logged {
        true => &Treatment::LOGGED,
        false => &Treatment::UNLOGGED,
    };
    let options: Vec<(Treatment, Carried)> = treatments
        .iter()
        .filter(|t| stated_c_max || !matches!(t, Treatment::Diluted(_)))
        .filter_map(|t| Some((*t, carried_by(setup, data, *t)?)))
        .collect();
    let shared: &Data = data;
    let fit = |carried: &Carried, model: &Model, noise: NoiseModel, effort: Effort| {
        let mut own = shared.clone();
        put(setup, &mut own, carried, model);
        let settled = single(setup, &own).under(model, &noise);
        put(setup, &mut own, carried, &settled);
        let wide = single(setup, &own).wide(&settled, noise, effort);
        let score = wide.log_score + carried.treatment.ln_prior();
        (score, settled, wide.noise)
    };
    let quick = parallel::map(&options, threads, |o| {
        fit(&o.1, &base, noise, Effort::QUICK)
    });
    let mut order: Vec<usize> = (0..options.len()).collect();
    order.sort_by(|a, b| quick[*b].0.total_cmp(&quick[*a].0).then(a.cmp(b)));
    order.truncate(3);
    let full = parallel::map(&order, threads, |k| {
        fit(&options[*k].1, &quick[*k].1, quick[*k].2, Effort::FULL)
    });
    let best = (0..order.len())
        .max_by(|a, b| full[*a].0.total_cmp(&full[*b].0).then(b.cmp(a)))
        .unwrap_or(0);
    let (treatment, carried) = &options[order[best]];
    put(setup, data, carried, &full[best].1);
    (*treatment, full[best].1.clone(), full[best].2)
}

fn single<'a>(setup: &'a Setup, data: &'a Data) -> Context<'a> {
    Context {
        setup,
        data,
        threads: 1,
    }
}

/// What the wind of `data` becomes under a treatment; `None` without the wind that it needs.
fn carried_by(setup: &Setup, data: &Data, treatment: Treatment) -> Option<Carried> {
    let logged: Vec<Option<Transport>> = data
        .wind
        .iter()
        .zip(data.track.transport())
        .map(|(w, t)| w.map(|_| *t))
        .collect();
    let distance: Vec<f64> = data.distance_m(setup.base.sources[0].place).collect();
    carried(data, &logged, &distance, treatment)
}

/// Puts a wind into `data`, with what it does to the plume of `model`.
fn put(setup: &Setup, data: &mut Data, carried: &Carried, model: &Model) {
    let world: Option<World> = model.world(&setup.base, data.track.platforms());
    let factors = world.map(|w| carried.plume_factors(data, &w));
    data.track
        .transport_mut()
        .copy_from_slice(&carried.transport);
    if let Some(factors) = factors {
        data.track.plume_factor_mut().copy_from_slice(&factors);
    }
}
