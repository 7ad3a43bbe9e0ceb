//! Another aircraft in a vehicle's place while the mission runs: a real one for a simulated one, or the other way
//! round; and what a vehicle goes on from whose process is started again.

use crate::real_vehicle::LinkOptions;
use crate::{Member, MissionError, Setup};
use protocol::message::{ControlLevel, EventMessage, Phase, Severity, State, Swap};
use protocol::{Agent as _, SimTime};
use va::{SafetyMonitor, SimulatedConfig, SimulatedVehicle, VehicleBackend, VirtualAircraft};

/// The simulated vehicle at `index` of the team, which goes on from `state`.
fn simulated_from(
    setup: &Setup,
    index: usize,
    state: &State,
) -> Result<VirtualAircraft, MissionError> {
    let config = SimulatedConfig {
        scenario: &setup.scenario,
        index,
        aircraft: setup.aircraft_of(index)?,
        ground_amsl_m: setup.ground_at_home_m(index)?,
        layer_amsl_m: setup.scenario.layers_amsl_m()[index],
    };
    let body = SimulatedVehicle::taking_over(config, state)?;
    let body = VehicleBackend::Simulated(Box::new(body));
    let watch = SafetyMonitor::new(&setup.scenario, index)?;
    Ok(VirtualAircraft::new(setup.name_of(index)?, body, watch)?)
}

/// The last messages of a vehicle or of the team, remembered by others for a process that restarts during a mission.
#[derive(Debug, Clone, Default)]
pub struct LastHeard {
    /// The vehicle's last state, and its time.
    pub state: Option<(SimTime, State)>,
    /// Its control level.
    pub level: Option<ControlLevel>,
    /// The phase of the mission.
    pub phase: Option<Phase>,
}

impl Member {
    /// Goes on at `now` with what others last heard, instead of beginning anew; says in words what it goes on with, or
    /// nothing where it begins.
    ///
    /// # Errors
    /// A stand-in in the air: its aircraft and its air were in the memory of its process alone, and so it is lost.
    pub fn resume(
        &mut self,
        setup: &Setup,
        heard: &LastHeard,
        now: SimTime,
    ) -> Result<Option<String>, MissionError> {
        match self {
            Self::Controller(controller) => {
                let Some(phase) = heard.phase else {
                    return Ok(None);
                };
                controller.resume(phase, now);
                Ok(Some(format!(
                    "resumes at {:.0} s in phase {phase:?}, with the messages from now on",
                    now.s()
                )))
            }
            Self::Simulated(vehicle) => {
                let Some((said, state)) = &heard.state else {
                    return Ok(None);
                };
                let index = setup.index_of(vehicle.id().name().as_str())?;
                let mut next = simulated_from(setup, index, state)?;
                let level = heard.level.unwrap_or(ControlLevel::Automatic);
                next.resume(level, state, now);
                let text = format!(
                    "resumes from its last state, {:.0} s old, in {level:?}",
                    now.since_s(*said)
                );
                next.tell(EventMessage::new(
                    Severity::Warning,
                    "resumed",
                    text.clone(),
                ));
                **vehicle = next;
                Ok(Some(text))
            }
            Self::Real(vehicle) if vehicle.is_stand_in() => match &heard.state {
                Some((_, state)) if state.airborne => Err(MissionError::Request(format!(
                    "{} was in the air when its process ended; a stand-in cannot be resumed, so it is lost",
                    vehicle.aircraft().id()
                ))),
                _ => Ok(None),
            },
            // A real vehicle reports its own state; the world and fed vehicles begin anew.
            Self::Real(_) | Self::World(_) | Self::Fed(_) => Ok(None),
        }
    }

    fn aircraft_mut(&mut self) -> Option<&mut VirtualAircraft> {
        match self {
            Self::World(_) | Self::Controller(_) | Self::Fed(_) => None,
            Self::Simulated(vehicle) => Some(vehicle),
            Self::Real(vehicle) => Some(vehicle.aircraft_mut()),
        }
    }

    /// Takes the operator's order to replace this vehicle, once.
    pub fn take_swap(&mut self) -> Option<Swap> {
        self.aircraft_mut()?.take_swap()
    }

    /// Whether the operator has ended the heartbeat to the real aircraft that this vehicle replaces; true once.
    pub fn take_release(&mut self) -> bool {
        self.aircraft_mut()
            .is_some_and(VirtualAircraft::take_release)
    }

    /// Answers the operator on the bus whether a swap was made.
    pub fn answer_swap(&mut self, made: Result<&str, &MissionError>) {
        let (code, text) = match made {
            Ok(what) => ("swapped", what.to_owned()),
            Err(why) => ("swap-refused", why.to_string()),
        };
        self.answer(made.is_ok(), code, text);
    }

    /// Reports to the operator on the bus whether the heartbeat to a released aircraft has ended.
    pub fn answer_release(&mut self, ended: bool, text: &str) {
        let code = if ended { "released" } else { "release-refused" };
        self.answer(ended, code, text.to_owned());
    }

    fn answer(&mut self, done: bool, code: &str, text: String) {
        let severity = if done {
            Severity::Info
        } else {
            Severity::Warning
        };
        if let Some(aircraft) = self.aircraft_mut() {
            aircraft.tell(EventMessage::new(severity, code, text));
        }
    }

    /// The member that flies on in place of this one, the vehicle at `index` of the team: a real aircraft behind a link
    /// that the caller serves, or a simulated one from where this one is.
    ///
    /// # Errors
    /// A vehicle of the requested kind already; a real one in automatic flight, which would lose its commander.
    pub fn swapped(&self, setup: &Setup, index: usize, swap: &Swap) -> Result<Self, MissionError> {
        let name = setup.name_of(index)?;
        let refuse = |why: String| Err(MissionError::Request(why));
        match (self, &swap.link) {
            (Self::Simulated(_), Some(_)) => {
                let options = LinkOptions {
                    may_arm: swap.may_arm,
                    ..LinkOptions::default()
                };
                Self::linked(setup, index, &options)
            }
            (Self::Real(real), None) => {
                let VehicleBackend::Bridged(body) = real.aircraft().backend() else {
                    return refuse(format!("vehicle {name} has no bridge"));
                };
                let pilot = real.aircraft().level() == Some(ControlLevel::Pilot);
                let Some(state) = body.last_state() else {
                    return refuse(format!(
                        "vehicle {name} has sent no state; its position is unknown"
                    ));
                };
                if state.airborne && !pilot {
                    return refuse(format!(
                        "the real vehicle {name} is in the air; its pilot must take over or land it first"
                    ));
                }
                Ok(Self::Simulated(Box::new(simulated_from(
                    setup, index, state,
                )?)))
            }
            (Self::Simulated(_), None) => refuse(format!("vehicle {name} is simulated already")),
            (Self::Real(_), Some(_)) => refuse(format!("vehicle {name} is real already")),
            (Self::World(_) | Self::Controller(_) | Self::Fed(_), _) => {
                refuse(format!("{name} is not a vehicle of the team"))
            }
        }
    }
}
