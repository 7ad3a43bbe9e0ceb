//! A real vehicle in a mission of processes: its hand-back is answered, its bridge stays until it is down, and it takes
//! the place of a simulated one.

use crate::program::Ends;
use mav_bridge::dialect::{
    ATTITUDE_DATA, GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavState,
    MavType, VFR_HUD_DATA,
};
use mav_bridge::wire::{FrameDecoder, FrameEncoder, MessageData};
use protocol::SimTime;
use std::io::Read as _;
use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

const SCENARIO: &str = "../scenarios/as-pontes-steady.toml";

fn spawn(path: &str, arguments: &[&str], errors: Stdio) -> Ends {
    let mut command = Command::new(path);
    let command = command.args(arguments).stdin(Stdio::piped()).stderr(errors);
    Ends(command.spawn().unwrap())
}

fn control(bus: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_plumage"))
        .args(["control", "hand-back", "--vehicles", "6"])
        .args(bus)
        .output()
        .unwrap()
}

/// Whether a process still runs.
fn runs(process: &mut Ends) -> bool {
    process.0.try_wait().unwrap().is_none()
}

fn wait_s(seconds: u64) {
    std::thread::sleep(Duration::from_secs(seconds));
}

/// The squadron controller of a mission, the options by which others join it, and a free address for a link.
fn begin_mission(duration_s: &'static str) -> (Ends, Vec<&'static str>, SocketAddr) {
    let free = "127.0.0.1:0";
    let tcp = TcpListener::bind(free).unwrap().local_addr().unwrap();
    let udp = UdpSocket::bind(free).unwrap().local_addr().unwrap();
    let endpoint: &str = format!("tcp/{tcp}").leak();
    let mission = ["--scenario", SCENARIO, "--duration", duration_s];
    let listen = [&mission[..], &["--listen", endpoint]].concat();
    let sc = spawn(env!("CARGO_BIN_EXE_sc"), &listen, Stdio::null());
    let bus = [&mission[..], &["--connect", endpoint]].concat();
    (sc, bus, udp)
}

fn a_hand_back_is_answered_and_the_bridge_stays_until_its_vehicle_is_down() {
    let (_sc, bus, udp) = begin_mission("28");
    let log = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bridge.log");
    let _ws = spawn(env!("CARGO_BIN_EXE_ws"), &bus, Stdio::null());
    let listens = format!("udpin:{udp}");
    let mut bridge = spawn(
        env!("CARGO_BIN_EXE_mav-bridge"),
        &[&bus[..], &["--vehicle", "6", "--link", &listens]].concat(),
        std::fs::File::create(&log).unwrap().into(),
    );
    // Nothing is on its link yet.
    let refused = control(&bus);
    let told = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{told}");
    assert!(told.contains("va/6: hand-back rejected: no link"), "{told}");
    let _vehicle = spawn(
        env!("CARGO_BIN_EXE_mav-bridge"),
        &[
            "stand-in",
            "--scenario",
            SCENARIO,
            "--vehicle",
            "6",
            "--link",
            &format!("udpout:{udp}"),
        ],
        Stdio::null(),
    );
    wait_s(4);
    let taken = control(&bus);
    let told = String::from_utf8_lossy(&taken.stdout).into_owned();
    assert_eq!(taken.status.code(), Some(0), "{told}");
    assert!(told.contains("va/6: hand-back ignored"), "{told}");
    // The mission ends with the vehicle in its climb.
    wait_s(32);
    let said = || {
        let mut text = String::new();
        std::fs::File::open(&log)
            .unwrap()
            .read_to_string(&mut text)
            .unwrap();
        text
    };
    assert!(runs(&mut bridge), "{}", said());
    assert!(
        said().contains("vehicle 6: warning: the mission is over"),
        "{}",
        said()
    );
    let id = bridge.0.id().to_string();
    let interrupt = || {
        Command::new("kill").args(["-INT", &id]).status().unwrap();
        wait_s(2);
    };
    interrupt();
    assert!(runs(&mut bridge), "{}", said());
    interrupt();
    assert!(!runs(&mut bridge), "{}", said());
    assert!(
        said().contains("real vehicles rely on their own failsafe"),
        "{}",
        said()
    );
}

fn swap(vehicle: &str, options: &[&str], bus: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_plumage"))
        .args(["swap", vehicle])
        .args(options)
        .args(bus)
        .output()
        .unwrap()
}

/// Checks the exit code and for words.
fn told(output: &Output, code: i32, words: &str) {
    let text = [&output.stdout[..], &output.stderr[..]].concat();
    let text = String::from_utf8_lossy(&text);
    assert_eq!(output.status.code(), Some(code), "{text}");
    assert!(text.contains(words), "'{words}' is not in: {text}");
}

