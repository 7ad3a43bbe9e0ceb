//! The state of a vehicle as FlightGear's `net_fdm` packet (version 24, 408 bytes, big-endian),
//! for `fgfs --native-fdm=socket,in,50,,5500,udp --fdm=external`.
//!
//! Field order: FlightGear's `net_fdm.hxx`; units as FlightGear takes them (radians, feet per
//! second, knots for the calibrated airspeed, metres for heights).

use crate::aircraft::Surfaces;
use crate::state::{FlightPhase, FlightState};

/// Length of a packet, bytes.
pub const PACKET_BYTES: usize = 408;
const VERSION: u32 = 24;
const FOOT_M: f64 = 0.3048;
const KNOT_M_S: f64 = 1852.0 / 3600.0;
/// Engine state "running".
const RUNNING: u32 = 2;

/// What one packet carries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NetFdm {
    /// Geodetic latitude, degrees.
    pub lat_deg: f64,
    /// Longitude, degrees.
    pub lon_deg: f64,
    /// Ground under the vehicle, m above mean sea level.
    pub ground_amsl_m: f64,
    /// Air density, kg/m³ (for the calibrated airspeed).
    pub density_kg_m3: f64,
    /// Unix time, s.
    pub unix_time_s: u32,
}

/// Writes numbers one after the other; what does not fit in the packet is left out.
struct Packet {
    bytes: [u8; PACKET_BYTES],
    at: usize,
}

impl Packet {
    fn put(&mut self, bytes: &[u8]) {
        if let Some(room) = self.bytes.get_mut(self.at..self.at + bytes.len()) {
            room.copy_from_slice(bytes);
        }
        self.at += bytes.len();
    }

    fn whole(&mut self, value: u32) {
        self.put(&value.to_be_bytes());
    }

    fn double(&mut self, value: f64) {
        self.put(&value.to_be_bytes());
    }

    fn floats(&mut self, values: &[f64]) {
        for value in values {
            self.put(&(*value as f32).to_be_bytes());
        }
    }

    fn skip(&mut self, words: usize) {
        self.at += 4 * words;
    }
}

impl NetFdm {
    /// The packet for a state of a vehicle with these surfaces; none of a multirotor.
    pub fn encode(&self, state: &FlightState, surfaces: Option<&Surfaces>) -> [u8; PACKET_BYTES] {
        let mut out = Packet {
            bytes: [0; PACKET_BYTES],
            at: 0,
        };
        out.whole(VERSION);
        out.skip(1);
        out.double(self.lon_deg.to_radians());
        out.double(self.lat_deg.to_radians());
        out.double(state.alt_amsl_m);
        out.floats(&[
            state.alt_amsl_m - self.ground_amsl_m,
            state.roll_rad,
            state.pitch_rad,
            state.yaw_rad,
            state.alpha_rad,
            state.beta_rad,
        ]);
        self.motion(&mut out, state);
        // One engine, no tank, one wheel: the belly.
        out.whole(1);
        out.whole(if state.throttle > 0.0 { RUNNING } else { 0 });
        out.skip(3 + 9 * 4);
        out.whole(0);
        out.skip(4);
        out.whole(1);
        out.whole(u32::from(state.phase != FlightPhase::Flying));
        out.skip(2 + 3 * 3);
        out.whole(self.unix_time_s);
        out.skip(1);
        // Visibility, m.
        out.floats(&[30_000.0]);
        // Without surfaces all of them stand at zero, over any travel.
        let travel = surfaces.map_or(1.0, |s| s.max_deg.to_radians());
        let elevator = state.elevator_rad / travel;
        let aileron = state.aileron_rad / travel;
        out.floats(&[
            elevator,
            0.0,
            0.0,
            0.0,
            aileron,
            -aileron,
            state.rudder_rad / travel,
            0.0,
            0.0,
            0.0,
        ]);
        out.bytes
    }

    fn motion(&self, out: &mut Packet, state: &FlightState) {
        let (sin_a, cos_a) = state.alpha_rad.sin_cos();
        let (sin_b, cos_b) = state.beta_rad.sin_cos();
        let (sin_r, cos_r) = state.roll_rad.sin_cos();
        let (tan_p, cos_p) = (state.pitch_rad.tan(), state.pitch_rad.cos().max(1e-3));
        let [p, q, r] = state.rate_rad_s;
        out.floats(&[
            p + (q * sin_r + r * cos_r) * tan_p.clamp(-1e3, 1e3),
            q * cos_r - r * sin_r,
            (q * sin_r + r * cos_r) / cos_p,
        ]);
        // At these speeds calibrated is equivalent airspeed.
        let calibrated = state.airspeed_m_s * (self.density_kg_m3.max(0.0) / 1.225).sqrt();
        let [north, east, down] = state.vel_ned_m_s;
        out.floats(&[
            calibrated / KNOT_M_S,
            -down / FOOT_M,
            north / FOOT_M,
            east / FOOT_M,
            down / FOOT_M,
        ]);
        let v = state.airspeed_m_s / FOOT_M;
        out.floats(&[v * cos_a * cos_b, v * sin_b, v * sin_a * cos_b]);
        out.floats(&state.specific_force_m_s2.map(|a| a / FOOT_M));
        let stalled = if state.flags.stalled { 1.0 } else { 0.0 };
        out.floats(&[stalled, state.beta_rad.to_degrees()]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Aircraft, FlightSim};
    use std::sync::Arc;

    /// `tests/oracle/flightgear.py` packs the same values with pymavlink's fgFDM.
    #[test]
    fn bytes_are_those_of_pymavlink() {
        let text = include_str!("../../../aircraft/x8.toml");
        let aircraft = Arc::new(Aircraft::from_toml("x8", text).unwrap());
        let sim = FlightSim::airborne(&aircraft, 0.0, 0.0, 400.0, 90.0, 18.0).unwrap();
        let mut state = sim.state();
        state.roll_rad = 0.25;
        state.pitch_rad = -0.125;
        state.yaw_rad = 1.5;
        state.alpha_rad = 0.0625;
        state.beta_rad = -0.03125;
        state.rate_rad_s = [0.5, -0.25, 0.125];
        state.vel_ned_m_s = [15.24, -6.096, 3.048];
        state.airspeed_m_s = 18.288;
        state.specific_force_m_s2 = [0.3048, -0.6096, -9.7536];
        state.elevator_rad = 0.1;
        state.aileron_rad = -0.2;
        state.throttle = 0.5;
        state.flags.stalled = true;
        let packet = NetFdm {
            lat_deg: 43.4417,
            lon_deg: -7.8631,
            ground_amsl_m: 340.0,
            density_kg_m3: 1.225,
            unix_time_s: 1_700_000_000,
        }
        .encode(&state, Some(&aircraft.surfaces));
        let expected: Vec<u8> = include_str!("../../../tests/oracle/flightgear.hex")
            .trim()
            .as_bytes()
            .chunks(2)
            .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
            .collect();
        assert_eq!(expected.len(), PACKET_BYTES);
        // Four-byte words may differ by the rounding of two libraries' trigonometry.
        for (k, (a, b)) in packet.chunks(4).zip(expected.chunks(4)).enumerate() {
            let word = |b: &[u8]| i64::from(u32::from_be_bytes(b.try_into().unwrap()));
            // Words 3 and 5 are the low halves of longitude and latitude.
            let low_half = k == 3 || k == 5;
            assert!(
                (word(a) - word(b)).abs() <= if low_half { 4 } else { 1 },
                "word {k}: {a:?} {b:?}"
            );
        }
    }
}
