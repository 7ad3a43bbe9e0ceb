//! A real vehicle's agent: the virtual aircraft, the bridge to its MAVLink, and, where no
//! hardware is, the stand-in behind that link, all in one process and in step with the mission.
//! The team sees of it what any real aircraft would show.

use crate::released::ReleasedAircraft;
use crate::{MissionError, Setup, preflight};
use mav_bridge::arduplane::ARDUPLANE;
use mav_bridge::px4::PX4;
use mav_bridge::signing::SigningConfig;
use mav_bridge::wire::LinkStatistics;
use mav_bridge::{
    AttitudeTarget, Bridge, BridgeConfig, BridgeOutput, Expectation, GasClock, GasInput,
};
use protocol::control_level::{ControlEvent, Danger};
use protocol::key::Name;
use protocol::message::{EventMessage, Health, MavlinkFrame, Mode, Severity};
use protocol::{Agent, AgentId, Event, Interest, Message, Outbox, SimTime, Topic};
use scenario::random::stream;
use scenario::tables::{AutopilotKind, GasTime, OuterLoopKind};
use stand_in::StandIn;
use va::{
    BridgedVehicle, OuterLoop, SafetyMonitor, VehicleBackend, VehicleReport, VirtualAircraft,
};

/// The other end of the MAVLink link.
enum FarEnd {
    /// A stand-in in this process.
    StandIn(Box<StandIn>),
    /// A link of the owner's: bytes are handed in and taken out by [`RealVehicle::link`].
    Link(LinkBuffers),
}

/// Bytes on their way between a bridge and the links to its vehicle, which the owner counts from 0.
#[derive(Debug, Default)]
pub struct LinkBuffers {
    /// Bytes that came from the vehicle, with the link over which they came.
    pub from_vehicle: Vec<(usize, Vec<u8>)>,
    /// Frames to send to the vehicle.
    pub to_vehicle: Vec<Vec<u8>>,
    /// The link that they go over but for those that go over all ([`mav_bridge::goes_over_all_links`]).
    pub best_link: usize,
    /// What came over a link that several vehicles share and was no frame of anybody's, so that it is not among
    /// the bytes: so far, and for one of the vehicles alone.
    pub no_frames: LinkStatistics,
    /// Notices about the links for the team, such as an ignored sender.
    pub notices: Vec<String>,
    /// Notices for the person at the vehicle.
    pub news: Vec<EventMessage>,
}

/// Options of a link that replace the scenario's.
#[derive(Debug, Clone, Default)]
pub struct LinkOptions {
    /// Whether the bridge may arm the motor; also if the scenario allows it.
    pub may_arm: bool,
    /// Nothing at all is sent to the vehicle.
    pub listen_only: bool,
    /// Send only requests; log every other frame.
    pub dry_run: bool,
    /// Whether parameters that the checklist finds wrong are set on board.
    pub set_parameters: bool,
    /// Whether the mission's fence is put on board.
    pub set_fence: bool,
    /// MAVLink system of the vehicle.
    pub system_id: Option<u8>,
    /// MAVLink component of its autopilot.
    pub component_id: Option<u8>,
    /// MAVLink system of the bridge as a ground station.
    pub gcs_system_id: Option<u8>,
}

/// A real vehicle of the team.
pub struct RealVehicle {
    va: VirtualAircraft,
    name: Name,
    bridge: Bridge,
    /// The team's outer loop, if that steers it.
    outer_loop: Option<OuterLoop>,
    far_end: FarEnd,
    output: BridgeOutput,
    handed_back: bool,
    /// Time of the next health message.
    next_health: SimTime,
    /// The mission has ended; the vehicle still has to land.
    over: bool,
}

impl RealVehicle {
    /// The vehicle at `index` of the team with a stand-in behind its bridge.
    ///
    /// # Errors
    /// A scenario or aircraft that the stand-in refuses.
    pub(crate) fn with_stand_in(setup: &Setup, index: usize) -> Result<Self, MissionError> {
        let scenario = &setup.scenario;
        let config = setup.stand_in_config(index)?;
        let name = setup.name_of(index)?;
        let rng = stream(scenario.mission.seed, &format!("stand-in/{name}"));
        let stand_in = StandIn::new(config, rng)?;
        // No person arms a stand-in.
        let bridge = BridgeConfig {
            may_arm: true,
            vehicle_system_id: Some(stand_in.system_id()),
            ..bridge_config(setup, index)?
        };
        Self::new(setup, index, bridge, FarEnd::StandIn(Box::new(stand_in)))
    }

