//! The start: which wind carries the plume, and the base with its noise at their best.

use ::plume::field::Strength;
use ::plume::mechanism::{Family, MechanismId};

use super::data::{Data, Setup};
use super::early;
use super::fit::{Context, Effort, Fitted, moved_to_better};
use super::followed::followed;
use super::model::{Model, Prediction};
use super::noise::{self, NoiseModel};
use super::parallel;
use super::shown;
use super::transport::{Carried, Treatment, carried};

/// Treatments of the wind that come so near to the best, with everything else free, are as
/// good, nats.
const ALIKE_NATS: f64 = 6.0;

/// How far on either side the plume is looked for, standard deviations of the wind's direction and
/// degrees, and in which steps.
const AIMS_SD: f64 = 2.5;
const FARTHEST_AIM_DEG: f64 = 180.0;
const AIM_STEP_SD: f64 = 0.5;
const LONGEST_AIM_STEP_DEG: f64 = 5.0;

/// Steps to where a base held back is at its best.
const HELD_STEPS: usize = 5;

/// Gain of log likelihood beyond which puffs of another plume are other puffs, nats.
const OTHER_PUFFS_NATS: f64 = 10.0;
/// How many standard deviations a log may drift by chance.
const CHANCE_SD: f64 = 3.0;

/// How often puffs and the plume that sheds them are fitted in turn at most, and what the last turn
/// gains, nats.
const TURNS: usize = 5;
const LAST_GAIN_NATS: f64 = 1.0;

/// The base at its best.
pub(crate) struct Started {
    pub fitted: Fitted,
    /// The wind as it carries the plume, by its treatment; none is the scenario's.
    carried: Option<Carried>,
    /// The straight line through the logged wind, where that does not carry it.
    steady: Option<Carried>,
}

/// Whether a mechanism is one of how the plume spreads, which its puffs do too.
fn spreads(id: MechanismId) -> bool {
    id.spec().family == Family::Spread
        || matches!(id, MechanismId::Meander | MechanismId::BuildingDownwash)
}

impl Started {
    /// The wind's treatment.
    pub fn treatment(&self) -> Treatment {
        let own = self.carried.as_ref().map(|c| c.treatment);
        own.unwrap_or(Treatment::Scenario)
    }

    /// The start in a wind that only turns steadily, and the data with it, where its log may drift so
    /// far by chance and that makes the data more probable than `last`, which has a cause for the drift:
    /// what gusts did where the log was kept need not have been done to the plume.
    pub fn in_steady_wind(
        &self,
        setup: &Setup,
        data: &Data,
        last: &Fitted,
    ) -> Option<(Self, Data)> {
        let line = self.steady.as_ref()?;
        // Only what has the metric of its own noise compares from wind to wind.
        let last = single(setup, data).refine(&last.model, last.noise);
        let base = self.fitted.model.beside_chance(line.chance_deg_per_h);
        let (own, base) = settled(setup, data, line, &base, &last.noise);
        let fitted = single(setup, &own).refine(&base, last.noise);
        let drift = fitted.model.free_of(MechanismId::WindDirectionDrift)?;
        let by_chance = fitted.model.departure_sd(drift).abs() < CHANCE_SD;
        let evidence = |f: &Fitted, t: Treatment| f.log_evidence + t.ln_prior();
        if !by_chance || evidence(&fitted, line.treatment) <= evidence(&last, self.treatment()) {
            return None;
        }
        let started = Self {
            fitted,
            carried: Some(line.clone()),
            steady: None,
        };
        Some((started, own))
    }

    /// What puffs do to a plume is fitted at the base. Where a plume was found to be so different
    /// that its own puffs differ, the data with those.
    pub fn other_puffs(&self, setup: &Setup, data: &Data, last: &Fitted) -> Option<Data> {
        let carried = self.carried.as_ref().filter(|c| c.has_history())?;
        last.model.parts.iter().find(|p| spreads(p.id))?;
        let mut own = data.clone();
        put(setup, &mut own, carried, &last.model);
        let mut change = single(setup, &own).readings(&last.model);
        for (i, value) in change.iter_mut().enumerate() {
            *value -= last.prediction.reading[i];
        }
        last.metric.whitener.whiten_one(&mut change);
        if 0.5 * last.metric.square(&change) < OTHER_PUFFS_NATS {
            return None;
        }
        Some(settled(setup, data, carried, &last.model, &last.noise).0)
    }
}

