//! The aircraft of the truth: its numbers read from the text of its file by a reader of its own,
//! and its equations of motion in body axes with Euler angles (Stevens & Lewis 2003, ch. 2).

use std::collections::BTreeMap;

use rand::Rng;

use super::gusts::Gust;
use crate::random::normal;

/// Standard gravity, m/s².
pub const GRAVITY: f64 = 9.806_65;
/// Number of states: u v w, p q r, roll pitch yaw, height, three surfaces and their rates, motor.
pub const STATES: usize = 17;

/// Numbers of an aircraft by "table.key".
#[derive(Debug, Clone, PartialEq)]
pub struct Airframe {
    numbers: BTreeMap<String, f64>,
    /// Whether it has elevons.
    pub elevons: bool,
    /// Whether thrust follows the proportional law.
    pub proportional: bool,
    /// Cruise, m/s.
    pub cruise_m_s: f64,
    /// Span, m.
    pub span_m: f64,
    /// What the hidden effects do to forces and moments.
    pub hidden: HiddenAerodynamics,
}

/// What hidden effects do beyond changed numbers: laws that the file cannot say.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HiddenAerodynamics {
    /// Added to the lift by angle of attack times the square of its excess over 2°.
    pub lift_break: f64,
    /// Pitching moment by the square of the angle of attack's departure from 4°, 1/rad².
    pub pitch_up: f64,
    /// Elevator's effect lost per relative excess of dynamic pressure over cruise.
    pub elastic: f64,
    /// Factor of the aileron's effect, now.
    pub aileron_fade: f64,
    /// Added drag, now.
    pub ice_drag: f64,
    /// Added roll damping by the magnitude of the dimensionless rate.
    pub damping_growth: f64,
    /// Share of thrust lost in proportion to throttle.
    pub thrust_by_throttle: f64,
    /// Added drag in proportion to the angle of attack.
    pub drag_by_alpha: f64,
    /// Added moments of inertia, as parts.
    pub inertia_part: f64,
}

/// Airspeed and angles of the flow.
#[derive(Debug, Clone, Copy)]
pub struct AirData {
    /// Airspeed, m/s.
    pub speed: f64,
    /// Angle of attack, rad.
    pub alpha: f64,
    /// Sideslip, rad.
    pub beta: f64,
}

/// What the air meets.
struct Onflow {
    flow: AirData,
    /// Dynamic pressure times area, N.
    pressure: f64,
    /// Rates relative to the air, made dimensionless by half a span, chord, span.
    turn: [f64; 3],
    /// Elevator, aileron, rudder, rad.
    surface: [f64; 3],
}

/// Derivatives, and the specific force on the way.
pub struct StateDerivatives {
    /// Of the states.
    pub of: [f64; STATES],
    /// Specific force, body axes, m/s².
    pub force: [f64; 3],
}

impl Airframe {
    /// Reads the text of an aircraft file; none if a needed number is not there.
    pub fn read(text: &str) -> Option<Self> {
        let mut numbers = BTreeMap::new();
        let (mut table, mut elevons, mut proportional) = (String::new(), false, false);
        for line in text.lines() {
            let line = line.split('#').next().unwrap_or("").trim();
            if let Some(name) = line.strip_prefix('[') {
                table = name.trim_matches(['[', ']']).to_owned();
            } else if let Some((key, value)) = line.split_once('=') {
                let value = value.trim();
                elevons |= value == "\"elevons\"";
                proportional |= value == "\"proportional\"";
                if let Ok(number) = value.parse() {
                    numbers.insert(format!("{table}.{}", key.trim()), number);
                }
            }
        }
        let get = |key: &str| numbers.get(key).copied();
        let (cruise_m_s, span_m) = (get("limits.airspeed_cruise_m_s")?, get("wing.span_m")?);
        for key in [
            "body.mass_kg",
            "body.ixx_kg_m2",
            "lift.alpha",
            "pitch.q",
            "roll.p",
        ] {
            get(key)?;
        }
        Some(Self {
            numbers,
            elevons,
            proportional,
            cruise_m_s,
            span_m,
            hidden: HiddenAerodynamics {
                aileron_fade: 1.0,
                ..HiddenAerodynamics::default()
            },
        })
    }

    /// A number, 0 where the file has none.
    pub fn n(&self, key: &str) -> f64 {
        self.numbers.get(key).copied().unwrap_or(0.0)
    }