    /// The vehicle at `index` of the team behind links that the owner serves.
    ///
    /// # Errors
    /// A scenario that describes no air.
    pub(crate) fn with_link(
        setup: &Setup,
        index: usize,
        options: &LinkOptions,
    ) -> Result<Self, MissionError> {
        let of_scenario = bridge_config(setup, index)?;
        let bridge = BridgeConfig {
            may_arm: options.may_arm || of_scenario.may_arm,
            listen_only: options.listen_only,
            dry_run: options.dry_run,
            set_parameters: options.set_parameters,
            set_fence: options.set_fence,
            expectation: Some(expectation(setup, index)?),
            vehicle_system_id: options.system_id.or(of_scenario.vehicle_system_id),
            vehicle_component_id: options
                .component_id
                .unwrap_or(of_scenario.vehicle_component_id),
            system_id: options.gcs_system_id.unwrap_or(of_scenario.system_id),
            ..of_scenario
        };
        Self::new(setup, index, bridge, FarEnd::Link(LinkBuffers::default()))
    }

    fn new(
        setup: &Setup,
        index: usize,
        bridge: BridgeConfig,
        far_end: FarEnd,
    ) -> Result<Self, MissionError> {
        let watch = SafetyMonitor::new(&setup.scenario, index)?;
        let name = setup.name_of(index)?;
        let aircraft = setup.aircraft_of(index)?;
        let surfaces = aircraft.fixed_wing().map(|fixed_wing| fixed_wing.surfaces);
        let body = BridgedVehicle::new(surfaces);
        let body = VehicleBackend::Bridged(Box::new(body));
        let outer_loop = bridge
            .attitude_targets
            .then(|| OuterLoop::new(&setup.scenario, aircraft));
        Ok(Self {
            va: VirtualAircraft::new(name, body, watch)?,
            name: Name::new(name)?,
            bridge: Bridge::new(bridge)?,
            outer_loop: outer_loop.transpose()?,
            far_end,
            output: BridgeOutput::default(),
            handed_back: false,
            next_health: SimTime::ZERO,
            over: false,
        })
    }

    /// The configured MAVLink system id; none accepts the one received.
    pub fn system_id(&self) -> Option<u8> {
        self.bridge.system_id()
    }

    /// Whether a stand-in of this process is at the far end, and no link.
    pub fn is_stand_in(&self) -> bool {
        matches!(self.far_end, FarEnd::StandIn(_))
    }

    /// Whether its autopilot has been received.
    pub fn is_heard(&self) -> bool {
        self.bridge.is_heard()
    }

    /// From now on frames to the vehicle are signed, and unsigned ones from it refused.
    pub fn sign(&mut self, config: SigningConfig) {
        self.bridge.sign(config);
    }

    /// The vehicle as the team sees it.
    pub fn aircraft(&self) -> &VirtualAircraft {
        &self.va
    }

    pub(crate) fn aircraft_mut(&mut self) -> &mut VirtualAircraft {
        &mut self.va
    }

    /// The owner's end of the link; none where a stand-in is at the far end.
    pub fn link(&mut self) -> Option<&mut LinkBuffers> {
        match &mut self.far_end {
            FarEnd::StandIn(_) => None,
            FarEnd::Link(buffers) => Some(buffers),
        }
    }

    /// Returns the vehicle to automatic flight, on behalf of its pilot or operator.
    pub fn hand_back(&mut self) {
        self.handed_back = true;
    }

    /// Ends the mission: the vehicle comes home to land, unless it is down or under other control.
    pub fn mission_over(&mut self) {
        self.over = true;
    }

    /// Whether there is a vehicle behind a link that is in the air or armed: its bridge must stay until it is not,
    /// but for one that sends it nothing.
    pub fn is_up(&self) -> bool {
        let is_missed = matches!(self.far_end, FarEnd::Link(_)) && !self.bridge.is_onlooker();
        is_missed && self.bridge.is_up()
    }

