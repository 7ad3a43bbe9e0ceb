//! The plume model of a track with its unknowns: what the scenario is unsure of, and the parameters of
//! the mechanisms that are tried, all of them mechanisms of the catalogue. The correction of the world by
//! readings has the same model.

use ::plume::effects::SensorAir;
use ::plume::field::{DispersionModel, DispersionSpec, InPlume, Place, Strength};
use ::plume::mechanism::{Mechanism, MechanismId, ParameterSpec};
use ::plume::track::Track;
use std::borrow::Cow;

use infer::{AxisTurn, ForwardModel, InferError, PlumePlace, Prediction};

use super::data::Setup;

/// A mechanism of the model with values of all its parameters, and the platforms it applies to.
#[derive(Debug, Clone)]
pub struct Part {
    pub id: MechanismId,
    /// Index of the one platform it applies to; none for all.
    pub platform: Option<usize>,
    /// Values of its parameters, of which some are unknown.
    pub values: Vec<f64>,
}

/// What of a base is unknown: the first parameter of a mechanism, in the coordinate of the catalogue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unknown {
    /// The mechanism that moves it.
    pub id: MechanismId,
    /// Index of the one platform it applies to; none for all.
    pub platform: Option<usize>,
    /// Value of its second parameter, which is a setting; none for the catalogue's.
    pub setting: Option<f64>,
    /// What is known of it beforehand.
    pub prior: infer::Prior,
}

/// A parameter of a part that is fitted.
#[derive(Debug, Clone, Copy)]
struct Fitted {
    part: usize,
    parameter: usize,
}

/// The model of a track. Unknowns stand in the coordinates of the catalogue: themselves or natural
/// logarithms.
#[derive(Debug, Clone)]
pub struct PlumeModel<'a> {
    base: &'a DispersionSpec,
    track: &'a Track,
    parts: Vec<Part>,
    unknowns: Vec<Fitted>,
    priors: Vec<infer::Prior>,
    /// An unknown and the value about which a search for it begins.
    aim: Option<(usize, f64)>,
    /// What the catalogue's concentrations are multiplied by.
    scale: Scale,
    /// How the plume follows an axis drift.
    axis_drift: DriftResponse,
    /// What the sensor of each platform has read, where that is known.
    has_read: &'a [f64],
}

/// How the plume follows an axis drift of the wind that no log shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DriftResponse {
    /// All of it turns at once, as in a steady wind that is known badly.
    AtOnce,
    /// Each part of it lies where the wind has carried it since it left the source.
    Carried,
}

/// The catalogue's priors and steps of concentrations are those of a CO2 sensor; of another gas, or in
/// another unit, they follow the sensor's noise and the highest reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Factor on priors and steps.
    pub factor: f64,
    /// The highest reading.
    pub highest: f64,
}

/// What moves the level of all of a sensor's readings.
pub const LEVELS: [MechanismId; 2] = [MechanismId::BackgroundOffset, MechanismId::SensorOffset];

/// The noise for which the catalogue's concentrations are meant, ppm.
const CATALOGUE_NOISE_PPM: f64 = 2.0;

impl Scale {
    /// That of the catalogue itself.
    const CATALOGUE: Self = Self {
        factor: 1.0,
        highest: 1.0,
    };

    /// The scale of a sensor of this noise, whose highest reading is given.
    pub fn of(sensor_sd: f64, highest: f64) -> Self {
        Self {
            factor: sensor_sd / CATALOGUE_NOISE_PPM,
            highest,
        }
    }

    /// Standard deviation of what a sensor's readings may be off all along, where this much is known of
    /// background and zeros: of a sensor of this scale.
    pub(crate) fn level_sd(&self, stated: impl Iterator<Item = f64>) -> f64 {
        let spec = &MechanismId::SensorOffset.spec().parameters[0];
        stated.fold(spec.prior_sd * self.on(spec), f64::hypot)
    }