/// Chooses the wind's treatment, fits base and noise.
pub(crate) fn start(setup: &Setup, data: &mut Data, threads: usize) -> Started {
    early::leave_out(setup, data);
    let noise = white_noise(setup, data);
    let noise = if data.on_board_wind {
        noise.with_logged_wind()
    } else {
        noise
    };
    choose_wind(setup, data, noise, threads)
}

/// Steps between neighbouring readings, ppm, the smallest first.
fn steps_ppm(data: &Data) -> Vec<f64> {
    let mut steps = Vec::new();
    for range in data.ranges() {
        let rows: Vec<usize> = range.clone().filter(|i| data.used[*i]).collect();
        steps.extend(
            rows.windows(2)
                .map(|w| (data.reading_ppm[w[1]] - data.reading_ppm[w[0]]).abs()),
        );
    }
    steps.sort_by(f64::total_cmp);
    steps
}

/// White noise as stated, or as neighbouring readings differ, whichever they agree on within a
/// factor of three; at least that of the readings' own grid.
fn white_noise(setup: &Setup, data: &Data) -> NoiseModel {
    let steps = steps_ppm(data);
    let middle = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    let grid = steps.iter().copied().find(|s| *s > 0.0).unwrap_or(0.0);
    // Median of |a - b| of two normal numbers is 0.954 standard deviations. On a coarse grid half
    // of the steps may be nil.
    let seen = (middle / 0.954).max(noise::of_grid(grid)).max(1e-3);
    let stated = setup.base.sensor.noise_sd_ppm;
    let white = if stated > 0.0 {
        seen.clamp(stated / 3.0, stated * 3.0)
    } else {
        seen
    };
    NoiseModel::prior(white).with_grid(grid)
}

/// Puts the transport under which the data are most probable, whatever else may be wrong, into
/// `data`; gives the base there. Of those that are about as probable it is the one under which
/// the least else is wrong.
fn choose_wind(setup: &Setup, data: &mut Data, noise: NoiseModel, threads: usize) -> Started {
    let logged = data.on_board_wind;
    let base = Model::base(setup, logged);
    let mut options = options(setup, data, logged);
    let shared: &Data = data;
    let first = options.iter().find(|o| o.treatment == Treatment::FIRST);
    let Some(first) = first.or(options.first()) else {
        return Started {
            fitted: single(setup, data).refine(&base, noise),
            carried: None,
            steady: None,
        };
    };
    let (base, far) = aimed(setup, shared, first, base, &noise);
    // The wind's treatment and the noise are those of a plume that the readings follow.
    let (base, held) = match far {
        Some(far) => (far, Some(base)),
        None => (base, None),
    };
    let (base, held) = match swinging(setup, shared, first, &base, &noise) {
        Some((shown, beside)) => {
            options = shown;
            (beside, None)
        }
        None => (base, held),
    };
    let quick = parallel::map(&options, threads, |o| {
        let (own, settled) = settled(setup, shared, o, &base, &noise);
        let wide = single(setup, &own).wide(&settled, noise, Effort::QUICK);
        (wide.log_score + o.treatment.ln_prior(), settled, wide.noise)
    });
    let scores: Vec<f64> = quick.iter().map(|q| q.0).collect();
    let order = shortlist(&options, &scores);
    let full = parallel::map(&order, threads, |&k| {
        let (own, settled) = settled(setup, shared, &options[k], &quick[k].1, &quick[k].2);
        // Three on two threads: within the last one there is work for both.
        let ctx = Context {
            threads,
            ..single(setup, &own)
        };
        let wide = ctx.wide(&settled, quick[k].2, Effort::FULL);
        let score = wide.log_score + options[k].treatment.ln_prior();
        (score, ctx.within(&settled, wide), own)
    });
    let (best, fitted, own) = least_wrong(&options, &order, full);
    *data = own;
    let carried = options.swap_remove(best);
    // Only now: a base that takes up what is hidden must not win by that.
    let fitted = if carried.chance_deg_per_h > 0.0 {
        let base = fitted.model.beside_chance(carried.chance_deg_per_h);
        single(setup, data).refine(&base, fitted.noise)
    } else {
        fitted
    };
    let fitted = match held {
        Some(base) => held_back(&single(setup, data), &base, fitted),
        None => fitted,
    };
    Started {
        fitted,
        carried: Some(carried),
        steady: options.into_iter().find(|o| o.treatment == Treatment::Line),
    }
}

