//! Readings prepared for a fit: rows, unknowns, rules and the wind that carries the plume. Calibrating a scenario and
//! searching for causes begin with the same.

use std::borrow::Cow;

use ::plume::DispersionSpec;
use ::plume::track::Track;
use infer::{Fit, FittedSet, InferError, PlumePlace, Policy, Problem, Question, Rows};
use scenario::observations::Observations;

use super::data::{Data, Setup, mean_transport};
use super::gate;
use super::model::{DriftResponse, PlumeModel, Scale};
use super::wind::{self, Carried};
use crate::GapError;

/// The sensor's noise where the scenario states none, in parts of the smallest difference between
/// readings: rounding.
const ROUNDING: f64 = 0.3;

/// All readings, and as many of them as a search needs.
#[derive(Debug)]
pub struct Records<'d> {
    setup: Setup,
    pub(crate) all: Cow<'d, Data>,
    part: Option<Data>,
    rows: Rows,
    part_rows: Rows,
    policy: Policy,
    sensor_sd: f64,
    scale: Scale,
    in_flight: bool,
}

impl Records<'_> {
    /// Readings of `observations` that have passed the checks, for a fit of `setup`; none where none is left.
    /// `rows_of_a_search` are enough to find the plume. `in_flight` vehicles that wait on the ground are no network,
    /// and few winds are tried.
    ///
    /// # Errors
    /// A base that the plume model refuses.
    pub fn of_checked(
        setup: &Setup,
        observations: &Observations,
        rows_of_a_search: usize,
        in_flight: bool,
    ) -> Result<Option<Self>, GapError> {
        if observations.readings() == 0 {
            return Ok(None);
        }
        let data = gate::rows_of(setup, observations)?;
        if data.used_count() == 0 {
            return Ok(None);
        }
        let thinned = data.thinned(setup, super::MOST_ROWS)?;
        let data = Cow::Owned(thinned.unwrap_or(data));
        let policy = Policy::default();
        Records::new(setup, data, rows_of_a_search, &policy, in_flight).map(Some)
    }
}

impl<'d> Records<'d> {
    /// The readings of `all`, for a fit of `setup` by the rules of `policy`.
    pub(crate) fn new(
        setup: &Setup,
        all: Cow<'d, Data>,
        rows_of_a_search: usize,
        policy: &Policy,
        in_flight: bool,
    ) -> Result<Self, GapError> {
        let part = all.thinned(setup, rows_of_a_search)?;
        let sensor_sd = sensor_sd(&setup.base, used_readings(&all));
        let scale = Scale::of(sensor_sd, highest(&all));
        Ok(Self {
            setup: all.told_of(setup, sensor_sd, scale, in_flight)?,
            rows: rows(&all)?,
            part_rows: rows(part.as_ref().unwrap_or(&all))?,
            policy: policy_of(setup, &all, sensor_sd, policy, in_flight),
            scale,
            all,
            part,
            sensor_sd,
            in_flight,
        })
    }

    /// The setup with what the readings say before any fit.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The rows of all readings.
    pub fn rows(&self) -> &Rows {
        &self.rows
    }

    /// The rows of a search.
    pub fn first_rows(&self) -> &Rows {
        &self.part_rows
    }

    /// Whether a wind is logged, often enough to follow it.
    pub fn has_logged_wind(&self) -> bool {
        self.all.on_board_wind
    }

    pub(crate) fn scale(&self) -> Scale {
        self.scale
    }

    pub(crate) fn first(&self) -> &Data {
        self.part.as_ref().unwrap_or(&self.all)
    }

