//! One multirotor in the air or on the ground.

use super::rotors::ROTORS;
use super::{Multirotor, inner_loops::InnerLoops, inner_loops::ThrustDemand};
use crate::dynamics::{
    AirState, Body, Inertia, StateDerivative, euler, flow, quaternion, rk4, rotation,
};
use crate::error::FdmError;
use crate::state::{AirAround, FlightFlags, FlightPhase, FlightState};

/// Longest step, s: the inner loops of usual autopilots run at 400 Hz, and a step is short beside the motors' lag.
const LONGEST_STEP_S: f64 = 0.0025;
/// How far the weight must be exceeded to leave the ground, as a share of it.
const LIFT_OFF: f64 = 1.0;

/// A multirotor that flies, with the inner loops of its autopilot.
#[derive(Debug, Clone, PartialEq)]
pub struct MultirotorSim {
    aircraft: Multirotor,
    inertia: Inertia,
    inner: InnerLoops,
    body: Body,
    /// Speed of each rotor, rad/s.
    speeds: [f64; ROTORS],
    ground_amsl_m: f64,
    phase: FlightPhase,
    flags: FlightFlags,
    specific_force: [f64; 3],
    air: AirState,
}

impl MultirotorSim {
    /// A multirotor on the ground, motors off.
    ///
    /// # Errors
    /// As [`Multirotor::check`].
    pub fn on_ground(
        aircraft: &Multirotor,
        north_m: f64,
        east_m: f64,
        ground_amsl_m: f64,
        heading_deg: f64,
    ) -> Result<Self, FdmError> {
        let down = -(ground_amsl_m + aircraft.rest_height_m);
        let mut sim = Self::still(aircraft, [north_m, east_m, down], heading_deg)?;
        sim.ground_amsl_m = ground_amsl_m;
        sim.flags.on_ground = true;
        Ok(sim)
    }

    /// A multirotor that hovers in still standard air.
    ///
    /// # Errors
    /// As [`Multirotor::check`].
    pub fn airborne(
        aircraft: &Multirotor,
        north_m: f64,
        east_m: f64,
        alt_amsl_m: f64,
        heading_deg: f64,
    ) -> Result<Self, FdmError> {
        let mut sim = Self::still(aircraft, [north_m, east_m, -alt_amsl_m], heading_deg)?;
        let each_n = aircraft.body.mass_kg * air::STANDARD_GRAVITY_M_S2 / ROTORS as f64;
        sim.speeds = [aircraft.rotors.speed_for(each_n, 0.0, sim.air.density); ROTORS];
        sim.phase = FlightPhase::Flying;
        Ok(sim)
    }

    fn still(aircraft: &Multirotor, pos_ned: [f64; 3], heading_deg: f64) -> Result<Self, FdmError> {
        aircraft.check()?;
        Ok(Self {
            inertia: Inertia::of(&aircraft.body),
            inner: InnerLoops::default(),
            body: Body {
                pos_ned,
                vel_ned: [0.0; 3],
                attitude: quaternion(0.0, 0.0, heading_deg.to_radians()),
                rate: [0.0; 3],
            },
            speeds: [0.0; ROTORS],
            ground_amsl_m: f64::NEG_INFINITY,
            phase: FlightPhase::OnGround,
            flags: FlightFlags::default(),
            specific_force: [0.0, 0.0, -air::STANDARD_GRAVITY_M_S2],
            air: AirState {
                wind_ned: [0.0; 3],
                density: AirAround::STANDARD_CALM.density_kg_m3,
            },
            aircraft: aircraft.clone(),
        })
    }

    /// The aircraft that flies.
    pub fn aircraft(&self) -> &Multirotor {
        &self.aircraft
    }

    /// Speed of each rotor, rad/s, in the order of [`super::MotorOutputs`].
    pub fn rotor_speeds_rad_s(&self) -> [f64; ROTORS] {
        self.speeds
    }

    /// Height of the ground under it, m above mean sea level.
    pub fn set_ground_amsl_m(&mut self, ground_amsl_m: f64) {
        if ground_amsl_m.is_finite() {
            self.ground_amsl_m = ground_amsl_m;
        }
    }

