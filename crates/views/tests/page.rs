//! The page's server over real sockets: what it serves, whom it refuses, what it passes on.
#![allow(clippy::unwrap_used)]

mod made_up;

use made_up::synthetic;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::{mpsc, watch};
use views::live::LiveState;
use views::page::{self, PageCommand};

struct Served {
    address: String,
    live: watch::Sender<Arc<LiveState>>,
    commands: mpsc::Receiver<PageCommand>,
    server: tokio::task::JoinHandle<Result<(), views::ViewError>>,
}

async fn served() -> Served {
    let listener = page::listen("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let (live, watched) = watch::channel(Arc::new(LiveState::new(made_up::site())));
    let (sender, commands) = mpsc::channel(8);
    let server = tokio::spawn(page::serve(listener, watched, sender));
    Served {
        address,
        live,
        commands,
        server,
    }
}

async fn ask(address: &str, path: &str, headers: &str) -> String {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let request = format!("GET {path} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).await.unwrap();
    String::from_utf8_lossy(&answer).into_owned()
}

#[tokio::test]
async fn it_serves_everything_itself_and_loads_nothing_from_elsewhere() {
    let served = served().await;
    let host = format!("Host: {}\r\n", served.address);
    let page = ask(&served.address, "/", &host).await;
    assert!(page.starts_with("HTTP/1.1 200"), "{page}");
    for asset in ["page.css", "page.js", "plotly.js", "site.json"] {
        let answer = ask(&served.address, &format!("/{asset}"), &host).await;
        assert!(answer.starts_with("HTTP/1.1 200"), "{asset}");
        if asset != "plotly.js" {
            assert!(!answer.contains("https://"), "{asset} points elsewhere");
        }
        if asset.starts_with("page") {
            assert!(page.contains(asset), "{asset} is not used");
        }
    }
    assert!(!page.contains("https://"));
    assert!(page.contains("default-src 'self'"));
}

#[tokio::test]
async fn a_foreign_name_or_page_is_refused() {
    let served = served().await;
    for host in ["Host: evil.example\r\n", "Host: evil.example:8787\r\n"] {
        let answer = ask(&served.address, "/site.json", host).await;
        assert!(answer.starts_with("HTTP/1.1 403"), "{host}: {answer}");
        assert!(!answer.contains("as-pontes"));
    }
    let upgrade = "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                   Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    let own = format!("Host: {}\r\n{upgrade}", served.address);
    for origin in [
        "http://evil.example",
        "http://127.0.0.1:1",
        "null",
        "https://evil.example",
    ] {
        let headers = format!("{own}Origin: {origin}\r\nConnection: Upgrade\r\n");
        let answer = ask(&served.address, "/live", &headers).await;
        assert!(answer.starts_with("HTTP/1.1 403"), "{origin}: {answer}");
    }
}

/// A WebSocket by hand (RFC 6455): one masked text frame out, text frames in.
struct Socket(TcpStream);

impl Socket {
    async fn open(address: &str) -> Self {
        let mut stream = TcpStream::connect(address).await.unwrap();
        let request = format!(
            "GET /live HTTP/1.1\r\nHost: {address}\r\nOrigin: http://{address}\r\n\
             Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
             Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        );
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            head.push(stream.read_u8().await.unwrap());
        }
        assert!(head.starts_with(b"HTTP/1.1 101"));
        Self(stream)
    }

    async fn say(&mut self, text: &str) {
        let mask = [1u8, 2, 3, 4];
        let mut frame = vec![0x81, 0x80 | u8::try_from(text.len()).unwrap()];
        frame.extend(mask);
        frame.extend(text.bytes().zip(mask.iter().cycle()).map(|(b, m)| b ^ m));
        self.0.write_all(&frame).await.unwrap();
    }

    async fn hear(&mut self) -> serde_json::Value {
        assert_eq!(self.0.read_u8().await.unwrap(), 0x81);
        let length = match self.0.read_u8().await.unwrap() {
            126 => u64::from(self.0.read_u16().await.unwrap()),
            127 => self.0.read_u64().await.unwrap(),
            short => u64::from(short),
        };
        let mut text = vec![0; usize::try_from(length).unwrap()];
        self.0.read_exact(&mut text).await.unwrap();
        serde_json::from_slice(&text).unwrap()
    }
}

#[tokio::test]
async fn pictures_come_and_commands_go() {
    let mut served = served().await;
    let mut socket = Socket::open(&served.address).await;
    assert_eq!(socket.hear().await["vehicles"].as_array().unwrap().len(), 0);
    let mut live = LiveState::new(made_up::site());
    for (topic, envelope) in synthetic::mission(300) {
        live.take(&topic, &envelope);
    }
    served.live.send_replace(Arc::new(live));
    let picture = socket.hear().await;
    assert_eq!(picture["vehicles"].as_array().unwrap().len(), 6);
    assert_eq!(picture["vehicles"][5]["real"], true);
    assert_eq!(picture["phase"], "take-off");
    assert_eq!(picture["stars"].as_array().unwrap().len(), 40);
    let cells =
        picture["plume"]["columns"].as_u64().unwrap() * picture["plume"]["rows"].as_u64().unwrap();
    assert_eq!(
        picture["plume"]["ppm"].as_array().unwrap().len() as u64,
        cells
    );

    socket.say("garbage").await;
    socket.say(r#"{"command":"pause"}"#).await;
    socket.say(r#"{"command":"speed","factor":10}"#).await;
    let wait = Duration::from_secs(10);
    let first = tokio::time::timeout(wait, served.commands.recv())
        .await
        .unwrap();
    assert_eq!(first, Some(PageCommand::Pause));
    let second = tokio::time::timeout(wait, served.commands.recv())
        .await
        .unwrap();
    assert_eq!(second, Some(PageCommand::Speed(10.0)));

    // When the mission's side goes, the server ends and says nothing bad.
    drop(served.live);
    tokio::time::timeout(wait, served.server)
        .await
        .unwrap()
        .unwrap()
        .unwrap();
}

#[tokio::test]
async fn a_busy_port_is_named() {
    let served = served().await;
    let refused = page::listen(&served.address).await.unwrap_err().to_string();
    assert!(refused.contains(&served.address), "{refused}");
}

#[test]
fn a_picture_stays_small_however_long_the_mission() {
    let mut live = LiveState::new(made_up::site());
    let mut largest = 0;
    for n in 0..40_000 {
        for (topic, envelope) in synthetic::tick(n) {
            live.take(&topic, &envelope);
        }
        if n % 4000 == 3999 {
            largest = largest.max(live.to_json().len());
        }
    }
    assert!(largest < 200_000, "{largest} bytes");
}
