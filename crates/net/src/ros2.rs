//! A node of ROS 2 that publishes on Zenoh in the format of rmw_zenoh, so that ROS 2 on that middleware receives a mission.
//!
//! rmw_zenoh, *docs/design.md*, and its releases since 0.2.4 (2025): a topic has the key
//! `<domain>/<topic>/<type>/<hash of the type>`; a node and each of its publishers declare liveliness tokens under
//! `@ros2_lv`; a message carries its number, its time and its publisher's id. The session is separate: ROS 2 sees
//! nothing of the mission's bus, and no message from there reaches the bus.

use crate::options::set;
use crate::{NetError, check_endpoints};
use futures_core::future::BoxFuture;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;

/// Endpoint of rmw_zenoh's router.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";
/// Prefix of the keys of liveliness tokens.
const GRAPH: &str = "@ros2_lv";
/// rclcpp's and rclpy's usual quality of service, reliable with the last ten kept, as far as it is not rmw_zenoh's own
/// default (which keeps 42).
const QUALITY: &str = "::,10:,:,:,,";
/// Messages queued for the network: some seconds of a team. Further ones are lost, and the mission continues.
const WAITING: usize = 4096;
/// Number of the node in its session.
const NODE: u64 = 0;

/// A message for a topic.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RosMessage {
    /// Topic, such as `/vehicle_3/fix`.
    pub topic: String,
    /// Name of the type, such as `sensor_msgs/msg/NavSatFix`.
    pub type_name: String,
    /// Hash of the type (REP 2016), `RIHS01_` and 64 digits.
    pub type_hash: String,
    /// Time of its content, ns since 1970.
    pub at_unix_ns: i64,
    /// Its bytes in CDR.
    pub cdr: Vec<u8>,
}

/// A node on a domain of ROS 2.
pub struct Node {
    sender: mpsc::Sender<RosMessage>,
    task: JoinHandle<()>,
    lost: Arc<AtomicU64>,
}

impl Node {
    /// Declares the node `name` on `domain` to the peer at `endpoint`, which may start later.
    ///
    /// # Errors
    /// An endpoint that Zenoh rejects.
    pub fn open<'a>(
        name: &'a str,
        domain: u32,
        endpoint: &'a str,
    ) -> BoxFuture<'a, Result<Self, NetError>> {
        Box::pin(async move {
            let session = zenoh::open(configuration(endpoint)?)
                .await
                .map_err(NetError::zenoh)?;
            let place = Place {
                domain,
                zid: session.zid().to_string(),
                name: name.to_owned(),
            };
            let token = session.liveliness().declare_token(place.node()).await;
            let mut speaker = Speaker {
                _token: token.map_err(NetError::zenoh)?,
                session,
                place,
                topics: BTreeMap::new(),
            };
            let (sender, mut receiver) = mpsc::channel(WAITING);
            let lost = Arc::new(AtomicU64::new(0));
            let failed = Arc::clone(&lost);
            let task = tokio::spawn(async move {
                while let Some(message) = receiver.recv().await {
                    if speaker.say(message).await.is_err() {
                        failed.fetch_add(1, Ordering::Relaxed);
                    }
                }
                // A peer that does not answer while connections close has lost nothing.
                let _ = speaker.session.close().await;
            });
            Ok(Self { sender, task, lost })
        })
    }

    /// Publishes a message without waiting for a peer.
    pub fn say(&self, message: RosMessage) {
        if self.sender.try_send(message).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Messages that were not published, because the queue was full or Zenoh rejected them.
    pub fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }

    /// Closes the session after the last message is published.
    pub fn close(self) -> BoxFuture<'static, ()> {
        Box::pin(async move {
            drop(self.sender);
            let _ = self.task.await;
        })
    }
}

/// A session like those of ROS 2: a peer that learns of the others from its endpoint.
fn configuration(endpoint: &str) -> Result<zenoh::Config, NetError> {
    check_endpoints([endpoint])?;
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", serde_json::json!("peer")),
        ("scouting/multicast/enabled", false.into()),
        ("scouting/gossip/enabled", true.into()),
        ("listen/endpoints", serde_json::json!(["tcp/127.0.0.1:0"])),
        ("connect/endpoints", serde_json::json!([endpoint])),
        ("connect/timeout_ms", (-1).into()),
        ("connect/exit_on_failure", false.into()),
    ] {
        set(&mut config, key, value)?;
    }
    Ok(config)
}

/// The keys of a node.
struct Place {
    domain: u32,
    zid: String,
    name: String,
}

impl Place {
    /// `@ros2_lv/<domain>/<session>/<node>/<entity>/<kind>/<enclave>/<namespace>/<node's name>`, the names' `/` as `%`.
    fn entity(&self, number: u64, kind: &str) -> String {
        let Self { domain, zid, name } = self;
        format!("{GRAPH}/{domain}/{zid}/{NODE}/{number}/{kind}/%/%/{name}")
    }

