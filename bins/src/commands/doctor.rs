//! `plumage doctor`: what this machine has of what missions need.

use crate::{Failure, agent, mission_files};
use formats::calendar::rfc_3339;
use net::{DEFAULT_ENDPOINT, Net, NetOptions};
use protocol::key::Name;
use protocol::seal::MissionKey;
use std::net::{TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use views::page::DEFAULT_ADDRESS;

/// Where ground stations and autopilots are listened for by habit (MAVLink).
const MAVLINK_ADDRESS: &str = "0.0.0.0:14550";
/// What a mission of an hour with a hundred vehicles may take, bytes.
const ROOM_BYTES: u64 = 5 << 30;
/// A clock before this stands wrong: 2026-01-01, s since 1970.
const NO_EARLIER_S: u64 = 1_767_225_600;
/// Time after which the bus is taken for blocked.
const BUS_PATIENCE: Duration = Duration::from_secs(10);

/// Arguments of `plumage doctor`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: plumage doctor scenarios/as-pontes.toml")]
pub struct DoctorArguments {
    /// Scenario to check with all files that it names: aircraft, terrain, weather
    pub scenario: Option<PathBuf>,
}

/// The result of one check.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CheckResult {
    /// As missions need it.
    Good,
    /// Not there, and needed by some only.
    Missing,
    /// Missions fail by it.
    Bad,
}

struct Finding {
    result: CheckResult,
    what: &'static str,
    words: String,
}

fn finding(result: CheckResult, what: &'static str, words: impl Into<String>) -> Finding {
    Finding {
        result,
        what,
        words: words.into(),
    }
}

/// Looks at everything and tells it, a line each.
///
/// # Errors
/// Something by which missions fail.
pub fn doctor(arguments: &DoctorArguments) -> Result<(), Failure> {
    let mut all = vec![
        processors(),
        disk(),
        clock(),
        port("page", DEFAULT_ADDRESS, |at| {
            TcpListener::bind(at).map(drop)
        }),
        port("bus", DEFAULT_ENDPOINT.trim_start_matches("tcp/"), |at| {
            TcpListener::bind(at).map(drop)
        }),
        port("MAVLink", MAVLINK_ADDRESS, |at| {
            UdpSocket::bind(at).map(drop)
        }),
        bus(),
        serial(),
        measured_data(),
    ];
    all.extend(arguments.scenario.as_deref().map(scenario_files));
    println!(
        "plumage {} on {} {}",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::OS,
        std::env::consts::ARCH
    );
    for Finding {
        result,
        what,
        words,
    } in &all
    {
        let mark = match result {
            CheckResult::Good => "ok  ",
            CheckResult::Missing => "none",
            CheckResult::Bad => "BAD ",
        };
        println!("{mark}  {what:<14} {words}");
    }
    let bad = all.iter().filter(|f| f.result == CheckResult::Bad).count();
    if bad > 0 {
        return Err(Failure::Run(anyhow::anyhow!(
            "{bad} of {} checks failed",
            all.len()
        )));
    }
    Ok(())
}

fn processors() -> Finding {
    let count = std::thread::available_parallelism().map_or(1, usize::from);
    finding(
        CheckResult::Good,
        "processors",
        format!("{count}; campaigns and plans use all of them"),
    )
}

/// Free room in the working folder, as `df` tells it.
fn disk() -> Finding {
    let probe = Path::new(".plumage-probe");
    if let Err(error) = std::fs::write(probe, b"").and_then(|()| std::fs::remove_file(probe)) {
        let words =
            format!("cannot write to the working folder ({error}); use --out with another folder");
        return finding(CheckResult::Bad, "disk", words);
    }
    let told = std::process::Command::new("df").args(["-Pk", "."]).output();
    let free = told.ok().and_then(|told| {
        let text = String::from_utf8(told.stdout).ok()?;
        text.lines()
            .nth(1)?
            .split_whitespace()
            .nth(3)?
            .parse::<u64>()
            .ok()
    });
    let Some(free) = free.map(|k| k * 1024) else {
        return finding(
            CheckResult::Missing,
            "disk",
            "writable; the free space is unknown on this system",
        );
    };
    let words = format!("{:.1} GB free in the working folder", free as f64 / 1e9);
    if free < ROOM_BYTES {
        return finding(
            CheckResult::Bad,
            "disk",
            format!("{words}; a mission of an hour with a large team writes up to 5 GB"),
        );
    }
    finding(CheckResult::Good, "disk", words)
}

