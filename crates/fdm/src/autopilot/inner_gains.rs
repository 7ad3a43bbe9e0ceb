//! The inner loops as linear feedback, for stability margins.

use super::inner_loops::{pitch_integral_gain, roll_integral_gain};
use super::plant::Plant;
use super::sensed::Sensed;
use crate::aircraft::{Aircraft, ControlGains};
use std::sync::Arc;

/// Surface angle that a loop takes off per rad of angle, rad/s of rate, and rad s of the angle's
/// integral: command = −(angle φ + rate φ̇ + integral ∫φ dt).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct InnerGains {
    pub angle: f64,
    pub rate: f64,
    pub integral: f64,
}

/// Feedback of the roll and the pitch loop in level flight.
pub(crate) fn inner_gains(
    aircraft: &Arc<Aircraft>,
    gains: &ControlGains,
    airspeed_m_s: f64,
    density_kg_m3: f64,
) -> [InnerGains; 2] {
    let plant = Plant::new(aircraft);
    let at = plant.at(&Sensed {
        vel_ned_m_s: [airspeed_m_s, 0.0, 0.0],
        airspeed_m_s,
        density_kg_m3,
        ..Sensed::default()
    });
    let roll_damping = gains.roll_damping_rad_s / at.roll_power;
    let pitch_damping = gains.pitch_damping_rad_s / at.pitch_power;
    let per_g = air::STANDARD_GRAVITY_M_S2 / at.speed;
    let elevator = |rate: f64| plant.elevator_for(&at, 1.0 + rate / per_g, rate);
    let per_rate = (elevator(1e-4) - elevator(-1e-4)) / 2e-4;
    [
        InnerGains {
            angle: gains.roll_bandwidth_rad_s * (at.aileron_per_roll_rate + roll_damping),
            rate: roll_damping,
            integral: roll_integral_gain(&at, gains),
        },
        InnerGains {
            angle: gains.pitch_bandwidth_rad_s * (per_rate + pitch_damping),
            rate: pitch_damping,
            integral: pitch_integral_gain(gains) / at.pitch_power,
        },
    ]
}
