//! A live mission for Foxglove: a server of its WebSocket protocol (`foxglove.sdk.v1`), which only tells.
//!
//! The crate `foxglove` has such a server, and brings protobuf, a second WebSocket and thirty more crates for what a
//! hundred lines do: say which channels there are, hear which of them somebody wants, and send these.

use crate::ViewError;
use crate::page::listen;
use crate::server::{self, Limits};
use axum::Router;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware;
use axum::response::{IntoResponse as _, Response};
use axum::routing::any;
use futures_core::future::BoxFuture;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{Semaphore, broadcast};
use tokio::task::JoinHandle;

/// Foxglove's default address.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8765";
/// The protocol's name.
const PROTOCOL: &str = "foxglove.sdk.v1";
/// Messages queued for a slow viewer, which loses further ones and delays no other.
const WAITING: usize = 4096;
/// Viewers at a time.
const VIEWERS: usize = 64;
const LIMITS: Limits = Limits {
    connections: VIEWERS,
    request_within: Duration::from_secs(10),
    reads_within: Duration::from_secs(10),
    closed_within: None,
};
/// First byte of a message with data.
const DATA: u8 = 1;

/// A channel that viewers may want.
#[derive(Debug, Clone)]
struct Channel {
    topic: String,
    schema_name: String,
    schema: String,
    /// What was said last, for those who come later.
    last: Option<Arc<Data>>,
}

/// What was said on a channel.
#[derive(Debug)]
struct Data {
    channel: usize,
    unix_ns: u64,
    json: String,
}

type Channels = Arc<Mutex<Vec<Channel>>>;

/// A server that viewers may come to and leave.
pub struct Server {
    channels: Channels,
    by_topic: BTreeMap<String, usize>,
    said: broadcast::Sender<Arc<Data>>,
    address: SocketAddr,
    serving: JoinHandle<()>,
}

#[derive(Clone)]
struct Shared {
    name: Arc<str>,
    channels: Channels,
    said: broadcast::Sender<Arc<Data>>,
    /// Viewers that may still come.
    viewers: Arc<Semaphore>,
}

impl Server {
    /// Serves at `address`; viewers see `name`.
    ///
    /// # Errors
    /// The address is in use or not to be had.
    pub fn open<'a>(address: &'a str, name: &'a str) -> BoxFuture<'a, Result<Self, ViewError>> {
        // Compiled here, and not in each program that serves.
        Box::pin(async move {
            let listener = listen(address).await?;
            let address = listener.local_addr().map_err(ViewError::Server)?;
            let channels = Channels::default();
            let (said, _) = broadcast::channel(WAITING);
            let shared = Shared {
                name: name.into(),
                channels: Arc::clone(&channels),
                said: said.clone(),
                viewers: Arc::new(Semaphore::new(VIEWERS)),
            };
            let app = Router::new()
                .route("/", any(socket))
                .layer(middleware::from_fn(server::only_by_address))
                .with_state(shared);
            // It serves until it is aborted.
            let serving = server::serve(listener, app, LIMITS, std::future::pending());
            let serving = tokio::spawn(serving);
            Ok(Self {
                channels,
                by_topic: BTreeMap::new(),
                said,
                address,
                serving,
            })
        })
    }

    /// Where viewers find it.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Says JSON of a schema (its name and its text, asked for once a topic) on a topic.
    pub fn say(
        &mut self,
        topic: &str,
        schema: impl FnOnce() -> (String, String),
        unix_ns: u64,
        json: String,
    ) {
        let Ok(mut channels) = self.channels.lock() else {
            return;
        };
        let known = self.by_topic.get(topic).copied();
        let channel = known.unwrap_or_else(|| {
            let (schema_name, schema) = schema();
            channels.push(Channel {
                topic: topic.to_owned(),
                schema_name,
                schema,
                last: None,
            });
            self.by_topic.insert(topic.to_owned(), channels.len() - 1);
            channels.len() - 1
        });
        let data = Arc::new(Data {
            channel,
            unix_ns,
            json,
        });
        channels[channel].last = Some(Arc::clone(&data));
        drop(channels);
        // Without a viewer nobody hears it.
        let _ = self.said.send(data);
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.serving.abort();
    }
}

/// Whether a viewer may connect from where it says it is. Browsers let any site open a WebSocket to any host: only
/// Foxglove's own site, a viewer that is served by address or from this host, and programs that are no site may see the
/// mission. Sandboxed pages of any site give the origin `null`.
fn is_viewer(headers: &HeaderMap) -> bool {
    let Some(origin) = headers.get(header::ORIGIN) else {
        return true;
    };
    let Some((scheme, host)) = origin.to_str().ok().and_then(|o| o.split_once("://")) else {
        return false;
    };
    let is_site = matches!(scheme, "http" | "https");
    let is_foxglove = host == "foxglove.dev" || host.ends_with(".foxglove.dev");
    !is_site || is_foxglove && scheme == "https" || server::is_address(host)
}

async fn socket(
    State(shared): State<Shared>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if !is_viewer(&headers) {
        let why = "expected Foxglove, or a viewer that is served by an address or from this host\n";
        return (StatusCode::FORBIDDEN, why).into_response();
    }
    let Ok(place) = Arc::clone(&shared.viewers).try_acquire_owned() else {
        return (
            StatusCode::SERVICE_UNAVAILABLE,
            "too many viewers are connected\n",
        )
            .into_response();
    };
    upgrade
        .protocols([PROTOCOL])
        .on_upgrade(move |socket| async move {
            // A viewer that leaves is no fault.
            let _ = Viewer::new(socket, shared).talk().await;
            drop(place);
        })
}

