//! Correction of the plume model by readings.
//!
//! Unknowns are the background, the effective height, the plume's axis (as a turn of the wind),
//! the strength (c_MAX or emission), the scales of σy and σz, the sensor's time constant, and,
//! where several platforms are compared with a reference, each other sensor's offset and gain.
//! Each has a normal prior from the scenario's `[uncertain]` table, or its usual one. Rows, wind, zeros of sensors and
//! priors are those with which `gap plume` begins ([`Records`]): calibrating is the same study without mechanisms.
//! Noise and discrepancy have the sizes that the readings show. The stated unknowns are those of the plume without a
//! discrepancy that is closest to the posterior.
//!
//! All readings are fitted anew rather than filtered one by one: while the axis is off by several
//! plume widths the posterior has several maxima, and an extended Kalman filter that linearises
//! about the wrong one cannot look back. Until the axis is located, every correction in flight
//! searches; from then on it goes on from the last one.

mod axis_line;
mod flux;
pub mod offline;
mod parameters;
mod peak;

pub use parameters::Calibrated;
pub use peak::READ_SD;

use crate::WsError;
use air::geo::Enu;
use axis_line::Line;
use gap::plume::{
    Averaging, Carried, Meander, PlumeModel, ROWS_OF_A_SEARCH, Records, Setup, plume_place,
};
use infer::{ClosestModel, InferError, LearnedNoise, PlumePlace, Posterior, Problem};
use nalgebra::{DMatrix, DVector};
use parameters::{Corrected, Unknowns};
use peak::AtCrossing;
use plume::stability::Stability;
use plume::{DispersionModel, DispersionSpec, MechanismId, Place};
use protocol::message::Estimate;
use scenario::Scenario;
use scenario::observations::{ObservationRow, Observations};
use study::pass_rate::PassRate;

/// A correction is worth its time when there are more rows by this factor: fewer change standard
/// deviations by about a tenth.
const GROWN: f64 = 1.25;

/// A plume is stated as it is in the mean over this time, s, for which the spread of the stability classes
/// holds: ten minutes. What turns over longer is a wind that turns, and is followed.
pub const AVERAGED_S: f64 = 600.0;
/// Where the plume's width is taken as an angle, m: near a source it grows in proportion to distance.
const WIDTH_AT_M: f64 = 1000.0;

/// A moment of a mean.
#[derive(Debug, Clone, Copy)]
struct Moment {
    time_s: f64,
    /// How far the slow wind has turned from the middle of the mean until then, degrees.
    slow_deg: f64,
}

/// Mean time of the moments, s.
fn middle_s(moments: &[Moment]) -> f64 {
    moments.iter().map(|m| m.time_s).sum::<f64>() / moments.len() as f64
}

/// Takes in readings and corrects the model.
#[derive(Debug, Clone)]
pub struct Calibrator {
    /// The scenario's world.
    base: DispersionSpec,
    /// How many of its mechanisms, the first, are the scenario's own.
    own_mechanisms: usize,
    /// The same as it is fitted.
    setup: Setup,
    unknowns: Unknowns,
    averaging: Averaging,
    /// Averaged readings.
    observations: Observations,
    taken: u64,
    estimate: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Variances of the estimate before any reading.
    beforehand: DVector<f64>,
    /// How far the axis lay from that of the estimate in the mean of `moments`, and how far both
    /// together may be off; none before a fit, and without an axis drift.
    turn: Option<infer::Estimate>,
    /// The estimate and its covariance in the mean over meanders, by the fit alone.
    by_fit: (DVector<f64>, DMatrix<f64>),
    /// Rate and vertical spread by the passes; none where too few cross the plume.
    passes: Option<PassRate>,
    /// The estimate and its covariance that include the passes; none where they do not.
    with_passes: Option<(DVector<f64>, DMatrix<f64>)>,
    /// Rows that there were at the last fit.
    fitted_rows: usize,
    posterior: Option<Posterior>,
    /// What of a logged wind carries the plume; none without a log.
    carried: Option<Carried>,
    /// Direction from which the logged wind blew where the plume was met, degrees; none without a log.
    logged_from_deg: Option<f64>,
    /// When the plume was last met, s.
    met_s: f64,
    predicted: peak::Predicted,
    /// The motion of the axis; none where the plume may be steady.
    meander: Option<Meander>,
    /// Half width of the peak's 95 % interval over its excess at which it is as well known as is asked.
    peak_within: f64,
}

