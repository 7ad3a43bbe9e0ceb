//! Bundles: the messages of one process and tick in one payload, for processes that follow many vehicles.
//!
//! A bus that routes each message by its key searches the keys of all vehicles for each. So a process publishes what
//! its agents say in a tick as one bundle, and each message on its own key only where somebody subscribes to that key.
//! A bundle holds whole envelopes with their paths; digest and recording are over these.
//!
//! ```
//! use protocol::bundle::{Bundle, entries};
//! use protocol::message::{Message, Severity};
//! use protocol::{AgentId, Envelope, SimTime, Topic};
//!
//! # fn main() -> Result<(), protocol::ProtocolError> {
//! let (topic, message) = (Topic::Event(AgentId::sc()), Message::event(Severity::Info, "here", "said"));
//! let envelope = Envelope::new(AgentId::sc(), 1, SimTime::ZERO, message);
//! let mut bundle = Bundle::default();
//! bundle.add(&topic, &envelope.to_bytes());
//! let payload = bundle.take();
//! for entry in entries(&payload) {
//!     let (path, bytes) = entry?;
//!     assert_eq!((Topic::parse_path(path)?, Envelope::from_bytes(&topic, bytes)?), (topic.clone(), envelope.clone()));
//! }
//! # Ok(())
//! # }
//! ```

use crate::ProtocolError;
use crate::key::{AgentKind, Interest, Name, Topic};

/// Which messages a bundle holds: raw frames are many, and only recorders and displays need them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum BundleKind {
    /// What vehicles, world and controller say.
    Messages,
    /// Raw MAVLink frames.
    Frames,
}

impl BundleKind {
    /// All kinds.
    pub const ALL: [Self; 2] = [Self::Messages, Self::Frames];

    /// The kind that holds messages on `topic`. None for the operator's and the conductor's, which come from single
    /// commands and have keys of their own only.
    pub fn of(topic: &Topic) -> Option<Self> {
        match topic {
            Topic::MavlinkRx(_) | Topic::MavlinkTx(_) => Some(Self::Frames),
            topic => match topic.writer().kind() {
                AgentKind::Va | AgentKind::Ws | AgentKind::Sc => Some(Self::Messages),
                AgentKind::Clock | AgentKind::Operator => None,
            },
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Messages => "bundle",
            Self::Frames => "frames",
        }
    }

    /// The key of the bundles of processes on `host` in `mission`.
    pub fn key(self, mission: &Name, host: &Name) -> String {
        format!("plumage/{mission}/team/{host}/{}", self.name())
    }

    /// The key expression of the bundles of all hosts in `mission`.
    pub fn key_expression(self, mission: &Name) -> String {
        format!("plumage/{mission}/team/*/{}", self.name())
    }
}

/// Kinds of the bundles that hold messages which `interest` covers.
pub fn kinds(interest: &Interest) -> Vec<BundleKind> {
    match interest {
        Interest::One(topic) | Interest::OfAny(topic) => {
            BundleKind::of(topic).into_iter().collect()
        }
        Interest::AllStates | Interest::AllReadings | Interest::AllModes => {
            vec![BundleKind::Messages]
        }
        Interest::Everything => BundleKind::ALL.to_vec(),
    }
}

/// Key expressions in `mission` of the messages that `interest` covers and no bundle holds.
pub fn key_expressions_beside(interest: &Interest, mission: &Name) -> Vec<String> {
    match interest {
        Interest::Everything => [
            "clock/main/tick",
            "clock/*/event",
            "clock/main/done/clock/*",
            "va/*/control",
            "va/*/swap",
            "va/*/destination",
        ]
        .map(|path| format!("plumage/{mission}/{path}"))
        .to_vec(),
        one if kinds(one).is_empty() => vec![one.key_expression(mission)],
        _ => Vec::new(),
    }
}

/// The host in the key of a bundle.
///
/// # Errors
/// [`ProtocolError::UnknownKey`] for any other key.
pub fn host_of(key: &str) -> Result<Name, ProtocolError> {
    let unknown = || ProtocolError::UnknownKey(key.to_owned());
    match key.split('/').collect::<Vec<_>>().as_slice() {
        ["plumage", _, "team", host, "bundle" | "frames"] => Name::new(host).map_err(|_| unknown()),
        _ => Err(unknown()),
    }
}

/// A bundle that is being filled.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Bundle(Vec<u8>);

impl Bundle {
    /// Adds the canonical bytes of an envelope on `topic`.
    pub fn add(&mut self, topic: &Topic, envelope: &[u8]) {
        let path = topic.path();
        for part in [path.as_bytes(), envelope] {
            // Longer parts cannot be: a path has a hundred bytes, and readers take envelopes of at most 1 MiB.
            let length = u32::try_from(part.len()).unwrap_or(u32::MAX);
            self.0.extend_from_slice(&length.to_be_bytes());
            self.0.extend_from_slice(part);
        }
    }

