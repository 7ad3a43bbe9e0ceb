//! Inner loops: roll by aileron, pitch by elevator, yaw damping by rudder.

use air::STANDARD_GRAVITY_M_S2;

use super::plant::{OperatingPoint, Plant};
use super::sensed::Sensed;
use crate::aircraft::ControlGains;

/// Share of the aileron's travel that the roll integral may use.
const ROLL_TRIM_SHARE: f64 = 0.4;
/// Share of the elevator's travel that the pitch integral may use.
const PITCH_TRIM_SHARE: f64 = 0.6;

/// Roll angle by aileron.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct RollLoop {
    /// Commanded bank after its rate limit, rad.
    bank: Option<f64>,
    /// Aileron that trims, rad.
    trim: f64,
}

impl RollLoop {
    pub fn bank_command(&self) -> f64 {
        self.bank.unwrap_or(0.0)
    }

    /// The bank that is commanded when `bank` is wanted, rad: limited, also by what the airspeed carries, and
    /// moving no faster than its rate limit.
    pub fn command(
        &mut self,
        dt: f64,
        sensed: &Sensed,
        bank: f64,
        plant: &Plant,
        at: &OperatingPoint,
        gains: &ControlGains,
    ) -> f64 {
        // A level turn needs the load factor 1/cos(bank).
        let carried = (1.0 / plant.load_factor_max(at).max(1.02)).min(1.0).acos();
        let limit = gains.bank_max_deg.to_radians().min(carried);
        let wanted = bank.clamp(-limit, limit);
        let most = gains.bank_rate_max_deg_s.to_radians() * dt;
        let before = self.bank.unwrap_or(sensed.roll_rad.clamp(-limit, limit));
        let command = before + (wanted - before).clamp(-most, most);
        self.bank = Some(command);
        command
    }

    /// Aileron, rad; the integral stops at the aileron's stop.
    pub fn step(
        &mut self,
        dt: f64,
        sensed: &Sensed,
        bank: f64,
        plant: &Plant,
        at: &OperatingPoint,
        gains: &ControlGains,
    ) -> f64 {
        let command = self.command(dt, sensed, bank, plant, at, gains);
        let error = command - sensed.roll_rad;
        // The loop may roll faster than the command moves, so that it can catch up after a gust.
        let rate_limit = 1.5 * gains.bank_rate_max_deg_s.to_radians();
        let rate = (gains.roll_bandwidth_rad_s * error).clamp(-rate_limit, rate_limit);
        let damping = gains.roll_damping_rad_s * (rate - sensed.rate_rad_s[0]);
        // Feedforward of the steady roll rate, so that the damping acts on the difference alone and
        // does not slow the roll that is wanted.
        let wanted = at.aileron_per_roll_rate * rate + damping / at.roll_power + self.trim;
        let aileron = wanted.clamp(-plant.aileron_high, plant.aileron_high);
        // Anti-windup: at the stop the integral moves only back towards the inside.
        if aileron == wanted || (wanted - aileron) * error < 0.0 {
            let most = ROLL_TRIM_SHARE * plant.aileron_high;
            let change = roll_integral_gain(at, gains) * error * dt;
            self.trim = (self.trim + change).clamp(-most, most);
        }
        aileron
    }
}

/// Pitch angle by elevator.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct PitchLoop {
    /// Pitch acceleration that trims, rad/s².
    trim: f64,
}

impl PitchLoop {
    /// Elevator, rad: that of the steady manoeuvre at the commanded pitch rate, and feedback. The
    /// commanded rate is limited so that the angle of attack stays below stall.
    pub fn step(
        &mut self,
        dt: f64,
        sensed: &Sensed,
        pitch: f64,
        plant: &Plant,
        at: &OperatingPoint,
        gains: &ControlGains,
    ) -> f64 {
        let (sin, cos) = sensed.roll_rad.sin_cos();
        let per_g = STANDARD_GRAVITY_M_S2 / at.speed;
        // Rate of a level turn at this bank.
        let turn = per_g * sin * sin / cos.max(0.5);
        let error = pitch - sensed.pitch_rad;
        let most = gains.pitch_rate_max_deg_s.to_radians();
        // Kinematics: q = θ̇ cos(bank) + ψ̇ sin(bank), the second being the pitch rate of the turn.
        let asked = (gains.pitch_bandwidth_rad_s * error).clamp(-most, most) * cos.max(0.3) + turn;
        let rate = asked.min((plant.load_factor_max(at) - cos) * per_g);
        // Pulling up at a pitch rate needs lift beyond that of level flight; bounded below, since
        // the linear model of lift does not hold in a deep push-over.
        let load_factor = (cos + rate / per_g).max(-0.5);
        let steady = plant.elevator_for(at, load_factor, rate);
        let feedback = gains.pitch_damping_rad_s * (rate - sensed.rate_rad_s[1]) + self.trim;
        let wanted = steady + feedback / at.pitch_power;
        let elevator = wanted.clamp(plant.elevator_low, plant.elevator_high);
        // Pulling (negative elevator) raises the nose.
        if elevator == wanted || (wanted - elevator) * error > 0.0 {
            let most = PITCH_TRIM_SHARE * plant.elevator_high * -at.pitch_power;
            self.trim = (self.trim + pitch_integral_gain(gains) * error * dt).clamp(-most, most);
        }
        elevator
    }
}

/// Aileron per integral of the roll error, 1/s.
pub(super) fn roll_integral_gain(at: &OperatingPoint, gains: &ControlGains) -> f64 {
    gains.roll_integral_rad_s * gains.roll_bandwidth_rad_s * at.aileron_per_roll_rate
}

/// Pitch acceleration per integral of the pitch error, 1/s³.
pub(super) fn pitch_integral_gain(gains: &ControlGains) -> f64 {
    gains.pitch_integral_rad_s
        * gains.pitch_bandwidth_rad_s
        * (gains.pitch_damping_rad_s + STIFFNESS_RAD_S)
}

/// Adds to the damping in the integral's scale, 1/s: the airframe's own damping in pitch.
const STIFFNESS_RAD_S: f64 = 5.0;

/// Rudder, rad: damps the yaw rate about that of a coordinated turn.
pub(super) fn yaw_damper(
    sensed: &Sensed,
    plant: &Plant,
    at: &OperatingPoint,
    gains: &ControlGains,
) -> f64 {
    if !plant.has_rudder {
        return 0.0;
    }
    // Damping about zero would fight every turn: a coordinated one yaws by g/V tan(bank) times the
    // cosines, as here.
    let turn = STANDARD_GRAVITY_M_S2 / at.speed * sensed.roll_rad.sin() * sensed.pitch_rad.cos();
    let wanted = gains.yaw_damping_rad_s * (turn - sensed.rate_rad_s[2]) / at.yaw_power;
    wanted.clamp(-plant.aileron_high, plant.aileron_high)
}
