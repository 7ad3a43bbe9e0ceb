//! A mission in miniature around the squadron controller: vehicles that are points with a speed,
//! a turn rate and a climb rate, readings from a plume, and a model that starts with the
//! scenario's error and is told the truth bit by bit.
#![allow(clippy::unwrap_used, dead_code)] // helpers of tests; each test uses some

use air::geo::{Enu, Geodetic, wrap_signed_deg};
use csea::Position;
use plume::DispersionModel;
use protocol::key::Name;
use protocol::message::{
    ControlLevel, Estimate, Flux, FluxMethod, Mode, Model, PathKind, Peak, PeakStatus, Phase,
    Reading, Setpoint, State, VehicleKind,
};
use protocol::{Agent, AgentId, Envelope, Event, Message, Outbox, SimTime, Topic};
use sc::SquadronController;
use scenario::Scenario;
use scenario::airspace::{Airspace, SETPOINT_MARGIN_M};
use scenario::peak::highest_of;

pub const TURN_DEG_S: f64 = 22.0;
pub const CLIMB_M_S: f64 = 2.5;
/// Above the background by this a reading is of the plume, ppm.
const PLUME_PPM: f64 = 30.0;

/// A point that flies.
pub struct Point {
    pub name: Name,
    pub real: bool,
    pub at: Position,
    pub heading_deg: f64,
    pub airborne: bool,
    pub obeys: bool,
    pub order: Option<Setpoint>,
}

/// A setpoint as it was said, with where its vehicle was.
pub struct SentSetpoint {
    pub time_s: f64,
    pub vehicle: usize,
    pub from: Position,
    pub path: PathKind,
    pub to: Position,
}

pub struct Miniature {
    pub scenario: Scenario,
    pub airspace: Airspace,
    pub controller: SquadronController,
    pub reality: DispersionModel,
    pub team: Vec<Point>,
    pub sent: Vec<SentSetpoint>,
    pub phases: Vec<(f64, Phase)>,
    pub events: Vec<String>,
    pub observations: usize,
    /// How far readings stand behind the peak once enough was read.
    pub status: PeakStatus,
    pub time_s: f64,
    read_plume: bool,
    sequence: u64,
}

impl Miniature {
    pub fn new(scenario: Scenario) -> Self {
        let controller = SquadronController::new(&scenario).unwrap();
        let airspace = Airspace::of(&scenario).unwrap();
        let team = scenario.vehicles.iter().enumerate().map(|(k, v)| {
            let at = airspace.frame().to_enu(scenario.home(k).unwrap());
            Point {
                name: Name::new(&v.id).unwrap(),
                real: v.kind != scenario::tables::VehicleKind::Simulated,
                at: Position {
                    at,
                    height_m: scenario.site.ground_amsl_m,
                },
                heading_deg: scenario.weather.wind_from_deg,
                airborne: false,
                obeys: true,
                order: None,
            }
        });
        Self {
            team: team.collect(),
            reality: scenario.in_reality().dispersion_model().unwrap(),
            controller,
            airspace,
            sent: Vec::new(),
            phases: vec![(0.0, Phase::TakeOff)],
            events: Vec::new(),
            observations: 0,
            status: PeakStatus::Supported,
            time_s: 0.0,
            read_plume: false,
            sequence: 0,
            scenario,
        }
    }

    /// Where a vehicle of the team is at home.
    pub fn home_of(&self, vehicle: usize) -> Position {
        Position {
            at: self
                .airspace
                .frame()
                .to_enu(self.scenario.home(vehicle).unwrap()),
            height_m: self.scenario.site.ground_amsl_m,
        }
    }

    /// Hands one message to the controller.
    pub fn hand(&mut self, topic: Topic, sender: AgentId, message: Message) {
        self.sequence += 1;
        let now = SimTime::from_s(self.time_s);
        let envelope = Envelope {
            sender,
            sequence: self.sequence,
            time: now,
            message,
        };
        let mut out = Outbox::default();
        let event = Event::Message(&topic, &envelope);
        self.controller.handle(event, now, &mut out);
        self.take(&mut out);
    }