fn clock() -> Finding {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    let said = rfc_3339(i64::try_from(since.as_nanos()).unwrap_or(0));
    if since.as_secs() < NO_EARLIER_S {
        let words = format!(
            "{said} is in the past; real aircraft and reported weather need the right time"
        );
        return finding(CheckResult::Bad, "clock", words);
    }
    finding(CheckResult::Good, "clock", said)
}

fn port(what: &'static str, at: &str, bind: impl Fn(&str) -> std::io::Result<()>) -> Finding {
    match bind(at) {
        Ok(()) => finding(CheckResult::Good, what, format!("{at} is free")),
        Err(error) => {
            let words = format!(
                "{at} is in use ({error}); another mission runs, or choose another address"
            );
            finding(CheckResult::Missing, what, words)
        }
    }
}

/// Whether a message goes round on this machine.
fn bus() -> Finding {
    let begun = Instant::now();
    let opened = agent::block_on(async {
        let options = NetOptions {
            listen: vec!["tcp/127.0.0.1:0".to_owned()],
            ..NetOptions::default()
        };
        let open = async {
            let name = Name::new("doctor").map_err(Failure::input)?;
            let key = MissionKey::new(net::random()?);
            let net = Net::open(name, key, &options).await;
            net.map_err(Failure::input)?.close().await;
            Ok(())
        };
        tokio::time::timeout(BUS_PATIENCE, open)
            .await
            .unwrap_or_else(|_| Err(Failure::usage("no answer within 10 s")))
    });
    match opened {
        Ok(()) => {
            let ms = begun.elapsed().as_millis();
            finding(
                CheckResult::Good,
                "zenoh",
                format!("opens and closes on this machine ({ms} ms)"),
            )
        }
        Err(error) => finding(
            CheckResult::Bad,
            "zenoh",
            format!("{}; only missions in a single process work", error.words()),
        ),
    }
}

/// Radios and autopilots on a cable.
fn serial() -> Finding {
    let names = std::fs::read_dir("/dev").into_iter().flatten().flatten();
    let names = names.filter_map(|entry| entry.file_name().into_string().ok());
    let mut found: Vec<String> = names
        .filter(|n| n.starts_with("ttyUSB") || n.starts_with("ttyACM"))
        .map(|n| format!("/dev/{n}"))
        .collect();
    found.sort();
    if found.is_empty() {
        let words = "none; needed only for real aircraft on serial links";
        return finding(CheckResult::Missing, "serial ports", words);
    }
    finding(CheckResult::Good, "serial ports", found.join(", "))
}

fn measured_data() -> Finding {
    let Some(folder) = std::env::var_os("PLUMAGE_DATA").map(PathBuf::from) else {
        let words = "PLUMAGE_DATA is not set; needed only for tests on measured data";
        return finding(CheckResult::Missing, "measured data", words);
    };
    let words = folder.display().to_string();
    if folder.is_dir() {
        return finding(CheckResult::Good, "measured data", words);
    }
    finding(
        CheckResult::Bad,
        "measured data",
        format!("PLUMAGE_DATA={words} is not a folder"),
    )
}

/// The scenario with all that it names.
fn scenario_files(path: &Path) -> Finding {
    match mission_files::load(path) {
        Ok(setup) => {
            let files: Vec<&str> = setup.files.keys().map(String::as_str).collect();
            let terrain = setup.scenario.site.terrain.as_deref().unwrap_or("flat");
            let words = format!("with {}; terrain: {terrain}", files.join(", "));
            finding(CheckResult::Good, "scenario", words)
        }
        Err(error) => finding(CheckResult::Bad, "scenario", error.words()),
    }
}
