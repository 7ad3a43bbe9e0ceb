//! Garbage, foreign senders and other wire versions on the bus are told of and do no harm; those who
//! have the password all meet, however they start, and nobody else gets in.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

use net::{Net, NetOptions};
use protocol::key::Name;
use protocol::message::{EventMessage, Severity};
use protocol::{AgentId, Envelope, Interest, Message, ProtocolError, SimTime, WIRE_VERSION};
use std::net::TcpListener;
use std::time::Duration;
use tokio::task::JoinSet;

fn free_endpoint() -> String {
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    format!("tcp/127.0.0.1:{port}")
}

/// A peer that is none of ours, connected to `endpoint`.
async fn stranger(endpoint: &str) -> zenoh::Session {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("scouting/multicast/enabled", "false".to_owned()),
        ("connect/endpoints", format!("[\"{endpoint}\"]")),
        ("listen/endpoints", "[\"tcp/127.0.0.1:0\"]".to_owned()),
    ] {
        config.insert_json5(key, &value).unwrap();
    }
    zenoh::open(config).await.unwrap()
}

async fn next(net: &mut Net) -> net::Received {
    tokio::time::timeout(Duration::from_secs(20), net.receive())
        .await
        .unwrap()
        .unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn garbage_on_a_key_is_an_error_and_what_follows_is_heard() {
    let endpoint = free_endpoint();
    let options = NetOptions {
        listen: vec![endpoint.clone()],
        ..NetOptions::default()
    };
    let mut net = Net::open(Name::new("m").unwrap(), &options).await.unwrap();
    net.subscribe(&[Interest::Everything]).await.unwrap();
    let stranger = stranger(&endpoint).await;
    let event = |text: &str| Envelope {
        sender: AgentId::sc(),
        sequence: 1,
        time: SimTime::ZERO,
        message: Message::Event(EventMessage {
            severity: Severity::Info,
            code: "test".to_owned(),
            text: text.to_owned(),
        }),
    };
    let mut newer = event("from the future").to_bytes();
    newer[0] += 1;
    let key = "plumage/m/sc/main/event";
    tokio::time::sleep(Duration::from_millis(500)).await;
    stranger
        .put(key, [&[WIRE_VERSION], &b"garbage"[..]].concat())
        .await
        .unwrap();
    assert!(matches!(
        next(&mut net).await,
        Err(ProtocolError::Garbage { .. })
    ));
    stranger.put(key, newer).await.unwrap();
    assert!(matches!(
        next(&mut net).await,
        Err(ProtocolError::WireVersion { theirs, ours: WIRE_VERSION }) if theirs == WIRE_VERSION + 1
    ));
    stranger
        .put("plumage/m/ws/main/event", event("forged").to_bytes())
        .await
        .unwrap();
    assert!(matches!(
        next(&mut net).await,
        Err(ProtocolError::ForeignSender { .. })
    ));
    stranger
        .put("plumage/m/no/such/key", b"x".to_vec())
        .await
        .unwrap();
    assert!(matches!(
        next(&mut net).await,
        Err(ProtocolError::UnknownKey(_))
    ));
    stranger.put(key, event("binary").to_bytes()).await.unwrap();
    assert_eq!(next(&mut net).await.unwrap().1, event("binary"));
    stranger
        .put(key, event("json").to_json())
        .encoding(zenoh::bytes::Encoding::APPLICATION_JSON)
        .await
        .unwrap();
    assert_eq!(next(&mut net).await.unwrap().1, event("json"));
    // As a script puts a string that knows of no encodings.
    stranger.put(key, event("text").to_json()).await.unwrap();
    assert_eq!(next(&mut net).await.unwrap().1, event("text"));
    stranger.close().await.unwrap();
    net.close().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_port_that_is_taken_is_refused() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", taken.local_addr().unwrap());
    let options = NetOptions {
        listen: vec![endpoint],
        ..NetOptions::default()
    };
    assert!(Net::open(Name::new("m").unwrap(), &options).await.is_err());
}

/// Joins as vehicle `k` and waits until it sees all of `team`; it is there as long as what comes back.
async fn meet(
    options: NetOptions,
    k: u8,
    team: Vec<AgentId>,
) -> (Net, zenoh::liveliness::LivelinessToken) {
    let net = Net::open(Name::new("m").unwrap(), &options).await.unwrap();
    let vehicle = AgentId::va(&k.to_string()).unwrap();
    let token = net.announce(&vehicle).await.unwrap();
    net.wait_for(&team).await;
    (net, token)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn all_with_the_password_meet_when_they_start_at_once_and_nobody_else() {
    all_with_the_password_meet(1).await;
}

/// Whether two of ten open connections to each other at the same moment, and would be left with none
/// (eclipse-zenoh/zenoh#2577), is chance, one time in three on a busy machine and in five on an idle
/// one.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "second tier: a rate, ten start at once twenty times"]
async fn they_meet_however_they_start() {
    all_with_the_password_meet(20).await;
}

/// Ten start at once, `starts` times; then one comes with a wrong password.
async fn all_with_the_password_meet(starts: usize) {
    let users = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("users-{starts}"));
    std::fs::write(&users, "team:secret\n").unwrap();
    let with = |endpoint: &str, password: &str| NetOptions {
        connect: vec![endpoint.to_owned()],
        user_password: Some(("team".to_owned(), password.to_owned())),
        password_file: Some(users.to_str().unwrap().to_owned()),
        ..NetOptions::default()
    };
    let team: Vec<AgentId> = (1..=10)
        .map(|k| AgentId::va(&k.to_string()).unwrap())
        .collect();
    let (mut there, mut endpoint) = (Vec::new(), String::new());
    for start in 1..=starts {
        for (net, _) in there {
            Net::close(net).await.unwrap();
        }
        endpoint = free_endpoint();
        let first = NetOptions {
            listen: vec![endpoint.clone()],
            connect: Vec::new(),
            ..with(&endpoint, "secret")
        };
        let mut all = JoinSet::new();
        all.spawn(meet(first, 1, team.clone()));
        for k in 2..=10 {
            all.spawn(meet(with(&endpoint, "secret"), k, team.clone()));
        }
        let all = tokio::time::timeout(Duration::from_secs(20), all.join_all()).await;
        there = all.unwrap_or_else(|_| panic!("not all met at start {start}"));
        assert_eq!(there.len(), 10);
    }
    // The last ten are still there, so that a stranger who is let in sees them.
    let stranger = meet(with(&endpoint, "guessed"), 11, team[..1].to_vec());
    let stranger = tokio::time::timeout(Duration::from_secs(3), stranger).await;
    assert!(stranger.is_err(), "a wrong password was let in");
}
