//! The messages, one type a topic.

use crate::key::{AgentId, Topic};
use crate::time::SimTime;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Kind of a vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum VehicleKind {
    /// Flown by Plumage's own flight dynamics.
    Simulated,
    /// A real aircraft, or one that stands in for it, behind MAVLink.
    Real,
}

/// Position and motion of a vehicle (`va/<id>/state`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct State {
    /// Simulated or real.
    pub kind: VehicleKind,
    /// Latitude, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude, degrees (WGS84).
    pub lon_deg: f64,
    /// Altitude above mean sea level, m.
    pub alt_amsl_m: f64,
    /// Velocity over ground, north, east, down, m/s.
    pub vel_ned_m_s: [f64; 3],
    /// Bank angle, degrees, right wing down positive.
    pub roll_deg: f64,
    /// Pitch angle, degrees, nose up positive.
    pub pitch_deg: f64,
    /// Direction of the nose, degrees from true north, 0 to 360.
    pub heading_deg: f64,
    /// True airspeed, m/s.
    pub airspeed_m_s: f64,
    /// Throttle, 0 to 1.
    pub throttle: f64,
    /// In the air.
    pub airborne: bool,
}

/// Readings of a vehicle's sensors (`va/<id>/reading`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reading {
    /// Simulated or real: only real readings correct the world.
    pub kind: VehicleKind,
    /// Latitude where it was read, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude where it was read, degrees (WGS84).
    pub lon_deg: f64,
    /// Altitude where it was read, m above mean sea level.
    pub alt_amsl_m: f64,
    /// Mole fraction of the mission's gas as read, ppm; it keeps its name whatever the gas is.
    pub co2_ppm: f64,
    /// Wind speed estimated on board, m/s.
    pub wind_speed_m_s: Option<f64>,
    /// Direction from which that wind blows, degrees.
    pub wind_from_deg: Option<f64>,
    /// Air temperature, °C.
    pub temperature_c: Option<f64>,
    /// Static pressure, hPa.
    pub pressure_hpa: Option<f64>,
    /// Time of the reading, ns since the mission's start, if it differs from the time of publication.
    #[serde(default)]
    pub time_ns: Option<i64>,
}

impl Reading {
    /// Time of the reading, if it was published at `said`.
    pub fn read_at(&self, said: SimTime) -> SimTime {
        self.time_ns.map_or(said, SimTime::from_ns)
    }
}

/// Control level of a vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ControlLevel {
    /// Flown automatically to the squadron controller's setpoints.
    Automatic,
    /// A human pilot flies; setpoints are ignored and shown as ignored.
    Pilot,
    /// The Guardian brings it home.
    Guardian,
}

/// Control level of a vehicle and outcome of the last setpoint (`va/<id>/mode`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Mode {
    /// The control level.
    pub level: ControlLevel,
    /// Why, in words.
    pub reason: String,
    /// Whether setpoints are followed now.
    pub setpoints_obeyed: bool,
}

/// Health of a real vehicle and its link, from its autopilot (`va/<id>/health`), once a second. Unknown values
/// are null.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Health {
    /// MAVLink system of its autopilot.
    pub system_id: Option<u8>,
    /// MAVLink component of its autopilot.
    pub component_id: Option<u8>,
    /// Name of the autopilot, such as "ArduPlane".
    pub autopilot: String,
    /// Its flight mode.
    pub flight_mode: Option<String>,
    /// Whether its motor may turn.
    pub armed: Option<bool>,
    /// Remaining charge of its battery, percent.
    pub battery_percent: Option<u8>,
    /// Voltage of its battery, V.
    pub battery_v: Option<f64>,
    /// Satellites used for its position.
    pub satellites: Option<u8>,
    /// Time since it was last received, s.
    pub silent_s: Option<f64>,
    /// Frames that came whole.
    pub frames: u64,
    /// Frames that are missing in its own count.
    pub lost_frames: u64,
    /// Damaged or unreadable frames.
    pub unreadable_frames: u64,
    /// Frames that were refused for their signature.
    pub refused_frames: u64,
    /// Whether the checklist before its take-off was gone through; null where none is kept.
    pub checked: Option<bool>,
    /// Points of that list that are not met.
    pub findings: Vec<Finding>,
}

