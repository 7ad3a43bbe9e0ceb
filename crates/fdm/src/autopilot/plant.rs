//! What the autopilot knows of the aircraft it flies: the coefficients as the constants of its
//! loops, and steady flight in closed form.

use air::STANDARD_GRAVITY_M_S2;

use super::sensed::Sensed;
use crate::aircraft::{Aircraft, PropellerLaw};
use crate::dynamics::induced_drag_factor;
use std::sync::Arc;

/// Airspeed below which the loops' gains stop growing, as a share of the lowest flying speed.
const GAIN_FLOOR: f64 = 0.6;
/// Reserve kept to the stall angle by the pitch loop, rad.
const STALL_RESERVE_RAD: f64 = 0.03;

/// Constants of one aircraft.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plant {
    aircraft: Arc<Aircraft>,
    weight_n: f64,
    /// Determinant of (CLα, CLδ; Cmα, Cmδ).
    det: f64,
    induced: f64,
    pub cruise_m_s: f64,
    pub slowest_m_s: f64,
    pub fastest_m_s: f64,
    pub elevator_low: f64,
    pub elevator_high: f64,
    pub aileron_high: f64,
    pub has_rudder: bool,
}

/// The constants at one airspeed.
#[derive(Debug, Clone, Copy)]
pub(super) struct OperatingPoint {
    pub speed: f64,
    /// Lift coefficient that carries the weight.
    pub lift_level: f64,
    /// Elevator of unaccelerated level flight, rad.
    pub elevator_level: f64,
    /// Angle of attack of the same, rad.
    pub alpha_level: f64,
    /// Roll acceleration per aileron, 1/s².
    pub roll_power: f64,
    /// Aileron that holds a roll rate, s.
    pub aileron_per_roll_rate: f64,
    /// Pitch acceleration per elevator (below 0), 1/s².
    pub pitch_power: f64,
    /// Yaw acceleration per rudder, 1/s²; 0 without rudder.
    pub yaw_power: f64,
    /// Half chord over airspeed, s.
    chord_per_2v: f64,
    qbar_s: f64,
    density: f64,
}

impl Plant {
    pub fn new(aircraft: &Arc<Aircraft>) -> Self {
        let (lift, pitch, limits) = (&aircraft.lift, &aircraft.pitch, &aircraft.limits);
        let low = aircraft.surfaces.min_deg.to_radians();
        let high = aircraft.surfaces.max_deg.to_radians();
        Self {
            weight_n: aircraft.body.mass_kg * STANDARD_GRAVITY_M_S2,
            det: lift.alpha * pitch.elevator - lift.elevator * pitch.alpha,
            induced: induced_drag_factor(aircraft),
            cruise_m_s: limits.airspeed_cruise_m_s,
            slowest_m_s: limits.airspeed_min_m_s,
            fastest_m_s: limits.airspeed_max_m_s,
            elevator_low: low,
            elevator_high: high,
            aileron_high: high.min(-low),
            has_rudder: aircraft.has_rudder(),
            aircraft: aircraft.clone(),
        }
    }

    /// The constants at the airspeed and density sensed.
    pub fn at(&self, sensed: &Sensed) -> OperatingPoint {
        let a = &self.aircraft;
        // Surface effect goes with V²: without a floor a slow aircraft, or a dead airspeed sensor,
        // would get gains without bound.
        let speed = sensed.airspeed_m_s.max(GAIN_FLOOR * self.slowest_m_s);
        let qbar_s = 0.5 * sensed.density_kg_m3.max(0.1) * speed * speed * a.wing.area_m2;
        let lift_level = self.weight_n / qbar_s;
        let chord_per_2v = 0.5 * a.wing.chord_m / speed;
        let (alpha_level, elevator_level) = self.balance(lift_level, 0.0);
        let roll_moment = qbar_s * a.wing.span_m;
        OperatingPoint {
            speed,
            lift_level,
            elevator_level,
            alpha_level,
            roll_power: roll_moment * a.roll.aileron / a.body.ixx_kg_m2,
            aileron_per_roll_rate: -a.roll.p * 0.5 * a.wing.span_m / speed / a.roll.aileron,
            pitch_power: qbar_s * a.wing.chord_m * a.pitch.elevator / a.body.iyy_kg_m2,
            yaw_power: roll_moment * a.yaw.rudder / a.body.izz_kg_m2,
            chord_per_2v,
            qbar_s,
            density: sensed.density_kg_m3.max(0.1),
        }
    }

    /// Angle of attack and elevator at which lift is `lift` and the pitching moment nil while
    /// pitching at the dimensionless rate `q_hat`.
    fn balance(&self, lift: f64, q_hat: f64) -> (f64, f64) {
        let (l, m) = (&self.aircraft.lift, &self.aircraft.pitch);
        // Two linear equations, lift and moment, in angle of attack and elevator, solved by
        // Cramer's rule.
        let a = lift - l.zero - l.q * q_hat;
        let b = -m.zero - m.q * q_hat;
        (
            (a * m.elevator - l.elevator * b) / self.det,
            (l.alpha * b - m.alpha * a) / self.det,
        )
    }

    /// Elevator for a load factor while pitching at `rate` rad/s.
    pub fn elevator_for(&self, at: &OperatingPoint, load_factor: f64, rate: f64) -> f64 {
        self.balance(at.lift_level * load_factor, rate * at.chord_per_2v)
            .1
    }

    /// Highest load factor before stall.
    pub fn load_factor_max(&self, at: &OperatingPoint) -> f64 {
        let l = &self.aircraft.lift;
        // A gust adds to the angle of attack before any loop can answer: hence the reserve.
        let alpha = self.aircraft.limits.alpha_stall_deg.to_radians() - STALL_RESERVE_RAD;
        (l.zero + l.alpha * alpha) / at.lift_level
    }

    /// Drag over weight at a load factor.
    pub fn drag_share(&self, at: &OperatingPoint, load_factor: f64) -> f64 {
        let lift = at.lift_level * load_factor;
        let (alpha, elevator) = self.balance(lift, 0.0);
        let d = &self.aircraft.drag;
        let over = lift - d.min_drag_lift;
        let drag = d.zero
            + alpha * (d.alpha + alpha * d.alpha_squared)
            + elevator * elevator * d.elevator_squared
            + over * over * self.induced;
        drag * at.qbar_s / self.weight_n
    }

    /// Throttle that gives a thrust over weight.
    pub fn throttle_for(&self, at: &OperatingPoint, thrust_share: f64) -> f64 {
        let p = &self.aircraft.propulsion;
        let v = at.speed;
        // The thrust law of the propeller, solved for its slipstream and from there for the
        // throttle.
        let demand = 2.0 * thrust_share * self.weight_n / (at.density * p.swept_area_m2);
        let throttle = match p.law {
            PropellerLaw::Blended => {
                let slipstream = 0.5 * v + (0.25 * v * v + demand).max(0.0).sqrt();
                (slipstream - v) / (p.exit_speed_m_s - v).max(1.0)
            }
            PropellerLaw::Proportional => (v * v + demand).max(0.0).sqrt() / p.exit_speed_m_s,
        };
        throttle.clamp(0.0, 1.0)
    }

    /// Thrust over weight at full throttle.
    pub fn thrust_share_max(&self, at: &OperatingPoint) -> f64 {
        let p = &self.aircraft.propulsion;
        let exit = p.exit_speed_m_s;
        let square = match p.law {
            PropellerLaw::Blended => exit * (exit - at.speed),
            PropellerLaw::Proportional => exit * exit - at.speed * at.speed,
        };
        0.5 * at.density * p.swept_area_m2 * square / self.weight_n
    }
}
