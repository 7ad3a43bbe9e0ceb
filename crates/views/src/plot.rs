//! What the figures of all reports share.

use serde_json::{Value, json};

/// Rounds for a smaller file; what is not finite is null.
pub(crate) fn rounded(value: f64, per_unit: f64) -> Value {
    let value = (value * per_unit).round() / per_unit;
    if value.is_finite() {
        json!(value)
    } else {
        Value::Null
    }
}

/// The title of a panel, above its left corner, in the figure's own coordinates.
pub(crate) fn panel_title(name: &str, unit: &str, x: f64, y: f64) -> Value {
    let text = if unit.is_empty() {
        format!("<b>{name}</b>")
    } else {
        format!("<b>{name}</b>, {unit}")
    };
    json!({"text": text, "x": x, "y": y, "xref": "paper", "yref": "paper", "showarrow": false,
           "xanchor": "left", "yanchor": "bottom", "yshift": 3})
}

/// Every so many-th item, so that at most about `most` are left.
pub(crate) fn stride(count: usize, most: usize) -> usize {
    count.div_ceil(most.max(1)).max(1)
}

/// Colours that the colour-blind tell apart (Okabe and Ito 2008), for platforms and vehicles; the yellow is left
/// out, which is faint on white.
const APART: [&str; 7] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#16181d",
];

/// The colour of the `k`-th of several that are to be told apart.
pub(crate) fn colour_of(k: usize) -> &'static str {
    APART[k % APART.len()]
}

/// A line is broken where nothing was read for so many of the usual steps between two readings: over a pause it
/// would show what nobody read.
const STEPS_OF_A_PAUSE: f64 = 20.0;

/// Where a line over `time_s` has to be broken: the indices of what follows a pause.
pub(crate) fn pauses(time_s: &[f64]) -> Vec<usize> {
    let mut steps: Vec<f64> = time_s.windows(2).map(|t| t[1] - t[0]).collect();
    if steps.is_empty() {
        return Vec::new();
    }
    steps.sort_by(f64::total_cmp);
    let longest = STEPS_OF_A_PAUSE * steps[steps.len() / 2];
    let after_a_pause = |&i: &usize| time_s[i] - time_s[i - 1] > longest;
    (1..time_s.len()).filter(after_a_pause).collect()
}

/// From here on an axis of time has hours, s: numbers of seconds with five digits and more say nothing to a reader.
const HOURS_FROM_S: f64 = 3.0 * 3600.0;

/// The unit of an axis that spans so many seconds, and how many seconds it has.
pub(crate) fn unit_of_time(span_s: f64) -> (&'static str, f64) {
    if span_s > HOURS_FROM_S {
        ("h", 3600.0)
    } else {
        ("s", 1.0)
    }
}
