//! Frames against those of pymavlink 2.4.50: `python tests/oracle/mavlink_frames.py`.

use mav_bridge::dialect::{NAMED_VALUE_FLOAT_DATA, WIND_DATA};
use mav_bridge::signing::SigningConfig;
use mav_bridge::wire::FrameEncoder;
use mav_bridge::{Bridge, BridgeConfig, BridgeOutput};
use protocol::SimTime;
use protocol::message::{PathKind, Setpoint, Severity};

const FRAMES: &str = include_str!("../../../tests/oracle/mavlink_frames.csv");

fn frame(direction: &str, name: &str) -> Vec<u8> {
    let row = FRAMES
        .lines()
        .find(|line| line.starts_with(&format!("{direction},{name},")))
        .unwrap();
    let hex = row.rsplit(',').next().unwrap();
    (0..hex.len() / 2)
        .map(|k| u8::from_str_radix(&hex[2 * k..2 * k + 2], 16).unwrap())
        .collect()
}

/// A frame without its number among those of its sender and the checksum over that.
fn without_number(frame: &[u8]) -> Vec<u8> {
    let mut bytes = frame[..10 + usize::from(frame[1])].to_vec();
    bytes[4] = 0;
    bytes
}

fn s(seconds: f64) -> SimTime {
    SimTime::from_s(seconds)
}

/// A bridge that has heard pymavlink's ArduPlane in GUIDED, and what came of it.
fn connected() -> (Bridge, BridgeOutput) {
    let mut bridge = Bridge::new(BridgeConfig {
        may_arm: true,
        vehicle_system_id: Some(1),
        ..BridgeConfig::default()
    })
    .unwrap();
    let mut out = BridgeOutput::default();
    for line in FRAMES.lines().filter(|l| l.starts_with("from-vehicle,")) {
        let name = line.split(',').nth(1).unwrap();
        bridge.receive(&frame("from-vehicle", name), s(0.0), &mut out);
    }
    (bridge, out)
}

#[test]
fn state_and_reading_of_pymavlinks_frames() {
    let (bridge, out) = connected();
    let state = out.state.unwrap();
    assert_eq!(
        (state.lat_deg, state.lon_deg, state.alt_amsl_m),
        (43.4417, -7.8631, 650.25)
    );
    assert_eq!(state.vel_ned_m_s, [-2.0, -21.0, 0.5]);
    assert!((state.roll_deg - 14.323_945).abs() < 1e-5);
    assert!((state.pitch_deg + 2.864_789).abs() < 1e-5);
    assert!((state.heading_deg - 270.0).abs() < 1e-4);
    assert!((state.throttle - 0.55).abs() < 1e-9 && state.airborne);
    // numpy: T = 288.15 - .0065*650.25; rho = 93750/(287.05287*T); 17.5*sqrt(1.225/rho) = 18.0593
    assert!((state.airspeed_m_s - 18.0593).abs() < 1e-3, "{state:?}");
    let reading = out.readings.last().unwrap();
    assert_eq!(reading.co2_ppm, 512.5);
    assert_eq!(reading.wind_speed_m_s, Some(8.25));
    assert_eq!(reading.wind_from_deg, Some(252.0));
    assert_eq!(reading.temperature_c, Some(15.25));
    assert_eq!(reading.pressure_hpa, Some(937.5));
    let said = |code: &str| out.events.iter().find(|e| e.code == code);
    assert!(said("failsafe-off").is_some());
    assert_eq!(said("vehicle-says").unwrap().text, "GCS Failsafe On");
    assert_eq!(said("vehicle-says").unwrap().severity, Severity::Warning);
    assert_eq!(out.frames_from_vehicle.len(), 13);
    let statistics = bridge.statistics();
    assert_eq!((statistics.frames, statistics.bad_frames), (13, 0));
    assert_eq!((statistics.lost_frames, statistics.skipped_bytes), (0, 0));
}

/// What an ArduCopter 4.7.0-dev in software tells in a wind of 5.6 m/s with its default of no estimate.
#[test]
fn a_wind_of_zero_is_none() {
    let (mut bridge, mut out) = connected();
    let mut vehicle = FrameEncoder::new(1, 1);
    let wind = WIND_DATA {
        direction: -180.0,
        speed: 0.0,
        speed_z: 0.0,
    };
    bridge.receive(&vehicle.encode(&wind, None, s(0.1)), s(0.1), &mut out);
    let reading = NAMED_VALUE_FLOAT_DATA {
        time_boot_ms: 60_100,
        value: 500.0,
        name: "CO2".into(),
    };
    bridge.receive(&vehicle.encode(&reading, None, s(0.1)), s(0.1), &mut out);
    let reading = out.readings.last().unwrap();
    assert_eq!((reading.co2_ppm, reading.wind_speed_m_s), (500.0, None));
    assert_eq!(reading.wind_from_deg, None);
}

