//! The fence on board: read back, compared with the mission's, and uploaded if requested.
#![allow(
    deprecated,
    reason = "vehicles may still ask by the older form, and are to be answered in the newer"
)]

use super::{Bridge, BridgeOutput};
use crate::dialect::{
    MISSION_ACK_DATA, MISSION_COUNT_DATA, MISSION_ITEM_INT_DATA, MISSION_REQUEST_INT_DATA,
    MISSION_REQUEST_LIST_DATA, MavCmd, MavFrame, MavMessage, MavMissionResult, MavMissionType,
};
use crate::event::event;
use crate::telemetry::distance_m;
use air::geo::Geodetic;
use protocol::SimTime;
use protocol::message::Severity;

/// Corners nearer than this are the same, m: latitudes and longitudes come in 1 cm.
const SAME_M: f64 = 1.0;
/// Most items that are read: a field's fence has some tens.
const MOST_ITEMS: u16 = 200;
const FENCE: MavMissionType = MavMissionType::MAV_MISSION_TYPE_FENCE;

/// Result of the comparison.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum FenceOnBoard {
    /// No fence.
    None,
    /// The mission's polygon, and nothing else.
    Same,
    /// Another one; the difference.
    Other(String),
}

/// A request to the vehicle without an answer yet.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Question {
    /// How many items there are.
    List,
    /// That item.
    Item(u16),
    /// Whether it takes the mission's.
    Offer,
    /// Whether it wants more than that item of the mission's.
    Sent(u16),
}

/// The exchange with one vehicle.
#[derive(Debug, Clone, Default)]
pub(super) struct FenceExchange {
    wanted: Vec<Geodetic>,
    /// What is asked, when it was sent, and how often.
    question: Option<(Question, Option<SimTime>, u32)>,
    count: u16,
    items: Vec<MISSION_ITEM_INT_DATA>,
    found: Option<FenceOnBoard>,
    uploaded: bool,
}

impl FenceExchange {
    /// An exchange for the mission's polygon; none for an empty one.
    pub(super) fn new(wanted: &[Geodetic]) -> Self {
        Self {
            wanted: wanted.to_vec(),
            ..Self::default()
        }
    }

    /// Reads the fence on board.
    pub(super) fn read(&mut self) {
        if !self.wanted.is_empty() {
            self.items.clear();
            self.ask(Question::List);
        }
    }

    /// Whether an answer is awaited.
    pub(super) fn is_busy(&self) -> bool {
        self.question.is_some()
    }

    /// The result; none before the fence on board was read.
    pub(super) fn found(&self) -> Option<&FenceOnBoard> {
        self.found.as_ref()
    }

    fn ask(&mut self, question: Question) {
        self.question = Some((question, None, 0));
    }

    /// What is to be sent at `now`, `timeout_s` after it was sent last; given up after `attempts`.
    fn due(&mut self, now: SimTime, timeout_s: f64, attempts: u32) -> Option<Question> {
        let (question, sent_at, sent) = self.question.as_mut()?;
        if sent_at.is_some_and(|at| now.since_s(at) < timeout_s) {
            return None;
        }
        if *sent >= attempts {
            self.question = None;
            return None;
        }
        (*sent_at, *sent) = (Some(now), *sent + 1);
        Some(*question)
    }

    /// Receives the number of items; true if the transfer is complete.
    fn counted(&mut self, count: u16) -> bool {
        if !matches!(self.question, Some((Question::List, ..))) {
            return false;
        }
        self.count = count.min(MOST_ITEMS);
        self.next_item()
    }

    /// Receives an item; true if it was the last.
    fn item(&mut self, item: &MISSION_ITEM_INT_DATA) -> bool {
        let awaited = self.items.len() as u16;
        if item.seq != awaited || !matches!(self.question, Some((Question::Item(_), ..))) {
            return false;
        }
        self.items.push(item.clone());
        self.next_item()
    }

    fn next_item(&mut self) -> bool {
        let next = self.items.len() as u16;
        if next < self.count {
            self.ask(Question::Item(next));
            return false;
        }
        self.question = None;
        self.found = Some(compare(&self.items, &self.wanted));
        true
    }
}

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

/// The fence of these items beside the mission's polygon.
fn compare(items: &[MISSION_ITEM_INT_DATA], wanted: &[Geodetic]) -> FenceOnBoard {
    let Some(first) = items.first() else {
        return FenceOnBoard::None;
    };
    let vertex = MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION;
    let others = items.iter().filter(|item| item.command != vertex).count();
    if others > 0 {
        let words = format!(
            "{others} of its {} items are not corners of an inclusion polygon",
            items.len()
        );
        return FenceOnBoard::Other(words);
    }
    if f64::from(first.param1) != items.len() as f64 {
        return FenceOnBoard::Other("it has several polygons, the mission's has one".to_owned());
    }
    if items.len() != wanted.len() {
        let words = format!(
            "{} corners, the mission's has {}",
            items.len(),
            wanted.len()
        );
        return FenceOnBoard::Other(words);
    }
    let found: Vec<Geodetic> = items
        .iter()
        .map(|item| Geodetic::new(f64::from(item.x) / 1e7, f64::from(item.y) / 1e7))
        .collect();
    let off_m = farthest_m(&found, wanted);
    if off_m <= SAME_M {
        return FenceOnBoard::Same;
    }
    FenceOnBoard::Other(format!("a corner is {off_m:.0} m from the mission's"))
}

/// How far the farthest corner is from its own, with the polygons laid on each other as well as can be: whichever corner
/// is first, and whichever way round.
fn farthest_m(found: &[Geodetic], wanted: &[Geodetic]) -> f64 {
    let count = wanted.len();
    let off_m = |shift: usize, forwards: bool| {
        let pairs = wanted.iter().enumerate().map(|(k, corner)| {
            let at = if forwards {
                shift + k
            } else {
                shift + count - k
            };
            distance_m(*corner, found[at % count])
        });
        pairs.fold(0.0, f64::max)
    };
    (0..count)
        .flat_map(|shift| [off_m(shift, true), off_m(shift, false)])
        .fold(f64::INFINITY, f64::min)
}