    /// The aircraft without its place in the team; none if it was never received, or gets no heartbeat.
    pub fn release(self) -> Option<ReleasedAircraft> {
        match self.far_end {
            FarEnd::Link(link) if self.bridge.is_heard() && !self.bridge.is_onlooker() => {
                Some(ReleasedAircraft::new(self.bridge, link))
            }
            _ => None,
        }
    }

    /// The control level as published on the bus.
    fn mode(&self) -> Mode {
        let mode = va::control::mode(self.bridge.control(), &self.bridge.doing());
        Mode {
            setpoints_obeyed: self.bridge.follows_setpoints(),
            ..mode
        }
    }

    /// How the vehicle and its link are, once a second.
    fn health_if_due(&mut self, now: SimTime) -> Option<Box<Health>> {
        if now < self.next_health {
            return None;
        }
        self.next_health = SimTime::from_ns(now.ns().saturating_add(HEALTH_NS));
        Some(Box::new(self.bridge.health(now)))
    }

    /// One exchange over the link: receives the vehicle's frames, then sends.
    fn exchange(&mut self, now: SimTime, out: &mut Outbox) {
        self.output.clear();
        if std::mem::take(&mut self.handed_back) {
            self.bridge.hand_back(&mut self.output);
        }
        if self.over {
            self.bridge.mission_over(&mut self.output);
        }
        if let VehicleBackend::Bridged(body) = self.va.backend_mut() {
            for event in body.take_control_events() {
                // The others have finished: their silence is no danger.
                let finished =
                    [Danger::SquadronController, Danger::World].map(ControlEvent::Begins);
                if !(self.over && finished.contains(&event)) {
                    self.bridge.handle(event, &mut self.output);
                }
            }
            for setpoint in body.take_setpoints() {
                self.bridge.setpoint(&setpoint, now, &mut self.output);
            }
        }
        let to_vehicle = match &mut self.far_end {
            FarEnd::StandIn(stand_in) => {
                // Frames go out before those of this tick are read: a stand-in answers within the tick, as the
                // far end of a fast link would, and always in the same order.
                self.bridge.tick(now, &mut self.output);
                let to_vehicle = std::mem::take(&mut self.output.frames_to_vehicle);
                for bytes in &stand_in.step(now, &to_vehicle) {
                    self.bridge.receive(bytes, now, &mut self.output);
                }
                steer(
                    &mut self.bridge,
                    self.outer_loop.as_mut(),
                    now,
                    &mut self.output,
                );
                // Answers to frames just received are sent in the next exchange.
                let answers = std::mem::take(&mut self.output.frames_to_vehicle);
                for bytes in &stand_in.step(now, &answers) {
                    self.bridge.receive(bytes, now, &mut self.output);
                }
                [to_vehicle, answers].concat()
            }
            FarEnd::Link(buffers) => {
                self.bridge.no_frames(buffers.no_frames);
                for text in buffers.notices.drain(..) {
                    self.output.events.push(EventMessage {
                        severity: Severity::Warning,
                        code: "sender-ignored".to_owned(),
                        text,
                    });
                }
                // Received frames are processed before a silence is judged.
                for (link, bytes) in buffers.from_vehicle.drain(..) {
                    self.bridge
                        .receive_over(link, &bytes, now, &mut self.output);
                }
                steer(
                    &mut self.bridge,
                    self.outer_loop.as_mut(),
                    now,
                    &mut self.output,
                );
                self.bridge.tick(now, &mut self.output);
                let to_vehicle = std::mem::take(&mut self.output.frames_to_vehicle);
                buffers.best_link = self.bridge.best_link(now);
                buffers.to_vehicle.extend(to_vehicle.iter().cloned());
                buffers.news.extend(self.output.events.iter().cloned());
                to_vehicle
            }
        };
        self.publish_frames(to_vehicle, out);
    }

    fn publish_frames(&mut self, to_vehicle: Vec<Vec<u8>>, out: &mut Outbox) {
        for bytes in self.output.frames_from_vehicle.drain(..) {
            let frame = Message::Mavlink(MavlinkFrame { bytes });
            out.say(Topic::MavlinkRx(self.name.clone()), frame);
        }
        for bytes in to_vehicle {
            let frame = Message::Mavlink(MavlinkFrame { bytes });
            out.say(Topic::MavlinkTx(self.name.clone()), frame);
        }
    }
}

