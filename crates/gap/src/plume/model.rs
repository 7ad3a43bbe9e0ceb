//! A model as a vector of parameters: the base and its extensions, all as mechanisms.

use ::plume::field::{DispersionModel, DispersionSpec};
use ::plume::mechanism::{Coordinate, Mechanism, MechanismId, ParameterSpec};
use ::plume::track::Track;
use nalgebra::DVector;

use super::data::Setup;

/// A parameter that is fitted, in the coordinate of its prior.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Free {
    /// Which part it belongs to.
    pub part: usize,
    /// Which parameter of that part.
    pub parameter: usize,
    /// Centre of its prior.
    pub centre: f64,
    /// One standard deviation of its prior.
    pub sd: f64,
    /// The prior is cut in half at the centre: twice the density on the side allowed.
    pub one_sided: bool,
    /// Its prior is the scenario's own word.
    pub stated: bool,
    /// One standard deviation by which it may differ from what these data tell, since what it is
    /// counted from, the log, is off by chance.
    pub chance_sd: f64,
}

/// A mechanism in the model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Part {
    pub id: MechanismId,
    /// Platform it acts on; none for all.
    pub platform: Option<usize>,
    pub values: Vec<f64>,
}

impl Part {
    /// The wind turned by so much for all platforms, degrees clockwise.
    pub fn turn(turned_deg: f64) -> Self {
        Self {
            id: MechanismId::WindDirectionOffset,
            platform: None,
            values: vec![turned_deg],
        }
    }
}

/// The tolerances that are far from linear and so parameters of the base, where a wind is logged
/// and where none is: no vane is set better than this, degrees, and no wind keeps its direction
/// to better, degrees an hour.
const TOLERATED: [(MechanismId, [f64; 2]); 2] = [
    (MechanismId::WindDirectionOffset, [0.15, 0.15]),
    (MechanismId::WindDirectionDrift, [2.0, 8.0]),
];

/// Part of the physical prior's standard deviation below which a prior is narrow, and how many times
/// that above which it is flat.
const NARROW: f64 = 0.7;
const FLAT: f64 = 3.0;
/// What a prior about as wide as the physical one is held against, in its own standard deviations.
const BEYOND_STATED: f64 = 3.0;

/// Parts and which of their parameters are free.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Model {
    pub parts: Vec<Part>,
    pub free: Vec<Free>,
}

impl Model {
    /// The base: one part for each parameter that the scenario marks uncertain, and the
    /// tolerances of a wind that is `logged` or not.
    pub fn base(setup: &Setup, logged: bool) -> Self {
        let mut model = Self::default();
        for prior in &setup.priors {
            let spec = &prior.id.spec().parameters[0];
            let whole = prior.id == MechanismId::SensorLag;
            let start = if whole { prior.value } else { spec.neutral };
            let sd = match spec.coordinate {
                Coordinate::Log => prior.sd / prior.value.abs().max(1e-12),
                Coordinate::Linear => prior.sd,
            };
            model.parts.push(Part {
                id: prior.id,
                platform: None,
                values: defaults(prior.id),
            });
            let part = model.parts.len() - 1;
            model.parts[part].values[0] = start;
            let centre = to_coordinate(spec, start);
            model.free.push(Free {
                part,
                parameter: 0,
                centre,
                sd,
                one_sided: false,
                stated: true,
                chance_sd: 0.0,
            });
        }
        for (id, sd) in TOLERATED {
            let sd = if logged { sd[0] } else { sd[1] };
            if setup.priors.iter().any(|p| p.id == id) {
                continue;
            }
            model.parts.push(Part {
                id,
                platform: None,
                values: defaults(id),
            });
            model.free.push(Free {
                part: model.parts.len() - 1,
                parameter: 0,
                centre: 0.0,
                sd,
                one_sided: false,
                stated: false,
                chance_sd: 0.0,
            });
        }
        model
    }

    /// The same beside a wind whose trend in direction may be off by so much more by chance,
    /// degrees an hour.
    pub fn beside_chance(&self, deg_per_h: f64) -> Self {
        let mut model = self.clone();
        if let Some(k) = model.free_of(MechanismId::WindDirectionDrift) {
            let free = &mut model.free[k];
            (free.sd, free.chance_sd) = (free.sd.hypot(deg_per_h), deg_per_h);
        }
        model
    }

