//! Bridge and stand-in in one closed loop, in virtual time.
#![allow(clippy::unwrap_used)]

use air::geo::Enu;
use fdm::control_level::{Danger, Event, Level};
use mav_bridge::arduplane::{FBWA, GUIDED, RTL};
use mav_bridge::{Bridge, BridgeConfig, BridgeOutput};
use protocol::SimTime;
use protocol::message::{EventMessage, PathKind, Reading, Setpoint, State};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use scenario::Scenario;
use stand_in::{StandIn, StandInConfig, Sticks};

const TICK_NS: i64 = 20_000_000;
const X8: &str = include_str!("../../../aircraft/x8.toml");
const AS_PONTES: &str = include_str!("../../../scenarios/as-pontes.toml");
/// Sticks that hold a gentle right turn.
const TURN: Sticks = Sticks {
    roll: 0.4,
    pitch: 0.0,
    throttle: 0.6,
};

fn scenario() -> Scenario {
    Scenario::parse("as-pontes.toml", AS_PONTES).unwrap()
}

fn stand_in_config() -> StandInConfig {
    let aircraft = fdm::Aircraft::from_toml("x8.toml", X8).unwrap();
    StandInConfig::from_scenario(&scenario(), 5, aircraft).unwrap()
}

/// What the link does to the bytes of one direction at a tick.
type Link = fn(tick: u64, Vec<Vec<u8>>) -> Vec<Vec<u8>>;

struct Pair {
    bridge: Bridge,
    vehicle: StandIn,
    tick: u64,
    to_vehicle: Vec<Vec<u8>>,
    up: Link,
    down: Link,
    state: Option<State>,
    readings: Vec<Reading>,
    events: Vec<EventMessage>,
    setpoint: Option<Setpoint>,
    sent: Vec<Vec<u8>>,
    received: Vec<Vec<u8>>,
}

impl Pair {
    fn new(seed: u64) -> Self {
        Self::with(stand_in_config(), seed)
    }

    fn with(config: StandInConfig, seed: u64) -> Self {
        let bridge = BridgeConfig {
            atmosphere: scenario().atmosphere().unwrap(),
            may_arm: true,
            signing: config.signing.clone(),
            ..BridgeConfig::default()
        };
        Self {
            bridge: Bridge::new(bridge).unwrap(),
            vehicle: StandIn::new(config, ChaCha8Rng::seed_from_u64(seed)).unwrap(),
            tick: 0,
            to_vehicle: Vec::new(),
            up: |_, frames| frames,
            down: |_, frames| frames,
            state: None,
            readings: Vec::new(),
            events: Vec::new(),
            setpoint: None,
            sent: Vec::new(),
            received: Vec::new(),
        }
    }

    fn now(&self) -> SimTime {
        SimTime::of_tick(self.tick, TICK_NS)
    }

    fn step(&mut self) {
        let now = self.now();
        let up = (self.up)(self.tick, std::mem::take(&mut self.to_vehicle));
        let from = self.vehicle.step(now, &up);
        let from = (self.down)(self.tick, from);
        let mut out = BridgeOutput::default();
        for bytes in &from {
            self.bridge.receive(bytes, now, &mut out);
        }
        if let Some(setpoint) = &self.setpoint {
            self.bridge.setpoint(setpoint, now, &mut out);
        }
        self.bridge.tick(now, &mut out);
        self.state = out.state.or(self.state.take());
        self.readings.extend(out.reading);
        self.events.extend(out.events);
        self.sent.extend(out.frames_to_vehicle.iter().cloned());
        self.received.extend(out.frames_from_vehicle);
        self.to_vehicle = out.frames_to_vehicle;
        self.tick += 1;
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds * 50.0).round() as u64 {
            self.step();
        }
    }

    fn hand_back(&mut self) {
        let mut out = BridgeOutput::default();
        self.bridge.hand_back(&mut out);
        self.events.extend(out.events);
    }

    fn said(&self, code: &str) -> usize {
        self.events.iter().filter(|e| e.code == code).count()
    }

    /// Runs until the bridge reports GUIDED.
    fn take_off(&mut self) {
        self.setpoint = Some(setpoint(PathKind::TakeOff, -1000.0, 500.0, 650.0));
        for _ in 0..120 {
            self.run(1.0);
            if self.said("guided") > 0 {
                return;
            }
        }
        panic!("no GUIDED within 120 s: {:#?}", self.events);
    }

    /// Horizontal distance of the real vehicle from the setpoint, m.
    fn distance_m(&self) -> f64 {
        let truth = self.vehicle.truth();
        let at = Enu {
            east_m: truth.east_m,
            north_m: truth.north_m,
        };
        let target = self.setpoint.as_ref().unwrap();
        at.distance_m(scenario().frame().unwrap().to_enu(air::geo::Geodetic {
            lat_deg: target.lat_deg,
            lon_deg: target.lon_deg,
        }))
    }
}

