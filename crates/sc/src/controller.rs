//! The squadron controller as an agent: what it receives, what it publishes, and the course of a
//! mission.

mod approaches;
mod dispatch;
mod homing;
mod pattern_flight;
mod phases;
mod survey;
mod take_off;

pub use homing::LEAST_OVER_GROUND_M_S;

use air::geo::{Enu, Geodetic, wrap_signed_deg};
use air::terrain::Terrain;
use air::wind::towards_deg;
use csea::{
    Archive, ArchiveOptions, CsEaOptions, Domain, PlumePrior, Position, Sample, SearchStrategy,
    strategy_by_name,
};
use formats::number::plus_minus;
use plume::{DispersionSpec, MechanismId, SourceSpec};
use protocol::key::Name;
use protocol::message::{
    ControlWish, Destination, Estimate, MechanismSetting, Mode, Model, Observation, Peak,
    PeakStatus, Phase, Plan, Population, Reading, Severity, State, VehicleKind as Kind,
};
use protocol::{Agent, AgentId, Envelope, Event, Interest, Message, Outbox, SimTime, Topic};
use rand::rngs::ChaCha8Rng;
use scenario::Scenario;
use scenario::random::stream;
use scenario::tables::{SearchTable, VehicleKind};
use scenario::world::OFF_HEIGHT_M;
use std::collections::BTreeMap;

use crate::error::ScError;
use crate::fleet::{Fleet, LINKED_CIRCLE_M, MARGIN_M, TeamVehicle};
use crate::passes::PassRange;
use crate::plume_estimate::PlumeEstimate;
use crate::route_graph::RouteGraph;
use crate::separation::Separation;
use crate::tasks::{Tasks, VehicleTask};
use approaches::Approaches;
use pattern_flight::PatternFlight;
use scenario::airspace::Airspace;
use survey::Survey;

/// Time between two decisions, s.
const DECISION_S: f64 = 1.0;
/// Time to hear where all vehicles are before the first decision of a controller that was started again, ns:
/// they say it ten times a second, and come home if nobody commands them for 5 s.
const LISTEN_NS: i64 = 500_000_000;
/// Vehicles are planned farther apart than they must stay, by how far they may be off their
/// track, m.
const OFF_TRACK_M: f64 = 25.0;
/// How far the search goes beyond the range of the passes, m.
const SEARCH_BEYOND_M: f64 = 600.0;
/// The search goes this far to both sides of the axis, degrees.
const SEARCH_SECTOR_DEG: f64 = 60.0;
/// A direction that is known no better than to this, degrees, is looked for: passes across it would be longer than the
/// plume is wide by far.
const LOCATED_DEG: f64 = 15.0;
/// Half width of the 95 % interval of a normal distribution, in standard deviations.
const HALF_WIDTH_95_SD: f64 = 1.96;
/// Half height of the search around the axis, in σz at the far end of the passes.
const SEARCH_SIGMAS: f64 = 2.5;

/// The squadron controller.
pub struct SquadronController {
    id: AgentId,
    fleet: Fleet,
    /// The approaches to the homes, in the wind as it is estimated.
    approaches: Approaches,
    tasks: Tasks,
    /// The world as the scenario describes it, with the sources that the model has beside the scenario's.
    base: DispersionSpec,
    /// How many sources the scenario has.
    scenario_sources: usize,
    model: Option<Model>,
    range: PassRange,
    /// Heights above home at which vehicles wait for their landing, from the lowest.
    levels_amsl_m: Vec<f64>,
    search: SearchTable,
    /// Half widths of the 95 % intervals of the peak's excess and of each flux, as parts of them, at which the team may
    /// go home.
    asked_within: (Option<f64>, Option<f64>),
    survey: Survey,
    /// What the scenario supposes of the plume.
    prior: PlumePrior,
    duration_s: f64,
    phase: Phase,
    rng: ChaCha8Rng,
    strategy: Option<Box<dyn SearchStrategy>>,
    archive: Archive,
    /// Those that fly patterns in place of a search.
    pattern: Option<PatternFlight>,
    generation: u64,
    next_decision: SimTime,
    next_population: SimTime,
}

impl std::fmt::Debug for SquadronController {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SquadronController")
            .field("phase", &self.phase)
            .field("fleet", &self.fleet)
            .finish_non_exhaustive()
    }
}

