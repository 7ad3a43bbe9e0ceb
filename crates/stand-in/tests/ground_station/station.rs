//! A ground station of system 255, component 190, beside one stand-in in virtual time.

use mav_bridge::dialect::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, MISSION_COUNT_DATA, MISSION_ITEM_INT_DATA,
    MISSION_REQUEST_INT_DATA, MISSION_REQUEST_LIST_DATA, MavCmd, MavFrame, MavMessage,
    MavMissionResult, MavMissionType, MavResult,
};
use mav_bridge::wire::{FrameDecoder, FrameEncoder, MessageData};
use protocol::SimTime;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use scenario::Scenario;
use stand_in::{StandIn, StandInConfig};

pub const TICK_NS: i64 = 20_000_000;
pub const SYSTEM: u8 = 6;
pub const MISSION: MavMissionType = MavMissionType::MAV_MISSION_TYPE_MISSION;
pub const FENCE: MavMissionType = MavMissionType::MAV_MISSION_TYPE_FENCE;
pub const RALLY: MavMissionType = MavMissionType::MAV_MISSION_TYPE_RALLY;
pub const X8: &str = include_str!("../../../../aircraft/x8.toml");
const AS_PONTES: &str = include_str!("../../../../scenarios/as-pontes.toml");

pub type Item = MISSION_ITEM_INT_DATA;

pub struct Station {
    pub vehicle: StandIn,
    tick: u64,
    encoder: FrameEncoder,
    decoder: FrameDecoder,
    up: Vec<Vec<u8>>,
    /// What was heard since it was last looked at.
    pub heard: Vec<MavMessage>,
}

pub fn scenario() -> Scenario {
    Scenario::parse("as-pontes.toml", AS_PONTES).unwrap()
}

impl Station {
    pub fn new() -> Self {
        let aircraft = fdm::Airframe::from_toml("x8.toml", X8).unwrap();
        let mut config = StandInConfig::from_scenario(&scenario(), 5, aircraft).unwrap();
        config.turbulence_intensity = 0.02;
        Self::with(config)
    }

    pub fn with(config: StandInConfig) -> Self {
        let rng = ChaCha8Rng::seed_from_u64(21);
        let mut station = Self {
            vehicle: StandIn::new(config, rng).unwrap(),
            tick: 0,
            encoder: FrameEncoder::new(255, 190),
            decoder: FrameDecoder::new(),
            up: Vec::new(),
            heard: Vec::new(),
        };
        // Its filter settles before it arms.
        station.run(3.0);
        station.heard.clear();
        station
    }

    fn now(&self) -> SimTime {
        SimTime::of_tick(self.tick, TICK_NS)
    }

    /// One tick of both.
    pub fn step(&mut self) {
        let now = self.now();
        let up = std::mem::take(&mut self.up);
        for bytes in self.vehicle.step(now, &up) {
            self.decoder.push(&bytes);
        }
        while let Some(frame) = self.decoder.next_frame(now) {
            self.heard.extend(frame.message());
        }
        self.tick += 1;
    }

