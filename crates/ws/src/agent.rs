//! The world simulator as an agent on the bus.

use crate::WsError;
use crate::calibration::Calibrator;
use crate::live_gap::{LiveGap, Look, LookResult};
use crate::wind::WorldWind;
use air::dryden::{Dryden, Turbulence};
use air::geo::{Geodetic, LocalFrame};
use air::isa::Atmosphere;
use air::terrain::Terrain;
use air::wind::{WindProfile, WindSeries, WindVector, towards_deg};
use formats::number::plus_minus;
use plume::{DispersionModel, Place, Puffs, UnsteadyAir};
use protocol::key::Name;
use protocol::message::{
    Ambient, Estimate, Extension, Flux, FluxMethod, GapCause, MechanismSetting, Model, Observation,
    Peak, PeakStatus, Phase, Severity, State, VehicleKind as FlownKind, Weather, WindRow,
};
use protocol::{Agent, AgentId, Event, Interest, Message, Outbox, Pauses, SimTime, Topic};
use rand::rngs::ChaCha8Rng;
use scenario::Scenario;
use scenario::airspace::{Airspace, SETPOINT_MARGIN_M};
use scenario::contradiction::{Corrected as CorrectedValues, Evidence, Read};
use scenario::random::stream;
use scenario::tables::{VehicleKind, WindFollows};
use scenario::uncertain::Uncertain;
use std::collections::BTreeMap;

/// Time between two ambients of a simulated vehicle, which flies in them, s.
const AMBIENT_S: f64 = 0.1;
/// Time between two ambients of a real vehicle, s: the heartbeat by which it knows that the world lives.
const HEARTBEAT_S: f64 = 1.0;
/// Time between two corrections of the model, s.
const CORRECTION_S: f64 = 10.0;
/// One standard deviation of a scenario's wind speed where it states none, as a part of it: that of a forecast.
const WIND_SPEED_SD: f64 = 0.2;
/// Height of the wind to which MIL-F-8785C refers turbulence: 20 ft.
const TURBULENCE_WIND_HEIGHT_M: f64 = 6.096;
/// Ratio of vertical gust to wind in MIL-F-8785C.
const STANDARD_INTENSITY: f64 = 0.1;

/// What a world simulator needs to start.
#[derive(Debug)]
pub struct WorldSimulatorConfig {
    /// The scenario, checked.
    pub scenario: Scenario,
    /// Measured wind, where the scenario names a series.
    pub wind_series: Option<WindSeries>,
    /// The ground.
    pub terrain: Terrain,
}

/// A vehicle of the team.
struct TeamVehicle {
    name: Name,
    /// Where it was last, and whether it is simulated.
    state: Option<State>,
    gust: Dryden,
    rng: ChaCha8Rng,
    next_s: f64,
}

/// The world simulator.
pub struct WorldSimulator {
    id: AgentId,
    frame: LocalFrame,
    atmosphere: Atmosphere,
    terrain: Terrain,
    wind: WorldWind,
    unsteady: Option<UnsteadyAir>,
    intensity: f64,
    calibrator: Calibrator,
    /// What the readings show of the model; none where the scenario wants none.
    gap: Option<LiveGap>,
    /// Where the mission is, by the plan.
    phase: Phase,
    airspace: Airspace,
    /// What speaks against the scenario's values, and the keys of those that it was told of last.
    evidence: Evidence,
    contradicted: Vec<String>,
    /// c_MAX as the scenario has it, ppm.
    stated_c_max_ppm: f64,
    /// The peak of the model as it was corrected last, and why it has its status.
    peak: Option<Peak>,
    reason: String,
    /// The status that was reported last.
    status: Option<PeakStatus>,
    /// What the sources emit, as it was found last.
    flux: Vec<Flux>,
    /// One standard deviation of the scenario's wind speed, m/s.
    wind_sd_m_s: f64,
    /// Index of each real vehicle in the calibrator.
    real: BTreeMap<String, usize>,
    /// The team; each gets its air from here.
    vehicles: Vec<TeamVehicle>,
    /// Their places by name.
    places: BTreeMap<Name, usize>,
    world: DispersionModel,
    extensions: Vec<MechanismSetting>,
    /// Whether readings have named a fault of a sensor that the model does not hold.
    sensor_is_named: bool,
    next_correction_s: f64,
    readings_used: u64,
    /// Whether a correction is being computed.
    corrects: bool,
    /// How often the base model has become another.
    base: u64,
    /// Weather that is not said yet.
    news: Option<Weather>,
    pauses: Pauses,
}

