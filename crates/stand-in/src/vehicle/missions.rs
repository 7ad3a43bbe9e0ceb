//! Missions, fences and rally points: what comes in of them, and what is told of the one that is
//! flown.
#![allow(deprecated, reason = "ground stations still send the older forms")]

use super::StandIn;
use crate::fence::Fence;
use crate::flight::Orders;
use crate::item_list::{Answer, Item, ItemList, Peer, UNSUPPORTED, whole_degrees};
use crate::mission_run::{MissionEvent, altitude_amsl_m};
use crate::parameters::{FENCE_ENABLE, MIN_GROUNDSPEED, TOTALS};
use air::geo::Geodetic;
use mav_bridge::arduplane::{AUTO, GUIDED};
use mav_bridge::dialect::{
    HOME_POSITION_DATA, MISSION_ACK_DATA, MISSION_COUNT_DATA, MISSION_CURRENT_DATA,
    MISSION_ITEM_DATA, MISSION_ITEM_INT_DATA, MISSION_ITEM_REACHED_DATA, MISSION_REQUEST_DATA,
    MavCmd, MavFrame, MavMessage, MavMissionResult, MavMissionType, MavSeverity,
};
use mav_bridge::wire::{MessageData as _, RawFrame};
use protocol::SimTime;

/// Where sequence number and target system stand in MISSION_ITEM and MISSION_ITEM_INT.
const SEQUENCE_AT: usize = 28;
const TARGET_AT: usize = 32;
/// Where the kind of the list stands in both.
const KIND_AT: usize = 37;
/// `current` of an item that is not one of a list: fly there, or at its altitude.
const FLY_THERE: u8 = 2;
const FLY_AT_ITS_ALTITUDE: u8 = 3;

/// A place in 1e-7 degrees.
fn whole_degrees_of(at: Geodetic) -> (i32, i32) {
    let whole = |deg: f64| (deg * 1e7).round() as i32;
    (whole(at.lat_deg), whole(at.lon_deg))
}

/// The landing sequence of a careful owner: its start, and a landing at home.
pub(super) fn landing_at(home: Geodetic) -> Vec<Item> {
    let (x, y) = whole_degrees_of(home);
    let item = |seq, command| Item {
        seq,
        command,
        frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
        x,
        y,
        autocontinue: 1,
        ..Item::default()
    };
    vec![
        item(0, MavCmd::MAV_CMD_NAV_WAYPOINT),
        item(1, MavCmd::MAV_CMD_DO_LAND_START),
        item(2, MavCmd::MAV_CMD_NAV_LAND),
    ]
}

impl StandIn {
    fn list(&mut self, kind: MavMissionType) -> Option<&mut ItemList> {
        self.lists.get_mut(kind as usize)
    }

    /// Takes part in the mission protocol.
    pub(super) fn mission_message(&mut self, frame: &RawFrame, m: &MavMessage, now: SimTime) {
        let from = (frame.system_id(), frame.component_id());
        match m {
            MavMessage::MISSION_REQUEST_LIST(m) if self.is_addressed(m.target_system) => {
                let ask = |list: &mut ItemList| vec![list.request_list()];
                self.with_list(m.mission_type, from, now, ask);
            }
            MavMessage::MISSION_REQUEST_INT(m) if self.is_addressed(m.target_system) => {
                let home = self.home_item();
                let ask = |list: &mut ItemList| list.request(m.seq, &home, false);
                self.with_list(m.mission_type, from, now, ask);
            }
            MavMessage::MISSION_REQUEST(m) if self.is_addressed(m.target_system) => {
                let home = self.home_item();
                let ask = |list: &mut ItemList| list.request(m.seq, &home, true);
                self.with_list(m.mission_type, from, now, ask);
            }
            MavMessage::MISSION_COUNT(m) if self.is_addressed(m.target_system) => {
                let begin = |list: &mut ItemList| list.count(m.count, from, now);
                self.with_list(m.mission_type, from, now, begin);
            }
            MavMessage::MISSION_WRITE_PARTIAL_LIST(m) if self.is_addressed(m.target_system) => {
                let begin =
                    |list: &mut ItemList| list.write_partial(m.start_index, m.end_index, from, now);
                self.with_list(m.mission_type, from, now, begin);
            }
            MavMessage::MISSION_ITEM_INT(m) if self.is_addressed(m.target_system) => {
                self.take_item(m.mission_type, Ok(m.clone()), from, now);
            }
            MavMessage::MISSION_ITEM(m) if self.is_addressed(m.target_system) => {
                let item = whole_degrees(m).map_err(|why| (m.seq, why));
                self.take_item(m.mission_type, item, from, now);
            }
            MavMessage::MISSION_CLEAR_ALL(m) if self.is_addressed(m.target_system) => {
                let result = self.clear(m.mission_type);
                self.acknowledge_mission(result, m.mission_type, from, now);
            }
            MavMessage::MISSION_SET_CURRENT(m) if self.is_addressed(m.target_system) => {
                self.set_current(m.seq, now);
            }
            _ => {}
        }
    }

