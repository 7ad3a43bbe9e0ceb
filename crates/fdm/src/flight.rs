//! One vehicle in the air or on the ground: servos, motor, rigid body, launcher and landing slide.

mod batch;
mod delay;
mod ground;

use crate::FdmError;
use crate::aircraft::Aircraft;
use crate::dynamics::{AirState, Body, Controls, Dynamics, euler, flow, rotation};
use crate::mechanism::{Extended, SensorErrors};
use crate::servo::{LagStep, Servo};
use crate::trim::{self, Trim};
pub(crate) use delay::DelayLine;

/// Angular rate beyond which the model has no meaning, rad/s: it is held there.
pub(crate) const HIGHEST_RATE_RAD_S: f64 = 30.0;

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
pub enum Phase {
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
    pub phase: Phase,
    /// Validity of the model here.
    pub flags: FlightFlags,
}

/// A vehicle that flies.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightSim {
    dynamics: Dynamics,
    body: Body,
    /// Left elevon, right elevon, none; or elevator, aileron, rudder.
    servos: [Servo; 3],
    motor: f64,
    last: SurfaceCommand,
    delay: DelayLine,
    half_step: Option<(f64, LagStep)>,
    sensors: SensorErrors,
    wind_bias: [f64; 3],
    ground_amsl_m: f64,
    launch_heading_rad: f64,
    phase: Phase,
    flags: FlightFlags,
    specific_force: [f64; 3],
    wind_ned: [f64; 3],
}

impl FlightSim {
    /// A vehicle in trimmed level flight in still standard air.
    ///
    /// # Errors
    /// [`FdmError::NoTrim`] when the aircraft cannot fly level at that airspeed; a mechanism of
    /// its list that is unknown or out of range.
    pub fn airborne(
        aircraft: &Aircraft,
        north_m: f64,
        east_m: f64,
        alt_amsl_m: f64,
        heading_deg: f64,
        airspeed_m_s: f64,
    ) -> Result<Self, FdmError> {
        let extended = Extended::of(aircraft)?;
        let mut sim = Self::still(&extended, [north_m, east_m, -alt_amsl_m], heading_deg);
        let density = AirAround::STANDARD_CALM.density_kg_m3;
        let trim = trim::level(&sim.dynamics, airspeed_m_s, density)?;
        sim.set_trimmed(&trim, heading_deg, [0.0; 3]);
        Ok(sim)
    }

    /// A vehicle on its launcher.
    ///
    /// # Errors
    /// A mechanism of the aircraft's list that is unknown or out of range.
    pub fn on_ground(
        aircraft: &Aircraft,
        north_m: f64,
        east_m: f64,
        ground_amsl_m: f64,
        heading_deg: f64,
    ) -> Result<Self, FdmError> {
        let extended = Extended::of(aircraft)?;
        let down = -(ground_amsl_m + aircraft.ground.rest_height_m);
        let mut sim = Self::still(&extended, [north_m, east_m, down], heading_deg);
        sim.ground_amsl_m = ground_amsl_m;
        sim.body.attitude = quaternion(
            0.0,
            aircraft.ground.launch_pitch_deg.to_radians(),
            sim.launch_heading_rad,
        );
        sim.flags.on_ground = true;
        Ok(sim)
    }

    fn still(extended: &Extended, pos_ned: [f64; 3], heading_deg: f64) -> Self {
        let heading = heading_deg.to_radians();
        Self {
            dynamics: Dynamics::new(&extended.aircraft),
            sensors: extended.sensors,
            wind_bias: extended.wind_bias_ned_m_s,
            body: Body {
                pos_ned,
                vel_ned: [0.0; 3],
                attitude: quaternion(0.0, 0.0, heading),
                rate: [0.0; 3],
            },
            servos: [Servo {
                angle: 0.0,
                rate: 0.0,
            }; 3],
            motor: 0.0,
            last: SurfaceCommand::default(),
            delay: DelayLine::filled(&SurfaceCommand::default()),
            half_step: None,
            ground_amsl_m: f64::NEG_INFINITY,
            launch_heading_rad: heading,
            phase: Phase::OnGround,
            flags: FlightFlags::default(),
            specific_force: [0.0, 0.0, -air::STANDARD_GRAVITY_M_S2],
            wind_ned: [0.0; 3],
        }
    }