fn a_real_aircraft_takes_the_place_of_a_simulated_one_and_is_not_let_go_in_the_air() {
    let (_sc, bus, udp) = begin_mission("300");
    let _ws = spawn(env!("CARGO_BIN_EXE_ws"), &bus, Stdio::null());
    let team = [&bus[..], &["--vehicles", "2,3"]].concat();
    let _va = spawn(env!("CARGO_BIN_EXE_va"), &team, Stdio::null());

    told(
        &swap("3", &["--simulated"], &bus),
        1,
        "vehicle 3 is simulated already",
    );
    told(
        &swap("3", &["--real", "udpin:256.0.0.1:9"], &bus),
        1,
        "udpin:256.0.0.1:9",
    );

    // The scenario has vehicle 3 simulated; its stand-in is somebody's real aircraft here.
    let link = format!("udpout:{udp}");
    let stand_in = [
        "stand-in",
        "--scenario",
        SCENARIO,
        "--vehicle",
        "3",
        "--link",
        &link,
    ];
    let _aircraft = spawn(env!("CARGO_BIN_EXE_mav-bridge"), &stand_in, Stdio::null());
    let link = format!("udpin:{udp}");
    let made = swap("3", &["--real", &link, "--may-arm"], &bus);
    told(
        &made,
        0,
        &format!("a real aircraft on {link} now flies as this vehicle"),
    );
    told(
        &swap("3", &["--real", &link], &bus),
        1,
        "vehicle 3 is real already",
    );

    // Nobody is on this link: after 30 s the simulated vehicle 2 goes on.
    let nobody = UdpSocket::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let nobody = format!("udpin:{nobody}");
    let real = format!("a real aircraft on {nobody} now flies as this vehicle");
    told(&swap("2", &["--real", &nobody], &bus), 0, &real);
    told(
        &swap("2", &["--real", &nobody], &bus),
        1,
        "vehicle 2 is real already",
    );

    // It takes off in its turn; from then on a simulated one is refused: nobody would have the real one.
    wait_s(25);
    told(
        &swap("3", &["--simulated"], &bus),
        1,
        "is in the air; its pilot must take over or land it first",
    );
    wait_s(6);
    told(
        &swap("2", &["--simulated"], &bus),
        1,
        "vehicle 2 is simulated already",
    );
}

/// A vehicle's autopilot, as far as a bridge needs it to know where it is, and what that sends to it.
struct Autopilot {
    socket: UdpSocket,
    encoder: FrameEncoder,
    /// Another ground station whose heartbeat the autopilot passes on, as ArduPilot does between its links.
    station: Option<FrameEncoder>,
}

impl Autopilot {
    /// That of system 3, which sends to a port of this host.
    fn towards(bridge: SocketAddr) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(bridge).unwrap();
        socket.set_nonblocking(true).unwrap();
        Self {
            socket,
            encoder: FrameEncoder::new(3, 1),
            station: None,
        }
    }

    fn send<D: MessageData>(&mut self, message: &D) {
        let frame = self.encoder.encode(message, None, SimTime::ZERO);
        let _ = self.socket.send(&frame);
    }

    /// Stands on the ground in MANUAL for so many seconds; the heartbeats of the bridge in that time.
    fn stand_s(&mut self, seconds: u32) -> usize {
        let mut heartbeats = 0;
        for k in 0..10 * seconds {
            let time_boot_ms = 60_000 + 100 * k;
            self.send(&GLOBAL_POSITION_INT_DATA {
                time_boot_ms,
                lat: 434_300_000,
                lon: -78_404_000,
                alt: 340_000,
                ..GLOBAL_POSITION_INT_DATA::default()
            });
            self.send(&ATTITUDE_DATA::default());
            self.send(&VFR_HUD_DATA::default());
            if k % 10 == 0 {
                self.send(&heartbeat(
                    MavType::MAV_TYPE_FIXED_WING,
                    MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
                ));
                if let Some(station) = &mut self.station {
                    let gcs = heartbeat(MavType::MAV_TYPE_GCS, MavAutopilot::MAV_AUTOPILOT_INVALID);
                    let frame = station.encode(&gcs, None, SimTime::ZERO);
                    let _ = self.socket.send(&frame);
                }
            }
            std::thread::sleep(Duration::from_millis(100));
            let (mut decoder, mut bytes) = (FrameDecoder::new(), [0; 2048]);
            while let Ok(length) = self.socket.recv(&mut bytes) {
                decoder.push(&bytes[..length]);
            }
            let frames = std::iter::from_fn(|| decoder.next_frame(SimTime::ZERO));
            heartbeats += frames
                .filter(|f| f.message_id() == HEARTBEAT_DATA::ID)
                .count();
        }
        heartbeats
    }
}

fn heartbeat(mavtype: MavType, autopilot: MavAutopilot) -> HEARTBEAT_DATA {
    HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype,
        autopilot,
        base_mode: MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
        system_status: MavState::MAV_STATE_STANDBY,
        mavlink_version: 3,
    }
}

