//! A real vehicle in a mission of processes: its hand-back is answered, its bridge stays until it is down, and it takes
//! the place of a simulated one.

use crate::program::Ends;
use std::io::Read as _;
use std::net::{TcpListener, UdpSocket};
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
    let free = "127.0.0.1:0";
    let tcp = TcpListener::bind(free).unwrap().local_addr().unwrap();
    let udp = UdpSocket::bind(free).unwrap().local_addr().unwrap();
    let endpoint = format!("tcp/{tcp}");
    let mission = ["--scenario", SCENARIO, "--duration", "300"];
    let bus = [&mission[..], &["--connect", &endpoint]].concat();
    let listen = [&mission[..], &["--listen", &endpoint]].concat();
    let _sc = spawn(env!("CARGO_BIN_EXE_sc"), &listen, Stdio::null());
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
    let nobody = UdpSocket::bind(free).unwrap().local_addr().unwrap();
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

crate::runner::tests! {
    RealTime {
        a_hand_back_is_answered_and_the_bridge_stays_until_its_vehicle_is_down,
        a_real_aircraft_takes_the_place_of_a_simulated_one_and_is_not_let_go_in_the_air,
    }
}
