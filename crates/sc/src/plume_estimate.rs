//! The running estimate of where the plume is, on which passes and search are planned.

use air::geo::Enu;
use plume::DispersionSpec;
use plume::sigma::{sigma_y_m, sigma_z_m};
use protocol::message::Model;

/// Factors on σ outside these are not used in planning, two usual standard deviations from 1: an estimate that has gone
/// astray must not lead the passes out of the plume.
const LEAST_FACTOR: f64 = 0.55;
/// See [`LEAST_FACTOR`].
const GREATEST_FACTOR: f64 = 1.8;

/// Where the plume is estimated to be, with uncertainties.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlumeEstimate {
    /// Foot of the stack.
    pub source: Enu,
    /// Direction towards which the axis runs, degrees.
    pub axis_deg: f64,
    /// Its standard deviation, degrees.
    pub axis_sd_deg: f64,
    /// Height of the axis, m above mean sea level.
    pub height_amsl_m: f64,
    /// Its standard deviation, m.
    pub height_sd_m: f64,
    /// Factors on σy and σz.
    pub sigma_factors: (f64, f64),
    /// Their standard deviations.
    pub sigma_factor_sds: (f64, f64),
}

impl PlumeEstimate {
    /// From a corrected model.
    pub fn of(model: &Model, base: &DispersionSpec) -> Self {
        let factors = [&model.sigma_y_scale, &model.sigma_z_scale];
        let [y, z] = factors.map(|s| s.value.clamp(LEAST_FACTOR, GREATEST_FACTOR));
        let [y_sd, z_sd] = factors.map(|s| s.sd.clamp(0.0, GREATEST_FACTOR));
        Self {
            source: base.sources.first().map_or(Enu::default(), |s| s.place),
            axis_deg: model.axis_deg.value,
            axis_sd_deg: model.axis_deg.sd.clamp(0.0, 30.0),
            height_amsl_m: base.ground_amsl_m + model.effective_height_agl_m.value,
            height_sd_m: model.effective_height_agl_m.sd.clamp(0.0, 200.0),
            sigma_factors: (y, z),
            sigma_factor_sds: (y_sd, z_sd),
        }
    }

    /// From the scenario, before anything was measured.
    pub(crate) fn of_base(base: &DispersionSpec) -> Self {
        let first = base.sources.first();
        Self {
            source: first.map_or(Enu::default(), |s| s.place),
            axis_deg: air::wind::towards_deg(base.wind.from_deg()),
            axis_sd_deg: 10.0,
            height_amsl_m: base.ground_amsl_m + first.map_or(0.0, |s| s.effective_height_agl_m),
            height_sd_m: 50.0,
            sigma_factors: (base.sigma_y_scale, base.sigma_z_scale),
            sigma_factor_sds: (0.0, 0.0),
        }
    }

    /// Spread (σy, σz) at a distance, m.
    pub fn sigmas_m(&self, base: &DispersionSpec, distance_m: f64) -> (f64, f64) {
        scaled_sigmas_m(self.sigma_factors, base, distance_m)
    }

    /// Standard deviations of the spread at a distance, m.
    pub fn sigma_sds_m(&self, base: &DispersionSpec, distance_m: f64) -> (f64, f64) {
        scaled_sigmas_m(self.sigma_factor_sds, base, distance_m)
    }

    /// Standard deviation of where a bit of the plume is across the axis at a distance, m: by its spread, by what is not
    /// known of that, and by how far the axis may be off.
    pub fn across_sd_m(&self, base: &DispersionSpec, distance_m: f64) -> f64 {
        let sigma_y_m = self.sigmas_m(base, distance_m).0;
        let sigma_y_sd_m = self.sigma_sds_m(base, distance_m).0;
        let axis_sd_m = distance_m * self.axis_sd_deg.to_radians();
        sigma_y_m.hypot(sigma_y_sd_m).hypot(axis_sd_m)
    }

    /// Whether passes may be planned about the axis: it is known, in direction and height, to the plume's own spread at
    /// `distance_m`.
    pub fn is_located(&self, base: &DispersionSpec, distance_m: f64) -> bool {
        let (sigma_y_m, sigma_z_m) = self.sigmas_m(base, distance_m);
        distance_m * self.axis_sd_deg.to_radians() < sigma_y_m && self.height_sd_m < sigma_z_m
    }

    /// How far a place is down the axis from the source and to the right of it, m.
    pub fn along_and_right_m(&self, at: Enu) -> [f64; 2] {
        let (sin, cos) = self.axis_deg.to_radians().sin_cos();
        let (east_m, north_m) = (
            at.east_m - self.source.east_m,
            at.north_m - self.source.north_m,
        );
        [east_m * sin + north_m * cos, east_m * cos - north_m * sin]
    }

    /// The place `distance_m` down the axis and `right_m` to its right.
    pub fn place(&self, distance_m: f64, right_m: f64) -> Enu {
        self.source
            .displaced(self.axis_deg, distance_m)
            .displaced(self.axis_deg + 90.0, right_m)
    }
}

fn scaled_sigmas_m((y, z): (f64, f64), base: &DispersionSpec, distance_m: f64) -> (f64, f64) {
    (
        y * sigma_y_m(distance_m, base.stability, base.setting),
        z * sigma_z_m(distance_m, base.stability, base.setting),
    )
}
