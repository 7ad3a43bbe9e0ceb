//! Foxglove's WebSocket protocol as a viewer speaks it (RFC 6455 below it).

use serde_json::{Value, json};
use std::time::Duration;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use views::foxglove::Server;

/// A viewer, by its socket.
struct Viewer(TcpStream);

/// What comes from the server: text, or a subscription with time and data.
#[derive(Debug, PartialEq)]
enum Heard {
    Text(Value),
    Data(u32, u64, Value),
}

impl Viewer {
    async fn open(address: &str) -> Self {
        let mut socket = TcpStream::connect(address).await.unwrap();
        let ask = format!(
            "GET / HTTP/1.1\r\nHost: {address}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
             Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: foxglove.sdk.v1.1, foxglove.sdk.v1\r\n\
             Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        );
        socket.write_all(ask.as_bytes()).await.unwrap();
        let mut answer = Vec::new();
        while !answer.ends_with(b"\r\n\r\n") {
            answer.push(socket.read_u8().await.unwrap());
        }
        let answer = String::from_utf8(answer).unwrap().to_lowercase();
        assert!(answer.starts_with("http/1.1 101"), "{answer}");
        assert!(
            answer.contains("sec-websocket-protocol: foxglove.sdk.v1\r\n"),
            "{answer}"
        );
        Self(socket)
    }

    /// A text of less than 126 bytes, masked by zeros.
    async fn say(&mut self, message: Value) {
        let text = message.to_string();
        let mut frame = vec![0x81, 0x80 | text.len() as u8, 0, 0, 0, 0];
        frame.extend(text.bytes());
        self.0.write_all(&frame).await.unwrap();
    }

    async fn hear(&mut self) -> Heard {
        let heard = tokio::time::timeout(Duration::from_secs(10), self.frame());
        let (kind, bytes) = heard.await.unwrap();
        if kind == 0x81 {
            return Heard::Text(serde_json::from_slice(&bytes).unwrap());
        }
        assert_eq!((kind, bytes[0]), (0x82, 1));
        let subscription = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
        let at = u64::from_le_bytes(bytes[5..13].try_into().unwrap());
        Heard::Data(
            subscription,
            at,
            serde_json::from_slice(&bytes[13..]).unwrap(),
        )
    }

    async fn frame(&mut self) -> (u8, Vec<u8>) {
        let kind = self.0.read_u8().await.unwrap();
        let length = match self.0.read_u8().await.unwrap() {
            126 => usize::from(self.0.read_u16().await.unwrap()),
            127 => self.0.read_u64().await.unwrap() as usize,
            short => usize::from(short),
        };
        let mut bytes = vec![0; length];
        self.0.read_exact(&mut bytes).await.unwrap();
        (kind, bytes)
    }
}

fn schema() -> (String, String) {
    (
        "foxglove.Log".to_owned(),
        json!({"type": "object"}).to_string(),
    )
}

#[tokio::test]
async fn viewers_hear_what_they_want_and_what_was_said_before() {
    let mut server = Server::open("127.0.0.1:0", "trial").await.unwrap();
    server.say("/before", schema, 7, json!({"n": 1}).to_string());
    let mut viewer = Viewer::open(&server.address().to_string()).await;
    let Heard::Text(info) = viewer.hear().await else {
        panic!("no text")
    };
    assert_eq!(
        (&info["op"], &info["name"]),
        (&json!("serverInfo"), &json!("trial"))
    );
    let Heard::Text(told) = viewer.hear().await else {
        panic!("no text")
    };
    let channel = json!({
        "id": 0, "topic": "/before", "encoding": "json", "schemaName": "foxglove.Log",
        "schemaEncoding": "jsonschema", "schema": "{\"type\":\"object\"}",
    });
    assert_eq!(told, json!({"op": "advertise", "channels": [channel]}));
    let wish = |id: u32, channel: u32| json!({"id": id, "channelId": channel});
    viewer
        .say(json!({"op": "subscribe", "subscriptions": [wish(40, 0)]}))
        .await;
    assert_eq!(viewer.hear().await, Heard::Data(40, 7, json!({"n": 1})));
    // A new channel is told, and nothing of it is sent before somebody wants it.
    server.say("/after", schema, 8, json!({"n": 2}).to_string());
    server.say("/before", schema, 9, json!({"n": 3}).to_string());
    let Heard::Text(told) = viewer.hear().await else {
        panic!("no text")
    };
    assert_eq!(told["channels"][0]["topic"], "/after");
    assert_eq!(viewer.hear().await, Heard::Data(40, 9, json!({"n": 3})));
    viewer
        .say(json!({"op": "unsubscribe", "subscriptionIds": [40]}))
        .await;
    viewer
        .say(json!({"op": "subscribe", "subscriptions": [wish(41, 1)]}))
        .await;
    assert_eq!(viewer.hear().await, Heard::Data(41, 8, json!({"n": 2})));
    server.say("/before", schema, 10, json!({"n": 4}).to_string());
    server.say("/after", schema, 11, json!({"n": 5}).to_string());
    assert_eq!(viewer.hear().await, Heard::Data(41, 11, json!({"n": 5})));
}

#[tokio::test]
async fn a_busy_port_is_named() {
    let server = Server::open("127.0.0.1:0", "one").await.unwrap();
    let address = server.address().to_string();
    let refused = Server::open(&address, "two")
        .await
        .err()
        .unwrap()
        .to_string();
    assert!(refused.contains(&address), "{refused}");
}
