//! An autopilot elsewhere flies the aircraft: this test plays the side of ArduPilot's JSON interface.

use fdm::autopilot::{Autopilot, Demand, Path, Sensed};
use fdm::dynamics::{euler, rotation};
use fdm::{Aircraft, SurfaceCommand};
use mav_bridge::wire::FrameDecoder;
use protocol::SimTime;
use serde_json::Value;
use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

const X8: &str = include_str!("../aircraft/x8.toml");
const RATE_HZ: u16 = 50;

/// The running server and the autopilot's socket.
struct Served {
    server: Child,
    socket: UdpSocket,
    count: u32,
}

impl Served {
    fn start(arguments: &[&str]) -> Self {
        // The port is free now and, but for bad luck, when the server takes it.
        let free = UdpSocket::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap();
        let server = Command::new(env!("CARGO_BIN_EXE_plumage"))
            .arg("fdm-server")
            .args(arguments)
            .args(["--ardupilot-json", &free.to_string()])
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(free).unwrap();
        socket
            .set_read_timeout(Some(Duration::from_millis(200)))
            .unwrap();
        let mut served = Self {
            server,
            socket,
            count: 0,
        };
        served.packet([1500, 1500, 1000]);
        served
    }

    /// Sends the next packet and waits for its answer.
    fn packet(&mut self, pulses_us: [u16; 3]) -> Value {
        self.count += 1;
        self.again(pulses_us)
    }

