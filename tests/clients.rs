//! Clients that are not ours ask and fly the stand-in over UDP, and read what missions leave: ignored, with the reason, where they
//! are not installed.

use crate::program::Ends;
use libtest_mimic::{Completion, Failed};
use mav_bridge::arduplane::AUTO;
use protocol::message::{Control, ControlLevel, ControlWish, Message, PathKind, Setpoint};
use protocol::{AgentId, SimTime, Topic};
use scenario::random::stream;
use stand_in::StandIn;
use std::net::{TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const SCENARIO: &str = "../scenarios/as-pontes.toml";
const SCRIPT: &str = "../tests/oracle/mavlink_clients.py";
const TEAM: &str = "../tests/oracle/mavlink_team.py";
const LADDER: &str = "../tests/oracle/mavlink_ladder.py";
const RECORDS: &str = "../tests/oracle/records.py";
const ROS2: &str = "../tests/oracle/ros2_node.py";
const STRANGER: &str = "../tests/oracle/stranger.py";
const STRATEGY: &str = "../examples/outside_strategy.py";
/// How many times faster than the clock a mission is flown.
const SPEED: f64 = 15.0;

/// The stand-in in this process, at the clock's pace on the ground and in every mode but AUTO, where
/// nobody asks and it flies its mission at [`SPEED`].
fn stand_in(port: &str, ended: &AtomicBool) {
    let setup = programs::mission_files::load(Path::new(SCENARIO)).expect("the scenario");
    let config = setup.stand_in_config(5).unwrap();
    let mut vehicle = StandIn::new(config, stream(7, "stand-in/6")).unwrap();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.connect(format!("127.0.0.1:{port}")).unwrap();
    socket.set_nonblocking(true).unwrap();
    let (mut time_s, mut before) = (0.0, Instant::now());
    let mut datagram = [0; 2048];
    while !ended.load(Ordering::Relaxed) {
        let flies_mission = vehicle.is_armed() && vehicle.custom_mode() == AUTO;
        let speed = if flies_mission { SPEED } else { 1.0 };
        time_s += speed * before.elapsed().as_secs_f64();
        before = Instant::now();
        let mut frames = Vec::new();
        while let Ok(length) = socket.recv(&mut datagram) {
            frames.push(datagram[..length].to_vec());
        }
        let now = SimTime::from_ns((time_s * 1e9) as i64);
        for frame in vehicle.step(now, &frames) {
            // Nobody listens yet, at first.
            let _ = socket.send(&frame);
        }
        std::thread::sleep(Duration::from_millis(4));
    }
}

fn free_port() -> String {
    let free = UdpSocket::bind("127.0.0.1:0").unwrap();
    free.local_addr().unwrap().port().to_string()
}

/// Runs a script to its end: what it said, which is the reason if it fails.
fn says(arguments: &[&str]) -> Result<String, Failed> {
    let said = Command::new("python3").args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    if said.status.success() {
        Ok(text(&said.stdout))
    } else {
        Err((text(&said.stdout) + &text(&said.stderr)).into())
    }
}

fn succeeds(arguments: &[&str]) -> Result<Completion, Failed> {
    says(arguments).map(|_| Completion::Completed)
}

fn not_installed(client: &str, module: &str) -> Option<Completion> {
    let reason = format!("needs a python3 with {module} (pip install {client})");
    (!installed(module)).then(|| Completion::ignored_with(reason))
}

/// Every question that a ground station asks, and a mission uploaded, read back and flown.
fn the_ladder_of_questions() -> Result<Completion, Failed> {
    if let Some(ignored) = not_installed("pymavlink", "pymavlink.mavutil") {
        return Ok(ignored);
    }
    let port = free_port();
    let ended = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let vehicle = scope.spawn(|| stand_in(&port, &ended));
        let asked = succeeds(&[LADDER, &port, &SPEED.to_string()]);
        ended.store(true, Ordering::Relaxed);
        vehicle.join().unwrap();
        asked
    })
}

/// A position as it was heard: system, time (ms), latitude and longitude (1e-7 degrees), altitude (mm).
type Heard = [i64; 5];

fn positions(said: &str) -> Vec<Heard> {
    let row = |line: &str| {
        let numbers: Vec<i64> = line.split(' ').map_while(|n| n.parse().ok()).collect();
        numbers.try_into().ok()
    };
    said.lines().filter_map(row).collect()
}

