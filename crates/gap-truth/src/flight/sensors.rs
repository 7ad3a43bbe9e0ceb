//! What the truth's sensors log: noise, quantisation, sample and hold, and the hidden errors.

use std::fmt::Write as _;

use rand::RngExt;
use rand::rngs::ChaCha8Rng;

use super::airframe::{AirData, Airframe, STATES, to_ned};
use super::effect::InjectedEffects;
use super::{FlightNoise, FlightSpec};
use crate::random::{OrnsteinUhlenbeck, between, normal, stream};

/// Noise of airspeed, vanes, angles, gyros, accelerometers and velocity (SI).
const NOISE: [f64; 6] = [0.25, 0.006, 0.005, 0.008, 0.12, 0.15];

/// The sensors' state.
pub struct Sensors {
    rng: ChaCha8Rng,
    unusual: bool,
    scale: f64,
    drift: [OrnsteinUhlenbeck; 2],
    held: [f64; 3],
    next_fix_s: f64,
}

impl Sensors {
    /// The sensors of a case.
    pub fn new(spec: &FlightSpec) -> Self {
        let mut rng = stream(spec.seed, "flight/sensors");
        let scale = between(&mut rng, 0.7, 1.5);
        let drift = [
            OrnsteinUhlenbeck::new(20.0, &mut rng),
            OrnsteinUhlenbeck::new(20.0, &mut rng),
        ];
        Self {
            unusual: spec.noise == FlightNoise::Unusual,
            rng,
            scale,
            drift,
            held: [f64::NAN; 3],
            next_fix_s: 0.0,
        }
    }

    /// The header of the flight file.
    pub fn header(&self, frame: &Airframe) -> String {
        let surfaces = if frame.elevons {
            "elevon_left_deg,elevon_right_deg"
        } else {
            "elevator_deg,aileron_left_deg,aileron_right_deg,rudder_deg"
        };
        format!(
            "time_s,airspeed_m_s,angle_of_attack_deg,sideslip_deg,roll_deg,pitch_deg,yaw_deg,\
             roll_rate_deg_s,pitch_rate_deg_s,yaw_rate_deg_s,accel_x_m_s2,accel_y_m_s2,\
             accel_z_m_s2,vel_north_m_s,vel_east_m_s,vel_down_m_s,alt_amsl_m,throttle,{surfaces}\n"
        )
    }

    /// A value with noise of `sd`, rounded to `step`.
    fn noisy(&mut self, value: f64, sd: f64, step: f64) -> String {
        let sd = sd * self.scale;
        let mut noise = normal(&mut self.rng);
        if self.unusual {
            // Student's t with 4 degrees of freedom, of the same middle.
            let sum: f64 = (0..4).map(|_| normal(&mut self.rng).powi(2)).sum();
            noise /= (sum / 4.0).sqrt().max(0.1);
            if self.rng.random::<f64>() < 0.01 {
                return String::new();
            }
        }
        let step = if self.unusual { 4.0 * step } else { step };
        format!("{:.5}", ((value + sd * noise) / step).round() * step)
    }

    /// One row.
    #[allow(clippy::too_many_arguments, reason = "a row has many sources")]
    pub fn log(
        &mut self,
        csv: &mut String,
        time: f64,
        x: &[f64; STATES],
        flow: &AirData,
        force: &[f64; 3],
        command: &[f64; 4],
        frame: &Airframe,
        hidden: &InjectedEffects,
    ) {
        let degrees = 1f64.to_degrees();
        let mut cells = vec![format!("{time:.3}")];
        self.air_data(&mut cells, flow, hidden);
        for k in 0..3 {
            let drift = if self.unusual && k < 2 {
                0.008 * self.drift[k].step(0.04, &mut self.rng)
            } else {
                0.0
            };
            cells.push(self.noisy((x[6 + k] + drift) * degrees, NOISE[2] * degrees, 0.01));
        }
        for k in 0..3 {
            let wander = if k == 1 { hidden.wander(time) } else { 0.0 };
            let rate = x[3 + k] + hidden.gyro[k] + wander;
            cells.push(self.noisy(rate * degrees, NOISE[3] * degrees, 0.02));
        }
        for (force, off) in force.iter().zip(hidden.accelerometer) {
            cells.push(self.noisy(force + off, NOISE[4], 0.01));
        }
        self.fix(time, x);
        cells.extend(self.held.iter().map(|v| format!("{v:.3}")));
        cells.push(format!("{:.1}", x[9]));
        cells.push(format!("{:.4}", command[3]));
        let [e, a, r] = [command[0], command[1], command[2]].map(f64::to_degrees);
        if frame.elevons {
            cells.extend([format!("{:.4}", e + a), format!("{:.4}", e - a)]);
        } else {
            cells.extend([e, a, -a, r].map(|v| format!("{v:.4}")));
        }
        // Writing into a String cannot fail.
        let _ = writeln!(csv, "{}", cells.join(","));
    }

    /// Airspeed and vanes.
    fn air_data(&mut self, cells: &mut Vec<String>, flow: &AirData, hidden: &InjectedEffects) {
        let degrees = 1f64.to_degrees();
        let (slip, bend) = if hidden.is_variant() {
            (
                (hidden.airspeed - 1.0) * (flow.alpha - 0.05),
                (hidden.vane.0 - 1.0) * flow.alpha.powi(2),
            )
        } else {
            (0.0, 0.0)
        };
        let speed = flow.speed * (hidden.airspeed + slip);
        cells.push(self.noisy(speed, NOISE[0], 0.02));
        let vane = hidden.vane.0 * flow.alpha + hidden.vane.1 + bend;
        for angle in [vane, flow.beta] {
            cells.push(self.noisy(angle * degrees, NOISE[1] * degrees, 0.05));
        }
    }

    /// Velocity over ground, sampled and held.
    fn fix(&mut self, time: f64, x: &[f64; STATES]) {
        if time >= self.next_fix_s - 1e-9 {
            let r = to_ned(x[6], x[7], x[8]);
            for (k, held) in self.held.iter_mut().enumerate() {
                let value = r[k][0] * x[0] + r[k][1] * x[1] + r[k][2] * x[2];
                *held = ((value + NOISE[5] * normal(&mut self.rng)) / 0.01).round() * 0.01;
            }
            self.next_fix_s += 0.2;
        }
    }
}