    /// Factor on a parameter: of what has concentrations in its unit.
    pub(crate) fn on(&self, spec: &ParameterSpec) -> f64 {
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
            mean: spec.to_coordinate(centre),
            sd: spec.prior_sd * self.on(spec),
        }
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

/// Priors of a mechanism's fitted parameters about its own values, as wide as the catalogue's.
pub fn priors_about(mechanism: &Mechanism) -> Vec<infer::Prior> {
    let spec = mechanism.id().spec();
    let of = |k: usize| infer::Prior {
        mean: spec.parameters[k].to_coordinate(mechanism.values()[k]),
        sd: spec.parameters[k].prior_sd,
    };
    fitted(mechanism.id()).map(of).collect()
}

/// The same mechanism with other coordinates of its fitted parameters.
pub fn at_coordinates(mechanism: &Mechanism, coordinates: &[f64]) -> Mechanism {
    let parameters = mechanism.id().spec().parameters;
    let mut values = mechanism.values().to_vec();
    for (k, x) in fitted(mechanism.id()).zip(coordinates) {
        values[k] = parameters[k]
            .from_coordinate(*x)
            .clamp(parameters[k].low, parameters[k].high);
    }
    Mechanism::from_values(mechanism.id(), &values)
}

impl<'a> PlumeModel<'a> {
    /// The model of `base` on a track with its unknowns.
    pub fn new(base: &'a DispersionSpec, unknowns: &[Unknown], track: &'a Track) -> Self {
        let mut model = Self {
            base,
            track,
            parts: Vec::new(),
            unknowns: Vec::new(),
            priors: Vec::new(),
            aim: None,
            scale: Scale::CATALOGUE,
            axis_drift: DriftResponse::AtOnce,
            has_read: &[],
        };
        for unknown in unknowns {
            let mut values = neutral(unknown.id);
            if let (Some(setting), Some(value)) = (unknown.setting, values.get_mut(1)) {
                *value = setting;
            }
            let part = Part {
                id: unknown.id,
                platform: unknown.platform,
                values,
            };
            model.add(part, &[unknown.prior]);
        }
        model
    }

    /// The model of `setup` on a track, with what the scenario is unsure of as unknowns.
    pub(crate) fn of(setup: &'a Setup, track: &'a Track, scale: Scale) -> Self {
        Self {
            scale,
            has_read: &setup.has_read,
            ..Self::new(&setup.base, &setup.unknowns(), track)
        }
    }

    /// The model with mechanisms whose parameters are unknown about their values.
    #[must_use]
    pub fn with_unknown(mut self, mechanisms: &[Mechanism]) -> Self {
        for mechanism in mechanisms {
            let part = Part {
                id: mechanism.id(),
                platform: None,
                values: mechanism.values().to_vec(),
            };
            self.add(part, &priors_about(mechanism));
        }
        self
    }

    /// Adds a part, of whose fitted parameters the first few have these priors.
    fn add(&mut self, part: Part, priors: &[infer::Prior]) {
        for (parameter, prior) in fitted(part.id).zip(priors) {
            self.unknowns.push(Fitted {
                part: self.parts.len(),
                parameter,
            });
            self.priors.push(*prior);
        }
        self.parts.push(part);
    }

    /// The model with a further part, all of whose fitted parameters are unknown.
    pub(crate) fn with(&self, part: &Part) -> Self {
        let mut out = self.clone();
        let prior = |k: usize| self.scale.prior(&part.id.spec().parameters[k]);
        let priors: Vec<_> = fitted(part.id).map(prior).collect();
        out.add(part.clone(), &priors);
        out
    }

    /// The model with a turn of the wind of which nothing is known but that the readings lie at about
    /// `turn_deg`.
    pub(crate) fn aimed(&self, part: &Part, turn_deg: f64) -> Self {
        let mut out = self.with(part);
        if let Some(last) = out.priors.last_mut() {
            last.sd = ANY_TURN_DEG;
        }
        out.aim = Some((out.priors.len() - 1, turn_deg));
        out
    }

