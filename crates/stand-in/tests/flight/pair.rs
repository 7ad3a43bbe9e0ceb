//! Bridge and stand-in in one closed loop.

use air::geo::Enu;
use mav_bridge::{Bridge, BridgeConfig, BridgeOutput};
use protocol::SimTime;
use protocol::message::{EventMessage, PathKind, Reading, Setpoint, State};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use scenario::Scenario;
use stand_in::{StandIn, StandInConfig};
use std::collections::VecDeque;

pub const TICK_NS: i64 = 20_000_000;
pub const X8: &str = include_str!("../../../../aircraft/x8.toml");
pub const AS_PONTES: &str = include_str!("../../../../scenarios/as-pontes.toml");
pub fn scenario() -> Scenario {
    Scenario::parse("as-pontes.toml", AS_PONTES).unwrap()
}

pub fn stand_in_config() -> StandInConfig {
    let aircraft = fdm::Airframe::from_toml("x8.toml", X8).unwrap();
    StandInConfig::from_scenario(&scenario(), 5, aircraft).unwrap()
}

/// What the link does to the bytes of one direction at a tick.
pub type Link = fn(tick: u64, Vec<Vec<u8>>) -> Vec<Vec<u8>>;

pub struct Pair {
    pub bridge: Bridge,
    pub vehicle: StandIn,
    pub tick: u64,
    pub to_vehicle: Vec<Vec<u8>>,
    pub up: Link,
    pub down: Link,
    /// Ticks that frames are on their way, each way.
    pub delay: usize,
    on_the_way: [VecDeque<Vec<Vec<u8>>>; 2],
    pub state: Option<State>,
    pub readings: Vec<Reading>,
    pub events: Vec<EventMessage>,
    pub setpoint: Option<Setpoint>,
    pub sent: Vec<Vec<u8>>,
    pub received: Vec<Vec<u8>>,
}

impl Pair {
    pub fn new(seed: u64) -> Self {
        Self::with(stand_in_config(), seed)
    }

    pub fn with(config: StandInConfig, seed: u64) -> Self {
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
            delay: 0,
            on_the_way: [VecDeque::new(), VecDeque::new()],
            state: None,
            readings: Vec::new(),
            events: Vec::new(),
            setpoint: None,
            sent: Vec::new(),
            received: Vec::new(),
        }
    }

    pub fn now(&self) -> SimTime {
        SimTime::of_tick(self.tick, TICK_NS)
    }

    pub fn step(&mut self) {
        let now = self.now();
        let up = (self.up)(self.tick, std::mem::take(&mut self.to_vehicle));
        let up = self.delayed(0, up);
        let from = self.vehicle.step(now, &up);
        let from = (self.down)(self.tick, from);
        let from = self.delayed(1, from);
        let mut out = BridgeOutput::default();
        for bytes in &from {
            self.bridge.receive(bytes, now, &mut out);
        }
        if let Some(setpoint) = &self.setpoint {
            self.bridge.setpoint(setpoint, now, &mut out);
        }
        self.bridge.tick(now, &mut out);
        self.state = out.state.or(self.state.take());
        self.readings.extend(out.readings);
        self.events.extend(out.events);
        self.sent.extend(out.frames_to_vehicle.iter().cloned());
        self.received.extend(out.frames_from_vehicle);
        self.to_vehicle = out.frames_to_vehicle;
        self.tick += 1;
    }

    /// What arrives now of what was sent in that direction.
    fn delayed(&mut self, way: usize, frames: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
        let on_the_way = &mut self.on_the_way[way];
        on_the_way.push_back(frames);
        if on_the_way.len() <= self.delay {
            return Vec::new();
        }
        on_the_way.pop_front().unwrap()
    }

    pub fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds * 50.0).round() as u64 {
            self.step();
        }
    }

    pub fn hand_back(&mut self) {
        let mut out = BridgeOutput::default();
        self.bridge.hand_back(&mut out);
        self.events.extend(out.events);
    }

    pub fn said(&self, code: &str) -> usize {
        self.events.iter().filter(|e| e.code == code).count()
    }

    /// Runs until the bridge reports GUIDED.
    pub fn take_off(&mut self) {
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
    pub fn distance_m(&self) -> f64 {
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
pub fn setpoint(path: PathKind, north_m: f64, east_m: f64, alt_amsl_m: f64) -> Setpoint {
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

/// Message id, and for commands the command and its first two parameters.
pub fn decode(frame: &[u8]) -> (u32, u16, f32, f32) {
    let mut payload = frame[10..10 + usize::from(frame[1])].to_vec();
    payload.resize(35, 0);
    let float = |at: usize| f32::from_le_bytes(payload[at..at + 4].try_into().unwrap());
    let id = u32::from_le_bytes([frame[7], frame[8], frame[9], 0]);
    let command = u16::from_le_bytes([payload[28], payload[29]]);
    (id, command, float(0), float(4))
}

/// How often GUIDED was commanded: COMMAND_LONG (76), DO_SET_MODE (176), mode 15.
pub fn guided_commands(frames: &[Vec<u8>]) -> usize {
    frames
        .iter()
        .map(|f| decode(f))
        .filter(|d| (d.0, d.1, d.3) == (76, 176, 15.0))
        .count()
}

/// Commands that change mode, place, speed or arming.
pub fn steering_commands(frames: &[Vec<u8>]) -> usize {
    frames
        .iter()
        .map(|f| decode(f))
        .filter(|d| matches!((d.0, d.1), (75 | 76, 176 | 178 | 189 | 192 | 400)))
        .count()
}
