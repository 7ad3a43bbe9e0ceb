//! Bundles on the bus: what a process publishes in a tick as one message, and what it takes of the bundles of others.

use crate::locks::lock;
use crate::session::Intake;
use protocol::bundle::{self, BundleKind};
use protocol::key::Name;
use protocol::{Envelope, Interest, ProtocolError, Topic};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};
use zenoh::key_expr::OwnedKeyExpr;
use zenoh::sample::Sample;

/// Host in the keys of bundles of a mission without host keys. Every holder of the mission's key may then publish for any
/// agent.
pub(crate) const ANY_HOST: &str = "any";

/// Name of the rule of Zenoh's access control that lists what `host` may publish.
pub fn publish_rule(host: &Name) -> String {
    format!("{host}{PUBLISHES}")
}

const PUBLISHES: &str = " publishes";

/// Which messages each host may publish. Zenoh checks the key of a bundle, and this the messages in it.
#[derive(Debug, Default)]
pub(crate) struct Roles(Option<BTreeMap<String, HostRoles>>);

#[derive(Debug, Default)]
struct HostRoles {
    keys: Vec<OwnedKeyExpr>,
    /// Topics on these keys, of which messages have come: they are looked up for each.
    topics: BTreeSet<Topic>,
}

impl Roles {
    /// The roles in Zenoh's access control, as `plumage keys new` writes it; without it every host may publish all.
    pub(crate) fn of(access_control: Option<&str>) -> Self {
        let Some(access) = access_control else {
            return Self(None);
        };
        // Access control that cannot be read allows nothing; Zenoh has rejected it by then.
        let access: serde_json::Value = serde_json::from_str(access).unwrap_or_default();
        let rules = access["rules"].as_array().into_iter().flatten();
        let host = |rule: &serde_json::Value| {
            let host = rule["id"].as_str()?.strip_suffix(PUBLISHES)?.to_owned();
            let keys = rule["key_exprs"].as_array()?.iter();
            let keys = keys.filter_map(|key| OwnedKeyExpr::new(key.as_str()?).ok());
            let roles = HostRoles {
                keys: keys.collect(),
                topics: BTreeSet::new(),
            };
            Some((host, roles))
        };
        Self(Some(rules.filter_map(host).collect()))
    }

    /// Whether `host` may publish on `topic` of `mission`.
    fn allow(&mut self, host: &Name, topic: &Topic, mission: &Name) -> bool {
        let Some(hosts) = &mut self.0 else {
            return true;
        };
        let Some(roles) = hosts.get_mut(host.as_str()) else {
            return false;
        };
        if roles.topics.contains(topic) {
            return true;
        }
        let key = OwnedKeyExpr::new(topic.key(mission)).ok();
        let is_allowed = key.is_some_and(|key| roles.keys.iter().any(|all| all.includes(&key)));
        if is_allowed {
            roles.topics.insert(topic.clone());
        }
        is_allowed
    }
}

/// Takes from bundles what this process is interested in.
#[derive(Clone)]
pub(crate) struct Unbundler {
    intake: Intake,
    roles: Arc<Mutex<Roles>>,
    interests: Arc<Mutex<Vec<Interest>>>,
}

impl Unbundler {
    pub(crate) fn new(intake: Intake, roles: Roles) -> Self {
        Self {
            intake,
            roles: Arc::new(Mutex::new(roles)),
            interests: Arc::default(),
        }
    }

    /// From now on it takes what `interest` covers as well. The kinds of bundles to subscribe to for that.
    pub(crate) fn add(&self, interest: &Interest) -> Vec<BundleKind> {
        lock(&self.interests).push(interest.clone());
        bundle::kinds(interest).to_vec()
    }

    /// Takes a bundle.
    pub(crate) fn take(&self, sample: &Sample) {
        let key = sample.key_expr().as_str();
        let payload = sample.payload().to_bytes();
        let opened = bundle::host_of(key).and_then(|host| {
            self.intake
                .check_seal(sample, &payload, || key.to_owned())?;
            Ok(host)
        });
        let host = match opened {
            Ok(host) => host,
            Err(fault) => return self.intake.deliver(None, Err(fault)),
        };
        for entry in bundle::entries(&payload) {
            match entry.and_then(|(path, bytes)| Ok((Topic::parse_path(path)?, bytes))) {
                Ok((topic, bytes)) if self.wants(&topic) => {
                    let envelope = self.open(&host, &topic, bytes);
                    self.intake
                        .deliver(Some(&topic.clone()), envelope.map(|e| (topic, e)));
                }
                Ok(_) => {}
                Err(fault) => self.intake.deliver(None, Err(fault)),
            }
        }
    }

    fn wants(&self, topic: &Topic) -> bool {
        lock(&self.interests)
            .iter()
            .any(|interest| interest.covers(topic))
    }

    fn open(&self, host: &Name, topic: &Topic, bytes: &[u8]) -> Result<Envelope, ProtocolError> {
        if !lock(&self.roles).allow(host, topic, &self.intake.mission) {
            return Err(ProtocolError::ForeignHost {
                host: host.to_string(),
                key: topic.path(),
            });
        }
        let envelope = Envelope::from_bytes(topic, bytes)?;
        envelope.message.check_numbers(topic)?;
        Ok(envelope)
    }
}
