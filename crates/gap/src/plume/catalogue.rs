//! What is tried: every mechanism of the catalogue, for all platforms or one, from steps along which
//! it departs from doing nothing.

use ::plume::field::{DispersionModel, Strength};
use ::plume::mechanism::{Family, MechanismId, Steps};
use infer::{AxisTurn, Catalogue, ForwardModel, InferError, Prediction, Start};

use super::data::Setup;
use super::model::{Part, PlumeModel, Scale, Unknown, fitted, neutral};

/// A mechanism that is tried, and a start of its search.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    /// The mechanism with its settings; fitted parameters are neutral.
    pub part: Part,
    /// Where a search of it starts.
    pub start: Start,
}

/// The part of a candidate that its unknowns `at` make.
fn set(part: &Part, at: &[f64]) -> Part {
    let mut out = part.clone();
    for (k, x) in fitted(part.id).zip(at) {
        let spec = &part.id.spec().parameters[k];
        out.values[k] = spec.from_coordinate(*x).clamp(spec.low, spec.high);
    }
    out
}

impl Catalogue for PlumeModel<'_> {
    type Hypothesis = Hypothesis;

    fn start(tried: &Hypothesis) -> &Start {
        &tried.start
    }

    fn same_cause(a: &Hypothesis, b: &Hypothesis) -> bool {
        a.part.id == b.part.id && a.part.platform == b.part.platform
    }

    fn with(&self, tried: &Hypothesis) -> Self {
        self.with(&tried.part)
    }

    fn predict_with(
        &self,
        at: &[f64],
        turns: &[AxisTurn],
        tried: &Hypothesis,
        end: &[f64],
    ) -> Result<Prediction, InferError> {
        let extended = self.with(&set(&tried.part, end));
        let at: Vec<f64> = at.iter().copied().chain(end.iter().copied()).collect();
        extended.predict(&at, turns)
    }

    fn exchanged(&self, at: &[f64]) -> Result<Vec<Vec<f64>>, InferError> {
        Ok(self.exchanged_sources(at)?.into_iter().collect())
    }
}

/// Parts of the highest reading at which a sensor may have gone no higher.
const LIMITS: [f64; 4] = [0.85, 0.65, 0.45, 0.25];
/// Heights of a lid above the axis, in σz at the middle of the track.
const LIDS: [f64; 5] = [0.3, 0.8, 1.4, 2.2, 3.2];
/// Strength of a second source that is tried at a place, over that of the first.
const SECOND: f64 = 0.3;
/// Places of a second source: along the wind in parts of the farthest reading, and across it.
const ALONG: [f64; 4] = [-0.6, -0.3, 0.0, 0.35];
const ACROSS: i32 = 7;
/// A prior of the scenario wider than this many of the catalogue's says nothing: what it is of is
/// fitted, not named.
const FLAT: f64 = 3.0;

/// All that is tried beside the base, whose prediction is given.
pub(crate) fn tried(
    setup: &Setup,
    model: &PlumeModel<'_>,
    base: &Prediction,
    world: &DispersionModel,
) -> Vec<Hypothesis> {
    let platforms = model.track().platforms().len();
    let mut out = Vec::new();
    for &id in MechanismId::ALL {
        if !is_known(setup, model, id) || is_flat(setup, id) || is_own(setup, id) {
            continue;
        }
        let starts = starts(setup, model, base, world, id);
        let scope: Vec<Option<usize>> = match id.spec().family {
            Family::Sensor if platforms > 1 => std::iter::once(None)
                .chain((0..platforms).map(Some))
                .collect(),
            _ => vec![None],
        };
        // A fault of all sensors and of one are equally likely before the data.
        let share = |platform: Option<usize>| match platform {
            _ if scope.len() == 1 => 0.0,
            None => -std::f64::consts::LN_2,
            Some(_) => -std::f64::consts::LN_2 - (platforms as f64).ln(),
        };
        for platform in &scope {
            for (values, start) in &starts {
                let mut start = start.clone();
                start.ln_prior += share(*platform);
                out.push(Hypothesis {
                    part: Part {
                        id,
                        platform: *platform,
                        values: values.clone(),
                    },
                    start,
                });
            }
        }
    }
    out
}