    /// A ground station waits for its own number, even if that is none to be flown.
    fn set_current(&mut self, seq: u16, now: SimTime) {
        if self.go_on_with(seq) {
            let current = MISSION_CURRENT_DATA {
                seq,
                ..self.mission_current()
            };
            self.send(&current, now);
        }
    }

    /// An item with a command or a frame that the dialect does not know.
    pub(super) fn refuse_unknown_item(&mut self, frame: &RawFrame, now: SimTime) {
        if ![MISSION_ITEM_DATA::ID, MISSION_ITEM_INT_DATA::ID].contains(&frame.message_id()) {
            return;
        }
        // Zeros at the end of a payload are not sent.
        let byte = |at: usize| frame.payload().get(at).copied().unwrap_or(0);
        let Some(list) = self.lists.get_mut(usize::from(byte(KIND_AT))) else {
            return;
        };
        if ![0, self.speaker.system_id].contains(&byte(TARGET_AT)) {
            return;
        }
        let seq = u16::from_le_bytes([byte(SEQUENCE_AT), byte(SEQUENCE_AT + 1)]);
        let from = (frame.system_id(), frame.component_id());
        let said = list.item(Err((seq, UNSUPPORTED)), from, now);
        let kind = list.kind();
        self.tell(said, kind, from, now);
    }

    fn with_list(
        &mut self,
        kind: MavMissionType,
        from: Peer,
        now: SimTime,
        act: impl FnOnce(&mut ItemList) -> Vec<Answer>,
    ) {
        match self.list(kind).map(act) {
            Some(said) => self.tell(said, kind, from, now),
            None => self.acknowledge_mission(UNSUPPORTED, kind, from, now),
        }
        self.count_items();
    }

    fn take_item(
        &mut self,
        kind: MavMissionType,
        item: Result<Item, (u16, MavMissionResult)>,
        from: Peer,
        now: SimTime,
    ) {
        let is_mission = kind == MavMissionType::MAV_MISSION_TYPE_MISSION;
        match item {
            Ok(item) if is_mission && [FLY_THERE, FLY_AT_ITS_ALTITUDE].contains(&item.current) => {
                let result = self.fly_to_item(&item);
                self.acknowledge_mission(result, kind, from, now);
            }
            item => self.with_list(kind, from, now, |list| list.item(item, from, now)),
        }
    }

    /// The oldest way to send a vehicle somewhere, which MAVProxy still goes.
    fn fly_to_item(&mut self, item: &Item) -> MavMissionResult {
        let home = self.flight.home();
        let at = crate::fence::local((item.x, item.y), &self.reality.frame);
        let ground = || self.reality.ground_at_amsl_m(at);
        let Some(alt_amsl_m) = altitude_amsl_m(item.frame as u8, item.z, home, ground) else {
            return MavMissionResult::MAV_MISSION_UNSUPPORTED_FRAME;
        };
        if item.current == FLY_AT_ITS_ALTITUDE {
            self.flight.set_altitude(alt_amsl_m);
            return MavMissionResult::MAV_MISSION_ACCEPTED;
        }
        if self.flight.mode() != GUIDED || (item.x, item.y) == (0, 0) {
            return MavMissionResult::MAV_MISSION_ERROR;
        }
        self.fly_around(at, 0.0, true);
        self.flight.set_altitude(alt_amsl_m);
        MavMissionResult::MAV_MISSION_ACCEPTED
    }

