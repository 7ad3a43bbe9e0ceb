//! Foxglove's messages, made of a mission's own: where vehicles are, how they are turned, the plume, the places that
//! the search finds promising, and the log.
//!
//! Foxglove, *Message schemas*: JSON of `LocationFix`, `FrameTransform`, `SceneUpdate`, `Grid` and `Log`. The frame
//! `site` has its origin on the ground of the scenario's site, axes towards east, north and up; each vehicle has the
//! frame `vehicle/<name>`, forward, left and up.

mod schema;

pub use schema::Kind;

use super::pose;
use crate::contour::{Grid, PlumeLine};
use crate::kml::MapFeatures;
use air::geo::{Enu, Geodetic, LocalFrame};
use protocol::message::{EventMessage, Message, Model, Peak, Population, Reading, Severity, State};
use protocol::{Envelope, SimTime, Topic};
use serde_json::{Value, json};

/// Name of the site's frame.
const SITE: &str = "site";
/// Simulated time after which the plume is drawn anew, s: it changes slowly, and takes most of the bytes.
const PLUME_EVERY_S: f64 = 30.0;
/// Radius of the sphere that shows what a vehicle reads, and of a promising point, m.
const READING_M: f64 = 25.0;
const PROMISING_M: f64 = 15.0;
/// Type of the grid's numbers: FLOAT32 of PackedElementField.
const FLOAT32: u8 = 7;
/// Type of a line through all of its points: LINE_STRIP.
const LINE_STRIP: u8 = 0;

/// A message of Foxglove's.
#[derive(Debug, Clone, PartialEq)]
pub struct FoxgloveMessage {
    /// Its topic.
    pub topic: String,
    /// What it is.
    pub kind: Kind,
    /// When it was so.
    pub time: SimTime,
    /// Its content.
    pub json: Value,
}

/// A plume as it is drawn.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlumeShape {
    /// Lines of one concentration.
    pub lines: Vec<PlumeLine>,
    /// A level cut through its axis.
    pub slice: Option<Slice>,
}

/// A level cut through a plume, over a part of the map.
#[derive(Debug, Clone, PartialEq)]
pub struct Slice {
    /// Excess over the background, ppm, row by row from the south, west to east.
    pub excess_ppm: Grid,
    /// The grid's first point.
    pub low: Enu,
    /// Distance of its points, m.
    pub step_m: f64,
    /// Its altitude, m above mean sea level.
    pub alt_amsl_m: f64,
}

/// Makes Foxglove's messages of a mission's.
pub struct Converter<'a> {
    start_unix_ns: i64,
    frame: LocalFrame,
    around: MapFeatures,
    plume: Box<dyn Fn(&Model) -> PlumeShape + Send + 'a>,
    next_plume: SimTime,
}

impl<'a> Converter<'a> {
    /// Of a mission that began at `start_unix_ns` at the site of `frame`; `plume` draws that of a model.
    pub fn new(
        start_unix_ns: Option<i64>,
        frame: LocalFrame,
        around: MapFeatures,
        plume: impl Fn(&Model) -> PlumeShape + Send + 'a,
    ) -> Self {
        Self {
            start_unix_ns: start_unix_ns.unwrap_or(0),
            frame,
            around,
            plume: Box::new(plume),
            next_plume: SimTime::ZERO,
        }
    }

    /// What stands there from the beginning: stacks and fence.
    pub fn begin(&self) -> Vec<FoxgloveMessage> {
        let time = SimTime::ZERO;
        let stacks = self.around.stacks.iter().map(|stack| {
            let foot = self.point(stack.lat_deg, stack.lon_deg, self.frame.ground_amsl_m);
            let middle = [foot[0], foot[1], stack.height_m / 2.0];
            let height_m = stack.height_m.max(1.0);
            let cylinder = json!({
                "pose": pose_at(middle),
                "size": xyz([20.0, 20.0, height_m]),
                "bottom_scale": 1.0,
                "top_scale": 0.6,
                "color": colour([120, 120, 120], 1.0),
            });
            let text = json!({
                "pose": pose_at([foot[0], foot[1], stack.height_m + 20.0]),
                "billboard": true,
                "font_size": 14.0,
                "scale_invariant": true,
                "color": colour([240, 240, 240], 1.0),
                "text": stack.name,
            });
            self.entity(
                time,
                &format!("stack/{}", stack.name),
                json!({"cylinders": [cylinder], "texts": [text]}),
            )
        });
        let mut entities: Vec<Value> = stacks.collect();
        let corners = self.around.fence.iter().chain(self.around.fence.first());
        let corners: Vec<[f64; 3]> = corners
            .map(|&(lat, lon)| self.point(lat, lon, self.around.fence_top_amsl_m))
            .collect();
        if corners.len() > 3 {
            let fence = line(&corners, colour([64, 128, 192], 1.0), 2.0);
            entities.push(self.entity(time, "fence", json!({"lines": [fence]})));
        }
        vec![self.scene("/scene/site", time, entities)]
    }

