//! The fence on board as the bridge reads it back, and uploads the mission's if requested.
#![allow(
    deprecated,
    reason = "vehicles may still ask by the older form, and are to be answered in the newer"
)]

use super::fence::{FenceOnBoard, Question};
use super::{Bridge, BridgeOutput};
use crate::dialect::{
    MISSION_ACK_DATA, MISSION_COUNT_DATA, MISSION_ITEM_INT_DATA, MISSION_REQUEST_INT_DATA,
    MISSION_REQUEST_LIST_DATA, MavCmd, MavFrame, MavMessage, MavMissionResult, MavMissionType,
};
use crate::event::event;
use protocol::SimTime;
use protocol::message::Severity;

const FENCE: MavMissionType = MavMissionType::MAV_MISSION_TYPE_FENCE;

impl Bridge {
    /// Receives the vehicle's answers about its fence.
    pub(super) fn on_fence(&mut self, message: &MavMessage, now: SimTime, out: &mut BridgeOutput) {
        let own = (self.config.system_id, self.config.component_id);
        let read_whole = match message {
            MavMessage::MISSION_COUNT(m)
                if m.mission_type == FENCE && (m.target_system, m.target_component) == own =>
            {
                self.fence.counted(m.count)
            }
            MavMessage::MISSION_ITEM_INT(m)
                if m.mission_type == FENCE && (m.target_system, m.target_component) == own =>
            {
                self.fence.item(m)
            }
            MavMessage::MISSION_REQUEST_INT(m)
                if m.mission_type == FENCE && (m.target_system, m.target_component) == own =>
            {
                self.hand_over(m.seq);
                false
            }
            MavMessage::MISSION_REQUEST(m)
                if m.mission_type == FENCE && (m.target_system, m.target_component) == own =>
            {
                self.hand_over(m.seq);
                false
            }
            MavMessage::MISSION_ACK(m)
                if m.mission_type == FENCE && (m.target_system, m.target_component) == own =>
            {
                self.on_fence_taken(m.mavtype, out);
                false
            }
            _ => false,
        };
        if read_whole {
            self.thank(now, out);
        }
    }

    /// The vehicle wants an item of the mission's fence.
    fn hand_over(&mut self, seq: u16) {
        let offered = matches!(
            self.fence.question,
            Some((Question::Offer | Question::Sent(_), ..))
        );
        if offered && usize::from(seq) < self.fence.wanted.len() {
            self.fence.ask(Question::Sent(seq));
        }
    }

    fn on_fence_taken(&mut self, result: MavMissionResult, out: &mut BridgeOutput) {
        let offered = matches!(
            self.fence.question,
            Some((Question::Offer | Question::Sent(_), ..))
        );
        if !offered {
            return;
        }
        self.fence.question = None;
        let (severity, text) = if result == MavMissionResult::MAV_MISSION_ACCEPTED {
            // Read back after an upload: only that shows the fence on board.
            self.fence.read();
            (
                Severity::Info,
                "the mission's fence was uploaded".to_owned(),
            )
        } else {
            let text = format!("the vehicle rejects the mission's fence: {result:?}");
            (Severity::Error, text)
        };
        out.events.push(event(severity, "fence-upload", text));
    }

    /// Sends what is due of the exchange; on the ground, and where that is asked for, begins to put the mission's fence on
    /// board once another was found there.
    pub(super) fn exchange_fence(&mut self, now: SimTime, out: &mut BridgeOutput) {
        let Some(to) = self.identity.address().filter(|_| {
            self.authority.link_up() && self.identity.is_certain() && !self.config.listen_only
        }) else {
            return;
        };
        let on_ground = self
            .authority
            .shown()
            .is_some_and(|s| !s.airborne && !s.armed);
        let wrong = self
            .fence
            .found
            .as_ref()
            .is_some_and(|f| *f != FenceOnBoard::Same);
        let may = self.config.set_fence && on_ground && !self.fence.uploaded;
        if wrong && may && !self.fence.is_busy() {
            self.fence.uploaded = true;
            if self.config.dry_run {
                for seq in 0..self.fence.wanted.len() as u16 {
                    let item = self.fence_item(seq, to);
                    self.show("a corner of the fence", &item, now, out);
                }
                return;
            }
            self.fence.ask(Question::Offer);
        }
        let due = self
            .fence
            .due(now, self.config.ack_timeout_s, self.config.attempts);
        match due {
            None => {}
            Some(Question::List) => self.send(
                &MISSION_REQUEST_LIST_DATA {
                    target_system: to.0,
                    target_component: to.1,
                    mission_type: FENCE,
                },
                now,
                out,
            ),
            Some(Question::Item(seq)) => self.send(
                &MISSION_REQUEST_INT_DATA {
                    seq,
                    target_system: to.0,
                    target_component: to.1,
                    mission_type: FENCE,
                },
                now,
                out,
            ),
            Some(Question::Offer) => self.send(
                &MISSION_COUNT_DATA {
                    count: self.fence.wanted.len() as u16,
                    target_system: to.0,
                    target_component: to.1,
                    mission_type: FENCE,
                    ..MISSION_COUNT_DATA::default()
                },
                now,
                out,
            ),
            Some(Question::Sent(seq)) => {
                let item = self.fence_item(seq, to);
                self.send(&item, now, out);
            }
        }
    }

    fn fence_item(&self, seq: u16, to: (u8, u8)) -> MISSION_ITEM_INT_DATA {
        let corner = self.fence.wanted[usize::from(seq)];
        MISSION_ITEM_INT_DATA {
            param1: self.fence.wanted.len() as f32,
            x: (corner.lat_deg * 1e7).round() as i32,
            y: (corner.lon_deg * 1e7).round() as i32,
            seq,
            command: MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
            target_system: to.0,
            target_component: to.1,
            frame: MavFrame::MAV_FRAME_GLOBAL,
            mission_type: FENCE,
            ..MISSION_ITEM_INT_DATA::default()
        }
    }

    /// Ends a reading.
    fn thank(&mut self, now: SimTime, out: &mut BridgeOutput) {
        let Some((target_system, target_component)) = self.identity.address() else {
            return;
        };
        let message = MISSION_ACK_DATA {
            target_system,
            target_component,
            mavtype: MavMissionResult::MAV_MISSION_ACCEPTED,
            mission_type: FENCE,
            ..MISSION_ACK_DATA::default()
        };
        self.send(&message, now, out);
    }
}
