//! Clients that are not ours fly the stand-in over UDP, in real time. Left out, with a word, where
//! they are not installed.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};

const SCENARIO: &str = "../scenarios/as-pontes.toml";
const SCRIPT: &str = "../tests/oracle/mavlink_clients.py";

/// A process that ends with its owner.
struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn installed(module: &str) -> bool {
    let import = format!("import {module}");
    let python = Command::new("python3")
        .args(["-c", &import])
        .stderr(Stdio::null())
        .status();
    python.is_ok_and(|status| status.success())
}

fn flies_by(client: &str, module: &str) {
    if !installed(module) {
        eprintln!("left out: python3 has no {module} (pip install {client})");
        return;
    }
    let free = UdpSocket::bind("127.0.0.1:0").unwrap();
    let port = free.local_addr().unwrap().port().to_string();
    drop(free);
    let link = format!("udpout:127.0.0.1:{port}");
    let stand_in = Command::new(env!("CARGO_BIN_EXE_mav-bridge"))
        .args(["stand-in", "--scenario", SCENARIO, "--vehicle", "6"])
        .args(["--hands-off", "--duration", "300", "--link", &link])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let _stand_in = Ends(stand_in);
    let said = Command::new("python3")
        .args([SCRIPT, client, &port])
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(
        said.status.success(),
        "{}{}",
        text(&said.stdout),
        text(&said.stderr)
    );
}

#[test]
fn pymavlink_flies_the_stand_in() {
    flies_by("pymavlink", "pymavlink.mavutil");
}

/// The module of version 4; earlier ones had another interface.
#[test]
fn mavsdk_flies_the_stand_in() {
    flies_by("mavsdk", "mavsdk.asyncio");
}
