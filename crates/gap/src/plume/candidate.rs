//! What is tried: every mechanism of the catalogue, for all platforms or one, from a small
//! dictionary of starting points for those that are not linear.

use ::plume::field::Strength;
use ::plume::mechanism::{Coordinate, Family, MechanismId, Steps};

use super::fit::Context;
use super::lid;
use super::model::{Model, Part, Prediction, defaults, to_coordinate};

/// A direction in which a mechanism may depart from doing nothing: one or two columns.
#[derive(Debug, Clone)]
pub(crate) struct Start {
    pub id: MechanismId,
    /// Parameter values at the end of each column's step.
    pub ends: Vec<Vec<f64>>,
    /// Prior standard deviation of each column's amplitude, in steps.
    pub sd: Vec<f64>,
    /// Standard deviation of what nothing real departs by, in steps.
    pub tolerance: Vec<f64>,
    /// Only positive amplitudes.
    pub one_sided: bool,
    /// All platforms alike have it in the model already: only one may differ.
    pub one_platform: bool,
    /// Platforms that have it in the model already.
    pub taken: Vec<usize>,
    /// Log of its share of the mechanism's prior.
    pub ln_weight: f64,
}

/// All starts on top of a model with its prediction.
pub(crate) fn starts(ctx: &Context<'_>, model: &Model, prediction: &Prediction) -> Vec<Start> {
    let mut out = Vec::new();
    let platforms = ctx.data.ranges().len();
    for &id in MechanismId::ALL {
        let of_all = |p: &Part| p.id == id && p.platform.is_none();
        let has = model.parts.iter().position(of_all);
        // That all sensors may be slow, as the scenario says, does not explain one that is.
        let stated = has.is_some_and(|k| k < ctx.setup.priors.len());
        let one_platform = stated && id.spec().family == Family::Sensor && platforms > 1;
        if (has.is_some() && !one_platform) || !known(ctx, id) {
            continue;
        }
        let mut own = of_mechanism(ctx, model, prediction, id);
        let taken = model.parts.iter().filter(|p| p.id == id);
        let taken: Vec<usize> = taken.filter_map(|p| p.platform).collect();
        for start in &mut own {
            start.one_platform = one_platform;
            start.taken.clone_from(&taken);
        }
        let share = -(own.len().max(1) as f64).ln();
        // Steps of one line are one hypothesis; places of a grid share the prior.
        if matches!(id, MechanismId::SecondSource) {
            own.iter_mut().for_each(|s| s.ln_weight = share);
        }
        out.extend(own);
    }
    out
}

/// Whether the data could say anything about it.
fn known(ctx: &Context<'_>, id: MechanismId) -> bool {
    use MechanismId as M;
    let air = ctx.data.track.air();
    let varies = |f: &dyn Fn(usize) -> f64| {
        let known: Vec<f64> = (0..air.len()).map(f).filter(|v| v.is_finite()).collect();
        let low = known.iter().copied().fold(f64::INFINITY, f64::min);
        let high = known.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        known.len() * 2 > air.len() && high > low
    };
    match id {
        M::CrossSensitivityHumidity => varies(&|i| air[i].relative_humidity_pct),
        M::CrossSensitivityTemperature => varies(&|i| air[i].temperature_c),
        M::CrossSensitivityPressure => varies(&|i| air[i].pressure_hpa),
        M::WindSpeedScale => {
            // Without an emission rate the speed does not enter.
            matches!(ctx.setup.base.sources[0].strength, Strength::EmissionKgS(_))
        }
        _ => true,
    }
}

/// A step of the first parameter alone.
pub(crate) fn single(id: MechanismId, value: f64) -> Start {
    let spec = &id.spec().parameters[0];
    let mut end = defaults(id);
    end[0] = value;
    let step = if spec.neutral.is_finite() {
        to_coordinate(spec, value) - to_coordinate(spec, spec.neutral)
    } else {
        1.0
    };
    Start {
        id,
        ends: vec![end],
        sd: vec![spec.prior_sd / step.abs()],
        tolerance: vec![spec.tolerance / step.abs()],
        one_sided: spec.low == spec.neutral || spec.high == spec.neutral,
        one_platform: false,
        taken: Vec::new(),
        ln_weight: 0.0,
    }
}

/// Steps of two parameters, each a column.
fn plane(id: MechanismId, step: f64) -> Vec<Start> {
    let spec = &id.spec().parameters[0];
    let end = |k: usize| {
        let mut end = defaults(id);
        end[k] = step;
        end
    };
    vec![Start {
        id,
        ends: vec![end(0), end(1)],
        sd: vec![spec.prior_sd / step; 2],
        tolerance: vec![spec.tolerance / step; 2],
        one_sided: false,
        one_platform: false,
        taken: Vec::new(),
        ln_weight: 0.0,
    }]
}

fn of_mechanism(
    ctx: &Context<'_>,
    model: &Model,
    prediction: &Prediction,
    id: MechanismId,
) -> Vec<Start> {
    match id.spec().steps {
        Steps::Line(values) => values.iter().map(|v| single(id, *v)).collect(),
        Steps::Plane(step) => plane(id, step),
        Steps::HeightsAboveAxis => lid::starts(ctx, model),
        Steps::PlacesAroundSource => second_sources(ctx, model),
        Steps::PartsOfRange => saturations(id, prediction),
        Steps::AboutBackground(value) => about(id, value, &[0.0, ctx.setup.base.background_ppm]),
        Steps::AboutPressureMet(value) => about(id, value, &pressures(ctx)),
    }
}