/// A point of the checklist before a take-off that is not right.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Finding {
    /// The point.
    pub about: String,
    /// Whether it prevents take-off; else it needs a person's attention.
    pub refused: bool,
    /// The value found and the value expected.
    pub says: String,
}

/// An operator's command on a vehicle's control level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ControlWish {
    /// The operator flies a simulated vehicle by these sticks; a real one's pilot has a remote
    /// control of his own.
    TakeOver,
    /// The vehicle is given back to automatic flight.
    HandBack,
    /// The vehicle is to come home and land; one on the ground stays there.
    Home,
    /// End the heartbeat to the real aircraft that a simulated one has replaced.
    Release,
}

/// Positions of a remote control's sticks, fly by wire.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sticks {
    /// Bank asked for, -1 (left) to 1, of the largest bank.
    pub roll: f64,
    /// Pitch asked for, -1 (down) to 1, of the largest pitch.
    pub pitch: f64,
    /// Throttle, 0 to 1.
    pub throttle: f64,
}

/// A command on the control of a vehicle (`va/<id>/control`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Control {
    /// Takeover, hand-back, the way home, or the release of a real aircraft.
    pub wish: ControlWish,
    /// The sticks of a takeover. None: held level at a little more than half power for as long
    /// as nobody sends any; once sent they have to be repeated, for their silence is a lost
    /// remote control.
    pub sticks: Option<Sticks>,
}

/// The replacement of a vehicle by another aircraft (`va/<id>/swap`).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Swap {
    /// The MAVLink link of the real aircraft that takes its place, such as `udpin:0.0.0.0:14550`; none: a simulated
    /// one does, from where it is.
    pub link: Option<String>,
    /// Whether the bridge may arm the motor of the real one.
    #[serde(default)]
    pub may_arm: bool,
}

/// The next target for a vehicle from an external search strategy (`va/<id>/destination`): the squadron
/// controller sends it there, within its own rules, while `search.strategy` is `outside`. A simulated vehicle that
/// an operator has taken over flies there itself, and circles there until its sticks are moved or it is handed
/// back.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Destination {
    /// Latitude, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude, degrees (WGS84).
    pub lon_deg: f64,
    /// Altitude, m above mean sea level.
    pub alt_amsl_m: f64,
}

/// How much an event matters.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// Worth knowing.
    Info,
    /// Needs attention.
    Warning,
    /// Something failed.
    Error,
}

/// Something that happened (`<agent>/event`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EventMessage {
    /// How much it matters.
    pub severity: Severity,
    /// Short stable code, kebab-case.
    pub code: String,
    /// The event as text.
    pub text: String,
}

impl EventMessage {
    /// An event with its stable code and its text.
    pub fn new(severity: Severity, code: &str, text: impl Into<String>) -> Self {
        Self {
            severity,
            code: code.to_owned(),
            text: text.into(),
        }
    }
}

/// The path a vehicle is asked to fly.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PathKind {
    /// Fly to the point and orbit it on arrival.
    GoTo,
    /// Circle the point.
    Orbit,
    /// Take off from home and climb to the point's altitude.
    TakeOff,
    /// Come home and land at the point.
    Land,
}

/// The flight path that a vehicle shall follow (`va/<id>/setpoint`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Setpoint {
    /// The path.
    pub path: PathKind,
    /// Latitude of the point, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude of the point, degrees (WGS84).
    pub lon_deg: f64,
    /// Altitude of the point, m above mean sea level.
    pub alt_amsl_m: f64,
    /// Airspeed to fly, m/s (true).
    pub airspeed_m_s: f64,
    /// Radius of an orbit around the point, m.
    pub orbit_radius_m: f64,
}

/// A raw MAVLink frame (`va/<id>/mavlink/{rx,tx}`).
#[derive(Debug, Clone, PartialEq)]
pub struct MavlinkFrame {
    /// The frame as on the wire, start byte to checksum or signature.
    pub bytes: Vec<u8>,
}

/// Raw frames are bytes in bincode and a hexadecimal string in JSON.
mod frame_serde {
    use super::MavlinkFrame;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    struct Text {
        hex: String,
    }

