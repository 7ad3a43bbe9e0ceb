//! A real vehicle's agent: the virtual aircraft, the bridge to its MAVLink, and, where no
//! hardware is, the stand-in behind that link, all in one process and in step with the mission.
//! The team sees of it what any real aircraft would show.

use crate::{MissionError, Setup};
use mav_bridge::signing::SigningConfig;
use mav_bridge::{Bridge, BridgeConfig, BridgeOutput};
use protocol::key::Name;
use protocol::message::{MavlinkFrame, Mode};
use protocol::{Agent, AgentId, Event, Interest, Message, Outbox, SimTime, Topic};
use scenario::random::stream;
use stand_in::StandIn;
use va::{BridgeReport, BridgedVehicle, SafetyMonitor, VehicleBackend, VirtualAircraft};

/// What is at the far end of the MAVLink link.
enum FarEnd {
    /// A stand-in in this process.
    StandIn(Box<StandIn>),
    /// A link of the owner's: bytes are handed in and taken out by [`RealVehicle::link`].
    Link(LinkBuffers),
}

/// Bytes on their way between a bridge and a link.
#[derive(Debug, Default)]
pub struct LinkBuffers {
    /// Bytes that came from the vehicle.
    pub from_vehicle: Vec<Vec<u8>>,
    /// Frames to send to the vehicle.
    pub to_vehicle: Vec<Vec<u8>>,
}

/// A real vehicle of the team.
pub struct RealVehicle {
    va: VirtualAircraft,
    name: Name,
    bridge: Bridge,
    far_end: FarEnd,
    output: BridgeOutput,
    handed_back: bool,
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
        // Nobody stands beside a stand-in to arm it.
        let bridge = BridgeConfig {
            may_arm: true,
            ..bridge_config(setup)?
        };
        Self::new(setup, index, bridge, FarEnd::StandIn(Box::new(stand_in)))
    }

    /// The vehicle at `index` of the team behind a link that the owner serves; the bridge arms
    /// its motor if it `may_arm`.
    ///
    /// # Errors
    /// A scenario that describes no air.
    pub(crate) fn with_link(
        setup: &Setup,
        index: usize,
        may_arm: bool,
    ) -> Result<Self, MissionError> {
        Self::new(
            setup,
            index,
            BridgeConfig {
                may_arm,
                ..bridge_config(setup)?
            },
            FarEnd::Link(LinkBuffers::default()),
        )
    }

    fn new(
        setup: &Setup,
        index: usize,
        bridge: BridgeConfig,
        far_end: FarEnd,
    ) -> Result<Self, MissionError> {
        let watch = SafetyMonitor::new(&setup.scenario, index)?;
        let name = setup.name_of(index)?;
        let surfaces = setup.aircraft_of(index)?.surfaces;
        let body = VehicleBackend::Bridged(Box::new(BridgedVehicle::new(surfaces)));
        Ok(Self {
            va: VirtualAircraft::new(name, body, watch)?,
            name: Name::new(name)?,
            bridge: Bridge::new(bridge)?,
            far_end,
            output: BridgeOutput::default(),
            handed_back: false,
        })
    }

    /// From now on frames to the vehicle are signed, and unsigned ones from it refused.
    pub fn sign(&mut self, config: SigningConfig) {
        self.bridge.sign(config);
    }

    /// The vehicle as the team sees it.
    pub fn aircraft(&self) -> &VirtualAircraft {
        &self.va
    }

    /// The owner's end of the link; none where a stand-in is at the far end.
    pub fn link(&mut self) -> Option<&mut LinkBuffers> {
        match &mut self.far_end {
            FarEnd::StandIn(_) => None,
            FarEnd::Link(buffers) => Some(buffers),
        }
    }

    /// The pilot, or whoever answers for the vehicle, gives it back to automatic flight.
    pub fn hand_back(&mut self) {
        self.handed_back = true;
    }

    /// Who flies, as it is said on the bus.
    fn mode(&self) -> Mode {
        let mode = va::control::mode(self.bridge.control(), &self.bridge.doing());
        Mode {
            setpoints_obeyed: self.bridge.follows_setpoints(),
            ..mode
        }
    }

    /// One exchange over the link: what the vehicle said, then what it is told.
    fn exchange(&mut self, now: SimTime, out: &mut Outbox) {
        self.output.clear();
        if std::mem::take(&mut self.handed_back) {
            self.bridge.hand_back(&mut self.output);
        }
        if let VehicleBackend::Bridged(body) = self.va.backend_mut() {
            for event in body.take_control_events() {
                self.bridge.handle(event, &mut self.output);
            }
            for setpoint in body.take_setpoints() {
                self.bridge.setpoint(&setpoint, now, &mut self.output);
            }
        }
        // Frames go out before those of this tick are read: a stand-in answers within the tick, as the
        // far end of a fast link would, and always in the same order.
        self.bridge.tick(now, &mut self.output);
        let to_vehicle = std::mem::take(&mut self.output.frames_to_vehicle);
        let from_vehicle = match &mut self.far_end {
            FarEnd::StandIn(stand_in) => stand_in.step(now, &to_vehicle),
            FarEnd::Link(buffers) => {
                buffers.to_vehicle.extend(to_vehicle.iter().cloned());
                std::mem::take(&mut buffers.from_vehicle)
            }
        };
        for bytes in &from_vehicle {
            self.bridge.receive(bytes, now, &mut self.output);
        }
        // Answers to what was just heard go out at the next exchange.
        let answers = std::mem::take(&mut self.output.frames_to_vehicle);
        if let FarEnd::StandIn(stand_in) = &mut self.far_end {
            let more = stand_in.step(now, &answers);
            for bytes in &more {
                self.bridge.receive(bytes, now, &mut self.output);
            }
        } else if let FarEnd::Link(buffers) = &mut self.far_end {
            buffers.to_vehicle.extend(answers.iter().cloned());
        }
        self.publish_frames(to_vehicle.into_iter().chain(answers), out);
    }

    fn publish_frames(&mut self, to_vehicle: impl Iterator<Item = Vec<u8>>, out: &mut Outbox) {
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

fn bridge_config(setup: &Setup) -> Result<BridgeConfig, MissionError> {
    Ok(BridgeConfig {
        atmosphere: setup.scenario.atmosphere()?,
        gas: setup.scenario.gas(),
        ..BridgeConfig::default()
    })
}

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
            let news = BridgeReport {
                state: self.output.state.take(),
                reading: self.output.reading.take(),
                mode: Some(self.mode()),
                events: std::mem::take(&mut self.output.events),
            };
            if let VehicleBackend::Bridged(body) = self.va.backend_mut() {
                body.receive(news);
            }
        }
        self.va.handle(event, now, out);
    }
}