impl WorldSimulator {
    /// A world simulator for a scenario.
    ///
    /// # Errors
    /// A scenario that describes no world.
    pub fn new(config: WorldSimulatorConfig) -> Result<Self, WsError> {
        let scenario = &config.scenario;
        let real: Vec<String> = scenario
            .vehicles
            .iter()
            .filter(|v| v.kind != VehicleKind::Simulated)
            .map(|v| v.id.clone())
            .collect();
        let calibrator = Calibrator::new(scenario, &real, None)?;
        let vehicles = scenario
            .vehicles
            .iter()
            .map(|v| {
                Ok(TeamVehicle {
                    name: Name::new(&v.id)?,
                    state: None,
                    gust: Dryden::new(),
                    rng: stream(scenario.mission.seed, &format!("ws/gust/{}", v.id)),
                    next_s: 0.0,
                })
            })
            .collect::<Result<Vec<_>, WsError>>()?;
        let stated_c_max_ppm = calibrator.calibrated().c_max_ppm.value;
        let follow = scenario.weather.follow == WindFollows::Reported;
        let world = DispersionModel::new(calibrator.corrected_spec())?;
        Ok(Self {
            id: AgentId::ws(),
            frame: scenario.frame()?,
            atmosphere: scenario.atmosphere()?,
            airspace: Airspace::of(scenario)?.over(&config.terrain),
            terrain: config.terrain,
            wind: WorldWind::new(scenario.wind_profile()?, config.wind_series, follow),
            intensity: scenario.weather.turbulence_intensity / STANDARD_INTENSITY,
            unsteady: scenario.unsteady_weather().map(|u| u.around(&world)),
            world,
            calibrator,
            gap: LiveGap::new(scenario)?,
            phase: Phase::TakeOff,
            evidence: Evidence::new(scenario),
            contradicted: Vec::new(),
            stated_c_max_ppm,
            peak: None,
            reason: String::new(),
            status: None,
            flux: Vec::new(),
            wind_sd_m_s: scenario
                .prior_sd(Uncertain::WindSpeed)
                .unwrap_or(WIND_SPEED_SD * scenario.weather.wind_speed_m_s),
            real: real
                .into_iter()
                .enumerate()
                .map(|(k, name)| (name, k))
                .collect(),
            places: vehicles.iter().map(|v| v.name.clone()).zip(0..).collect(),
            vehicles,
            extensions: Vec::new(),
            sensor_is_named: false,
            next_correction_s: 0.0,
            readings_used: 0,
            corrects: false,
            base: 0,
            news: None,
            pauses: Pauses::default(),
        })
    }

    /// What is known of the wind over time is this from the next tick on; the world says so. Nothing where the
    /// scenario has no series, or follows what vehicles report.
    pub fn set_weather(&mut self, weather: Weather) {
        let vector = |row: &WindRow| WindVector {
            east_m_s: row.wind_ne_m_s[1],
            north_m_s: row.wind_ne_m_s[0],
        };
        let rows = weather.wind.iter().map(|row| (row.time_s, vector(row)));
        let series = WindSeries::of_rows(rows);
        if series.is_some_and(|series| self.wind.set_series(series)) {
            self.news = Some(weather);
        }
    }

