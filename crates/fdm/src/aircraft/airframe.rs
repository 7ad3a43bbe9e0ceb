//! Mass, reference lengths, limits of the envelope, and contact with the ground.

use serde::{Deserialize, Serialize};

/// Mass and inertia about the centre of gravity in body axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MassProperties {
    /// Mass ready to fly, kg.
    pub mass_kg: f64,
    /// Moment of inertia about the forward axis, kg m².
    pub ixx_kg_m2: f64,
    /// Moment of inertia about the right axis, kg m².
    pub iyy_kg_m2: f64,
    /// Moment of inertia about the down axis, kg m².
    pub izz_kg_m2: f64,
    /// Product of inertia ∫xz dm, kg m²: the inertia matrix holds −Ixz off its diagonal.
    pub ixz_kg_m2: f64,
    /// How far the centre of gravity lies ahead of the aerodynamic reference point, m.
    #[serde(default)]
    pub cg_ahead_m: f64,
}

/// Reference lengths and area of the coefficients.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wing {
    /// Span b, m.
    pub span_m: f64,
    /// Mean aerodynamic chord c, m.
    pub chord_m: f64,
    /// Wing area S, m².
    pub area_m2: f64,
}

/// Where the aerodynamic model and the airframe hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Lowest angle of attack of the linear model, degrees (below 0).
    pub alpha_min_deg: f64,
    /// Stall: highest angle of attack of the linear model, degrees.
    pub alpha_stall_deg: f64,
    /// Largest sideslip of the linear model, degrees.
    pub beta_max_deg: f64,
    /// Slowest airspeed the autopilot flies, m/s.
    pub airspeed_min_m_s: f64,
    /// Airspeed of normal cruise, m/s.
    pub airspeed_cruise_m_s: f64,
    /// Fastest airspeed the airframe allows, m/s.
    pub airspeed_max_m_s: f64,
}

/// Launch by catapult or bungee and landing on the belly.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GroundHandling {
    /// Airspeed at which the launcher lets go, m/s.
    pub launch_airspeed_m_s: f64,
    /// Acceleration along the launcher's rail, m/s².
    pub launch_acceleration_m_s2: f64,
    /// Elevation of the launcher's rail, degrees.
    pub launch_pitch_deg: f64,
    /// Coefficient of sliding friction on the ground.
    pub friction: f64,
    /// Height of the centre of gravity above the ground at rest, m.
    pub rest_height_m: f64,
    /// Sink rate at touch-down beyond which the landing counts as hard, m/s.
    pub hard_sink_m_s: f64,
}

impl Default for GroundHandling {
    fn default() -> Self {
        Self {
            launch_airspeed_m_s: 16.0,
            launch_acceleration_m_s2: 30.0,
            launch_pitch_deg: 10.0,
            friction: 0.4,
            rest_height_m: 0.1,
            hard_sink_m_s: 2.5,
        }
    }
}
