//! What is supposed of a plume of class D from the origin towards the north-east.

use air::geo::Enu;
use air::isa::Atmosphere;
use air::wind::WindProfile;
use csea::{Estimate, PlumePrior};
use plume::sigma::Setting;
use plume::stability::Stability;
use plume::{DispersionSpec, Gas, SensorSpec, SourceSpec, Strength};

/// The prior with a direction that is known so well.
pub fn prior(axis_sd_deg: f64) -> PlumePrior {
    let source = SourceSpec {
        name: "stack".to_owned(),
        gas: Gas::Co2,
        place: Enu::default(),
        area: None,
        stack_height_m: 356.0,
        effective_height_agl_m: 500.0,
        schedule: None,
        strength: Strength::CMax {
            excess_ppm: 1400.0,
            distance_m: 2400.0,
        },
    };
    let base = DispersionSpec {
        ground_amsl_m: 0.0,
        atmosphere: Atmosphere::through(500.0, 15.0, 950.0).unwrap(),
        wind: WindProfile::new(7.0, 500.0, 240.0, 0.15).unwrap(),
        stability: Stability::D,
        setting: Setting::Rural,
        ground_reflection: false,
        mixing_height_m: None,
        lid_edge_m: 0.0,
        background_ppm: 449.0,
        sources: vec![source],
        sigma_y_scale: 1.0,
        sigma_z_scale: 1.0,
        mechanisms: Vec::new(),
        sensor: SensorSpec::default(),
    };
    let unsure = |value: f64, sd: f64| Estimate { value, sd };
    PlumePrior {
        axis_deg: unsure(60.0, axis_sd_deg),
        height_amsl_m: unsure(500.0, 50.0),
        ln_strength_sd: 0.3,
        ln_spread_sd: 0.2,
        background_ppm: unsure(449.0, 1.0),
        noise_ppm: 3.0,
        meander: (1.0, 60.0),
        base,
    }
}
