//! What is known of the stand-ins' reality: its numbers, and the highest concentration that the
//! team may reach in it. The team never sees this; the summary holds its result against it.

use crate::MissionError;
use air::geo::Enu;
use air::wind::towards_deg;
use plume::{DispersionModel, Place};
use protocol::message::{Estimate, Peak};
use record::summary::ModelNumbers;
use scenario::Scenario;
use scenario::tables::VehicleKind;

/// First grid of the search for the peak, m.
const COARSE_M: f64 = 40.0;
/// Last grid of the search for the peak, m.
const FINE_M: f64 = 1.0;

/// Whether a vehicle of the team stands in for a real one, so that there is a reality.
pub fn has_stand_in(scenario: &Scenario) -> bool {
    scenario
        .vehicles
        .iter()
        .any(|v| v.kind == VehicleKind::StandIn)
}

/// The numbers of the model that `scenario` describes, with its priors as standard deviations.
///
/// # Errors
/// A scenario that describes no world.
pub fn numbers(scenario: &Scenario) -> Result<ModelNumbers, MissionError> {
    let calibrator = ws::Calibrator::new(scenario, &[], None)?;
    let c = calibrator.calibrated();
    Ok(ModelNumbers {
        background_ppm: c.background_ppm,
        effective_height_agl_m: c.effective_height_agl_m,
        axis_deg: c.axis_deg,
        c_max_ppm: c.c_max_ppm,
        c_max_distance_m: Estimate {
            value: c.c_max_distance_m,
            sd: 0.0,
        },
        sigma_y_scale: c.sigma_y_scale,
        sigma_z_scale: c.sigma_z_scale,
    })
}

/// The numbers of the reality of `scenario`, at the distance at which the scenario states c_MAX.
/// They are what they are: their standard deviations are zero.
///
/// # Errors
/// A reality that describes no world.
pub(crate) fn reality_numbers(scenario: &Scenario) -> Result<ModelNumbers, MissionError> {
    let spec = scenario.in_reality().dispersion_spec()?;
    let distance_m = scenario.dispersion_spec()?.sources[0]
        .strength
        .c_max_distance_m();
    let source = &spec.sources[0];
    let axis_deg = towards_deg(spec.wind.from_deg());
    let height_m = source.effective_height_agl_m;
    let exactly = |value: f64| Estimate { value, sd: 0.0 };
    let (background, y, z) = (spec.background_ppm, spec.sigma_y_scale, spec.sigma_z_scale);
    let model = DispersionModel::new(spec).map_err(scenario::world::WorldError::from)?;
    Ok(ModelNumbers {
        background_ppm: exactly(background),
        effective_height_agl_m: exactly(height_m),
        axis_deg: exactly(axis_deg),
        c_max_ppm: exactly(model.axis_excess_ppm(distance_m)),
        c_max_distance_m: exactly(distance_m),
        sigma_y_scale: exactly(y),
        sigma_z_scale: exactly(z),
    })
}

/// The maximum of the reality's mean field inside the fence and the height band and outside the
/// keep-out radius of every stack, by grids of falling spacing over all of it.
///
/// # Errors
/// A reality that describes no world, or a fence with nowhere to fly.
pub fn reachable_peak(scenario: &Scenario) -> Result<Peak, MissionError> {
    let model = scenario.in_reality().dispersion_model()?;
    let frame = scenario.frame()?;
    let region = Region::new(scenario, &model)?;
    let mut best: Option<(f64, Place)> = None;
    // A grid rather than a gradient: with several sources, a lid or a fence the field has several local
    // maxima, and the truth that results are held against must not depend on a starting point.
    let mut spacing_m = COARSE_M;
    let mut bounds = region.bounds();
    loop {
        best = region.best_on_grid(&model, &bounds, spacing_m, best);
        let Some((_, at)) = best else {
            return Err(MissionError::Request(
                "the fence leaves nowhere to fly".to_owned(),
            ));
        };
        if spacing_m <= FINE_M {
            break;
        }
        let reach = 2.0 * spacing_m;
        let axes = [at.east_m, at.north_m, at.height_agl_m];
        bounds = axes.map(|centre| (centre - reach, centre + reach));
        spacing_m = (spacing_m / 4.0).max(FINE_M);
    }
    let (ppm, at) = best.unwrap_or_default();
    let geodetic = frame.to_geodetic(Enu {
        east_m: at.east_m,
        north_m: at.north_m,
    });
    Ok(Peak {
        lat_deg: geodetic.lat_deg,
        lon_deg: geodetic.lon_deg,
        alt_amsl_m: frame.ground_amsl_m + at.height_agl_m,
        co2_ppm: ppm,
        sd_ppm: 0.0,
    })
}

