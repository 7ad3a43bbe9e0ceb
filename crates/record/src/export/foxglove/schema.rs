//! The schemas of Foxglove's messages, as JSON Schema: names and types of the fields that are written.

use serde_json::{Value, json};

/// What a message is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Where something is on the globe.
    LocationFix,
    /// Where a frame is in another.
    FrameTransform,
    /// Shapes in three dimensions.
    SceneUpdate,
    /// Numbers on a level grid.
    Grid,
    /// A line of a log.
    Log,
}

impl Kind {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::LocationFix => "foxglove.LocationFix",
            Self::FrameTransform => "foxglove.FrameTransform",
            Self::SceneUpdate => "foxglove.SceneUpdate",
            Self::Grid => "foxglove.Grid",
            Self::Log => "foxglove.Log",
        }
    }

    /// Its JSON Schema.
    pub fn json_schema(self) -> Value {
        let fields = match self {
            Self::LocationFix => json!({
                "timestamp": stamp(),
                "frame_id": text(),
                "latitude": number(),
                "longitude": number(),
                "altitude": number(),
                "position_covariance": list(number()),
                "position_covariance_type": whole(),
            }),
            Self::FrameTransform => json!({
                "timestamp": stamp(),
                "parent_frame_id": text(),
                "child_frame_id": text(),
                "translation": vector(),
                "rotation": turn(),
            }),
            Self::SceneUpdate => json!({
                "deletions": list(object(json!({"timestamp": stamp(), "type": whole(), "id": text()}))),
                "entities": list(entity()),
            }),
            Self::Grid => json!({
                "timestamp": stamp(),
                "frame_id": text(),
                "pose": pose(),
                "column_count": whole(),
                "cell_size": object(json!({"x": number(), "y": number()})),
                "row_stride": whole(),
                "cell_stride": whole(),
                "fields": list(object(json!({"name": text(), "offset": whole(), "type": whole()}))),
                "data": {"type": "string", "contentEncoding": "base64"},
            }),
            Self::Log => json!({
                "timestamp": stamp(),
                "level": whole(),
                "message": text(),
                "name": text(),
                "file": text(),
                "line": whole(),
            }),
        };
        let mut schema = object(fields);
        schema["title"] = json!(self.name());
        schema
    }
}

fn object(properties: Value) -> Value {
    json!({"type": "object", "properties": properties})
}

fn list(items: Value) -> Value {
    json!({"type": "array", "items": items})
}

fn text() -> Value {
    json!({"type": "string"})
}

fn number() -> Value {
    json!({"type": "number"})
}

fn whole() -> Value {
    json!({"type": "integer"})
}

fn flag() -> Value {
    json!({"type": "boolean"})
}

fn stamp() -> Value {
    object(json!({"sec": whole(), "nsec": whole()}))
}

fn vector() -> Value {
    object(json!({"x": number(), "y": number(), "z": number()}))
}

fn turn() -> Value {
    object(json!({"x": number(), "y": number(), "z": number(), "w": number()}))
}

fn pose() -> Value {
    object(json!({"position": vector(), "orientation": turn()}))
}

fn colour() -> Value {
    object(json!({"r": number(), "g": number(), "b": number(), "a": number()}))
}

fn entity() -> Value {
    let other = || list(object(json!({})));
    object(json!({
        "timestamp": stamp(),
        "frame_id": text(),
        "id": text(),
        "lifetime": stamp(),
        "frame_locked": flag(),
        "metadata": list(object(json!({"key": text(), "value": text()}))),
        "arrows": other(),
        "cubes": other(),
        "spheres": list(object(json!({"pose": pose(), "size": vector(), "color": colour()}))),
        "cylinders": list(object(json!({
            "pose": pose(),
            "size": vector(),
            "bottom_scale": number(),
            "top_scale": number(),
            "color": colour(),
        }))),
        "lines": list(object(json!({
            "type": whole(),
            "pose": pose(),
            "thickness": number(),
            "scale_invariant": flag(),
            "points": list(vector()),
            "color": colour(),
            "colors": list(colour()),
            "indices": list(whole()),
        }))),
        "triangles": other(),
        "texts": list(object(json!({
            "pose": pose(),
            "billboard": flag(),
            "font_size": number(),
            "scale_invariant": flag(),
            "color": colour(),
            "text": text(),
        }))),
        "models": other(),
    }))
}
