//! What the autopilot knows of the flight.

use crate::state::{FlightPhase, FlightState};

/// The measured state that the autopilot works from.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sensed {
    /// Metres north of the site's origin.
    pub north_m: f64,
    /// Metres east of the site's origin.
    pub east_m: f64,
    /// Altitude above mean sea level, m.
    pub alt_amsl_m: f64,
    /// Velocity over ground, NED, m/s.
    pub vel_ned_m_s: [f64; 3],
    /// Roll angle, rad.
    pub roll_rad: f64,
    /// Pitch angle, rad.
    pub pitch_rad: f64,
    /// Yaw angle, rad.
    pub yaw_rad: f64,
    /// Angular rate in body axes, rad/s.
    pub rate_rad_s: [f64; 3],
    /// True airspeed, m/s.
    pub airspeed_m_s: f64,
    /// Air density, kg/m³.
    pub density_kg_m3: f64,
    /// Whether the aircraft stands or slides on the ground or its launcher.
    pub on_ground: bool,
}

impl Sensed {
    /// What faultless sensors would measure.
    pub fn perfect(state: &FlightState, density_kg_m3: f64) -> Self {
        Self {
            north_m: state.north_m,
            east_m: state.east_m,
            alt_amsl_m: state.alt_amsl_m,
            vel_ned_m_s: state.vel_ned_m_s,
            roll_rad: state.roll_rad,
            pitch_rad: state.pitch_rad,
            yaw_rad: state.yaw_rad,
            rate_rad_s: state.rate_rad_s,
            airspeed_m_s: state.airspeed_m_s,
            density_kg_m3,
            on_ground: state.phase != FlightPhase::Flying,
        }
    }

    /// Whether it is finite, and the time step `dt_s` a positive number.
    pub(crate) fn is_sound(&self, dt_s: f64) -> bool {
        self.is_finite() && dt_s.is_finite() && dt_s > 0.0
    }

    fn is_finite(&self) -> bool {
        let scalars = [
            self.north_m,
            self.east_m,
            self.alt_amsl_m,
            self.roll_rad,
            self.pitch_rad,
            self.yaw_rad,
            self.airspeed_m_s,
            self.density_kg_m3,
        ];
        scalars
            .iter()
            .chain(&self.vel_ned_m_s)
            .chain(&self.rate_rad_s)
            .all(|value| value.is_finite())
    }
}