    /// The same with one more part whose parameters that have no default are free.
    pub fn extended(&self, part: Part) -> Self {
        let mut model = self.clone();
        let index = model.parts.len();
        for (k, spec) in part.id.spec().parameters.iter().enumerate() {
            if spec.default.is_none() {
                model.free.push(Free {
                    part: index,
                    parameter: k,
                    centre: to_coordinate(spec, spec.prior_centre),
                    sd: spec.prior_sd,
                    one_sided: spec.low == spec.neutral || spec.high == spec.neutral,
                    stated: false,
                    chance_sd: 0.0,
                });
            }
        }
        model.parts.push(part);
        model
    }

    /// Free parameters whose prior the data may contradict.
    pub fn held(&self) -> impl Iterator<Item = usize> {
        (0..self.dimension()).filter(|k| self.wider_sd(*k).is_some())
    }

    /// Standard deviation of the prior that the one of the free parameter `k` is held against: the
    /// physical one, or, where it is about as wide as that itself, a wider one; none of a flat one.
    pub fn wider_sd(&self, k: usize) -> Option<f64> {
        let (own, physical) = (self.free[k].sd, self.spec_of(k).prior_sd);
        if own < NARROW * physical {
            Some(physical)
        } else {
            let held = self.free[k].stated && own < FLAT * physical;
            held.then_some(BEYOND_STATED * own)
        }
    }

    /// The same with the wider prior for the free parameter `k`.
    pub fn widened(&self, k: usize) -> Self {
        let mut model = self.clone();
        if let Some(sd) = self.wider_sd(k) {
            model.free[k].sd = sd;
            model.free[k].stated = false;
        }
        model
    }

    /// The same with its parameters where a larger model, whose first they are, has them.
    pub fn placed_as(mut self, larger: &Self) -> Self {
        for k in 0..self.dimension() {
            self.set_coordinate(k, larger.coordinate(k));
        }
        self
    }

    /// The coordinates of all free parameters.
    pub fn coordinates(&self) -> DVector<f64> {
        DVector::from_fn(self.dimension(), |k, _| self.coordinate(k))
    }

    /// The mechanism that the free parameter `k` is one of.
    pub fn id_of(&self, k: usize) -> MechanismId {
        self.parts[self.free[k].part].id
    }

    /// The first free parameter of the mechanism `id`, on whatever platforms.
    pub fn free_of(&self, id: MechanismId) -> Option<usize> {
        (0..self.dimension()).find(|k| self.id_of(*k) == id)
    }

    pub fn dimension(&self) -> usize {
        self.free.len()
    }

