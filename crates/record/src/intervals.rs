//! 95 % intervals beside the estimates of `summary.json`.

use crate::summary::{ModelNumbers, PeakSummary};
use protocol::message::{Estimate, Flux, FluxMethod};
use serde::{Serialize, Serializer};

/// An estimate with the ends of its 95 % interval; null where it has none.
#[derive(Serialize)]
struct WithInterval<T> {
    #[serde(flatten)]
    of: T,
    low95: Option<f64>,
    high95: Option<f64>,
}

impl<T> WithInterval<T> {
    fn new(of: T, interval: Option<[f64; 2]>) -> Self {
        Self {
            of,
            low95: interval.map(|ends| ends[0]),
            high95: interval.map(|ends| ends[1]),
        }
    }
}

/// The 95 % interval of a positive quantity, by a log-normal distribution; none of an estimate that is not positive.
pub fn positive_interval_95(of: Estimate) -> Option<[f64; 2]> {
    let is_positive = of.value > 0.0 && of.value.is_finite() && of.sd.is_finite();
    let interval = is_positive.then(|| study::Interval::of_mean(of.value, of.sd))?;
    Some([interval.low95, interval.high95])
}

fn positive(of: Estimate) -> WithInterval<Estimate> {
    WithInterval::new(of, positive_interval_95(of))
}

fn normal(of: Estimate) -> WithInterval<Estimate> {
    let half = study::SD_95 * of.sd;
    WithInterval::new(of, Some([of.value - half, of.value + half]))
}

/// Writes an emission rate with its interval.
pub(crate) fn flux<S: Serializer>(of: &Flux, serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Json<'a> {
        source: &'a str,
        method: FluxMethod,
        kg_s: WithInterval<Estimate>,
    }
    let Flux {
        source,
        method,
        kg_s,
    } = of;
    let (method, kg_s) = (*method, positive(*kg_s));
    let json = Json {
        source,
        method,
        kg_s,
    };
    json.serialize(serializer)
}

/// Writes the numbers of a model with their intervals.
pub(crate) fn model<S: Serializer>(of: &ModelNumbers, serializer: S) -> Result<S::Ok, S::Error> {
    let json = ModelNumbers {
        background_ppm: normal(of.background_ppm),
        effective_height_agl_m: normal(of.effective_height_agl_m),
        axis_deg: normal(of.axis_deg),
        c_max_ppm: positive(of.c_max_ppm),
        c_max_distance_m: positive(of.c_max_distance_m),
        sigma_y_scale: positive(of.sigma_y_scale),
        sigma_z_scale: positive(of.sigma_z_scale),
    };
    json.serialize(serializer)
}

/// Writes a peak with its interval.
pub(crate) fn peak<S: Serializer>(of: &PeakSummary, serializer: S) -> Result<S::Ok, S::Error> {
    let estimate = of.estimate;
    let json = PeakSummary {
        status: of.status,
        estimate: estimate.map(|peak| WithInterval::new(peak, of.interval_95_ppm)),
        interval_95_ppm: None,
        highest_reading: of.highest_reading.clone(),
        truth: of.truth,
        error_m: of.error_m,
        known_s: of.known_s,
        came_near: of.came_near,
    };
    json.serialize(serializer)
}
