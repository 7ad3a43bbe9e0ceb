//! Dryden turbulence in body axes with rotary gusts (MIL-F-8785C), its shaping filters driven by
//! white noise every 5 ms.

use rand::rngs::ChaCha8Rng;

use crate::random::{normal, stream};

/// A gust: velocity and rotation of the air, body axes.
#[derive(Debug, Clone, Copy, Default)]
pub struct Gust {
    /// m/s.
    pub velocity: [f64; 3],
    /// rad/s.
    pub rate: [f64; 3],
}

/// The filters' states.
pub struct Gusts {
    sigma: [f64; 3],
    time: [f64; 3],
    state: [[f64; 2]; 3],
    roll: f64,
    roll_sigma: f64,
    roll_time: f64,
    span_time: f64,
    before: [f64; 2],
    rng: ChaCha8Rng,
}

impl Gusts {
    /// Turbulence of `intensity` (standard deviation of the vertical gust, m/s) at a height.
    pub fn new(height_m: f64, intensity: f64, speed: f64, span_m: f64, seed: u64) -> Self {
        // The standard's formulas take feet.
        let feet = (height_m / 0.3048).clamp(50.0, 1000.0);
        let ratio = 1.0 / (0.177 + 0.000_823 * feet).powf(0.4);
        let long = feet / (0.177 + 0.000_823 * feet).powf(1.2) * 0.3048;
        let short = feet * 0.3048;
        let roll_sigma = intensity * (0.8 * (std::f64::consts::PI / (4.0 * span_m)).cbrt().powi(1))
            / (short.cbrt() * speed.cbrt().max(1.0)).max(1.0);
        Self {
            sigma: [intensity * ratio, intensity * ratio, intensity],
            time: [long / speed, long / speed, short / speed],
            state: [[0.0; 2]; 3],
            roll: 0.0,
            roll_sigma,
            roll_time: 4.0 * span_m / (std::f64::consts::PI * speed),
            span_time: 3.0 * span_m / (std::f64::consts::PI * speed),
            before: [0.0; 2],
            rng: stream(seed, "flight/gusts"),
        }
    }

    /// The gust `dt` later.
    pub fn step(&mut self, dt: f64, speed: f64) -> Gust {
        let mut velocity = [0.0; 3];
        for (k, velocity) in velocity.iter_mut().enumerate() {
            let keep = (-dt / self.time[k]).exp();
            let drive = (1.0 - keep * keep).sqrt() * normal(&mut self.rng);
            let [first, second] = self.state[k];
            let next = keep * first + drive;
            if k == 0 {
                self.state[k][0] = next;
                *velocity = self.sigma[k] * next;
            } else {
                // (1 + √3 T s)/(1 + T s)²: a second lag, and √3 of its input's change.
                let second = second + (1.0 - keep) * (next - second);
                self.state[k] = [next, second];
                let shaped = 3f64.sqrt() * next + (1.0 - 3f64.sqrt()) * second;
                *velocity = self.sigma[k] * shaped / 1.414;
            }
        }
        let keep = (-dt / self.roll_time).exp();
        self.roll = keep * self.roll + (1.0 - keep * keep).sqrt() * normal(&mut self.rng);
        // Pitch and yaw gusts: the change of the vertical and lateral gust along the path.
        let mut turn = [0.0; 2];
        for (i, k) in [(0, 2), (1, 1)] {
            self.before[i] += dt / self.span_time * (velocity[k] - self.before[i]);
            turn[i] = (velocity[k] - self.before[i]) / (self.span_time * speed);
        }
        Gust {
            velocity,
            rate: [self.roll_sigma * self.roll, -0.3 * turn[0], 0.3 * turn[1]],
        }
    }
}