    /// The same without counting on.
    fn again(&mut self, pulses_us: [u16; 3]) -> Value {
        let mut bytes = [18458, RATE_HZ].map(u16::to_le_bytes).concat();
        bytes.extend(self.count.to_le_bytes());
        let outputs = pulses_us.into_iter().chain([0; 13]);
        bytes.extend(outputs.flat_map(u16::to_le_bytes));
        let mut buffer = [0; 4096];
        // A server that has just started does not listen yet: ask again, as ArduPilot does.
        for _ in 0..100 {
            let _ = self.socket.send(&bytes);
            if let Ok(length) = self.socket.recv(&mut buffer) {
                return serde_json::from_slice(&buffer[..length]).unwrap();
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        panic!("no answer");
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

fn three(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|k| value[k].as_f64().unwrap())
}

/// What the autopilot knows after an answer.
fn sensed(answer: &Value) -> Sensed {
    let q = [0, 1, 2, 3].map(|k| answer["quaternion"][k].as_f64().unwrap());
    let [roll_rad, pitch_rad, yaw_rad] = euler(&rotation(&q));
    let [north_m, east_m, down_m] = three(&answer["position"]);
    Sensed {
        north_m,
        east_m,
        alt_amsl_m: -down_m,
        vel_ned_m_s: three(&answer["velocity"]),
        roll_rad,
        pitch_rad,
        yaw_rad,
        rate_rad_s: three(&answer["imu"]["gyro"]),
        airspeed_m_s: answer["airspeed"].as_f64().unwrap(),
        density_kg_m3: 1.18,
        on_ground: false,
    }
}

/// Pulses of ArduPlane's elevon mixer for wished angles: left = elevator - aileron and right = elevator + aileron of
/// its own senses (nose up, roll right), a long pulse being trailing edge up.
fn pulses(command: &SurfaceCommand) -> [u16; 3] {
    let pulse = |down_deg: f64| {
        let part = if down_deg > 0.0 {
            -down_deg / 35.0
        } else {
            -down_deg / 30.0
        };
        (1500.0 + 500.0 * part.clamp(-1.0, 1.0)).round() as u16
    };
    let left = command.elevator_rad + command.aileron_rad;
    let right = command.elevator_rad - command.aileron_rad;
    let throttle = (1000.0 + 1000.0 * command.throttle).round() as u16;
    [
        pulse(left.to_degrees()),
        pulse(right.to_degrees()),
        throttle,
    ]
}

fn an_autopilot_elsewhere_takes_off_circles_and_reads_gas() {
    let gas = UdpSocket::bind("127.0.0.1:0").unwrap();
    gas.set_nonblocking(true).unwrap();
    let to = gas.local_addr().unwrap().to_string();
    let mut served = Served::start(&["../scenarios/as-pontes-steady.toml", "--gas", &to]);

    // On its launcher it stands with its nose up, and its accelerometer shows gravity in that attitude.
    let answer = served.packet([1500, 1500, 1000]);
    let at_rest = sensed(&answer);
    assert!(at_rest.alt_amsl_m.abs() < 1.0);
    let [x, _, z] = three(&answer["imu"]["accel_body"]);
    assert!((x - 9.80665 * at_rest.pitch_rad.sin()).abs() < 1e-6, "{x}");
    assert!((z + 9.80665 * at_rest.pitch_rad.cos()).abs() < 1e-6, "{z}");

    // The same packet again is answered by the same motion.
    assert_eq!(served.again([1500, 1500, 1000]), answer);

    // Full throttle launches it; then it circles at 100 m and 18 m/s.
    let aircraft = Arc::new(Aircraft::from_toml("x8.toml", X8).unwrap());
    let mut autopilot = Autopilot::new(&aircraft);
    let demand = Demand {
        path: Path::Orbit {
            north_m: 0.0,
            east_m: 0.0,
            radius_m: 120.0,
            clockwise: true,
        },
        alt_amsl_m: 100.0,
        airspeed_m_s: 18.0,
    };
    let mut answer = served.packet([1500, 1500, 2000]);
    let (mut off_m, mut speed, mut counted) = (0.0, 0.0, 0.0);
    for step in 0..120 * u32::from(RATE_HZ) {
        let sensed = sensed(&answer);
        let mut wish = pulses(&autopilot.command(0.02, &sensed, &demand));
        if sensed.alt_amsl_m < 20.0 {
            wish[2] = 2000;
        }
        answer = served.packet(wish);
        if step >= 90 * u32::from(RATE_HZ) {
            off_m += sensed.alt_amsl_m - 100.0;
            speed += sensed.airspeed_m_s;
            counted += 1.0;
        }
    }
    assert!((off_m / counted).abs() < 2.0, "{} m off", off_m / counted);
    assert!(
        (speed / counted - 18.0).abs() < 1.0,
        "{} m/s",
        speed / counted
    );
    let time_s = answer["timestamp"].as_f64().unwrap();
    assert!((time_s - f64::from(served.count) / f64::from(RATE_HZ)).abs() < 1e-6);
    // The wind of the scenario blows around it: 8 m/s from 252 degrees at the stack's height, less below.
    let [north, east, _] = three(&answer["velocity_wind"]);
    assert!((2.0..12.0).contains(&north.hypot(east)) && east > 0.0);

    // Its gas sensor speaks as a component of its own, ten times a second.
    let mut decoder = FrameDecoder::new();
    let mut buffer = [0; 2048];
    let mut readings = 0;
    while let Ok(length) = gas.recv(&mut buffer) {
        decoder.push(&buffer[..length]);
        while let Some(frame) = decoder.next_frame(SimTime::ZERO) {
            assert_eq!((frame.system_id(), frame.component_id()), (1, 25));
            assert_eq!(frame.message_id(), 251, "NAMED_VALUE_FLOAT");
            readings += 1;
        }
    }
    // A socket's buffer may be full before all is read.
    assert!(readings > 100, "{readings}");

    // An autopilot that starts anew finds the aircraft at home.
    served.count = 0;
    let anew = sensed(&served.packet([1500, 1500, 1000]));
    assert!(anew.north_m.hypot(anew.east_m) < 0.1 && anew.alt_amsl_m.abs() < 1.0);
}

fn what_is_no_packet_is_not_answered_and_ends_nothing() {
    let mut served = Served::start(&[]);
    for garbage in [&b"hello"[..], &[0; 40], &[0x1a, 0x48, 50, 0]] {
        served.socket.send(garbage).unwrap();
    }
    let mut buffer = [0; 64];
    assert!(served.socket.recv(&mut buffer).is_err());
    served.packet([1500, 1500, 1000]);
}

fn the_servo_parameters_are_those_of_the_layout_and_nothing_to_serve_is_refused() {
    let served = |options: &[&str]| {
        let mut plumage = Command::new(env!("CARGO_BIN_EXE_plumage"));
        plumage.arg("fdm-server").args(options).output().unwrap()
    };
    let text = String::from_utf8(served(&["--print-parameters"]).stdout).unwrap();
    // 77 and 78 are ArduPilot's left and right elevon, 70 its throttle.
    for line in [
        "SERVO1_FUNCTION 77",
        "SERVO2_FUNCTION 78",
        "SERVO3_FUNCTION 70",
    ] {
        assert!(text.lines().any(|l| l == line), "{text}");
    }
    let nothing = served(&[]);
    assert_eq!(nothing.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&nothing.stderr).contains("--ardupilot-json"));
}

crate::runner::tests! {
    Cores {
        an_autopilot_elsewhere_takes_off_circles_and_reads_gas,
        what_is_no_packet_is_not_answered_and_ends_nothing,
        the_servo_parameters_are_those_of_the_layout_and_nothing_to_serve_is_refused,
    }
}