/// Of treatments whose full fits, in this `order`, are about as probable as the best, the one under
/// which the least else is wrong, with its fit.
fn least_wrong(
    options: &[Carried],
    order: &[usize],
    mut full: Vec<(f64, Fitted, Data)>,
) -> (usize, Fitted, Data) {
    let most = full.iter().map(|f| f.0).fold(f64::NEG_INFINITY, f64::max);
    let evidence = |k: usize| full[k].1.log_evidence + options[order[k]].treatment.ln_prior();
    let best = (0..order.len())
        .filter(|k| full[*k].0 > most - ALIKE_NATS)
        .max_by(|a, b| evidence(*a).total_cmp(&evidence(*b)).then(b.cmp(a)))
        .unwrap_or(0);
    let (_, fitted, own) = full.swap_remove(best);
    (order[best], fitted, own)
}

/// How often the swing that a plume shows and the plume are fitted in turn.
const SWING_TURNS: usize = 2;

/// The treatments of a wind that nobody logged where the plume shows that it swings, and the base
/// beside them.
fn swinging(
    setup: &Setup,
    data: &Data,
    still: &Carried,
    base: &Model,
    noise: &NoiseModel,
) -> Option<(Vec<Carried>, Model)> {
    if data.on_board_wind {
        return None;
    }
    let distance_m: Vec<f64> = data.distance_m(setup.base.sources[0].place).collect();
    let mut fitted = settled(setup, data, still, base, noise).1;
    let mut found = None;
    for _ in 0..SWING_TURNS {
        let stated = shown::with_stated_wind(&fitted);
        let mut own = data.clone();
        put(setup, &mut own, still, &stated);
        let swing = shown::shown(&single(setup, &own), &stated, noise.white_ppm())?;
        let carried = Carried::shown(data, &distance_m, &swing);
        let beside = shown::base_beside(base, &stated, &swing);
        fitted = settled(setup, data, carried.first()?, &beside, noise).1;
        found = Some((carried, fitted.clone()));
    }
    found
}

/// The treatments of the wind that the data allow.
fn options(setup: &Setup, data: &Data, logged: bool) -> Vec<Carried> {
    let stated_c_max = matches!(setup.base.sources[0].strength, Strength::CMax { .. });
    let treatments: &[Treatment] = if logged {
        &Treatment::LOGGED
    } else {
        &Treatment::UNLOGGED
    };
    treatments
        .iter()
        .filter(|t| stated_c_max || !matches!(t, Treatment::Diluted(_)))
        .filter_map(|t| carried_by(setup, data, *t))
        .collect()
}

/// The best three by `scores`. Of two that are as good at first the fuller fit tells: puffs and
/// straight plumes both have to be among them.
fn shortlist(options: &[Carried], scores: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..options.len()).collect();
    order.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]).then(a.cmp(b)));
    let kind = |place: usize| options[order[place]].has_history();
    let other = (1..order.len()).find(|k| kind(*k) != kind(0));
    if let Some(other) = other.filter(|k| *k > 2) {
        order.swap(2, other);
    }
    order.truncate(3);
    order
}

/// The base turned to where its plume is most probable, about as far as its prior reaches: a
/// narrow plume that points elsewhere than the readings has no slope that leads to them. Where they
/// follow none of these, also a base with a wide prior, turned to where they follow it, if anywhere.
fn aimed(
    setup: &Setup,
    data: &Data,
    carried: &Carried,
    base: Model,
    noise: &NoiseModel,
) -> (Model, Option<Model>) {
    let Some(k) = base.free_of(MechanismId::WindDirectionOffset) else {
        return (base, None);
    };
    let mut own = data.clone();
    put(setup, &mut own, carried, &base);
    let ctx = single(setup, &own);
    let reach_deg = (AIMS_SD * base.free[k].sd).min(FARTHEST_AIM_DEG);
    let (near, prediction) = turned_by(&ctx, &base, k, reach_deg, noise);
    if followed(&own, &prediction.reading) {
        return (near, None);
    }
    let (far, prediction) = turned_afar(&ctx, &base, k, noise);
    let far = followed(&own, &prediction.reading).then_some(far);
    (near, far)
}

/// A model with a wide prior for its free parameter `k`, a direction, turned to wherever it is most
/// probable under `noise`, and what it predicts.
pub(super) fn turned_afar(
    ctx: &Context<'_>,
    model: &Model,
    k: usize,
    noise: &NoiseModel,
) -> (Model, Prediction) {
    turned_by(ctx, &model.widened(k), k, FARTHEST_AIM_DEG, noise)
}