    pub(crate) fn question(&self) -> Question<'_> {
        Question {
            rows: &self.rows,
            policy: &self.policy,
            sensor_sd: self.sensor_sd,
            asked: &[],
        }
    }

    pub(crate) fn first_question(&self) -> Question<'_> {
        Question {
            rows: &self.part_rows,
            ..self.question()
        }
    }

    /// What of the wind's log carries the plume where `setup` fits the readings best; none without a log.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn carried(&self, setup: &Setup) -> Result<Option<Carried>, InferError> {
        let question = self.first_question();
        wind::chosen(setup, self.first(), &question, self.scale, self.in_flight)
    }

    /// The tracks of a search and of all readings in that wind.
    pub fn tracks(&self, setup: &Setup, carried: Option<Carried>) -> [Track; 2] {
        [self.first(), &self.all].map(|data| wind::carrying(setup, data, carried))
    }

    /// The model of `setup` on a track.
    pub fn model<'t>(&self, setup: &'t Setup, track: &'t Track) -> PlumeModel<'t> {
        PlumeModel::of(setup, track, self.scale)
    }

    /// The problem of explaining `rows`, with `asked` places of which something is to be told.
    pub fn problem<'p>(
        &'p self,
        model: &'p PlumeModel<'p>,
        rows: &'p Rows,
        asked: &'p [PlumePlace],
    ) -> Problem<'p, PlumeModel<'p>> {
        Problem::new(model, rows, &self.policy, self.sensor_sd, asked)
    }

    /// The base as a search finds it, and how its plume follows an axis drift.
    pub(crate) fn searched(
        &self,
        model: &PlumeModel<'_>,
        carried: Option<Carried>,
    ) -> Result<(Fit, DriftResponse), InferError> {
        let question = self.first_question();
        let (found, axis_drift) = wind::swinging(&question, model, carried, self.in_flight)?;
        Ok((found.fit().clone(), axis_drift))
    }

    /// The model of a setup without names, fitted.
    pub(crate) fn fitted<'t>(
        &self,
        setup: &'t Setup,
        tracks: &'t [Track; 2],
        carried: Option<Carried>,
    ) -> Result<FittedSet<PlumeModel<'t>>, InferError> {
        let (first, axis_drift) = self.searched(&self.model(setup, &tracks[0]), carried)?;
        let model = self.model(setup, &tracks[1]).following(axis_drift);
        self.question().set_from(&model, Vec::new(), &first)
    }

    /// The wind that carried the plume, each row by its `weight`: direction from, in degrees.
    pub fn met_from_deg(&self, track: &Track, weight: &[f64]) -> f64 {
        let wind = mean_transport(track.transport(), weight);
        air::wind::from_deg(wind.east, wind.north)
    }
}

/// The rules for these data: a wind that nobody logs may turn the axis as far as its stability class lets it, and one that is logged
/// at sensors at rest turns no further.
fn policy_of(
    setup: &Setup,
    data: &Data,
    sensor_sd: f64,
    policy: &Policy,
    in_flight: bool,
) -> Policy {
    let mut policy = policy.clone();
    setup.noise.tell(sensor_sd, &mut policy);
    // A turn that grows has a name, where causes are named.
    if !setup.corrects {
        policy.axis_drift_slope_deg = policy.axis_drift_slope_deg.min(policy.axis_drift_mean_deg);
    }
    if !data.on_board_wind {
        let axis_drift_deg = setup.base.stability.sigma_theta_deg();
        let tolerated = &mut policy.noise_tolerated;
        tolerated.wander_deg = tolerated.wander_deg.max(axis_drift_deg);
    }
    if let Some(rest) = data.rest.filter(|_| !in_flight) {
        rest.bind(&mut policy);
    }
    policy
}

/// The readings as the inference wants them.
fn rows(data: &Data) -> Result<Rows, InferError> {
    let known = |c: &f64| if c.is_finite() { *c } else { 0.0 };
    Rows::new(
        data.ranges().to_vec(),
        data.track.time_s().to_vec(),
        data.reading_ppm.iter().map(known).collect(),
        data.sd_ppm.clone(),
        data.used.clone(),
    )?
    .averaged_over(data.averaging_s())
}

/// The highest reading, ppm.
fn highest(data: &Data) -> f64 {
    used_readings(data).fold(f64::MIN_POSITIVE, f64::max)
}

/// Readings that count, ppm.
fn used_readings(data: &Data) -> impl Iterator<Item = f64> {
    let used = data.reading_ppm.iter().zip(&data.used).filter(|(_, u)| **u);
    used.map(|(c, _)| *c)
}

/// Standard deviation of the noise of the sensor that made these readings, ppm: the scenario's, or what
/// rounding alone makes.
pub fn sensor_sd(base: &DispersionSpec, readings: impl Iterator<Item = f64>) -> f64 {
    let stated = base.sensor.noise_sd_ppm;
    if stated > 0.0 {
        return stated;
    }
    let mut read: Vec<f64> = readings.collect();
    read.sort_by(f64::total_cmp);
    let steps = read.windows(2).map(|w| w[1] - w[0]).filter(|s| *s > 0.0);
    let least = steps.fold(f64::INFINITY, f64::min);
    if least.is_finite() {
        ROUNDING * least
    } else {
        1.0
    }
}
