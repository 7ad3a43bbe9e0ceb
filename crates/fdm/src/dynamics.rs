//! The equations of motion: aerodynamic and propulsive force, moment, and the rigid body, the same
//! for one vehicle and for many.

use air::STANDARD_GRAVITY_M_S2;

use crate::aircraft::{Aircraft, MassProperties};
use crate::scalar::{angle, bounded, larger};
use std::sync::Arc;

/// Airspeed below which the dimensionless rates stop growing, m/s.
const AIRSPEED_FLOOR_M_S: f64 = 1.0;
/// Longest step of the rigid body, s.
const LONGEST_STEP_S: f64 = 0.02;
/// Longest step over the time constant of the roll mode.
const STEP_OF_ROLL_TIME: f64 = 0.5;
/// Width of the passage from the linear model to a flat plate beyond stall, rad.
const STALL_BLEND_RAD: f64 = 0.17;

/// An aircraft's constants in the form in which the equations use them (SI, radians).
#[derive(Debug, Clone, PartialEq)]
pub struct Dynamics {
    pub(crate) aircraft: Arc<Aircraft>,
    inverse_mass: f64,
    inertia: Inertia,
    induced: f64,
    alpha_min: f64,
    alpha_max: f64,
    beta_max: f64,
    longest_step_s: f64,
}

/// Position, velocity, attitude and rotation of a rigid body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Metres north, east and *down* from the frame's origin.
    pub pos_ned: [f64; 3],
    /// Velocity over ground in NED, m/s.
    pub vel_ned: [f64; 3],
    /// Attitude quaternion (w, x, y, z), body to NED.
    pub attitude: [f64; 4],
    /// Angular rate in body axes, rad/s.
    pub rate: [f64; 3],
}

/// Angular rate beyond which the model has no meaning, rad/s: it is held there.
const HIGHEST_RATE_RAD_S: f64 = 30.0;

impl Body {
    /// Replaces motion and attitude, whose quaternion is normalised; returns whether all values are finite, as otherwise
    /// nothing changes.
    pub(crate) fn set_motion(
        &mut self,
        vel_ned_m_s: [f64; 3],
        attitude: [f64; 4],
        rate_rad_s: [f64; 3],
    ) -> bool {
        let norm = attitude.iter().map(|part| part * part).sum::<f64>().sqrt();
        let finite = vel_ned_m_s.iter().chain(&rate_rad_s).all(|v| v.is_finite());
        let sound = finite && norm.is_finite() && norm > 0.0;
        if sound {
            self.vel_ned = vel_ned_m_s;
            self.attitude = attitude.map(|part| part / norm);
            self.rate = rate_rad_s;
        }
        sound
    }

    /// Takes the state at the end of a step with the specific force there, its rate held at the highest; returns whether
    /// it was. A state that leaves the numbers must not spread NaN through the mission: none is returned, and the body
    /// keeps its last state without rotation.
    pub(crate) fn step_to(&mut self, mut next: Self, force: &[f64; 3]) -> Option<bool> {
        let motion = next.pos_ned.iter().chain(&next.vel_ned);
        let numbers = motion.chain(&next.attitude).chain(&next.rate).chain(force);
        if !numbers.into_iter().all(|v| v.is_finite()) {
            self.rate = [0.0; 3];
            return None;
        }
        let mut is_held = false;
        for rate in &mut next.rate {
            is_held |= rate.abs() > HIGHEST_RATE_RAD_S;
            *rate = rate.clamp(-HIGHEST_RATE_RAD_S, HIGHEST_RATE_RAD_S);
        }
        *self = next;
        Some(is_held)
    }
}

/// What moves the aircraft at one instant: surface angles as they are (rad) and motor state 0…1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Controls {
    /// Elevator, trailing edge down positive.
    pub elevator: f64,
    /// Aileron, (left − right)/2.
    pub aileron: f64,
    /// Rudder, trailing edge left positive.
    pub rudder: f64,
    /// Motor state, 0 to 1.
    pub throttle: f64,
}

/// The air at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AirState {
    /// Wind vector in NED, m/s.
    pub wind_ned: [f64; 3],
    /// Density, kg/m³.
    pub density: f64,
}

