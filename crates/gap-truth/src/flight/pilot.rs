//! An autopilot of the truth's own: attitude, height and speed loops, and manoeuvres on top.

use rand::RngExt;

use super::FlightSpec;
use super::airframe::{AirData, Airframe, STATES};
use crate::random::{between, pick, sign, stream};

/// A manoeuvre: when, on which command, how large, what shape.
#[derive(Debug, Clone, Copy)]
struct Manoeuvre {
    start_s: f64,
    on: usize,
    size: f64,
    unit_s: f64,
}

/// The autopilot's state.
pub struct CaseAutopilot {
    trim: [f64; 3],
    speed: f64,
    height: f64,
    integral: [f64; 2],
    manoeuvres: Vec<Manoeuvre>,
    turns: Vec<(f64, f64, f64)>,
    control_power: f64,
}

impl CaseAutopilot {
    /// An autopilot for the published aircraft at a speed and height.
    pub fn new(spec: &FlightSpec, published: &Airframe, speed: f64, height: f64, rho: f64) -> Self {
        let mut rng = stream(spec.seed, "flight/pilot");
        let mut manoeuvres = Vec::new();
        let mut turns = Vec::new();
        let mut at = between(&mut rng, 3.0, 6.0);
        let mut on = rng.random_range(0..4);
        while spec.manoeuvres && at < spec.duration_s - 6.0 {
            if published.elevons && on == 2 {
                on = 3;
            }
            let size = sign(&mut rng)
                * match on {
                    0 => between(&mut rng, 0.04, 0.07),
                    1 => between(&mut rng, 0.05, 0.1),
                    2 => between(&mut rng, 0.06, 0.1),
                    _ => between(&mut rng, 0.15, 0.3),
                };
            let unit_s = match on {
                3 => between(&mut rng, 1.0, 2.0),
                _ => pick(&mut rng, &[0.24, 0.4, 0.6]),
            };
            manoeuvres.push(Manoeuvre {
                start_s: at,
                on,
                size,
                unit_s,
            });
            on = (on + 1) % 4;
            at += between(&mut rng, 5.0, 8.0);
        }
        let mut at = 0.0;
        while at < spec.duration_s {
            let bank = sign(&mut rng) * between(&mut rng, 0.0, 0.6);
            turns.push((at, bank, speed * between(&mut rng, 0.92, 1.12)));
            at += between(&mut rng, 12.0, 22.0);
        }
        // Gains fall with the control power at cruise, pitch acceleration per radian of elevator, 1/s²:
        // one autopilot for small and large aircraft.
        let pressure = 0.5 * rho * speed * speed * published.n("wing.area_m2");
        let control_power =
            (pressure * published.n("wing.chord_m") * published.n("pitch.elevator").abs()
                / published.n("body.iyy_kg_m2"))
            .max(1.0);
        Self {
            trim: published.trim(speed, rho),
            speed,
            height,
            integral: [0.0; 2],
            manoeuvres,
            turns,
            control_power,
        }
    }

    /// Elevator, aileron, rudder (rad, as a table of three tenths of a millirad) and throttle.
    pub fn command(&mut self, time: f64, x: &[f64; STATES], flow: &AirData) -> [f64; 4] {
        let (_, bank, speed) = self
            .turns
            .iter()
            .rev()
            .find(|t| t.0 <= time)
            .copied()
            .unwrap_or((0.0, 0.0, self.speed));
        let height_error = (self.height - x[9]).clamp(-8.0, 8.0);
        let climb = x[0] * x[7].sin() - x[2] * x[7].cos() * x[6].cos();
        let pitch = self.trim[0] * (self.speed / speed).powi(2) + 0.02 * height_error
            - 0.03 * climb
            + 0.12 * (1.0 / x[6].cos().abs().max(0.5) - 1.0);
        let off = pitch - x[7];
        self.integral[0] = (self.integral[0] + 0.04 * off).clamp(-0.3, 0.3);
        let gain = (60.0 / self.control_power).clamp(0.2, 0.9);
        let mut out = [
            self.trim[1] - gain * (off + 0.6 * self.integral[0]) + 0.12 * gain * x[4],
            0.35 * (bank - x[6]) - 0.05 * x[3],
            0.06 * x[5] - 0.03 * flow.beta,
            0.0,
        ];
        let slow = speed - flow.speed;
        self.integral[1] = (self.integral[1] + 0.04 * slow).clamp(-8.0, 8.0);
        out[3] = self.trim[2] + 0.06 * slow + 0.012 * self.integral[1];
        for m in &self.manoeuvres {
            // A 2-1-1 of alternate sign excites a wider band than a doublet (Jategaonkar
            // 2006, chapter 2); a single step for the throttle.
            let into = (time - m.start_s) / m.unit_s;
            let shape = match into {
                i if i < 0.0 => 0.0,
                i if i < 2.0 => 1.0,
                i if i < 3.0 && m.on < 3 => -1.0,
                i if i < 4.0 && m.on < 3 => 1.0,
                _ => 0.0,
            };
            out[m.on] += shape * m.size;
        }
        // Servos are told in steps.
        for value in &mut out[..3] {
            *value = ((*value).clamp(-0.4, 0.4) / 3e-4).round() * 3e-4;
        }
        out[3] = (out[3].clamp(0.0, 1.0) * 500.0).round() / 500.0;
        out
    }
}