    fn observe(&mut self, observation: &Observation) {
        let platform = match self.real.get(&observation.vehicle) {
            Some(&platform) => platform,
            // One that joined in flight.
            None => {
                let platform = self.calibrator.add_platform(&observation.vehicle);
                self.real.insert(observation.vehicle.clone(), platform);
                platform
            }
        };
        let reading = &observation.reading;
        let time = SimTime::from_ns(observation.time_ns);
        if let Some(gap) = &mut self.gap {
            gap.take(&observation.vehicle, time, reading);
        }
        let time_s = time.s();
        let at = Geodetic {
            lat_deg: reading.lat_deg,
            lon_deg: reading.lon_deg,
        };
        let place = Place::from_geodetic(&self.frame, at, reading.alt_amsl_m);
        let reported = reading.wind_speed_m_s.zip(reading.wind_from_deg);
        self.evidence.read(&Read {
            vehicle: &observation.vehicle,
            ppm: reading.co2_ppm,
            at,
            alt_amsl_m: reading.alt_amsl_m,
            wind: reported,
        });
        if let Some((speed, from)) = reported {
            let wind = WindVector::from_speed_and_direction(speed, from);
            self.wind.report(time_s, place.height_agl_m, wind);
        }
        // A wind that changes in time carries the plume with it; the turn found is on top of it.
        let wind = (!self.wind.is_constant()).then(|| {
            let there = self.wind.at(time_s, 0.0);
            (there.speed_at_m_s(place.height_agl_m), there.from_deg())
        });
        self.calibrator
            .observe(platform, time_s, place, wind, reading.co2_ppm);
    }

    fn say_weather(&self, weather: Weather, now_s: f64, out: &mut Outbox) {
        let wind = self.wind.at(now_s, 0.0);
        let words = format!(
            "wind {:.1} m/s from {:.0}° at {:.0} m AGL",
            wind.reference_speed_m_s(),
            wind.from_deg(),
            wind.reference_height_agl_m()
        );
        out.say(Topic::Weather, Message::Weather(weather));
        out.event(&self.id, Severity::Info, "weather", words);
    }

    /// Begins a correction of the model where one is due, and publishes the model as it is.
    fn correct(&mut self, now_s: f64, out: &mut Outbox) {
        let is_due = self.calibrator.is_due() && self.calibrator.taken() > self.readings_used;
        if is_due && !self.corrects {
            self.corrects = true;
            let correction = self.correction();
            out.compute(|| correction.compute(None));
        }
        self.publish_model(now_s, out);
    }

    /// Looks at what readings show of the model where the plume has been located, and at each later phase where what is
    /// found changes the world on the way.
    fn enter_phase(&mut self, phase: Phase, out: &mut Outbox) {
        if std::mem::replace(&mut self.phase, phase) == phase {
            return;
        }
        let Some(gap) = &mut self.gap else { return };
        let is_due = phase == Phase::Characterise || (phase.has_searched() && gap.adopts());
        if let Some(look) = is_due.then(|| gap.look()).flatten() {
            out.compute(|| look.compute());
        }
    }

    /// Takes in what a look has found.
    fn learn_gap(&mut self, found: LookResult, out: &mut Outbox) {
        out.event(&self.id, Severity::Info, "reality-gap", found.words);
        self.extend(&found.extension, out);
        out.say(Topic::Extension, Message::Extension(found.extension));
    }

    /// Looks at all readings and corrects the model for the last time, where there are new ones.
    fn conclude(&mut self, now_s: f64, out: &mut Outbox) {
        let look = self.gap.as_mut().and_then(LiveGap::last_look);
        if let Some(found) = look.map(Look::compute) {
            self.learn_gap(found, out);
        }
        if self.calibrator.taken() > self.readings_used {
            let nearest_m = self.airspace.keep_out_m() + SETPOINT_MARGIN_M;
            let found = self.correction().compute(Some(nearest_m));
            self.learn(found, out);
        }
        self.publish_model(now_s, out);
        self.report_status(true, out);
    }

    fn correction(&mut self) -> Correction {
        self.readings_used = self.calibrator.taken();
        Correction {
            base: self.base,
            calibrator: self.calibrator.clone(),
            airspace: self.airspace.clone(),
            wind_m_s: self.wind.reported_speed(self.wind_sd_m_s),
        }
    }

    /// Takes in a correction, unless the base model has become another since it began.
    fn learn(&mut self, found: CorrectionResult, out: &mut Outbox) {
        self.corrects = false;
        if found.base != self.base {
            return;
        }
        match found.corrected {
            Ok(corrected) => {
                self.calibrator.adopt(*corrected.calibrator);
                let found = self.calibrator.calibrated();
                let values = [
                    found.background_ppm,
                    found.effective_height_agl_m,
                    found.axis_deg,
                    found.c_max_ppm,
                    found.sigma_y_scale,
                    found.sigma_z_scale,
                ];
                let values = values.map(|e| (e.value, e.sd));
                let values = CorrectedValues::new(values, self.stated_c_max_ppm);
                let balance = Flux::by(FluxMethod::MassBalance, &corrected.flux);
                self.evidence.correct(values, balance);
                self.world = corrected.world;
                self.peak = corrected.peak;
                self.reason = corrected.reason;
                self.flux = corrected.flux;
            }
            Err(e) => out.event(
                &self.id,
                Severity::Error,
                "correction-failed",
                e.to_string(),
            ),
        }
    }