impl SquadronController {
    /// The controller of a scenario's team.
    ///
    /// # Errors
    /// A scenario that describes no world, an unknown search strategy, or a fence that leaves
    /// nowhere to fly.
    pub fn new(scenario: &Scenario) -> Result<Self, ScError> {
        let airspace = Airspace::of(scenario)?;
        let base = scenario.dispersion_spec()?;
        let separation = Separation {
            distance_m: scenario.fence.separation_m + OFF_TRACK_M,
            height_m: scenario.fence.separation_height_m + OFF_HEIGHT_M,
        };
        let source = &scenario.sources[0];
        let stated_m = source.c_max_distance_m.unwrap_or(0.0);
        let lag_m = scenario.search.airspeed_m_s * scenario.sensor.time_constant_s;
        let range = PassRange::of(&airspace, MARGIN_M, stated_m, lag_m);
        let keep_out_m = airspace.keep_out_m();
        let no_airspace = ScError::NoAirspace {
            margin_m: MARGIN_M,
            keep_out_m,
        };
        let centre = airspace.polygon()[0];
        airspace
            .nearest_allowed(centre, MARGIN_M)
            .ok_or(no_airspace)?;
        let vehicles = team(scenario, &airspace)?;
        let tasks = Tasks::new(&vehicles);
        let fleet = Fleet {
            routes: RouteGraph::of(&airspace, MARGIN_M),
            airspace,
            separation,
            airspeed_m_s: scenario.search.airspeed_m_s,
            has_real: vehicles.iter().any(|v| v.real),
            places: places(&vehicles),
            vehicles,
            passes: Vec::new(),
            ways_down: Vec::new(),
            climbs: Vec::new(),
            others: BTreeMap::new(),
            occupancy: None,
        };
        let downwind_deg = towards_deg(base.wind.from_deg());
        let mut controller = Self {
            id: AgentId::sc(),
            approaches: homing::approaches_of(&fleet, downwind_deg),
            tasks,
            fleet,
            levels_amsl_m: scenario.levels_amsl_m(),
            prior: crate::prior::of(scenario, &base),
            scenario_sources: base.sources.len(),
            base,
            model: None,
            range,
            search: scenario.search.clone(),
            asked_within: (scenario.mission.peak_within, scenario.mission.flux_within),
            survey: Survey::of(scenario.vehicles.len()),
            duration_s: scenario.mission.duration_s,
            pattern: None,
            phase: Phase::TakeOff,
            rng: stream(scenario.mission.seed, "sc"),
            strategy: None,
            archive: Archive::new(ArchiveOptions::default())?,
            generation: 0,
            next_decision: SimTime::ZERO,
            next_population: SimTime::ZERO,
        };
        // A strategy that cannot be is found out now, not in flight.
        controller.strategy = Some(controller.new_strategy()?);
        Ok(controller)
    }

    /// The same controller of vehicles of which some can stop, in the team's order: they fly the patterns that the scenario
    /// names.
    #[must_use]
    pub fn flown_by(mut self, scenario: &Scenario, hovers: &[bool]) -> Self {
        self.pattern = PatternFlight::of(scenario, hovers, &self.fleet.airspace);
        self
    }

    /// The same controller over terrain.
    ///
    /// # Errors
    /// A search that has nowhere to look between floor and ceiling.
    pub fn over(mut self, terrain: &Terrain) -> Result<Self, ScError> {
        self.fleet.airspace = self.fleet.airspace.over(terrain);
        let frame = self.fleet.airspace.frame();
        for vehicle in &mut self.fleet.vehicles {
            vehicle.home.height_m = terrain.ground_amsl_m(frame.to_geodetic(vehicle.home.at));
        }
        if self.fleet.airspace.follows_terrain() {
            self.strategy = Some(self.new_strategy()?);
        }
        Ok(self)
    }

    /// Goes on at `now` with a mission that was in `phase`, after its process was started again: vehicles that are
    /// heard in the air have no orders yet. What was read before is in nobody's memory but the world simulator's, in
    /// its model.
    pub fn resume(&mut self, phase: Phase, now: SimTime) {
        if phase == Phase::Home {
            // The way home begins when those in the air are known.
            self.tasks.called.fill(true);
        } else {
            self.phase = phase;
        }
        self.next_decision = now.later(LISTEN_NS);
    }

    /// The phase of the mission.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The running estimate of the peak; none before the search, while it is only what the
    /// scenario supposes, and none where the readings follow no plume.
    pub fn peak(&self) -> Option<Peak> {
        let found = self.model.as_ref().and_then(|m| m.peak);
        found.filter(|p| self.phase.has_searched() && p.status != PeakStatus::NotFound)
    }

