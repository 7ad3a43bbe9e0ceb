//! The plume model of a track with its unknowns: what the scenario is unsure of, and the parameters of
//! the mechanisms that are tried, all of them mechanisms of the catalogue.

use ::plume::effects::SensorAir;
use ::plume::field::{DispersionModel, DispersionSpec, InPlume};
use ::plume::mechanism::{Coordinate, Mechanism, MechanismId, ParameterSpec};
use ::plume::track::Track;
use infer::{ForwardModel, InferError, PlumePlace, Prediction};

use super::data::Setup;

/// A mechanism of the model with values of all its parameters, and the platforms it applies to.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    pub id: MechanismId,
    /// Index of the one platform it applies to; none for all.
    pub platform: Option<usize>,
    /// Values of its parameters, of which some are unknown.
    pub values: Vec<f64>,
}

/// An unknown: a parameter of a part.
#[derive(Debug, Clone, Copy)]
struct Unknown {
    part: usize,
    parameter: usize,
}

/// The model of a track. Unknowns stand in the coordinates of the catalogue: themselves or natural
/// logarithms.
#[derive(Debug, Clone)]
pub(crate) struct PlumeModel<'a> {
    base: &'a DispersionSpec,
    track: &'a Track,
    parts: Vec<Part>,
    unknowns: Vec<Unknown>,
    priors: Vec<infer::Prior>,
    /// An unknown and the value about which a search for it begins.
    aim: Option<(usize, f64)>,
    /// What the catalogue's concentrations are multiplied by.
    scale: Scale,
    /// How the plume follows a swing.
    swing: Swing,
}

/// How the plume follows a swing of the wind that no log shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Swing {
    /// All of it turns at once, as in a steady wind that is known badly.
    AtOnce,
    /// Each part of it lies where the wind has carried it since it left the source.
    Carried,
}

/// The catalogue's priors and steps of concentrations are those of a CO2 sensor; of another gas, or in
/// another unit, they follow the sensor's noise and the highest reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale {
    /// Factor on priors and steps.
    pub factor: f64,
    /// The highest reading.
    pub highest: f64,
}

/// The noise for which the catalogue's concentrations are meant, ppm.
const CATALOGUE_NOISE_PPM: f64 = 2.0;

impl Scale {
    /// The scale of a sensor of this noise, whose highest reading is given.
    pub fn of(sensor_sd: f64, highest: f64) -> Self {
        Self {
            factor: sensor_sd / CATALOGUE_NOISE_PPM,
            highest,
        }
    }

    /// Factor on a parameter: of what has concentrations in its unit.
    pub fn on(&self, spec: &ParameterSpec) -> f64 {
        if spec.unit.starts_with("ppm") && spec.neutral.is_finite() {
            self.factor
        } else {
            1.0
        }
    }

    /// What is known of a parameter beforehand.
    fn prior(&self, spec: &ParameterSpec) -> infer::Prior {
        let centre = if spec.unit == "ppm" && spec.neutral.is_infinite() {
            self.highest
        } else {
            spec.prior_centre
        };
        infer::Prior {
            mean: to_coordinate(spec, centre),
            sd: spec.prior_sd * self.on(spec),
        }
    }
}

/// A value in the coordinate in which its prior is normal.
pub(crate) fn to_coordinate(spec: &ParameterSpec, value: f64) -> f64 {
    match spec.coordinate {
        Coordinate::Linear => value,
        Coordinate::Log => value.ln(),
    }
}

/// A parameter's value from its coordinate.
pub(crate) fn from_coordinate(spec: &ParameterSpec, at: f64) -> f64 {
    match spec.coordinate {
        Coordinate::Linear => at,
        Coordinate::Log => at.exp(),
    }
}

/// Values of all parameters at which a mechanism does nothing.
pub(crate) fn neutral(id: MechanismId) -> Vec<f64> {
    let of = |p: &ParameterSpec| p.default.unwrap_or(p.neutral);
    id.spec().parameters.iter().map(of).collect()
}

/// Parameters of a mechanism that are fitted: all but settings.
pub(crate) fn fitted(id: MechanismId) -> impl Iterator<Item = usize> {
    let parameters = id.spec().parameters.iter().enumerate();
    parameters
        .filter(|(_, p)| p.default.is_none())
        .map(|(k, _)| k)
}