/// Whether every position that was heard is one that the record has from no more than `late_ms` before.
fn are_recorded(heard: &[Heard], recording: &record::Recording, late_ms: i64) {
    let said = recording.in_order().unwrap().filter_map(|said| {
        let (topic, envelope) = said.unwrap();
        let (Topic::State(name), Message::State(state)) = (topic, envelope.message) else {
            return None;
        };
        let whole = |value: f64, unit: f64| (value / unit).round() as i64;
        let place = [
            whole(state.lat_deg, 1e-7),
            whole(state.lon_deg, 1e-7),
            whole(state.alt_amsl_m, 1e-3),
        ];
        Some((
            name.as_str().parse().unwrap(),
            envelope.time.ns() / 1_000_000,
            place,
        ))
    });
    let said: Vec<(i64, i64, [i64; 3])> = said.collect();
    for &[system, time_ms, lat, lon, alt] in heard {
        let near = |a: i64, b: i64| (a - b).abs() <= 1;
        let agrees = said.iter().any(|&(id, at_ms, place)| {
            id == system
                && (0..=late_ms).contains(&(time_ms - at_ms))
                && near(place[0], lat)
                && near(place[1], lon)
                && near(place[2], alt)
        });
        assert!(
            agrees,
            "vehicle {system} at {time_ms} ms is nowhere in the record"
        );
    }
}

