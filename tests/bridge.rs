//! A real vehicle in a mission of processes: its hand-back is answered, and its bridge stays until it is down.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

use std::io::Read as _;
use std::net::{TcpListener, UdpSocket};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

const SCENARIO: &str = "../scenarios/as-pontes-steady.toml";

/// A process that ends with the test.
struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

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

#[test]
fn a_hand_back_is_answered_and_the_bridge_stays_until_its_vehicle_is_down() {
    let free = |port: u16| format!("127.0.0.1:{port}");
    let tcp = TcpListener::bind(free(0)).unwrap().local_addr().unwrap();
    let udp = UdpSocket::bind(free(0)).unwrap().local_addr().unwrap();
    let endpoint = format!("tcp/{tcp}");
    let mission = ["--scenario", SCENARIO, "--duration", "28"];
    let bus = [&mission[..], &["--connect", &endpoint]].concat();
    let log = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bridge.log");
    let _sc = spawn(
        env!("CARGO_BIN_EXE_sc"),
        &[&mission[..], &["--listen", &endpoint]].concat(),
        Stdio::null(),
    );
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
    assert!(told.contains("va/6: hand-back refused: no link"), "{told}");
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
    assert!(told.contains("va/6: hand-back without effect"), "{told}");
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
    assert!(said().contains("left to its own failsafe"), "{}", said());
}
