//! Arcs predicted by the base and by the mean over models, and what the base gets wrong of them.

use serde::Serialize;

use super::arcs::{Arc, Weather};
use super::model::{Model, Numbers, ln_peak, same_distance};
use crate::verdict::ResidualBin;

/// One arc, measured and predicted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArcDetail {
    /// Trial.
    pub trial: String,
    /// "unstable" or "stable".
    pub group: String,
    /// Class.
    pub class: char,
    /// Distance, m.
    pub distance_m: f64,
    /// Samplers with a value.
    pub samplers: usize,
    /// Whether integral and width hold (the plume ends inside the arc).
    pub whole: bool,
    /// Highest concentration, mg/m³.
    pub max_mg_m3: f64,
    /// Crosswind-integrated concentration, mg/m².
    pub integrated_mg_m2: f64,
    /// Width, m.
    pub width_m: f64,
    /// The base's maximum, mg/m³.
    pub base_max_mg_m3: f64,
    /// The base's integral, mg/m².
    pub base_integrated_mg_m2: f64,
    /// The base's width, m.
    pub base_width_m: f64,
    /// Maximum predicted from the other trials, mg/m³.
    pub held_out_max_mg_m3: f64,
    /// Integral predicted from the other trials, mg/m².
    pub held_out_integrated_mg_m2: f64,
    /// Width predicted from the other trials, m.
    pub held_out_width_m: f64,
}

/// A model with its probability and its numbers.
pub type Weighted = (f64, Model, Numbers);

/// Models of integrals, of widths where the deviation of azimuth is known, and of widths where it is not.
pub type Models = [Vec<Weighted>; 3];

/// Mean of what the models predict by their probability. Those that cannot predict here pass their share on, evenly if
/// they had all of it.
fn averaged(models: &[Weighted], predict: impl Fn(&Model, &Numbers) -> Option<f64>) -> Option<f64> {
    let one = |(weight, model, numbers): &Weighted| Some((*weight, predict(model, numbers)?));
    let mut each: Vec<(f64, f64)> = models.iter().filter_map(one).collect();
    if each.iter().all(|e| e.0 == 0.0) {
        each.iter_mut().for_each(|e| e.0 = 1.0);
    }
    let sum: f64 = each.iter().map(|(w, v)| w * v).sum();
    let weight: f64 = each.iter().map(|e| e.0).sum();
    (weight > 0.0).then(|| sum / weight)
}

/// An arc in air of kind `group` with the predictions of the base and of the models: where there are none of this kind
/// of width those of the other kind, and where there are none at all the base.
pub fn arc(w: &Weather, group: &str, arc: &Arc, [vertical, known, unknown]: &Models) -> ArcDetail {
    let (x, z) = (arc.distance_m, arc.height_m);
    let (briggs, none) = (Model::default(), Numbers::default());
    let base_integral = briggs.ln_integral(w, x, z, &none);
    let base_width = briggs.ln_width(w, x, &none).unwrap_or(f64::NAN);
    let lateral = match w.sigma_azimuth_rad {
        Some(_) => [known, unknown],
        None => [unknown, known],
    };
    let integral = averaged(vertical, |m, n| Some(m.ln_integral(w, x, z, n)));
    let integral = integral.unwrap_or(base_integral);
    let width = |models: &Vec<Weighted>| averaged(models, |m, n| m.ln_width(w, x, n));
    let width = lateral.into_iter().find_map(width).unwrap_or(base_width);
    ArcDetail {
        trial: w.trial.clone(),
        group: group.to_owned(),
        class: w.class.letter(),
        distance_m: x,
        samplers: arc.samplers,
        whole: arc.whole,
        max_mg_m3: arc.max_mg_m3,
        integrated_mg_m2: arc.integrated_mg_m2,
        width_m: arc.width_m,
        base_max_mg_m3: ln_peak(base_integral, base_width).exp(),
        base_integrated_mg_m2: base_integral.exp(),
        base_width_m: base_width.exp(),
        held_out_max_mg_m3: ln_peak(integral, width).exp(),
        held_out_integrated_mg_m2: integral.exp(),
        held_out_width_m: width.exp(),
    }
}

/// Mean of ln(measured/predicted) of arc maxima by kind of air and distance, as standardised
/// means; concentrations in ppm are not known without the gas.
pub fn residual(arcs: &[ArcDetail]) -> Vec<ResidualBin> {
    let mut bins: Vec<Vec<&ArcDetail>> = Vec::new();
    for arc in arcs {
        let same = |bin: &&mut Vec<&ArcDetail>| {
            bin[0].group == arc.group && same_distance(bin[0].distance_m, arc.distance_m)
        };
        match bins.iter_mut().find(same) {
            Some(bin) => bin.push(arc),
            None => bins.push(vec![arc]),
        }
    }
    let bin = |arcs: &Vec<&ArcDetail>| {
        let ln = |a: &&ArcDetail| (a.max_mg_m3 / a.base_max_mg_m3).ln();
        let n = arcs.len() as f64;
        let mean = arcs.iter().map(ln).sum::<f64>() / n;
        let square: f64 = arcs.iter().map(|a| (ln(a) - mean).powi(2)).sum();
        ResidualBin {
            coordinate: "along_wind".into(),
            platform: Some(arcs[0].group.clone()),
            from: arcs[0].distance_m,
            to: arcs.iter().map(|a| a.distance_m).fold(0.0, f64::max),
            unit: "m".into(),
            count: arcs.len(),
            mean_ppm: f64::NAN,
            standardised: mean / (square / (n - 1.0) / n).sqrt(),
        }
    };
    bins.iter().map(bin).collect()
}
