//! Fitted parameters in the catalogue's words, with standard deviations over trials.

use super::model::PIVOT_M;
use super::trial_scores::Scored;
use crate::verdict::Parameter;

/// A parameter without its standard deviation.
struct Value {
    mechanism: &'static str,
    name: &'static str,
    value: f64,
    unit: &'static str,
    positive: bool,
}

/// Parameters of a scored model. A change of growth turns about 1 km in the catalogue, so its
/// level is written as the factor at 1 km. The standard deviation is that of the fit or, where it
/// is larger, the jackknife's over trials (Efron 1982), which asks nothing of the errors but that
/// trials are independent.
pub fn parameters(scored: &Scored) -> Vec<Parameter> {
    let at = |theta: &[f64]| values(&scored.ids, theta);
    let fit = &scored.fit;
    let without: Vec<Vec<Value>> = scored.theta_without.iter().map(|t| at(t)).collect();
    // Slopes of the written values by the fitted ones.
    let slopes: Vec<Vec<f64>> = (0..fit.theta.len())
        .map(|k| {
            const STEP: f64 = 1e-5;
            let moved = |by: f64| {
                let mut theta = fit.theta.clone();
                theta[k] += by;
                at(&theta)
            };
            let (up, down) = (moved(STEP), moved(-STEP));
            up.iter()
                .zip(&down)
                .map(|(u, d)| (u.value - d.value) / (2.0 * STEP))
                .collect()
        })
        .collect();
    at(&fit.theta)
        .into_iter()
        .enumerate()
        .map(|(p, v)| {
            let d = slopes.len();
            let variance: f64 = (0..d * d)
                .map(|ij| (ij / d, ij % d))
                .map(|(i, j)| slopes[i][p] * fit.covariance[(i, j)] * slopes[j][p])
                .sum();
            let each: Vec<f64> = without.iter().map(|w| w[p].value).collect();
            let least = if v.positive { 0.0 } else { f64::NEG_INFINITY };
            Parameter {
                mechanism: v.mechanism.to_owned(),
                name: v.name.to_owned(),
                value: v.value.max(least),
                sd: variance.sqrt().max(jackknife_sd(&each)),
                unit: v.unit.to_owned(),
            }
        })
        .collect()
}

/// Standard deviation of an estimate from the estimates without each of n trials.
fn jackknife_sd(each: &[f64]) -> f64 {
    let n = each.len() as f64;
    let mean = each.iter().sum::<f64>() / n;
    let sum: f64 = each.iter().map(|e| (e - mean).powi(2)).sum();
    (sum * (n - 1.0) / n).sqrt()
}

fn values(ids: &[&'static str], theta: &[f64]) -> Vec<Value> {
    let mut rest = theta.iter().copied();
    let mut next = || rest.next().unwrap_or(f64::NAN);
    let mut out = Vec::new();
    let mut push = |mechanism, name, value, unit, positive| {
        out.push(Value {
            mechanism,
            name,
            value,
            unit,
            positive,
        });
    };
    for &id in ids {
        match id {
            "sigma-z-growth" | "sigma-y-growth" => {
                let scale = if id == "sigma-z-growth" {
                    "sigma-z-scale"
                } else {
                    "sigma-y-scale"
                };
                let (log_factor, exponent) = (next(), next());
                let at_1_km = (log_factor + exponent * (1000.0 / PIVOT_M).ln()).exp();
                push(id, "exponent", exponent, "1", false);
                push(scale, "factor", at_1_km, "1", false);
            }
            "sigma-z-scale" | "sigma-y-scale" | "emission-scale" => {
                push(id, "factor", next().exp(), "1", false);
            }
            "dry-deposition" => push(id, "velocity_m_s", next(), "m/s", true),
            "first-order-decay" => push(id, "rate_per_s", next(), "1/s", true),
            _ => {}
        }
    }
    out
}

/// The fitted numbers behind parameters in the catalogue's words; none where one is missing or has no
/// logarithm.
pub fn fitted(ids: &[String], parameters: &[Parameter]) -> Option<Vec<f64>> {
    let of = |mechanism: &str| {
        let own = parameters.iter().find(|p| p.mechanism == mechanism)?;
        own.value.is_finite().then_some(own.value)
    };
    let log = |mechanism: &str| of(mechanism).filter(|f| *f > 0.0).map(f64::ln);
    let mut out = Vec::new();
    for id in ids {
        match id.as_str() {
            "sigma-z-growth" | "sigma-y-growth" => {
                let exponent = of(id)?;
                let at_1_km = log(&id.replace("growth", "scale"))?;
                out.push(at_1_km - exponent * (1000.0 / PIVOT_M).ln());
                out.push(exponent);
            }
            "sigma-z-scale" | "sigma-y-scale" | "emission-scale" => out.push(log(id)?),
            "dry-deposition" | "first-order-decay" => out.push(of(id)?),
            _ => {}
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fitted_numbers_come_back() {
        for ids in [
            &["wind-at-plume-height", "sigma-z-growth", "dry-deposition"][..],
            &["sigma-y-from-azimuth", "sigma-y-scale"],
            &["first-order-decay"],
            &["emission-scale"],
        ] {
            let theta = &[0.2, -0.3, 0.004][..ids.len().min(3)];
            let parameters: Vec<Parameter> = values(ids, theta)
                .into_iter()
                .map(|v| Parameter {
                    mechanism: v.mechanism.into(),
                    name: v.name.into(),
                    value: v.value,
                    sd: 0.1,
                    unit: v.unit.into(),
                })
                .collect();
            let ids: Vec<String> = ids.iter().map(|id| (*id).to_owned()).collect();
            let back = fitted(&ids, &parameters).unwrap();
            for (a, b) in back.iter().zip(theta) {
                assert!((a - b).abs() < 1e-12, "{ids:?}: {back:?}");
            }
            assert_eq!(fitted(&ids, &[]).is_some(), back.is_empty());
        }
    }

    // The jackknife of a mean is its standard error: of 1, 2, 6 it is 7^½ / 3^½ = 1.527525.
    #[test]
    fn jackknife_of_a_mean() {
        let got = jackknife_sd(&[4.0, 3.5, 1.5]);
        assert!((got - 1.527_525).abs() < 1e-6, "{got}");
    }
}