    /// Where the plume is estimated to be; none before the first model.
    fn estimate(&self) -> Option<PlumeEstimate> {
        self.model
            .as_ref()
            .map(|m| PlumeEstimate::of(m, &self.base))
    }

    /// A strategy over the sector downwind in which the plume may be.
    fn new_strategy(&mut self) -> Result<Box<dyn SearchStrategy>, ScError> {
        let options = CsEaOptions {
            population: self.search.population,
            differential_weight: self.search.differential_weight,
            crossover: self.search.crossover,
            ..CsEaOptions::default()
        };
        let domain = self.search_domain()?;
        let mut prior = self.prior.clone();
        if let Some(model) = &self.model {
            crate::prior::by_model(&mut prior, model);
        }
        let name = &self.search.strategy;
        Ok(strategy_by_name(
            name,
            domain,
            options,
            &prior,
            &mut self.rng,
        )?)
    }

    /// Whether it is known where the plume lies, well enough for passes across it: from the start, or because it was
    /// read. A fit to clean air may be sure of a direction too.
    fn is_located(&self) -> bool {
        let is_known = |sd_deg: f64| sd_deg <= LOCATED_DEG;
        let found = self.model.as_ref().filter(|_| self.has_read_plume());
        is_known(self.prior.axis_deg.sd) || found.is_some_and(|m| is_known(m.axis_deg.sd))
    }

    /// Whether real readings have shown a plume.
    fn has_read_plume(&self) -> bool {
        let peak = self.model.as_ref().and_then(|m| m.peak);
        peak.is_some_and(|p| p.status != PeakStatus::NotFound)
    }

    fn search_domain(&mut self) -> Result<Domain, ScError> {
        let estimate = self
            .estimate()
            .unwrap_or_else(|| PlumeEstimate::of_base(&self.base));
        let airspace = self.fleet.airspace.clone();
        let reach_m = self.range.far_m + SEARCH_BEYOND_M;
        let far_m = self.range.far_m;
        let sigma_z_m = estimate.sigmas_m(&self.base, far_m).1;
        let half_m = SEARCH_SIGMAS * (sigma_z_m + estimate.sigma_sds_m(&self.base, far_m).1);
        let low_m = airspace.clamp_height_m(estimate.height_amsl_m - half_m);
        let high_m = airspace.clamp_height_m(estimate.height_amsl_m + half_m);
        let centre = estimate.source;
        let corner = |side: f64, height_m: f64| {
            Position::new(
                centre.east_m + side * reach_m,
                centre.north_m + side * reach_m,
                height_m,
            )
        };
        let (low, high) = (corner(-1.0, low_m), corner(1.0, high_m));
        let everywhere = airspace.clone();
        let sector_deg = if self.is_located() {
            SEARCH_SECTOR_DEG
        } else {
            180.0
        };
        let allowed = move |p: Position| {
            let off_deg = wrap_signed_deg(centre.bearing_deg(p.at) - estimate.axis_deg).abs();
            off_deg <= sector_deg
                && centre.distance_m(p.at) <= reach_m
                && airspace.contains(p, MARGIN_M)
        };
        let sector = Domain::new(low, high, allowed, &mut self.rng);
        // Where the sector is all outside the fence, the whole airspace is searched.
        let whole = move |p: Position| everywhere.contains(p, MARGIN_M);
        Ok(match sector {
            Ok(domain) => domain,
            Err(_) => {
                let (low, high) = self.fleet.airspace.bounds();
                Domain::new(low, high, whole, &mut self.rng)?
            }
        })
    }

    fn handle_message(&mut self, topic: &Topic, envelope: &Envelope, out: &mut Outbox) {
        match (topic, &envelope.message) {
            (Topic::State(name), Message::State(state)) => {
                self.handle_state(name, state, envelope.time, out);
            }
            (Topic::Reading(name), Message::Reading(reading)) => {
                self.handle_reading(name, reading, envelope.time, out);
            }
            (Topic::Mode(name), Message::Mode(mode)) => {
                self.handle_mode(name, mode, envelope.time, out);
            }
            (Topic::Control(name), Message::Control(control)) => {
                if let Some(index) = self.fleet.index_of(name) {
                    self.tasks.called[index] |= control.wish == ControlWish::Home;
                }
            }
            (Topic::Destination(name), Message::Destination(wished)) => self.wish(name, wished),
            (Topic::Model, Message::Model(model)) => self.handle_model(model),
            _ => {}
        }
    }

