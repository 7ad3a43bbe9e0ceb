//! The bus over Zenoh: the envelopes of `protocol` between processes and hosts.
//!
//! Needs a multi-thread tokio runtime. Multicast scouting is off and only the endpoints given
//! are used, so that no other process on a network joins; gossip lets the peers that met at one
//! endpoint find each other. Nothing is dropped: congestion control blocks the sender.
//!
//! A [`Net`] is one process's session on the bus of one mission, opened with [`NetOptions`]. What its agents say in a
//! tick leaves as one [bundle](protocol::bundle), and on the messages' own keys where somebody subscribes to these.
//! [`lockstep`] runs an agent tick by tick under a conductor; [`realtime`] runs
//! it by the wall clock, with the squadron controller's process keeping the mission's time. Both begin with
//! [joining](protocol::joining), and every message carries a [seal](protocol::seal) of the mission's key.
//! [`presence`] reports present and missing agents, and [`OneRun`] keeps a mission to one run. [`ros2`] is separate from the bus: it publishes a mission to ROS 2.
//!
//! ```
//! use net::{Net, NetOptions};
//! use protocol::key::Name;
//! use protocol::seal::MissionKey;
//!
//! # #[tokio::main(flavor = "multi_thread")]
//! # async fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A free port of this host.
//! let options = NetOptions {
//!     listen: vec!["tcp/127.0.0.1:0".to_owned()],
//!     ..NetOptions::default()
//! };
//! let key = MissionKey::new(net::random()?);
//! let bus = Net::open(Name::new("as-pontes")?, key, &options).await?;
//! assert!(bus.peers().is_empty());
//! bus.close().await;
//! # Ok(())
//! # }
//! ```
//!
//! Futures that call Zenoh are boxed: each program and test that awaits an `async fn` compiles it again, with all of
//! Zenoh that it awaits; a boxed future is compiled here, once.
//!
//! Not pure, and for programs only: it handles sockets, threads and the wall clock.

mod asking;
mod bundles;
mod figures;
mod hosted;
mod joining;
mod locks;
pub mod lockstep;
mod options;
pub mod presence;
mod random;
mod reach;
pub mod realtime;
mod refusals;
mod remembered;
pub mod ros2;
mod run;
mod runs;
mod session;

pub use bundles::publish_rule;
pub use figures::Figures;
pub use options::{DEFAULT_ENDPOINT, NetOptions, TlsFiles};
pub use presence::Presence;
pub use random::random;
pub use runs::OneRun;
pub use session::{Net, Received};

/// Error of the bus.
#[derive(Debug, Clone, thiserror::Error, PartialEq)]
pub enum NetError {
    /// Zenoh rejects an option.
    #[error("network: option {key} = {value}: {why}")]
    Option {
        /// Zenoh's name of the option.
        key: String,
        /// The value, as JSON.
        value: String,
        /// Zenoh's error.
        why: String,
    },
    /// An invalid endpoint.
    #[error(
        "endpoint {0}: expected PROTOCOL/ADDRESS:PORT, such as tcp/127.0.0.1:7447 or tls/[2001:db8::1]:7447"
    )]
    Endpoint(String),
    /// Zenoh failed: an endpoint in use, a closed session.
    #[error("network: {0}")]
    Zenoh(String),
    /// The mission did not admit this process.
    #[error("the mission rejected this process: {0}")]
    Refused(String),
    /// A message was published before a run was joined.
    #[error("network: cannot publish before the mission's time is known")]
    NotJoined,
    /// The system has no random numbers.
    #[error("the system provides no random numbers: {0}")]
    Random(String),
    /// The session ended during a wait.
    #[error("network: the session has closed")]
    Closed,
    /// Agents of a lockstep run, or its conductor, left before its end or stopped answering.
    #[error("a process of the lockstep run stopped responding: {}; the run ended before tick {tick} was finished", in_words(.agents))]
    Gone {
        /// The missing agents.
        agents: Vec<protocol::AgentId>,
        /// The unfinished tick.
        tick: u64,
    },
    /// Agents of the team are present without a run, as in lockstep.
    #[error(
        "{0} are on the bus already and in no run; stop them, or start them for real time, before this mission starts"
    )]
    NoRun(String),
    /// Another, older run of the mission flies.
    #[error(
        "another run of this mission is active, {older_s} s older than this one, with {members}; \
         a mission has one run: restart this process to join that one"
    )]
    OtherRun {
        /// Agents of the team in it.
        members: String,
        /// How much earlier it began, s.
        older_s: u64,
    },
    /// A message of a lockstep run did not arrive.
    #[error(
        "a message of the lockstep run was lost: {path} number {sequence}; the run ended before tick {tick} \
             was finished"
    )]
    Lost {
        /// The topic.
        path: String,
        /// The number of the expected message.
        sequence: u64,
        /// The unfinished tick.
        tick: u64,
    },
}

/// Checks the syntax of `endpoints`.
///
/// # Errors
/// [`NetError::Endpoint`] with the first invalid one.
fn check_endpoints(endpoints: impl IntoIterator<Item: AsRef<str>>) -> Result<(), NetError> {
    for endpoint in endpoints {
        let endpoint = endpoint.as_ref();
        let parsed: Result<zenoh::config::EndPoint, _> = endpoint.parse();
        parsed.map_err(|_| NetError::Endpoint(endpoint.to_owned()))?;
    }
    Ok(())
}

impl NetError {
    /// The operation that Zenoh failed at.
    fn zenoh(error: impl std::fmt::Display) -> Self {
        Self::Zenoh(error.to_string())
    }
}

fn names(agents: &[protocol::AgentId]) -> String {
    let names: Vec<String> = agents.iter().map(ToString::to_string).collect();
    names.join(", ")
}

/// The same as text.
fn in_words(agents: &[protocol::AgentId]) -> String {
    let conductor = protocol::AgentId::clock().to_string();
    names(agents).replace(&conductor, "the conductor")
}