    impl Serialize for MavlinkFrame {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            if serializer.is_human_readable() {
                let hex = self.bytes.iter().map(|b| format!("{b:02x}")).collect();
                Text { hex }.serialize(serializer)
            } else {
                self.bytes.serialize(serializer)
            }
        }
    }

    impl<'de> Deserialize<'de> for MavlinkFrame {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            if !deserializer.is_human_readable() {
                return Ok(Self {
                    bytes: Vec::deserialize(deserializer)?,
                });
            }
            let text = Text::deserialize(deserializer)?.hex;
            let digits: Option<Vec<u32>> = text.chars().map(|c| c.to_digit(16)).collect();
            let digits = digits.filter(|d| d.len() % 2 == 0);
            let digits = digits
                .ok_or_else(|| serde::de::Error::custom("expected pairs of hexadecimal digits"))?;
            Ok(Self {
                bytes: digits
                    .chunks_exact(2)
                    .map(|p| (p[0] * 16 + p[1]) as u8)
                    .collect(),
            })
        }
    }

    impl schemars::JsonSchema for MavlinkFrame {
        fn schema_name() -> std::borrow::Cow<'static, str> {
            "MavlinkFrame".into()
        }
        fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
            schemars::json_schema!({
                "type": "object",
                "properties": {"hex": {"type": "string", "description": "the frame, hexadecimal"}},
                "required": ["hex"]
            })
        }
    }
}

/// The air around a vehicle (`ws/main/ambient/<va>`): ten times a second for a simulated vehicle, which flies in it, and
/// once a second for a real one, as the heartbeat of the world simulator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Ambient {
    /// Mean wind as a vector towards, north, east, down, m/s.
    pub wind_ned_m_s: [f64; 3],
    /// Gust on top of it, north, east, down, m/s.
    pub gust_ned_m_s: [f64; 3],
    /// Temperature, K.
    pub temperature_k: f64,
    /// Static pressure, Pa.
    pub pressure_pa: f64,
    /// Mole fraction of the mission's gas in the air, ppm; it keeps its name whatever the gas is.
    pub co2_ppm: f64,
    /// Height of the ground below, m above mean sea level.
    pub ground_amsl_m: f64,
}

/// A value with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// One standard deviation, same unit.
    pub sd: f64,
}

/// A mechanism with its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MechanismSetting {
    /// Id of the catalogue.
    pub id: String,
    /// Platforms to which it applies; all if empty.
    pub platforms: Vec<String>,
    /// Parameters by name.
    pub parameters: BTreeMap<String, f64>,
}

impl MechanismSetting {
    /// Its id with its value, where it has one parameter.
    pub fn only_parameter(&self) -> Option<(&str, f64)> {
        let mut values = self.parameters.values();
        let value = values.next()?;
        values.next().is_none().then_some((&self.id, *value))
    }

    /// From what the catalogue has: an id, platforms, and parameters by name.
    pub fn new<'a>(
        id: &str,
        platforms: &[String],
        parameters: impl Iterator<Item = (&'a str, f64)>,
    ) -> Self {
        Self {
            id: id.to_owned(),
            platforms: platforms.to_vec(),
            parameters: parameters
                .map(|(name, value)| (name.to_owned(), value))
                .collect(),
        }
    }
}

/// The world simulator's model of the plume (`ws/main/model`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Model {
    /// Background of the mission's gas, ppm.
    pub background_ppm: Estimate,
    /// Height of the plume's axis above ground at the first source, m.
    pub effective_height_agl_m: Estimate,
    /// Direction towards which the plume's axis runs, degrees.
    pub axis_deg: Estimate,
    /// Concentration above background on the axis at `c_max_distance_m`, ppm.
    pub c_max_ppm: Estimate,
    /// Distance from the source at which `c_max_ppm` holds, m.
    pub c_max_distance_m: Estimate,
    /// Scale of the lateral spread.
    pub sigma_y_scale: Estimate,
    /// Scale of the vertical spread.
    pub sigma_z_scale: Estimate,
    /// Wind speed at the plume's axis, m/s.
    pub wind_speed_m_s: f64,
    /// Readings of real vehicles that the model has taken in.
    pub observations: u64,
    /// Extensions in force.
    pub mechanisms: Vec<MechanismSetting>,
    /// The highest concentration where set-points may go; none before anything was read.
    pub peak: Option<Peak>,
    /// Emission rates of the sources, estimated from the readings.
    #[serde(default)]
    pub flux: Vec<Flux>,
}