/// Lets the team's outer loop, where it has the vehicle, answer the state that has just come.
fn steer(
    bridge: &mut Bridge,
    outer_loop: Option<&mut OuterLoop>,
    now: SimTime,
    out: &mut BridgeOutput,
) {
    let Some(outer_loop) = outer_loop else {
        return;
    };
    if !bridge.takes_attitudes() {
        return outer_loop.rest();
    }
    let Some(state) = &out.state else {
        return;
    };
    let yaw_rad = state.heading_deg.to_radians();
    let wanted = outer_loop.step(state, bridge.steers_to(), now);
    if let Some(wanted) = wanted {
        let target = AttitudeTarget {
            roll_rad: wanted.bank_rad,
            pitch_rad: wanted.pitch_rad,
            yaw_rad,
            throttle: wanted.throttle,
        };
        bridge.attitude(&target, now, out);
    }
}

/// The mission's expectations of the vehicle at `index`.
fn expectation(setup: &Setup, index: usize) -> Result<Expectation, MissionError> {
    let scenario = &setup.scenario;
    let stacks = scenario.sources.iter().map(|s| s.stack_height_m);
    let frame = scenario.frame()?;
    let corners = scenario.fence_polygon()?;
    Ok(Expectation {
        home: scenario.home(index)?,
        home_amsl_m: setup.ground_at_home_m(index)?,
        airspeed_m_s: scenario.search.airspeed_m_s,
        least_over_ground_m_s: sc::controller::LEAST_OVER_GROUND_M_S,
        wind_m_s: preflight::strongest_wind_m_s(setup)?.1,
        stack_top_amsl_m: scenario.site.ground_amsl_m + stacks.fold(0.0, f64::max),
        fence: corners.iter().map(|at| frame.to_geodetic(*at)).collect(),
    })
}

/// How the bridge of the vehicle at `index` behaves by the scenario.
fn bridge_config(setup: &Setup, index: usize) -> Result<BridgeConfig, MissionError> {
    let scenario = &setup.scenario;
    let (vehicle, gas, usual) = (
        &scenario.vehicles[index],
        scenario.gas(),
        BridgeConfig::default(),
    );
    let inputs = vehicle
        .gas
        .iter()
        .filter(|input| input.gas.is_none_or(|of| of == gas))
        .map(|input| GasInput {
            name: input.name.clone(),
            component_id: input.component_id,
            scale: input.scale,
            offset_ppm: input.offset,
            clock: match input.time {
                GasTime::Vehicle => GasClock::Vehicle,
                GasTime::Arrival => GasClock::Arrival,
            },
        });
    Ok(BridgeConfig {
        profile: match vehicle.autopilot {
            AutopilotKind::Ardupilot => &ARDUPLANE,
            AutopilotKind::Px4 => &PX4,
        },
        attitude_targets: vehicle.outer_loop == OuterLoopKind::Plumage,
        atmosphere: scenario.atmosphere()?,
        gas,
        gas_inputs: inputs.collect(),
        may_arm: vehicle.may_arm,
        vehicle_system_id: vehicle.system_id,
        vehicle_component_id: vehicle.component_id.unwrap_or(usual.vehicle_component_id),
        system_id: vehicle.gcs_system_id.unwrap_or(usual.system_id),
        ..usual
    })
}

/// Interval of health messages, ns: battery and link change within seconds.
const HEALTH_NS: i64 = 1_000_000_000;

impl Agent for RealVehicle {
    fn id(&self) -> &AgentId {
        self.va.id()
    }

    fn interests(&self) -> Vec<Interest> {
        self.va.interests()
    }

    fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox) {
        if matches!(event, Event::Tick) {
            self.exchange(now, out);
            let news = VehicleReport {
                state: self.output.state.take(),
                readings: std::mem::take(&mut self.output.readings),
                mode: Some(self.mode()),
                health: self.health_if_due(now),
                events: std::mem::take(&mut self.output.events),
            };
            if let VehicleBackend::Bridged(body) = self.va.backend_mut() {
                body.receive(news);
            }
        }
        self.va.handle(event, now, out);
    }
}