impl<'a> PlumeModel<'a> {
    /// The model of `setup` on a track, with what the scenario is unsure of as unknowns.
    pub fn new(setup: &'a Setup, track: &'a Track, scale: Scale) -> Self {
        let mut model = Self {
            base: &setup.base,
            track,
            parts: Vec::new(),
            unknowns: Vec::new(),
            priors: Vec::new(),
            aim: None,
            scale,
            swing: Swing::AtOnce,
        };
        for prior in &setup.priors {
            let spec = &prior.id.spec().parameters[0];
            let (mean, sd) = match (spec.coordinate, prior.id) {
                (Coordinate::Log, _) => (0.0, prior.sd / prior.value.abs().max(f64::MIN_POSITIVE)),
                (Coordinate::Linear, MechanismId::SensorLag) => (prior.value, prior.sd),
                (Coordinate::Linear, _) => (0.0, prior.sd),
            };
            model.add(
                Part {
                    id: prior.id,
                    platform: None,
                    values: neutral(prior.id),
                },
                &[infer::Prior { mean, sd }],
            );
        }
        model
    }

    /// Adds a part, of whose fitted parameters the first few have these priors.
    fn add(&mut self, part: Part, priors: &[infer::Prior]) {
        for (parameter, prior) in fitted(part.id).zip(priors) {
            self.unknowns.push(Unknown {
                part: self.parts.len(),
                parameter,
            });
            self.priors.push(*prior);
        }
        self.parts.push(part);
    }

    /// The model with a further part, all of whose fitted parameters are unknown.
    pub fn with(&self, part: &Part) -> Self {
        let mut out = self.clone();
        let prior = |k: usize| self.scale.prior(&part.id.spec().parameters[k]);
        let priors: Vec<_> = fitted(part.id).map(prior).collect();
        out.add(part.clone(), &priors);
        out
    }

    /// The model with a turn of the wind of which nothing is known but that the readings lie at about
    /// `turn_deg`.
    pub fn aimed(&self, part: &Part, turn_deg: f64) -> Self {
        let mut out = self.with(part);
        if let Some(last) = out.priors.last_mut() {
            last.sd = ANY_TURN_DEG;
        }
        out.aim = Some((out.priors.len() - 1, turn_deg));
        out
    }

    /// The same model whose plume follows a swing in this way.
    pub fn following(self, swing: Swing) -> Self {
        Self { swing, ..self }
    }

    /// The same model of another track.
    pub fn on<'t>(&self, track: &'t Track) -> PlumeModel<'t>
    where
        'a: 't,
    {
        PlumeModel {
            track,
            ..self.clone()
        }
    }

    /// Its parts with the values of the unknowns `at`.
    pub fn parts(&self, at: &[f64]) -> Vec<Part> {
        let mut parts = self.parts.clone();
        for (unknown, x) in self.unknowns.iter().zip(at) {
            let part = &mut parts[unknown.part];
            let spec = &part.id.spec().parameters[unknown.parameter];
            part.values[unknown.parameter] = from_coordinate(spec, *x);
        }
        parts
    }

    /// The unknowns of a part: indices among all.
    pub fn unknowns_of(&self, part: usize) -> impl Iterator<Item = usize> + '_ {
        let all = self.unknowns.iter().enumerate();
        all.filter(move |(_, u)| u.part == part).map(|(k, _)| k)
    }

    /// The mechanisms of some parts.
    pub fn mechanisms(&self, parts: &[Part]) -> Vec<Mechanism> {
        let platforms = self.track.platforms();
        let of = |part: &Part| {
            let own = part.platform.map_or(&[][..], |p| &platforms[p..=p]);
            Mechanism::from_values(part.id, &part.values).for_platforms(own)
        };
        parts.iter().map(of).collect()
    }

    /// The dispersion model of the unknowns `at`.
    pub fn world(&self, at: &[f64]) -> Result<DispersionModel, InferError> {
        let mut spec = self.base.clone();
        spec.mechanisms.extend(self.mechanisms(&self.parts(at)));
        DispersionModel::new(spec).map_err(|error| InferError::Model(error.to_string()))
    }

    /// The unknown that belongs to a mechanism which the scenario is unsure of.
    pub fn unknown(&self, id: MechanismId) -> Option<usize> {
        let of = |u: &Unknown| self.parts[u.part].id == id && self.parts[u.part].platform.is_none();
        self.unknowns.iter().position(of)
    }

    /// What concentrations of the catalogue are multiplied by.
    pub fn scale(&self) -> Scale {
        self.scale
    }

    /// The track.
    pub fn track(&self) -> &'a Track {
        self.track
    }

    /// What the logged air makes known besides: whether a mechanism needs what nobody logged.
    pub fn air(&self) -> &[SensorAir] {
        self.track.air()
    }
}