    fn take(&mut self, out: &mut Outbox) {
        for (topic, message) in out.drain() {
            match (topic, message) {
                (Topic::Setpoint(name), Message::Setpoint(setpoint)) => {
                    let vehicle = self.team.iter().position(|p| p.name == name).unwrap();
                    let at = self.airspace.frame().to_enu(Geodetic {
                        lat_deg: setpoint.lat_deg,
                        lon_deg: setpoint.lon_deg,
                    });
                    let to = Position {
                        at,
                        height_m: setpoint.alt_amsl_m,
                    };
                    let from = self.team[vehicle].at;
                    let (time_s, path) = (self.time_s, setpoint.path);
                    self.sent.push(SentSetpoint {
                        time_s,
                        vehicle,
                        from,
                        path,
                        to,
                    });
                    self.team[vehicle].order = Some(setpoint);
                }
                (Topic::Plan, Message::Plan(plan))
                    if self.phases.last().unwrap().1 != plan.phase =>
                {
                    self.phases.push((self.time_s, plan.phase));
                }
                (Topic::Event(_), Message::Event(e)) => {
                    self.events.push(format!("{}: {}", e.code, e.text));
                }
                (Topic::Observation, Message::Observation(_)) => self.observations += 1,
                _ => {}
            }
        }
    }

    /// One second: vehicles move, say where they are and what they read; the model is said every
    /// ten seconds; the controller ticks.
    pub fn second(&mut self) {
        self.time_s += 1.0;
        for k in 0..self.team.len() {
            self.fly(k);
            let (state, reading) = self.words(k);
            let clean_ppm = self.scenario.background.ppm(self.scenario.gas());
            self.read_plume |= self.team[k].real && reading.co2_ppm > clean_ppm + PLUME_PPM;
            let name = self.team[k].name.clone();
            let va = AgentId::va(name.as_str()).unwrap();
            self.hand(
                Topic::State(name.clone()),
                va.clone(),
                Message::State(state),
            );
            self.hand(Topic::Reading(name), va, Message::Reading(reading));
        }
        if self.time_s % 10.0 == 0.0 {
            let model = self.model();
            self.hand(Topic::Model, AgentId::ws(), Message::Model(Box::new(model)));
        }
        let mut out = Outbox::default();
        self.controller
            .handle(Event::Tick, SimTime::from_s(self.time_s), &mut out);
        self.take(&mut out);
    }

    /// The whole mission.
    pub fn run(&mut self) {
        while self.time_s < self.scenario.mission.duration_s {
            self.second();
        }
    }

    /// The reality's own peak, as it stands once enough was read.
    fn peak(&self, seen: f64) -> Option<Peak> {
        let highest = highest_of(&self.reality, &self.airspace, SETPOINT_MARGIN_M, 0.0)?;
        let at = self.airspace.frame().to_geodetic(highest.position.at);
        Some(Peak {
            lat_deg: at.lat_deg,
            lon_deg: at.lon_deg,
            alt_amsl_m: highest.position.height_m,
            co2_ppm: highest.co2_ppm,
            sd_ppm: 30.0,
            time_s: self.time_s,
            status: match seen {
                _ if !self.read_plume && self.team.iter().any(|p| p.real) => PeakStatus::NotFound,
                seen if seen < 1.0 => PeakStatus::Doubtful,
                _ => self.status,
            },
        })
    }