    /// What a message of the mission comes to.
    pub fn take(&mut self, topic: &Topic, envelope: &Envelope) -> Vec<FoxgloveMessage> {
        let time = envelope.time;
        match (topic, &envelope.message) {
            (Topic::State(id), Message::State(state)) => self.state(id.as_str(), time, state),
            (Topic::Reading(id), Message::Reading(reading)) => {
                vec![self.reading(id.as_str(), time, reading)]
            }
            (Topic::Population, Message::Population(population)) => {
                vec![self.population(time, population)]
            }
            (Topic::Model, Message::Model(model)) if time >= self.next_plume => {
                self.next_plume = SimTime::from_s(time.s() + PLUME_EVERY_S);
                self.model(time, model)
            }
            (Topic::Event(agent), Message::Event(event)) => {
                vec![self.log(&agent.to_string(), time, event)]
            }
            _ => Vec::new(),
        }
    }

    fn state(&self, id: &str, time: SimTime, state: &State) -> Vec<FoxgloveMessage> {
        let turn = pose::quaternion(state);
        let transform = json!({
            "timestamp": self.stamp(time),
            "parent_frame_id": SITE,
            "child_frame_id": format!("vehicle/{id}"),
            "translation": xyz(self.point(state.lat_deg, state.lon_deg, state.alt_amsl_m)),
            "rotation": xyzw(turn),
        });
        let fix = json!({
            "timestamp": self.stamp(time),
            "frame_id": format!("vehicle/{id}"),
            "latitude": state.lat_deg,
            "longitude": state.lon_deg,
            "altitude": state.alt_amsl_m,
            "position_covariance": vec![0.0; 9],
            "position_covariance_type": 0,
        });
        vec![
            self.message("/tf", Kind::FrameTransform, time, transform),
            self.message(&format!("/vehicle/{id}/fix"), Kind::LocationFix, time, fix),
        ]
    }

    /// A sphere at the vehicle in the colour of what it reads.
    fn reading(&self, id: &str, time: SimTime, reading: &Reading) -> FoxgloveMessage {
        let shown = &self.around.shown;
        let at = self.point(reading.lat_deg, reading.lon_deg, reading.alt_amsl_m);
        let ball = sphere(at, READING_M, colour(shown.colour(reading.co2_ppm), 1.0));
        let text = json!({
            "pose": pose_at([at[0], at[1], at[2] + 2.0 * READING_M]),
            "billboard": true,
            "font_size": 12.0,
            "scale_invariant": true,
            "color": colour([240, 240, 240], 1.0),
            "text": format!("{id}: {} ppm {}", shown.number(reading.co2_ppm), shown.gas.formula()),
        });
        let entity = self.entity(
            time,
            &format!("reading/{id}"),
            json!({"spheres": [ball], "texts": [text]}),
        );
        self.scene("/scene/readings", time, vec![entity])
    }

    fn population(&self, time: SimTime, population: &Population) -> FoxgloveMessage {
        let shown = &self.around.shown;
        let points = population.points.iter().map(|p| {
            let at = self.point(p.lat_deg, p.lon_deg, p.alt_amsl_m);
            sphere(at, PROMISING_M, colour(shown.colour(p.fitness_ppm), 0.5))
        });
        let points: Vec<Value> = points.collect();
        let entity = self.entity(time, "promising", json!({"spheres": points}));
        self.scene("/scene/promising", time, vec![entity])
    }

    fn model(&self, time: SimTime, model: &Model) -> Vec<FoxgloveMessage> {
        let shape = (self.plume)(model);
        let lines: Vec<Value> = shape.lines.iter().map(|l| self.plume_line(l)).collect();
        let mut entities = vec![self.entity(time, "plume", json!({"lines": lines}))];
        entities.extend(model.peak.as_ref().map(|peak| self.peak(time, peak)));
        let mut messages = vec![self.scene("/scene/plume", time, entities)];
        messages.extend(shape.slice.map(|slice| self.slice(time, &slice)));
        messages
    }

    fn plume_line(&self, plume: &PlumeLine) -> Value {
        let shown = &self.around.shown;
        let corners = plume
            .corners
            .iter()
            .map(|[lon, lat, alt]| self.point(*lat, *lon, *alt));
        let corners: Vec<[f64; 3]> = corners.collect();
        line(
            &corners,
            colour(shown.colour(shown.grey_ppm + plume.excess_ppm), 0.8),
            1.5,
        )
    }

    fn peak(&self, time: SimTime, peak: &Peak) -> Value {
        let at = self.point(peak.lat_deg, peak.lon_deg, peak.alt_amsl_m);
        let ball = sphere(at, 2.0 * READING_M, colour([255, 215, 0], 0.8));
        self.entity(time, "peak", json!({"spheres": [ball]}))
    }

