//! The exchange about the fence on board, and how that compares with the mission's.

use crate::dialect::{MISSION_ITEM_INT_DATA, MavCmd};
use crate::telemetry::distance_m;
use air::geo::Geodetic;
use protocol::SimTime;

/// Corners nearer than this are the same, m: latitudes and longitudes come in 1 cm.
const SAME_M: f64 = 1.0;
/// Most items that are read: a field's fence has some tens.
const MOST_ITEMS: u16 = 200;

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
pub(super) enum Question {
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
    pub(super) wanted: Vec<Geodetic>,
    /// What is asked, when it was sent, and how often.
    pub(super) question: Option<(Question, Option<SimTime>, u32)>,
    count: u16,
    items: Vec<MISSION_ITEM_INT_DATA>,
    pub(super) found: Option<FenceOnBoard>,
    pub(super) uploaded: bool,
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

    pub(super) fn ask(&mut self, question: Question) {
        self.question = Some((question, None, 0));
    }

    /// What is to be sent at `now`, `timeout_s` after it was sent last; given up after `attempts`.
    pub(super) fn due(&mut self, now: SimTime, timeout_s: f64, attempts: u32) -> Option<Question> {
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
    pub(super) fn counted(&mut self, count: u16) -> bool {
        if !matches!(self.question, Some((Question::List, ..))) {
            return false;
        }
        self.count = count.min(MOST_ITEMS);
        self.next_item()
    }

    /// Receives an item; true if it was the last.
    pub(super) fn item(&mut self, item: &MISSION_ITEM_INT_DATA) -> bool {
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
