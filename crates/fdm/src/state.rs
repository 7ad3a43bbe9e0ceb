//! Inputs and outputs of a flight: the air around a vehicle, the command to its surfaces, its state.

use crate::dynamics::{Body, Flow, euler};

/// The air around a vehicle during one step; gusts are the caller's to add.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AirAround {
    /// Vector towards which the air moves, NED, m/s.
    pub wind_ned_m_s: [f64; 3],
    /// Air density, kg/m³.
    pub density_kg_m3: f64,
}

impl AirAround {
    /// Still air of the standard atmosphere at sea level.
    pub const STANDARD_CALM: Self = Self {
        wind_ned_m_s: [0.0; 3],
        density_kg_m3: 1.225,
    };
}

/// What a pilot or autopilot asks of surfaces and motor. Out-of-range values are limited to the
/// travel; values that are not finite keep the last command.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SurfaceCommand {
    /// Elevator, rad, trailing edge down positive.
    pub elevator_rad: f64,
    /// Aileron (left − right)/2, rad, positive rolls right.
    pub aileron_rad: f64,
    /// Rudder, rad, trailing edge left positive; without effect on an elevon aircraft.
    pub rudder_rad: f64,
    /// Throttle, 0 to 1.
    pub throttle: f64,
    /// Releases the launcher of a vehicle that stands on it.
    pub launch: bool,
}

/// Whether a vehicle flies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlightPhase {
    /// On the launcher, or stopped after a landing and set up again.
    OnGround,
    /// Being accelerated by the launcher.
    Launching,
    /// In the air.
    Flying,
    /// Sliding on its belly after touch-down.
    Sliding,
}

/// Whether the state is inside what the model is valid for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FlightFlags {
    /// Angle of attack beyond the linear model.
    pub stalled: bool,
    /// Sideslip beyond the linear model.
    pub sideslip: bool,
    /// Airspeed above the airframe's limit.
    pub overspeed: bool,
    /// On or in contact with the ground.
    pub on_ground: bool,
    /// It touched down harder than the airframe allows; stays set until the next launch.
    pub hard_landing: bool,
    /// A rate had to be held at its bound, or a step refused because it left the finite numbers.
    pub outside_model: bool,
}

/// Everything that can be known of a vehicle at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightState {
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
    /// Yaw angle (true heading), rad in `(−π, π]`.
    pub yaw_rad: f64,
    /// Attitude quaternion (w, x, y, z), body to NED.
    pub attitude: [f64; 4],
    /// Angular rate in body axes, rad/s.
    pub rate_rad_s: [f64; 3],
    /// True airspeed, m/s.
    pub airspeed_m_s: f64,
    /// Angle of attack, rad.
    pub alpha_rad: f64,
    /// Sideslip, rad.
    pub beta_rad: f64,
    /// Elevator as it stands, rad.
    pub elevator_rad: f64,
    /// Aileron as it stands, rad.
    pub aileron_rad: f64,
    /// Rudder as it stands, rad.
    pub rudder_rad: f64,
    /// Motor state, 0 to 1.
    pub throttle: f64,
    /// Specific force at the centre of gravity, body axes, m/s².
    pub specific_force_m_s2: [f64; 3],
    /// Whether it flies.
    pub phase: FlightPhase,
    /// Validity of the model here.
    pub flags: FlightFlags,
}

impl FlightState {
    /// Motion and flow of a body whose rotation is `m`, on the ground with surfaces, throttle and forces at zero.
    pub(crate) fn of_body(body: &Body, m: &[[f64; 3]; 3], flow: &Flow) -> Self {
        let [roll_rad, pitch_rad, yaw_rad] = euler(m);
        Self {
            north_m: body.pos_ned[0],
            east_m: body.pos_ned[1],
            alt_amsl_m: -body.pos_ned[2],
            vel_ned_m_s: body.vel_ned,
            roll_rad,
            pitch_rad,
            yaw_rad,
            attitude: body.attitude,
            rate_rad_s: body.rate,
            airspeed_m_s: flow.airspeed,
            alpha_rad: flow.alpha,
            beta_rad: flow.beta,
            elevator_rad: 0.0,
            aileron_rad: 0.0,
            rudder_rad: 0.0,
            throttle: 0.0,
            specific_force_m_s2: [0.0; 3],
            phase: FlightPhase::OnGround,
            flags: FlightFlags::default(),
        }
    }

    /// What an observer sees of a flight: place (north, east, height above mean sea level, m), velocity over ground, NED,
    /// m/s, attitude (roll, pitch, yaw, rad), airspeed, m/s, throttle and whether it flies. Rates, flow and surfaces are
    /// not seen and stand at zero.
    pub fn seen(
        [north_m, east_m, alt_amsl_m]: [f64; 3],
        vel_ned_m_s: [f64; 3],
        [roll_rad, pitch_rad, yaw_rad]: [f64; 3],
        airspeed_m_s: f64,
        throttle: f64,
        airborne: bool,
    ) -> Self {
        Self {
            north_m,
            east_m,
            alt_amsl_m,
            vel_ned_m_s,
            roll_rad,
            pitch_rad,
            yaw_rad,
            attitude: crate::quaternion(roll_rad, pitch_rad, yaw_rad),
            rate_rad_s: [0.0; 3],
            airspeed_m_s,
            alpha_rad: 0.0,
            beta_rad: 0.0,
            elevator_rad: 0.0,
            aileron_rad: 0.0,
            rudder_rad: 0.0,
            throttle,
            specific_force_m_s2: [0.0; 3],
            phase: if airborne {
                FlightPhase::Flying
            } else {
                FlightPhase::OnGround
            },
            flags: FlightFlags::default(),
        }
    }
}

/// The command with what is not finite replaced by the last one.
pub(crate) fn sanitised(command: &SurfaceCommand, last: &SurfaceCommand) -> SurfaceCommand {
    let keep = |new: f64, old: f64| if new.is_finite() { new } else { old };
    SurfaceCommand {
        elevator_rad: keep(command.elevator_rad, last.elevator_rad),
        aileron_rad: keep(command.aileron_rad, last.aileron_rad),
        rudder_rad: keep(command.rudder_rad, last.rudder_rad),
        throttle: keep(command.throttle, last.throttle),
        launch: command.launch,
    }
}