/// Time derivative of a [`Body`], and the specific force on the way.
#[derive(Debug, Clone, Copy)]
pub struct StateDerivative {
    /// Of position: the velocity, NED, m/s.
    pub vel_ned: [f64; 3],
    /// Of velocity, NED, m/s².
    pub acc_ned: [f64; 3],
    /// Of the attitude quaternion, 1/s.
    pub attitude: [f64; 4],
    /// Of the angular rate, body axes, rad/s².
    pub rate: [f64; 3],
    /// What an accelerometer at the centre of gravity feels, body axes, m/s².
    pub specific_force: [f64; 3],
}

/// The inertia of a rigid body, ready for Euler's equation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Inertia {
    body: MassProperties,
    /// Inverse of the inertia matrix: xx, yy, zz, xz.
    inverse: [f64; 4],
}

impl Inertia {
    /// Prepares the inertia of a checked body.
    pub fn of(body: &MassProperties) -> Self {
        let b = body;
        let det = b.ixx_kg_m2 * b.izz_kg_m2 - b.ixz_kg_m2 * b.ixz_kg_m2;
        Self {
            body: *body,
            inverse: [
                b.izz_kg_m2 / det,
                1.0 / b.iyy_kg_m2,
                b.ixx_kg_m2 / det,
                b.ixz_kg_m2 / det,
            ],
        }
    }

    /// Angular acceleration (rad/s²) at a rate (rad/s) by a moment (N m), body axes: I ω̇ = M − ω × I ω.
    #[inline(always)]
    pub fn angular_acceleration(&self, rate: &[f64; 3], moment: &[f64; 3]) -> [f64; 3] {
        let b = &self.body;
        let [p, q, r] = *rate;
        // Angular momentum; the product of inertia couples roll and yaw.
        let momentum = [
            p * b.ixx_kg_m2 - r * b.ixz_kg_m2,
            q * b.iyy_kg_m2,
            r * b.izz_kg_m2 - p * b.ixz_kg_m2,
        ];
        let net = [
            moment[0] - (q * momentum[2] - r * momentum[1]),
            moment[1] - (r * momentum[0] - p * momentum[2]),
            moment[2] - (p * momentum[1] - q * momentum[0]),
        ];
        let [xx, yy, zz, xz] = self.inverse;
        [
            net[0] * xx + net[2] * xz,
            net[1] * yy,
            net[2] * zz + net[0] * xz,
        ]
    }
}

impl StateDerivative {
    /// The derivative for a body with rotation `m` on which a specific force (m/s²) acts and an angular
    /// acceleration (rad/s²), both in body axes.
    #[inline(always)]
    pub(crate) fn of(
        body: &Body,
        m: &[[f64; 3]; 3],
        specific_force: [f64; 3],
        rate: [f64; 3],
    ) -> Self {
        let out = |row: &[f64; 3]| {
            row[0] * specific_force[0] + row[1] * specific_force[1] + row[2] * specific_force[2]
        };
        let [w, x, y, z] = body.attitude;
        let [p, q, r] = body.rate;
        Self {
            vel_ned: body.vel_ned,
            acc_ned: [out(&m[0]), out(&m[1]), out(&m[2]) + STANDARD_GRAVITY_M_S2],
            attitude: [
                -(x * p + y * q + z * r) * 0.5,
                (w * p + y * r - z * q) * 0.5,
                (w * q + z * p - x * r) * 0.5,
                (w * r + x * q - y * p) * 0.5,
            ],
            rate,
            specific_force,
        }
    }
}

/// Airspeed and flow angles.
#[derive(Debug, Clone, Copy)]
pub struct Flow {
    /// True airspeed, m/s.
    pub airspeed: f64,
    /// Angle of attack, rad.
    pub alpha: f64,
    /// Sideslip, rad.
    pub beta: f64,
    /// Air velocity in body axes, m/s.
    pub body: [f64; 3],
    /// Its magnitude in the plane of symmetry, m/s.
    plane: f64,
}

/// Time constant of the roll mode at cruise and sea level, s: Ixx / (−Clp ρ V S b² / 4).
fn roll_time_s(aircraft: &Aircraft) -> f64 {
    let (wing, speed) = (&aircraft.wing, aircraft.limits.airspeed_cruise_m_s);
    let damping = -aircraft.roll.p * 1.225 * speed * wing.area_m2 * wing.span_m * wing.span_m / 4.0;
    aircraft.body.ixx_kg_m2 / damping
}

