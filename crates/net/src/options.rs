//! Options with which a process joins the bus, and Zenoh's configuration for them.

use crate::NetError;
use protocol::key::Name;

/// Endpoint at which the squadron controller listens and the others connect by default.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// Options with which a process joins the bus.
#[derive(Debug, Clone, Default)]
pub struct NetOptions {
    /// Endpoints to listen on, such as `tcp/127.0.0.1:7447` or `tls/0.0.0.0:7447`.
    pub listen: Vec<String>,
    /// Endpoints to connect to.
    pub connect: Vec<String>,
    /// Publish JSON instead of bincode, for peers in other languages.
    pub json: bool,
    /// PEM files for TLS endpoints: root certificate, own certificate, own private key.
    pub tls: Option<TlsFiles>,
    /// Permissions by the names in certificates: Zenoh's `access_control`, as JSON.
    pub access_control: Option<String>,
    /// Name of this host in its certificate and in the access control.
    pub host: Option<Name>,
    /// User name and password that every peer must show.
    pub user_password: Option<(String, String)>,
    /// File of `user:password` lines that a listening process accepts.
    pub password_file: Option<String>,
    /// Run by the wall clock, not tick by tick: a publisher waits only briefly for a peer that stopped reading.
    pub real_time: bool,
}

/// Time limit to open a connection, ms: TCP repeats a lost first packet after 1 and 3 s,
/// and an attempt that began during an interruption must not outlast it by more.
const OPEN_MS: u64 = 4000;
/// First and longest interval between two attempts to connect to an endpoint, ms.
const DIAL_MS: (u64, u64) = (500, 1000);
/// In real time: time that a message waits for a peer that stopped reading, before its connection is closed and
/// reopened, µs. By then the system's buffers and [`QUEUED`] batches, seconds of a mission, are full, and the
/// publisher is silent towards all others: 2 s for the seven processes of another host, which is less than the
/// 5 s after which a vehicle flies home.
const BLOCKED_US: u64 = 250_000;
/// Batches queued for a peer: Zenoh's maximum.
const QUEUED: u64 = 16;

/// PEM files for TLS. The process needs a single I/O thread of Zenoh, set by the
/// environment variable `ZENOH_RUNTIME`: Zenoh 1.10 otherwise loses connections (eclipse-zenoh/zenoh#2557).
#[derive(Debug, Clone)]
pub struct TlsFiles {
    /// Certificate of the authority that signs the peers' certificates.
    pub root_ca: String,
    /// Own certificate, needed to listen.
    pub certificate: Option<String>,
    /// Own private key, needed to listen.
    pub private_key: Option<String>,
    /// Require a certificate of the connecting side as well.
    pub mutual: bool,
}

/// Sets an option of Zenoh.
///
/// # Errors
/// [`NetError::Option`].
pub(crate) fn set(
    config: &mut zenoh::Config,
    key: &str,
    value: serde_json::Value,
) -> Result<(), NetError> {
    let value = value.to_string();
    config
        .insert_json5(key, &value)
        .map_err(|e| NetError::Option {
            key: key.to_owned(),
            value,
            why: e.to_string(),
        })
}

impl NetOptions {
    /// Zenoh's configuration for these options.
    pub(crate) fn configuration(&self) -> Result<zenoh::Config, NetError> {
        crate::check_endpoints(self.listen.iter().chain(&self.connect))?;
        let mut config = zenoh::Config::default();
        let mut set = |key: &str, value: serde_json::Value| set(&mut config, key, value);
        set("mode", "peer".into())?;
        set("scouting/multicast/enabled", false.into())?;
        set("scouting/gossip/enabled", true.into())?;
        // A process that only connects still listens on a free loopback port, so that the peers
        // it meets by gossip can reach it: peers do not relay for each other.
        let mutual = self.tls.as_ref().is_some_and(|tls| tls.mutual);
        let loopback = if mutual {
            "tls/127.0.0.1:0"
        } else {
            "tcp/127.0.0.1:0"
        };
        let loopback = vec![loopback.to_owned()];
        let listen = if self.listen.is_empty() {
            &loopback
        } else {
            &self.listen
        };
        set("listen/endpoints", listen.clone().into())?;
        set("connect/endpoints", self.connect.clone().into())?;
        // Agents start in any order: retry until the other side is present.
        set("connect/timeout_ms", (-1).into())?;
        set("connect/exit_on_failure", false.into())?;
        set(
            "connect/retry",
            serde_json::json!({"period_init_ms": DIAL_MS.0, "period_max_ms": DIAL_MS.1, "period_increase_factor": 2}),
        )?;
        set("transport/unicast/open_timeout", OPEN_MS.into())?;
        if self.real_time {
            set("transport/link/tx/queue/size/data", QUEUED.into())?;
            set(
                "transport/link/tx/queue/congestion_control/block/wait_before_close",
                BLOCKED_US.into(),
            )?;
        }
        if let Some(tls) = &self.tls {
            set(
                "transport/link/tls/root_ca_certificate",
                tls.root_ca.clone().into(),
            )?;
            set("transport/link/tls/enable_mtls", tls.mutual.into())?;
            let sides = if tls.mutual {
                &["listen", "connect"][..]
            } else {
                &["listen"]
            };
            for side in sides {
                for (what, file) in [
                    ("certificate", &tls.certificate),
                    ("private_key", &tls.private_key),
                ] {
                    if let Some(file) = file {
                        let key = format!("transport/link/tls/{side}_{what}");
                        set(&key, file.clone().into())?;
                    }
                }
            }
        }
        if let Some(access) = &self.access_control {
            let rules = serde_json::from_str(access).map_err(NetError::zenoh)?;
            set("access_control", rules)?;
        }
        // Of two peers that meet by gossip only one opens the connection: simultaneous attempts may end with one that works
        // in one direction only, and with passwords with none (eclipse-zenoh/zenoh#2577). If it cannot reach the other, the
        // other tries later.
        set(
            "scouting/gossip/autoconnect_strategy",
            serde_json::json!({"peer": {"to_router": "always", "to_peer": "greater-zid"}}),
        )?;
        if let Some((user, password)) = &self.user_password {
            set("transport/auth/usrpwd/user", user.clone().into())?;
            set("transport/auth/usrpwd/password", password.clone().into())?;
        }
        if let Some(file) = &self.password_file {
            set("transport/auth/usrpwd/dictionary_file", file.clone().into())?;
        }
        Ok(config)
    }
}
