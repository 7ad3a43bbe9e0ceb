//! Clients that are not ours fly the stand-in over UDP, in real time: ignored, with the reason, where
//! they are not installed.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

use libtest_mimic::{Arguments, Completion, Failed, Trial};
use std::net::UdpSocket;
use std::process::{Child, Command, ExitCode, Stdio};

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

fn flies_by(client: &str, module: &str) -> Result<Completion, Failed> {
    if !installed(module) {
        let reason = format!("needs a python3 with {module} (pip install {client})");
        return Ok(Completion::ignored_with(reason));
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
    Ok(Completion::Completed)
}

fn main() -> ExitCode {
    let trials = vec![
        Trial::ignorable_test("pymavlink_flies_the_stand_in", || {
            flies_by("pymavlink", "pymavlink.mavutil")
        }),
        // The module of version 4; earlier ones had another interface.
        Trial::ignorable_test("mavsdk_flies_the_stand_in", || {
            flies_by("mavsdk", "mavsdk.asyncio")
        }),
    ];
    libtest_mimic::run(&Arguments::from_args(), trials).exit_code()
}