    /// A number to change.
    pub fn set(&mut self, key: &str, change: impl Fn(f64) -> f64) {
        let value = change(self.n(key));
        self.numbers.insert(key.to_owned(), value);
    }

    /// Makes this one of many built to the same drawing: coefficients off by about a hundredth.
    pub fn vary_within_tolerance<R: Rng>(&mut self, rng: &mut R) {
        for (key, value) in &mut self.numbers {
            let part = match key.split('.').next() {
                Some("lift" | "side" | "roll" | "yaw" | "drag") => 0.008,
                Some("pitch" | "body") => 0.004,
                _ => 0.0,
            };
            *value *= 1.0 + part * normal(rng);
        }
        // Every aircraft is trimmed by hand: what its parts are off in lift and pitch is taken out but
        // for this much.
        let lift = 0.002 * normal(rng);
        self.set("lift.zero", |v| v + lift);
        let moment = 0.0004 * normal(rng);
        self.set("pitch.zero", |v| v + moment);
    }

    /// The flow that the body meets.
    pub fn flow(&self, x: &[f64; STATES], gust: &Gust, wind: [f64; 2]) -> AirData {
        let [u, v, w] = relative(x, gust, wind);
        let speed = (u * u + v * v + w * w).sqrt().max(1.0);
        AirData {
            speed,
            alpha: w.atan2(u),
            beta: (v / speed).clamp(-1.0, 1.0).asin(),
        }
    }

    /// Commanded surfaces (elevator, aileron, rudder; rad) as they go to the servos, and back.
    pub fn to_servos(&self, [e, a, r]: [f64; 3]) -> [f64; 3] {
        if self.elevons {
            [e + a, e - a, 0.0]
        } else {
            [e, a, r]
        }
    }

    fn of_servos(&self, [a, b, c]: [f64; 3]) -> [f64; 3] {
        if self.elevons {
            [0.5 * (a + b), 0.5 * (a - b), 0.0]
        } else {
            [a, b, c]
        }
    }

    /// Derivatives of the states at commanded surfaces (rad) and throttle.
    pub fn derivatives(
        &self,
        x: &[f64; STATES],
        gust: &Gust,
        wind: [f64; 2],
        rho: f64,
        command: &[f64; 4],
    ) -> StateDerivatives {
        let onflow = self.onflow(x, gust, wind, rho);
        let force = self.force(&onflow, x[16], rho);
        let moment = self.moment(&onflow, &force, rho);
        let mass = self.n("body.mass_kg");
        let specific = force.map(|f| f / mass);
        StateDerivatives {
            of: self.rates(x, &specific, &moment, command),
            force: specific,
        }
    }

    fn onflow(&self, x: &[f64; STATES], gust: &Gust, wind: [f64; 2], rho: f64) -> Onflow {
        let flow = self.flow(x, gust, wind);
        let part = |length: f64, rate: f64| rate * length / (2.0 * flow.speed);
        let (b, c) = (self.span_m, self.n("wing.chord_m"));
        Onflow {
            pressure: 0.5 * rho * flow.speed * flow.speed * self.n("wing.area_m2"),
            turn: [
                part(b, x[3] - gust.rate[0]),
                part(c, x[4] - gust.rate[1]),
                part(b, x[5] - gust.rate[2]),
            ],
            surface: self.of_servos([x[10], x[11], x[12]]),
            flow,
        }
    }

    /// Coefficients of lift and drag.
    fn lift_and_drag(&self, onflow: &Onflow) -> [f64; 2] {
        let n = |key: &str| self.n(key);
        let (flow, t, e) = (&onflow.flow, &self.hidden, onflow.surface[0]);
        let past = (flow.alpha - 0.035).max(0.0);
        let lift = n("lift.zero")
            + n("lift.alpha") * flow.alpha
            + n("lift.q") * onflow.turn[1]
            + n("lift.elevator") * e
            - t.lift_break * past * past;
        let mut drag = n("drag.zero")
            + t.ice_drag
            + (n("drag.alpha") + t.drag_by_alpha) * flow.alpha
            + n("drag.alpha_squared") * flow.alpha.powi(2)
            + n("drag.beta") * flow.beta
            + n("drag.beta_squared") * flow.beta.powi(2)
            + n("drag.elevator_squared") * e * e;
        if n("drag.oswald") > 0.0 {
            let aspect = self.span_m * self.span_m / n("wing.area_m2");
            drag += (lift - n("drag.min_drag_lift")).powi(2)
                / (std::f64::consts::PI * n("drag.oswald") * aspect);
        }
        [lift, drag]
    }