    /// Passes a wish of an external program for a vehicle's target to the strategy.
    fn wish(&mut self, name: &Name, wished: &Destination) {
        let at = self
            .fleet
            .airspace
            .frame()
            .to_enu(Geodetic::new(wished.lat_deg, wished.lon_deg));
        let height_m = wished.alt_amsl_m;
        let is_place = [at.east_m, at.north_m, height_m]
            .iter()
            .all(|v| v.is_finite());
        if let (Some(index), Some(strategy), true) =
            (self.fleet.index_of(name), &mut self.strategy, is_place)
        {
            strategy.wish(index, Position { at, height_m });
        }
    }

    fn handle_state(&mut self, name: &Name, state: &State, time: SimTime, out: &mut Outbox) {
        if let Some(index) = self.fleet.index_of(name) {
            self.fleet.observe(index, state, time);
            let real = state.kind == Kind::Real;
            if self.fleet.vehicles[index].real != real {
                self.swap(index, real, out);
            }
        } else if state.kind == Kind::Real && self.fleet.observe_other(name, state, time) {
            let words = format!(
                "vehicle {name} outside the team joined: its readings are used, and the team keeps clear of it"
            );
            out.event(&self.id, Severity::Info, "other-heard", words);
        }
    }

    /// Goes on with another aircraft in a vehicle's place: a real one for a simulated one, or the other way round. It
    /// has no orders yet, and where it stands on the ground it has to take off.
    fn swap(&mut self, index: usize, real: bool, out: &mut Outbox) {
        self.fleet.swap(index, real);
        let airborne = self.fleet.vehicles[index].track.is_some_and(|t| t.airborne);
        self.tasks.each[index] = match (airborne, self.phase) {
            (false, _) => VehicleTask::Parked,
            (true, Phase::Home) => VehicleTask::Returning,
            (true, _) => VehicleTask::Idle,
        };
        let what = if real { "a real" } else { "a simulated" };
        let name = &self.fleet.vehicles[index].name;
        let words = format!("vehicle {name} is now flown by {what} aircraft");
        out.event(&self.id, Severity::Info, "swapped", words);
    }

    fn handle_reading(&mut self, name: &Name, reading: &Reading, said: SimTime, out: &mut Outbox) {
        let real = reading.kind == Kind::Real;
        // A real vehicle need not be of the team to tell how the air is; a simulated one would tell of
        // nobody knows which world.
        if self.fleet.index_of(name).is_none() && !real {
            return;
        }
        let time = reading.read_at(said);
        let at = self
            .fleet
            .airspace
            .frame()
            .to_enu(Geodetic::new(reading.lat_deg, reading.lon_deg));
        let sample = Sample {
            position: Position {
                at,
                height_m: reading.alt_amsl_m,
            },
            value: reading.co2_ppm,
        };
        // Of a plume that real vehicles are still to show, simulated ones read nothing worth knowing.
        let too_early = self.phase == Phase::Preliminary && !real;
        // A reading that is not finite is left out.
        if too_early || self.archive.push(sample).is_err() {
            return;
        }
        self.sense(name, time, &sample, real);
        if !real {
            return;
        }
        let observation = Observation {
            vehicle: name.to_string(),
            time_ns: time.ns(),
            reading: reading.clone(),
        };
        out.say(Topic::Observation, Message::Observation(observation));
    }

    /// Lets the strategy learn what a vehicle of the team read: where there are real ones, theirs alone tell of the air that
    /// is searched.
    fn sense(&mut self, name: &Name, time: SimTime, sample: &Sample, real: bool) {
        if !real && self.fleet.has_real {
            return;
        }
        // What was fed in counts as the reading of one more.
        let id = self
            .fleet
            .index_of(name)
            .unwrap_or(self.fleet.vehicles.len());
        if let Some(strategy) = &mut self.strategy {
            strategy.sense(time.s(), id, sample, &mut self.rng);
        }
    }

    fn handle_mode(&mut self, name: &Name, mode: &Mode, time: SimTime, out: &mut Outbox) {
        let Some(index) = self.fleet.index_of(name) else {
            return;
        };
        let followed_before = std::mem::replace(
            &mut self.fleet.vehicles[index].follows_setpoints,
            mode.setpoints_obeyed,
        );
        match (followed_before, mode.setpoints_obeyed) {
            (true, false) => self.fleet.vehicles[index].not_ready_since = time,
            // Also where it follows as before: this controller may have missed the time between, in which the vehicle flew
            // elsewhere.
            (_, true) => self.fleet.repeat(index, out),
            (false, false) => {}
        }
    }