    /// The scenario's model, going over to the reality's while real readings come in.
    fn model(&self) -> Model {
        let (prior, reality) = (&self.scenario, self.scenario.in_reality());
        let seen = (self.observations as f64 / 400.0).min(1.0);
        let mix = |a: f64, b: f64, sd: f64| Estimate {
            value: a + seen * (b - a),
            sd: sd * (1.0 - 0.98 * seen),
        };
        let source = |s: &Scenario| s.sources[0].clone();
        let (a, b) = (source(prior), source(&reality));
        let toward = |s: &Scenario| air::wind::towards_deg(s.weather.wind_from_deg);
        let turn_deg = wrap_signed_deg(toward(&reality) - toward(prior));
        let c_max = |s: &scenario::tables::SourceTable| s.c_max_ppm.unwrap_or(400.0);
        let distance_m = a.c_max_distance_m.unwrap_or(2000.0);
        Model {
            background_ppm: mix(
                prior.background.ppm(prior.gas()),
                reality.background.ppm(reality.gas()),
                4.0,
            ),
            effective_height_agl_m: mix(a.axis_height_agl_m(), b.axis_height_agl_m(), 50.0),
            axis_deg: mix(toward(prior), toward(prior) + turn_deg, 12.0),
            c_max_ppm: mix(c_max(&a), c_max(&b), 100.0),
            c_max_distance_m: Estimate {
                value: distance_m,
                sd: 0.0,
            },
            sigma_y_scale: mix(prior.plume.sigma_y_scale, reality.plume.sigma_y_scale, 0.3),
            sigma_z_scale: mix(prior.plume.sigma_z_scale, reality.plume.sigma_z_scale, 0.3),
            wind_speed_m_s: prior.weather.wind_speed_m_s.max(0.5),
            observations: self.observations as u64,
            mechanisms: Vec::new(),
            peak: self.peak(seen),
            flux: vec![Flux {
                source: a.name.clone(),
                method: FluxMethod::Inference,
                kg_s: mix(100.0, 100.0, 100.0),
            }],
        }
    }

    fn words(&self, k: usize) -> (State, Reading) {
        let p = &self.team[k];
        let Geodetic { lat_deg, lon_deg } = self.airspace.frame().to_geodetic(p.at.at);
        let (sin, cos) = p.heading_deg.to_radians().sin_cos();
        let speed = if p.airborne {
            self.scenario.search.airspeed_m_s
        } else {
            0.0
        };
        let kind = if p.real {
            VehicleKind::Real
        } else {
            VehicleKind::Simulated
        };
        let state = State {
            kind,
            lat_deg,
            lon_deg,
            alt_amsl_m: p.at.height_m,
            vel_ned_m_s: [speed * cos, speed * sin, 0.0],
            roll_deg: 0.0,
            pitch_deg: 0.0,
            heading_deg: p.heading_deg,
            airspeed_m_s: speed,
            throttle: 0.5,
            airborne: p.airborne,
        };
        let place = plume::Place {
            east_m: p.at.at.east_m,
            north_m: p.at.at.north_m,
            height_agl_m: p.at.height_m - self.scenario.site.ground_amsl_m,
        };
        let reading = Reading {
            kind,
            lat_deg,
            lon_deg,
            alt_amsl_m: p.at.height_m,
            co2_ppm: self.reality.mean_ppm(&place, self.time_s),
            wind_speed_m_s: None,
            wind_from_deg: None,
            temperature_c: None,
            pressure_hpa: None,
            time_ns: None,
        };
        (state, reading)
    }

    /// Points fly straight to their setpoint and circle it; a point that nobody has told
    /// anything, or whom a pilot flies, goes on as it is.
    fn fly(&mut self, k: usize) {
        let speed = self.scenario.search.airspeed_m_s;
        let ground_m = self.scenario.site.ground_amsl_m;
        let frame = *self.airspace.frame();
        let p = &mut self.team[k];
        let Some(order) = p.order.as_ref().filter(|_| p.obeys) else {
            return;
        };
        let to = frame.to_enu(Geodetic {
            lat_deg: order.lat_deg,
            lon_deg: order.lon_deg,
        });
        let distance_m = p.at.at.distance_m(to);
        let lands = order.path == PathKind::Land;
        if lands && (distance_m < 150.0 || !p.airborne) && p.at.height_m < ground_m + 30.0 {
            p.airborne = false;
            p.at.height_m = ground_m;
            return;
        }
        p.airborne = p.airborne || order.path == PathKind::TakeOff;
        if !p.airborne {
            return;
        }
        let bearing_deg = p.at.at.bearing_deg(to);
        let wanted_deg = if distance_m < order.orbit_radius_m {
            bearing_deg + 90.0
        } else {
            bearing_deg
        };
        let turn_deg = wrap_signed_deg(wanted_deg - p.heading_deg);
        p.heading_deg += turn_deg.clamp(-TURN_DEG_S, TURN_DEG_S);
        p.at.at = p.at.at.displaced(p.heading_deg, speed);
        let climb_m = order.alt_amsl_m - p.at.height_m;
        p.at.height_m += climb_m.clamp(-CLIMB_M_S, CLIMB_M_S);
    }