/// The wind of the simulated world from now on, published after a change (`ws/main/weather`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Weather {
    /// The wind over time at the scenario's `wind_height_agl_m`, in order of time: between two rows the vector
    /// changes evenly, before the first and after the last it stays.
    pub wind: Vec<WindRow>,
}

/// The wind of one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WindRow {
    /// Mission time, s; before the mission's start negative.
    pub time_s: f64,
    /// Wind as a vector towards, north, east, m/s.
    pub wind_ne_m_s: [f64; 2],
}

/// Emission rate of a source.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Flux {
    /// The source's name; of several that were weighed together all names, with [`Flux::AND`] between them.
    pub source: String,
    /// How it was found.
    pub method: FluxMethod,
    /// Emission, kg/s.
    pub kg_s: Estimate,
}

impl Flux {
    /// Between the names of sources that were weighed together.
    pub const AND: &str = " + ";

    /// The first of `found` that was found by `method`: value and standard deviation, kg/s.
    pub fn by(method: FluxMethod, found: &[Self]) -> Option<(f64, f64)> {
        let first = found.iter().find(|f| f.method == method)?;
        Some((first.kg_s.value, first.kg_s.sd))
    }
}

/// How a flux was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FluxMethod {
    /// From the fit of the model to all readings, and the wind that was measured.
    Inference,
    /// Mass balance of passes across the plume.
    MassBalance,
    /// Both, which agree; last because methods are numbered in recordings.
    Combined,
}

/// A place worth flying to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PromisingPoint {
    /// Latitude, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude, degrees (WGS84).
    pub lon_deg: f64,
    /// Altitude, m above mean sea level.
    pub alt_amsl_m: f64,
    /// Fitness: concentration expected there from the samples so far, ppm.
    pub fitness_ppm: f64,
}

/// The search's population (`sc/main/population`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Population {
    /// Number of the search step.
    pub generation: u64,
    /// The points.
    pub points: Vec<PromisingPoint>,
}

/// A real reading handed to the world simulator (`sc/main/observation`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Observation {
    /// Vehicle that read it.
    pub vehicle: String,
    /// When it was read, ns since the mission's start.
    pub time_ns: i64,
    /// The reading.
    pub reading: Reading,
}

/// Phase of a mission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Taking off and climbing.
    TakeOff,
    /// Real vehicles search for the plume, which no reading has shown yet.
    Preliminary,
    /// Readings show the plume: real vehicles fly passes until it is located, the others search for the peak.
    Search,
    /// Passes through the peak of the plume that was located.
    Characterise,
    /// Coming home.
    Home,
    /// A curtain of passes downwind, by which an emission is weighed; after the passes through the peak,
    /// and last here because phases are numbered in recordings.
    Flux,
}

impl Phase {
    /// Whether the search lasted long enough to state the peak.
    pub fn has_searched(self) -> bool {
        !matches!(self, Self::TakeOff | Self::Preliminary)
    }
}

/// Target and task of one vehicle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Assignment {
    /// The vehicle.
    pub vehicle: String,
    /// Latitude, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude, degrees (WGS84).
    pub lon_deg: f64,
    /// Altitude, m above mean sea level.
    pub alt_amsl_m: f64,
    /// Why, in a word or two.
    pub purpose: String,
}

/// How far readings stand behind a peak.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PeakStatus {
    /// Readings of real crossings there agree with the prediction, within the combined uncertainty.
    Confirmed,
    /// Too few crossings there, but the plume reads as predicted where it was crossed.
    Supported,
    /// Readings contradict it, or it is hardly known.
    #[default]
    Doubtful,
    /// Nothing of a plume was read.
    NotFound,
}

impl PeakStatus {
    /// Whether real readings stand behind the peak: confirmed or supported.
    pub fn stands(self) -> bool {
        matches!(self, Self::Confirmed | Self::Supported)
    }

