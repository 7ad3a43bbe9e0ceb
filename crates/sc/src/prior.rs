//! What the search supposes of the plume: by the scenario, and later by the corrected model.

use air::wind::towards_deg;
use csea::{Estimate, PlumePrior};
use plume::DispersionSpec;
use protocol::message::{self, Model};
use scenario::Scenario;
use scenario::uncertain::{Uncertain, usual};

/// How long a meander lasts, s: eddies that move a plume of some hundred metres.
const MEANDER_S: f64 = 120.0;
/// Meander about the mean of ten minutes as a part of σθ, whose other part is the plume's own spread.
const MEANDER_PART: f64 = 0.5;

/// The scenario's word.
pub(crate) fn of(scenario: &Scenario, base: &DispersionSpec) -> PlumePrior {
    let sd = |key: Uncertain, default: f64| scenario.prior_sd(key).unwrap_or(default);
    let source = &base.sources[0];
    let table = &scenario.sources[0];
    let strength_sd = match (table.c_max_ppm, table.mean_emission_kg_s()) {
        (Some(c_max), _) => scenario.prior_sd(Uncertain::CMax).map(|sd| sd / c_max),
        (_, Some(q)) => scenario.prior_sd(Uncertain::Emission).map(|sd| sd / q),
        _ => None,
    };
    PlumePrior {
        axis_deg: Estimate {
            value: towards_deg(base.wind.from_deg()),
            sd: sd(Uncertain::WindFrom, usual::AXIS_SD_DEG),
        },
        height_amsl_m: Estimate {
            value: base.ground_amsl_m + source.effective_height_agl_m,
            sd: sd(
                Uncertain::EffectiveHeight,
                usual::height_sd_m(source.effective_height_agl_m),
            ),
        },
        ln_strength_sd: strength_sd
            .filter(|s| s.is_finite())
            .unwrap_or(usual::LN_STRENGTH_SD),
        ln_spread_sd: usual::LN_SPREAD_SD,
        background_ppm: Estimate {
            value: base.background_ppm,
            sd: sd(
                Uncertain::Background,
                // By nobody's word as uncertain as a reading, or by a thousandth.
                base.sensor.noise_sd_ppm.max(1e-3 * base.background_ppm),
            ),
        },
        noise_ppm: base
            .sensor
            .noise_sd_ppm
            .max(base.sensor.resolution_ppm)
            .max(f64::MIN_POSITIVE),
        meander: (MEANDER_PART * base.stability.sigma_theta_deg(), MEANDER_S),
        base: base.clone(),
    }
}

/// What readings have corrected.
pub(crate) fn by_model(prior: &mut PlumePrior, model: &Model) {
    let believed = |e: &message::Estimate| Estimate {
        value: e.value,
        sd: e.sd,
    };
    prior.axis_deg = believed(&model.axis_deg);
    let height = believed(&model.effective_height_agl_m);
    prior.height_amsl_m = Estimate {
        value: prior.base.ground_amsl_m + height.value,
        ..height
    };
    prior.background_ppm = believed(&model.background_ppm);
    let c_max = &model.c_max_ppm;
    prior.ln_strength_sd = prior
        .ln_strength_sd
        .min(c_max.sd / c_max.value.max(f64::MIN_POSITIVE));
    prior.base.sources[0].strength = plume::Strength::CMax {
        excess_ppm: c_max.value.max(0.0),
        distance_m: model.c_max_distance_m.value,
    };
    prior.base.sigma_y_scale = model.sigma_y_scale.value;
    prior.base.sigma_z_scale = model.sigma_z_scale.value;
}