    /// The same model whose plume follows an axis drift in this way.
    pub(crate) fn following(self, axis_drift: DriftResponse) -> Self {
        Self { axis_drift, ..self }
    }

    /// How its plume follows an axis drift.
    pub(crate) fn axis_drift(&self) -> DriftResponse {
        self.axis_drift
    }

    /// The same model of another track.
    pub(crate) fn on<'t>(&self, track: &'t Track) -> PlumeModel<'t>
    where
        'a: 't,
    {
        PlumeModel {
            track,
            ..self.clone()
        }
    }

    /// Its parts with the values of the unknowns `at`.
    pub(crate) fn parts(&self, at: &[f64]) -> Vec<Part> {
        let mut parts = self.parts.clone();
        for (unknown, x) in self.unknowns.iter().zip(at) {
            let part = &mut parts[unknown.part];
            let spec = &part.id.spec().parameters[unknown.parameter];
            part.values[unknown.parameter] = spec.from_coordinate(*x);
        }
        for part in parts
            .iter_mut()
            .filter(|p| p.id == MechanismId::SensorSaturation)
        {
            part.values[0] = part.values[0].max(self.read_by(part.platform));
        }
        parts
    }

    /// What the sensor of a platform, or any sensor, has read: no range ends below it.
    fn read_by(&self, platform: Option<usize>) -> f64 {
        let of = match platform {
            Some(p) => self.has_read.get(p..=p).unwrap_or_default(),
            None => self.has_read,
        };
        of.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// The unknowns of a part: indices among all.
    pub(crate) fn unknowns_of(&self, part: usize) -> impl Iterator<Item = usize> + '_ {
        let all = self.unknowns.iter().enumerate();
        all.filter(move |(_, u)| u.part == part).map(|(k, _)| k)
    }

    /// The mechanisms of some parts.
    pub(crate) fn mechanisms(&self, parts: &[Part]) -> Vec<Mechanism> {
        let platforms = self.track.platforms();
        let of = |part: &Part| {
            let own = part.platform.map_or(&[][..], |p| &platforms[p..=p]);
            Mechanism::from_values(part.id, &part.values).for_platforms(own)
        };
        parts.iter().map(of).collect()
    }

    /// The dispersion model of the unknowns `at`.
    pub(crate) fn world(&self, at: &[f64]) -> Result<DispersionModel, InferError> {
        let mut spec = self.base.clone();
        spec.mechanisms.extend(self.mechanisms(&self.parts(at)));
        DispersionModel::new(spec).map_err(|error| InferError::Model(error.to_string()))
    }

    /// How the scenario states the strength of its source.
    pub(crate) fn strength(&self) -> Strength {
        self.base.sources[0].strength
    }

    /// The unknown that belongs to a mechanism which the scenario is unsure of.
    pub(crate) fn unknown(&self, id: MechanismId) -> Option<usize> {
        let of = |u: &Fitted| self.parts[u.part].id == id && self.parts[u.part].platform.is_none();
        self.unknowns.iter().position(of)
    }

    /// By how much the unknowns `at` turn the direction from which the wind blows, degrees clockwise: what the
    /// scenario is unsure of and what is named together.
    pub(crate) fn turned_deg(&self, at: &[f64]) -> f64 {
        let turns = |u: &Fitted| {
            let part = &self.parts[u.part];
            part.id == MechanismId::WindDirectionOffset && part.platform.is_none()
        };
        let turned = self.unknowns.iter().zip(at).filter(|(u, _)| turns(u));
        turned.map(|(_, deg)| deg).sum()
    }

