//! Spread, vertical exchange and air by this crate's own formulas.
//!
//! The spread is that of Briggs (1973), open country, written as σ = a x (1 + b x)^p; the air
//! is a dry hydrostatic troposphere. Nothing here comes from the crates that look for effects.

use std::f64::consts::PI;

/// A Pasquill class as a number, 0 for A to 5 for F; fractions lie between two classes.
pub type ClassNumber = f64;

/// (a, b, p) of σ_y for A to F (Briggs 1973, rural).
const LATERAL: [(f64, f64, f64); 6] = [
    (0.22, 1e-4, -0.5),
    (0.16, 1e-4, -0.5),
    (0.11, 1e-4, -0.5),
    (0.08, 1e-4, -0.5),
    (0.06, 1e-4, -0.5),
    (0.04, 1e-4, -0.5),
];

/// (a, b, p) of σ_z for A to F (Briggs 1973, rural).
const VERTICAL: [(f64, f64, f64); 6] = [
    (0.20, 0.0, 1.0),
    (0.12, 0.0, 1.0),
    (0.08, 2e-4, -0.5),
    (0.06, 1.5e-3, -0.5),
    (0.03, 3e-4, -1.0),
    (0.016, 3e-4, -1.0),
];

fn table(rows: &[(f64, f64, f64); 6], class: ClassNumber, x_m: f64) -> f64 {
    let class = class.clamp(0.0, 5.0);
    let below = class.floor().min(4.0) as usize;
    let log_of = |(a, b, p): (f64, f64, f64)| (a * x_m * (1.0 + b * x_m).powf(p)).ln();
    let share = class - below as f64;
    ((1.0 - share) * log_of(rows[below]) + share * log_of(rows[below + 1])).exp()
}

/// Lateral spread at `x_m` downwind, m; between classes even in the logarithm.
pub fn sigma_y_m(class: ClassNumber, x_m: f64) -> f64 {
    table(&LATERAL, class, x_m.max(1.0))
}

/// Vertical spread at `x_m` downwind, m; between classes even in the logarithm.
pub fn sigma_z_m(class: ClassNumber, x_m: f64) -> f64 {
    table(&VERTICAL, class, x_m.max(1.0))
}

/// Where the plume meets ground and lid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReflectingBoundaries {
    /// Part of the plume that the ground sends back, 0 to 1.
    pub ground: f64,
    /// Height of a lid, m above ground.
    pub lid_agl_m: Option<f64>,
    /// Part of the plume that the lid sends back, 0 to 1.
    pub lid: f64,
}

/// The vertical profile exp(-(z - H)²/2σ²) with the images of ground and lid; dimensionless.
pub fn vertical(z_m: f64, axis_m: f64, sigma_m: f64, boundaries: &ReflectingBoundaries) -> f64 {
    let gaussian = |mirror: f64| (-0.5 * ((z_m - mirror) / sigma_m).powi(2)).exp();
    let mut sum = gaussian(axis_m) + boundaries.ground * gaussian(-axis_m);
    let Some(lid) = boundaries.lid_agl_m.filter(|&lid| lid > axis_m) else {
        return sum;
    };
    if z_m > lid {
        return sum * (1.0 - boundaries.lid);
    }
    // Images up to the second reflection at the lid: farther ones matter to a plume only that is
    // nearly well mixed.
    let (r, a) = (boundaries.lid, boundaries.ground);
    sum += r * gaussian(2.0 * lid - axis_m);
    sum += r * a * (gaussian(axis_m - 2.0 * lid) + gaussian(2.0 * lid + axis_m));
    sum += r * r * a * gaussian(4.0 * lid - axis_m) + r * a * a * gaussian(-2.0 * lid - axis_m);
    sum
}