    /// Puts the vehicle into steady flight as trimmed, with the air moving as `wind_ned_m_s`.
    pub fn set_trimmed(&mut self, trim: &Trim, heading_deg: f64, wind_ned_m_s: [f64; 3]) {
        let heading = heading_deg.to_radians();
        self.body.attitude = quaternion(0.0, trim.pitch_rad, heading);
        let path = trim.pitch_rad - trim.alpha_rad;
        let level = trim.airspeed_m_s * path.cos();
        self.body.vel_ned = [
            level * heading.cos() + wind_ned_m_s[0],
            level * heading.sin() + wind_ned_m_s[1],
            -trim.airspeed_m_s * path.sin() + wind_ned_m_s[2],
        ];
        self.body.rate = [0.0; 3];
        self.wind_ned = wind_ned_m_s;
        self.last = trim.command();
        // The trim says where the surfaces stand.
        let surfaces = &self.dynamics.aircraft.surfaces;
        self.last.elevator_rad -= surfaces.elevator_offset_deg.to_radians();
        self.last.aileron_rad -= surfaces.aileron_offset_deg.to_radians();
        self.last.rudder_rad -= surfaces.rudder_offset_deg.to_radians();
        self.delay = DelayLine::filled(&self.last);
        self.servos = self
            .dynamics
            .servo_angles(&self.last)
            .map(|angle| Servo { angle, rate: 0.0 });
        self.motor = trim.throttle;
        self.phase = Phase::Flying;
        self.flags = FlightFlags::default();
    }

    /// Replaces motion and attitude (for tests, system identification and replays); the servos
    /// and the motor stay. The quaternion is normalised; values that are not finite are ignored.
    pub fn set_motion(&mut self, vel_ned_m_s: [f64; 3], attitude: [f64; 4], rate_rad_s: [f64; 3]) {
        let norm = attitude.iter().map(|part| part * part).sum::<f64>().sqrt();
        let finite = vel_ned_m_s.iter().chain(&rate_rad_s).all(|v| v.is_finite());
        if finite && norm.is_finite() && norm > 0.0 {
            self.body.vel_ned = vel_ned_m_s;
            self.body.attitude = attitude.map(|part| part / norm);
            self.body.rate = rate_rad_s;
            self.phase = Phase::Flying;
        }
    }

    /// Sets surfaces and motor at once, as if they had been there for long.
    pub fn set_surfaces(&mut self, command: &SurfaceCommand) {
        self.last = sanitised(command, &self.last);
        self.delay = DelayLine::filled(&self.last);
        self.servos = self
            .dynamics
            .servo_angles(&self.last)
            .map(|angle| Servo { angle, rate: 0.0 });
        self.motor = self.last.throttle;
    }

    /// Tells the vehicle how high the ground under it is, m above mean sea level.
    pub fn set_ground_amsl_m(&mut self, ground_amsl_m: f64) {
        if ground_amsl_m.is_finite() {
            self.ground_amsl_m = ground_amsl_m;
        }
    }

    /// The state as the vehicle's own sensors tell it, with the errors of its mechanisms.
    pub fn sensed(&self) -> FlightState {
        self.sensors.of(&self.state())
    }

    /// The aircraft that flies, with the mechanisms of its list applied.
    pub fn aircraft(&self) -> &Aircraft {
        &self.dynamics.aircraft
    }

    /// Advances by `dt_s` (cut into equal steps, see [`Dynamics::longest_step_s`]) with the command and the
    /// air held. A `dt_s` that is not positive and finite does nothing.
    pub fn step(&mut self, dt_s: f64, air: &AirAround, command: &SurfaceCommand) {
        if !(dt_s.is_finite() && dt_s > 0.0) {
            return;
        }
        let air = self.usable(air);
        self.last = sanitised(command, &self.last);
        let calls = DelayLine::calls(self.aircraft().surfaces.delay_s, dt_s);
        let command = self.delay.pass(&self.last, calls);
        let count = self.dynamics.steps_in(dt_s);
        let dt = dt_s / count;
        let lag = self.lag_step(dt);
        for _ in 0..count as usize {
            match self.phase {
                Phase::Flying => self.fly(dt, &air, &command, &lag),
                Phase::OnGround => self.stand(&lag, &command),
                Phase::Launching => self.launch(dt, &air, &command, &lag),
                Phase::Sliding => self.slide(dt, &lag, &command),
            }
        }
    }

    /// Advances one step of `dt_s` exactly (no cutting) with the surfaces and the motor held at
    /// the given values, without servos, launcher or ground: for system identification and for
    /// comparison with other programs.
    pub fn step_with_surfaces(&mut self, dt_s: f64, air: &AirAround, surfaces: &SurfaceCommand) {
        let air = self.usable(air);
        self.set_surfaces(surfaces);
        let held = self.controls();
        self.advance(dt_s, &air, &[held; 3]);
    }