    /// Whether nothing was added.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Takes the payload; the bundle is empty afterwards.
    pub fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.0)
    }
}

/// The entries of a bundle's payload: path and bytes of each envelope. Ends after the first error.
pub fn entries(payload: &[u8]) -> impl Iterator<Item = Result<(&str, &[u8]), ProtocolError>> {
    let mut rest = payload;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let entry = part(&mut rest).zip(part(&mut rest));
        let entry = entry.and_then(|(path, bytes)| Some((std::str::from_utf8(path).ok()?, bytes)));
        if entry.is_none() {
            rest = &[];
        }
        Some(entry.ok_or_else(|| ProtocolError::Garbage {
            key: "bundle".to_owned(),
            why: "an entry is incomplete or its path is no text".to_owned(),
        }))
    })
}

/// Takes the next part off `rest`; none if it is incomplete.
fn part<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, after) = rest.split_first_chunk()?;
    let length = usize::try_from(u32::from_be_bytes(*length)).ok()?;
    let (part, after) = after.split_at_checked(length)?;
    *rest = after;
    Some(part)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::AgentId;
    use proptest::prelude::*;

    #[test]
    fn keys_of_bundles_name_their_host() {
        let (mission, host) = (Name::new("m").unwrap(), Name::new("air").unwrap());
        let key = BundleKind::Messages.key(&mission, &host);
        assert_eq!(key, "plumage/m/team/air/bundle");
        for kind in BundleKind::ALL {
            assert_eq!(host_of(&kind.key(&mission, &host)), Ok(host.clone()));
        }
        for other in ["plumage/m/team/air/other", "plumage/m/va/1/state", ""] {
            assert!(host_of(other).is_err(), "{other}");
        }
    }

    #[test]
    fn what_single_commands_say_is_in_no_bundle() {
        let va = Name::new("3").unwrap();
        for (topic, kind) in [
            (Topic::State(va.clone()), Some(BundleKind::Messages)),
            (Topic::Ambient(va.clone()), Some(BundleKind::Messages)),
            (Topic::Done(AgentId::sc()), Some(BundleKind::Messages)),
            (Topic::MavlinkRx(va.clone()), Some(BundleKind::Frames)),
            (Topic::Control(va), None),
            (Topic::Tick, None),
            (Topic::Event(AgentId::recorder()), None),
        ] {
            assert_eq!(BundleKind::of(&topic), kind, "{}", topic.path());
        }
    }

    #[test]
    fn all_messages_that_no_bundle_holds_have_a_subscription() {
        let mission = Name::new("m").unwrap();
        let others = key_expressions_beside(&Interest::Everything, &mission);
        let matches = |expression: &String, key: &str| {
            let (parts, of) = (expression.split('/'), key.split('/'));
            parts.clone().count() == of.clone().count()
                && parts.zip(of).all(|(part, of)| part == "*" || part == of)
        };
        for topic in crate::key::tests::every_topic() {
            let key = topic.key(&mission);
            let is_subscribed = others.iter().any(|other| matches(other, &key));
            assert_eq!(is_subscribed, BundleKind::of(&topic).is_none(), "{key}");
        }
    }

    proptest! {
        #[test]
        fn entries_come_back_in_order(said in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..300), 0..20)) {
            let topics = [Topic::Plan, Topic::State(Name::new("7").unwrap())];
            let mut bundle = Bundle::default();
            for (k, bytes) in said.iter().enumerate() {
                bundle.add(&topics[k % 2], bytes);
            }
            let payload = bundle.take();
            prop_assert!(bundle.is_empty());
            let read: Result<Vec<_>, _> = entries(&payload).collect();
            let read = read.unwrap();
            prop_assert_eq!(read.len(), said.len());
            for (k, (path, bytes)) in read.into_iter().enumerate() {
                prop_assert_eq!((path, bytes), (&*topics[k % 2].path(), &*said[k]));
            }
        }

        #[test]
        fn a_bundle_cut_short_is_an_error_and_whole_entries_before_it_are_read(cut in 1_usize..20) {
            let mut bundle = Bundle::default();
            bundle.add(&Topic::Plan, b"one");
            let whole = bundle.0.len();
            bundle.add(&Topic::Plan, b"another");
            let payload = bundle.take();
            let cut = &payload[..payload.len() - cut];
            prop_assume!(cut.len() > whole);
            let read: Vec<_> = entries(cut).collect();
            prop_assert!(read.len() == 2 && read[0].is_ok() && read[1].is_err());
        }
    }
}
