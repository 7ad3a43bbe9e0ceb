//! The running estimate of where the plume is, on which passes and search are planned.

use air::geo::Enu;
use plume::DispersionSpec;
use plume::sigma::{sigma_y_m, sigma_z_m};
use protocol::message::Model;

/// Factors on σ outside these are not used in planning: an estimate that has gone astray
/// must not lead the passes out of the plume.
const LEAST_FACTOR: f64 = 0.3;
/// See [`LEAST_FACTOR`].
const GREATEST_FACTOR: f64 = 2.5;

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
    /// c_MAX's standard deviation as a part of it.
    pub strength_sd: f64,
    /// Factors on σy and σz, each with one standard deviation added: passes had rather be long.
    pub sigma_factors: (f64, f64),
}

impl PlumeEstimate {
    /// From a corrected model.
    pub fn of(model: &Model, base: &DispersionSpec) -> Self {
        // A third of the sensor's noise: 1 ppm of CO2.
        let least_ppm = (base.sensor.noise_sd_ppm / 3.0).max(f64::MIN_POSITIVE);
        let [y, z] = [&model.sigma_y_scale, &model.sigma_z_scale]
            .map(|s| (s.value + s.sd).clamp(LEAST_FACTOR, GREATEST_FACTOR));
        Self {
            source: base.sources.first().map_or(Enu::default(), |s| s.place),
            axis_deg: model.axis_deg.value,
            axis_sd_deg: model.axis_deg.sd.clamp(0.0, 30.0),
            height_amsl_m: base.ground_amsl_m + model.effective_height_agl_m.value,
            height_sd_m: model.effective_height_agl_m.sd.clamp(0.0, 200.0),
            strength_sd: model.c_max_ppm.sd / model.c_max_ppm.value.max(least_ppm),
            sigma_factors: (y, z),
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
            strength_sd: 1.0,
            sigma_factors: (base.sigma_y_scale, base.sigma_z_scale),
        }
    }

    /// Spread (σy, σz) at a distance, generously, m.
    pub fn sigmas_m(&self, base: &DispersionSpec, distance_m: f64) -> (f64, f64) {
        (
            self.sigma_factors.0 * sigma_y_m(distance_m, base.stability, base.setting),
            self.sigma_factors.1 * sigma_z_m(distance_m, base.stability, base.setting),
        )
    }

    /// Whether passes have shown enough: axis to 1.5°, height to 8 m, c_MAX to 8 %.
    pub fn is_precise(&self) -> bool {
        self.axis_sd_deg < 1.5 && self.height_sd_m < 8.0 && self.strength_sd < 0.08
    }

    /// The place `distance_m` down the axis and `right_m` to its right.
    pub fn place(&self, distance_m: f64, right_m: f64) -> Enu {
        self.source
            .displaced(self.axis_deg, distance_m)
            .displaced(self.axis_deg + 90.0, right_m)
    }
}