/// One that looks.
struct Viewer {
    socket: WebSocket,
    shared: Shared,
    said: broadcast::Receiver<Arc<Data>>,
    /// Channels that were told.
    told: usize,
    /// Numbers of subscriptions, and their channels.
    wanted: BTreeMap<u32, usize>,
}

impl Viewer {
    fn new(socket: WebSocket, shared: Shared) -> Self {
        Self {
            said: shared.said.subscribe(),
            socket,
            shared,
            told: 0,
            wanted: BTreeMap::new(),
        }
    }

    async fn talk(mut self) -> Result<(), axum::Error> {
        let info = json!({"op": "serverInfo", "name": &*self.shared.name, "capabilities": []});
        self.send(Message::Text(info.to_string().into())).await?;
        self.tell_channels().await?;
        loop {
            tokio::select! {
                said = self.said.recv() => match said {
                    Ok(data) => self.pass_on(&data).await?,
                    Err(RecvError::Lagged(_)) => {}
                    Err(RecvError::Closed) => return Ok(()),
                },
                asked = self.socket.recv() => match asked {
                    Some(Ok(Message::Text(text))) => self.hear(&text).await?,
                    Some(Ok(Message::Close(_))) | None => return Ok(()),
                    Some(other) => { other?; }
                },
            }
        }
    }

    async fn send(&mut self, message: Message) -> Result<(), axum::Error> {
        self.socket.send(message).await
    }

    /// Tells the channels that are new.
    async fn tell_channels(&mut self) -> Result<(), axum::Error> {
        let new: Vec<Value> = match self.shared.channels.lock() {
            Ok(channels) => {
                let new = channels.iter().enumerate().skip(self.told);
                new.map(|(id, channel)| channel.advertised(id)).collect()
            }
            Err(_) => Vec::new(),
        };
        if new.is_empty() {
            return Ok(());
        }
        self.told += new.len();
        let advertise = json!({"op": "advertise", "channels": new});
        self.send(Message::Text(advertise.to_string().into())).await
    }

    async fn pass_on(&mut self, data: &Data) -> Result<(), axum::Error> {
        if data.channel >= self.told {
            self.tell_channels().await?;
        }
        let wanted = self
            .wanted
            .iter()
            .filter(|(_, channel)| **channel == data.channel);
        let wanted: Vec<u32> = wanted.map(|(subscription, _)| *subscription).collect();
        for subscription in wanted {
            self.send(framed(subscription, data)).await?;
        }
        Ok(())
    }

    async fn hear(&mut self, text: &str) -> Result<(), axum::Error> {
        let Ok(asked) = serde_json::from_str::<Value>(text) else {
            return Ok(());
        };
        let list = |name: &str| asked[name].as_array().cloned().unwrap_or_default();
        let number = |value: &Value| value.as_u64().and_then(|n| u32::try_from(n).ok());
        match asked["op"].as_str() {
            Some("subscribe") => {
                for wish in list("subscriptions") {
                    let channel = number(&wish["channelId"]).map(|id| id as usize);
                    if let (Some(subscription), Some(channel)) = (number(&wish["id"]), channel) {
                        self.wanted.insert(subscription, channel);
                        self.tell_last(subscription, channel).await?;
                    }
                }
            }
            Some("unsubscribe") => {
                for subscription in list("subscriptionIds").iter().filter_map(number) {
                    self.wanted.remove(&subscription);
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Messages from before a subscription: stacks and fence are published once.
    async fn tell_last(&mut self, subscription: u32, channel: usize) -> Result<(), axum::Error> {
        let last = match self.shared.channels.lock() {
            Ok(channels) => channels.get(channel).and_then(|c| c.last.clone()),
            Err(_) => None,
        };
        match last {
            Some(data) => self.send(framed(subscription, &data)).await,
            None => Ok(()),
        }
    }
}

impl Channel {
    fn advertised(&self, id: usize) -> Value {
        json!({
            "id": id,
            "topic": self.topic,
            "encoding": "json",
            "schemaName": self.schema_name,
            "schemaEncoding": "jsonschema",
            "schema": self.schema,
        })
    }
}

/// Data for a subscription.
fn framed(subscription: u32, data: &Data) -> Message {
    let mut bytes = vec![DATA];
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(data.unix_ns.to_le_bytes());
    bytes.extend(data.json.as_bytes());
    Message::Binary(bytes.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_viewers_may_look() {
        let comes_from = |origin: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::ORIGIN, origin.parse().unwrap());
            is_viewer(&headers)
        };
        assert!(is_viewer(&HeaderMap::new()));
        for origin in [
            "https://app.foxglove.dev",
            "http://localhost:8080",
            "http://192.168.1.4:8080",
            "file://",
        ] {
            assert!(comes_from(origin), "{origin}");
        }
        for origin in [
            "https://evil.example",
            "http://app.foxglove.dev",
            "https://evilfoxglove.dev",
            "https://app.foxglove.dev.evil.example",
            "null",
        ] {
            assert!(!comes_from(origin), "{origin}");
        }
    }
}