    fn handle_model(&mut self, model: &Model) {
        if self.model.as_ref() != Some(model) {
            self.take_up_sources(model);
            self.model = Some(model.clone());
            if let Some(estimate) = self.estimate() {
                self.approaches.turn_to(estimate.axis_deg);
            }
        }
    }

    /// Lets passes reach through the plumes of sources that the readings showed, beside the scenario's.
    fn take_up_sources(&mut self, model: &Model) {
        let Some(first) = self.base.sources.first().cloned() else {
            return;
        };
        let found = |m: &MechanismSetting| {
            let is_source = m.id == MechanismId::SecondSource.as_str();
            let of = |name: &str| m.parameters.get(name).filter(|_| is_source).copied();
            let (east_m, north_m) = (of("east_m")?, of("north_m")?);
            let place = Enu::new(first.place.east_m + east_m, first.place.north_m + north_m);
            let first = first.clone();
            Some(SourceSpec { place, ..first })
        };
        self.base.sources.truncate(self.scenario_sources);
        let found = model.mechanisms.iter().filter_map(found);
        self.base.sources.extend(found);
    }

    fn decide(&mut self, now: SimTime, out: &mut Outbox) {
        for (index, silent) in self.fleet.silences(now) {
            let name = &self.fleet.vehicles[index].name;
            let (severity, code, words) = if silent {
                (
                    Severity::Warning,
                    "vehicle-silent",
                    "stopped sending and is not planned for",
                )
            } else {
                (Severity::Info, "vehicle-heard", "sends again")
            };
            out.event(&self.id, severity, code, format!("vehicle {name} {words}"));
        }
        for name in self.fleet.others_gone(now) {
            let words = format!("vehicle {name} outside the team stopped sending");
            out.event(&self.id, Severity::Info, "other-silent", words);
        }
        self.fleet.begin_decision();
        self.command(now, out);
        self.fleet.end_decision();
        self.publish_plan(out);
    }

    /// Gives orders to the vehicles, and goes on to the next phase where it is due.
    fn command(&mut self, now: SimTime, out: &mut Outbox) {
        self.fly_patterns(now, out);
        if self.pattern.as_ref().is_some_and(PatternFlight::is_all) {
            return;
        }
        self.recall(now);
        if let Some(next) = self.next_phase(now) {
            self.enter_phase(next, now, out);
        }
        self.note_crossings(now);
        for index in 0..self.fleet.vehicles.len() {
            self.fleet.advance(index, out);
        }
        self.direct(now, out);
        let searches = !matches!(self.phase, Phase::TakeOff | Phase::Home);
        if searches && now >= self.next_population {
            self.next_population = SimTime::from_s(now.s() + self.search.step_s);
            self.search_step(out);
        }
    }

    fn enter_phase(&mut self, phase: Phase, now: SimTime, out: &mut Outbox) {
        self.phase = phase;
        let words = match phase {
            Phase::TakeOff => "take-off",
            Phase::Preliminary => "preliminary flight: real vehicles search for the plume",
            Phase::Search => "search: the team searches for the peak",
            Phase::Characterise => {
                "characterise: real vehicles pass where they learn most of the plume"
            }
            Phase::Flux => "flux: real vehicles fly a curtain of passes downwind",
            Phase::Home => "home",
        };
        out.event(&self.id, Severity::Info, "phase", words);
        if matches!(phase, Phase::Search | Phase::Characterise) && self.is_located() {
            // Now that the plume is better known, the sector is drawn anew.
            if let Ok(strategy) = self.new_strategy() {
                self.strategy = Some(strategy);
            }
        }
        if phase == Phase::Home {
            self.publish_findings(out);
        }
        self.tasks.start_phase(phase, &self.fleet);
        if phase == Phase::Characterise {
            self.publish_expected_precision(now, out);
        }
        if phase == Phase::Home {
            self.recall_all();
        }
    }

