//! The order in which the items of a mission come: jumps, and what is done on the way.

use crate::item_list::{Item, navigates};
use mav_bridge::dialect::MavCmd;
use std::collections::{BTreeMap, VecDeque};

/// Where in a mission it is.
#[derive(Debug, Clone, Default)]
pub(super) struct Sequence {
    /// The item that is flown; 0 before the first.
    pub current: usize,
    /// Items met on the way to it that are still to be done.
    pending: VecDeque<usize>,
    /// When the first of these began to wait, s.
    waits_since_s: Option<f64>,
    /// How often each jump has been made.
    jumps: BTreeMap<usize, u16>,
}

impl Sequence {
    /// On to the next item that is flown; false at the end.
    pub(super) fn advance(&mut self, items: &[Item]) -> bool {
        self.seek(self.current + 1, items)
    }

    /// On to the item at `index`, or the first one after it that is flown.
    pub(super) fn go_to(&mut self, index: usize, items: &[Item]) {
        if !self.seek(index, items) {
            self.current = items.len();
        }
    }

    /// The item flown after the current one, no jump counted; none at the end.
    pub(super) fn after<'a>(&self, items: &'a [Item]) -> Option<&'a Item> {
        let mut ahead = self.clone();
        ahead.advance(items).then(|| &items[ahead.current])
    }

    /// The item to be done next.
    pub(super) fn to_do(&self) -> Option<usize> {
        self.pending.front().copied()
    }

    /// Seconds since the item to be done next began to wait.
    pub(super) fn waited_s(&mut self, time_s: f64) -> f64 {
        time_s - *self.waits_since_s.get_or_insert(time_s)
    }

    /// The item to be done next has been done.
    pub(super) fn done(&mut self) {
        self.pending.pop_front();
        self.waits_since_s = None;
    }

    fn seek(&mut self, from: usize, items: &[Item]) -> bool {
        // What waited for a condition is dropped with the leg on which it was met.
        self.pending.clear();
        self.waits_since_s = None;
        let mut index = from;
        // A ring of jumps with nothing to fly in it is an end.
        for _ in 0..=2 * items.len() {
            let Some(item) = items.get(index) else {
                return false;
            };
            if item.command == MavCmd::MAV_CMD_DO_JUMP {
                index = self.jump(index, item);
                continue;
            }
            if navigates(item.command) {
                self.current = index;
                return true;
            }
            self.pending.push_back(index);
            index += 1;
        }
        false
    }

    /// Where the jump at `index` leads: -1 times is for ever.
    fn jump(&mut self, index: usize, item: &Item) -> usize {
        let made = self.jumps.entry(index).or_default();
        let times = item.param2 as i32;
        if times < 0 || i32::from(*made) < times {
            *made = made.saturating_add(1);
            item.param1 as usize
        } else {
            index + 1
        }
    }
}