/// Drag per square of lift over that of least drag, 1/(π e AR); 0 where no Oswald factor is given.
pub(crate) fn induced_drag_factor(aircraft: &Aircraft) -> f64 {
    let aspect_ratio = aircraft.wing.span_m * aircraft.wing.span_m / aircraft.wing.area_m2;
    aircraft
        .drag
        .oswald
        .map_or(0.0, |e| 1.0 / (std::f64::consts::PI * e * aspect_ratio))
}

/// Rotation matrix body to NED, row by row.
#[inline(always)]
pub fn rotation(q: &[f64; 4]) -> [[f64; 3]; 3] {
    let [w, x, y, z] = *q;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let (xy, xz, yz) = (x * y, x * z, y * z);
    let (wx, wy, wz) = (w * x, w * y, w * z);
    [
        [(yy + zz) * -2.0 + 1.0, (xy - wz) * 2.0, (xz + wy) * 2.0],
        [(xy + wz) * 2.0, (xx + zz) * -2.0 + 1.0, (yz - wx) * 2.0],
        [(xz - wy) * 2.0, (yz + wx) * 2.0, (xx + yy) * -2.0 + 1.0],
    ]
}

/// Roll, pitch and yaw (rad; yaw in `(−π, π]`) of a rotation matrix body to NED.
#[inline(always)]
pub fn euler(m: &[[f64; 3]; 3]) -> [f64; 3] {
    let level = (m[2][1] * m[2][1] + m[2][2] * m[2][2]).sqrt();
    [
        angle(m[2][1], m[2][2]),
        angle(-m[2][0], level),
        angle(m[1][0], m[0][0]),
    ]
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

/// The flow that a body with rotation `m` meets.
#[inline(always)]
pub fn flow(m: &[[f64; 3]; 3], vel_ned: &[f64; 3], wind_ned: &[f64; 3]) -> Flow {
    let a = [
        vel_ned[0] - wind_ned[0],
        vel_ned[1] - wind_ned[1],
        vel_ned[2] - wind_ned[2],
    ];
    let into = |k: usize| m[0][k] * a[0] + m[1][k] * a[1] + m[2][k] * a[2];
    let body = [into(0), into(1), into(2)];
    let plane_squared = body[0] * body[0] + body[2] * body[2];
    let plane = plane_squared.sqrt();
    Flow {
        airspeed: (plane_squared + body[1] * body[1]).sqrt(),
        alpha: angle(body[2], body[0]),
        beta: angle(body[1], plane),
        body,
        plane,
    }
}

impl Dynamics {
    /// Prepares the constants of a checked aircraft.
    pub fn new(aircraft: &Arc<Aircraft>) -> Self {
        Self {
            aircraft: aircraft.clone(),
            inverse_mass: 1.0 / aircraft.body.mass_kg,
            inertia: Inertia::of(&aircraft.body),
            induced: induced_drag_factor(aircraft),
            alpha_min: aircraft.limits.alpha_min_deg.to_radians(),
            alpha_max: aircraft.limits.alpha_stall_deg.to_radians(),
            beta_max: aircraft.limits.beta_max_deg.to_radians(),
            longest_step_s: (STEP_OF_ROLL_TIME * roll_time_s(aircraft)).min(LONGEST_STEP_S),
        }
    }

    /// The aircraft whose equations these are.
    pub fn aircraft(&self) -> &Aircraft {
        &self.aircraft
    }

    /// Its mass, kg.
    pub fn mass_kg(&self) -> f64 {
        self.aircraft.body.mass_kg
    }

    /// Longest step of the rigid body, s: 20 ms, or half the time constant of the roll mode (the
    /// fastest) at cruise where that is shorter. RK4 then errs by less than 3e-4 of a transient
    /// per step; servos and motor are exact at any step.
    pub fn longest_step_s(&self) -> f64 {
        self.longest_step_s
    }

    /// Number of equal steps into which a time is cut.
    pub(crate) fn steps_in(&self, dt_s: f64) -> f64 {
        (dt_s / self.longest_step_s - 1e-9).ceil().max(1.0)
    }

    /// Whether the flow is inside the linear model: (not stalled, not side-slipping too far).
    pub fn flow_is_valid(&self, alpha: f64, beta: f64) -> (bool, bool) {
        (
            alpha <= self.alpha_max && alpha >= self.alpha_min,
            beta.abs() <= self.beta_max,
        )
    }

    /// Lift and drag coefficients; beyond stall they pass over to a flat plate's.
    #[inline(always)]
    fn lift_and_drag(&self, flow: &Flow, q_hat: f64, elevator: f64) -> (f64, f64, f64) {
        let (lift, drag) = (&self.aircraft.lift, &self.aircraft.drag);
        // Beyond stall the linear coefficients are held and fade into those of a flat plate;
        // smooth, so that a step of the integrator does not see a kink.
        let alpha = bounded(
            flow.alpha,
            self.alpha_min - STALL_BLEND_RAD,
            self.alpha_max + STALL_BLEND_RAD,
        );
        let beta = bounded(flow.beta, -2.0 * self.beta_max, 2.0 * self.beta_max);
        let cl = alpha * lift.alpha + q_hat * lift.q + elevator * lift.elevator + lift.zero;
        let over_min = cl - drag.min_drag_lift;
        let cd = alpha * (alpha * drag.alpha_squared + drag.alpha)
            + beta * (beta * drag.beta_squared + drag.beta)
            + elevator * elevator * drag.elevator_squared
            + over_min * over_min * self.induced
            + drag.zero;
        let beyond = larger(flow.alpha - self.alpha_max, self.alpha_min - flow.alpha);
        let excess = bounded(beyond, 0.0, STALL_BLEND_RAD) * (1.0 / STALL_BLEND_RAD);
        let stalled = excess * excess * (excess * -2.0 + 3.0);
        let inverse_plane = 1.0 / larger(flow.plane, 1e-6);
        let (sin, cos) = (flow.body[2] * inverse_plane, flow.body[0] * inverse_plane);
        let normal = sin * sin.abs() * 2.0;
        (
            cl + stalled * (normal * cos - cl),
            cd + stalled * (normal * sin + drag.zero - cd),
            alpha,
        )
    }

    /// Aerodynamic and propulsive force (N) and moment (N m) about the centre of gravity, body
    /// axes.
    #[inline(always)]
    pub fn load(
        &self,
        flow: &Flow,
        rate: &[f64; 3],
        controls: &Controls,
        density: f64,
    ) -> ([f64; 3], [f64; 3]) {
        let a = &self.aircraft;
        let speed = flow.airspeed;
        let half_rho = density * 0.5;
        let qbar_s = half_rho * speed * speed * a.wing.area_m2;
        // At rest the dimensionless rates would be infinite; the dynamic pressure that multiplies
        // them is nil.
        let per_2v = 0.5 / larger(speed, AIRSPEED_FLOOR_M_S);
        let p_hat = rate[0] * per_2v * a.wing.span_m;
        let q_hat = rate[1] * per_2v * a.wing.chord_m;
        let r_hat = rate[2] * per_2v * a.wing.span_m;
        let (cl, cd, alpha) = self.lift_and_drag(flow, q_hat, controls.elevator);
        let beta = bounded(flow.beta, -2.0 * self.beta_max, 2.0 * self.beta_max);
        let lateral = |d: &crate::aircraft::LateralDerivatives| {
            beta * d.beta
                + p_hat * d.p
                + r_hat * d.r
                + controls.aileron * d.aileron
                + controls.rudder * d.rudder
        };
        let cm = alpha * a.pitch.alpha
            + q_hat * a.pitch.q
            + controls.elevator * a.pitch.elevator
            + a.pitch.zero;

        let (drag, side, lift) = (qbar_s * cd, qbar_s * lateral(&a.side), qbar_s * cl);
        // Wind to body axes; at rest the pressure is nil and the direction does not matter.
        let floor = 1e-6;
        let inverse_plane = 1.0 / larger(flow.plane, floor);
        let inverse_speed = 1.0 / larger(speed, floor);
        let (sin_a, cos_a) = (flow.body[2] * inverse_plane, flow.body[0] * inverse_plane);
        let (sin_b, cos_b) = (flow.body[1] * inverse_speed, flow.plane * inverse_speed);
        let along = drag * cos_b + side * sin_b;
        let thrust = self.thrust(speed, controls.throttle, density);
        let force = [
            lift * sin_a - along * cos_a + thrust,
            side * cos_b - drag * sin_b,
            -(lift * cos_a) - along * sin_a,
        ];
        let cg = a.body.cg_ahead_m;
        let moment = [
            qbar_s * lateral(&a.roll) * a.wing.span_m,
            qbar_s * cm * a.wing.chord_m + force[2] * cg,
            qbar_s * lateral(&a.yaw) * a.wing.span_m - force[1] * cg,
        ];
        (force, moment)
    }

    /// Thrust, N.
    #[inline(always)]
    pub fn thrust(&self, airspeed: f64, throttle: f64, density: f64) -> f64 {
        self.aircraft
            .propulsion
            .thrust_n(airspeed, throttle, density)
    }

    /// The derivative of the state.
    #[inline(always)]
    pub fn derivative(&self, body: &Body, controls: &Controls, air: &AirState) -> StateDerivative {
        let m = rotation(&body.attitude);
        let flow = flow(&m, &body.vel_ned, &air.wind_ned);
        let (force, moment) = self.load(&flow, &body.rate, controls, air.density);
        let specific_force = force.map(|f| f * self.inverse_mass);
        let rate = self.angular_acceleration(&body.rate, &moment);
        StateDerivative::of(body, &m, specific_force, rate)
    }

    /// Angular acceleration (rad/s²) at a rate (rad/s) by a moment (N m), body axes, by Euler's
    /// equation, I ω̇ = M − ω × I ω.
    #[inline(always)]
    pub fn angular_acceleration(&self, rate: &[f64; 3], moment: &[f64; 3]) -> [f64; 3] {
        self.inertia.angular_acceleration(rate, moment)
    }

    /// One step of the classical fourth-order Runge-Kutta method with the controls known at its
    /// beginning, middle and end, and the air held. Returns the new state and the specific force
    /// at its end.
    #[inline(always)]
    pub fn rk4(
        &self,
        body: &Body,
        controls: &[Controls; 3],
        air: &AirState,
        dt: f64,
    ) -> (Body, [f64; 3]) {
        rk4(body, dt, |stage, body| {
            self.derivative(body, &controls[stage], air)
        })
    }
}

/// One step of the classical fourth-order Runge-Kutta method. `slope` is asked for the beginning (0), twice for the
/// middle (1) and for the end (2) of the step. Returns the new state and the specific force at its end.
#[inline(always)]
pub(crate) fn rk4(
    body: &Body,
    dt: f64,
    slope: impl Fn(usize, &Body) -> StateDerivative,
) -> (Body, [f64; 3]) {
    let k1 = slope(0, body);
    let k2 = slope(1, &advance(body, &k1, 0.5 * dt));
    let k3 = slope(1, &advance(body, &k2, 0.5 * dt));
    let k4 = slope(2, &advance(body, &k3, dt));
    let sixth = dt / 6.0;
    let mix = |a: f64, b: f64, c: f64, d: f64| (a + (b + c) * 2.0 + d) * sixth;
    let mut new = *body;
    for k in 0..3 {
        new.pos_ned[k] += mix(k1.vel_ned[k], k2.vel_ned[k], k3.vel_ned[k], k4.vel_ned[k]);
        new.vel_ned[k] += mix(k1.acc_ned[k], k2.acc_ned[k], k3.acc_ned[k], k4.acc_ned[k]);
        new.rate[k] += mix(k1.rate[k], k2.rate[k], k3.rate[k], k4.rate[k]);
    }
    for k in 0..4 {
        new.attitude[k] += mix(
            k1.attitude[k],
            k2.attitude[k],
            k3.attitude[k],
            k4.attitude[k],
        );
    }
    let [w, x, y, z] = new.attitude;
    // Integration lets the quaternion's length drift; renormalised at each step it stays a
    // rotation.
    let scale = 1.0 / (w * w + x * x + y * y + z * z).sqrt();
    new.attitude = new.attitude.map(|part| part * scale);
    (new, k4.specific_force)
}

/// The state moved along a slope for `dt`.
#[inline(always)]
fn advance(body: &Body, slope: &StateDerivative, dt: f64) -> Body {
    let mut new = *body;
    for k in 0..3 {
        // Position does not enter the forces; only its final value is needed.
        new.vel_ned[k] += slope.acc_ned[k] * dt;
        new.rate[k] += slope.rate[k] * dt;
    }
    for k in 0..4 {
        new.attitude[k] += slope.attitude[k] * dt;
    }
    new
}