/// A mission whose team a ground station watches, takes over and calls home, and the log of it.
fn the_team_on_a_link_and_in_its_log() -> Result<Completion, Failed> {
    if let Some(ignored) = not_installed("pymavlink", "pymavlink.mavutil") {
        return Ok(ignored);
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("team-on-a-link");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let (out, log) = (folder.join("out"), folder.join("team.tlog"));
    let port = free_port();
    let mission = Command::new(env!("CARGO_BIN_EXE_plumage"))
        .args([
            "run",
            SCENARIO,
            "--speed",
            "10",
            "--duration",
            "300",
            "--no-serve",
        ])
        .args(["--gcs", &format!("udpout:127.0.0.1:{port}"), "--tlog"])
        .args([log.as_os_str(), "--out".as_ref(), out.as_os_str()])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut mission = Ends(mission);
    let live = says(&[TEAM, "link", &port])?;
    assert!(mission.0.wait().unwrap().success());
    let logged = says(&[TEAM, "log", log.to_str().unwrap()])?;
    let recording = record::read_mcap(&out.join("mission.mcap")).unwrap();
    let (live, logged) = (positions(&live), positions(&logged));
    assert!(live.len() > 500 && logged.len() > live.len());
    // Simulated vehicles say ten times a second where they are.
    are_recorded(&live, &recording, 150);
    are_recorded(&logged, &recording, 150);
    let replayed = Command::new(env!("CARGO_BIN_EXE_plumage"))
        .args([
            "replay".as_ref(),
            out.join("mission.mcap").as_os_str(),
            "--verify".as_ref(),
        ])
        .output()
        .unwrap();
    assert!(replayed.status.success(), "{replayed:?}");
    Ok(Completion::Completed)
}

fn installed(module: &str) -> bool {
    let import = format!("import {module}");
    let python = Command::new("python3")
        .args(["-c", &import])
        .stderr(Stdio::null())
        .status();
    python.is_ok_and(|status| status.success())
}

fn flies_by(client: &str, module: &str) -> Result<Completion, Failed> {
    if let Some(ignored) = not_installed(client, module) {
        return Ok(ignored);
    }
    let port = free_port();
    let link = format!("udpout:127.0.0.1:{port}");
    let stand_in = Command::new(env!("CARGO_BIN_EXE_mav-bridge"))
        .args(["stand-in", "--scenario", SCENARIO, "--vehicle", "6"])
        .args(["--hands-off", "--duration", "300", "--link", &link])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let _stand_in = Ends(stand_in);
    succeeds(&[SCRIPT, client, &port])
}

/// A short mission with a start, exported in every format, and each read by the program of others that it is for.
/// An empty folder.
fn fresh(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// The reference mission in `folder`, at the date that the readers expect.
fn dated(folder: &Path) -> PathBuf {
    let shipped = std::fs::read_to_string(SCENARIO).unwrap();
    let dated = shipped.replacen(
        "start = \"2026-09-16T11:00:00Z\"",
        "start = \"2026-11-27T12:30:00Z\"",
        1,
    );
    assert_ne!(dated, shipped, "{SCENARIO} has another start");
    let scenario = folder.join("dated.toml");
    std::fs::write(&scenario, dated).unwrap();
    std::fs::create_dir(folder.join("aircraft")).unwrap();
    std::fs::copy("../aircraft/x8.toml", folder.join("aircraft/x8.toml")).unwrap();
    scenario
}

fn ros2_hears_a_mission() -> Result<Completion, Failed> {
    if let Some(ignored) = not_installed("eclipse-zenoh rosbags", "zenoh, rosbags") {
        return Ok(ignored);
    }
    let folder = fresh("ros2");
    let (scenario, out) = (dated(&folder), folder.join("out"));
    succeeds(&[
        ROS2,
        env!("CARGO_BIN_EXE_plumage"),
        scenario.to_str().unwrap(),
        out.to_str().unwrap(),
        &free_port(),
    ])
}

fn what_a_mission_leaves() -> Result<Completion, Failed> {
    if let Some(ignored) = not_installed(
        "fastkml lxml pyogrio mcap rosbags xarray netCDF4 pyarrow foxglove-sdk protobuf",
        "fastkml, lxml, pyogrio, mcap, rosbags, xarray, netCDF4, pyarrow, foxglove, google.protobuf",
    ) {
        return Ok(ignored);
    }
    let folder = fresh("records");
    let scenario = dated(&folder);
    let out = folder.join("out");
    let plumage = |arguments: &[&str]| {
        let said = Command::new(env!("CARGO_BIN_EXE_plumage"))
            .args(arguments)
            .output()
            .unwrap();
        assert!(said.status.success(), "{said:?}");
    };
    let path = |name: &str| out.join(name).to_str().unwrap().to_owned();
    let flown = [
        "run",
        scenario.to_str().unwrap(),
        "--duration",
        "200",
        "--no-serve",
        "--out",
    ];
    plumage(&[&flown[..], &[&path("")]].concat());
    for (format, name) in [
        ("csv", "out.csv"),
        ("geojson", "out.geojson"),
        ("netcdf", "out.nc"),
        ("parquet", "out.parquet"),
        ("kml", "out.kml"),
        ("kmz", "out.kmz"),
        ("ros2", "out-ros2"),
        ("foxglove", "out-foxglove.mcap"),
    ] {
        let (recording, to) = (path("mission.mcap"), path(name));
        plumage(&[
            "export",
            &recording,
            "--to",
            format,
            "--out",
            &to,
            "--undulation-m",
            "55",
        ]);
    }
    // The exported recording is one still.
    plumage(&["replay", &path("out-foxglove.mcap"), "--verify"]);
    // What was imported and what was exported are observations, and exported in turn.
    plumage(&["import", &path("mission.mcap"), "--out", &path("real.csv")]);
    for (format, name) in [
        ("kml", "real.kml"),
        ("netcdf", "real.nc"),
        ("ros2", "real-ros2"),
    ] {
        plumage(&[
            "export",
            &path("real.csv"),
            "--to",
            format,
            "--out",
            &path(name),
        ]);
    }
    succeeds(&[RECORDS, &path("")])
}

/// The team of as-pontes in processes in real time on a port of its own, recorded.
struct Processes {
    endpoint: String,
    out: PathBuf,
    recorder: Ends,
    _team: Vec<Ends>,
}

impl Processes {
    fn fly(mission: &str, strategy: &str, duration_s: u32) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(mission);
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(folder.join("aircraft")).unwrap();
        std::fs::copy("../aircraft/x8.toml", folder.join("aircraft/x8.toml")).unwrap();
        let text = std::fs::read_to_string(SCENARIO).unwrap();
        let text = text
            .replacen("\"as-pontes\"", &format!("{mission:?}"), 1)
            .replacen(
                "duration_s = 2100.0",
                &format!("duration_s = {duration_s}.0"),
                1,
            )
            .replacen("\"cs-ea\"", &format!("{strategy:?}"), 1);
        let file = folder.join("mission.toml");
        std::fs::write(&file, text).unwrap();
        let port = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", port.local_addr().unwrap());
        drop(port);
        let (scenario, out) = (file.to_str().unwrap().to_owned(), folder.join("out"));
        let start = |program: &str, arguments: &[&str]| {
            let log = std::fs::File::create(
                folder.join(format!("{}.log", program.rsplit('/').next().unwrap())),
            );
            let mut command = Command::new(program);
            command
                .args(["--scenario", &scenario, "--json"])
                .args(arguments);
            command.stdout(Stdio::null()).stderr(log.unwrap());
            Ends(command.spawn().unwrap())
        };
        let join = ["--connect", &endpoint];
        let team = vec![
            start(env!("CARGO_BIN_EXE_sc"), &["--listen", &endpoint]),
            start(env!("CARGO_BIN_EXE_ws"), &join),
            start(
                env!("CARGO_BIN_EXE_va"),
                &[&join[..], &["--vehicles", "1,2,3,4,5,6"]].concat(),
            ),
        ];
        let record = [&join[..], &["--out", out.to_str().unwrap()]].concat();
        let recorder = start(env!("CARGO_BIN_EXE_recorder"), &record);
        Self {
            endpoint,
            out,
            recorder,
            _team: team,
        }
    }

    /// What was said in it.
    fn recorded(mut self) -> Vec<(Topic, protocol::Envelope)> {
        assert!(self.recorder.0.wait().unwrap().success());
        let recording = record::read_mcap(&self.out.join("mission.mcap")).unwrap();
        let said = recording.in_order().unwrap();
        said.map(Result::unwrap).collect()
    }
}

/// Somebody on the same host who does not hold the mission's key says 100 times what moves a vehicle: nothing of it is
/// obeyed, or recorded as said, and it is told of at most once a second.
fn a_stranger_on_loopback() -> Result<Completion, Failed> {
    if let Some(ignored) = not_installed("eclipse-zenoh", "zenoh") {
        return Ok(ignored);
    }
    let processes = Processes::fly("strangers", "cs-ea", 40);
    let said = |sender, message| protocol::Envelope {
        sender,
        sequence: 1_000_000,
        time: SimTime::from_s(10.0),
        message,
    };
    let hex = |envelope: protocol::Envelope| -> String {
        let bytes = envelope.to_bytes();
        bytes.iter().map(|b| format!("{b:02x}")).collect()
    };
    let setpoint = hex(said(
        AgentId::sc(),
        Message::Setpoint(Setpoint {
            path: PathKind::GoTo,
            lat_deg: 43.523,
            lon_deg: -7.8631,
            alt_amsl_m: 2500.0,
            airspeed_m_s: 18.0,
            orbit_radius_m: 80.0,
        }),
    ));
    let control = hex(said(
        AgentId::operator(),
        Message::Control(Control {
            wish: ControlWish::TakeOver,
            sticks: None,
        }),
    ));
    let heard = says(&[
        STRANGER,
        &processes.endpoint,
        "strangers",
        &setpoint,
        &control,
    ])?;
    assert!(!heard.contains("\"pilot\""), "{heard}");
    let recorded = processes.recorded();
    let (mut refused, mut told_at) = (0, Vec::new());
    for (topic, envelope) in &recorded {
        assert!(!matches!(topic, Topic::Control(_)), "{envelope:?}");
        match &envelope.message {
            Message::Setpoint(to) => assert!(to.alt_amsl_m < 1300.0, "{to:?}"),
            Message::Mode(mode) => assert!(mode.level != ControlLevel::Pilot, "{mode:?}"),
            Message::Event(event) if event.code == "bad-message" => {
                told_at.push(envelope.time.s());
                // Its count of all so far, or the first one alone.
                let words = event.text.split(' ').collect::<Vec<_>>();
                refused = words.get(3).and_then(|n| n.parse().ok()).unwrap_or(1);
            }
            _ => {}
        }
    }
    assert_eq!(refused, 100, "refused of 100");
    assert!(
        told_at.windows(2).all(|t| t[1] - t[0] > 0.99),
        "{told_at:?}"
    );
    Ok(Completion::Completed)
}

/// The search strategy in Python that the documentation shows sends the vehicles somewhere: it finds the key by itself.
fn a_strategy_outside_the_program() -> Result<Completion, Failed> {
    if let Some(ignored) = not_installed("eclipse-zenoh", "zenoh") {
        return Ok(ignored);
    }
    let processes = Processes::fly("outside", "outside", 45);
    let connect = ["--mission", "outside", "--connect", &processes.endpoint];
    let printed = says(&[&[STRATEGY][..], &connect, &["--seconds", "40"]].concat())?;
    assert!(
        printed.contains("1 to ") && printed.contains("2 to "),
        "{printed}"
    );
    let recorded = processes.recorded();
    let sent = |id: &str| {
        let to_it = |topic: &Topic| matches!(topic, Topic::Destination(to) if to.as_str() == id);
        recorded.iter().any(|(topic, _)| to_it(topic))
    };
    assert!(sent("1") && sent("2"), "{printed}");
    let told_of = |e: &Message| matches!(e, Message::Event(e) if e.code == "bad-message");
    assert!(!recorded.iter().any(|(_, e)| told_of(&e.message)));
    Ok(Completion::Completed)
}

fn pymavlink_flies_the_stand_in() -> Result<Completion, Failed> {
    flies_by("pymavlink", "pymavlink.mavutil")
}

fn mavsdk_flies_the_stand_in() -> Result<Completion, Failed> {
    // The module of version 4; earlier ones had another interface.
    flies_by("mavsdk", "mavsdk.asyncio")
}

fn mavproxy_flies_the_stand_in() -> Result<Completion, Failed> {
    flies_by("mavproxy", "MAVProxy.mavproxy")
}

crate::runner::tests! {
    RealTime {
        pymavlink_flies_the_stand_in,
        mavsdk_flies_the_stand_in,
        mavproxy_flies_the_stand_in,
        the_ladder_of_questions,
        ros2_hears_a_mission,
        a_stranger_on_loopback,
        a_strategy_outside_the_program,
        the_team_on_a_link_and_in_its_log,
    }
    Cores {
        what_a_mission_leaves,
    }
}