    fn clear(&mut self, kind: MavMissionType) -> MavMissionResult {
        // A mission is not cleared while it is flown.
        let flown = self.flight.mode() == AUTO && self.flight.mission().is_running();
        let all = kind == MavMissionType::MAV_MISSION_TYPE_ALL;
        let mut result = if all || self.list(kind).is_some() {
            MavMissionResult::MAV_MISSION_ACCEPTED
        } else {
            UNSUPPORTED
        };
        for (k, list) in self.lists.iter_mut().enumerate() {
            if all || list.kind() == kind {
                let cleared = list.clear(k == 0 && flown);
                if cleared != MavMissionResult::MAV_MISSION_ACCEPTED {
                    result = cleared;
                }
            }
        }
        self.count_items();
        result
    }

    /// Keeps what depends on the lists in step with them.
    pub(super) fn count_items(&mut self) {
        for (list, name) in self.lists.iter().zip(TOTALS) {
            self.speaker.parameters.set(name, list.items().len() as f32);
        }
        self.fence = Fence::from_items(self.lists[1].items()).unwrap_or_default();
    }

    pub(super) fn remind_uploads(&mut self, now: SimTime) {
        for k in 0..self.lists.len() {
            if let Some((from, said)) = self.lists[k].remind(now) {
                let kind = self.lists[k].kind();
                self.tell(said, kind, from, now);
            }
        }
    }

    fn tell(&mut self, said: Vec<Answer>, kind: MavMissionType, to: Peer, now: SimTime) {
        let (target_system, target_component) = to;
        for answer in said {
            match answer {
                Answer::Count(count) => {
                    let count = MISSION_COUNT_DATA {
                        count: count as u16,
                        target_system,
                        target_component,
                        mission_type: kind,
                        ..MISSION_COUNT_DATA::default()
                    };
                    self.send(&count, now);
                }
                Answer::Item { item, in_floats } => {
                    self.send_item(item, in_floats, kind, to, now);
                }
                Answer::Ack(result) => self.acknowledge_mission(result, kind, to, now),
                // ArduPlane asks by the older message and takes either as the answer.
                Answer::Request(seq) => {
                    let request = MISSION_REQUEST_DATA {
                        seq,
                        target_system,
                        target_component,
                        mission_type: kind,
                    };
                    self.send(&request, now);
                }
                Answer::Text(severity, text) => self.send_text(severity, text, now),
            }
        }
    }

    fn send_item(
        &mut self,
        item: Item,
        in_floats: bool,
        kind: MavMissionType,
        (target_system, target_component): Peer,
        now: SimTime,
    ) {
        let is_mission = kind == MavMissionType::MAV_MISSION_TYPE_MISSION;
        let is_current = is_mission && item.seq != 0 && item.seq == self.flight.mission().current();
        let item = Item {
            target_system,
            target_component,
            current: u8::from(is_current),
            mission_type: kind,
            ..item
        };
        if !in_floats {
            return self.send(&item, now);
        }
        let degrees = |whole: i32| (f64::from(whole) / 1e7) as f32;
        let item = MISSION_ITEM_DATA {
            param1: item.param1,
            param2: item.param2,
            param3: item.param3,
            param4: item.param4,
            x: degrees(item.x),
            y: degrees(item.y),
            z: item.z,
            seq: item.seq,
            command: item.command,
            target_system,
            target_component,
            frame: item.frame,
            current: item.current,
            autocontinue: item.autocontinue,
            mission_type: kind,
        };
        self.send(&item, now);
    }

