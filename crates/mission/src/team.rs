//! The agents that a scenario asks for.

use crate::fed_vehicle::FedVehicle;
use crate::real_vehicle::{LinkOptions, RealVehicle};
use crate::{MissionError, Setup};
use protocol::{Agent, AgentId, Event, Interest, Outbox, SimTime};
use sc::SquadronController;
use scenario::tables::VehicleKind;
use va::{SafetyMonitor, SimulatedConfig, SimulatedVehicle, VehicleBackend, VirtualAircraft};
use ws::{WorldSimulator, WorldSimulatorConfig};

/// One agent of a mission.
pub enum Member {
    /// The world simulator.
    World(Box<WorldSimulator>),
    /// The squadron controller.
    Controller(Box<SquadronController>),
    /// A simulated vehicle.
    Simulated(Box<VirtualAircraft>),
    /// A real vehicle, or a stand-in for one.
    Real(Box<RealVehicle>),
    /// A vehicle that is not of the team, and of which there is only what it read.
    Fed(Box<FedVehicle>),
}

impl Member {
    /// The world simulator of a mission.
    ///
    /// # Errors
    /// A scenario that describes no world.
    pub fn world(setup: &Setup) -> Result<Self, MissionError> {
        let config = WorldSimulatorConfig {
            scenario: setup.scenario.clone(),
            wind_series: setup.wind_series.clone(),
            terrain: setup.terrain.clone(),
        };
        Ok(Self::World(Box::new(WorldSimulator::new(config)?)))
    }

    /// The squadron controller of a mission.
    ///
    /// # Errors
    /// A scenario that it refuses.
    pub fn controller(setup: &Setup) -> Result<Self, MissionError> {
        let controller = setup.controller()?;
        Ok(Self::Controller(Box::new(controller)))
    }

    /// The vehicle at `index` of the team; a `mavlink` vehicle's link is the caller's to serve.
    ///
    /// # Errors
    /// A vehicle that cannot fly.
    pub fn vehicle(setup: &Setup, index: usize) -> Result<Self, MissionError> {
        Self::vehicle_among(setup, index, &setup.scenario.layers_amsl_m())
    }

    /// The same, of a team whose layers ([`Scenario::layers_amsl_m`](scenario::Scenario::layers_amsl_m)) are known.
    ///
    /// # Errors
    /// As [`Self::vehicle`].
    pub fn vehicle_among(
        setup: &Setup,
        index: usize,
        layers_amsl_m: &[f64],
    ) -> Result<Self, MissionError> {
        let aircraft = setup.aircraft_of(index)?;
        let vehicle = &setup.scenario.vehicles[index];
        Ok(match vehicle.kind {
            VehicleKind::Simulated => {
                let config = SimulatedConfig {
                    scenario: &setup.scenario,
                    index,
                    aircraft,
                    ground_amsl_m: setup.ground_at_home_m(index)?,
                    layer_amsl_m: layers_amsl_m[index],
                };
                let body = VehicleBackend::Simulated(Box::new(SimulatedVehicle::new(config)?));
                let watch = SafetyMonitor::new(&setup.scenario, index)?;
                Self::Simulated(Box::new(VirtualAircraft::new(&vehicle.id, body, watch)?))
            }
            VehicleKind::StandIn => Self::Real(Box::new(RealVehicle::with_stand_in(setup, index)?)),
            VehicleKind::Mavlink => Self::linked(setup, index, &LinkOptions::default())?,
        })
    }

    /// The vehicle at `index` of the team behind links that the caller serves, whatever the scenario says of its kind.
    ///
    /// # Errors
    /// A scenario that describes no air.
    pub fn linked(
        setup: &Setup,
        index: usize,
        options: &LinkOptions,
    ) -> Result<Self, MissionError> {
        let vehicle = RealVehicle::with_link(setup, index, options)?;
        Ok(Self::Real(Box::new(vehicle)))
    }

    /// The vehicle that this member is, as the team sees it.
    pub fn aircraft(&self) -> Option<&VirtualAircraft> {
        match self {
            Self::World(_) | Self::Controller(_) | Self::Fed(_) => None,
            Self::Simulated(vehicle) => Some(vehicle),
            Self::Real(vehicle) => Some(vehicle.aircraft()),
        }
    }

    /// All agents of a mission.
    ///
    /// # Errors
    /// The first that cannot be made.
    pub fn all(setup: &Setup) -> Result<Vec<Self>, MissionError> {
        let mut team = vec![Self::world(setup)?, Self::controller(setup)?];
        let layers_amsl_m = setup.scenario.layers_amsl_m();
        for index in 0..setup.scenario.vehicles.len() {
            team.push(Self::vehicle_among(setup, index, &layers_amsl_m)?);
        }
        Ok(team)
    }

    fn agent(&self) -> &dyn Agent {
        match self {
            Self::World(agent) => agent.as_ref(),
            Self::Controller(agent) => agent.as_ref(),
            Self::Simulated(agent) => agent.as_ref(),
            Self::Real(agent) => agent.as_ref(),
            Self::Fed(agent) => agent.as_ref(),
        }
    }
}

/// Ids of all agents of a mission.
///
/// # Errors
/// A vehicle's id that cannot be part of a key.
pub fn agent_ids(setup: &Setup) -> Result<Vec<AgentId>, MissionError> {
    let mut ids = vec![AgentId::ws(), AgentId::sc()];
    for vehicle in &setup.scenario.vehicles {
        ids.push(AgentId::va(&vehicle.id)?);
    }
    Ok(ids)
}

impl Agent for Member {
    fn id(&self) -> &AgentId {
        self.agent().id()
    }

    fn interests(&self) -> Vec<Interest> {
        self.agent().interests()
    }

    fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox) {
        match self {
            Self::World(agent) => agent.handle(event, now, out),
            Self::Controller(agent) => agent.handle(event, now, out),
            Self::Simulated(agent) => agent.handle(event, now, out),
            Self::Real(agent) => agent.handle(event, now, out),
            Self::Fed(agent) => agent.handle(event, now, out),
        }
    }
}
