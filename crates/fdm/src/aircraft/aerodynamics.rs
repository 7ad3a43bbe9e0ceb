//! Aerodynamic derivatives; their conventions stand at [`super::Aircraft`].

use serde::{Deserialize, Serialize};

/// Derivatives of a longitudinal coefficient (lift or pitching moment).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LiftDerivatives {
    /// Value at zero angle of attack, rate and elevator.
    pub zero: f64,
    /// By angle of attack, 1/rad.
    pub alpha: f64,
    /// By dimensionless pitch rate q c/2V, 1/rad.
    pub q: f64,
    /// By elevator, 1/rad.
    pub elevator: f64,
}

/// Drag: a polynomial in the angles and, where an Oswald factor is given, induced drag
/// (CL − CL_min)²/(π e AR).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DragPolar {
    /// Parasite drag.
    pub zero: f64,
    /// By angle of attack, 1/rad.
    #[serde(default)]
    pub alpha: f64,
    /// By its square, 1/rad².
    #[serde(default)]
    pub alpha_squared: f64,
    /// By sideslip, 1/rad.
    #[serde(default)]
    pub beta: f64,
    /// By its square, 1/rad².
    #[serde(default)]
    pub beta_squared: f64,
    /// By the elevator's square, 1/rad².
    #[serde(default)]
    pub elevator_squared: f64,
    /// Oswald's span efficiency e of the induced drag; none: no such term.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub oswald: Option<f64>,
    /// Lift coefficient of least drag, for the induced term.
    #[serde(default)]
    pub min_drag_lift: f64,
}

/// Derivatives of a lateral coefficient (side force, rolling or yawing moment).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LateralDerivatives {
    /// By sideslip, 1/rad.
    pub beta: f64,
    /// By dimensionless roll rate p b/2V, 1/rad.
    pub p: f64,
    /// By dimensionless yaw rate r b/2V, 1/rad.
    pub r: f64,
    /// By aileron, 1/rad.
    pub aileron: f64,
    /// By rudder, 1/rad.
    #[serde(default)]
    pub rudder: f64,
}