    pub fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds * 50.0).round() as u64 {
            self.step();
        }
    }

    pub fn send<D: MessageData>(&mut self, message: &D) {
        let frame = self.encoder.encode(message, None, self.now());
        self.up.push(frame);
    }

    pub fn send_bytes(&mut self, frame: Vec<u8>) {
        self.up.push(frame);
    }

    /// What it says within a second of a message.
    pub fn ask<D: MessageData>(&mut self, message: &D) -> Vec<MavMessage> {
        self.heard.clear();
        self.send(message);
        self.run(1.0);
        std::mem::take(&mut self.heard)
    }

    /// The answer to a command whose place is in whole numbers.
    pub fn command_int(&mut self, command: &COMMAND_INT_DATA) -> MavResult {
        let heard = self.ask(command);
        acknowledged(&heard, command.command)
    }

    /// The answer to a command with up to seven numbers.
    pub fn command(&mut self, command: MavCmd, p: &[f32]) -> MavResult {
        let heard = self.ask(&long(command, p));
        acknowledged(&heard, command)
    }

    pub fn mode(&mut self, mode: u32) {
        let set = MavCmd::MAV_CMD_DO_SET_MODE;
        let result = self.command(set, &[1.0, mode as f32]);
        assert_eq!(result, MavResult::MAV_RESULT_ACCEPTED);
        assert_eq!(self.vehicle.custom_mode(), mode);
    }

    /// Uploads a list as ground stations do: what ends it, and what was asked for on the way.
    pub fn upload(&mut self, kind: MavMissionType, items: &[Item]) -> (MavMissionResult, Vec<u16>) {
        self.heard.clear();
        let (target_system, target_component) = (SYSTEM, 1);
        self.send(&MISSION_COUNT_DATA {
            count: items.len() as u16,
            target_system,
            target_component,
            mission_type: kind,
            ..MISSION_COUNT_DATA::default()
        });
        let mut asked = Vec::new();
        for _ in 0..500 {
            self.step();
            for message in std::mem::take(&mut self.heard) {
                match message {
                    MavMessage::MISSION_REQUEST(m) => {
                        assert_eq!(m.mission_type, kind);
                        assert_eq!((m.target_system, m.target_component), (255, 190));
                        asked.push(m.seq);
                        let item = items[usize::from(m.seq)].clone();
                        self.send(&Item {
                            mission_type: kind,
                            ..item
                        });
                    }
                    MavMessage::MISSION_ACK(m) => {
                        assert_eq!(m.mission_type, kind);
                        return (m.mavtype, asked);
                    }
                    _ => {}
                }
            }
        }
        panic!("the upload never ended; asked for {asked:?}");
    }

    /// Downloads a list.
    pub fn download(&mut self, kind: MavMissionType) -> Vec<Item> {
        let (target_system, target_component) = (SYSTEM, 1);
        let heard = self.ask(&MISSION_REQUEST_LIST_DATA {
            target_system,
            target_component,
            mission_type: kind,
        });
        let count = heard.iter().find_map(|m| match m {
            MavMessage::MISSION_COUNT(m) if m.mission_type == kind => Some(m.count),
            _ => None,
        });
        let mut items = Vec::new();
        for seq in 0..count.expect("a count of the kind asked for") {
            self.send(&MISSION_REQUEST_INT_DATA {
                seq,
                target_system,
                target_component,
                mission_type: kind,
            });
            self.heard.clear();
            self.step();
            items.extend(
                std::mem::take(&mut self.heard)
                    .into_iter()
                    .find_map(|m| match m {
                        MavMessage::MISSION_ITEM_INT(m)
                            if m.seq == seq && m.mission_type == kind =>
                        {
                            Some(m)
                        }
                        _ => None,
                    }),
            );
        }
        items
    }
}

pub fn long(command: MavCmd, p: &[f32]) -> COMMAND_LONG_DATA {
    let at = |k: usize| p.get(k).copied().unwrap_or(0.0);
    COMMAND_LONG_DATA {
        command,
        param1: at(0),
        param2: at(1),
        param3: at(2),
        param4: at(3),
        param5: at(4),
        param6: at(5),
        param7: at(6),
        target_system: SYSTEM,
        ..COMMAND_LONG_DATA::default()
    }
}

fn acknowledged(heard: &[MavMessage], command: MavCmd) -> MavResult {
    let answer = heard.iter().find_map(|m| match m {
        MavMessage::COMMAND_ACK(m) if m.command == command => Some(m.result),
        _ => None,
    });
    answer.unwrap_or_else(|| panic!("{command:?} is met with silence: {heard:?}"))
}

/// A place some metres north and east of the vehicle's home.
pub fn place(north_m: f64, east_m: f64) -> (i32, i32) {
    let scenario = scenario();
    let frame = scenario.frame().unwrap();
    let home = frame.to_enu(scenario.home(5).unwrap());
    let at = frame.to_geodetic(air::geo::Enu {
        east_m: home.east_m + east_m,
        north_m: home.north_m + north_m,
    });
    let whole = |deg: f64| (deg * 1e7).round() as i32;
    (whole(at.lat_deg), whole(at.lon_deg))
}

/// An item some metres north and east of home, so high above it.
pub fn item(command: MavCmd, p: [f32; 4], (north_m, east_m, up_m): (f64, f64, f32)) -> Item {
    let (x, y) = place(north_m, east_m);
    Item {
        command,
        param1: p[0],
        param2: p[1],
        param3: p[2],
        param4: p[3],
        x,
        y,
        z: up_m,
        frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
        target_system: SYSTEM,
        target_component: 1,
        autocontinue: 1,
        ..Item::default()
    }
}

/// An item without a place.
pub fn deed(command: MavCmd, p: [f32; 4]) -> Item {
    Item {
        x: 0,
        y: 0,
        frame: MavFrame::MAV_FRAME_MISSION,
        ..item(command, p, (0.0, 0.0, 0.0))
    }
}

/// The items with their numbers.
pub fn numbered(items: Vec<Item>) -> Vec<Item> {
    let number = |(seq, item): (usize, Item)| Item {
        seq: seq as u16,
        ..item
    };
    items.into_iter().enumerate().map(number).collect()
}
