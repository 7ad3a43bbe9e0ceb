//! Missions, fences and rally points on board, and how a ground station uploads and downloads them:
//! MAVLink's mission protocol with the answers that ArduPlane gives.
//!
//! One difference is meant: an upload replaces what is on board only when it is complete, where
//! ArduPlane writes the items of a mission over the old ones as they come.

mod checks;

use crate::fence::Fence;
use mav_bridge::dialect::{MISSION_ITEM_INT_DATA, MavMissionResult, MavMissionType, MavSeverity};
use protocol::SimTime;

use MavMissionResult::{
    MAV_MISSION_ACCEPTED as ACCEPTED, MAV_MISSION_DENIED as DENIED, MAV_MISSION_ERROR as ERROR,
    MAV_MISSION_INVALID_SEQUENCE as INVALID_SEQUENCE, MAV_MISSION_NO_SPACE as NO_SPACE,
    MAV_MISSION_OPERATION_CANCELLED as CANCELLED,
};

pub(crate) use checks::{UNSUPPORTED, navigates, whole_degrees};

/// One item, as it is told.
pub(crate) type Item = MISSION_ITEM_INT_DATA;
/// System and component of a ground station.
pub(crate) type Peer = (u8, u8);

/// Silence after which an item is asked for again, s, and after which an upload is given up.
const ASK_AGAIN_S: f64 = 1.0;
const GIVE_UP_S: f64 = 8.0;

/// What a list has to say.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Answer {
    /// It has so many items.
    Count(usize),
    /// One of them, in the form in which it was asked for.
    Item { item: Item, in_floats: bool },
    /// How something ended.
    Ack(MavMissionResult),
    /// It waits for the item of this number.
    Request(u16),
    /// To be said to the people on the ground.
    Text(MavSeverity, &'static str),
}

/// An upload under way.
#[derive(Debug, Clone)]
struct Upload {
    from: Peer,
    items: Vec<Item>,
    next: u16,
    last: u16,
    heard_at: SimTime,
    asked_at: SimTime,
}

/// The items of one kind on board.
#[derive(Debug, Clone)]
pub(crate) struct ItemList {
    kind: MavMissionType,
    items: Vec<Item>,
    upload: Option<Upload>,
}

impl ItemList {
    pub(crate) fn new(kind: MavMissionType, items: Vec<Item>) -> Self {
        Self {
            kind,
            items,
            upload: None,
        }
    }

    pub(crate) fn kind(&self) -> MavMissionType {
        self.kind
    }

    pub(crate) fn items(&self) -> &[Item] {
        &self.items
    }

    /// Most items taken: what an autopilot with 16 kB of storage has room for.
    fn capacity(&self) -> usize {
        match self.kind {
            MavMissionType::MAV_MISSION_TYPE_MISSION => 724,
            MavMissionType::MAV_MISSION_TYPE_FENCE => 255,
            _ => 30,
        }
    }

    /// MISSION_REQUEST_LIST.
    pub(crate) fn request_list(&self) -> Answer {
        if self.upload.is_some() {
            Answer::Ack(DENIED)
        } else {
            Answer::Count(self.items.len())
        }
    }

    /// MISSION_REQUEST_INT, or MISSION_REQUEST where the answer is `in_floats`. Item 0 of a mission is
    /// `home`, uploaded or not.
    pub(crate) fn request(&self, seq: u16, home: &Item, in_floats: bool) -> Vec<Answer> {
        let is_mission = self.kind == MavMissionType::MAV_MISSION_TYPE_MISSION;
        if self.upload.is_some() {
            return vec![Answer::Ack(DENIED)];
        }
        if is_mission && seq == 0 {
            let item = home.clone();
            return vec![Answer::Item { item, in_floats }];
        }
        match self.items.get(usize::from(seq)) {
            Some(item) => vec![Answer::Item {
                item: item.clone(),
                in_floats,
            }],
            // The peer may assume another length, so the answer includes the true one.
            None => vec![
                Answer::Count(self.items.len()),
                Answer::Ack(INVALID_SEQUENCE),
            ],
        }
    }

    /// MISSION_CLEAR_ALL; what flies is not cleared.
    pub(crate) fn clear(&mut self, in_use: bool) -> MavMissionResult {
        if self.upload.is_some() || in_use {
            return ERROR;
        }
        self.items.clear();
        ACCEPTED
    }

    /// MISSION_COUNT.
    pub(crate) fn count(&mut self, count: u16, from: Peer, now: SimTime) -> Vec<Answer> {
        // Who uploads may begin anew; nobody else may cut in.
        if self.upload.as_ref().is_some_and(|u| u.from != from) {
            return vec![Answer::Ack(DENIED)];
        }
        self.upload = None;
        if usize::from(count) > self.capacity() {
            return vec![Answer::Ack(NO_SPACE)];
        }
        let Some(last) = count.checked_sub(1) else {
            self.items.clear();
            return self.ended(ACCEPTED);
        };
        self.begin(Vec::new(), 0, last, from, now)
    }