    /// It in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Confirmed => "confirmed",
            Self::Supported => "supported",
            Self::Doubtful => "doubtful",
            Self::NotFound => "not found",
        }
    }
}

/// The place of the highest concentration where set-points may go, as far as is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Peak {
    /// Latitude, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude, degrees (WGS84).
    pub lon_deg: f64,
    /// Altitude, m above mean sea level.
    pub alt_amsl_m: f64,
    /// Mole fraction of the mission's gas there, background included, ppm; it keeps its name whatever the gas is.
    pub co2_ppm: f64,
    /// One standard deviation of `co2_ppm`, the model's error of form included.
    pub sd_ppm: f64,
    /// Mission time for which it holds: when the plume was last met, s.
    #[serde(default)]
    pub time_s: f64,
    /// Support by readings; doubtful if not checked.
    #[serde(default)]
    pub status: PeakStatus,
}

/// The squadron controller's plan (`sc/main/plan`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Plan {
    /// Phase of the mission.
    pub phase: Phase,
    /// Targets of the vehicles.
    pub assignments: Vec<Assignment>,
    /// Running estimate of the peak.
    pub peak: Option<Peak>,
}

/// A cause that the reality gap considers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GapCause {
    /// Mechanisms that the readings cannot distinguish: one of them is the cause.
    pub mechanisms: Vec<String>,
    /// How probable it is, 0 to 1.
    pub probability: f64,
}

/// The text of a `verdict` on the reality gap, one of those of [`Extension`], with the texts of its `causes`.
pub fn verdict_text(verdict: &str, causes: &[String]) -> String {
    let causes = causes.join(", ");
    match verdict {
        "none" => "none: the readings agree with the model within its uncertainty".to_owned(),
        "insufficient" => {
            "insufficient: the readings are too few or too weak to test the model".to_owned()
        }
        "named" => format!("named: the readings deviate from the model because of {causes}"),
        "ambiguous" => {
            format!("ambiguous: the readings deviate from the model, possibly because of {causes}")
        }
        "unexplained" if causes.is_empty() => {
            "unexplained: the readings deviate from the model, and no listed \
             mechanism accounts for it"
                .to_owned()
        }
        "unexplained" => format!(
            "unexplained: the readings deviate from the model; {causes} accounts for a part of it, no listed mechanism \
             for the rest"
        ),
        other => other.to_owned(),
    }
}

/// Result of the reality gap analysis, and whether to adopt it (`sc/main/extension`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Extension {
    /// Verdict: none, named, ambiguous, unexplained or insufficient.
    pub verdict: String,
    /// Possible causes, the likeliest first.
    #[serde(default)]
    pub causes: Vec<GapCause>,
    /// Mechanisms to add.
    pub mechanisms: Vec<MechanismSetting>,
    /// Whether the world simulator shall fly with them from now on.
    pub adopt: bool,
}

/// Last sequence number written on each key path in a tick.
pub type LastSequences = BTreeMap<String, u64>;

/// The conductor starts a tick (`clock/main/tick`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tick {
    /// Number of the tick.
    pub tick: u64,
    /// Messages that every agent must have received before it starts: last sequence per key of the tick before.
    pub expect: LastSequences,
    /// The run ends with this tick.
    pub last: bool,
}

/// An agent has finished a tick (`clock/main/done/<agent>`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Done {
    /// Number of the tick; -1 stands ready before the first.
    pub tick: i64,
    /// Last sequence number it wrote on each key path.
    pub wrote: LastSequences,
}