    fn publish_model(&mut self, now_s: f64, out: &mut Outbox) {
        self.compare_with_scenario(out);
        self.report_status(false, out);
        out.say(Topic::Model, Message::Model(Box::new(self.model(now_s))));
    }

    /// Reports what of the scenario readings contradict, whenever that is something else.
    fn compare_with_scenario(&mut self, out: &mut Outbox) {
        let found = self.evidence.contradictions();
        let keys: Vec<String> = found.iter().map(|c| c.key.clone()).collect();
        if keys != self.contradicted {
            for contradiction in found {
                let code = "scenario-contradicted";
                out.event(&self.id, Severity::Warning, code, contradiction.says);
            }
            self.contradicted = keys;
        }
    }

    /// Reports how far readings stand behind the peak and why, once it is searched, whenever that changes and at the end.
    fn report_status(&mut self, concludes: bool, out: &mut Outbox) {
        let peak = self.peak();
        let status = peak.map_or(PeakStatus::NotFound, |p| p.status);
        let follows_none = status == PeakStatus::NotFound && self.calibrator.has_read_a_plume();
        let status = if follows_none {
            PeakStatus::Doubtful
        } else {
            status
        };
        if !self.phase.has_searched() || !concludes && self.status == Some(status) {
            return;
        }
        let before = self
            .status
            .replace(status)
            .filter(|before| *before != status);
        let why = if !self.contradicted.is_empty() {
            format!("the readings contradict {}", self.contradicted.join(", "))
        } else if follows_none {
            "a plume was read, but the readings follow none that the model allows".to_owned()
        } else if self.sensor_is_named && status == PeakStatus::Doubtful {
            "a fault of a sensor is named that the model does not hold".to_owned()
        } else {
            self.reason.clone()
        };
        let state = if concludes { "" } else { "preliminary, " };
        let mut words = format!("peak {state}{}", status.words());
        if let Some(before) = before {
            words += &format!(" (before: {})", before.words());
        }
        if let Some(p) = peak.filter(|p| p.status != PeakStatus::NotFound) {
            words += &format!(", {} ppm", plus_minus(p.co2_ppm, p.sd_ppm));
        }
        if !why.is_empty() {
            words += &format!(": {why}");
        }
        out.event(&self.id, Severity::Info, "peak-status", words);
    }

    fn model(&self, now_s: f64) -> Model {
        let found = self.calibrator.calibrated();
        let spec = self.world.spec();
        let (axis, wind) = self.axis_and_wind(now_s);
        Model {
            background_ppm: found.background_ppm,
            effective_height_agl_m: found.effective_height_agl_m,
            axis_deg: axis,
            c_max_ppm: found.c_max_ppm,
            c_max_distance_m: Estimate {
                value: found.c_max_distance_m,
                sd: 0.0,
            },
            sigma_y_scale: found.sigma_y_scale,
            sigma_z_scale: found.sigma_z_scale,
            wind_speed_m_s: wind.speed_at_m_s(spec.sources[0].effective_height_agl_m),
            observations: self.calibrator.taken(),
            mechanisms: self.in_force(),
            peak: self.peak(),
            flux: self.flux.clone(),
        }
    }

    /// The extensions, further sources as they are believed to be now.
    fn in_force(&self) -> Vec<MechanismSetting> {
        let fixed = self.extensions.iter().filter(|m| !is_a_source(m)).cloned();
        let added = self.calibrator.added_sources();
        let setting = |m: &plume::Mechanism| {
            MechanismSetting::new(m.id().as_str(), m.platforms(), m.parameters())
        };
        fixed.chain(added.iter().map(setting)).collect()
    }

