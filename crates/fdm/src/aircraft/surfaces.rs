//! Control surfaces and their servos.

use serde::{Deserialize, Serialize};

/// How the commands for pitch, roll and yaw reach the surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// Two elevons, each elevator and aileron; no rudder.
    Elevons,
    /// Separate elevator, ailerons and rudder.
    Conventional,
}

/// Control surfaces and their servos: a second-order lag with limits of rate and travel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Surfaces {
    /// Elevons, or separate elevator, ailerons and rudder.
    pub layout: Layout,
    /// Travel of each surface in the negative sense, degrees (below 0).
    pub min_deg: f64,
    /// Travel of each surface in the positive sense, degrees (above 0).
    pub max_deg: f64,
    /// Fastest motion, degrees per second.
    pub rate_deg_s: f64,
    /// Natural frequency of the servo, rad/s.
    pub natural_frequency_rad_s: f64,
    /// Damping ratio of the servo.
    pub damping_ratio: f64,
    /// Pure delay between a command and the servo's first motion, s.
    #[serde(default)]
    pub delay_s: f64,
    /// Where the elevator stands when commanded to 0, degrees.
    #[serde(default)]
    pub elevator_offset_deg: f64,
    /// Where the aileron stands when commanded to 0, degrees.
    #[serde(default)]
    pub aileron_offset_deg: f64,
    /// Where the rudder stands when commanded to 0, degrees.
    #[serde(default)]
    pub rudder_offset_deg: f64,
}