/// Part of the gas still airborne after each multiple of `step_m` of travel, for a deposition
/// velocity over transport speed `ratio` and a plume axis at `axis_m` (source depletion).
pub fn airborne_share(
    ratio: f64,
    axis_m: f64,
    step_m: f64,
    steps: usize,
    at_ground: impl Fn(f64) -> f64,
    sigma_z_m: impl Fn(f64) -> f64,
) -> Vec<f64> {
    let mut share = Vec::with_capacity(steps + 1);
    let mut lost = 0.0;
    share.push(1.0);
    for k in 0..steps {
        let x_m = (k as f64 + 0.5) * step_m;
        let sigma_m = sigma_z_m(x_m);
        let gaussian = (-0.5 * (axis_m / sigma_m).powi(2)).exp();
        lost += ratio * at_ground(x_m) * gaussian / ((2.0 * PI).sqrt() * sigma_m) * step_m;
        share.push((-lost).exp());
    }
    share
}

/// Molar mass of CO2, kg/mol.
pub const CO2_KG_MOL: f64 = 0.044_009_5;

/// A dry troposphere with the temperature gradient -6.5 K/km through a place on the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Troposphere {
    /// Temperature at the ground, °C.
    pub temperature_c: f64,
    /// Pressure at the ground, hPa.
    pub pressure_hpa: f64,
}

impl Troposphere {
    /// Temperature at `z_m` above ground, °C.
    pub fn temperature_at_c(&self, z_m: f64) -> f64 {
        self.temperature_c - 0.0065 * z_m
    }

    /// Pressure at `z_m` above ground, hPa (hydrostatic, g/(R γ) = 5.2559).
    pub fn pressure_at_hpa(&self, z_m: f64) -> f64 {
        let ratio = 1.0 - 0.0065 * z_m / (self.temperature_c + 273.15);
        self.pressure_hpa * ratio.powf(5.2559)
    }

    /// ppm of CO2 that one kg/m³ makes at `z_m` above ground.
    pub fn ppm_per_kg_m3(&self, z_m: f64) -> f64 {
        let moles =
            self.pressure_at_hpa(z_m) * 100.0 / (8.314_463 * (self.temperature_at_c(z_m) + 273.15));
        1e6 / (CO2_KG_MOL * moles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Briggs (1973) by hand: class D at 1 km, σy = 80/√1.1, σz = 60/√2.5.
    #[test]
    fn briggs_by_hand() {
        assert!((sigma_y_m(3.0, 1000.0) - 76.277).abs() < 1e-3);
        assert!((sigma_z_m(3.0, 1000.0) - 37.947).abs() < 1e-3);
        assert!((sigma_z_m(0.0, 1000.0) - 200.0).abs() < 1e-9);
        let between = sigma_z_m(2.5, 700.0);
        assert!(between < sigma_z_m(2.0, 700.0) && between > sigma_z_m(3.0, 700.0));
    }

    // Class D, u = 7 m/s at H, 920 hPa, 15 °C, 410 ppm at 2.4 km is about 352 kg/s.
    #[test]
    fn the_reference_power_station() {
        let air = Troposphere {
            temperature_c: 15.0,
            pressure_hpa: 920.0,
        };
        let spread = sigma_y_m(3.0, 2400.0) * sigma_z_m(3.0, 2400.0);
        let emission = 410.0 / air.ppm_per_kg_m3(0.0) * 2.0 * PI * 7.0 * spread;
        assert!((emission / 352.0 - 1.0).abs() < 0.01, "{emission}");
    }

    // Between ground and lid the images keep the whole mass.
    #[test]
    fn walls_keep_the_mass() {
        let boundaries = ReflectingBoundaries {
            ground: 1.0,
            lid_agl_m: Some(300.0),
            lid: 1.0,
        };
        let sum: f64 = (0..300)
            .map(|k| vertical(f64::from(k) + 0.5, 120.0, 90.0, &boundaries))
            .sum();
        let whole = (2.0 * PI).sqrt() * 90.0;
        assert!((sum / whole - 1.0).abs() < 0.01, "{}", sum / whole);
    }

    #[test]
    fn deposition_only_removes() {
        let share = airborne_share(0.01, 50.0, 10.0, 300, |_| 1.0, |x| sigma_z_m(3.0, x));
        assert!(share.windows(2).all(|w| w[1] <= w[0]) && share[300] > 0.5 && share[300] < 0.99);
    }
}