/// Standard deviation of a direction of which nothing is known, degrees: that of 360 alike.
const ANY_TURN_DEG: f64 = 104.0;
/// A search from a turn that passes show on the average looks so far to both sides, degrees.
const AIM_REACH_DEG: f64 = 30.0;

/// Reach in prior standard deviations, and points on each side, of the search for direction and
/// height: in direction the points must lie closer than the plume is wide.
const SEARCH_REACH_SD: f64 = 3.0;
const SEARCH_DIRECTIONS: i32 = 18;
const SEARCH_HEIGHTS: i32 = 2;

impl ForwardModel for PlumeModel<'_> {
    fn priors(&self) -> &[infer::Prior] {
        &self.priors
    }

    fn ln_strength(&self) -> Option<usize> {
        self.unknown(MechanismId::EmissionScale)
    }

    fn starts(&self) -> Vec<Vec<f64>> {
        let mean: Vec<f64> = self.priors.iter().map(|p| p.mean).collect();
        let along = |unknown: Option<usize>, steps: i32| -> Vec<Option<(usize, f64)>> {
            let Some(k) = unknown else { return vec![None] };
            let step =
                |n: i32| SEARCH_REACH_SD * self.priors[k].sd * f64::from(n) / f64::from(steps);
            (-steps..=steps).map(|n| Some((k, step(n)))).collect()
        };
        let mut directions = along(
            self.unknown(MechanismId::WindDirectionOffset),
            SEARCH_DIRECTIONS,
        );
        if let Some((k, turn_deg)) = self.aim {
            let part = |n: i32| f64::from(n) / f64::from(SEARCH_DIRECTIONS);
            let steps = -SEARCH_DIRECTIONS..=SEARCH_DIRECTIONS;
            directions = steps
                .map(|n| Some((k, turn_deg + AIM_REACH_DEG * part(n))))
                .collect();
        }
        let heights = along(
            self.unknown(MechanismId::EffectiveHeightOffset),
            SEARCH_HEIGHTS,
        );
        let mut out = Vec::new();
        for direction in &directions {
            for height in &heights {
                let mut at = mean.clone();
                for (k, step) in [direction, height].into_iter().flatten() {
                    at[*k] += step;
                }
                out.push(at);
            }
        }
        out
    }

    fn predict(&self, at: &[f64], turn_deg: &[f64]) -> Result<Prediction, InferError> {
        let world = self.world(at)?;
        let n = self.track.len();
        let mut out = Prediction {
            reading: vec![0.0; n],
            plume: vec![0.0; n],
        };
        let mut fill = |track: &Track| {
            track.predict_parts(&world, &mut out.reading, Some(&mut out.plume));
        };
        if turn_deg.iter().all(|t| *t == 0.0) {
            fill(self.track);
        } else {
            fill(&self.track.turned(turn_deg));
        }
        Ok(out)
    }

    fn under_way_s(&self, row: usize) -> f64 {
        match self.swing {
            Swing::AtOnce => 0.0,
            Swing::Carried => self.track.under_way_s(row, self.base.sources[0].place),
        }
    }

    fn level_sd(&self) -> f64 {
        let zero = MechanismId::SensorOffset;
        let spec = &zero.spec().parameters[0];
        let own = spec.prior_sd * self.scale.on(spec);
        let stated = [MechanismId::BackgroundOffset, zero].map(|id| self.unknown(id));
        let stated = stated.into_iter().flatten().map(|k| self.priors[k].sd);
        stated.fold(own, f64::hypot)
    }

    fn places(&self, at: &[f64]) -> Result<Vec<PlumePlace>, InferError> {
        let world = self.world(at)?;
        let places = self.track.in_first_plume(&world).into_iter().enumerate();
        let source = self.base.sources[0].place;
        let of = |(i, place): (usize, Option<InPlume>)| {
            let under_way_s = self.track.under_way_s(i, source);
            plume_place(place, self.track.time_s()[i], under_way_s)
        };
        Ok(places.map(of).collect())
    }
}

/// A place in the plume as the inference has it; not a number upwind of the source.
pub(crate) fn plume_place(place: Option<InPlume>, time_s: f64, under_way_s: f64) -> PlumePlace {
    let none = PlumePlace {
        ln_distance: f64::NAN,
        above_sigmas: f64::NAN,
        across_sigmas: f64::NAN,
        time_s,
        emitted_s: time_s - under_way_s,
    };
    place.map_or(none, |p| PlumePlace {
        ln_distance: p.distance_m.ln(),
        above_sigmas: p.above_sigmas,
        across_sigmas: p.across_sigmas,
        time_s,
        emitted_s: time_s - under_way_s,
    })
}
