//! Who speaks and where: agent ids, topics and their key expressions.

use crate::ProtocolError;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::sync::Arc;

/// What an agent is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum AgentKind {
    /// A virtual aircraft.
    Va,
    /// The world simulator.
    Ws,
    /// The squadron controller.
    Sc,
    /// The conductor of a lockstep run.
    Clock,
    /// The operator, at the page or by a command.
    Operator,
}

impl AgentKind {
    /// The kind as it stands in keys.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Va => "va",
            Self::Ws => "ws",
            Self::Sc => "sc",
            Self::Clock => "clock",
            Self::Operator => "op",
        }
    }

    fn parse(text: &str) -> Option<Self> {
        [Self::Va, Self::Ws, Self::Sc, Self::Clock, Self::Operator]
            .into_iter()
            .find(|kind| kind.as_str() == text)
    }
}

/// A name that may stand in a key: 1 to 32 of letters, digits, `-` and `_`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Name(Arc<str>);

impl Name {
    /// Checks and takes a name.
    ///
    /// # Errors
    /// [`ProtocolError::BadName`].
    pub fn new(name: &str) -> Result<Self, ProtocolError> {
        let fits = (1..=32).contains(&name.len())
            && name
                .bytes()
                .all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_');
        if fits {
            Ok(Self(name.into()))
        } else {
            Err(ProtocolError::BadName(name.to_owned()))
        }
    }

    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// An agent: `va/<id>`, `ws/main`, `sc/main`, `clock/main` or `op/main`. Ordered by that text in UTF-8.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct AgentId {
    kind: AgentKind,
    name: Name,
}

impl AgentId {
    /// The virtual aircraft `name`.
    ///
    /// # Errors
    /// [`ProtocolError::BadName`].
    pub fn va(name: &str) -> Result<Self, ProtocolError> {
        Ok(Self {
            kind: AgentKind::Va,
            name: Name::new(name)?,
        })
    }

    /// The world simulator.
    pub fn ws() -> Self {
        Self::main(AgentKind::Ws)
    }

    /// The squadron controller.
    pub fn sc() -> Self {
        Self::main(AgentKind::Sc)
    }

    /// The conductor.
    pub fn clock() -> Self {
        Self::main(AgentKind::Clock)
    }

    /// The operator.
    pub fn operator() -> Self {
        Self::main(AgentKind::Operator)
    }

    /// The recorder of a lockstep run.
    pub fn recorder() -> Self {
        Self {
            kind: AgentKind::Clock,
            name: Name("recorder".into()),
        }
    }

    fn main(kind: AgentKind) -> Self {
        Self {
            kind,
            name: Name("main".into()),
        }
    }

    /// What it is.
    pub fn kind(&self) -> AgentKind {
        self.kind
    }

    /// Which one it is.
    pub fn name(&self) -> &Name {
        &self.name
    }

    /// Reads `kind/name`.
    ///
    /// # Errors
    /// [`ProtocolError::BadName`].
    pub fn parse(text: &str) -> Result<Self, ProtocolError> {
        let bad = || ProtocolError::BadName(text.to_owned());
        let (kind, name) = text.split_once('/').ok_or_else(bad)?;
        let kind = AgentKind::parse(kind).ok_or_else(bad)?;
        Ok(Self {
            kind,
            name: Name::new(name)?,
        })
    }
}

impl fmt::Display for AgentId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.kind.as_str(), self.name)
    }
}

impl Ord for AgentId {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        // The text's own order: kinds differ before the slash and none is another's prefix.
        (self.kind.as_str(), self.name.as_str()).cmp(&(other.kind.as_str(), other.name.as_str()))
    }
}

impl PartialOrd for AgentId {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Serialize for AgentId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for AgentId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        Self::parse(&text).map_err(serde::de::Error::custom)
    }
}

impl schemars::JsonSchema for AgentId {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "AgentId".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        String::json_schema(generator)
    }
}

