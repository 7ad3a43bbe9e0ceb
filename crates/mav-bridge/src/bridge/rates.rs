//! The messages that the vehicle is asked for: fifty a second at most, so that no radio is flooded, without waiting for the
//! answer to another; and again those that do not come as often as asked. Acknowledgements do not tell
//! which message they are about, arrivals do.

use crate::command_queue::VehicleCommand;
use crate::dialect::MavMessage;
use mavlink::Message as _;
use protocol::SimTime;
use std::collections::VecDeque;

/// Time in which arrivals are counted before what is missing is asked for again, s.
const WINDOW_S: f64 = 3.0;
/// Share of the arrivals asked for that is enough: a third of the frames may be lost.
const ENOUGH: f64 = 0.5;
/// How often a message is asked for.
const ROUNDS: u32 = 4;
/// Time between two requests, s: 44 bytes each then take a third of a radio of 57,600 baud.
const ASK_EVERY_S: f64 = 0.02;

#[derive(Debug, Clone, Copy)]
struct Rate {
    message_id: u32,
    hz: f64,
    arrived: u32,
    comes: bool,
}

/// What was asked for and how much of it comes.
#[derive(Debug, Clone, Default)]
pub(super) struct Rates {
    asked: Vec<Rate>,
    waiting: VecDeque<VehicleCommand>,
    round: u32,
    since: SimTime,
    /// When the last request was made.
    asked_at: Option<SimTime>,
}

/// What is due.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Due {
    /// A message to ask for.
    pub ask: Option<VehicleCommand>,
    /// Those that are given up, with how often they come, in words.
    pub given_up: Option<String>,
}

impl Rates {
    /// Asks for all of `wanted`, message and rate in 1/s, from now on.
    pub(super) fn start(&mut self, wanted: &[(u32, f64)], now: SimTime) {
        let rate = |&(message_id, hz): &(u32, f64)| Rate {
            message_id,
            hz,
            arrived: 0,
            comes: false,
        };
        *self = Self {
            asked: wanted.iter().map(rate).collect(),
            waiting: VecDeque::new(),
            round: 0,
            since: now,
            asked_at: None,
        };
    }

    /// A message has come.
    pub(super) fn arrived(&mut self, message_id: u32) {
        if self.round > ROUNDS {
            return;
        }
        if let Some(rate) = self.asked.iter_mut().find(|r| r.message_id == message_id) {
            rate.arrived += 1;
        }
    }

    /// What is to be done at `now`.
    pub(super) fn due(&mut self, now: SimTime) -> Due {
        let given_up = self.next_round(now);
        let rests = |at: SimTime| now.since_s(at) < ASK_EVERY_S - 1e-9;
        let ask = if self.asked_at.is_some_and(rests) {
            None
        } else {
            self.waiting.pop_front()
        };
        if ask.is_some() {
            self.asked_at = Some(now);
        }
        Due { ask, given_up }
    }

    /// Begins the next round if it is time: what is asked for in it; or words on what is given up.
    fn next_round(&mut self, now: SimTime) -> Option<String> {
        let window_s = now.since_s(self.since);
        if self.asked.is_empty() || self.round > ROUNDS || (self.round > 0 && window_s < WINDOW_S) {
            return None;
        }
        if self.round > 0 {
            for rate in &mut self.asked {
                rate.comes |= f64::from(rate.arrived) >= ENOUGH * rate.hz * window_s;
            }
        }
        let missing: Vec<Rate> = self.asked.iter().filter(|r| !r.comes).copied().collect();
        (self.round, self.since) = (self.round + 1, now);
        for rate in &mut self.asked {
            rate.arrived = 0;
        }
        if missing.is_empty() {
            self.round = ROUNDS + 1;
            return None;
        }
        if self.round > ROUNDS {
            let words = missing.iter().map(|r| {
                let name = MavMessage::default_message_from_id(r.message_id)
                    .map_or_else(|| r.message_id.to_string(), |m| m.message_name().to_owned());
                let comes_hz = f64::from(r.arrived) / window_s;
                format!("{name} ({comes_hz:.1} of {} per second)", r.hz)
            });
            return Some(words.collect::<Vec<_>>().join(", "));
        }
        let ask = |r: &Rate| VehicleCommand::Interval {
            message_id: r.message_id,
            hz: r.hz,
        };
        self.waiting = missing.iter().map(ask).collect();
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_without_waiting_and_again_what_does_not_come() {
        let mut rates = Rates::default();
        let at = SimTime::from_s;
        // Twenty ticks a second.
        let ask = |rates: &mut Rates, from_s: f64, to_s: f64| -> (Vec<u32>, Vec<String>) {
            let (mut ids, mut told) = (Vec::new(), Vec::new());
            for k in 0..((to_s - from_s) * 20.0).round() as u32 {
                let due = rates.due(at(from_s + f64::from(k) / 20.0));
                ids.extend(due.ask.map(|command| match command {
                    VehicleCommand::Interval { message_id, .. } => message_id,
                    other => panic!("{other:?}"),
                }));
                told.extend(due.given_up);
            }
            (ids, told)
        };
        rates.start(&[(33, 10.0), (30, 10.0)], at(0.0));
        assert_eq!(ask(&mut rates, 0.0, 0.1).0, [33, 30]);
        assert!(ask(&mut rates, 0.1, 2.9).0.is_empty());
        // Two thirds of the one come, 1 in a second of the other.
        for k in 0..20 {
            rates.arrived(33);
            if k % 7 == 0 {
                rates.arrived(30);
            }
        }
        assert_eq!(ask(&mut rates, 3.0, 3.5).0, [30]);
        let (ids, told) = ask(&mut rates, 3.5, 20.0);
        assert_eq!(ids, [30, 30]);
        assert_eq!(told, ["ATTITUDE (0.0 of 10 per second)"]);
    }
}