impl Calibrator {
    /// A calibrator that starts from `scenario` for readings of `platforms`. With a `reference`
    /// among them, offset and gain of the others' sensors are unknowns too.
    ///
    /// # Errors
    /// A scenario that describes no world.
    pub fn new(
        scenario: &Scenario,
        platforms: &[String],
        reference: Option<&str>,
    ) -> Result<Self, WsError> {
        let base = scenario.dispersion_spec()?;
        let setup = Setup::to_correct(scenario, reference)?;
        let unknowns = Unknowns::new(&setup, platforms);
        let estimate = unknowns.prior_mean();
        let covariance = DMatrix::from_diagonal(&unknowns.prior_sd().map(|sd| sd * sd));
        Ok(Self {
            by_fit: (estimate.clone(), covariance.clone()),
            passes: None,
            with_passes: None,
            beforehand: covariance.diagonal(),
            estimate,
            covariance,
            turn: None,
            own_mechanisms: base.mechanisms.len(),
            base,
            setup,
            unknowns,
            averaging: Averaging::default(),
            observations: Observations {
                gas: scenario.gas(),
                platforms: platforms.to_vec(),
                ..Observations::default()
            },
            taken: 0,
            fitted_rows: 0,
            posterior: None,
            carried: None,
            logged_from_deg: None,
            met_s: 0.0,
            predicted: peak::Predicted::default(),
            meander: None,
            peak_within: scenario.mission.peak_within.unwrap_or(peak::WITHIN),
        })
    }

    /// Lets the air have these stability classes, each from its time on, s.
    fn set_classes(&mut self, classes: Vec<(f64, Stability)>) {
        self.setup.classes = classes;
    }

    /// One more platform, whose sensor is as all others; its index.
    pub fn add_platform(&mut self, name: &str) -> usize {
        self.observations.platforms.push(name.to_owned());
        self.unknowns.add_platform(name);
        self.observations.platforms.len() - 1
    }

    /// Takes in one reading of the platform at index `platform`; `wind` is speed and
    /// from-direction at the place, where it is known better than by the scenario.
    pub fn observe(
        &mut self,
        platform: usize,
        time_s: f64,
        place: Place,
        wind: Option<(f64, f64)>,
        ppm: f64,
    ) {
        let at = self.setup.frame.to_geodetic(Enu {
            east_m: place.east_m,
            north_m: place.north_m,
        });
        self.observe_row(&ObservationRow {
            time_s,
            platform,
            lat_deg: at.lat_deg,
            lon_deg: at.lon_deg,
            alt_amsl_m: place.height_agl_m + self.setup.base.ground_amsl_m,
            co2_ppm: Some(ppm),
            wind_speed_m_s: wind.map(|w| w.0),
            wind_from_deg: wind.map(|w| w.1),
            ..ObservationRow::default()
        });
    }

    /// Takes in one row of observations; one that is not finite is ignored.
    pub fn observe_row(&mut self, row: &ObservationRow) {
        let place = [row.time_s, row.lat_deg, row.lon_deg, row.alt_amsl_m];
        let is_finite = place.iter().chain(&row.co2_ppm).all(|v| v.is_finite());
        if row.platform >= self.observations.platforms.len() || !is_finite {
            return;
        }
        self.taken += u64::from(row.co2_ppm.is_some());
        self.averaging.take(row, &mut self.observations.rows);
    }

    /// Takes the readings being averaged as they are: no more will come.
    pub fn finish(&mut self) {
        self.averaging.finish(&mut self.observations.rows);
    }