    /// Coefficient of side force, roll or yaw by the lateral motion, at an aileron.
    fn lateral(&self, table: &str, onflow: &Onflow, aileron: f64) -> f64 {
        let of = |key: &str| self.n(&format!("{table}.{key}"));
        of("beta") * onflow.flow.beta
            + of("p") * onflow.turn[0]
            + of("r") * onflow.turn[2]
            + of("aileron") * aileron
            + of("rudder") * onflow.surface[2]
    }

    /// Force of air and propeller, body axes, N.
    fn force(&self, onflow: &Onflow, motor: f64, rho: f64) -> [f64; 3] {
        let [lift, drag] = self.lift_and_drag(onflow);
        let side = self.lateral("side", onflow, onflow.surface[1]);
        let (sa, ca) = onflow.flow.alpha.sin_cos();
        let (sb, cb) = onflow.flow.beta.sin_cos();
        // Wind to body axes by the two rotations.
        let along = -drag * cb - side * sb;
        [
            onflow.pressure * (along * ca + lift * sa) + self.thrust(onflow.flow.speed, motor, rho),
            onflow.pressure * (side * cb - drag * sb),
            onflow.pressure * (along * sa - lift * ca),
        ]
    }

    /// Moment about the centre of gravity, body axes, N m.
    fn moment(&self, onflow: &Onflow, force: &[f64; 3], rho: f64) -> [f64; 3] {
        let n = |key: &str| self.n(key);
        let (b, c, t) = (self.span_m, n("wing.chord_m"), &self.hidden);
        let faded = onflow.surface[1] * t.aileron_fade;
        let cruise = 0.5 * rho * self.cruise_m_s.powi(2) * n("wing.area_m2");
        let elastic = 1.0 - t.elastic * (onflow.pressure / cruise - 1.0);
        let up = onflow.flow.alpha - 0.07;
        let cm = n("pitch.zero")
            + n("pitch.alpha") * onflow.flow.alpha
            + n("pitch.q") * onflow.turn[1]
            + n("pitch.elevator") * onflow.surface[0] * elastic
            + t.pitch_up * up * up;
        let cg = n("body.cg_ahead_m");
        let roll = onflow.turn[0];
        let damping = t.damping_growth * n("roll.p") * roll * roll.abs();
        [
            onflow.pressure * b * (self.lateral("roll", onflow, faded) + damping),
            onflow.pressure * c * cm + force[2] * cg,
            onflow.pressure * b * self.lateral("yaw", onflow, faded) - force[1] * cg,
        ]
    }

    fn thrust(&self, speed: f64, motor: f64, rho: f64) -> f64 {
        let (area, exit) = (
            self.n("propulsion.swept_area_m2"),
            self.n("propulsion.exit_speed_m_s"),
        );
        let whole = if self.proportional {
            0.5 * rho * area * ((motor * exit).powi(2) - speed * speed).max(0.0)
        } else {
            let out = speed + motor * (exit - speed);
            0.5 * rho * area * out * (out - speed)
        };
        whole * (1.0 - self.hidden.thrust_by_throttle * motor)
    }