    /// MISSION_WRITE_PARTIAL_LIST: items within the list, and one past its end.
    pub(crate) fn write_partial(
        &mut self,
        start: i16,
        end: i16,
        from: Peer,
        now: SimTime,
    ) -> Vec<Answer> {
        let within = |index: i16| {
            u16::try_from(index)
                .ok()
                .filter(|&k| usize::from(k) <= self.items.len())
        };
        let (Some(first), Some(last)) = (within(start), within(end)) else {
            return reject_partial();
        };
        if last < first {
            return reject_partial();
        }
        self.begin(self.items.clone(), first, last, from, now)
    }

    fn begin(
        &mut self,
        items: Vec<Item>,
        next: u16,
        last: u16,
        from: Peer,
        now: SimTime,
    ) -> Vec<Answer> {
        self.upload = Some(Upload {
            from,
            items,
            next,
            last,
            heard_at: now,
            asked_at: now,
        });
        vec![Answer::Request(next)]
    }

    /// MISSION_ITEM_INT, and MISSION_ITEM turned into it; or why the message holds no item.
    pub(crate) fn item(
        &mut self,
        item: Result<Item, (u16, MavMissionResult)>,
        from: Peer,
        now: SimTime,
    ) -> Vec<Answer> {
        let Some(upload) = &mut self.upload else {
            return vec![Answer::Ack(ERROR)];
        };
        let seq = match &item {
            Ok(item) => item.seq,
            Err((seq, _)) => *seq,
        };
        if seq != upload.next {
            return vec![Answer::Ack(INVALID_SEQUENCE)];
        }
        if from != upload.from {
            return vec![Answer::Ack(DENIED)];
        }
        let checked = item
            .map_err(|(_, why)| why)
            .and_then(|item| checks::stored(self.kind, item, upload.last));
        let place = usize::from(seq);
        match checked {
            Ok(item) if place < upload.items.len() => upload.items[place] = item,
            Ok(item) if place == upload.items.len() => upload.items.push(item),
            Ok(_) => return self.refuse(ERROR),
            Err(why) => return self.refuse(why),
        }
        upload.heard_at = now;
        upload.asked_at = now;
        if upload.next < upload.last {
            upload.next += 1;
            return vec![Answer::Request(upload.next)];
        }
        self.complete()
    }

    fn refuse(&mut self, why: MavMissionResult) -> Vec<Answer> {
        self.upload = None;
        vec![Answer::Ack(why)]
    }

    fn complete(&mut self) -> Vec<Answer> {
        let Some(upload) = self.upload.take() else {
            return Vec::new();
        };
        let is_fence = self.kind == MavMissionType::MAV_MISSION_TYPE_FENCE;
        if is_fence && Fence::from_items(&upload.items).is_none() {
            return vec![Answer::Ack(ERROR)];
        }
        self.items = upload.items;
        self.ended(ACCEPTED)
    }

    fn ended(&self, result: MavMissionResult) -> Vec<Answer> {
        let info = MavSeverity::MAV_SEVERITY_INFO;
        let said = match self.kind {
            MavMissionType::MAV_MISSION_TYPE_MISSION => Some("Flight plan received"),
            MavMissionType::MAV_MISSION_TYPE_RALLY => Some("Rally points received"),
            _ => None,
        };
        let text = said.map(|text| Answer::Text(info, text));
        text.into_iter().chain([Answer::Ack(result)]).collect()
    }

    /// Asks again for an item that has not come, and gives up in the end: what to say, to whom.
    pub(crate) fn remind(&mut self, now: SimTime) -> Option<(Peer, Vec<Answer>)> {
        let upload = self.upload.as_mut()?;
        let from = upload.from;
        if now.since_s(upload.heard_at) > GIVE_UP_S {
            let what = match self.kind {
                MavMissionType::MAV_MISSION_TYPE_MISSION => "Mission upload timeout",
                MavMissionType::MAV_MISSION_TYPE_FENCE => "Fence upload timeout",
                _ => "Rally upload timeout",
            };
            let warning = MavSeverity::MAV_SEVERITY_WARNING;
            let mut said = vec![Answer::Text(warning, what)];
            said.extend(self.refuse(CANCELLED));
            return Some((from, said));
        }
        (now.since_s(upload.asked_at) > ASK_AGAIN_S).then(|| {
            upload.asked_at = now;
            (from, vec![Answer::Request(upload.next)])
        })
    }
}

fn reject_partial() -> Vec<Answer> {
    let warning = MavSeverity::MAV_SEVERITY_WARNING;
    vec![
        Answer::Text(warning, "Flight plan update rejected"),
        Answer::Ack(ERROR),
    ]
}