    /// The peak as it was corrected last. Readings of a sensor of which a fault was named, and is not in the
    /// model, stand behind nothing, and neither does a scenario that they contradict.
    fn peak(&self) -> Option<Peak> {
        let found = self.peak?;
        let is_found = found.status != PeakStatus::NotFound;
        let is_doubtful = !self.contradicted.is_empty() || self.sensor_is_named && is_found;
        Some(if !is_doubtful {
            found
        } else {
            Peak {
                status: PeakStatus::Doubtful,
                ..found
            }
        })
    }

    /// Where the axis runs, and the wind: by the correction alone, or by what is known of the wind of the
    /// moment with the correction on top.
    fn axis_and_wind(&self, now_s: f64) -> (Estimate, WindProfile) {
        let corrected = self.calibrator.calibrated().axis_deg;
        if self.wind.is_constant() {
            return (corrected, self.world.spec().wind);
        }
        let wind = self.wind.at(now_s, self.calibrator.turn_deg());
        let axis = Estimate {
            value: towards_deg(wind.from_deg()),
            ..corrected
        };
        (axis, wind)
    }

    fn extend(&mut self, extension: &Extension, out: &mut Outbox) {
        let is_sensor = |c: &GapCause| c.mechanisms.iter().all(|m| of_a_sensor(m));
        let beside_model = extension.mechanisms.iter().filter(|_| !extension.adopt);
        self.evidence
            .name(beside_model.filter_map(MechanismSetting::only_parameter));
        // A name that stands does so whatever else is not explained.
        self.sensor_is_named = !extension.adopt && extension.causes.iter().any(is_sensor);
        // Further sources are part of what is asked for, whether or not other mechanisms are to be adopted.
        let taken: Vec<MechanismSetting> = extension
            .mechanisms
            .iter()
            .filter(|m| extension.adopt || is_a_source(m))
            .cloned()
            .collect();
        if taken == self.extensions {
            return;
        }
        let made: Result<Vec<plume::Mechanism>, plume::PlumeError> = taken
            .iter()
            .map(|m| {
                let parameters: Vec<(&str, f64)> = m
                    .parameters
                    .iter()
                    .map(|(name, value)| (name.as_str(), *value))
                    .collect();
                Ok(plume::Mechanism::new(&m.id, &parameters)?.for_platforms(&m.platforms))
            })
            .collect();
        let done = made
            .map_err(WsError::from)
            .and_then(|m| self.calibrator.extend(m));
        match done {
            Ok(()) => {
                self.readings_used = 0;
                self.base += 1;
                let ids: Vec<&str> = taken.iter().map(|m| m.id.as_str()).collect();
                let (code, words) = match ids[..] {
                    [] => (
                        "extension-withdrawn",
                        "the world uses the base model again, without mechanisms".to_owned(),
                    ),
                    _ => ("extension-adopted", ids.join(", ")),
                };
                out.event(&self.id, Severity::Info, code, words);
                self.extensions = taken;
            }
            Err(e) => out.event(
                &self.id,
                Severity::Warning,
                "extension-refused",
                e.to_string(),
            ),
        }
    }

    /// The plume as the wind has carried it so far; none where nothing moves it.
    fn plume_in_motion(&mut self, now_s: f64) -> Option<Puffs> {
        let unsteady = self.unsteady.as_mut();
        if !self.wind.is_constant() {
            let turn_deg = self.calibrator.turn_deg();
            return Some(
                self.world
                    .puffs(self.wind.slow(), turn_deg, unsteady, now_s),
            );
        }
        let wind = &self.world.spec().wind;
        let slow = WindSeries::constant(wind.at(wind.reference_height_agl_m()));
        unsteady.map(|air| self.world.puffs(&slow, 0.0, Some(air), now_s))
    }