    fn rates(
        &self,
        x: &[f64; STATES],
        specific: &[f64; 3],
        moment: &[f64; 3],
        command: &[f64; 4],
    ) -> [f64; STATES] {
        let [u, v, w, p, q, r, phi, theta, psi] =
            [x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8]];
        let _ = psi;
        let (sp, cp, st, ct) = (phi.sin(), phi.cos(), theta.sin(), theta.cos());
        let mut out = [0.0; STATES];
        out[0] = r * v - q * w - GRAVITY * st + specific[0];
        out[1] = p * w - r * u + GRAVITY * sp * ct + specific[1];
        out[2] = q * u - p * v + GRAVITY * cp * ct + specific[2];
        let grown = 1.0 + self.hidden.inertia_part;
        let (ix, iy, iz, ixz) = (
            self.n("body.ixx_kg_m2") * grown,
            self.n("body.iyy_kg_m2") * grown,
            self.n("body.izz_kg_m2") * grown,
            self.n("body.ixz_kg_m2"),
        );
        // Roll and yaw are coupled by the product of inertia (Stevens and Lewis 2003, chapter 2).
        let gamma = ix * iz - ixz * ixz;
        let l = moment[0] + ixz * p * q - (iz - iy) * q * r;
        let n = moment[2] - (iy - ix) * p * q - ixz * q * r;
        out[3] = (iz * l + ixz * n) / gamma;
        out[4] = (moment[1] - (ix - iz) * p * r - ixz * (p * p - r * r)) / iy;
        out[5] = (ixz * l + ix * n) / gamma;
        out[6] = p + (q * sp + r * cp) * theta.tan();
        out[7] = q * cp - r * sp;
        out[8] = (q * sp + r * cp) / ct;
        out[9] = u * st - v * sp * ct - w * cp * ct;
        let (omega, zeta) = (
            self.n("surfaces.natural_frequency_rad_s"),
            self.n("surfaces.damping_ratio"),
        );
        let servo = self.to_servos([command[0], command[1], command[2]]);
        let limit = self.n("surfaces.rate_deg_s").to_radians();
        for k in 0..3 {
            let (low, high) = (
                self.n("surfaces.min_deg").to_radians(),
                self.n("surfaces.max_deg").to_radians(),
            );
            let error = servo[k].clamp(low, high) - x[10 + k];
            out[10 + k] = x[13 + k].clamp(-limit, limit);
            out[13 + k] = omega * (omega * error - 2.0 * zeta * x[13 + k]);
        }
        out[16] = (command[3].clamp(0.0, 1.0) - x[16]) / self.n("propulsion.lag_s").max(0.02);
        out
    }

    /// One step of Heun's method: of second order, where the simulator's is of fourth, so that the two
    /// share no error of integration.
    pub fn step(
        &self,
        x: &[f64; STATES],
        gust: &Gust,
        wind: [f64; 2],
        rho: f64,
        command: &[f64; 4],
        dt: f64,
    ) -> [f64; STATES] {
        let first = self.derivatives(x, gust, wind, rho, command).of;
        let mut guess = *x;
        for k in 0..STATES {
            guess[k] += dt * first[k];
        }
        let second = self.derivatives(&guess, gust, wind, rho, command).of;
        let mut next = *x;
        for k in 0..STATES {
            next[k] += 0.5 * dt * (first[k] + second[k]);
        }
        next
    }

    /// Level flight at a speed: angle of attack, elevator and throttle by relaxation of the three
    /// equations (a fixed point: lift carries, elevator balances, thrust pulls).
    pub fn trim(&self, speed: f64, rho: f64) -> [f64; 3] {
        let n = |key: &str| self.n(key);
        let pressure = 0.5 * rho * speed * speed * n("wing.area_m2");
        let (mut alpha, mut e, mut throttle) = (0.05, 0.0, 0.4);
        for _ in 0..200 {
            let lift = n("body.mass_kg") * GRAVITY / pressure;
            alpha = (lift - n("lift.zero") - n("lift.elevator") * e) / n("lift.alpha");
            e = -(n("pitch.zero") + n("pitch.alpha") * alpha) / n("pitch.elevator");
            let mut x = [0.0; STATES];
            (x[0], x[2], x[7]) = (speed * alpha.cos(), speed * alpha.sin(), alpha);
            x[10..13].copy_from_slice(&self.to_servos([e, 0.0, 0.0]));
            x[16] = throttle;
            let derivatives = self.derivatives(
                &x,
                &Gust::default(),
                [0.0; 2],
                rho,
                &[e, 0.0, 0.0, throttle],
            );
            throttle = (throttle - 0.02 * derivatives.of[0]).clamp(0.02, 1.0);
        }
        [alpha, e, throttle]
    }
}

/// Velocity relative to the air, body axes.
fn relative(x: &[f64; STATES], gust: &Gust, wind: [f64; 2]) -> [f64; 3] {
    let r = to_ned(x[6], x[7], x[8]);
    let body: [f64; 3] = std::array::from_fn(|k| r[0][k] * wind[0] + r[1][k] * wind[1]);
    [
        x[0] - body[0] - gust.velocity[0],
        x[1] - body[1] - gust.velocity[1],
        x[2] - body[2] - gust.velocity[2],
    ]
}

/// Rotation matrix body to NED of Euler angles.
pub fn to_ned(phi: f64, theta: f64, psi: f64) -> [[f64; 3]; 3] {
    let (sp, cp) = phi.sin_cos();
    let (st, ct) = theta.sin_cos();
    let (ss, cs) = psi.sin_cos();
    [
        [ct * cs, sp * st * cs - cp * ss, cp * st * cs + sp * ss],
        [ct * ss, sp * st * ss + cp * cs, cp * st * ss - sp * cs],
        [-st, sp * ct, cp * ct],
    ]
}