    fn acknowledge_mission(
        &mut self,
        result: MavMissionResult,
        kind: MavMissionType,
        (target_system, target_component): Peer,
        now: SimTime,
    ) {
        let ack = MISSION_ACK_DATA {
            target_system,
            target_component,
            mavtype: result,
            mission_type: kind,
            ..MISSION_ACK_DATA::default()
        };
        self.send(&ack, now);
    }

    /// Home as item 0 of every mission.
    fn home_item(&self) -> Item {
        let home = self.flight.home();
        let (x, y) = whole_degrees_of(self.reality.frame.to_geodetic(home.at));
        Item {
            command: MavCmd::MAV_CMD_NAV_WAYPOINT,
            frame: MavFrame::MAV_FRAME_GLOBAL,
            x,
            y,
            z: home.ground_amsl_m as f32,
            autocontinue: 1,
            ..Item::default()
        }
    }

    /// Goes on with the mission's item of this number; false if there is none.
    pub(super) fn go_on_with(&mut self, seq: u16) -> bool {
        let orders = Orders::new(&self.speaker.parameters, &self.lists);
        self.flight.set_mission_item(usize::from(seq), &orders)
    }

    /// Goes on with the nearest start of a landing sequence; false if none is on board.
    pub(super) fn begin_landing(&mut self) -> bool {
        let here = self.flight.here().at;
        let frame = &self.reality.frame;
        let starts = self.lists[0].items().iter().enumerate();
        let nearest = starts
            .filter(|(_, item)| item.command == MavCmd::MAV_CMD_DO_LAND_START)
            .map(|(k, item)| (k, crate::fence::local((item.x, item.y), frame)))
            .min_by(|(_, a), (_, b)| here.distance_m(*a).total_cmp(&here.distance_m(*b)));
        let Some((index, _)) = nearest else {
            return false;
        };
        self.go_on_with(index as u16) && self.flight.set_mode(AUTO, &self.speaker.parameters)
    }

    pub(super) fn mission_current(&self) -> MISSION_CURRENT_DATA {
        let items = self.lists[0].items();
        MISSION_CURRENT_DATA {
            seq: self.flight.mission().current(),
            // Without home.
            total: items.len().saturating_sub(1) as u16,
            mission_state: self.flight.mission().state(items),
            // 1: in a mode that flies it; 2: not.
            mission_mode: if self.flight.mode() == AUTO { 1 } else { 2 },
            ..MISSION_CURRENT_DATA::default()
        }
    }

    /// Tells what the mission has done, and when another item is flown.
    pub(super) fn tell_mission(&mut self, now: SimTime) {
        for event in self.flight.take_events() {
            match event {
                MissionEvent::Reached(seq) => self.send(&MISSION_ITEM_REACHED_DATA { seq }, now),
                MissionEvent::Text(severity, text) => self.send_text(severity, &text, now),
                MissionEvent::Fence(on) => {
                    self.speaker
                        .parameters
                        .set(FENCE_ENABLE, f32::from(u8::from(on)));
                }
                MissionEvent::Speed(_, m_s) => {
                    self.speaker.parameters.set(MIN_GROUNDSPEED, m_s);
                }
                MissionEvent::Home(_) => {
                    self.speaker.request_once(HOME_POSITION_DATA::ID, 0);
                }
                MissionEvent::Mode(_) => {}
            }
        }
        let current = self.flight.mission().current();
        if std::mem::replace(&mut self.told_item, current) != current {
            let current = self.mission_current();
            self.send(&current, now);
        }
    }

    /// Says why it does not arm with this mission; none if nothing speaks against it.
    pub(super) fn mission_forbids_arming(&self) -> Option<(MavSeverity, &'static str)> {
        let has_landing = self.lists[0]
            .items()
            .iter()
            .any(|item| item.command == MavCmd::MAV_CMD_DO_LAND_START);
        let unused = self.speaker.parameters.get(crate::parameters::RTL_AUTOLAND) == 0.0;
        (has_landing && unused).then_some((
            MavSeverity::MAV_SEVERITY_CRITICAL,
            "Arm: DO_LAND_START set and RTL_AUTOLAND disabled",
        ))
    }
}