    /// When the plume of the unknowns `at` was last met, s: what it did afterwards nobody has read. The last
    /// row's time where no row met it.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn last_met_s(&self, at: &[f64]) -> Result<f64, InferError> {
        Ok(self.last_met_of(&self.still_plume(at)?))
    }

    /// The readings with the axis at rest.
    fn at_rest(&self, at: &[f64]) -> Result<Prediction, InferError> {
        self.predict(at, &vec![AxisTurn::NONE; self.track.len()])
    }

    /// The plume's part of each reading, with the axis at rest.
    pub(super) fn still_plume(&self, at: &[f64]) -> Result<Vec<f64>, InferError> {
        Ok(self.at_rest(at)?.plume)
    }

    fn last_met_of(&self, plume: &[f64]) -> f64 {
        let most = plume.iter().copied().fold(0.0, f64::max);
        let times = self.track.time_s();
        let met = plume.iter().zip(times).filter(|(p, _)| **p > MET * most);
        let last = |times: &mut dyn Iterator<Item = f64>| times.fold(f64::NEG_INFINITY, f64::max);
        let met_s = last(&mut met.map(|(_, t)| *t));
        if met_s.is_finite() {
            met_s
        } else {
            last(&mut times.iter().copied()).max(0.0)
        }
    }

    /// Distance from the source at which readings were in the plume, m: the geometric mean, weighted by the plume's
    /// concentrations `met`. None where none was in the plume.
    pub(crate) fn met_distance_m(
        &self,
        at: &[f64],
        met: &[f64],
    ) -> Result<Option<f64>, InferError> {
        let (mut all, mut ln_distance) = (0.0, 0.0);
        for (place, plume) in self.places(at)?.iter().zip(met) {
            if *plume > 0.0 {
                all += plume;
                ln_distance += plume * place.ln_distance;
            }
        }
        let distance_m = (ln_distance / all).exp();
        Ok(distance_m.is_finite().then_some(distance_m))
    }

    /// The reported unknowns of the `nearest` plume. The variance of the strength includes the discrepancy on the axis, at the
    /// distance of a stated c_MAX or, of a stated emission, where readings were in the plume; at the last such time, or in the
    /// mean over time.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn stated(
        &self,
        mut nearest: infer::ClosestModel,
        believed: &infer::Posterior,
        in_the_mean: bool,
    ) -> Result<infer::ClosestModel, InferError> {
        let Some(k) = self.ln_strength() else {
            return Ok(nearest);
        };
        let at = nearest.mean.as_slice();
        let met = self.still_plume(at)?;
        let met_s = self.last_met_of(&met);
        let stated_m = self.strength().c_max_distance_m();
        let distance_m = match self.strength() {
            Strength::CMax { .. } => stated_m,
            Strength::EmissionKgS(_) => self.met_distance_m(at, &met)?.unwrap_or(stated_m),
        };
        let under_way_s = distance_m / self.track.transport()[0].speed_m_s.max(1.0);
        let here = PlumePlace {
            ln_distance: distance_m.ln(),
            time_s: met_s,
            emitted_s: if in_the_mean {
                f64::NAN
            } else {
                met_s - under_way_s
            },
            ..PlumePlace::default()
        };
        let on_axis = |at: &[f64]| self.axis_excess(at, distance_m).unwrap_or(f64::NAN);
        let with_discrepancy = believed.at_place(met_s, |at, _| (0.0, on_axis(at), here));
        let value = on_axis(at);
        let slopes = (0..at.len()).map(|i| {
            let step = 0.01 * nearest.covariance[(i, i)].sqrt();
            let mut aside = at.to_vec();
            aside[i] += step;
            if step > 0.0 {
                (on_axis(&aside) - value) / step
            } else {
                0.0
            }
        });
        let slope = nalgebra::DVector::from_iterator(at.len(), slopes);
        let plain = (&nearest.covariance * &slope).dot(&slope).sqrt();
        let grown = with_discrepancy.sd.hypot(with_discrepancy.value - value) / plain;
        if grown > 1.0 && grown.is_finite() {
            // What the discrepancy adds there has nothing to do with the other unknowns.
            nearest.covariance[(k, k)] *= grown.powi(2);
            nearest.prior[k] *= grown.powi(2);
        }
        Ok(nearest)
    }

    /// Concentration above background on the axis in the scenario's wind.
    fn axis_excess(&self, at: &[f64], distance_m: f64) -> Result<f64, InferError> {
        let world = self.world(at)?;
        let of = |id| self.unknown(id).map_or(0.0, |k| at[k]);
        let source = &self.base.sources[0];
        let towards_deg = air::wind::towards_deg(self.base.wind.from_deg());
        let turned_deg = towards_deg + of(MechanismId::WindDirectionOffset);
        let there = source.place.displaced(turned_deg, distance_m);
        let place = Place {
            east_m: there.east_m,
            north_m: there.north_m,
            height_agl_m: source.effective_height_agl_m + of(MechanismId::EffectiveHeightOffset),
        };
        Ok(world.mean_ppm(&place, 0.0) - world.background_ppm(&place, 0.0))
    }

    /// What each row reads without the plume, ppm.
    fn clean(&self, at: &[f64]) -> Result<Vec<f64>, InferError> {
        let there = self.at_rest(at)?;
        let clean = there.reading.iter().zip(&there.plume).map(|(r, p)| r - p);
        Ok(clean.collect())
    }

    /// The same where all unknowns are as most probable before any reading.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn clean_beforehand(&self) -> Result<Vec<f64>, InferError> {
        let mean: Vec<f64> = self.priors.iter().map(|p| p.mean).collect();
        self.clean(&mean)
    }

    /// What each platform's sensor reads without the plume, in the mean over its rows, ppm; not a number of one
    /// without rows.
    pub(crate) fn levels(&self, at: &[f64]) -> Result<Vec<f64>, InferError> {
        let clean = self.clean(at)?;
        let of = |range: &std::ops::Range<usize>| {
            clean[range.clone()].iter().sum::<f64>() / range.len() as f64
        };
        Ok(self.track.ranges().iter().map(of).collect())
    }

    /// What concentrations of the catalogue are multiplied by.
    pub(crate) fn scale(&self) -> Scale {
        self.scale
    }

    /// The track.
    pub(crate) fn track(&self) -> &'a Track {
        self.track
    }

    /// What the logged air makes known besides: whether a mechanism needs what nobody logged.
    pub(crate) fn air(&self) -> &[SensorAir] {
        self.track.air()
    }
}