    /// The corrected unknowns that no key of a scenario holds, as mechanisms in the order in which they act.
    pub fn beside_keys(&self) -> Vec<plume::Mechanism> {
        self.unknowns.beside_keys(&self.in_the_mean().0)
    }

    /// What the sensor of a platform reads in clean air, ppm, where it has a zero of its own.
    pub fn zero_ppm(&self, platform: usize) -> Option<Estimate> {
        let (at, covariance) = self.in_the_mean();
        let zero = self
            .unknowns
            .index(MechanismId::SensorOffset, Some(platform))?;
        let background = self.unknowns.index(MechanismId::BackgroundOffset, None)?;
        let both = [zero, background];
        let variance: f64 = both
            .iter()
            .flat_map(|i| both.iter().map(|j| covariance[(*i, *j)]))
            .sum();
        let name = &self.observations.platforms[platform];
        let is_its = |m: &&plume::Mechanism| {
            m.id() == MechanismId::SensorOffset
                && (m.platforms().is_empty() || m.platforms().contains(name))
        };
        let stated = self.base.mechanisms.iter().filter(is_its);
        let stated: f64 = stated.map(|m| m.values()[0]).sum();
        let clean = self.base.background_ppm + self.base.sensor.offset_ppm + stated;
        Some(Estimate {
            value: clean + at[zero] + at[background],
            sd: variance.max(0.0).sqrt(),
        })
    }

    /// Readings taken in so far.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// Replaces the extensions of the base model, beside the scenario's own mechanisms. Of a further source
    /// place and strength are unknown about those that it comes with; other mechanisms stay as they are.
    ///
    /// # Errors
    /// Mechanisms that the plume model refuses.
    pub fn extend(&mut self, mechanisms: Vec<plume::Mechanism>) -> Result<(), WsError> {
        let (sources, mechanisms): (Vec<_>, Vec<_>) = mechanisms
            .into_iter()
            .partition(|m| m.id() == MechanismId::SecondSource);
        let own = self
            .base
            .mechanisms
            .iter()
            .take(self.own_mechanisms)
            .cloned();
        let extended = DispersionSpec {
            mechanisms: own.chain(mechanisms).collect(),
            ..self.base.clone()
        };
        DispersionModel::new(extended.clone())?;
        self.setup.base.mechanisms.clone_from(&extended.mechanisms);
        self.base = extended;
        self.fitted_rows = 0;
        if sources != self.unknowns.added_sources() {
            self.add_sources(sources);
        }
        Ok(())
    }

    /// Takes other sources beside the scenario's; what is believed of everything else stays until the next fit,
    /// which searches anew.
    fn add_sources(&mut self, sources: Vec<plume::Mechanism>) {
        self.unknowns.set_added_sources(sources);
        let (mean, sd) = (self.unknowns.prior_mean(), self.unknowns.prior_sd());
        let stated = self.unknowns.stated();
        let with_priors = |at: &DVector<f64>, covariance: &DMatrix<f64>| {
            let mut all = mean.clone();
            all.rows_mut(0, stated).copy_from(&at.rows(0, stated));
            let mut variances = DMatrix::from_diagonal(&sd.map(|sd| sd * sd));
            let shape = (stated, stated);
            let known = covariance.view((0, 0), shape);
            variances.view_mut((0, 0), shape).copy_from(&known);
            (all, variances)
        };
        let with_passes = self.with_passes.as_ref();
        self.with_passes = with_passes.map(|(at, covariance)| with_priors(at, covariance));
        self.by_fit = with_priors(&self.by_fit.0, &self.by_fit.1);
        (self.estimate, self.covariance) = with_priors(&self.estimate, &self.covariance);
        self.posterior = None;
    }

    /// Sources beside the scenario's, as they are believed to be.
    pub fn added_sources(&self) -> Vec<plume::Mechanism> {
        self.unknowns.added_sources_at(&self.in_the_mean().0)
    }