/// Where the team may fly.
struct Region {
    polygon: Vec<Enu>,
    floor_m: f64,
    ceiling_m: f64,
    stacks: Vec<Enu>,
    keep_out_m: f64,
}

impl Region {
    fn new(scenario: &Scenario, model: &DispersionModel) -> Result<Self, MissionError> {
        Ok(Self {
            polygon: scenario.fence_polygon()?,
            floor_m: scenario.fence.floor_agl_m,
            ceiling_m: scenario.fence.ceiling_agl_m,
            stacks: model.spec().sources.iter().map(|s| s.place).collect(),
            keep_out_m: scenario.fence.keep_out_radius_m,
        })
    }

    fn bounds(&self) -> [(f64, f64); 3] {
        let span = |of: fn(&Enu) -> f64| {
            let values = self.polygon.iter().map(of);
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
                (l.min(v), h.max(v))
            })
        };
        [
            span(|c| c.east_m),
            span(|c| c.north_m),
            (self.floor_m, self.ceiling_m),
        ]
    }

    fn allows(&self, at: Enu) -> bool {
        air::area::is_inside(&self.polygon, at)
            && self
                .stacks
                .iter()
                .all(|s| s.distance_m(at) >= self.keep_out_m)
    }

    fn best_on_grid(
        &self,
        model: &DispersionModel,
        bounds: &[(f64, f64); 3],
        spacing_m: f64,
        mut best: Option<(f64, Place)>,
    ) -> Option<(f64, Place)> {
        let grid = |(low, high): (f64, f64)| {
            let n = ((high - low) / spacing_m).ceil().max(0.0) as usize;
            (0..=n).map(move |k| (low + k as f64 * spacing_m).min(high))
        };
        for east_m in grid(bounds[0]) {
            for north_m in grid(bounds[1]) {
                if !self.allows(Enu { east_m, north_m }) {
                    continue;
                }
                for height_agl_m in grid(bounds[2]) {
                    let height_agl_m = height_agl_m.clamp(self.floor_m, self.ceiling_m);
                    let place = Place {
                        east_m,
                        north_m,
                        height_agl_m,
                    };
                    let ppm = model.mean_ppm(&place, 0.0);
                    if best.is_none_or(|(highest, _)| ppm > highest) {
                        best = Some((ppm, place));
                    }
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_of_as_pontes_lies_on_the_axis_at_the_keep_out() {
        // On the axis c = c_MAX σy σz(2400)/σy σz(1000): with Briggs D that factor is 3.9994
        // (python: (.08*2400/1.24**.5*.06*2400/4.6**.5)/(.08*1000/1.1**.5*.06*1000/2.5**.5)),
        // so 446 + 500 × 3.9994 = 2445.7 ppm at 1000 m towards 72°, 540 m above ground.
        let text = include_str!("../../../scenarios/as-pontes.toml");
        let scenario = Scenario::parse("s", text).unwrap();
        let peak = reachable_peak(&scenario).unwrap();
        let at = scenario.frame().unwrap().to_enu(air::geo::Geodetic {
            lat_deg: peak.lat_deg,
            lon_deg: peak.lon_deg,
        });
        assert!(
            (Enu::default().distance_m(at) - 1000.0).abs() < 2.0,
            "{at:?}"
        );
        assert!(
            (Enu::default().bearing_deg(at) - 72.0).abs() < 0.2,
            "{at:?}"
        );
        assert!((peak.alt_amsl_m - 880.0).abs() < 1.5, "{peak:?}");
        assert!((peak.co2_ppm - 2445.7).abs() < 5.0, "{peak:?}");
    }
}
