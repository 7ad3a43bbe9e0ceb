//! The corrected model as it goes over the bus, made a model again.

use air::wind::{WindProfile, towards_deg};
use plume::{DispersionModel, DispersionSpec, Strength};
use protocol::message::Model;

/// The dispersion model of `base` as the world simulator's `model` has corrected it; none where the
/// model cannot be.
pub fn corrected(base: &DispersionSpec, model: &Model) -> Option<DispersionModel> {
    let mut spec = base.clone();
    spec.background_ppm = model.background_ppm.value;
    let first = spec.sources.first_mut()?;
    first.effective_height_agl_m = model.effective_height_agl_m.value;
    first.strength = Strength::CMax {
        excess_ppm: model.c_max_ppm.value,
        distance_m: model.c_max_distance_m.value,
    };
    spec.wind = WindProfile::new(
        model.wind_speed_m_s,
        model.effective_height_agl_m.value.max(1.0),
        towards_deg(model.axis_deg.value),
        spec.wind.exponent(),
    )
    .ok()?;
    spec.sigma_y_scale = model.sigma_y_scale.value;
    spec.sigma_z_scale = model.sigma_z_scale.value;
    for m in &model.mechanisms {
        let parameters: Vec<(&str, f64)> =
            m.parameters.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        if let Ok(mechanism) = plume::Mechanism::new(&m.id, &parameters) {
            spec.mechanisms.push(mechanism);
        }
    }
    DispersionModel::new(spec).ok()
}