/// A model turned by up to `reach_deg` on either side by its free parameter `k`, a direction, to
/// where it is most probable under `noise`, and what it predicts.
fn turned_by(
    ctx: &Context<'_>,
    model: &Model,
    k: usize,
    reach_deg: f64,
    noise: &NoiseModel,
) -> (Model, Prediction) {
    let step_deg = (AIM_STEP_SD * model.free[k].sd).min(LONGEST_AIM_STEP_DEG);
    let steps = (reach_deg / step_deg).ceil() as i32;
    let turned = |aim: i32| {
        let mut turned = model.clone();
        let turn_deg = f64::from(aim) / f64::from(steps.max(1)) * reach_deg;
        turned.set_coordinate(k, model.coordinate(k) + turn_deg);
        let prediction = ctx.predict(&turned);
        let loading = ctx.loading(&turned, &prediction);
        let residual = ctx.data.residual(&prediction.reading);
        let score = noise::log_likelihood(&ctx.rows(&loading), noise, &residual);
        (score + turned.ln_prior(), turned, prediction)
    };
    // From the middle outwards: of two that are as good the nearer one stands.
    let aims = (1..=2 * steps).map(|n| if n % 2 == 0 { n / 2 } else { -(n + 1) / 2 });
    let better = aims
        .map(turned)
        .fold(turned(0), |a, b| if b.0 > a.0 { b } else { a });
    (better.1, better.2)
}

/// What was fitted turned afar, with the wind's direction back in the prior of `base`: under the
/// same noise, against which it is seen how far the readings lie from there.
fn held_back(ctx: &Context<'_>, base: &Model, fitted: Fitted) -> Fitted {
    let mut model = fitted.model.clone();
    if let Some(k) = base.free_of(MechanismId::WindDirectionOffset) {
        model.free[k] = base.free[k].clone();
        model.set_coordinate(k, base.coordinate(k));
    }
    ctx.settle(&model, &fitted.metric, &fitted, HELD_STEPS)
}

/// The data with a wind put in, and a model settled in it.
fn settled(
    setup: &Setup,
    data: &Data,
    carried: &Carried,
    model: &Model,
    noise: &NoiseModel,
) -> (Data, Model) {
    let with_its_wind = |model: &Model| {
        let mut own = data.clone();
        put(setup, &mut own, carried, model);
        own
    };
    let own = with_its_wind(model);
    if carried.has_history() {
        return settled_puffs(setup, own, model, noise, with_its_wind);
    }
    let settled = single(setup, &own).under(model, noise);
    (with_its_wind(&settled), settled)
}

/// The same of puffs: what they make of a plume is that of a model beside which another may be worse,
/// and is asked for again at every step.
fn settled_puffs(
    setup: &Setup,
    mut own: Data,
    model: &Model,
    noise: &NoiseModel,
    with_its_wind: impl Fn(&Model) -> Data,
) -> (Data, Model) {
    let mut model = model.clone();
    let (mut nats, mut metric) = single(setup, &own).nats_under(&model, noise);
    for _ in 0..TURNS {
        let next = single(setup, &own).under_from(&model, &metric, noise);
        let step = next.coordinates() - model.coordinates();
        let better = moved_to_better(&model, &step, |there| {
            let data = with_its_wind(there);
            let (there_nats, metric) = single(setup, &data).nats_under(there, noise);
            (there_nats > nats).then_some((there_nats, metric, data))
        });
        let Some((there, (there_nats, there_metric, data))) = better else {
            break;
        };
        let gained = there_nats - nats;
        (nats, metric, model, own) = (there_nats, there_metric, there, data);
        if gained < LAST_GAIN_NATS {
            break;
        }
    }
    (own, model)
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
    let distance: Vec<f64> = data.distance_m(setup.base.sources[0].place).collect();
    carried(data, &distance, treatment)
}

/// Puts a wind into `data`, with what it does to the plume of `model`.
fn put(setup: &Setup, data: &mut Data, carried: &Carried, model: &Model) {
    if let Some(world) = model.world(&setup.base, data.track.platforms()) {
        carried.put(&mut data.track, &world);
    }
    data.shown_swing_deg = carried.shown_swing_deg;
    let source = setup.base.sources[0].place;
    let ages: Vec<f64> = match (carried.has_history(), data.on_board_wind) {
        (true, true) => data.logged_age_s(source).collect(),
        // A wind that nobody logged drifts as the weather does, before the record too.
        (true, false) => data.way_s(source).map(|way_s| 0.5 * way_s).collect(),
        (false, _) => vec![0.0; data.len()],
    };
    data.track.wind_age_s_mut().copy_from_slice(&ages);
}