    fn slice(&self, time: SimTime, slice: &Slice) -> FoxgloveMessage {
        let bytes = slice
            .excess_ppm
            .values
            .iter()
            .flat_map(|v| (*v as f32).to_le_bytes());
        let bytes: Vec<u8> = bytes.collect();
        let columns = slice.excess_ppm.columns;
        let up_m = slice.alt_amsl_m - self.frame.ground_amsl_m;
        let half_m = slice.step_m / 2.0;
        let grid = json!({
            "timestamp": self.stamp(time),
            "frame_id": SITE,
            // The corner of the first cell, whose middle is the grid's first point.
            "pose": pose_at([slice.low.east_m - half_m, slice.low.north_m - half_m, up_m]),
            "column_count": columns,
            "cell_size": {"x": slice.step_m, "y": slice.step_m},
            "row_stride": columns * size_of::<f32>(),
            "cell_stride": size_of::<f32>(),
            "fields": [{"name": "excess_ppm", "offset": 0, "type": FLOAT32}],
            "data": base64(&bytes),
        });
        self.message("/plume/grid", Kind::Grid, time, grid)
    }

    fn log(&self, agent: &str, time: SimTime, event: &EventMessage) -> FoxgloveMessage {
        // INFO, WARNING and ERROR.
        let level = match event.severity {
            Severity::Info => 2,
            Severity::Warning => 3,
            Severity::Error => 4,
        };
        let log = json!({
            "timestamp": self.stamp(time),
            "level": level,
            "message": event.text,
            "name": agent,
            "file": event.code,
            "line": 0,
        });
        self.message("/log", Kind::Log, time, log)
    }

    fn message(&self, topic: &str, kind: Kind, time: SimTime, json: Value) -> FoxgloveMessage {
        FoxgloveMessage {
            topic: topic.to_owned(),
            kind,
            time,
            json,
        }
    }

    fn scene(&self, topic: &str, time: SimTime, entities: Vec<Value>) -> FoxgloveMessage {
        let update = json!({"deletions": [], "entities": entities});
        self.message(topic, Kind::SceneUpdate, time, update)
    }

    /// An entity that stays until it is published anew; `shapes` are the lists of shapes that it has.
    fn entity(&self, time: SimTime, id: &str, shapes: Value) -> Value {
        let mut entity = json!({
            "timestamp": self.stamp(time),
            "frame_id": SITE,
            "id": id,
            "lifetime": {"sec": 0, "nsec": 0},
            "frame_locked": true,
            "metadata": [],
            "arrows": [],
            "cubes": [],
            "spheres": [],
            "cylinders": [],
            "lines": [],
            "triangles": [],
            "texts": [],
            "models": [],
        });
        if let (Value::Object(entity), Value::Object(shapes)) = (&mut entity, shapes) {
            entity.extend(shapes);
        }
        entity
    }

    fn stamp(&self, time: SimTime) -> Value {
        let unix_ns = self.start_unix_ns.saturating_add(time.ns()).max(0);
        json!({"sec": unix_ns / 1_000_000_000, "nsec": unix_ns % 1_000_000_000})
    }

    /// A place in the site's frame, m.
    fn point(&self, lat_deg: f64, lon_deg: f64, alt_amsl_m: f64) -> [f64; 3] {
        let at = self.frame.to_enu(Geodetic { lat_deg, lon_deg });
        // A centimetre is finer than any position here.
        [at.east_m, at.north_m, alt_amsl_m - self.frame.ground_amsl_m]
            .map(|m| (m * 100.0).round() / 100.0)
    }
}

fn xyz([x, y, z]: [f64; 3]) -> Value {
    json!({"x": x, "y": y, "z": z})
}

fn xyzw([x, y, z, w]: [f64; 4]) -> Value {
    json!({"x": x, "y": y, "z": z, "w": w})
}

fn pose_at(at: [f64; 3]) -> Value {
    json!({"position": xyz(at), "orientation": xyzw([0.0, 0.0, 0.0, 1.0])})
}

fn colour(rgb: [u8; 3], alpha: f64) -> Value {
    let [r, g, b] = rgb.map(|c| (f64::from(c) / 255.0 * 1000.0).round() / 1000.0);
    json!({"r": r, "g": g, "b": b, "a": alpha})
}

fn sphere(at: [f64; 3], radius_m: f64, colour: Value) -> Value {
    let size_m = 2.0 * radius_m;
    json!({"pose": pose_at(at), "size": xyz([size_m; 3]), "color": colour})
}

fn line(corners: &[[f64; 3]], colour: Value, thickness: f64) -> Value {
    let points: Vec<Value> = corners.iter().map(|c| xyz(*c)).collect();
    json!({
        "type": LINE_STRIP,
        "pose": pose_at([0.0; 3]),
        "thickness": thickness,
        "scale_invariant": true,
        "points": points,
        "color": colour,
        "colors": [],
        "indices": [],
    })
}

/// Bytes as text (RFC 4648).
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let at = |k: usize| u32::from(three.get(k).copied().unwrap_or(0));
        let bits = at(0) << 16 | at(1) << 8 | at(2);
        for k in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * k) & 63) as usize];
            text.push(if k <= three.len() {
                char::from(letter)
            } else {
                '='
            });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_become_the_text_of_the_standard() {
        // RFC 4648, section 10.
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }
}