/// What a message is about; with the mission's name it is a key expression.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Topic {
    /// `va/<id>/state`
    State(Name),
    /// `va/<id>/reading`
    Reading(Name),
    /// `va/<id>/mode`
    Mode(Name),
    /// `va/<id>/health`
    Health(Name),
    /// `va/<id>/event`, `ws/main/event`, `sc/main/event`, `clock/main/event`, `clock/recorder/event`
    Event(AgentId),
    /// `va/<id>/setpoint`, written by the squadron controller
    Setpoint(Name),
    /// `va/<id>/control`, written by the operator
    Control(Name),
    /// `va/<id>/swap`, written by the operator
    Swap(Name),
    /// `va/<id>/destination`, written by a search strategy outside the program in the operator's name
    Destination(Name),
    /// `va/<id>/mavlink/rx`: raw frames from the vehicle
    MavlinkRx(Name),
    /// `va/<id>/mavlink/tx`: raw frames to the vehicle
    MavlinkTx(Name),
    /// `ws/main/ambient/<va>`
    Ambient(Name),
    /// `ws/main/model`
    Model,
    /// `ws/main/weather`
    Weather,
    /// `sc/main/population`
    Population,
    /// `sc/main/observation`
    Observation,
    /// `sc/main/plan`
    Plan,
    /// `sc/main/extension`
    Extension,
    /// `clock/main/tick`
    Tick,
    /// `clock/main/done/<kind>/<id>`, written by that agent
    Done(AgentId),
}

impl Topic {
    /// The key without its mission: `<kind>/<id>/<topic>`.
    pub fn path(&self) -> String {
        match self {
            Self::State(va) => format!("va/{va}/state"),
            Self::Reading(va) => format!("va/{va}/reading"),
            Self::Mode(va) => format!("va/{va}/mode"),
            Self::Health(va) => format!("va/{va}/health"),
            Self::Event(agent) => format!("{agent}/event"),
            Self::Setpoint(va) => format!("va/{va}/setpoint"),
            Self::Control(va) => format!("va/{va}/control"),
            Self::Swap(va) => format!("va/{va}/swap"),
            Self::Destination(va) => format!("va/{va}/destination"),
            Self::MavlinkRx(va) => format!("va/{va}/mavlink/rx"),
            Self::MavlinkTx(va) => format!("va/{va}/mavlink/tx"),
            Self::Ambient(va) => format!("ws/main/ambient/{va}"),
            Self::Model => "ws/main/model".to_owned(),
            Self::Weather => "ws/main/weather".to_owned(),
            Self::Population => "sc/main/population".to_owned(),
            Self::Observation => "sc/main/observation".to_owned(),
            Self::Plan => "sc/main/plan".to_owned(),
            Self::Extension => "sc/main/extension".to_owned(),
            Self::Tick => "clock/main/tick".to_owned(),
            Self::Done(agent) => format!("clock/main/done/{agent}"),
        }
    }

    /// The vehicle that it is about or for; none of what is not a vehicle's.
    pub fn vehicle(&self) -> Option<&Name> {
        match self {
            Self::State(va)
            | Self::Reading(va)
            | Self::Mode(va)
            | Self::Health(va)
            | Self::Setpoint(va)
            | Self::Control(va)
            | Self::Swap(va)
            | Self::Destination(va)
            | Self::MavlinkRx(va)
            | Self::MavlinkTx(va)
            | Self::Ambient(va) => Some(va),
            _ => None,
        }
    }

    /// The path with any vehicle in the place of its own.
    fn path_of_any(&self) -> String {
        let Some(vehicle) = self.vehicle() else {
            return self.path();
        };
        let any = |(k, part): (usize, &str)| {
            // The first part is the kind of agent, which a vehicle may be called as well.
            let part = if k > 0 && part == vehicle.as_str() {
                "*"
            } else {
                part
            };
            part.to_owned()
        };
        let path = self.path();
        let parts: Vec<String> = path.split('/').enumerate().map(any).collect();
        parts.join("/")
    }

    /// The whole key expression of this topic in `mission`.
    pub fn key(&self, mission: &Name) -> String {
        format!("plumage/{mission}/{}", self.path())
    }

