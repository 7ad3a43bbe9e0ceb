//! The vertical density of a plume near the ground, and what is not known of it.

use crate::gain_ln_sd;
use crate::grid::{normal_grid, variance};
use plume::DispersionSpec;
use plume::sigma::sigma_z_m;
use plume::stability::Stability;
use scenario::Scenario;
use scenario::uncertain::Uncertain;

/// Standard deviation of ln σz of one class about Briggs' curve (Hanna, Briggs & Hosker 1982: about 25 % in ideal
/// conditions).
const CURVE_LN_SD: f64 = 0.25;
/// A source without a stack stands on a structure, in whose wake its plume begins: initial σz is its height over this
/// number (US EPA 1995, ISC3 User's Guide II, table 3-1: an elevated source on or adjacent to a building).
const HEIGHTS_PER_INITIAL_SIGMA_Z: f64 = 2.15;

/// The plume at a distance.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MeanPlume {
    pub axis_agl_m: f64,
    pub sigma_z_m: f64,
    /// Whether the ground reflects it.
    pub reflects: bool,
}

impl MeanPlume {
    /// Density over height, 1/m.
    pub fn density_1_m(&self, height_agl_m: f64) -> f64 {
        let bell = |off_m: f64| (-0.5 * (off_m / self.sigma_z_m).powi(2)).exp();
        let image = if self.reflects {
            bell(height_agl_m + self.axis_agl_m)
        } else {
            0.0
        };
        (bell(height_agl_m - self.axis_agl_m) + image)
            / (std::f64::consts::TAU.sqrt() * self.sigma_z_m)
    }
}

/// The plume's density over height, and its uncertain parameters.
pub(crate) struct Vertical<'a> {
    pub spec: &'a DispersionSpec,
    /// Standard deviation of the source's position, east and north, m.
    pub position_sd_m: f64,
    /// Standard deviation of ln gain of the sensor.
    pub gain_ln_sd: f64,
    initial_sigma_z_m: f64,
    source_height_sd_m: f64,
    stated_sigma_z_ln_sd: Option<f64>,
}

impl<'a> Vertical<'a> {
    pub fn new(scenario: &Scenario, spec: &'a DispersionSpec) -> Self {
        let source = &spec.sources[0];
        let has_stack = scenario.sources[0].stack_height_m > 0.0;
        let sigma_z = scenario.prior_sd(Uncertain::SigmaZScale);
        Self {
            position_sd_m: scenario.sources[0].position_sd_m,
            gain_ln_sd: gain_ln_sd(scenario),
            initial_sigma_z_m: if has_stack {
                0.0
            } else {
                source.effective_height_agl_m / HEIGHTS_PER_INITIAL_SIGMA_Z
            },
            source_height_sd_m: scenario.prior_sd(Uncertain::EffectiveHeight).unwrap_or(0.0),
            stated_sigma_z_ln_sd: sigma_z.map(|sd| sd / spec.sigma_z_scale),
            spec,
        }
    }

    /// The plume so far downwind, with σz and the source's height off by so many standard deviations.
    pub fn plume(
        &self,
        distance_m: f64,
        class: Stability,
        [sigma_z_off, height_off]: [f64; 2],
    ) -> MeanPlume {
        let spread_m = sigma_z_m(distance_m, class, self.spec.setting)
            * self.spec.sigma_z_scale
            * (self.sigma_z_ln_sd(distance_m) * sigma_z_off).exp();
        MeanPlume {
            axis_agl_m: self.spec.sources[0].effective_height_agl_m
                + self.source_height_sd_m * height_off,
            sigma_z_m: spread_m.hypot(self.initial_sigma_z_m),
            reflects: self.spec.ground_reflection,
        }
    }

    /// Density at `height_agl_m`, 1/m, of [`Self::plume`].
    pub fn density_1_m(
        &self,
        (distance_m, height_agl_m): (f64, f64),
        class: Stability,
        off: [f64; 2],
    ) -> f64 {
        self.plume(distance_m, class, off).density_1_m(height_agl_m)
    }

    /// Standard deviation of ln σz: what the scenario states, or that of the curve and of a class that is known to half a
    /// class.
    fn sigma_z_ln_sd(&self, distance_m: f64) -> f64 {
        if let Some(stated) = self.stated_sigma_z_ln_sd {
            return stated;
        }
        let ln = |class: Stability| sigma_z_m(distance_m, class, self.spec.setting).ln();
        let steps: Vec<f64> = neighbours(self.spec.stability)
            .into_iter()
            .flatten()
            .map(|class| (ln(class) - ln(self.spec.stability)).abs())
            .collect();
        CURVE_LN_SD.hypot(0.5 * steps.iter().sum::<f64>() / steps.len() as f64)
    }

    /// Whether the source's height is uncertain.
    pub fn height_steps(&self, steps: usize) -> Vec<(f64, f64)> {
        if self.source_height_sd_m > 0.0 {
            normal_grid(steps)
        } else {
            vec![(0.0, 1.0)]
        }
    }

    /// ln density at a place, with weights.
    pub fn ln_density(&self, at: (f64, f64), steps: usize) -> Vec<(f64, f64)> {
        let mut out = Vec::new();
        for (sigma_z_off, by_sigma_z) in normal_grid(steps) {
            for &(height_off, by_height) in &self.height_steps(steps) {
                let off = [sigma_z_off, height_off];
                let density = self.density_1_m(at, self.spec.stability, off);
                out.push((density.ln(), by_sigma_z * by_height));
            }
        }
        out
    }

    /// Variances of ln density by σz and by the height.
    pub fn variances(&self, at: (f64, f64), steps: usize) -> [f64; 2] {
        let of = |grid: Vec<(f64, f64)>, off: &dyn Fn(f64) -> [f64; 2]| {
            let ln = |z: f64| self.density_1_m(at, self.spec.stability, off(z)).ln();
            let values: Vec<(f64, f64)> = grid.into_iter().map(|(z, w)| (ln(z), w)).collect();
            variance(&values)
        };
        [
            of(normal_grid(steps), &|z| [z, 0.0]),
            of(self.height_steps(steps), &|z| [0.0, z]),
        ]
    }

    /// Rates of a median `kg_s` in the next less and the next more stable class, kg/s.
    pub fn one_class_off(&self, at: (f64, f64), kg_s: f64) -> [Option<f64>; 2] {
        let density = |class| self.density_1_m(at, class, [0.0; 2]);
        let own = density(self.spec.stability);
        neighbours(self.spec.stability).map(|class| Some(kg_s * own / density(class?)))
    }

    /// The least density at a place within two standard deviations of σz, 1/m.
    pub fn least_density_1_m(&self, at: (f64, f64)) -> f64 {
        [-2.0, 0.0, 2.0]
            .map(|z| self.density_1_m(at, self.spec.stability, [z, 0.0]))
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }

    /// Mass per volume of 1 ppm of the source's gas at a height, kg/m³.
    pub fn kg_m3_per_ppm(&self, height_agl_m: f64) -> f64 {
        let alt_amsl_m = self.spec.ground_amsl_m + height_agl_m;
        let air = self.spec.atmosphere.at(alt_amsl_m);
        self.spec.sources[0].gas.kg_m3(1.0, air)
    }
}

/// The next less and the next more stable class.
fn neighbours(class: Stability) -> [Option<Stability>; 2] {
    let at = |index: Option<usize>| index.and_then(|i| Stability::ALL.get(i).copied());
    [
        at(class.index().checked_sub(1)),
        at(Some(class.index() + 1)),
    ]
}
