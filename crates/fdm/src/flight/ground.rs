//! On the launcher, along its rail, and sliding to rest after touch-down.
//!
//! Contact is kinematic: no springs that would shorten the step of the rigid body.

use super::FlightSim;
use crate::dynamics::{AirState, flow, quaternion, rotation};
use crate::scalar::angle;
use crate::servo::LagStep;
use crate::state::{FlightPhase, SurfaceCommand};

/// How far below the ground a climbing aircraft counts as having hit it, m.
const CLIMBING_CONTACT_M: f64 = 0.5;
/// Time in which a sliding aircraft comes level, s.
const LEVELLING_TIME_S: f64 = 0.2;

impl FlightSim {
    fn rest_down(&self) -> f64 {
        -(self.ground_amsl_m + self.dynamics.aircraft.ground.rest_height_m)
    }

    /// What an accelerometer shows of the ground that carries the aircraft, body, m/s².
    pub(super) fn force_at_rest(&self) -> [f64; 3] {
        rotation(&self.body.attitude)[2].map(|down| -air::STANDARD_GRAVITY_M_S2 * down)
    }

    pub(super) fn touch_down(&mut self) {
        let depth = self.body.pos_ned[2] - self.rest_down();
        // Climbing out from the launcher, or into a slope?
        if depth < 0.0 || (self.body.vel_ned[2] < 0.0 && depth < CLIMBING_CONTACT_M) {
            return;
        }
        let ground = &self.dynamics.aircraft.ground;
        if self.body.vel_ned[2] > ground.hard_sink_m_s {
            self.flags.hard_landing = true;
        }
        self.phase = FlightPhase::Sliding;
        self.body.pos_ned[2] = self.rest_down();
        self.body.vel_ned[2] = 0.0;
        self.body.rate = [0.0; 3];
    }

    /// On the belly: friction stops it, and it comes level.
    pub(super) fn slide(&mut self, dt: f64, lag: &LagStep, command: &SurfaceCommand) {
        self.drive(lag, command);
        self.drive(lag, command);
        let deceleration = self.dynamics.aircraft.ground.friction * air::STANDARD_GRAVITY_M_S2;
        let [north, east, _] = self.body.vel_ned;
        let speed = north.hypot(east);
        let left = (speed - deceleration * dt).max(0.0);
        let keep = if speed > 0.0 { left / speed } else { 0.0 };
        for k in 0..2 {
            self.body.pos_ned[k] += 0.5 * (1.0 + keep) * dt * self.body.vel_ned[k];
            self.body.vel_ned[k] *= keep;
        }
        self.body.pos_ned[2] = self.rest_down();
        let m = rotation(&self.body.attitude);
        let fade = (-dt / LEVELLING_TIME_S).exp();
        let level = (m[2][1] * m[2][1] + m[2][2] * m[2][2]).sqrt();
        let roll = angle(m[2][1], m[2][2]) * fade;
        let pitch = angle(-m[2][0], level) * fade;
        let yaw = angle(m[1][0], m[0][0]);
        self.body.attitude = quaternion(roll, pitch, yaw);
        self.specific_force = [-deceleration, 0.0, -air::STANDARD_GRAVITY_M_S2];
        if left == 0.0 {
            self.phase = FlightPhase::OnGround;
            self.launch_heading_rad = yaw;
            self.specific_force = self.force_at_rest();
        }
    }

    pub(super) fn stand(&mut self, lag: &LagStep, command: &SurfaceCommand) {
        self.drive(lag, command);
        self.drive(lag, command);
        self.body.pos_ned[2] = self.rest_down();
        self.body.vel_ned = [0.0; 3];
        self.body.rate = [0.0; 3];
        self.specific_force = self.force_at_rest();
        if command.launch {
            let pitch = self.dynamics.aircraft.ground.launch_pitch_deg.to_radians();
            self.body.attitude = quaternion(0.0, pitch, self.launch_heading_rad);
            self.flags.hard_landing = false;
            self.phase = FlightPhase::Launching;
        }
    }

    /// Along the rail at constant acceleration until the airspeed suffices.
    pub(super) fn launch(
        &mut self,
        dt: f64,
        air: &AirState,
        command: &SurfaceCommand,
        lag: &LagStep,
    ) {
        self.drive(lag, command);
        self.drive(lag, command);
        let ground = &self.dynamics.aircraft.ground;
        let acceleration = ground.launch_acceleration_m_s2;
        let m = rotation(&self.body.attitude);
        for (k, row) in m.iter().enumerate() {
            let along = row[0];
            let before = self.body.vel_ned[k];
            self.body.vel_ned[k] += acceleration * along * dt;
            self.body.pos_ned[k] += 0.5 * (before + self.body.vel_ned[k]) * dt;
        }
        let gravity = air::STANDARD_GRAVITY_M_S2;
        self.specific_force = [acceleration - gravity * m[2][0], 0.0, -gravity * m[2][2]];
        if flow(&m, &self.body.vel_ned, &air.wind_ned).body[0] >= ground.launch_airspeed_m_s {
            self.phase = FlightPhase::Flying;
        }
    }
}