/// A row meets the plume where the plume's part of it is above this share of the strongest.
const MET: f64 = 0.02;
/// Standard deviation of a direction of which nothing is known, degrees: that of 360 alike.
const ANY_TURN_DEG: f64 = 104.0;
/// A search from a turn that passes show on the average looks so far to both sides, degrees.
const AIM_REACH_DEG: f64 = 30.0;

/// Reach in prior standard deviations, and points on each side, of the search for direction and
/// height: in direction the points must lie closer than the plume is wide, and need reach no farther than all round.
const SEARCH_REACH_SD: f64 = 3.0;
const SEARCH_DIRECTIONS: i32 = 18;
const SEARCH_STEP_DEG: f64 = 3.0;
const SEARCH_HEIGHTS: i32 = 2;

impl ForwardModel for PlumeModel<'_> {
    fn priors(&self) -> &[infer::Prior] {
        &self.priors
    }

    fn ln_strength(&self) -> Option<usize> {
        self.unknown(MechanismId::EmissionScale)
    }

    fn rows_of(&self, unknown: usize) -> Option<std::ops::Range<usize>> {
        let platform = self.parts[self.unknowns[unknown].part].platform?;
        Some(self.track.ranges()[platform].clone())
    }

    fn starts(&self) -> Vec<Vec<f64>> {
        let mean: Vec<f64> = self.priors.iter().map(|p| p.mean).collect();
        let along = |unknown: Option<usize>, reach: f64, steps: i32| -> Vec<Option<(usize, f64)>> {
            let Some(k) = unknown else { return vec![None] };
            let step = |n: i32| reach * f64::from(n) / f64::from(steps);
            (-steps..=steps).map(|n| Some((k, step(n)))).collect()
        };
        let reach = |k: Option<usize>| k.map_or(0.0, |k| SEARCH_REACH_SD * self.priors[k].sd);
        let direction = self.unknown(MechanismId::WindDirectionOffset);
        let reach_deg = reach(direction).min(180.0);
        let least = (reach_deg / SEARCH_STEP_DEG).ceil() as i32;
        let mut directions = along(direction, reach_deg, SEARCH_DIRECTIONS.max(least));
        if let Some((k, turn_deg)) = self.aim {
            let part = |n: i32| f64::from(n) / f64::from(SEARCH_DIRECTIONS);
            let steps = -SEARCH_DIRECTIONS..=SEARCH_DIRECTIONS;
            directions = steps
                .map(|n| Some((k, turn_deg + AIM_REACH_DEG * part(n))))
                .collect();
        }
        let height = self.unknown(MechanismId::EffectiveHeightOffset);
        let heights = along(height, reach(height), SEARCH_HEIGHTS);
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

    fn predict(&self, at: &[f64], turns: &[AxisTurn]) -> Result<Prediction, InferError> {
        let world = self.world(at)?;
        let n = self.track.len();
        let mut out = Prediction {
            reading: vec![0.0; n],
            plume: vec![0.0; n],
        };
        let mut track = Cow::Borrowed(self.track);
        if turns.iter().any(|t| t.clockwise_deg != 0.0) {
            let clockwise_deg: Vec<f64> = turns.iter().map(|t| t.clockwise_deg).collect();
            track = Cow::Owned(track.turned(&clockwise_deg));
        }
        if turns.iter().any(|t| t.upward_deg != 0.0) {
            let upward_deg: Vec<f64> = turns.iter().map(|t| t.upward_deg).collect();
            track = Cow::Owned(track.inclined(&upward_deg, self.base.sources[0].place));
        }
        track.predict_parts(&world, &mut out.reading, Some(&mut out.plume));
        Ok(out)
    }

    fn response_s(&self, at: &[f64]) -> Result<Vec<f64>, InferError> {
        let world = self.world(at)?;
        let spec = world.spec();
        let mut out = vec![0.0; self.track.len()];
        for (range, platform) in self.track.ranges().iter().zip(self.track.platforms()) {
            out[range.clone()].fill(spec.sensor.response_s(&spec.mechanisms, platform));
        }
        Ok(out)
    }

    fn height_agl_m(&self, row: usize) -> f64 {
        self.track.place(row).height_agl_m
    }

    fn under_way_s(&self, row: usize) -> f64 {
        match self.axis_drift {
            DriftResponse::AtOnce => 0.0,
            DriftResponse::Carried => self.track.under_way_s(row, self.base.sources[0].place),
        }
    }

    fn level_sd(&self) -> f64 {
        let stated = LEVELS.map(|id| self.unknown(id)).into_iter().flatten();
        self.scale.level_sd(stated.map(|k| self.priors[k].sd))
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
pub fn plume_place(place: Option<InPlume>, time_s: f64, under_way_s: f64) -> PlumePlace {
    let none = PlumePlace {
        ln_distance: f64::NAN,
        above_sigmas: f64::NAN,
        sigma_z_m: f64::NAN,
        across_sigmas: f64::NAN,
        time_s,
        emitted_s: time_s - under_way_s,
    };
    place.map_or(none, |p| PlumePlace {
        ln_distance: p.distance_m.ln(),
        above_sigmas: p.above_sigmas,
        sigma_z_m: p.sigma_z_m,
        across_sigmas: p.across_sigmas,
        time_s,
        emitted_s: time_s - under_way_s,
    })
}