    fn search_step(&mut self, out: &mut Outbox) {
        let Some(mut strategy) = self.strategy.take() else {
            return;
        };
        self.generation += 1;
        let points = strategy.step(&self.archive, &mut self.rng);
        let frame = self.fleet.airspace.frame();
        let said = points.iter().map(|p| {
            let Geodetic { lat_deg, lon_deg } = frame.to_geodetic(p.position.at);
            protocol::message::PromisingPoint {
                lat_deg,
                lon_deg,
                alt_amsl_m: p.position.height_m,
                fitness_ppm: p.fitness,
            }
        });
        let population = Population {
            generation: self.generation,
            points: said.collect(),
        };
        out.say(Topic::Population, Message::Population(population));
        self.follow(strategy.as_mut(), out);
        self.strategy = Some(strategy);
    }

    /// Publishes the plan at every decision, changed or not: vehicles take it as the sign that
    /// somebody is in command, and go home without it.
    fn publish_plan(&self, out: &mut Outbox) {
        let plan = Plan {
            phase: self.phase,
            assignments: self.fleet.assignments(),
            peak: self.peak(),
        };
        out.say(Topic::Plan, Message::Plan(plan));
    }

    /// Publishes what was found so far, and how far readings stand behind it: the world simulator concludes at the end.
    fn publish_findings(&self, out: &mut Outbox) {
        let Some(model) = &self.model else { return };
        let Some(peak) = self.peak() else {
            let words = "no peak: the real readings do not follow any plume that the model allows"
                .to_owned();
            return out.event(&self.id, Severity::Warning, "peak-not-found", words);
        };
        let known = |e: Estimate| plus_minus(e.value, e.sd);
        let text = format!(
            "preliminary peak {} ppm at {:.5}, {:.5}, {:.0} m AMSL; H {} m AGL, axis towards {} degrees, c_max {} ppm \
             above background at {:.0} m",
            plus_minus(peak.co2_ppm, peak.sd_ppm),
            peak.lat_deg,
            peak.lon_deg,
            peak.alt_amsl_m,
            known(model.effective_height_agl_m),
            known(model.axis_deg),
            known(model.c_max_ppm),
            model.c_max_distance_m.value
        );
        let (severity, code) = match peak.status {
            PeakStatus::Confirmed => (Severity::Info, "peak-confirmed"),
            PeakStatus::Supported => (Severity::Info, "peak-supported"),
            PeakStatus::Doubtful | PeakStatus::NotFound => (Severity::Warning, "peak-doubtful"),
        };
        out.event(&self.id, severity, code, text);
    }
}

/// The vehicles with their homes and, above them, layers in the order of take-off: the first to
/// rise has the highest.
fn team(scenario: &Scenario, airspace: &Airspace) -> Result<Vec<TeamVehicle>, ScError> {
    let layers = scenario.layers_amsl_m();
    let vehicle = |(k, v): (usize, &scenario::tables::VehicleTable)| {
        let at = airspace.frame().to_enu(scenario.home(k)?);
        let home = Position {
            at,
            height_m: scenario.site.ground_amsl_m,
        };
        let real = v.kind != VehicleKind::Simulated;
        let mut vehicle = TeamVehicle::new(Name::new(&v.id)?, real, home, layers[k]);
        if v.kind == VehicleKind::Mavlink {
            vehicle.circle_m = LINKED_CIRCLE_M;
        }
        Ok(vehicle)
    };
    scenario.vehicles.iter().enumerate().map(vehicle).collect()
}

fn places(vehicles: &[TeamVehicle]) -> BTreeMap<Name, usize> {
    let names = vehicles.iter().map(|v| v.name.clone());
    names.zip(0..).collect()
}

impl Agent for SquadronController {
    fn id(&self) -> &AgentId {
        &self.id
    }

    fn interests(&self) -> Vec<Interest> {
        let vehicles = self.fleet.vehicles.iter();
        let to_vehicles = vehicles.flat_map(|v| {
            let name = || v.name.clone();
            [Topic::Control(name()), Topic::Destination(name())].map(Interest::One)
        });
        [
            Interest::AllStates,
            Interest::AllReadings,
            Interest::AllModes,
            Interest::One(Topic::Model),
        ]
        .into_iter()
        .chain(to_vehicles)
        .collect()
    }

    fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox) {
        match event {
            Event::Message(topic, envelope) => self.handle_message(topic, envelope, out),
            Event::Tick if now >= self.next_decision => {
                self.next_decision = SimTime::from_s(now.s() + DECISION_S);
                self.decide(now, out);
            }
            Event::Tick | Event::Computed(_) => {}
            Event::Stop => {
                if self.phase != Phase::Home {
                    self.publish_findings(out);
                }
                self.publish_plan(out);
            }
        }
    }
}