    fn node(&self) -> String {
        self.entity(NODE, "NN")
    }

    fn publisher(&self, number: u64, message: &RosMessage) -> String {
        format!(
            "{}/{}/{}/{}/{QUALITY}",
            self.entity(number, "MP"),
            message.topic.replace('/', "%"),
            dds_name(&message.type_name),
            message.type_hash
        )
    }

    fn topic(&self, message: &RosMessage) -> String {
        format!(
            "{}/{}/{}/{}",
            self.domain,
            message.topic.trim_matches('/'),
            dds_name(&message.type_name),
            message.type_hash
        )
    }
}

/// `sensor_msgs/msg/NavSatFix` as `sensor_msgs::msg::dds_::NavSatFix_`.
fn dds_name(type_name: &str) -> String {
    let (package, kind) = type_name.rsplit_once('/').unwrap_or(("", type_name));
    format!("{}::dds_::{kind}_", package.replace('/', "::"))
}

/// A publisher's id: the hash of its token, as rmw_zenoh computes it.
fn id(token: &str) -> [u8; 16] {
    twox_hash::XxHash3_128::oneshot(token.as_bytes()).to_le_bytes()
}

/// Attachment of a message: its number, its time, and the length and the bytes of its publisher's id.
fn attachment(number: i64, at_unix_ns: i64, id: &[u8; 16]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(33);
    bytes.extend(number.to_le_bytes());
    bytes.extend(at_unix_ns.to_le_bytes());
    bytes.push(16);
    bytes.extend(id);
    bytes
}

struct TopicOfNode {
    publisher: Publisher<'static>,
    id: [u8; 16],
    sequence: i64,
    _token: LivelinessToken,
}

struct Speaker {
    session: zenoh::Session,
    place: Place,
    topics: BTreeMap<String, TopicOfNode>,
    _token: LivelinessToken,
}

impl Speaker {
    async fn say(&mut self, message: RosMessage) -> Result<(), NetError> {
        if !self.topics.contains_key(&message.topic) {
            let topic = self.declare(&message).await?;
            self.topics.insert(message.topic.clone(), topic);
        }
        let Some(topic) = self.topics.get_mut(&message.topic) else {
            return Ok(());
        };
        topic.sequence += 1;
        topic
            .publisher
            .put(message.cdr)
            .attachment(attachment(topic.sequence, message.at_unix_ns, &topic.id))
            .await
            .map_err(NetError::zenoh)
    }

    async fn declare(&self, message: &RosMessage) -> Result<TopicOfNode, NetError> {
        // The node has its own number.
        let number = self.topics.len() as u64 + NODE + 1;
        let token = self.place.publisher(number, message);
        let publisher = self
            .session
            .declare_publisher(self.place.topic(message))
            .congestion_control(CongestionControl::Block)
            .await
            .map_err(NetError::zenoh)?;
        Ok(TopicOfNode {
            publisher,
            id: id(&token),
            sequence: 0,
            _token: self
                .session
                .liveliness()
                .declare_token(token)
                .await
                .map_err(NetError::zenoh)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fix() -> RosMessage {
        RosMessage {
            topic: "/chatter".to_owned(),
            type_name: "std_msgs/msg/String".to_owned(),
            type_hash: "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
                .to_owned(),
            at_unix_ns: 1_700_000_000_000_000_001,
            cdr: Vec::new(),
        }
    }

    /// The examples of rmw_zenoh's README and design: `ros2 topic pub` of a string on /chatter.
    #[test]
    fn keys_are_those_of_rmw_zenoh() {
        let place = Place {
            domain: 0,
            zid: "aac3178e146ba6f1fc6e6a4085e77f21".to_owned(),
            name: "talker".to_owned(),
        };
        let hash = fix().type_hash;
        assert_eq!(
            place.topic(&fix()),
            format!("0/chatter/std_msgs::msg::dds_::String_/{hash}")
        );
        assert_eq!(
            place.node(),
            "@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/talker"
        );
        assert_eq!(
            place.publisher(10, &fix()),
            format!(
                "@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MP/%/%/talker/%chatter/\
                 std_msgs::msg::dds_::String_/{hash}/::,10:,:,:,,"
            )
        );
    }

    #[test]
    fn an_attachment_has_number_time_and_id() {
        let bytes = attachment(1, 2, &[7; 16]);
        assert_eq!(
            bytes[..17],
            [1, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 16]
        );
        assert_eq!(bytes[17..], [7; 16]);
        // xxhsum -H2 of no bytes: 99aa06d3014798d86001c324468d497f; its low half comes first.
        assert_eq!(id("")[..8], 0x6001_c324_468d_497f_u64.to_le_bytes());
        assert_eq!(id("")[8..], 0x99aa_06d3_0147_98d8_u64.to_le_bytes());
    }
}