    /// Replaces velocity, attitude and rate; the rotors stay. Values that are not finite are ignored.
    pub fn set_motion(&mut self, vel_ned_m_s: [f64; 3], attitude: [f64; 4], rate_rad_s: [f64; 3]) {
        if self.body.set_motion(vel_ned_m_s, attitude, rate_rad_s) {
            self.phase = FlightPhase::Flying;
        }
    }

    /// Advances by `dt_s` with the inner loops following `demand`; none: motors off. The air is held.
    pub fn step(&mut self, dt_s: f64, air: &AirAround, demand: Option<&ThrustDemand>) {
        self.advance(dt_s, air, |sim, dt| match demand {
            Some(demand) => sim.inner.step(
                dt,
                &sim.aircraft,
                &sim.body,
                sim.air.density,
                sim.phase == FlightPhase::Flying,
                demand,
            ),
            None => {
                sim.inner = InnerLoops::default();
                [0.0; ROTORS]
            }
        });
    }

    /// Advances by `dt_s` with the rotors driven to shares of their highest speed, 0 to 1.
    pub fn step_rotors(&mut self, dt_s: f64, air: &AirAround, shares: &[f64; ROTORS]) {
        let commands = shares.map(|share| share.clamp(0.0, 1.0) * self.aircraft.rotors.max_rad_s);
        self.advance(dt_s, air, |_, _| commands);
    }

    fn advance(
        &mut self,
        dt_s: f64,
        air: &AirAround,
        mut commands: impl FnMut(&mut Self, f64) -> [f64; ROTORS],
    ) {
        if !(dt_s.is_finite() && dt_s > 0.0) {
            return;
        }
        if air.wind_ned_m_s.iter().all(|w| w.is_finite()) {
            self.air.wind_ned = air.wind_ned_m_s;
        }
        if air.density_kg_m3.is_finite() && air.density_kg_m3 > 0.0 {
            self.air.density = air.density_kg_m3;
        }
        let count = (dt_s / LONGEST_STEP_S - 1e-9).ceil().max(1.0);
        let dt = dt_s / count;
        for _ in 0..count as usize {
            let commands = commands(self, dt);
            self.substep(dt, &commands);
        }
    }

    fn substep(&mut self, dt: f64, commands: &[f64; ROTORS]) {
        let rotors = self.aircraft.rotors;
        let middle = rotors.lagged(&self.speeds, commands, 0.5 * dt);
        let end = rotors.lagged(&middle, commands, 0.5 * dt);
        let stages = [self.speeds, middle, end];
        if self.phase != FlightPhase::Flying {
            self.speeds = end;
            self.stand();
            return;
        }
        let (body, force) = rk4(&self.body, dt, |stage, body| {
            self.derivative(body, &stages[stage])
        });
        let held = self.body.step_to(body, &force);
        self.flags.outside_model = held != Some(false);
        if held.is_none() {
            return;
        }
        self.speeds = end;
        self.specific_force = force;
        self.touch_down();
    }

    /// Force (N) and moment (N m) about the centre of gravity, body axes, in a flow (m/s) and at a rate (rad/s).
    fn load(
        &self,
        flow: &[f64; 3],
        rate: &[f64; 3],
        speeds: &[f64; ROTORS],
    ) -> ([f64; 3], [f64; 3]) {
        let (rotors, density) = (&self.aircraft.rotors, self.air.density);
        let area = &self.aircraft.drag.area_m2;
        let speed = flow.iter().map(|v| v * v).sum::<f64>().sqrt();
        let mut force: [f64; 3] =
            std::array::from_fn(|k| -0.5 * density * area[k] * speed * flow[k]);
        let mut moment = [0.0; 3];
        let [p, q, r] = *rate;
        for (k, &turn) in speeds.iter().enumerate() {
            let [x, y, z] = rotors.place_m(k);
            // The flow at the hub: that of the body and of its rotation.
            let u = flow[0] + q * z - r * y;
            let v = flow[1] + r * x - p * z;
            let w = flow[2] + p * y - q * x;
            let thrust = rotors.thrust_n(turn, -w, density);
            let torque = rotors.torque_n_m(turn, -w, density);
            let across = -rotors.drag_n_s2_rad_m * turn;
            let at_hub = [across * u, across * v, -thrust];
            for axis in 0..3 {
                force[axis] += at_hub[axis];
            }
            moment[0] += y * at_hub[2] - z * at_hub[1];
            moment[1] += z * at_hub[0] - x * at_hub[2];
            moment[2] += x * at_hub[1] - y * at_hub[0] + rotors.torque_sign(k) * torque;
        }
        (force, moment)
    }