/// A step of the first parameter about each of two values of the second, which is a setting: the
/// sensor was adjusted at one of them.
fn about(id: MechanismId, value: f64, pivots: &[f64]) -> Vec<Start> {
    let start = |pivot: &f64| {
        let mut start = single(id, value);
        start.ends[0][1] = *pivot;
        start.ln_weight = -std::f64::consts::LN_2;
        start
    };
    pivots.iter().map(start).collect()
}

/// The standard pressure and the mean of that met, hPa, as far as they are pressures of the air.
fn pressures(ctx: &Context<'_>) -> Vec<f64> {
    let air = ctx.data.track.air().iter();
    let known: Vec<f64> = air
        .map(|a| a.pressure_hpa)
        .filter(|p| p.is_finite())
        .collect();
    let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
    let mut out = vec![1013.25, mean];
    out.retain(|p| (100.0..=1100.0).contains(p));
    out
}

/// Limits below the highest predicted reading.
fn saturations(id: MechanismId, prediction: &Prediction) -> Vec<Start> {
    let reading = &prediction.reading;
    let high = reading.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let base = reading.iter().zip(&prediction.plume).map(|(r, p)| r - p);
    let low = base.fold(f64::INFINITY, f64::min);
    [0.85, 0.65, 0.45, 0.25]
        .iter()
        .map(|part| (low + part * (high - low)).max(1.0))
        .map(|limit| single(id, limit))
        .collect()
}

/// Second sources on a grid around the first, finer across the wind than along it.
fn second_sources(ctx: &Context<'_>, model: &Model) -> Vec<Start> {
    let track = &ctx.data.track;
    let n = track.len() as f64;
    let wind = track
        .transport()
        .iter()
        .fold([0.0; 2], |s, t| [s[0] + t.east / n, s[1] + t.north / n]);
    let length = wind[0].hypot(wind[1]).max(1e-9);
    let (e, no) = (wind[0] / length, wind[1] / length);
    let first = ctx.setup.base.sources[0].place;
    let reach = ctx.data.farthest_m(first).max(300.0);
    let Some(world) = model.world(&ctx.setup.base, track.platforms()) else {
        return Vec::new();
    };
    let spacing = 1.2 * world.sigmas_m(0.5 * reach).0;
    let mut out = Vec::new();
    for along in [-0.35, 0.0, 0.35] {
        for k in -6i32..=6 {
            if k == 0 && along == 0.0 {
                continue;
            }
            let (x, y) = (along * reach, f64::from(k) * spacing);
            let mut start = single(MechanismId::SecondSource, 0.0);
            start.ends = vec![vec![x * e + y * no, x * no - y * e, 0.3, 0.0]];
            start.sd = vec![0.5 / 0.3];
            start.tolerance = vec![0.002 / 0.3];
            start.one_sided = true;
            out.push(start);
        }
    }
    out
}

impl Start {
    /// What a wider prior adds to that of the free parameter `k`; it has no end of its own, as the
    /// base's derivative is its column.
    pub fn widened(model: &Model, k: usize) -> Self {
        let free = &model.free[k];
        let wider = model.wider_sd(k).unwrap_or(free.sd);
        Self {
            id: model.parts[free.part].id,
            ends: Vec::new(),
            sd: vec![(wider * wider - free.sd * free.sd).sqrt()],
            tolerance: vec![0.0],
            one_sided: false,
            one_platform: false,
            taken: Vec::new(),
            ln_weight: 0.0,
        }
    }

    /// The part at amplitudes `a` of the columns' steps.
    pub fn part(&self, platform: Option<usize>, a: &[f64]) -> Part {
        let spec = self.id.spec();
        let mut values = defaults(self.id);
        for (k, p) in spec.parameters.iter().enumerate() {
            if p.default.is_some() {
                values[k] = self.ends[0][k];
            }
        }
        for (end, a) in self.ends.iter().zip(a) {
            for (k, p) in spec.parameters.iter().enumerate() {
                if p.default.is_some() {
                    continue;
                }
                let place = self.id == MechanismId::SecondSource && k < 2;
                values[k] = if place || !p.neutral.is_finite() {
                    end[k]
                } else if end[k] == p.neutral {
                    values[k]
                } else {
                    let (from, to) = (to_coordinate(p, p.neutral), to_coordinate(p, end[k]));
                    let c = from + a * (to - from);
                    match p.coordinate {
                        Coordinate::Log => c.exp(),
                        Coordinate::Linear => c,
                    }
                };
                values[k] = values[k].clamp(p.low, p.high);
            }
        }
        Part {
            id: self.id,
            platform,
            values,
        }
    }

    /// The part at the end of column `k`'s step.
    pub fn end_part(&self, k: usize) -> Part {
        Part {
            id: self.id,
            platform: None,
            values: self.ends[k].clone(),
        }
    }

    /// What column `k`'s step changes in the readings.
    pub fn column(
        &self,
        ctx: &Context<'_>,
        model: &Model,
        prediction: &Prediction,
        k: usize,
    ) -> Vec<f64> {
        ctx.change(model, prediction, self.end_part(k))
    }

    /// Whether it may differ between platforms.
    pub fn of_a_platform(&self) -> bool {
        self.id.spec().family == Family::Sensor
    }

    /// Log of the share of its prior that lies on `platform` (or on all alike): a fault of all
    /// sensors and of one are equally likely before the data.
    pub fn ln_weight_on(&self, platform: Option<usize>, platforms: usize) -> f64 {
        match platform {
            _ if platforms < 2 || !self.of_a_platform() => 0.0,
            None => -std::f64::consts::LN_2,
            Some(_) => -std::f64::consts::LN_2 - (platforms as f64).ln(),
        }
    }
}
