//! One vehicle over two links: what is heard over either counts once, and losing one loses nothing.

use mav_bridge::arduplane::{FBWA, GUIDED};
use mav_bridge::dialect::{
    ATTITUDE_DATA, GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavState,
    MavType, NAMED_VALUE_FLOAT_DATA, STATUSTEXT_DATA, VFR_HUD_DATA,
};
use mav_bridge::wire::{FrameEncoder, MessageData};
use mav_bridge::{Bridge, BridgeConfig, BridgeOutput, goes_over_all_links};
use protocol::SimTime;
use protocol::message::{ControlLevel, PathKind, Reading, Setpoint};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};

/// Share of the frames that each link loses.
const LOSS: f64 = 0.3;
/// How long is flown, s; ten readings a second.
const FLIGHT_S: u32 = 300;

/// A vehicle on two radios, each of which numbers its frames for itself, as ArduPilot's ports do.
struct Flight {
    bridge: Bridge,
    ports: [FrameEncoder; 2],
    up: [bool; 2],
    loss: f64,
    mode: u32,
    rng: ChaCha8Rng,
    time_s: f64,
    readings: Vec<Reading>,
    events: Vec<String>,
    /// Link and frame of what was sent.
    sent: Vec<(usize, Vec<u8>)>,
}

impl Flight {
    fn new(loss: f64) -> Self {
        let config = BridgeConfig {
            vehicle_system_id: Some(1),
            ..BridgeConfig::default()
        };
        Self {
            bridge: Bridge::new(config).unwrap(),
            ports: [FrameEncoder::new(1, 1), FrameEncoder::new(1, 1)],
            up: [true; 2],
            loss,
            mode: GUIDED,
            rng: ChaCha8Rng::seed_from_u64(5),
            time_s: 0.0,
            readings: Vec::new(),
            events: Vec::new(),
            sent: Vec::new(),
        }
    }

    /// Sends `message` over both radios; what arrives.
    fn say<D: MessageData>(&mut self, message: &D, out: &mut BridgeOutput) {
        let now = SimTime::from_s(self.time_s);
        for link in 0..2 {
            let frame = self.ports[link].encode(message, None, now);
            let arrives = self.rng.random::<f64>() >= self.loss;
            if self.up[link] && arrives {
                self.bridge.receive_over(link, &frame, now, out);
            }
        }
    }

    /// A tenth of a second; each reading is sent `times` times, a tenth of a second apart.
    fn tick(&mut self, k: u32, times: u32) {
        let mut out = BridgeOutput::default();
        let boot_ms = |k: u32| 10_000 + 100 * k;
        if k.is_multiple_of(10) {
            self.say(&heartbeat(self.mode), &mut out);
        }
        let position = GLOBAL_POSITION_INT_DATA {
            time_boot_ms: boot_ms(k),
            lat: 434_400_000 + 180 * k as i32, // 20 m/s north
            lon: -78_600_000,
            alt: 650_000,
            relative_alt: 310_000,
            vx: 2000,
            ..GLOBAL_POSITION_INT_DATA::default()
        };
        self.say(&position, &mut out);
        self.say(
            &ATTITUDE_DATA {
                time_boot_ms: boot_ms(k),
                ..ATTITUDE_DATA::default()
            },
            &mut out,
        );
        self.say(
            &VFR_HUD_DATA {
                airspeed: 18.0,
                ..VFR_HUD_DATA::default()
            },
            &mut out,
        );
        for before in (0..times).filter(|before| *before <= k) {
            let read = k - before;
            let gas = NAMED_VALUE_FLOAT_DATA {
                time_boot_ms: boot_ms(read),
                value: 400.0 + (read % 1000) as f32 / 10.0,
                name: "CO2".into(),
            };
            self.say(&gas, &mut out);
        }
        let now = SimTime::from_s(self.time_s);
        self.bridge.tick(now, &mut out);
        let best = self.bridge.best_link(now);
        for frame in out.frames_to_vehicle {
            for link in 0..2 {
                if link == best || goes_over_all_links(&frame) {
                    self.sent.push((link, frame.clone()));
                }
            }
        }
        self.readings.extend(out.readings);
        self.events.extend(out.events.into_iter().map(|e| e.code));
        self.time_s += 0.1;
    }

    fn said(&self, code: &str) -> usize {
        self.events.iter().filter(|e| *e == code).count()
    }
}

fn heartbeat(custom_mode: u32) -> HEARTBEAT_DATA {
    HEARTBEAT_DATA {
        custom_mode,
        mavtype: MavType::MAV_TYPE_FIXED_WING,
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        base_mode: MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            | MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED,
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: 3,
    }
}

/// Share of the readings that did not come, and whether each that came is where and when it was read.
fn lost(times: u32) -> f64 {
    let mut flight = Flight::new(LOSS);
    let count = 10 * FLIGHT_S;
    for k in 0..count {
        flight.tick(k, times);
    }
    for reading in &flight.readings {
        let read = (reading.lat_deg - 43.44) / 1.8e-5;
        assert!(
            (read - read.round()).abs() < 0.1,
            "between two readings: {read}"
        );
        let ppm = 400.0 + (read.round() as u32 % 1000) as f64 / 10.0;
        assert!((reading.co2_ppm - ppm).abs() < 1e-4, "{reading:?}");
    }
    assert_eq!(flight.said("link-lost"), 0);
    1.0 - flight.readings.len() as f64 / f64::from(count)
}

