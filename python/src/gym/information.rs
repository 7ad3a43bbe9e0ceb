//! What readings tell of a plume: the information matrix of its direction, height and strength.

use super::scene::{AXIS_M, AXIS_SD_DEG, BACKGROUND_PPM, C_MAX_PPM, NOISE_PPM, Scene};
use plume::Place;

/// Information of prior and readings about direction (rad), height (m) and the logarithm of the strength.
#[derive(Debug, Clone)]
pub(crate) struct Information([[f64; 3]; 3]);

impl Information {
    /// That of the ranges from which scenes are drawn. A uniform distribution has the variance of its width squared
    /// over 12.
    pub(crate) fn prior() -> Self {
        let variance = |[low, high]: [f64; 2]| (high - low) * (high - low) / 12.0;
        let variances = [
            AXIS_SD_DEG.to_radians() * AXIS_SD_DEG.to_radians(),
            variance(AXIS_M),
            variance(C_MAX_PPM.map(f64::ln)),
        ];
        let mut matrix = [[0.0; 3]; 3];
        for (k, variance) in variances.into_iter().enumerate() {
            matrix[k][k] = 1.0 / variance;
        }
        Self(matrix)
    }

    /// Takes in `count` readings at a place; how much they tell of what all readings so far do not, nats: half the growth
    /// of the determinant's logarithm.
    pub(crate) fn take(&mut self, scene: &Scene, place: &Place, count: f64) -> f64 {
        let [e, n] = scene.axis;
        let along = place.east_m * e + place.north_m * n;
        if along <= 1.0 {
            return 0.0;
        }
        let left = place.north_m * e - place.east_m * n;
        let excess = scene.model.mean_ppm(place, 0.0) - BACKGROUND_PPM;
        let (sigma_y, sigma_z) = scene.model.sigmas_m(along);
        let above = place.height_agl_m - scene.peak.height_agl_m;
        // Derivatives of the plume by its formula: the axis turned to the left by an angle brings it nearer by `along`
        // times that. The ground's image is left out: it matters where there is little to read.
        let by = [
            excess * left * along / (sigma_y * sigma_y),
            excess * above / (sigma_z * sigma_z),
            excess,
        ];
        let before = self.log_det();
        for (row, a) in self.0.iter_mut().zip(by) {
            for (cell, b) in row.iter_mut().zip(by) {
                *cell += count * a * b / (NOISE_PPM * NOISE_PPM);
            }
        }
        0.5 * (self.log_det() - before)
    }

    fn log_det(&self) -> f64 {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.0;
        (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)).ln()
    }
}
