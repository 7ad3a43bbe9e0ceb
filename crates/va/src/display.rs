//! The state of a vehicle for displays such as FlightGear.

use crate::agent::{VehicleBackend, VirtualAircraft};
use crate::safety_monitor::SafetyMonitor;
use air::isa::Atmosphere;
use fdm::FlightState;
use fdm::flightgear::{NetFdm, PACKET_BYTES};
use protocol::message::State;

impl VirtualAircraft {
    /// FlightGear's packet of the vehicle as it is now; none before a real vehicle's first
    /// position. A real vehicle's surfaces and angle of attack are not known and stand at zero.
    pub fn net_fdm(&self, unix_time_s: u32) -> Option<[u8; PACKET_BYTES]> {
        match self.backend() {
            VehicleBackend::Simulated(backend) => Some(backend.net_fdm(unix_time_s)),
            VehicleBackend::Bridged(backend) => {
                let state = backend.last_state()?;
                let packet = NetFdm {
                    lat_deg: state.lat_deg,
                    lon_deg: state.lon_deg,
                    ground_amsl_m: self.monitor().ground_amsl_m(),
                    // The standard atmosphere is accurate enough for an instrument's needle.
                    density_kg_m3: Atmosphere::standard().at(state.alt_amsl_m).density_kg_m3(),
                    unix_time_s,
                };
                Some(packet.encode(&flight_state(self.monitor(), state), backend.surfaces()))
            }
        }
    }
}

/// A flight state from the state on the bus.
fn flight_state(monitor: &SafetyMonitor, state: &State) -> FlightState {
    let place = monitor.locate(state).at;
    let angles = [state.roll_deg, state.pitch_deg, state.heading_deg].map(f64::to_radians);
    FlightState::seen(
        [place.north_m, place.east_m, state.alt_amsl_m],
        state.vel_ned_m_s,
        angles,
        state.airspeed_m_s,
        state.throttle,
        state.airborne,
    )
}