/// Any message, by its topic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Message {
    /// On [`Topic::State`].
    State(State),
    /// On [`Topic::Reading`].
    Reading(Reading),
    /// On [`Topic::Mode`].
    Mode(Mode),
    /// On [`Topic::Event`].
    Event(EventMessage),
    /// On [`Topic::Setpoint`].
    Setpoint(Setpoint),
    /// On [`Topic::MavlinkRx`] and [`Topic::MavlinkTx`].
    Mavlink(MavlinkFrame),
    /// On [`Topic::Ambient`].
    Ambient(Ambient),
    /// On [`Topic::Model`].
    Model(Box<Model>),
    /// On [`Topic::Population`].
    Population(Population),
    /// On [`Topic::Observation`].
    Observation(Observation),
    /// On [`Topic::Plan`].
    Plan(Plan),
    /// On [`Topic::Extension`].
    Extension(Extension),
    /// On [`Topic::Tick`].
    Tick(Tick),
    /// On [`Topic::Done`].
    Done(Done),
    /// On [`Topic::Control`].
    Control(Control),
    /// On [`Topic::Weather`].
    Weather(Weather),
    /// On [`Topic::Destination`].
    Destination(Destination),
    /// On [`Topic::Swap`].
    Swap(Swap),
    /// On [`Topic::Health`].
    Health(Box<Health>),
}

/// Writes the matches that go through all kinds of messages once.
macro_rules! for_each_kind {
    ($($variant:ident, $type:ty, $name:literal, $topics:pat,)*) => {
        impl Message {
            /// Name of the kind of message.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$variant(_) => $name,)* }
            }

            /// Name of the kind of message that belongs on `topic`.
            pub fn name_on(topic: &Topic) -> &'static str {
                match topic { $($topics => $name,)* }
            }

            /// Serializes the message alone, without the name of its kind.
            pub(crate) fn serialize_content<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
                match self { $(Self::$variant(m) => m.serialize(to),)* }
            }

            /// Reads the JSON of the kind of message that belongs on `topic`.
            pub(crate) fn from_json(topic: &Topic, text: &str) -> serde_json::Result<Self> {
                match topic { $($topics => serde_json::from_str(text).map(Self::$variant),)* }
            }

            /// JSON Schema of the kind of message that belongs on `topic`.
            pub fn json_schema_on(topic: &Topic) -> schemars::Schema {
                match topic { $($topics => schemars::schema_for!($type),)* }
            }
        }
    };
}

for_each_kind! {
    State, State, "State", Topic::State(_),
    Reading, Reading, "Reading", Topic::Reading(_),
    Mode, Mode, "Mode", Topic::Mode(_),
    Event, EventMessage, "Event", Topic::Event(_),
    Setpoint, Setpoint, "Setpoint", Topic::Setpoint(_),
    Mavlink, MavlinkFrame, "MavlinkFrame", Topic::MavlinkRx(_) | Topic::MavlinkTx(_),
    Ambient, Ambient, "Ambient", Topic::Ambient(_),
    Model, Model, "Model", Topic::Model,
    Population, Population, "Population", Topic::Population,
    Observation, Observation, "Observation", Topic::Observation,
    Plan, Plan, "Plan", Topic::Plan,
    Extension, Extension, "Extension", Topic::Extension,
    Tick, Tick, "Tick", Topic::Tick,
    Done, Done, "Done", Topic::Done(_),
    Control, Control, "Control", Topic::Control(_),
    Weather, Weather, "Weather", Topic::Weather,
    Destination, Destination, "Destination", Topic::Destination(_),
    Swap, Swap, "Swap", Topic::Swap(_),
    Health, Health, "Health", Topic::Health(_),
}

impl Message {
    /// An event.
    pub fn event(severity: Severity, code: &str, text: impl Into<String>) -> Self {
        Self::Event(EventMessage::new(severity, code, text))
    }

    /// Whether this kind of message belongs on `topic` and `sender` may write there.
    ///
    /// # Errors
    /// [`crate::ProtocolError::WrongMessage`] or [`crate::ProtocolError::ForeignSender`].
    pub fn check(&self, topic: &Topic, sender: &AgentId) -> Result<(), crate::ProtocolError> {
        let expected = Self::name_on(topic);
        if self.name() != expected {
            return Err(crate::ProtocolError::WrongMessage {
                key: topic.path(),
                found: self.name(),
                expected,
            });
        }
        // Earlier recordings have the extension from the squadron controller.
        let is_of_earlier = *topic == Topic::Extension && *sender == AgentId::sc();
        if topic.writer() != *sender && !is_of_earlier {
            return Err(crate::ProtocolError::ForeignSender {
                sender: sender.to_string(),
                key: topic.path(),
            });
        }
        Ok(())
    }
}