/// A setpoint north and east of the stack.
fn setpoint(path: PathKind, north_m: f64, east_m: f64, alt_amsl_m: f64) -> Setpoint {
    let at = scenario()
        .frame()
        .unwrap()
        .to_geodetic(Enu { east_m, north_m });
    Setpoint {
        path,
        lat_deg: at.lat_deg,
        lon_deg: at.lon_deg,
        alt_amsl_m,
        airspeed_m_s: 18.0,
        orbit_radius_m: 100.0,
    }
}

#[test]
fn takes_off_and_obeys_setpoints() {
    let mut pair = Pair::new(1);
    pair.take_off();
    pair.setpoint = Some(setpoint(PathKind::GoTo, -800.0, 1800.0, 700.0));
    pair.run(180.0);
    assert_eq!(pair.bridge.level(), Level::Automatic);
    let off = (pair.distance_m() - 100.0).abs();
    assert!(off < 40.0, "orbits {off} m off its circle");
    let truth = pair.vehicle.truth();
    assert!((truth.alt_amsl_m - 700.0).abs() < 15.0, "{truth:?}");
    // What the team hears is what happens, to the errors of satellite navigation.
    let state = pair.state.clone().unwrap();
    assert!(state.airborne);
    assert!((state.alt_amsl_m - truth.alt_amsl_m).abs() < 6.0);
    assert!((state.roll_deg - truth.roll_rad.to_degrees()).abs() < 5.0);
    // GUIDED was asked for once.
    assert_eq!(guided_commands(&pair.sent), 1);
}

#[test]
fn airspeed_is_true_airspeed_on_both_sides() {
    let mut config = stand_in_config();
    config.turbulence_intensity = 0.0;
    let mut pair = Pair::with(config, 2);
    pair.take_off();
    for speed in [16.0, 20.0] {
        let mut fast = setpoint(PathKind::GoTo, -3000.0, 4000.0, 650.0);
        fast.airspeed_m_s = speed;
        pair.setpoint = Some(fast);
        pair.run(60.0);
        let (mut heard, mut flown) = (0.0, 0.0);
        for _ in 0..500 {
            pair.step();
            heard += pair.state.as_ref().unwrap().airspeed_m_s / 500.0;
            flown += pair.vehicle.truth().airspeed_m_s / 500.0;
        }
        assert!((flown - speed).abs() < 0.3, "flown {flown}, asked {speed}");
        assert!((heard - flown).abs() < 0.15, "heard {heard}, flown {flown}");
    }
}

