//! 95 % intervals beside the estimates of `summary.json`.

use crate::summary::{HighestReading, ModelNumbers, PeakSummary, PlaceOfPeak};
use protocol::message::{Estimate, Flux, FluxMethod, HALF_WIDTH_95_SD, Peak, PeakStatus};
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
    let half = HALF_WIDTH_95_SD * of.sd;
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
    #[derive(Serialize)]
    struct Json {
        background_ppm: WithInterval<Estimate>,
        effective_height_agl_m: WithInterval<Estimate>,
        axis_deg: WithInterval<Estimate>,
        c_max_ppm: WithInterval<Estimate>,
        c_max_distance_m: WithInterval<Estimate>,
        sigma_y_scale: WithInterval<Estimate>,
        sigma_z_scale: WithInterval<Estimate>,
    }
    let json = Json {
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

impl Serialize for PeakSummary {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Json<'a> {
            status: PeakStatus,
            estimate: Option<WithInterval<Peak>>,
            highest_reading: &'a Option<HighestReading>,
            truth: &'a Option<PlaceOfPeak>,
            error_m: Option<f64>,
            known_s: Option<f64>,
            came_near: bool,
        }
        let estimate = self.estimate;
        let json = Json {
            status: self.status,
            estimate: estimate.map(|peak| WithInterval::new(peak, self.interval_95_ppm)),
            highest_reading: &self.highest_reading,
            truth: &self.truth,
            error_m: self.error_m,
            known_s: self.known_s,
            came_near: self.came_near,
        };
        json.serialize(serializer)
    }
}