    /// Reads a path as [`Topic::path`] writes it.
    ///
    /// # Errors
    /// [`ProtocolError::UnknownKey`] or [`ProtocolError::BadName`].
    pub fn parse_path(path: &str) -> Result<Self, ProtocolError> {
        let parts: Vec<&str> = path.split('/').collect();
        Ok(match parts.as_slice() {
            ["va", id, "state"] => Self::State(Name::new(id)?),
            ["va", id, "reading"] => Self::Reading(Name::new(id)?),
            ["va", id, "mode"] => Self::Mode(Name::new(id)?),
            ["va", id, "health"] => Self::Health(Name::new(id)?),
            ["va", id, "setpoint"] => Self::Setpoint(Name::new(id)?),
            ["va", id, "control"] => Self::Control(Name::new(id)?),
            ["va", id, "swap"] => Self::Swap(Name::new(id)?),
            ["va", id, "destination"] => Self::Destination(Name::new(id)?),
            ["va", id, "mavlink", "rx"] => Self::MavlinkRx(Name::new(id)?),
            ["va", id, "mavlink", "tx"] => Self::MavlinkTx(Name::new(id)?),
            ["ws", "main", "ambient", id] => Self::Ambient(Name::new(id)?),
            ["ws", "main", "model"] => Self::Model,
            ["ws", "main", "weather"] => Self::Weather,
            ["sc", "main", "population"] => Self::Population,
            ["sc", "main", "observation"] => Self::Observation,
            ["sc", "main", "plan"] => Self::Plan,
            ["sc", "main", "extension"] => Self::Extension,
            [kind @ ("va" | "ws" | "sc" | "clock"), id, "event"] => {
                Self::Event(AgentId::parse(&format!("{kind}/{id}"))?)
            }
            ["clock", "main", "tick"] => Self::Tick,
            ["clock", "main", "done", kind, id] => {
                Self::Done(AgentId::parse(&format!("{kind}/{id}"))?)
            }
            _ => return Err(ProtocolError::UnknownKey(path.to_owned())),
        })
    }

    /// Reads a whole key of `mission`.
    ///
    /// # Errors
    /// As [`Topic::parse_path`]; also when the key is of another mission.
    pub fn parse_key(key: &str, mission: &Name) -> Result<Self, ProtocolError> {
        key.strip_prefix("plumage/")
            .and_then(|rest| rest.strip_prefix(mission.as_str()))
            .and_then(|rest| rest.strip_prefix('/'))
            .ok_or_else(|| ProtocolError::UnknownKey(key.to_owned()))
            .and_then(Self::parse_path)
    }

    /// Who alone may write here.
    pub fn writer(&self) -> AgentId {
        let va = |name: &Name| AgentId {
            kind: AgentKind::Va,
            name: name.clone(),
        };
        match self {
            Self::State(id) | Self::Reading(id) | Self::Mode(id) | Self::Health(id) => va(id),
            Self::MavlinkRx(id) | Self::MavlinkTx(id) => va(id),
            Self::Event(agent) | Self::Done(agent) => agent.clone(),
            Self::Ambient(_) | Self::Model | Self::Weather | Self::Extension => AgentId::ws(),
            Self::Setpoint(_) | Self::Population | Self::Observation | Self::Plan => AgentId::sc(),
            Self::Tick => AgentId::clock(),
            Self::Control(_) | Self::Swap(_) | Self::Destination(_) => AgentId::operator(),
        }
    }

    /// Of those who hear it the one who tells of what was refused on it, so that it is recorded once; none where
    /// whoever hears it does.
    pub fn refusals_told_by(&self) -> Option<AgentId> {
        match self {
            Self::Setpoint(id)
            | Self::Control(id)
            | Self::Swap(id)
            | Self::Destination(id)
            | Self::Ambient(id) => Some(AgentId {
                kind: AgentKind::Va,
                name: id.clone(),
            }),
            Self::State(_) | Self::Reading(_) | Self::Mode(_) | Self::Model => Some(AgentId::sc()),
            _ => None,
        }
    }

    /// Whether messages on it count in a run's digest: all but the clock's and raw MAVLink.
    pub fn is_in_digest(&self) -> bool {
        match self {
            Self::Tick | Self::Done(_) | Self::MavlinkRx(_) | Self::MavlinkTx(_) => false,
            Self::Event(agent) => agent.kind() != AgentKind::Clock,
            _ => true,
        }
    }
}

/// Which topics an agent wants to hear.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Interest {
    /// This topic alone.
    One(Topic),
    /// This topic of whatever vehicle.
    OfAny(Topic),
    /// `va/*/state` of all vehicles.
    AllStates,
    /// `va/*/reading` of all vehicles.
    AllReadings,
    /// `va/*/mode` of all vehicles.
    AllModes,
    /// Everything of the mission.
    Everything,
}

impl Interest {
    /// Whether `topic` is among those wanted.
    pub fn covers(&self, topic: &Topic) -> bool {
        match self {
            Self::One(one) => one == topic,
            Self::OfAny(one) => std::mem::discriminant(one) == std::mem::discriminant(topic),
            Self::AllStates => matches!(topic, Topic::State(_)),
            Self::AllReadings => matches!(topic, Topic::Reading(_)),
            Self::AllModes => matches!(topic, Topic::Mode(_)),
            Self::Everything => true,
        }
    }

