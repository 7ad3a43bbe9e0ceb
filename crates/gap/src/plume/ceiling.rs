//! Readings that stop at a limit: what the gate saw of the raw data, held against the model.

use ::plume::mechanism::MechanismId;

use super::fit::{Context, Fitted};
use crate::verdict::{Cause, Evidence, Parameter};

/// A platform whose readings stop at a limit.
#[derive(Debug, Clone)]
pub(crate) struct Ceiling {
    pub platform: String,
    pub limit_ppm: f64,
    /// Log score by which the limit beats its absence on the readings held, nats.
    pub nats: f64,
}

/// Least log score at which a ceiling is a finding, nats.
const CEILING_NATS: f64 = 10.0;

/// Ceilings that the gate saw, where the model predicts well above them. Readings held close
/// together share their intermittency: they count as many as fit between its correlation times.
pub(crate) fn ceilings(ctx: &Context<'_>, last: &Fitted) -> Vec<Ceiling> {
    let (size, scale_s) = last.noise.gust();
    let white = last.noise.white_ppm();
    let times = ctx.data.track.time_s();
    let mut out = Vec::new();
    for (held, limit_ppm) in &ctx.data.ceiling_ppm {
        let Some(&first) = held.first() else { continue };
        let mut nats = 0.0;
        let mut last_time = f64::NEG_INFINITY;
        for &i in held {
            let above = last.prediction.reading[i] - limit_ppm;
            let sd = white.hypot(size * last.prediction.plume[i]);
            let new = ((times[i] - last_time) / scale_s).min(1.0);
            last_time = times[i];
            nats += 0.5 * new * (above.max(0.0) / sd).powi(2);
        }
        if nats > CEILING_NATS {
            let platform = ctx.data.track.platforms()[ctx.data.platform_of(first)].clone();
            out.push(Ceiling {
                platform,
                limit_ppm: *limit_ppm,
                nats,
            });
        }
    }
    out
}

impl Ceiling {
    pub fn cause(&self) -> Cause {
        Cause {
            mechanisms: vec![MechanismId::SensorSaturation.as_str().to_string()],
            // Readings at one and the same top value leave little else.
            probability: 1.0 - (-self.nats).exp(),
            evidence: Evidence {
                delta_log_score: self.nats,
                delta_log_evidence: self.nats,
                p_value: (-self.nats).exp(),
            },
            parameters: vec![Parameter {
                mechanism: MechanismId::SensorSaturation.as_str().to_string(),
                name: "limit_ppm".to_string(),
                value: self.limit_ppm,
                sd: 0.0,
                unit: "ppm".to_string(),
            }],
            platforms: vec![self.platform.clone()],
            nats_to_next: self.nats,
        }
    }
}
