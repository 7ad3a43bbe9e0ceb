//! The weather in which gains are searched and judged.

use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::Serialize;

/// Strongest wind of a drawn case, m/s.
const STRONGEST_WIND_M_S: f64 = 10.0;
/// The stream of the generator that draws cases; gusts come from stream 0.
const DRAWING_STREAM: u64 = 1;

/// Weather to fly in.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WeatherCase {
    /// What the report calls it.
    pub name: String,
    /// Wind speed, m/s.
    pub wind_m_s: f64,
    /// Where the wind comes from, degrees.
    pub wind_from_deg: f64,
    /// Turbulence as a share of MIL-F-8785C's for that wind.
    pub turbulence: f64,
    /// Air density, kg/m³.
    pub density_kg_m3: f64,
    /// Seed of its gusts.
    pub gust_seed: u64,
}

impl WeatherCase {
    /// Calm, moderate, strong and hot: what a search flies in.
    pub fn standard(seed: u64) -> Vec<Self> {
        [
            ("calm, sea level", 0.0, 270.0, 0.0, 1.225),
            ("5 m/s across, gusts", 5.0, 270.0, 1.0, 1.18),
            ("9 m/s along, strong gusts, 1500 m", 9.0, 0.0, 1.3, 1.06),
            ("7 m/s, gusts, hot", 7.0, 130.0, 1.0, 1.12),
        ]
        .into_iter()
        .zip(0..)
        .map(
            |((name, wind_m_s, wind_from_deg, turbulence, density_kg_m3), number)| Self {
                name: name.to_owned(),
                wind_m_s,
                wind_from_deg,
                turbulence,
                density_kg_m3,
                gust_seed: seed.wrapping_add(number),
            },
        )
        .collect()
    }

    /// `count` cases drawn at random, up to 10 m/s from anywhere, with turbulence from a third of
    /// the norm to a third more, and air as dense as from sea level in winter to 2000 m.
    pub fn drawn(seed: u64, count: usize) -> Vec<Self> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(DRAWING_STREAM);
        (0..count)
            .map(|_| {
                let wind_m_s = STRONGEST_WIND_M_S * rng.random::<f64>();
                let wind_from_deg = 360.0 * rng.random::<f64>();
                let turbulence = 0.33 + rng.random::<f64>();
                let density_kg_m3 = 1.0 + 0.27 * rng.random::<f64>();
                Self {
                    name: format!("{wind_m_s:.1} m/s from {wind_from_deg:.0}°"),
                    wind_m_s,
                    wind_from_deg,
                    turbulence,
                    density_kg_m3,
                    gust_seed: rng.random(),
                }
            })
            .collect()
    }

    /// The mean wind, a vector towards which the air moves, NED, m/s.
    pub(super) fn wind_ned_m_s(&self) -> [f64; 3] {
        let (sin, cos) = self.wind_from_deg.to_radians().sin_cos();
        [-self.wind_m_s * cos, -self.wind_m_s * sin, 0.0]
    }
}