#[test]
fn readings_come_at_10_hz_with_place_and_wind() {
    let mut pair = Pair::new(3);
    pair.take_off();
    pair.readings.clear();
    pair.run(60.0);
    assert!((595..=605).contains(&pair.readings.len()));
    let last = pair.readings.last().unwrap();
    let truth = pair.vehicle.truth();
    let at = scenario().frame().unwrap().to_enu(air::geo::Geodetic {
        lat_deg: last.lat_deg,
        lon_deg: last.lon_deg,
    });
    let off = at.distance_m(Enu {
        east_m: truth.east_m,
        north_m: truth.north_m,
    });
    assert!(off < 6.0, "reading placed {off} m away");
    // The reality's wind, 252 degrees, not the scenario's 240; its height law is the same.
    let mean = |f: fn(&Reading) -> f64| {
        pair.readings.iter().map(f).sum::<f64>() / pair.readings.len() as f64
    };
    let from = mean(|r| r.wind_from_deg.unwrap());
    assert!((from - 252.0).abs() < 10.0, "wind from {from}");
    let height = truth.alt_amsl_m - 340.0;
    let expected = 8.0 * (height / 486.0_f64).powf(0.15);
    let speed = mean(|r| r.wind_speed_m_s.unwrap());
    assert!((speed - expected).abs() < 1.5, "wind {speed}, {expected}");
    assert!((mean(|r| r.co2_ppm) - 446.0).abs() < 3.0);
    assert!(last.temperature_c.is_some() && last.pressure_hpa.is_some());
}

#[test]
fn pilot_takes_over_and_hands_back() {
    let mut pair = Pair::new(4);
    pair.take_off();
    pair.run(10.0);
    assert!(pair.vehicle.pilot(FBWA, TURN));
    pair.run(2.0);
    assert_eq!(pair.bridge.level(), Level::Pilot);
    assert_eq!(pair.said("pilot-takeover"), 1);
    // New setpoints are withheld and reported; nothing that steers goes out.
    pair.sent.clear();
    pair.events.clear();
    for k in 0..5 {
        pair.setpoint = Some(setpoint(
            PathKind::GoTo,
            -900.0,
            f64::from(k) * 100.0,
            650.0,
        ));
        pair.run(4.0);
    }
    assert_eq!(pair.said("setpoint-ignored"), 5);
    assert_eq!(steering_commands(&pair.sent), 0);
    // Explicit hand-back: GUIDED is asked for once, setpoints go through again.
    let north_m = pair.vehicle.truth().north_m;
    pair.setpoint = Some(setpoint(PathKind::GoTo, north_m, 1500.0, 650.0));
    pair.hand_back();
    pair.run(120.0);
    assert_eq!(pair.bridge.level(), Level::Automatic);
    assert_eq!(guided_commands(&pair.sent), 1);
    assert!((pair.distance_m() - 100.0).abs() < 40.0);
}

#[test]
fn lost_link_brings_it_home() {
    let mut pair = Pair::new(5);
    pair.take_off();
    pair.setpoint = Some(setpoint(PathKind::GoTo, -500.0, 2500.0, 700.0));
    pair.run(40.0);
    // Both directions go silent.
    pair.up = |_, _| Vec::new();
    pair.down = |_, _| Vec::new();
    pair.run(200.0);
    assert_eq!(pair.bridge.level(), Level::Guardian);
    assert_eq!(pair.said("link-lost"), 1);
    let truth = pair.vehicle.truth();
    let home = scenario().home(5).unwrap();
    let home = scenario().frame().unwrap().to_enu(home);
    let at = Enu {
        east_m: truth.east_m,
        north_m: truth.north_m,
    };
    assert!(at.distance_m(home) < 250.0, "{} m", at.distance_m(home));
    assert!((truth.alt_amsl_m - 440.0).abs() < 20.0);
    // The link comes back: it stays with the Guardian until handed back.
    pair.up = |_, frames| frames;
    pair.down = |_, frames| frames;
    pair.sent.clear();
    pair.run(20.0);
    assert_eq!(pair.bridge.level(), Level::Guardian);
    assert_eq!(pair.said("link-restored"), 1);
    assert_eq!(steering_commands(&pair.sent), 0);
    pair.hand_back();
    pair.run(150.0);
    assert_eq!(pair.bridge.level(), Level::Automatic);
    assert!((pair.distance_m() - 100.0).abs() < 40.0);
}

