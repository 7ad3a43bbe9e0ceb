//! One vehicle in the air or on the ground: servos, motor, rigid body, launcher and landing slide.

mod delay;
mod ground;

use crate::aircraft::Aircraft;
use crate::dynamics::{AirState, Body, Controls, Dynamics, flow, quaternion, rotation};
use crate::error::FdmError;
use crate::extended::{ExtendedAircraft, SensorErrors};
use crate::servo::{LagStep, Servo};
use crate::state::{AirAround, FlightFlags, FlightPhase, FlightState, SurfaceCommand, sanitised};
use crate::trim::{self, Trim};
use delay::DelayLine;
use std::sync::Arc;

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
    phase: FlightPhase,
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
        aircraft: &Arc<Aircraft>,
        north_m: f64,
        east_m: f64,
        alt_amsl_m: f64,
        heading_deg: f64,
        airspeed_m_s: f64,
    ) -> Result<Self, FdmError> {
        let extended = ExtendedAircraft::of(aircraft)?;
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
        aircraft: &Arc<Aircraft>,
        north_m: f64,
        east_m: f64,
        ground_amsl_m: f64,
        heading_deg: f64,
    ) -> Result<Self, FdmError> {
        let extended = ExtendedAircraft::of(aircraft)?;
        let down = -(ground_amsl_m + aircraft.ground.rest_height_m);
        let mut sim = Self::still(&extended, [north_m, east_m, down], heading_deg);
        sim.ground_amsl_m = ground_amsl_m;
        sim.body.attitude = quaternion(
            0.0,
            aircraft.ground.launch_pitch_deg.to_radians(),
            sim.launch_heading_rad,
        );
        sim.specific_force = sim.force_at_rest();
        sim.flags.on_ground = true;
        Ok(sim)
    }

    fn still(extended: &ExtendedAircraft, pos_ned: [f64; 3], heading_deg: f64) -> Self {
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
            phase: FlightPhase::OnGround,
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
        // The trim is where the surfaces stand, the command what makes them stand there.
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
        self.phase = FlightPhase::Flying;
        self.flags = FlightFlags::default();
    }

    /// Adds the air's motion to the vehicle's, so that its flight through the air stays the same.
    pub(crate) fn drift_with(&mut self, wind_ned_m_s: [f64; 3]) {
        for (k, wind) in wind_ned_m_s.into_iter().enumerate() {
            self.body.vel_ned[k] += wind - self.wind_ned[k];
        }
        self.wind_ned = wind_ned_m_s;
    }

    /// Replaces motion and attitude (for tests, system identification and replays); the servos
    /// and the motor stay. The quaternion is normalised; values that are not finite are ignored.
    pub fn set_motion(&mut self, vel_ned_m_s: [f64; 3], attitude: [f64; 4], rate_rad_s: [f64; 3]) {
        if self.body.set_motion(vel_ned_m_s, attitude, rate_rad_s) {
            self.phase = FlightPhase::Flying;
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

    /// The state as the vehicle's own sensors measure it, with the errors of its mechanisms.
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
        // The delay counts calls, not the inner steps: a command changes once a call.
        let calls = DelayLine::calls(self.aircraft().surfaces.delay_s, dt_s);
        let command = self.delay.pass(&self.last, calls);
        // A long tick is cut so that no mode of the aircraft is stepped too coarsely; equal steps
        // keep the servos' exact transition valid for all.
        let count = self.dynamics.steps_in(dt_s);
        let dt = dt_s / count;
        let lag = self.lag_step(dt);
        for _ in 0..count as usize {
            match self.phase {
                FlightPhase::Flying => self.fly(dt, &air, &command, &lag),
                FlightPhase::OnGround => self.stand(&lag, &command),
                FlightPhase::Launching => self.launch(dt, &air, &command, &lag),
                FlightPhase::Sliding => self.slide(dt, &lag, &command),
            }
        }
    }

    /// The state now.
    pub fn state(&self) -> FlightState {
        let m = rotation(&self.body.attitude);
        let flow = flow(&m, &self.body.vel_ned, &self.wind_ned);
        let controls = self.controls();
        let mut flags = self.flags;
        if self.phase == FlightPhase::Flying {
            let (attached, straight) = self.dynamics.flow_is_valid(flow.alpha, flow.beta);
            flags.stalled = !attached;
            flags.sideslip = !straight;
            flags.overspeed = flow.airspeed > self.aircraft().limits.airspeed_max_m_s;
        }
        flags.on_ground = self.phase != FlightPhase::Flying;
        FlightState {
            elevator_rad: controls.elevator,
            aileron_rad: controls.aileron,
            rudder_rad: controls.rudder,
            throttle: controls.throttle,
            specific_force_m_s2: self.specific_force,
            phase: self.phase,
            flags,
            ..FlightState::of_body(&self.body, &m, &flow)
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
        let (body, force) = self.dynamics.rk4(&self.body, controls, air, dt);
        let held = self.body.step_to(body, &force);
        self.flags.outside_model = held != Some(false);
        if held.is_some() {
            self.specific_force = force;
        }
    }
}