/// A turn of the wind towards where the readings lie.
pub(crate) fn aimed(turn_deg: f64, scale: Scale) -> Hypothesis {
    let id = MechanismId::WindDirectionOffset;
    Hypothesis {
        part: Part {
            id,
            platform: None,
            values: neutral(id),
        },
        start: line(id, turn_deg, scale),
    }
}

/// Whether the data could say anything about it.
fn is_known(setup: &Setup, model: &PlumeModel<'_>, id: MechanismId) -> bool {
    use MechanismId as M;
    let air = model.air();
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
        // Without an emission rate the speed does not enter.
        M::WindSpeedScale => matches!(setup.base.sources[0].strength, Strength::EmissionKgS(_)),
        _ => true,
    }
}

/// Whether the scenario says that it knows nothing of what a mechanism moves.
fn is_flat(setup: &Setup, id: MechanismId) -> bool {
    let stated = setup.priors.iter().find(|p| p.id == id);
    stated.is_some_and(|p| p.unknown().prior.sd > FLAT * id.spec().parameters[0].prior_sd)
}

/// Whether it is fitted, not named: it moves the levels of sensors whose zeros are unknown, or is unknown itself.
fn is_own(setup: &Setup, id: MechanismId) -> bool {
    let of_all = |u: &Unknown| u.id == id && u.platform.is_none();
    setup.is_held(id) || setup.own.iter().any(of_all)
}

/// Settings and starts of a mechanism.
fn starts(
    setup: &Setup,
    model: &PlumeModel<'_>,
    base: &Prediction,
    world: &DispersionModel,
    id: MechanismId,
) -> Vec<(Vec<f64>, Start)> {
    let alone = |settings: &[f64], value: f64| (settings.to_vec(), line(id, value, model.scale()));
    let plain = neutral(id);
    let scale = model.scale().on(&id.spec().parameters[0]);
    match id.spec().steps {
        Steps::Line(values) => values.iter().map(|v| alone(&plain, scale * v)).collect(),
        Steps::Plane(step) => vec![(plain, plane(id, scale * step, model.scale()))],
        Steps::HeightsAboveAxis => lids(model, world)
            .iter()
            .map(|h| alone(&plain, *h))
            .collect(),
        Steps::PlacesAroundSource => second_sources(model, world, id),
        Steps::PartsOfRange => limits(base).iter().map(|l| alone(&plain, *l)).collect(),
        Steps::AboutBackground(value) => about(model, id, value, &[0.0, setup.base.background_ppm]),
        Steps::AboutPressureMet(value) => about(model, id, scale * value, &pressures(model)),
    }
}

/// A step of the first parameter alone.
fn line(id: MechanismId, value: f64, scale: Scale) -> Start {
    let spec = &id.spec().parameters[0];
    let end = spec.to_coordinate(value);
    let nothing = spec.to_coordinate(spec.neutral);
    let step = if nothing.is_finite() {
        end - nothing
    } else {
        1.0
    };
    Start {
        nothing: vec![nothing],
        ends: vec![vec![end]],
        amplitude_sd: vec![spec.prior_sd * scale.on(spec) / step.abs()],
        one_sided: spec.low == spec.neutral || spec.high == spec.neutral,
        ln_share: 0.0,
        ln_prior: 0.0,
    }
}

/// Steps of two parameters, each a direction.
fn plane(id: MechanismId, step: f64, scale: Scale) -> Start {
    let spec = &id.spec().parameters[0];
    let sd = spec.prior_sd * scale.on(spec) / step;
    Start {
        nothing: vec![0.0, 0.0],
        ends: vec![vec![step, 0.0], vec![0.0, step]],
        amplitude_sd: vec![sd, sd],
        one_sided: false,
        ln_share: 0.0,
        ln_prior: 0.0,
    }
}

