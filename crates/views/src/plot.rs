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
