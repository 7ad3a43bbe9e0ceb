//! Another aircraft in a vehicle's place while the mission runs: a real one for a simulated one, or the other way
//! round.

use crate::real_vehicle::LinkOptions;
use crate::{Member, MissionError, Setup};
use protocol::message::{ControlLevel, EventMessage, Severity, Swap};
use va::{SafetyMonitor, SimulatedConfig, SimulatedVehicle, VehicleBackend, VirtualAircraft};

impl Member {
    fn aircraft_mut(&mut self) -> Option<&mut VirtualAircraft> {
        match self {
            Self::World(_) | Self::Controller(_) | Self::Fed(_) => None,
            Self::Simulated(vehicle) => Some(vehicle),
            Self::Real(vehicle) => Some(vehicle.aircraft_mut()),
        }
    }

    /// What the operator wants in this vehicle's place, once.
    pub fn take_swap(&mut self) -> Option<Swap> {
        self.aircraft_mut()?.take_swap()
    }

    /// Answers the operator on the bus whether a swap was made.
    pub fn answer_swap(&mut self, made: Result<&str, &MissionError>) {
        let (severity, code, text) = match made {
            Ok(what) => (Severity::Info, "swapped", what.to_owned()),
            Err(why) => (Severity::Warning, "swap-refused", why.to_string()),
        };
        if let Some(aircraft) = self.aircraft_mut() {
            aircraft.tell(EventMessage {
                severity,
                code: code.to_owned(),
                text,
            });
        }
    }

    /// The member that flies on in place of this one, the vehicle at `index` of the team: a real aircraft behind a link
    /// that the caller serves, or a simulated one from where this one is.
    ///
    /// # Errors
    /// A vehicle that is what is asked for already; a real one that flies by itself, which nobody would have then.
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
                        "vehicle {name} was not heard: where it is is not known"
                    ));
                };
                if state.airborne && !pilot {
                    return refuse(format!(
                        "the real vehicle {name} is in the air and nobody flies it: its pilot takes it over first, or it lands"
                    ));
                }
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
                Ok(Self::Simulated(Box::new(VirtualAircraft::new(
                    name, body, watch,
                )?)))
            }
            (Self::Simulated(_), None) => refuse(format!("vehicle {name} is simulated already")),
            (Self::Real(_), Some(_)) => refuse(format!("vehicle {name} is real already")),
            (Self::World(_) | Self::Controller(_) | Self::Fed(_), _) => {
                refuse(format!("{name} is no vehicle of the team"))
            }
        }
    }
}