/// A step of the first parameter about each of a few values of the second, which is a setting.
fn about(
    model: &PlumeModel<'_>,
    id: MechanismId,
    value: f64,
    pivots: &[f64],
) -> Vec<(Vec<f64>, Start)> {
    let start = |pivot: &f64| {
        let mut settings = neutral(id);
        settings[1] = *pivot;
        (settings, line(id, value, model.scale()))
    };
    pivots.iter().map(start).collect()
}

/// The standard pressure and the mean of that met, hPa, as far as they are pressures of the air.
fn pressures(model: &PlumeModel<'_>) -> Vec<f64> {
    let air = model.air().iter();
    let known: Vec<f64> = air
        .map(|a| a.pressure_hpa)
        .filter(|p| p.is_finite())
        .collect();
    let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
    let mut out = vec![1013.25, mean];
    out.retain(|p| (100.0..=1100.0).contains(p));
    out
}

/// Limits below the highest reading that is expected.
fn limits(base: &Prediction) -> Vec<f64> {
    let high = base
        .reading
        .iter()
        .copied()
        .fold(f64::NEG_INFINITY, f64::max);
    let rest = base.reading.iter().zip(&base.plume).map(|(r, p)| r - p);
    let low = rest.fold(f64::INFINITY, f64::min);
    let limit = |part: &f64| low + part * (high - low);
    LIMITS.iter().map(limit).collect()
}

/// Heights of lids above the axis.
fn lids(model: &PlumeModel<'_>, world: &DispersionModel) -> Vec<f64> {
    let axis_m = world.spec().sources[0].effective_height_agl_m;
    let sigma_z_m = world.sigmas_m(0.5 * farthest_m(model, world)).1;
    LIDS.iter().map(|l| axis_m + l * sigma_z_m).collect()
}

/// Distance of the farthest row from the first source, m.
fn farthest_m(model: &PlumeModel<'_>, world: &DispersionModel) -> f64 {
    let source = world.spec().sources[0].place;
    let track = model.track();
    let distance = |i: usize| {
        let p = track.place(i);
        (p.east_m - source.east_m).hypot(p.north_m - source.north_m)
    };
    (0..track.len()).map(distance).fold(1.0, f64::max)
}

/// Second sources on a grid around the first, finer across the wind than along it.
fn second_sources(
    model: &PlumeModel<'_>,
    world: &DispersionModel,
    id: MechanismId,
) -> Vec<(Vec<f64>, Start)> {
    let track = model.track();
    let sum = track
        .transport()
        .iter()
        .fold([0.0; 2], |s, t| [s[0] + t.east, s[1] + t.north]);
    let length = sum[0].hypot(sum[1]).max(1e-9);
    let (east, north) = (sum[0] / length, sum[1] / length);
    let reach_m = farthest_m(model, world);
    let spacing_m = 1.2 * world.sigmas_m(0.5 * reach_m).0;
    let share = -((ALONG.len() * (2 * ACROSS as usize + 1)) as f64).ln();
    let mut out = Vec::new();
    for along in ALONG {
        for k in -ACROSS..=ACROSS {
            let (x, y) = (along * reach_m, f64::from(k) * spacing_m);
            let place = [x * east + y * north, x * north - y * east];
            let start = Start {
                nothing: vec![place[0], place[1], 0.0],
                ends: vec![vec![place[0], place[1], SECOND]],
                amplitude_sd: vec![id.spec().parameters[2].prior_sd / SECOND],
                one_sided: true,
                ln_share: share,
                ln_prior: 0.0,
            };
            if k != 0 || along != 0.0 {
                out.push((neutral(id), start));
            }
        }
    }
    out
}