#[test]
fn after_a_short_silence_it_comes_home_until_handed_back() {
    let mut pair = Pair::new(6);
    pair.take_off();
    pair.run(20.0);
    pair.down = |_, _| Vec::new();
    pair.run(7.0);
    assert_eq!(pair.bridge.level(), Level::Guardian);
    // Too short for the vehicle's own failsafe: the bridge sends it home when it hears it again.
    pair.down = |_, frames| frames;
    pair.sent.clear();
    pair.run(10.0);
    assert_eq!(pair.bridge.level(), Level::Guardian);
    assert_eq!(pair.bridge.control().dangers().count(), 0);
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    assert_eq!(steering_commands(&pair.sent), 1);
    pair.hand_back();
    pair.run(5.0);
    assert_eq!(pair.bridge.level(), Level::Automatic);
    assert_eq!(pair.vehicle.custom_mode(), GUIDED);
}

/// Tells the bridge what the rest of the team saw happen.
fn tell(pair: &mut Pair, event: Event) {
    let mut out = BridgeOutput::default();
    pair.bridge.handle(event, &mut out);
    pair.events.extend(out.events);
}

#[test]
fn a_danger_that_the_team_sees_sends_it_home() {
    let mut pair = Pair::new(16);
    pair.take_off();
    pair.run(20.0);
    tell(&mut pair, Event::Begins(Danger::SquadronController));
    pair.run(3.0);
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    assert_eq!(pair.said("guardian"), 1);
    // While it lasts nobody can have the vehicle back but its pilot.
    pair.hand_back();
    assert_eq!(pair.said("hand-back-refused"), 1);
    pair.vehicle.pilot(FBWA, TURN);
    pair.run(2.0);
    assert_eq!(pair.bridge.level(), Level::Pilot);
    // He hands it to the Guardian.
    pair.hand_back();
    pair.run(3.0);
    assert_eq!(pair.bridge.level(), Level::Guardian);
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    tell(&mut pair, Event::Ends(Danger::SquadronController));
    pair.run(3.0);
    assert_eq!(pair.bridge.level(), Level::Guardian);
    pair.hand_back();
    pair.run(3.0);
    assert_eq!(pair.bridge.level(), Level::Automatic);
    assert_eq!(pair.vehicle.custom_mode(), GUIDED);
}

#[test]
fn a_danger_during_take_off_lets_it_climb_first() {
    let mut pair = Pair::new(17);
    pair.setpoint = Some(setpoint(PathKind::TakeOff, -1000.0, 500.0, 650.0));
    while !pair.state.as_ref().is_some_and(|s| s.airborne) {
        pair.run(0.2);
    }
    tell(&mut pair, Event::Begins(Danger::World));
    let mut lowest_m = f64::INFINITY;
    for _ in 0..60 {
        pair.run(1.0);
        if pair.vehicle.custom_mode() == RTL {
            lowest_m = lowest_m.min(pair.vehicle.truth().alt_amsl_m - 340.0);
        }
    }
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    assert!(lowest_m > 30.0, "sent home at {lowest_m} m");
}

#[test]
fn a_bridge_that_dies_leaves_it_to_its_failsafe_and_a_new_one_asks_first() {
    let mut pair = Pair::new(18);
    pair.take_off();
    pair.run(30.0);
    let config = BridgeConfig {
        atmosphere: scenario().atmosphere().unwrap(),
        may_arm: true,
        ..BridgeConfig::default()
    };
    // The old one's process is gone: nothing goes up any more.
    pair.bridge = Bridge::new(config).unwrap();
    pair.up = |_, _| Vec::new();
    pair.run(100.0);
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    // A new one finds it in the air in a mode that it did not ask for.
    pair.up = |_, frames| frames;
    pair.run(5.0);
    assert_ne!(pair.bridge.level(), Level::Automatic);
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    pair.hand_back();
    pair.run(5.0);
    assert_eq!(pair.bridge.level(), Level::Automatic);
    assert_eq!(pair.vehicle.custom_mode(), GUIDED);
}

