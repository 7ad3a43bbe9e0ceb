//! Trials made up from formulas written out here.

use std::fmt::Write as _;

use gap::tracer::table::Tables;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

/// What is hidden in made trials.
#[derive(Clone, Copy, Default)]
pub struct Hidden {
    /// σz times (x/200 m)^this.
    pub growth: f64,
    /// ln of a factor on σz.
    pub log_scale: f64,
    /// Deposition velocity, m/s: a loss that grows with the root of distance.
    pub deposition_m_s: f64,
    /// Width follows σ_azimuth rather than the class.
    pub azimuth: bool,
    /// ln of a factor on σy.
    pub log_width: f64,
    /// Vertical spread by surface-layer similarity instead of Briggs'.
    pub similarity: bool,
}

/// Integrated stability function of wind over z/L (Paulson 1970, Dyer 1974), and the gradient
/// function of mass in unstable air.
fn psi(zeta: f64) -> f64 {
    let x = (1.0 - 16.0 * zeta).powf(0.25);
    2.0 * (0.5 * (1.0 + x)).ln() + (0.5 * (1.0 + x * x)).ln() - 2.0 * x.atan()
        + 0.5 * std::f64::consts::PI
}

/// Crosswind-integrated concentration at `z_m` of a unit release at the ground in unstable air
/// (van Ulden 1978): mean height by dz/dx = k²/(ln(.6 z/z0) − ψ) (1 − 16·1.55 z/L)^½, a profile
/// exp(−(.6595 z/mean)^1.5) with A = Γ(4/3)·1.5/Γ(2/3)² = .7305, wind at .6 of the mean height.
fn similarity_m2(x_m: f64, z_m: f64, u2_m_s: f64, length_m: f64) -> f64 {
    let z0 = 0.006;
    let shape = |z: f64| (z / z0).ln() - psi(z / length_m) + psi(z0 / length_m);
    let mut mean = 0.46_f64;
    let steps = 2000;
    for _ in 0..steps {
        let profile = (0.6 * mean / z0).ln() - psi(0.6 * mean / length_m);
        let slope = 0.16 / profile * (1.0 - 16.0 * 1.55 * mean / length_m).sqrt();
        mean += slope * x_m / f64::from(steps);
    }
    let u = u2_m_s * shape(0.6 * mean) / shape(2.0);
    0.7305 / (u * mean) * (-(0.6595 * z_m / mean).powf(1.5)).exp()
}

/// Sixteen trials of class C (L = -30 m) or E (L = 25 m), formulas written out here: Briggs rural
/// C σy .11 x/√(1+.0001x), σz .08 x/√(1+.0002x); E .06 x/√(1+.0001x), .03 x/(1+.0003x).
pub fn made(hidden: Hidden, stable: bool, seed: u64) -> Tables {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = |sd: f64| sd * rng.sample::<f64, _>(StandardNormal);
    let mut receptors = String::from("trial,east_m,north_m,height_agl_m,concentration_mg_m3\n");
    let mut trials = String::from(
        "trial,source_rate_g_s,source_height_agl_m,wind_speed_m_s,wind_height_m,wind_from_deg,\
         obukhov_length_m,sigma_azimuth_deg,roughness_length_m\n",
    );
    let pi = std::f64::consts::PI;
    for trial in 0..16 {
        let u = 5.0 + normal(0.8);
        let (a_y, length) = if stable { (0.06, 25.0) } else { (0.11, -30.0) };
        let azimuth_deg = 8.0 * normal(0.3).exp();
        let _ = writeln!(
            trials,
            "{trial},90,0.46,{u},2,180,{length},{azimuth_deg},0.006"
        );
        let level = normal(0.12);
        for x in [50.0_f64, 100.0, 200.0, 400.0, 800.0] {
            let class_c = 0.08 * x / (1.0 + 2e-4 * x).sqrt();
            let class_e = 0.03 * x / (1.0 + 3e-4 * x);
            let sz = if stable { class_e } else { class_c };
            let sz = sz * (hidden.log_scale + hidden.growth * (x / 200.0).ln()).exp();
            let sy = if hidden.azimuth {
                0.8 * f64::to_radians(azimuth_deg) * x * (x / 100.0).powf(-0.1)
            } else {
                a_y * x / (1.0 + 1e-4 * x).sqrt()
            };
            let sy = sy * (hidden.log_width + normal(0.06)).exp();
            let lost = (-hidden.deposition_m_s * 2.2 * x.sqrt() / u).exp();
            let bell = |z: f64| (-0.5 * (z / sz).powi(2)).exp();
            let vertical = bell(1.5 - 0.46) + bell(1.5 + 0.46);
            let error = (level + normal(0.1)).exp();
            let integrated = if hidden.similarity {
                90_000.0 * similarity_m2(x, 1.5, u, length)
            } else {
                90_000.0 / ((2.0 * pi).sqrt() * u * sz) * vertical
            };
            let peak = integrated / ((2.0 * pi).sqrt() * sy) * lost * error;
            for k in -40..=40 {
                let azimuth = f64::from(k) * 1.5_f64.to_radians();
                let c = peak * (-0.5 * (azimuth * x / sy).powi(2)).exp();
                let (e, n) = (x * azimuth.sin(), x * azimuth.cos());
                let _ = writeln!(receptors, "{trial},{e},{n},1.5,{c}");
            }
        }
    }
    Tables::parse(("receptors", &receptors), ("trials", &trials), None).unwrap()
}