    /// Whether there is so much more to fit than at the last fit that a correction is worth its time.
    pub fn is_due(&self) -> bool {
        self.row_count() as f64 > GROWN * self.fitted_rows as f64
    }

    fn row_count(&self) -> usize {
        self.observations.rows.len()
    }

    /// Corrects the model in flight, by all readings so far.
    ///
    /// # Errors
    /// The plume model refuses the corrected values.
    pub fn update(&mut self) -> Result<(), WsError> {
        let Some(records) = self.records(true)? else {
            return Ok(());
        };
        let before = self.posterior.as_ref().map(|p| p.fit().clone());
        if let Some(before) = before.filter(|_| self.axis_is_located()) {
            return self.fit(&records, &[], &Depth::Refine(&before));
        }
        self.carried = records.carried(records.setup())?;
        self.fit(&records, &[], &Depth::Glance)?;
        if self.axis_is_located() {
            self.searched(&records, &[])?;
        }
        Ok(())
    }

    /// Takes over what a copy of this has found since it was made; readings and platforms that came meanwhile stay.
    pub fn adopt(&mut self, mut fitted: Self) {
        let known = fitted.observations.platforms.len();
        for name in self.observations.platforms.iter().skip(known) {
            fitted.add_platform(name);
        }
        std::mem::swap(&mut fitted.averaging, &mut self.averaging);
        std::mem::swap(&mut fitted.observations, &mut self.observations);
        fitted.taken = self.taken;
        *self = fitted;
    }

    /// Corrects the model by all readings as a whole. `nearest_m` is the distance from the source at
    /// which something will be asked of the plume.
    ///
    /// # Errors
    /// The plume model refuses the corrected values.
    pub fn conclude(&mut self, nearest_m: f64) -> Result<(), WsError> {
        let asked = PlumePlace {
            ln_distance: nearest_m.max(1.0).ln(),
            // What is asked is asked of the time when the plume was met.
            time_s: f64::NAN,
            emitted_s: f64::NAN,
            ..PlumePlace::default()
        };
        let Some(records) = self.records(false)? else {
            return Ok(());
        };
        self.carried = records.carried(records.setup())?;
        self.searched(&records, &[asked])
    }