    /// The key expression that subscribes to it in `mission`.
    pub fn key_expression(&self, mission: &Name) -> String {
        match self {
            Self::One(topic) => topic.key(mission),
            Self::OfAny(topic) => format!("plumage/{mission}/{}", topic.path_of_any()),
            Self::AllStates => format!("plumage/{mission}/va/*/state"),
            Self::AllReadings => format!("plumage/{mission}/va/*/reading"),
            Self::AllModes => format!("plumage/{mission}/va/*/mode"),
            Self::Everything => format!("plumage/{mission}/**"),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn every_topic() -> Vec<Topic> {
        let va = Name::new("va-1_x").unwrap();
        let agent = AgentId::va("2").unwrap();
        vec![
            Topic::State(va.clone()),
            Topic::Reading(va.clone()),
            Topic::Mode(va.clone()),
            Topic::Health(va.clone()),
            Topic::Event(agent.clone()),
            Topic::Event(AgentId::sc()),
            Topic::Event(AgentId::recorder()),
            Topic::Setpoint(va.clone()),
            Topic::Control(va.clone()),
            Topic::Swap(va.clone()),
            Topic::Destination(va.clone()),
            Topic::MavlinkRx(va.clone()),
            Topic::MavlinkTx(va.clone()),
            Topic::Ambient(va),
            Topic::Model,
            Topic::Weather,
            Topic::Population,
            Topic::Observation,
            Topic::Plan,
            Topic::Extension,
            Topic::Tick,
            Topic::Done(agent),
        ]
    }

    #[test]
    fn keys_read_back() {
        let mission = Name::new("as-pontes").unwrap();
        for topic in every_topic() {
            assert_eq!(Topic::parse_key(&topic.key(&mission), &mission), Ok(topic));
        }
    }

    #[test]
    fn keys_of_the_contract() {
        let mission = Name::new("m").unwrap();
        let va = Name::new("3").unwrap();
        assert_eq!(
            Topic::Ambient(va.clone()).key(&mission),
            "plumage/m/ws/main/ambient/3"
        );
        assert_eq!(
            Topic::Setpoint(va.clone()).key(&mission),
            "plumage/m/va/3/setpoint"
        );
        assert_eq!(
            Topic::MavlinkRx(va).key(&mission),
            "plumage/m/va/3/mavlink/rx"
        );
        assert_eq!(
            Topic::Done(AgentId::sc()).key(&mission),
            "plumage/m/clock/main/done/sc/main"
        );
    }

    #[test]
    fn a_topic_of_any_vehicle_covers_each_and_no_other() {
        let mission = Name::new("m").unwrap();
        let (two, three) = (Name::new("2").unwrap(), Name::new("3").unwrap());
        let any = Interest::OfAny(Topic::Ambient(two.clone()));
        assert_eq!(any.key_expression(&mission), "plumage/m/ws/main/ambient/*");
        assert!(any.covers(&Topic::Ambient(three.clone())) && !any.covers(&Topic::State(two)));
        let any = Interest::OfAny(Topic::Setpoint(three));
        assert_eq!(any.key_expression(&mission), "plumage/m/va/*/setpoint");
    }

    #[test]
    fn foreign_keys_are_refused() {
        let mission = Name::new("m").unwrap();
        for key in [
            "plumage/m2/ws/main/model",
            "plumage/m",
            "x/m/ws/main/model",
            "plumage/m/ws/other/model",
        ] {
            assert!(Topic::parse_key(key, &mission).is_err(), "{key}");
        }
        assert!(Name::new("a/b").is_err() && Name::new("").is_err() && Name::new("*").is_err());
    }

    #[test]
    fn agents_are_ordered_as_their_text() {
        let mut ids: Vec<AgentId> = ["ws/main", "va/10", "sc/main", "va/2", "va/a"]
            .iter()
            .map(|t| AgentId::parse(t).unwrap())
            .collect();
        let mut texts: Vec<String> = ids.iter().map(AgentId::to_string).collect();
        ids.sort();
        texts.sort();
        assert_eq!(
            ids.iter().map(AgentId::to_string).collect::<Vec<_>>(),
            texts
        );
    }
}