    /// A pilot takes a vehicle over, or hands it back.
    pub fn pilot(&mut self, k: usize, flies: bool) {
        self.team[k].obeys = !flies;
        let mode = Mode {
            level: if flies {
                ControlLevel::Pilot
            } else {
                ControlLevel::Automatic
            },
            reason: String::new(),
            setpoints_obeyed: !flies,
        };
        let name = self.team[k].name.clone();
        let va = AgentId::va(name.as_str()).unwrap();
        self.hand(Topic::Mode(name), va, Message::Mode(mode));
    }
}

/// The reference scenario, with the last `real` of its vehicles stand-ins.
pub fn as_pontes(real: usize) -> Scenario {
    let text = include_str!("../../../../scenarios/as-pontes.toml");
    let mut scenario = Scenario::parse("as-pontes.toml", text).unwrap();
    let count = scenario.vehicles.len();
    for (k, v) in scenario.vehicles.iter_mut().enumerate() {
        v.kind = if k + real >= count {
            scenario::tables::VehicleKind::StandIn
        } else {
            scenario::tables::VehicleKind::Simulated
        };
    }
    scenario
}

/// Fails unless every setpoint and leg of the mission was safe.
pub fn assert_safe(mini: &Miniature) {
    let airspace = &mini.airspace;
    let (low_m, high_m) = airspace.height_band_amsl_m();
    for t in &mini.sent {
        if t.path == PathKind::Land {
            continue;
        }
        let what = format!(
            "{:.0} s, vehicle {}: {:?} to {:?}",
            t.time_s, t.vehicle, t.path, t.to
        );
        assert!(
            (low_m - 1e-6..=high_m + 1e-6).contains(&t.to.height_m),
            "{what}: height band"
        );
        // The orbit around the setpoint stays inside too.
        assert!(
            airspace.clearance_m(t.to.at) >= 80.0 - 1e-3,
            "{what}: fence or keep-out"
        );
        let starts_inside = airspace.clearance_m(t.from.at) > 0.0;
        if t.path == PathKind::GoTo && starts_inside {
            assert!(
                airspace.leg_is_clear(t.from.at, t.to.at, 0.0),
                "{what}: leg"
            );
        }
    }
}

/// Fails unless any two setpoints that stood at the same time were apart in height or distance.
pub fn assert_apart(mini: &Miniature) {
    let fence = &mini.scenario.fence;
    let mut standing: Vec<Option<&SentSetpoint>> = vec![None; mini.team.len()];
    for t in &mini.sent {
        standing[t.vehicle] = (t.path != PathKind::Land).then_some(t);
        for other in standing.iter().flatten().filter(|o| o.vehicle != t.vehicle) {
            if t.path == PathKind::Land {
                continue;
            }
            let far = other.to.at.distance_m(t.to.at) >= fence.separation_m - 1e-3;
            let gap_m = (other.to.height_m - t.to.height_m).abs();
            assert!(
                far || gap_m >= fence.separation_height_m - 1e-3,
                "{:.0} s: {} at {:?} and {} at {:?}",
                t.time_s,
                t.vehicle,
                t.to,
                other.vehicle,
                other.to
            );
        }
    }
}

/// A place of the plane.
pub fn enu(east_m: f64, north_m: f64) -> Enu {
    Enu { east_m, north_m }
}
