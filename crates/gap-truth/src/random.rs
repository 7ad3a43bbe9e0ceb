//! Random numbers by name: every part of a case has its own stream, so that changing the
//! strength of an effect leaves scene and noise as they were.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

/// The stream of `label` in the case of `seed`.
pub fn stream(seed: u64, label: &str) -> ChaCha8Rng {
    // Not the simulator's own derivation of streams: a truth must not share its random numbers.
    // FNV-1a over the label, started from the seed; four rounds fill the key.
    let mut key = [0_u8; 32];
    for (round, chunk) in key.chunks_mut(8).enumerate() {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64 ^ seed.rotate_left(round as u32 * 16);
        for byte in label.bytes().chain([round as u8]) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
        chunk.copy_from_slice(&hash.to_le_bytes());
    }
    ChaCha8Rng::from_seed(key)
}

/// A standard normal number.
pub fn normal<R: Rng>(rng: &mut R) -> f64 {
    StandardNormal.sample(rng)
}

/// A number from `low` to `high`.
pub fn between<R: Rng>(rng: &mut R, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// A number from `low` to `high`, even in its logarithm.
pub fn between_log<R: Rng>(rng: &mut R, low: f64, high: f64) -> f64 {
    between(rng, low.ln(), high.ln()).exp()
}

/// +1 or -1.
pub fn sign<R: Rng>(rng: &mut R) -> f64 {
    if rng.random::<bool>() { 1.0 } else { -1.0 }
}

/// One of `choices`.
pub fn pick<T: Copy, R: Rng>(rng: &mut R, choices: &[T]) -> T {
    choices[rng.random_range(0..choices.len())]
}

/// Student's t with three degrees of freedom, scaled to unit variance.
pub fn student_3<R: Rng>(rng: &mut R) -> f64 {
    let z = normal(rng);
    let chi_sq: f64 = (0..3).map(|_| normal(rng).powi(2)).sum();
    z / (chi_sq / 3.0).sqrt() / 3.0_f64.sqrt()
}

/// A stationary Ornstein–Uhlenbeck process of unit variance, stepped exactly.
#[derive(Debug, Clone)]
pub struct OrnsteinUhlenbeck {
    value: f64,
    time_scale_s: f64,
}

impl OrnsteinUhlenbeck {
    /// A process in its stationary state, with the correlation time `time_scale_s`.
    pub fn new<R: Rng>(time_scale_s: f64, rng: &mut R) -> Self {
        Self {
            value: normal(rng),
            time_scale_s,
        }
    }

    /// The value `step_s` later.
    pub fn step<R: Rng>(&mut self, step_s: f64, rng: &mut R) -> f64 {
        let keep = (-step_s / self.time_scale_s).exp();
        self.value = keep * self.value + (1.0 - keep * keep).sqrt() * normal(rng);
        self.value
    }
}