    fn publish_ambients(&mut self, now_s: f64, out: &mut Outbox) {
        let wind = self.axis_and_wind(now_s).1;
        let is_due = |v: &TeamVehicle| now_s + 1e-9 >= v.next_s && v.state.is_some();
        let puffs = self
            .vehicles
            .iter()
            .any(is_due)
            .then(|| self.plume_in_motion(now_s))
            .flatten();
        for vehicle in &mut self.vehicles {
            // Ticks are whole nanoseconds; the margin is for their sum as seconds.
            if now_s + 1e-9 < vehicle.next_s {
                continue;
            }
            let Some(state) = vehicle.state.clone() else {
                continue;
            };
            let period_s = match state.kind {
                FlownKind::Simulated => AMBIENT_S,
                FlownKind::Real => HEARTBEAT_S,
            };
            vehicle.next_s = now_s + period_s;
            let at = Geodetic {
                lat_deg: state.lat_deg,
                lon_deg: state.lon_deg,
            };
            let place = Place::from_geodetic(&self.frame, at, state.alt_amsl_m);
            let ground_amsl_m = self.terrain.ground_amsl_m(at);
            let above_ground_m = (state.alt_amsl_m - ground_amsl_m).max(0.0);
            let air = self.atmosphere.at(state.alt_amsl_m);
            let mean = wind.at(above_ground_m);
            let eddies = self.unsteady.as_mut();
            let [east, north, up] =
                eddies.map_or([0.0; 3], |air| air.wind_m_s(now_s, above_ground_m));
            let co2_ppm = match &puffs {
                None => self.world.mean_ppm(&place, now_s),
                Some(puffs) => self.world.ppm_among(puffs, &place),
            };
            let gust_ned_m_s = gust(
                vehicle,
                period_s,
                state.airspeed_m_s,
                &wind,
                above_ground_m,
                self.intensity,
            );
            let ambient = Ambient {
                wind_ned_m_s: [mean.north_m_s + north, mean.east_m_s + east, -up],
                gust_ned_m_s,
                temperature_k: air.temperature_k,
                pressure_pa: air.pressure_pa,
                co2_ppm,
                ground_amsl_m,
            };
            out.say(
                Topic::Ambient(vehicle.name.clone()),
                Message::Ambient(ambient),
            );
        }
    }
}

/// A correction of the model, which takes seconds.
struct Correction {
    /// The base model that it corrects.
    base: u64,
    calibrator: Calibrator,
    airspace: Airspace,
    wind_m_s: Estimate,
}

/// What it has found.
struct CorrectionResult {
    base: u64,
    corrected: Result<Corrected, WsError>,
}

struct Corrected {
    calibrator: Box<Calibrator>,
    world: DispersionModel,
    peak: Option<Peak>,
    flux: Vec<Flux>,
    /// Why the peak has its status.
    reason: String,
}

impl Correction {
    /// Corrects the model; where it is the last time, with the distance from the source nearest to which something will
    /// be asked of the plume.
    fn compute(self, concludes_at_m: Option<f64>) -> CorrectionResult {
        CorrectionResult {
            base: self.base,
            corrected: self.corrected(concludes_at_m),
        }
    }

    fn corrected(mut self, concludes_at_m: Option<f64>) -> Result<Corrected, WsError> {
        match concludes_at_m {
            Some(nearest_m) => self.calibrator.conclude(nearest_m)?,
            None => self.calibrator.update()?,
        }
        let found = self.calibrator.peak(&self.airspace);
        let (peak, reason) = found.map_or((None, String::new()), |(peak, why)| (Some(peak), why));
        Ok(Corrected {
            world: DispersionModel::new(self.calibrator.corrected_spec())?,
            reason,
            flux: self.flux(peak),
            peak,
            calibrator: Box::new(self.calibrator),
        })
    }

    /// The emission rates. Where no plume of the model fits what was read, that of the mass balance alone: it needs no model
    /// of the plume's strength. None before a plume was read.
    fn flux(&self, peak: Option<Peak>) -> Vec<Flux> {
        let fits = peak.is_some_and(|p| p.status != PeakStatus::NotFound);
        if !fits && !self.calibrator.has_read_a_plume() {
            return Vec::new();
        }
        let mut found = self.calibrator.fluxes(self.wind_m_s);
        found.retain(|flux| fits || flux.method == FluxMethod::MassBalance);
        found
    }
}

/// Whether an extension is a further source.
fn is_a_source(setting: &MechanismSetting) -> bool {
    setting.id == plume::MechanismId::SecondSource.as_str()
}

/// Whether a mechanism is one of a sensor, by which the same air reads otherwise.
fn of_a_sensor(id: &str) -> bool {
    let known = plume::MechanismId::from_name(id);
    known.is_some_and(|id| id.spec().family == plume::mechanism::Family::Sensor)
}

