//! Total-energy control (Lambregts 1983): throttle gives energy, pitch shares it between height
//! and airspeed.
//!
//! Both work on rates divided by weight and airspeed: climb angle ḣ/V and V̇/g. Throttle answers
//! their sum, pitch their difference.

use air::STANDARD_GRAVITY_M_S2;

use super::demand::Demand;
use super::plant::Plant;
use super::sensed::Sensed;
use crate::aircraft::ControlGains;

/// Bandwidth of the airspeed and acceleration filter, rad/s.
const FILTER_RAD_S: f64 = 2.0;
/// Largest commanded acceleration along the path, m/s².
const ACCELERATION_MAX_M_S2: f64 = 1.5;
/// Fastest change of the commanded climb rate, m/s².
const CLIMB_CHANGE_MAX_M_S2: f64 = 2.0;
/// Speed above the slowest at which protection begins, m/s.
const PROTECTION_BAND_M_S: f64 = 1.0;

/// What height and airspeed shall be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EnergyDemand {
    pub alt_amsl_m: f64,
    pub airspeed_m_s: f64,
    /// Climb rate that the altitude itself moves with, m/s.
    pub climb_m_s: f64,
}

impl EnergyDemand {
    pub fn of(demand: &Demand) -> Self {
        Self {
            alt_amsl_m: demand.alt_amsl_m,
            airspeed_m_s: demand.airspeed_m_s,
            climb_m_s: 0.0,
        }
    }
}

/// Pitch and throttle asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EnergyCommand {
    pub pitch_rad: f64,
    pub throttle: f64,
    pub protecting: bool,
}

/// Memory of the loop.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct EnergyLoop {
    /// Filtered airspeed (m/s) and acceleration (m/s²).
    filter: Option<(f64, f64)>,
    climb: Option<f64>,
    /// Thrust over weight that the model lacks.
    thrust_trim: f64,
    /// Pitch that the model lacks, rad.
    pitch_trim: f64,
}

impl EnergyLoop {
    /// Keeps the memory in step while something else commands pitch and throttle.
    pub fn follow(&mut self, sensed: &Sensed) {
        self.filter = Some((sensed.airspeed_m_s, 0.0));
        self.climb = Some(-sensed.vel_ned_m_s[2]);
    }

    fn filtered(&mut self, dt: f64, airspeed: f64) -> (f64, f64) {
        let (v, a) = self.filter.unwrap_or((airspeed, 0.0));
        let error = airspeed - v;
        // A second-order observer, critically damped: V̇ without differentiating a noisy airspeed.
        let v = v + dt * (a + 2.0 * FILTER_RAD_S * error);
        let a = a + dt * FILTER_RAD_S * FILTER_RAD_S * error;
        self.filter = Some((v, a));
        (v, a)
    }

    /// One step of the loop.
    pub fn step(
        &mut self,
        dt: f64,
        sensed: &Sensed,
        demand: &EnergyDemand,
        plant: &Plant,
        gains: &ControlGains,
    ) -> EnergyCommand {
        let g = STANDARD_GRAVITY_M_S2;
        let at = plant.at(sensed);
        let climb_now = -sensed.vel_ned_m_s[2];
        let (speed, acceleration) = self.filtered(dt, sensed.airspeed_m_s);
        // Lift in a turn costs drag: without it every bank would lose energy until the integral
        // learnt it.
        let load_factor = 1.0 / sensed.roll_rad.cos().max(0.5);
        let drag = plant.drag_share(&at, load_factor) + self.thrust_trim;
        let available = plant.thrust_share_max(&at) - drag;

        let target = demand
            .airspeed_m_s
            .clamp(plant.slowest_m_s + PROTECTION_BAND_M_S, plant.fastest_m_s);
        let accelerate = ((target - speed) / gains.airspeed_time_s)
            .clamp(-ACCELERATION_MAX_M_S2, ACCELERATION_MAX_M_S2);
        let climb = self.climb_command(dt, sensed, demand, gains, climb_now);
        // No more climb than thrust gives, no more descent than drag takes.
        let climb_angle =
            (climb / at.speed).clamp(-0.95 * drag.max(0.0), (0.95 * available).max(0.0));

        // Lambregts' split: throttle gives the sum of both rates, pitch trades one for the other;
        // so a demand for height does not upset airspeed.
        let potential = climb_angle - climb_now / at.speed;
        let kinetic = (accelerate - acceleration) / g;
        let (guard, slow) = protection(sensed.airspeed_m_s, plant);
        let sum = potential + kinetic;
        // Near a speed limit the weights shift until pitch serves airspeed alone.
        let balance = (1.0 - guard) * potential - (1.0 + guard) * kinetic;

        let integrate = dt / gains.energy_integral_s;
        let thrust = drag + climb_angle + accelerate / g + gains.energy_damping * sum;
        let throttle = if slow {
            1.0
        } else {
            plant.throttle_for(&at, thrust)
        };
        // Anti-windup: the integral must not grow on what the motor cannot give.
        let at_stop = (throttle >= 1.0 && sum > 0.0) || (throttle <= 0.0 && sum < 0.0);
        if !at_stop {
            self.thrust_trim = (self.thrust_trim + integrate * sum).clamp(-0.3, 0.3);
        }

        let alpha = at.alpha_level * load_factor * sensed.roll_rad.cos();
        // Feedforward of the pitch that the path needs, so that the loop corrects only what the
        // model lacks.
        let level = alpha + climb_angle * (1.0 - guard) + self.pitch_trim;
        let wanted = level + 0.5 * gains.energy_damping * balance;
        let low = gains.pitch_min_deg.to_radians();
        let high = gains.pitch_max_deg.to_radians();
        let pitch = wanted.clamp(low, high);
        if pitch == wanted || (wanted - pitch) * balance < 0.0 {
            self.pitch_trim = (self.pitch_trim + 0.5 * integrate * balance).clamp(-0.35, 0.35);
        }
        EnergyCommand {
            pitch_rad: pitch,
            throttle,
            protecting: guard > 0.0,
        }
    }

    /// Climb rate towards the altitude, with its limits and its rate of change.
    fn climb_command(
        &mut self,
        dt: f64,
        sensed: &Sensed,
        demand: &EnergyDemand,
        gains: &ControlGains,
        climb_now: f64,
    ) -> f64 {
        let error = demand.alt_amsl_m - sensed.alt_amsl_m;
        let wanted = (error / gains.height_time_s + demand.climb_m_s)
            .clamp(-gains.sink_max_m_s, gains.climb_max_m_s);
        // The first step starts from the climb flown now, so that engaging the loop gives no jump.
        let before = self
            .climb
            .unwrap_or(climb_now.clamp(-gains.sink_max_m_s, gains.climb_max_m_s));
        let most = CLIMB_CHANGE_MAX_M_S2 * dt;
        let climb = before + (wanted - before).clamp(-most, most);
        self.climb = Some(climb);
        climb
    }
}

/// How far airspeed protection acts (0 to 1: below the slowest speed and above the fastest, pitch
/// serves airspeed alone), and whether because it is too slow.
fn protection(airspeed_m_s: f64, plant: &Plant) -> (f64, bool) {
    let slow = (plant.slowest_m_s + PROTECTION_BAND_M_S - airspeed_m_s) / PROTECTION_BAND_M_S;
    let fast = (airspeed_m_s - plant.fastest_m_s) / PROTECTION_BAND_M_S;
    (slow.max(fast).clamp(0.0, 1.0), slow > 0.0)
}