    /// The readings so far, prepared for a fit; none where there are none.
    fn records(&mut self, in_flight: bool) -> Result<Option<Records<'static>>, WsError> {
        let of = Records::of_checked(&self.setup, &self.observations, ROWS_OF_A_SEARCH, in_flight)?;
        if let Some(records) = &of {
            self.unknowns.set(records.setup());
        }
        Ok(of)
    }

    /// Searches on a part of the readings, and goes on from there on all of them.
    fn searched(&mut self, records: &Records<'_>, asked: &[PlumePlace]) -> Result<(), WsError> {
        self.fit(records, asked, &Depth::Search)?;
        match self.posterior.as_ref().map(|p| p.fit().clone()) {
            Some(found) => self.fit(records, asked, &Depth::Refine(&found)),
            None => Ok(()),
        }
    }

    /// Fits readings.
    fn fit(
        &mut self,
        records: &Records<'_>,
        asked: &[PlumePlace],
        depth: &Depth<'_>,
    ) -> Result<(), WsError> {
        let setup = records.setup();
        let [first, all] = records.tracks(setup, self.carried);
        let (track, rows) = match depth {
            Depth::Glance | Depth::Search => (first, records.first_rows()),
            Depth::Refine(_) => (all, records.rows()),
        };
        let model = records
            .model(setup, &track)
            .with_unknown(self.unknowns.added_sources());
        let problem = records.problem(&model, rows, asked);
        let posterior = depth.posterior(&problem)?;
        let nearest = problem.nearest(&posterior)?;
        self.estimate.clone_from(&nearest.mean);
        self.met_s = model.last_met_s(self.estimate.as_slice())?;
        self.predicted = peak::Predicted::of(&model, &track, rows, &self.estimate, &posterior)?;
        self.logged_from_deg = records
            .has_logged_wind()
            .then(|| records.met_from_deg(&track, self.predicted.plume()));
        self.fitted_rows = self.row_count();
        self.meander = Meander::of(&model, self.estimate.as_slice(), &posterior)?;
        let stated = model.stated(nearest, &posterior, self.meander.is_some())?;
        (self.covariance, self.beforehand) = (stated.covariance, stated.prior);
        self.posterior = Some(posterior);
        self.turn = self.mean_turn();
        self.by_fit = self.averaged();
        // Passes are read above the background of the fit.
        self.with_passes = None;
        self.passes = self.pass_rate();
        self.with_passes = self.including_passes();
        Ok(())
    }

    /// What all readings tell of the noise, once they are concluded; none without a fit.
    ///
    /// # Errors
    /// A base that the plume model refuses.
    pub fn learned_noise(&mut self) -> Result<Option<LearnedNoise>, WsError> {
        let Some(records) = self.records(false)? else {
            return Ok(None);
        };
        let setup = records.setup();
        let [_, track] = records.tracks(setup, self.carried);
        let model = records.model(setup, &track);
        let problem = records.problem(&model, records.rows(), &[]);
        let fit = self.posterior.as_ref().map(Posterior::fit);
        Ok(fit.map(|fit| problem.learned_noise(fit)))
    }

    /// Direction from which the logged wind blew where the plume was met, degrees: what a turn that was found against
    /// the log turns. None where no wind is logged, and before a fit.
    pub fn logged_from_deg(&self) -> Option<f64> {
        self.logged_from_deg
    }

    /// Lets the wind that the turn is found against blow as the readings' own, where these carried one.
    pub(crate) fn blow_as_logged(&mut self) {
        if let Some(from_deg) = self.logged_from_deg {
            self.base.wind = self.base.wind.turned(from_deg - self.base.wind.from_deg());
        }
    }

    /// The mean mole fraction at a place over `Calibrator::moments`, ppm, with the discrepancy that the readings
    /// showed, in the slow wind of their middle; none before a fit.
    pub fn mean_ppm(&self, place: &Place) -> Option<Estimate> {
        let posterior = self.posterior.as_ref()?;
        let moments = self.moments();
        let n = moments.len() as f64;
        let stated_s = middle_s(&moments);
        let (mut value, mut sd) = (0.0, 0.0);
        for moment in &moments {
            let there = posterior.at_place(moment.time_s, |at, turn_deg| {
                let at = DVector::from_column_slice(at);
                self.there(place, stated_s, moment, (at, turn_deg))
            });
            // What is not known is the same at all moments, for the most part.
            (value, sd) = (value + there.value / n, sd + there.sd / n);
        }
        Some(Estimate { value, sd })
    }

    /// The same over `moments` without what is not known of it; nothing before a fit.
    fn most_probable_ppm(&self, place: &Place, moments: &[Moment]) -> f64 {
        let Some(posterior) = self.posterior.as_ref() else {
            return 0.0;
        };
        let stated_s = middle_s(moments);
        let at_moment = |moment: &Moment| {
            posterior.value_at(moment.time_s, |at, turn_deg| {
                let at = DVector::from_column_slice(at);
                self.there(place, stated_s, moment, (at, turn_deg))
            })
        };
        moments.iter().map(at_moment).sum::<f64>() / moments.len() as f64
    }

    /// Background and plume at a place, ppm, and the place's position in the plume. Background and emission are those of
    /// `stated_s`, axis and discrepancy those of the moment: the mean over moments of an emission that grows exponentially
    /// exceeds its value at their mean time.
    fn there(
        &self,
        place: &Place,
        stated_s: f64,
        moment: &Moment,
        (at, turn_deg): (DVector<f64>, f64),
    ) -> (f64, f64, PlumePlace) {
        let Ok(model) = DispersionModel::new(self.swung_spec(at, turn_deg - moment.slow_deg))
        else {
            return (f64::NAN, f64::NAN, PlumePlace::default());
        };
        let rest = model.background_ppm(place, stated_s);
        let wind = model.transport();
        let there = model.in_first_plume(place, stated_s, wind);
        let under_way_s = there.map_or(0.0, |p| wind.under_way_s(p.distance_m));
        let plume = model.mean_ppm(place, stated_s) - rest;
        (rest, plume, plume_place(there, moment.time_s, under_way_s))
    }

    /// Moments over which the plume is averaged: its crossings, or those of the last ten minutes where the axis
    /// turned for good, with the straight line through the turns as the slow wind; the last moment alone where
    /// the axis leaves that line by more than the plume is wide, as no meander within the class's spread does.
    fn moments(&self) -> Vec<Moment> {
        let crossings = self.predicted.axis();
        let last = crossings.partition_point(|c| c.time_s < self.met_s - AVERAGED_S);
        let width_deg = self.width_deg();
        let moments = |over: &[AtCrossing], slow_deg: &dyn Fn(f64) -> f64| -> Vec<Moment> {
            let moment = |c: &AtCrossing| Moment {
                time_s: c.time_s,
                slow_deg: slow_deg(c.time_s),
            };
            over.iter().map(moment).collect()
        };
        // Of no crossings nothing is a number, and no comparison holds.
        let line = Line::through(crossings);
        if !line.is_a_turn() && line.rms_off_deg() <= width_deg {
            return moments(crossings, &|_| 0.0);
        }
        let line = Line::through(&crossings[last..]);
        if line.rms_off_deg() <= width_deg {
            return moments(&crossings[last..], &|time_s| line.turned_deg(time_s));
        }
        vec![Moment {
            time_s: self.met_s,
            slow_deg: 0.0,
        }]
    }

    /// How wide the corrected plume is as seen from its source, one standard deviation, degrees.
    fn width_deg(&self) -> f64 {
        let model = DispersionModel::new(self.unknowns.folded(&self.base, &self.estimate));
        let width =
            |m: DispersionModel| (m.sigmas_m(WIDTH_AT_M).0 / WIDTH_AT_M).atan().to_degrees();
        model.map_or(f64::INFINITY, width)
    }

    /// The time for which the plume is stated, s: the middle of those over which it is averaged.
    pub fn stated_s(&self) -> f64 {
        middle_s(&self.moments())
    }

    /// What the readings were found to be like; none before a fit.
    pub fn posterior(&self) -> Option<&Posterior> {
        self.posterior.as_ref()
    }

    /// Whether the plume was read and its axis is known well enough that a local search finds the best fit. A fit to
    /// clean air is sure only of where nobody has been, and one that leads away from the plume that was read is lost.
    fn axis_is_located(&self) -> bool {
        if !self.has_read_a_plume() || !self.predicted.shows_a_plume() {
            return false;
        }
        let (estimate, prior) = (&self.covariance, self.unknowns.prior_sd());
        self.unknowns
            .index(MechanismId::WindDirectionOffset, None)
            .is_none_or(|k| estimate[(k, k)].sqrt() < 0.2 * prior[k])
    }

    /// Whether a reading stands out of the others, whatever the model makes of it.
    pub fn has_read_a_plume(&self) -> bool {
        let rows = self.observations.rows.iter();
        let mut sorted: Vec<f64> = rows.filter_map(|r| r.co2_ppm).collect();
        sorted.sort_by(f64::total_cmp);
        let noise_ppm = gap::plume::sensor_sd(&self.base, sorted.iter().copied());
        let middle = sorted.get(sorted.len() / 2);
        let highest = sorted
            .last()
            .zip(middle)
            .map_or(0.0, |(high, middle)| high - middle);
        highest > peak::READ_SD * noise_ppm
    }

    /// The corrected model in the mean over meanders.
    pub fn corrected_spec(&self) -> DispersionSpec {
        self.unknowns.folded(&self.base, &self.in_the_mean().0)
    }

    /// The estimate and its covariance in the mean over meanders.
    fn in_the_mean(&self) -> &(DVector<f64>, DMatrix<f64>) {
        self.with_passes.as_ref().unwrap_or(&self.by_fit)
    }

    /// The unknowns in the mean over meanders, with what the scenario says of them beforehand.
    fn averaged(&self) -> (DVector<f64>, DMatrix<f64>) {
        let mut stated = ClosestModel {
            mean: self.estimate.clone(),
            covariance: self.covariance.clone(),
            prior: self.beforehand.clone(),
        };
        // Without an axis drift the axis is the unknown alone, as the gap has it.
        if let Some((k, turn)) = self.axis_index().zip(self.turn) {
            stated.mean[k] += turn.value;
            let grown = turn.sd / stated.covariance[(k, k)].sqrt();
            if grown.is_finite() {
                stated.covariance.row_mut(k).scale_mut(grown);
                stated.covariance.column_mut(k).scale_mut(grown);
            }
        }
        if let Some(meander) = self.meander {
            let index = |id| self.unknowns.index(id, None);
            let strength = self.base.sources[0].strength;
            meander.in_the_mean(index, strength, &mut stated);
        }
        let priors: Vec<_> = self.unknowns.priors().collect();
        let stated = stated.known_beforehand(&priors);
        (stated.mean, stated.covariance)
    }

    fn axis_index(&self) -> Option<usize> {
        self.unknowns.index(MechanismId::WindDirectionOffset, None)
    }

    fn mean_turn(&self) -> Option<infer::Estimate> {
        let times_s: Vec<f64> = self.moments().iter().map(|m| m.time_s).collect();
        let posterior = self.posterior.as_ref().filter(|p| p.has_axis_drift())?;
        Some(posterior.mean_turn(&times_s, self.axis_index()))
    }

    /// The corrected model, its axis as it lay in the mean of `Calibrator::moments`.
    pub fn latest_spec(&self) -> DispersionSpec {
        let turn_deg = self.turn.map_or(0.0, |t| t.value);
        self.swung_spec(self.estimate.clone(), turn_deg)
    }

    /// The model at these values of the unknowns, its axis turned by `turn_deg` besides.
    fn swung_spec(&self, mut at: DVector<f64>, turn_deg: f64) -> DispersionSpec {
        if let Some(k) = self.axis_index() {
            at[k] += turn_deg;
        }
        self.unknowns.folded(&self.base, &at)
    }

    /// How far the wind is turned clockwise from the scenario's, degrees.
    pub fn turn_deg(&self) -> f64 {
        self.axis_index().map_or(0.0, |k| self.in_the_mean().0[k])
    }

    /// The corrected parameters with their standard deviations.
    pub fn calibrated(&self) -> Calibrated {
        self.corrected(self.in_the_mean()).calibrated()
    }

    /// Value and standard deviation of a mechanism's parameter that is unknown, of one platform's sensor or
    /// of all.
    pub fn parameter(&self, id: MechanismId, platform: Option<usize>) -> Option<Estimate> {
        self.corrected(self.in_the_mean()).parameter(id, platform)
    }

    /// These values of the unknowns, with their covariance, about the base.
    fn corrected<'a>(
        &'a self,
        (at, covariance): &'a (DVector<f64>, DMatrix<f64>),
    ) -> Corrected<'a> {
        Corrected {
            unknowns: &self.unknowns,
            base: &self.base,
            at,
            covariance,
        }
    }
}

/// How thoroughly readings are fitted.
enum Depth<'f> {
    /// Enough to see whether a part of them locates the plume.
    Glance,
    /// A search on a part of them.
    Search,
    /// All of them, from a fit before, with the noise found as well as can be.
    Refine(&'f infer::Fit),
}

impl Depth<'_> {
    fn posterior(&self, problem: &Problem<'_, PlumeModel<'_>>) -> Result<Posterior, InferError> {
        match self {
            Self::Glance => problem.quick_posterior(),
            Self::Search => problem.posterior(),
            Self::Refine(before) => problem.refined_posterior(before),
        }
    }
}
