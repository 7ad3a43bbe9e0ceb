//! A running mission shows its vehicles to FlightGear, fifty packets a second.

use std::net::UdpSocket;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const SCENARIO: &str = "../scenarios/as-pontes.toml";

/// Packets that come within a mission of 4 s.
fn packets(socket: &UdpSocket) -> Vec<Vec<u8>> {
    let end = Instant::now() + Duration::from_secs(30);
    let mut packets = Vec::new();
    let mut buffer = [0; 2048];
    // From the first packet on, silence is the end.
    while Instant::now() < end {
        match socket.recv(&mut buffer) {
            Ok(length) => packets.push(buffer[..length].to_vec()),
            Err(_) if packets.is_empty() => {}
            Err(_) => break,
        }
    }
    packets
}

fn double(packet: &[u8], at: usize) -> f64 {
    f64::from_be_bytes(packet[at..at + 8].try_into().unwrap())
}

/// Field places as in FlightGear's `net_fdm.hxx` version 24: version at 0, longitude, latitude
/// and altitude as doubles from 8 on. `tests/oracle/flightgear_live.py` reads the same stream
/// with pymavlink's fgFDM.
fn simulated_and_real_vehicles_are_shown() {
    let simulated = UdpSocket::bind("127.0.0.1:0").unwrap();
    let real = UdpSocket::bind("127.0.0.1:0").unwrap();
    for socket in [&simulated, &real] {
        socket
            .set_read_timeout(Some(Duration::from_secs(1)))
            .unwrap();
    }
    let show = |id: &str, socket: &UdpSocket| format!("{id}={}", socket.local_addr().unwrap());
    let out = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("flightgear");
    let mut run = Command::new(env!("CARGO_BIN_EXE_plumage"))
        .args(["run", SCENARIO, "--speed", "real", "--duration", "4"])
        .args(["--no-serve", "--force", "--out"])
        .arg(out)
        .args(["--flightgear", &show("1", &simulated)])
        .args(["--flightgear", &show("6", &real)])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let from_simulated = packets(&simulated);
    let from_real = packets(&real);
    assert!(run.wait().unwrap().success());
    // 4 s at 50 Hz; a busy machine may be late with some.
    assert!(
        (20..=210).contains(&from_simulated.len()),
        "{}",
        from_simulated.len()
    );
    for (packets, lat_deg, lon_deg) in [
        (&from_simulated, 43.4300, -7.8420),
        (&from_real, 43.4294, -7.8404),
    ] {
        assert!(!packets.is_empty());
        for packet in packets {
            assert_eq!(packet.len(), 408);
            assert_eq!(packet[..4], [0, 0, 0, 24]);
            assert!((double(packet, 8).to_degrees() - lon_deg).abs() < 2e-3);
            assert!((double(packet, 16).to_degrees() - lat_deg).abs() < 2e-3);
            assert!((330.0..400.0).contains(&double(packet, 24)));
        }
    }
}

fn a_vehicle_that_is_not_there_is_refused() {
    let refused = Command::new(env!("CARGO_BIN_EXE_plumage"))
        .args([
            "run",
            SCENARIO,
            "--no-serve",
            "--flightgear",
            "9=127.0.0.1:5500",
        ])
        .output()
        .unwrap();
    assert_eq!(refused.status.code(), Some(2));
    let told = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        told.contains("no vehicle '9' in this process; expected one of 1, 2"),
        "{told}"
    );
}

crate::runner::tests! {
    RealTime {
        simulated_and_real_vehicles_are_shown,
    }
    Cores {
        a_vehicle_that_is_not_there_is_refused,
    }
}