    fn derivative(&self, body: &Body, speeds: &[f64; ROTORS]) -> StateDerivative {
        let m = rotation(&body.attitude);
        let flow = flow(&m, &body.vel_ned, &self.air.wind_ned);
        let (force, moment) = self.load(&flow.body, &body.rate, speeds);
        let specific_force = force.map(|f| f / self.aircraft.body.mass_kg);
        let rate = self.inertia.angular_acceleration(&body.rate, &moment);
        StateDerivative::of(body, &m, specific_force, rate)
    }

    /// Rotors turn on the ground until they lift more than the weight.
    fn stand(&mut self) {
        self.rest();
        let (rotors, density) = (&self.aircraft.rotors, self.air.density);
        let lift_n: f64 = self
            .speeds
            .iter()
            .map(|&speed| rotors.thrust_n(speed, 0.0, density))
            .sum();
        let weight_n = self.aircraft.body.mass_kg * air::STANDARD_GRAVITY_M_S2;
        if lift_n > LIFT_OFF * weight_n {
            self.phase = FlightPhase::Flying;
            self.flags.hard_landing = false;
        }
    }

    fn touch_down(&mut self) {
        let rest_down = -(self.ground_amsl_m + self.aircraft.rest_height_m);
        if self.body.pos_ned[2] < rest_down || self.body.vel_ned[2] <= 0.0 {
            return;
        }
        self.flags.hard_landing |= self.body.vel_ned[2] > self.aircraft.hard_sink_m_s;
        let [_, _, yaw] = euler(&rotation(&self.body.attitude));
        self.body.attitude = quaternion(0.0, 0.0, yaw);
        self.phase = FlightPhase::OnGround;
        self.rest();
    }

    /// Level and without motion on the ground, whatever the rotors lift.
    fn rest(&mut self) {
        self.body.pos_ned[2] = -(self.ground_amsl_m + self.aircraft.rest_height_m);
        self.body.vel_ned = [0.0; 3];
        self.body.rate = [0.0; 3];
        self.specific_force = [0.0, 0.0, -air::STANDARD_GRAVITY_M_S2];
    }

    /// Electrical power now, W; 0 without a battery.
    pub fn power_w(&self) -> f64 {
        let Some(battery) = self.aircraft.battery else {
            return 0.0;
        };
        let (rotors, density) = (&self.aircraft.rotors, self.air.density);
        let m = rotation(&self.body.attitude);
        let flow = flow(&m, &self.body.vel_ned, &self.air.wind_ned);
        let shaft_w = self
            .speeds
            .iter()
            .map(|&speed| speed * rotors.torque_n_m(speed, -flow.body[2], density))
            .sum();
        battery.power_of_w(shaft_w)
    }

    /// The state now. Surfaces stand at zero; the throttle is the mean of the rotors' squared share of their highest
    /// speed.
    pub fn state(&self) -> FlightState {
        let m = rotation(&self.body.attitude);
        let flow = flow(&m, &self.body.vel_ned, &self.air.wind_ned);
        let max = self.aircraft.rotors.max_rad_s;
        let square = |speed: f64| (speed / max) * (speed / max);
        let mut flags = self.flags;
        flags.on_ground = self.phase != FlightPhase::Flying;
        flags.overspeed = flow.airspeed > self.aircraft.limits.airspeed_max_m_s;
        FlightState {
            throttle: self.speeds.iter().map(|&s| square(s)).sum::<f64>() / ROTORS as f64,
            specific_force_m_s2: self.specific_force,
            phase: self.phase,
            flags,
            ..FlightState::of_body(&self.body, &m, &flow)
        }
    }
}