    pub fn spec_of(&self, k: usize) -> &'static ParameterSpec {
        let free = &self.free[k];
        &self.parts[free.part].id.spec().parameters[free.parameter]
    }

    /// Value of the free parameter `k` in its coordinate.
    pub fn coordinate(&self, k: usize) -> f64 {
        let free = &self.free[k];
        to_coordinate(
            self.spec_of(k),
            self.parts[free.part].values[free.parameter],
        )
    }

    /// Sets it, brought into its bounds.
    pub fn set_coordinate(&mut self, k: usize, coordinate: f64) {
        let spec = self.spec_of(k);
        let value = match spec.coordinate {
            Coordinate::Log => coordinate.exp(),
            Coordinate::Linear => coordinate,
        };
        let free = self.free[k].clone();
        self.parts[free.part].values[free.parameter] = value.clamp(spec.low, spec.high);
    }

    /// Step for a difference of the free parameter `k`, away from a bound it stands on.
    pub fn difference_step(&self, k: usize) -> f64 {
        let spec = self.spec_of(k);
        let free = &self.free[k];
        let step = 2e-3 * free.sd.min(spec.prior_sd);
        let value = self.parts[free.part].values[free.parameter];
        let up = match spec.coordinate {
            Coordinate::Log => value * step.exp(),
            Coordinate::Linear => value + step,
        };
        if up > spec.high { -step } else { step }
    }

    /// Log prior density of all free parameters, nats.
    pub fn ln_prior(&self) -> f64 {
        (0..self.dimension()).map(|k| self.ln_prior_of(k)).sum()
    }

    /// Log prior density of those parameters that `counts`, relative to that at their centres,
    /// nats.
    pub fn ln_departure(&self, counts: impl Fn(usize) -> bool) -> f64 {
        (0..self.dimension())
            .filter(|k| counts(*k))
            .map(|k| -0.5 * self.departure_sd(k).powi(2))
            .sum()
    }

    /// How far the free parameter `k` stands from its prior's centre, in its coordinate.
    pub fn departure(&self, k: usize) -> f64 {
        self.coordinate(k) - self.free[k].centre
    }

    /// The same in standard deviations of its prior.
    pub fn departure_sd(&self, k: usize) -> f64 {
        self.departure(k) / self.free[k].sd
    }

    fn ln_prior_of(&self, k: usize) -> f64 {
        let free = &self.free[k];
        let half = if free.one_sided {
            std::f64::consts::LN_2
        } else {
            0.0
        };
        half - 0.5 * self.departure_sd(k).powi(2) - free.sd.ln() - 0.5 * std::f64::consts::TAU.ln()
    }

    /// The world of this model.
    pub fn world(&self, base: &DispersionSpec, platforms: &[String]) -> Option<DispersionModel> {
        let mut spec = base.clone();
        spec.mechanisms
            .extend(self.parts.iter().map(|p| mechanism(p, platforms)));
        DispersionModel::new(spec).ok()
    }

    /// Predicted readings on `track`, and the plume's part of them.
    pub fn predict(&self, base: &DispersionSpec, track: &Track) -> Prediction {
        let mut out = Prediction {
            reading: vec![0.0; track.len()],
            plume: vec![0.0; track.len()],
        };
        if let Some(world) = self.world(base, track.platforms()) {
            track.predict_parts(&world, &mut out.reading, Some(&mut out.plume));
        }
        out
    }

    /// Predicted readings alone.
    pub fn readings(&self, base: &DispersionSpec, track: &Track) -> Vec<f64> {
        let mut out = vec![0.0; track.len()];
        if let Some(world) = self.world(base, track.platforms()) {
            track.predict(&world, &mut out);
        }
        out
    }
}

/// Predicted readings and the plume's part of them, ppm.
#[derive(Debug, Clone)]
pub(crate) struct Prediction {
    pub reading: Vec<f64>,
    pub plume: Vec<f64>,
}

/// A part as the mechanism that the world runs.
pub(crate) fn mechanism(part: &Part, platforms: &[String]) -> Mechanism {
    let mechanism = Mechanism::from_values(part.id, &part.values);
    match part.platform.and_then(|p| platforms.get(p)) {
        Some(name) => mechanism.for_platforms(std::slice::from_ref(name)),
        None => mechanism,
    }
}

/// A mechanism as parts of a model: one for each platform that it names, or one for all.
pub(crate) fn parts_of(mechanism: &Mechanism, platforms: &[String]) -> Vec<Part> {
    let id = mechanism.id();
    let values: Vec<f64> = mechanism.values().to_vec();
    let on: Vec<Option<usize>> = if mechanism.platforms().is_empty() {
        vec![None]
    } else {
        let position = |name: &String| platforms.iter().position(|p| p == name);
        mechanism
            .platforms()
            .iter()
            .map(position)
            .filter(Option::is_some)
            .collect()
    };
    on.into_iter()
        .map(|platform| Part {
            id,
            platform,
            values: values.clone(),
        })
        .collect()
}

/// Parameters of `id` that do nothing.
pub(crate) fn defaults(id: MechanismId) -> Vec<f64> {
    id.spec()
        .parameters
        .iter()
        .map(|p| p.default.unwrap_or(p.neutral))
        .collect()
}

/// A value in the coordinate of its prior.
pub(crate) fn to_coordinate(spec: &ParameterSpec, value: f64) -> f64 {
    match spec.coordinate {
        Coordinate::Log => value.max(1e-300).ln(),
        Coordinate::Linear => value,
    }
}