#[test]
fn lands_at_home() {
    let mut pair = Pair::new(7);
    pair.take_off();
    pair.run(30.0);
    let home = scenario().home(5).unwrap();
    pair.setpoint = Some(Setpoint {
        path: PathKind::Land,
        lat_deg: home.lat_deg,
        lon_deg: home.lon_deg,
        alt_amsl_m: 340.0,
        airspeed_m_s: 16.0,
        orbit_radius_m: 0.0,
    });
    pair.run(400.0);
    assert!(!pair.state.as_ref().unwrap().airborne, "{:?}", pair.state);
    assert_eq!(pair.said("landed"), 1, "{:#?}", pair.events);
    assert!(pair.distance_m() < 60.0, "{} m", pair.distance_m());
}

#[test]
fn without_a_landing_sequence_it_returns_and_circles() {
    let mut config = stand_in_config();
    config.has_landing_sequence = false;
    let mut pair = Pair::with(config, 8);
    pair.take_off();
    let mut land = setpoint(PathKind::Land, 0.0, 0.0, 340.0);
    land.airspeed_m_s = 16.0;
    pair.setpoint = Some(land);
    pair.run(60.0);
    assert_eq!(pair.said("no-landing-sequence"), 1);
    assert_eq!(pair.bridge.level(), Level::Automatic);
    assert!(pair.state.as_ref().unwrap().airborne);
    // A pilot who then switches to another mode takes it over all the same.
    pair.vehicle.pilot(FBWA, TURN);
    pair.run(2.0);
    assert_eq!(pair.bridge.level(), Level::Pilot);
}

#[test]
fn warns_of_a_failsafe_that_is_off() {
    let mut config = stand_in_config();
    assert!(config.parameters.set("FS_GCS_ENABL", 0.0));
    let mut pair = Pair::with(config, 9);
    pair.run(5.0);
    let warnings: Vec<_> = pair
        .events
        .iter()
        .filter(|e| e.code == "failsafe-off")
        .collect();
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].text.contains("FS_GCS_ENABL"));
}

#[test]
fn its_own_failsafe_is_the_guardian() {
    let mut pair = Pair::new(10);
    pair.take_off();
    // The vehicle no longer hears the bridge, but the bridge hears the vehicle.
    pair.up = |_, _| Vec::new();
    pair.run(10.0);
    assert_eq!(pair.bridge.level(), Level::Guardian);
    assert_eq!(pair.said("guardian"), 1);
    assert_eq!(pair.said("link-lost"), 0);
    assert!(pair.bridge.control().has(Danger::Bridge));
}

#[test]
fn it_stands_and_lands_on_its_terrain() {
    // A plateau of 520 m all over the tile, where the site itself is at 340 m.
    let bytes: Vec<u8> = (0..1201 * 1201)
        .flat_map(|_| 520i16.to_be_bytes())
        .collect();
    let terrain = air::terrain::Terrain::from_hgt("N43W008.hgt", &bytes, 340.0).unwrap();
    let mut pair = Pair::with(stand_in_config().over(terrain), 19);
    pair.run(1.0);
    assert!((pair.vehicle.truth().alt_amsl_m - 520.0).abs() < 1.0);
    pair.take_off();
    pair.run(30.0);
    let home = scenario().home(5).unwrap();
    let mut land = setpoint(PathKind::Land, 0.0, 0.0, 520.0);
    (land.lat_deg, land.lon_deg) = (home.lat_deg, home.lon_deg);
    pair.setpoint = Some(land);
    pair.run(400.0);
    assert!(!pair.state.as_ref().unwrap().airborne, "{:?}", pair.state);
    assert!((pair.vehicle.truth().alt_amsl_m - 520.0).abs() < 1.0);
}