/// Two links that lose three of ten each lose 0.3² together: 9 % ± 0.5 % of 3000. With every reading sent three
/// times 0.3⁶: 0.07 %.
#[test]
fn two_links_lose_what_chance_leaves_and_a_sensor_that_repeats_itself_next_to_nothing() {
    let once = lost(1);
    assert!((once - 0.09).abs() < 0.02, "{once}");
    let thrice = lost(3);
    assert!(thrice < 0.005, "{thrice}");
}

#[test]
fn losing_either_link_loses_nothing() {
    for dies in 0..2 {
        let mut flight = Flight::new(0.0);
        for k in 0..900 {
            // One after the other: first both, then one, then both, then the other.
            flight.up[dies] = !(300..500).contains(&k);
            flight.up[1 - dies] = !(700..900).contains(&k);
            flight.tick(k, 1);
        }
        assert_eq!(flight.readings.len(), 900);
        assert_eq!((flight.said("link-lost"), flight.said("restarted")), (0, 0));
        assert_eq!(flight.bridge.level(), ControlLevel::Automatic);
    }
}

#[test]
fn commands_go_over_the_link_that_is_heard() {
    let mut flight = Flight::new(0.0);
    let setpoint = |k: u32| Setpoint {
        path: PathKind::GoTo,
        lat_deg: 43.5 + f64::from(k) * 1e-4,
        lon_deg: -7.86,
        alt_amsl_m: 700.0,
        airspeed_m_s: 18.0,
        orbit_radius_m: 80.0,
    };
    for k in 0..400 {
        flight.up = [k < 200, true];
        if k % 50 == 0 {
            let now = SimTime::from_s(flight.time_s);
            flight
                .bridge
                .setpoint(&setpoint(k), now, &mut BridgeOutput::default());
        }
        flight.tick(k, 1);
        if k == 230 {
            flight.sent.clear();
        }
    }
    let beats = |link: usize| {
        flight
            .sent
            .iter()
            .filter(|(l, f)| *l == link && f[7] == 0)
            .count()
    };
    assert!(
        beats(0) >= 16 && beats(0) == beats(1),
        "heartbeats over both"
    );
    let repositions = |link: usize| {
        let is = |f: &[u8]| f[7] == 75 && f[38] == 192;
        flight
            .sent
            .iter()
            .filter(|(l, f)| *l == link && is(f))
            .count()
    };
    assert!(repositions(0) == 0 && repositions(1) > 0);
}

/// The slower link shows the mode that the vehicle has left: that is no pilot's.
#[test]
fn a_late_heartbeat_is_no_takeover_and_a_real_one_is_seen() {
    let mut flight = Flight::new(0.0);
    flight.mode = FBWA;
    for k in 0..20 {
        flight.tick(k, 1);
    }
    assert_eq!(flight.bridge.level(), ControlLevel::Pilot);
    flight.bridge.hand_back(&mut BridgeOutput::default());
    flight.mode = GUIDED;
    for k in 20..25 {
        flight.tick(k, 1);
    }
    assert_eq!(flight.bridge.level(), ControlLevel::Automatic);
    let now = SimTime::from_s(flight.time_s);
    let late = flight.ports[1].encode(&heartbeat(FBWA), None, now);
    flight
        .bridge
        .receive_over(1, &late, now, &mut BridgeOutput::default());
    assert_eq!(flight.bridge.level(), ControlLevel::Automatic);
    for k in 25..40 {
        flight.tick(k, 1);
    }
    flight.mode = FBWA;
    for k in 40..60 {
        flight.tick(k, 1);
    }
    assert_eq!(flight.bridge.level(), ControlLevel::Pilot);
}

#[test]
fn a_text_over_both_links_is_said_once() {
    let mut flight = Flight::new(0.0);
    flight.tick(0, 1);
    let mut out = BridgeOutput::default();
    let text = STATUSTEXT_DATA {
        text: "Throttle armed".into(),
        ..STATUSTEXT_DATA::default()
    };
    flight.say(&text, &mut out);
    let said = |out: &BridgeOutput| {
        let events = out.events.iter();
        events.filter(|e| e.code == "vehicle-says").count()
    };
    assert_eq!(said(&out), 1);
    // One link may be two texts behind the other. What is said again is counted when their time is over.
    let mut out = BridgeOutput::default();
    let now = SimTime::from_s(flight.time_s);
    for link in 0..2 {
        for words in ["Battery 1 is low", "Failsafe", "RTL"] {
            let text = STATUSTEXT_DATA {
                text: words.into(),
                ..STATUSTEXT_DATA::default()
            };
            let frame = flight.ports[link].encode(&text, None, now);
            flight.bridge.receive_over(link, &frame, now, &mut out);
        }
    }
    assert_eq!(said(&out), 3);
    let mut out = BridgeOutput::default();
    for s in [5.0, 15.0] {
        flight
            .bridge
            .tick(SimTime::from_s(flight.time_s + s), &mut out);
    }
    assert_eq!(said(&out), 0, "{:?}", out.events);
}
