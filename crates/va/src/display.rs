//! What a display such as FlightGear shows of a vehicle.

use crate::agent::{VehicleBackend, VirtualAircraft};
use crate::safety_monitor::SafetyMonitor;
use air::isa::Atmosphere;
use fdm::flightgear::{NetFdm, PACKET_BYTES};
use fdm::quaternion;
use fdm::{FlightFlags, FlightPhase, FlightState};
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
                    // A standard day is near enough for a needle.
                    density_kg_m3: Atmosphere::standard().at(state.alt_amsl_m).density_kg_m3(),
                    unix_time_s,
                };
                Some(packet.encode(&flight_state(self.monitor(), state), backend.surfaces()))
            }
        }
    }
}

/// A flight state from what the state on the bus carries.
fn flight_state(monitor: &SafetyMonitor, state: &State) -> FlightState {
    let place = monitor.locate(state).at;
    let angles = [state.roll_deg, state.pitch_deg, state.heading_deg].map(f64::to_radians);
    let [roll_rad, pitch_rad, yaw_rad] = angles;
    FlightState {
        north_m: place.north_m,
        east_m: place.east_m,
        alt_amsl_m: state.alt_amsl_m,
        vel_ned_m_s: state.vel_ned_m_s,
        roll_rad,
        pitch_rad,
        yaw_rad,
        attitude: quaternion(roll_rad, pitch_rad, yaw_rad),
        rate_rad_s: [0.0; 3],
        airspeed_m_s: state.airspeed_m_s,
        alpha_rad: 0.0,
        beta_rad: 0.0,
        elevator_rad: 0.0,
        aileron_rad: 0.0,
        rudder_rad: 0.0,
        throttle: state.throttle,
        specific_force_m_s2: [0.0; 3],
        phase: if state.airborne {
            FlightPhase::Flying
        } else {
            FlightPhase::OnGround
        },
        flags: FlightFlags::default(),
    }
}