#[test]
fn signed_on_both_sides() {
    let mut config = stand_in_config();
    config.signing = Some(mav_bridge::signing::SigningConfig {
        key: [7; 32],
        link_id: 1,
        epoch_10us: 37_000_000_000_000,
    });
    let mut pair = Pair::with(config, 11);
    pair.take_off();
    assert!(pair.received.iter().all(|f| f[2] & 1 == 1));
    assert_eq!(pair.bridge.statistics().refused_frames, 0);
    // A stranger without the key is not heard.
    let mut out = BridgeOutput::default();
    let forged = Pair::new(1).vehicle.step(SimTime::ZERO, &[]);
    pair.bridge.receive(&forged[0], pair.now(), &mut out);
    assert_eq!(pair.bridge.statistics().refused_frames, 1);
}

#[test]
fn same_seed_same_bytes() {
    let fly = |seed| {
        let mut pair = Pair::new(seed);
        pair.take_off();
        pair.run(20.0);
        (pair.received, pair.sent)
    };
    let first = fly(12);
    assert_eq!(first, fly(12));
    assert_ne!(first.0, fly(13).0);
}

/// Loses every fifth datagram, cuts one in seven short, flips a bit in one in eleven, and puts
/// garbage with start bytes between them.
fn noisy(tick: u64, frames: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
    let mut out = Vec::new();
    for (k, mut frame) in frames.into_iter().enumerate() {
        let n = tick.wrapping_mul(2654435761).wrapping_add(k as u64 * 40503) >> 4;
        if n.is_multiple_of(5) {
            continue;
        }
        if n.is_multiple_of(7) {
            frame.truncate(frame.len() / 2);
        }
        if n.is_multiple_of(11) {
            let at = (n as usize / 11) % frame.len();
            frame[at] ^= 1 << (n % 8);
        }
        out.push(vec![0xFD, 0xFE, (n % 256) as u8]);
        out.push(frame);
    }
    out
}

#[test]
fn flies_over_a_noisy_link() {
    let mut pair = Pair::new(14);
    pair.up = noisy;
    pair.down = noisy;
    pair.take_off();
    pair.setpoint = Some(setpoint(PathKind::GoTo, -800.0, 1500.0, 650.0));
    pair.run(150.0);
    assert_eq!(pair.bridge.level(), Level::Automatic);
    assert!((pair.distance_m() - 100.0).abs() < 40.0);
    let statistics = pair.bridge.statistics();
    assert!(
        statistics.bad_frames > 100 && statistics.lost_frames > 100,
        "{statistics:?}"
    );
}

#[test]
fn home_mode_by_the_pilot_is_the_pilots() {
    let mut pair = Pair::new(15);
    pair.take_off();
    assert!(pair.vehicle.pilot(RTL, TURN));
    pair.run(2.0);
    assert_eq!(pair.bridge.level(), Level::Pilot);
}

/// Message id, and for commands the command and its first two parameters.
fn decode(frame: &[u8]) -> (u32, u16, f32, f32) {
    let mut payload = frame[10..10 + usize::from(frame[1])].to_vec();
    payload.resize(35, 0);
    let float = |at: usize| f32::from_le_bytes(payload[at..at + 4].try_into().unwrap());
    let id = u32::from_le_bytes([frame[7], frame[8], frame[9], 0]);
    let command = u16::from_le_bytes([payload[28], payload[29]]);
    (id, command, float(0), float(4))
}

/// How often GUIDED was commanded: COMMAND_LONG (76), DO_SET_MODE (176), mode 15.
fn guided_commands(frames: &[Vec<u8>]) -> usize {
    frames
        .iter()
        .map(|f| decode(f))
        .filter(|d| (d.0, d.1, d.3) == (76, 176, 15.0))
        .count()
}

/// Commands that change mode, place, speed or arming.
fn steering_commands(frames: &[Vec<u8>]) -> usize {
    frames
        .iter()
        .map(|f| decode(f))
        .filter(|d| matches!((d.0, d.1), (75 | 76, 176 | 178 | 189 | 192 | 400)))
        .count()
}
