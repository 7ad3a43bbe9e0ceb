//! The page's server over real sockets: what it serves, whom it refuses, what it passes on.

use crate::made_up::synthetic;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::{mpsc, watch};
use views::live::LiveState;
use views::page::{self, Live, PageCommand, PageOptions};

struct Served {
    address: String,
    live: Live,
    open: watch::Sender<()>,
    commands: mpsc::Receiver<PageCommand>,
    server: tokio::task::JoinHandle<()>,
}

async fn served_with(options: PageOptions) -> Served {
    let listener = page::listen("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let live = Live::new(LiveState::new(crate::made_up::site()));
    let (open, is_open) = watch::channel(());
    let (sender, commands) = mpsc::channel(16);
    let server = tokio::spawn(page::serve(
        listener,
        live.clone(),
        options,
        sender,
        is_open,
    ));
    Served {
        address,
        live,
        open,
        commands,
        server,
    }
}

async fn served() -> Served {
    served_with(PageOptions::default()).await
}

fn fly(live: &Live, ticks: std::ops::Range<u64>) {
    live.with(|live| {
        for n in ticks {
            for (topic, envelope) in synthetic::tick(n) {
                live.take(&topic, &envelope);
            }
            if n % 1000 == 0 {
                let (topic, envelope) = synthetic::event(n, "something happened");
                live.take(&topic, &envelope);
            }
        }
    });
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
    let script = ask(&served.address, "/page.js", &host).await;
    let of_page = ["map.js", "section.js", "readings.js", "team.js", "shown.js"];
    let of_parts = [
        "plume.js",
        "scale.js",
        "grid.js",
        "svg.js",
        "chart_axes.js",
        "chart_layers.js",
        "chart.js",
        "chart_pointer.js",
    ];
    let parts = [of_page.as_slice(), &of_parts, &["chart.css"]].concat();
    for asset in ["page.css", "page.js", "site.json"].iter().chain(&parts) {
        let answer = ask(&served.address, &format!("/{asset}"), &host).await;
        assert!(answer.starts_with("HTTP/1.1 200"), "{asset}");
        assert!(!answer.contains("https://"), "{asset} points elsewhere");
        if asset.starts_with("page") {
            assert!(page.contains(asset), "{asset} is not used");
        }
        if of_page.contains(asset) {
            assert!(script.contains(asset), "{asset} is not used");
        }
    }
    assert!(!page.contains("https://"));
    assert!(page.contains("default-src 'self'"));
}

#[tokio::test]
async fn tiles_come_from_where_somebody_said_and_the_report_once_it_is_there() {
    let folder = std::env::temp_dir().join(format!("plumage-page-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let report = folder.join("report.html");
    std::fs::write(&report, "how it went").unwrap();
    let tiles = "https://tiles.example/{z}/{x}/{y}.png".parse().unwrap();
    let served = served_with(PageOptions {
        tiles: Some(tiles),
        report: Some(report),
        ..PageOptions::default()
    })
    .await;
    let host = format!("Host: {}\r\n", served.address);
    let page = ask(&served.address, "/", &host).await;
    assert!(
        page.contains("img-src 'self' data: blob: https://tiles.example;"),
        "{page}"
    );
    assert!(
        ask(&served.address, "/site.json", &host)
            .await
            .contains("tiles.example/{z}")
    );
    let early = ask(&served.address, "/report.html", &host).await;
    assert!(early.starts_with("HTTP/1.1 404"), "{early}");
    served.live.with(|live| live.run.reported = true);
    let there = ask(&served.address, "/report.html", &host).await;
    assert!(
        there.starts_with("HTTP/1.1 200") && there.contains("how it went"),
        "{there}"
    );
    std::fs::remove_dir_all(folder).unwrap();
}

/// The body of an answer as JSON.
fn body(answer: &str) -> serde_json::Value {
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    serde_json::from_str(answer.split("\r\n\r\n").nth(1).unwrap()).unwrap()
}

#[tokio::test]
async fn plume_and_section_are_those_of_the_model() {
    let served = served().await;
    let host = format!("Host: {}\r\n", served.address);
    let view = "west=-1000&south=-3000&east=3000&north=1000&columns=40";
    let nothing = ask(&served.address, &format!("/plume.json?{view}"), &host).await;
    assert!(
        nothing.starts_with("HTTP/1.1 404"),
        "no model yet: {nothing}"
    );
    fly(&served.live, 0..300);
    let plume = body(&ask(&served.address, &format!("/plume.json?{view}"), &host).await);
    let (columns, rows) = (&plume["grid"]["columns"], &plume["grid"]["rows"]);
    let (columns, rows) = (columns.as_u64().unwrap(), rows.as_u64().unwrap());
    assert_eq!((columns, rows), (41, 41));
    let values = plume["values"].as_array().unwrap();
    assert_eq!(values.len() as u64, columns * rows);
    // Upwind of the source there is nothing; far downwind it is strongest where the made-up axis runs, 118° to 130°.
    let at = |e: i64, n: i64| {
        values[((n + 3000) / 100 * 41 + (e + 1000) / 100) as usize]
            .as_f64()
            .unwrap()
    };
    assert!(at(-500, 500).abs() < 1.0);
    let ring = (0..360).map(|bearing| {
        let angle = f64::from(bearing).to_radians();
        let [e, n] =
            [angle.sin(), angle.cos()].map(|part| (900.0 * part / 100.0).round() as i64 * 100);
        (bearing, at(e, n))
    });
    let (bearing, excess) = ring.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    assert!(
        (112..136).contains(&bearing) && excess > 20.0,
        "{bearing} {excess}"
    );
    let section = "from=-500&to=5000&low=300&high=1300&columns=50";
    let section = body(&ask(&served.address, &format!("/section.json?{section}"), &host).await);
    assert_eq!(section["ground"].as_array().unwrap().len(), 50);
    assert_eq!(
        section["values"].as_array().unwrap().len() as u64,
        50 * section["rows"].as_u64().unwrap()
    );
    let ground = body(&ask(&served.address, &format!("/ground.json?{view}"), &host).await);
    assert_eq!(ground["values"][7], synthetic::frame().ground_amsl_m);
    for wrong in [
        "west=0&south=0&east=-5&north=9&columns=9",
        "west=nan&south=0&east=5&north=9&columns=9",
    ] {
        let answer = ask(&served.address, &format!("/plume.json?{wrong}"), &host).await;
        assert!(answer.starts_with("HTTP/1.1 40"), "{wrong}: {answer}");
    }
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
    // A program that does not say where it is from is no page either.
    let headers = format!("{own}Connection: Upgrade\r\n");
    let answer = ask(&served.address, "/live", &headers).await;
    assert!(answer.starts_with("HTTP/1.1 403"), "{answer}");
}

#[tokio::test]
async fn with_a_token_nothing_is_served_without_it() {
    let served = served_with(PageOptions {
        token: Some("open-sesame".to_owned()),
        ..PageOptions::default()
    })
    .await;
    let host = format!("Host: {}\r\n", served.address);
    let origin = format!("{host}Origin: http://{}\r\n", served.address);
    for (path, headers) in [
        ("/", host.clone()),
        ("/live", origin),
        ("/?token=open-sesam", host.clone()),
        ("/site.json?token=", host.clone()),
        ("/", format!("{host}Cookie: plumage-token=open-sesame2\r\n")),
    ] {
        let answer = ask(&served.address, path, &headers).await;
        assert!(answer.starts_with("HTTP/1.1 401"), "{path}: {answer}");
    }
    let page = ask(&served.address, "/?token=open-sesame", &host).await;
    assert!(page.starts_with("HTTP/1.1 200"), "{page}");
    let cookie = "plumage-token=open-sesame";
    assert!(
        page.contains(&format!("set-cookie: {cookie}; HttpOnly")),
        "{page}"
    );
    let with_cookie = format!("{host}Cookie: other=1; {cookie}\r\n");
    let site = ask(&served.address, "/site.json", &with_cookie).await;
    assert!(site.starts_with("HTTP/1.1 200"), "{site}");
}

/// 300 connections that never finish their request: the server takes 64, drops them after 10 s, and then serves who
/// asks.
#[tokio::test]
async fn connections_that_never_ask_are_few_and_dropped() {
    let served = served().await;
    let mut half_open = Vec::new();
    for _ in 0..300 {
        let mut stream = TcpStream::connect(&served.address).await.unwrap();
        stream
            .write_all(b"GET / HTTP/1.1\r\nHost: 127.0")
            .await
            .unwrap();
        half_open.push(stream);
    }
    tokio::time::sleep(Duration::from_millis(500)).await;
    let held = |address: &str| {
        let port: u16 = address.rsplit_once(':').unwrap().1.parse().unwrap();
        served_by_this_process(port)
    };
    if let Some(held) = held(&served.address) {
        assert!(held <= 64, "{held} connections are held");
    }
    // The first of them is told so, or closed, within its time.
    let mut answer = Vec::new();
    let first = half_open[0].read_to_end(&mut answer);
    let first = tokio::time::timeout(Duration::from_secs(15), first).await;
    assert!(first.is_ok(), "a half-open connection is held for ever");
    drop(half_open);
    let host = format!("Host: {}\r\n", served.address);
    let page = ask(&served.address, "/", &host);
    let page = tokio::time::timeout(Duration::from_secs(15), page).await;
    assert!(page.unwrap().starts_with("HTTP/1.1 200"));
}

#[tokio::test]
async fn a_place_that_a_vehicle_refuses_is_told_before_it_is_sent() {
    let served = served().await;
    let host = format!("Host: {}\r\n", served.address);
    for (e, n, alt_amsl_m, why) in [
        (2000.0, 1000.0, 800.0, None),
        (20_000.0, 1000.0, 800.0, Some("outside the fence")),
        (2000.0, 1000.0, 5000.0, Some("expected at most")),
    ] {
        let asked = format!("/refusal.json?vehicle=1&e={e}&n={n}&alt_amsl_m={alt_amsl_m}");
        let told = body(&ask(&served.address, &asked, &host).await)["why"].clone();
        match why {
            None => assert!(told.is_null(), "{told}"),
            Some(part) => assert!(told.as_str().unwrap().contains(part), "{told}"),
        }
    }
}

#[tokio::test]
async fn clients_that_ask_without_reading_keep_nobody_out() {
    let served = served().await;
    let request = format!("GET /page.js HTTP/1.1\r\nHost: {}\r\n\r\n", served.address);
    let requests = request.repeat(2000).into_bytes();
    let mut deaf = Vec::new();
    for _ in 0..70 {
        let (stream, requests) = (
            TcpStream::connect(&served.address).await.unwrap(),
            requests.clone(),
        );
        deaf.push(tokio::spawn(async move {
            let mut stream = stream;
            let _ = stream.write_all(&requests).await;
            // Open, and deaf, for as long as the test lasts.
            std::future::pending::<TcpStream>().await
        }));
    }
    tokio::time::sleep(Duration::from_millis(500)).await;
    let host = format!("Host: {}\r\n", served.address);
    let page = ask(&served.address, "/", &host);
    let page = tokio::time::timeout(Duration::from_secs(25), page).await;
    assert!(page.is_ok_and(|page| page.starts_with("HTTP/1.1 200")));
    deaf.iter().for_each(tokio::task::JoinHandle::abort);
}

/// Sockets that this process has accepted at `port`: those files of it that are sockets connected from there. None
/// where the system does not tell.
fn served_by_this_process(port: u16) -> Option<usize> {
    let inodes: Vec<String> = std::fs::read_dir("/proc/self/fd")
        .ok()?
        .filter_map(|file| std::fs::read_link(file.ok()?.path()).ok())
        .filter_map(|to| {
            Some(
                to.to_str()?
                    .strip_prefix("socket:[")?
                    .trim_end_matches(']')
                    .to_owned(),
            )
        })
        .collect();
    let table = std::fs::read_to_string("/proc/self/net/tcp").ok()?;
    let local = format!(":{port:04X}");
    let held = table.lines().skip(1).filter(|line| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        // Established, its own end here, and accepted: one that waits has no file.
        fields[3] == "01" && fields[1].ends_with(&local) && inodes.iter().any(|i| i == fields[9])
    });
    Some(held.count())
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

impl Socket {
    /// Hears until a picture is as wished.
    async fn hear_until(
        &mut self,
        wished: impl Fn(&serde_json::Value) -> bool,
    ) -> serde_json::Value {
        for _ in 0..100 {
            let picture = self.hear().await;
            if wished(&picture) {
                return picture;
            }
        }
        panic!("no such picture");
    }
}

#[tokio::test]
async fn pictures_come_and_commands_go() {
    let mut served = served().await;
    let mut socket = Socket::open(&served.address).await;
    assert_eq!(socket.hear().await["vehicles"].as_array().unwrap().len(), 0);
    fly(&served.live, 0..300);
    let picture = socket
        .hear_until(|p| !p["vehicles"].as_array().unwrap().is_empty())
        .await;
    assert_eq!(picture["vehicles"].as_array().unwrap().len(), 6);
    assert_eq!(picture["vehicles"][5]["real"], true);
    assert_eq!(picture["phase"], "take-off");
    assert_eq!(picture["stars"].as_array().unwrap().len(), 40);

    let says = [
        "garbage",
        "",
        r#"{"command":"hand-back"}"#,
        r#"{"command":"hand-back","vehicle":"a/b"}"#,
        r#"{"command":"take-over","vehicle":"nobody"}"#,
        r#"{"command":"go-to","vehicle":"3","e":1}"#,
        r#"{"command":"speed","factor":-1}"#,
        r#"{"command":"rm"}"#,
        r#"{"command":"pause"}"#,
        r#"{"command":"resume"}"#,
        r#"{"command":"speed","factor":10}"#,
        r#"{"command":"speed","factor":null}"#,
        r#"{"command":"seek","time_s":60.5}"#,
        r#"{"command":"hand-back","vehicle":"3"}"#,
        r#"{"command":"home","vehicle":"3"}"#,
        r#"{"command":"home"}"#,
        r#"{"command":"take-over","vehicle":"3"}"#,
        r#"{"command":"go-to","vehicle":"3","e":0,"n":0,"alt_amsl_m":700}"#,
    ];
    for text in says {
        socket.say(text).await;
    }
    let wait = Duration::from_secs(10);
    let mut heard = Vec::new();
    while heard.len() < 10 {
        let next = tokio::time::timeout(wait, served.commands.recv()).await;
        heard.push(next.unwrap().unwrap());
    }
    let three = || "3".to_owned();
    let place = |command: &PageCommand| match command {
        PageCommand::TakeOver(id, place) | PageCommand::SendTo(id, place) if *id == three() => {
            *place
        }
        other => panic!("{other:?}"),
    };
    assert!(matches!(
        heard[8..],
        [PageCommand::TakeOver(..), PageCommand::SendTo(..)]
    ));
    assert_eq!(heard[..2], [PageCommand::Pause, PageCommand::Resume]);
    let speeds = [10.0, f64::INFINITY].map(PageCommand::Speed);
    assert_eq!(heard[2..4], speeds);
    assert_eq!(heard[4], PageCommand::Seek(60.5));
    assert_eq!(heard[5], PageCommand::HandBack(three()));
    assert_eq!(
        heard[6..8],
        [PageCommand::Home(Some(three())), PageCommand::Home(None)]
    );
    // Taken over it circles where it is.
    let (at, there) = (place(&heard[8]), place(&heard[9]));
    let vehicle = &picture["vehicles"][2];
    let enu = synthetic::frame().to_enu(air::geo::Geodetic {
        lat_deg: at.lat_deg,
        lon_deg: at.lon_deg,
    });
    assert!((enu.east_m - vehicle["e"].as_f64().unwrap()).abs() <= 0.5);
    assert!((at.alt_amsl_m - vehicle["alt"].as_f64().unwrap()).abs() <= 0.5);
    let origin = synthetic::frame().origin();
    assert!((there.lat_deg - origin.lat_deg).abs() < 1e-9 && there.alt_amsl_m == 700.0);

    // When the mission's side goes, the server ends and says nothing bad.
    drop(served.open);
    tokio::time::timeout(wait, served.server)
        .await
        .unwrap()
        .unwrap();
}

/// A page as the script keeps it: the tracks' points by vehicle, and how many events it has.
#[derive(Default)]
struct Kept {
    tracks: std::collections::BTreeMap<String, Vec<i64>>,
    events: usize,
}

impl Kept {
    fn take(&mut self, message: &serde_json::Value) {
        if message["whole"] == true {
            *self = Self::default();
        }
        self.events += message["events"].as_array().map_or(0, Vec::len);
        for piece in message["tracks"].as_array().unwrap() {
            let points = piece["points"].as_array().unwrap();
            let kept = self
                .tracks
                .entry(piece["id"].as_str().unwrap().to_owned())
                .or_default();
            for _ in 0..piece["halvings"].as_u64().unwrap() {
                let every_second = kept.chunks(5).step_by(2).flatten().copied();
                *kept = every_second.collect();
            }
            kept.extend(points.iter().map(|v| v.as_i64().unwrap()));
        }
    }
}

/// Whoever follows from the beginning and whoever opens the page late have the same.
#[tokio::test]
async fn early_and_late_pages_have_the_same_tracks() {
    let served = served().await;
    let mut early = Socket::open(&served.address).await;
    let mut follows = Kept::default();
    for part in 0..12 {
        fly(&served.live, part * 4000..(part + 1) * 4000);
        let time_s = ((part + 1) * 4000 - 1) as f64 * 0.02 - 1.0;
        loop {
            let message = early.hear().await;
            follows.take(&message);
            if message["time_s"].as_f64().is_some_and(|t| t > time_s) {
                break;
            }
        }
    }
    let mut late = Socket::open(&served.address).await;
    let mut opened = Kept::default();
    while opened.tracks.len() < follows.tracks.len()
        || opened.tracks.values().map(Vec::len).sum::<usize>()
            < follows.tracks.values().map(Vec::len).sum()
    {
        opened.take(&late.hear().await);
    }
    assert_eq!(follows.tracks, opened.tracks);
    assert_eq!((follows.events, opened.events), (48, 40));
    // A recording that is wound back begins anew on every page.
    served.live.with(|live| live.forget());
    fly(&served.live, 0..100);
    loop {
        let message = early.hear().await;
        follows.take(&message);
        if message["whole"] == true {
            break;
        }
    }
    assert!(follows.events <= 1 && follows.tracks.values().all(|t| t.len() <= 100 * 5));
}

#[tokio::test]
async fn a_busy_port_is_named() {
    let served = served().await;
    let refused = page::listen(&served.address).await.unwrap_err().to_string();
    assert!(refused.contains(&served.address), "{refused}");
}

#[test]
fn messages_stay_small_however_long_the_mission() {
    let mut live = LiveState::new(crate::made_up::site());
    let (mut news, mut whole) = (0, 0);
    for n in 0..40_000 {
        for (topic, envelope) in synthetic::tick(n) {
            live.take(&topic, &envelope);
        }
        if n % 500 == 499 {
            news = news.max(live.news()[0].len());
        }
    }
    for message in live.whole() {
        whole = whole.max(message.len());
    }
    assert!(news < 10_000 && whole < 50_000, "{news} and {whole} bytes");
}
