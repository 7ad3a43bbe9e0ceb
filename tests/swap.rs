//! Another aircraft takes a vehicle's place while a mission of processes runs.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

use std::net::{TcpListener, UdpSocket};
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

fn spawn(path: &str, arguments: &[&str]) -> Ends {
    let mut command = Command::new(path);
    let command = command.args(arguments).stdin(Stdio::piped());
    Ends(command.stderr(Stdio::null()).spawn().unwrap())
}

fn swap(options: &[&str], bus: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_plumage"))
        .args(["swap", "3"])
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

#[test]
fn a_real_aircraft_takes_the_place_of_a_simulated_one_and_is_not_let_go_in_the_air() {
    let free = "127.0.0.1:0";
    let tcp = TcpListener::bind(free).unwrap().local_addr().unwrap();
    let udp = UdpSocket::bind(free).unwrap().local_addr().unwrap();
    let endpoint = format!("tcp/{tcp}");
    let mission = ["--scenario", SCENARIO, "--duration", "300"];
    let bus = [&mission[..], &["--connect", &endpoint]].concat();
    let listen = [&mission[..], &["--listen", &endpoint]].concat();
    let _sc = spawn(env!("CARGO_BIN_EXE_sc"), &listen);
    let _ws = spawn(env!("CARGO_BIN_EXE_ws"), &bus);
    let team = [&bus[..], &["--vehicles", "2,3"]].concat();
    let _va = spawn(env!("CARGO_BIN_EXE_va"), &team);

    told(
        &swap(&["--simulated"], &bus),
        1,
        "vehicle 3 is simulated already",
    );
    told(
        &swap(&["--real", "udpin:256.0.0.1:9"], &bus),
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
    let _aircraft = spawn(env!("CARGO_BIN_EXE_mav-bridge"), &stand_in);
    let link = format!("udpin:{udp}");
    let made = swap(&["--real", &link, "--may-arm"], &bus);
    told(&made, 0, &format!("a real aircraft on {link} from now on"));
    told(
        &swap(&["--real", &link], &bus),
        1,
        "vehicle 3 is real already",
    );

    // It takes off in its turn; from then on a simulated one is refused: nobody would have the real one.
    std::thread::sleep(Duration::from_secs(25));
    told(
        &swap(&["--simulated"], &bus),
        1,
        "in the air and nobody flies it",
    );
}