    /// The state now.
    pub fn state(&self) -> FlightState {
        let m = rotation(&self.body.attitude);
        let flow = flow(&m, &self.body.vel_ned, &self.wind_ned);
        let controls = self.controls();
        let mut flags = self.flags;
        if self.phase == Phase::Flying {
            let (attached, straight) = self.dynamics.flow_is_valid(flow.alpha, flow.beta);
            flags.stalled = !attached;
            flags.sideslip = !straight;
            flags.overspeed = flow.airspeed > self.aircraft().limits.airspeed_max_m_s;
        }
        flags.on_ground = self.phase != Phase::Flying;
        let [roll_rad, pitch_rad, yaw_rad] = euler(&m);
        FlightState {
            north_m: self.body.pos_ned[0],
            east_m: self.body.pos_ned[1],
            alt_amsl_m: -self.body.pos_ned[2],
            vel_ned_m_s: self.body.vel_ned,
            roll_rad,
            pitch_rad,
            yaw_rad,
            attitude: self.body.attitude,
            rate_rad_s: self.body.rate,
            airspeed_m_s: flow.airspeed,
            alpha_rad: flow.alpha,
            beta_rad: flow.beta,
            elevator_rad: controls.elevator,
            aileron_rad: controls.aileron,
            rudder_rad: controls.rudder,
            throttle: controls.throttle,
            specific_force_m_s2: self.specific_force,
            phase: self.phase,
            flags,
        }
    }

    /// Air that the equations can use: what is not finite is replaced by the last wind and the
    /// standard density.
    fn usable(&mut self, air: &AirAround) -> AirState {
        if air.wind_ned_m_s.iter().all(|w| w.is_finite()) {
            self.wind_ned = air.wind_ned_m_s;
            for (wind, bias) in self.wind_ned.iter_mut().zip(self.wind_bias) {
                *wind += bias;
            }
        }
        let density = if air.density_kg_m3.is_finite() && air.density_kg_m3 > 0.0 {
            air.density_kg_m3
        } else {
            AirAround::STANDARD_CALM.density_kg_m3
        };
        AirState {
            wind_ned: self.wind_ned,
            density,
        }
    }

    /// The servos' transition over half a step, kept while the step stays the same.
    fn lag_step(&mut self, dt: f64) -> LagStep {
        match self.half_step {
            Some((kept, lag)) if kept == dt => lag,
            _ => {
                let a = &self.dynamics.aircraft;
                let lag = LagStep::new(&a.surfaces, a.propulsion.lag_s, 0.5 * dt);
                self.half_step = Some((dt, lag));
                lag
            }
        }
    }

    /// What the surfaces do now.
    fn controls(&self) -> Controls {
        self.dynamics.controls(&self.servos, self.motor)
    }

    /// Servos and motor over half a step.
    fn drive(&mut self, lag: &LagStep, command: &SurfaceCommand) -> Controls {
        let angles = self.dynamics.servo_angles(command);
        lag.drive(&mut self.servos, &mut self.motor, &angles, command.throttle);
        self.controls()
    }

    fn fly(&mut self, dt: f64, air: &AirState, command: &SurfaceCommand, lag: &LagStep) {
        let start = self.controls();
        let middle = self.drive(lag, command);
        let end = self.drive(lag, command);
        self.advance(dt, air, &[start, middle, end]);
        self.touch_down();
    }

    /// One step of the rigid body; a step that leaves the finite numbers is not taken.
    fn advance(&mut self, dt: f64, air: &AirState, controls: &[Controls; 3]) {
        let (mut body, force) = self.dynamics.rk4(&self.body, controls, air, dt);
        let finite = body
            .pos_ned
            .iter()
            .chain(&body.vel_ned)
            .chain(&body.attitude)
            .chain(&body.rate)
            .chain(&force)
            .all(|v| v.is_finite());
        if !finite {
            self.flags.outside_model = true;
            self.body.rate = [0.0; 3];
            return;
        }
        self.flags.outside_model = false;
        for rate in &mut body.rate {
            if rate.abs() > HIGHEST_RATE_RAD_S {
                *rate = rate.clamp(-HIGHEST_RATE_RAD_S, HIGHEST_RATE_RAD_S);
                self.flags.outside_model = true;
            }
        }
        self.body = body;
        self.specific_force = force;
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

/// Attitude quaternion of roll, pitch and yaw (rad), body to NED.
pub fn quaternion(roll_rad: f64, pitch_rad: f64, yaw_rad: f64) -> [f64; 4] {
    let (sr, cr) = (0.5 * roll_rad).sin_cos();
    let (sp, cp) = (0.5 * pitch_rad).sin_cos();
    let (sy, cy) = (0.5 * yaw_rad).sin_cos();
    [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
}