/// The next gust on a vehicle, north, east, down. Dryden's components are along and across the mean
/// wind, and the filter runs at the airspeed: the vehicle flies through a frozen field (Taylor 1938).
fn gust(
    vehicle: &mut TeamVehicle,
    period_s: f64,
    airspeed_m_s: f64,
    wind: &WindProfile,
    above_ground_m: f64,
    intensity: f64,
) -> [f64; 3] {
    let low = wind.speed_at_m_s(TURBULENCE_WIND_HEIGHT_M);
    let turbulence = Turbulence::mil_f_8785c(above_ground_m, low, intensity);
    let [along, across, down] =
        vehicle
            .gust
            .step(period_s, airspeed_m_s, &turbulence, &mut vehicle.rng);
    let toward = WindVector::from_speed_and_direction(1.0, wind.from_deg());
    [
        along * toward.north_m_s - across * toward.east_m_s,
        along * toward.east_m_s + across * toward.north_m_s,
        down,
    ]
}

impl Agent for WorldSimulator {
    fn id(&self) -> &AgentId {
        &self.id
    }

    fn interests(&self) -> Vec<Interest> {
        vec![
            Interest::AllStates,
            Interest::One(Topic::Observation),
            Interest::One(Topic::Plan),
        ]
    }

    fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox) {
        match event {
            Event::Message(Topic::State(name), envelope) => {
                let place = self.places.get(name).copied();
                let vehicle = place.and_then(|k| self.vehicles.get_mut(k));
                if let (Some(vehicle), Message::State(state)) = (vehicle, &envelope.message) {
                    vehicle.state = Some(state.clone());
                }
            }
            Event::Message(_, envelope) => match &envelope.message {
                Message::Observation(observation) => self.observe(observation),
                Message::Plan(plan) => self.enter_phase(plan.phase, out),
                _ => {}
            },
            Event::Tick => {
                if let Some(weather) = self.news.take() {
                    self.say_weather(weather, now.s(), out);
                }
                // Whoever waited for the model gets it before the next correction, which may take long.
                if self.pauses.tick(now) > 0 {
                    self.publish_model(now.s(), out);
                }
                if now.s() + 1e-9 >= self.next_correction_s {
                    self.next_correction_s = now.s() + CORRECTION_S;
                    self.correct(now.s(), out);
                }
                self.publish_ambients(now.s(), out);
            }
            Event::Computed(result) => {
                if let Some(found) = result.take() {
                    self.learn(found, out);
                    self.publish_model(now.s(), out);
                } else if let Some(found) = result.take() {
                    if let Some(gap) = &mut self.gap {
                        gap.has_looked(&found);
                    }
                    self.learn_gap(found, out);
                }
            }
            Event::Stop => self.conclude(now.s(), out),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::Envelope;
    use protocol::message::{Reading, VehicleKind as Kind};

    #[test]
    fn a_real_vehicle_hears_the_world_every_second_and_the_model_as_soon_as_it_is_back() {
        let text = include_str!("../../../scenarios/as-pontes.toml");
        let mut ws = WorldSimulator::new(WorldSimulatorConfig {
            terrain: Terrain::Flat(340.0),
            wind_series: None,
            scenario: Scenario::parse("as-pontes.toml", text).unwrap(),
        })
        .unwrap();
        let state = State {
            kind: Kind::Real,
            lat_deg: 43.45,
            lon_deg: -7.86,
            alt_amsl_m: 700.0,
            vel_ned_m_s: [18.0, 0.0, 0.0],
            roll_deg: 0.0,
            pitch_deg: 0.0,
            heading_deg: 0.0,
            airspeed_m_s: 18.0,
            throttle: 0.5,
            airborne: true,
        };
        let topic = Topic::State(Name::new("6").unwrap());
        let mut at = |ticks: std::ops::Range<u64>| {
            let (mut ambients, mut models) = (0, Vec::new());
            for tick in ticks {
                let now = SimTime::of_tick(tick, 20_000_000);
                let mut out = Outbox::default();
                let envelope = Envelope {
                    sender: AgentId::va("6").unwrap(),
                    sequence: tick + 1,
                    time: now,
                    message: Message::State(state.clone()),
                };
                ws.handle(Event::Message(&topic, &envelope), now, &mut out);
                ws.handle(Event::Tick, now, &mut out);
                for (_, message) in out.drain() {
                    ambients += usize::from(matches!(message, Message::Ambient(_)));
                    if matches!(message, Message::Model(_)) {
                        models.push(now.s());
                    }
                }
            }
            (ambients, models)
        };
        // 50 ticks a second.
        assert_eq!(at(0..500), (10, vec![0.0]));
        assert_eq!(at(500..600), (2, vec![10.0]));
        // Stopped for 6 s: both at once, although the next correction is due at 20 s.
        assert_eq!(at(900..901), (1, vec![18.0]));
        assert_eq!(at(901..1001), (2, vec![20.0]));
    }

    #[test]
    fn further_sources_come_and_go_as_readings_show_them() {
        let text = "[site]\nlat_deg=43.4\nlon_deg=-7.8\nground_amsl_m=340\n\
            [[source]]\nname=\"stack\"\nlat_deg=43.4\nlon_deg=-7.8\nemission_kg_s=300\n";
        let mut ws = WorldSimulator::new(WorldSimulatorConfig {
            terrain: Terrain::Flat(340.0),
            wind_series: None,
            scenario: Scenario::parse("s.toml", text).unwrap(),
        })
        .unwrap();
        let second = [("east_m", 300.0), ("north_m", -250.0), ("ratio", 0.5)];
        let second = MechanismSetting::new("second-source", &[], second.into_iter());
        let lag = MechanismSetting::new("sensor-lag", &[], [("time_constant_s", 5.0)].into_iter());
        let mut say = |mechanisms: &[&MechanismSetting]| {
            let extension = Extension {
                verdict: "named".to_owned(),
                causes: Vec::new(),
                mechanisms: mechanisms.iter().copied().cloned().collect(),
                adopt: false,
            };
            ws.extend(&extension, &mut Outbox::default());
            let wind = Estimate {
                value: 5.0,
                sd: 0.0,
            };
            let flux: Vec<(String, f64)> = ws
                .calibrator
                .flux(wind)
                .into_iter()
                .map(|(name, q)| (name, q.value))
                .collect();
            let ids: Vec<String> = ws.model(0.0).mechanisms.into_iter().map(|m| m.id).collect();
            (ids, flux)
        };
        let (ids, flux) = say(&[&second, &lag]);
        assert_eq!(
            ids,
            ["second-source"],
            "other mechanisms only where they are adopted"
        );
        assert_eq!(flux[0].0, "stack");
        assert_eq!(flux[1].0, "second-source");
        assert!((flux[1].1 / flux[0].1 - 0.5).abs() < 1e-9, "{flux:?}");
        let (ids, flux) = say(&[]);
        assert!(ids.is_empty() && flux.len() == 1);
    }

    #[test]
    fn the_axis_of_the_model_follows_the_wind_that_is_reported() {
        // Stated from the west; reported from 300°: the axis runs towards 120°.
        let text = "[site]\nlat_deg=43.4\nlon_deg=-7.8\nground_amsl_m=340\n[weather]\nwind_from_deg=270\n\
            follow=\"reported\"\n[[source]]\nlat_deg=43.4\nlon_deg=-7.8\nemission_kg_s=300\n\
            [[vehicle]]\nid=\"6\"\nkind=\"stand-in\"\n";
        let scenario = Scenario::parse("s.toml", text).unwrap();
        let mut ws = WorldSimulator::new(WorldSimulatorConfig {
            terrain: Terrain::Flat(340.0),
            wind_series: None,
            scenario,
        })
        .unwrap();
        let mut out = Outbox::default();
        let reading = Reading {
            kind: Kind::Real,
            lat_deg: 43.41,
            lon_deg: -7.8,
            alt_amsl_m: 700.0,
            co2_ppm: 400.0,
            wind_speed_m_s: Some(6.0),
            wind_from_deg: Some(300.0),
            temperature_c: None,
            pressure_hpa: None,
            time_ns: None,
        };
        let observation = Envelope {
            sender: AgentId::sc(),
            sequence: 1,
            time: SimTime::ZERO,
            message: Message::Observation(Observation {
                vehicle: "6".to_owned(),
                time_ns: 0,
                reading,
            }),
        };
        let heard = Event::Message(&Topic::Observation, &observation);
        ws.handle(heard, SimTime::ZERO, &mut out);
        assert!((ws.model(1.0).axis_deg.value - 120.0).abs() < 1e-6);
    }
}
