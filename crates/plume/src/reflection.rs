//! Reflection of a plume at the ground and at a lid: the vertical shape by the method of images
//! (Turner 1970; ISC3, US EPA-454/B-95-003b, equation 1-50).

use super::MAX_EXPONENT;

/// What of a plume comes back from below and above.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reflection {
    /// Part that the ground gives back, 0 to 1.
    pub(super) ground: f64,
    /// Height of the lid above ground, m; infinite where there is none.
    pub(super) lid_m: f64,
    /// Standard deviation of that height, m.
    pub(super) lid_edge_m: f64,
}

impl Reflection {
    /// exp(−across) times the vertical shape with its images.
    #[inline]
    pub(super) fn profile(&self, z_m: f64, height_m: f64, sigma_z_m: f64, across: f64) -> f64 {
        let gauss = |d: f64| {
            let exponent = across + 0.5 * (d / sigma_z_m) * (d / sigma_z_m);
            if exponent > MAX_EXPONENT {
                0.0
            } else {
                (-exponent).exp()
            }
        };
        let direct = gauss(z_m - height_m);
        // A plume above the lid does not feel it, nor does what is above the lid see the plume
        // below.
        let lid_m = if height_m < self.lid_m {
            self.lid_m
        } else {
            f64::INFINITY
        };
        if !lid_m.is_finite() {
            return if self.ground > 0.0 {
                direct + self.ground * gauss(z_m + height_m)
            } else {
                direct
            };
        }
        let below = self.part_below(z_m - lid_m);
        if below == 0.0 {
            return 0.0;
        }
        if self.ground == 0.0 {
            return below * (direct + gauss(2.0 * lid_m - height_m - z_m));
        }
        if self.ground == 1.0 && sigma_z_m > 1.6 * lid_m {
            // Well mixed: the images have merged (ISC3, equation 1-51).
            let mixed = (std::f64::consts::TAU).sqrt() * sigma_z_m / lid_m;
            return below * mixed * (-across).exp();
        }
        // The n-th pair of images is 2n lids away: from n = 5σ/lid on its exponent is above 50, which
        // counts as nothing. Twelve pairs are enough for σ of twice the lid; a wider plume is well
        // mixed where the ground gives all back, and elsewhere has lost a part to it at each image.
        let reach = (1.0 + 5.0 * sigma_z_m / lid_m).ceil().min(12.0) as i32;
        let mut sum = 0.0;
        for n in -reach..=reach {
            // An image that met the ground k times has that factor k times.
            let shift = 2.0 * f64::from(n) * lid_m;
            sum += self.ground.powi(n.abs()) * gauss(z_m - height_m - shift);
            let ground_hits = if n >= 1 { n - 1 } else { 1 - n };
            sum += self.ground.powi(ground_hits) * gauss(z_m + height_m - shift);
        }
        below * sum
    }

    /// The part of the time that a place `above_m` over the lid is below it: the logistic
    /// distribution with the edge's standard deviation.
    #[inline]
    fn part_below(&self, above_m: f64) -> f64 {
        if self.lid_edge_m == 0.0 {
            return if above_m > 0.0 { 0.0 } else { 1.0 };
        }
        let scale_m = self.lid_edge_m * 3f64.sqrt() / std::f64::consts::PI;
        1.0 / (1.0 + (above_m / scale_m).exp())
    }
}