fn a_real_aircraft_that_is_let_go_gets_the_heartbeat_until_its_pilots_station_is_there() {
    let (_sc, bus, udp) = begin_mission("300");
    let team = [&bus[..], &["--vehicles", "3"]].concat();
    let _va = spawn(env!("CARGO_BIN_EXE_va"), &team, Stdio::null());
    let link = format!("udpin:{udp}");
    let mut autopilot = Autopilot::towards(udp);
    for released in [false, true] {
        let real = swap("3", &["--real", &link], &bus);
        told(&real, 0, "a real aircraft on udpin");
        assert!(autopilot.stand_s(4) >= 3);
        let let_go = swap("3", &["--simulated"], &bus);
        told(
            &let_go,
            0,
            "warning: only its pilot flies the real aircraft now",
        );
        told(
            &let_go,
            0,
            "gets the heartbeat until its pilot's own ground station is received",
        );
        autopilot.stand_s(1);
        let after = autopilot.stand_s(4);
        assert!((3..=5).contains(&after), "{after} heartbeats in 4 s");
        if released {
            let ended = swap("3", &["--simulated", "--release"], &bus);
            told(&ended, 0, "the heartbeat to the real aircraft has ended");
        } else {
            autopilot.station = Some(FrameEncoder::new(255, 190));
        }
        autopilot.stand_s(2);
        assert_eq!(autopilot.stand_s(4), 0);
        autopilot.station = None;
    }
    let again = swap("3", &["--simulated", "--release"], &bus);
    told(&again, 1, "vehicle 3 is simulated already");
}

/// Two aircraft send to one port, as on a bench without a router.
fn who_only_listens_needs_no_mission_and_hears_both_aircraft_at_its_port() {
    let udp = UdpSocket::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let text = std::fs::read_to_string(SCENARIO).unwrap();
    let text = ["5", "6"].iter().fold(text, |text, id| {
        let line = format!("id = \"{id}\"");
        let (before, after) = text.split_once(&line).unwrap();
        let kind = ["kind = \"simulated\"", "kind = \"stand-in\""]
            .into_iter()
            .find(|kind| after.lines().take(4).any(|l| l.starts_with(kind)))
            .unwrap();
        let real = format!("kind = \"mavlink\"\nsystem_id = {id}\nlink = \"udpin:{udp}\"");
        format!("{before}{line}{}", after.replacen(kind, &real, 1))
    });
    let scenario = folder.join("two-at-one-port.toml");
    std::fs::write(&scenario, text).unwrap();
    let file = scenario.to_str().unwrap().to_owned();
    let log = folder.join("listening.log");
    let link = format!("udpin:{udp}");
    let arguments = [
        "--scenario",
        &file,
        "--vehicle",
        "5,6",
        "--link",
        &link,
        "--listen-only",
        "--connect",
        "tcp/127.0.0.1:1",
    ];
    let mut bridge = spawn(
        env!("CARGO_BIN_EXE_mav-bridge"),
        &arguments,
        std::fs::File::create(&log).unwrap().into(),
    );
    let to = format!("udpout:{udp}");
    let aircraft = ["5", "6"].map(|id| {
        let arguments = [
            "stand-in",
            "--scenario",
            &file,
            "--vehicle",
            id,
            "--link",
            &to,
        ];
        spawn(env!("CARGO_BIN_EXE_mav-bridge"), &arguments, Stdio::null())
    });
    wait_s(13);
    let said = std::fs::read_to_string(&log).unwrap();
    let interrupted = Command::new("kill")
        .args(["-INT", &bridge.0.id().to_string()])
        .status();
    wait_s(2);
    let ended = bridge.0.try_wait().unwrap();
    drop(aircraft);
    for id in [5, 6] {
        assert!(
            said.contains(&format!("vehicle {id}: ArduPlane found as system {id}")),
            "{said}"
        );
        let line = format!("vehicle {id}: system {id}, component 1, ");
        let line = said.lines().rfind(|l| l.starts_with(&line)).unwrap();
        assert!(line.contains("at 43.4") && line.contains("ppm"), "{line}");
    }
    assert!(interrupted.unwrap().success());
    assert!(
        ended.is_some_and(|status| status.success()),
        "{ended:?}: {said}"
    );
}

crate::runner::tests! {
    RealTime {
        a_hand_back_is_answered_and_the_bridge_stays_until_its_vehicle_is_down,
        a_real_aircraft_takes_the_place_of_a_simulated_one_and_is_not_let_go_in_the_air,
        a_real_aircraft_that_is_let_go_gets_the_heartbeat_until_its_pilots_station_is_there,
        who_only_listens_needs_no_mission_and_hears_both_aircraft_at_its_port,
    }
}