#[test]
fn commands_as_pymavlink_writes_them() {
    let (mut bridge, _) = connected();
    let setpoint = Setpoint {
        path: PathKind::GoTo,
        lat_deg: 43.4417,
        lon_deg: -7.8631,
        alt_amsl_m: 700.0,
        airspeed_m_s: 18.0,
        orbit_radius_m: 120.0,
    };
    let mut out = BridgeOutput::default();
    bridge.setpoint(&setpoint, s(0.02), &mut out);
    bridge.tick(s(0.02), &mut out);
    let sent: Vec<Vec<u8>> = out
        .frames_to_vehicle
        .iter()
        .map(|f| without_number(f))
        .collect();
    for name in ["heartbeat", "rate", "reposition", "read"] {
        let golden = frame("to-vehicle", name);
        let golden = without_number(&golden);
        assert!(
            sent.contains(&golden),
            "{name}: {golden:02x?} is not in {sent:02x?}"
        );
    }
    // The first frame of the bridge has number 0, as pymavlink's: equal to the last bit.
    assert_eq!(out.frames_to_vehicle[0], frame("to-vehicle", "heartbeat"));
    // param2, the speed, is the equivalent airspeed of 18 m/s true; all else is golden.
    let mut speed = without_number(&frame("to-vehicle", "speed"));
    // numpy: rho at 700 m ISA with 937.5 hPa: 18*sqrt(rho/1.225) = 17.4524
    let sent_speed = sent
        .iter()
        .find(|f| f.len() > 40 && f[38..40] == speed[38..40]);
    let sent_speed = sent_speed.unwrap();
    let value = f32::from_le_bytes(sent_speed[14..18].try_into().unwrap());
    assert!((value - 17.4524).abs() < 1e-3, "{value}");
    speed[14..18].copy_from_slice(&sent_speed[14..18]);
    assert_eq!(sent_speed, &speed);
    // Landing.
    let land = Setpoint {
        path: PathKind::Land,
        ..setpoint
    };
    let mut out = BridgeOutput::default();
    bridge.setpoint(&land, s(0.04), &mut out);
    bridge.tick(s(0.04), &mut out);
    let mut sent = out.frames_to_vehicle.iter().map(|f| without_number(f));
    let golden = without_number(&frame("to-vehicle", "land"));
    assert!(sent.any(|f| f == golden));
}

#[test]
fn signed_as_pymavlink_signs() {
    let mut bridge = Bridge::new(BridgeConfig {
        signing: Some(SigningConfig {
            key: std::array::from_fn(|k| k as u8),
            link_id: 3,
            epoch_10us: 36_999_999_999_999,
        }),
        ..BridgeConfig::default()
    })
    .unwrap();
    let mut out = BridgeOutput::default();
    bridge.tick(s(0.0), &mut out);
    let sent = &out.frames_to_vehicle[0];
    let golden = frame("to-vehicle", "signed_heartbeat");
    assert_eq!(without_number(sent), without_number(&golden));
    assert_eq!(sent.len(), golden.len());
    // pymavlink's own signed frame is taken, once; an unsigned one and a forged one are not.
    let signed = frame("from-vehicle", "signed_heartbeat");
    let mut forged = signed.clone();
    let last = forged.len() - 1;
    forged[last] ^= 1;
    bridge.receive(&forged, s(0.1), &mut out);
    bridge.receive(&frame("from-vehicle", "heartbeat"), s(0.1), &mut out);
    assert_eq!(bridge.statistics().refused_frames, 2);
    assert!(!out.events.iter().any(|e| e.code == "connected"));
    bridge.receive(&signed, s(0.1), &mut out);
    assert_eq!(bridge.statistics().refused_frames, 2);
    assert!(out.events.iter().any(|e| e.code == "connected"));
    bridge.receive(&signed, s(0.1), &mut out);
    assert_eq!(bridge.statistics().refused_frames, 3, "replayed");
}
