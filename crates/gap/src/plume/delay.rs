//! Readings that come late: by how much the predicted ones then differ.

use super::fit::{Context, Fitted};

/// Delays that are longer than a plume takes to cross, for which its derivative does not stand, s.
pub(super) const LATE_S: [f64; 3] = [4.0, 10.0, 22.0];

/// Derivative of the predicted reading by time on each platform.
pub(super) fn rate_of_change(ctx: &Context<'_>, fitted: &Fitted) -> Vec<f64> {
    let times = ctx.data.track.time_s();
    let r = &fitted.prediction.reading;
    let mut out = vec![0.0; r.len()];
    for range in ctx.data.ranges() {
        for i in range.clone() {
            let (a, b) = (i.max(range.start + 1) - 1, (i + 1).min(range.end - 1));
            if times[b] > times[a] {
                out[i] = (r[b] - r[a]) / (times[b] - times[a]);
            }
        }
    }
    out
}

/// What readings that come late by some time differ by from those in time.
pub(super) fn late(ctx: &Context<'_>, fitted: &Fitted, by_s: f64) -> Vec<f64> {
    let times = ctx.data.track.time_s();
    let r = &fitted.prediction.reading;
    let mut out = vec![0.0; r.len()];
    for range in ctx.data.ranges() {
        let mut at = range.start;
        for i in range.clone() {
            let then = times[i] - by_s;
            while at + 1 < range.end && times[at + 1] <= then {
                at += 1;
            }
            let next = (at + 1).min(range.end - 1);
            let step = times[next] - times[at];
            let part = if step > 0.0 {
                ((then - times[at]) / step).clamp(0.0, 1.0)
            } else {
                0.0
            };
            out[i] = r[at] + part * (r[next] - r[at]) - r[i];
        }
    }
    out
}
