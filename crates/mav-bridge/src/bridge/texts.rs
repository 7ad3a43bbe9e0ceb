//! Forwarding of the vehicle's own texts to the team. A vehicle, or a sender in its name, may send as many as its
//! link carries: repeated ones are only counted.

use crate::event::event;
use protocol::SimTime;
use protocol::message::{EventMessage, Severity};

/// Time in which the same text is passed on once, s: autopilots repeat what does not pass every 30 s, and that is
/// passed on each time.
const WINDOW_S: f64 = 10.0;
/// Different texts passed on in that time: an autopilot that starts sends about ten.
const MOST: usize = 20;

/// Beginning of ArduPilot's answer to a request for a message that it does not have. It is not passed on, because the bridge
/// itself reports once which messages are missing.
const UNKNOWN_MESSAGE: &str = "No ap_message for mavlink id";

/// Code of the events with such texts.
const CODE: &str = "vehicle-says";

/// The text of a field up to its first zero.
pub(super) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

/// A text that was passed on, and how often it came again since.
#[derive(Debug, Clone)]
struct Passed {
    severity: Severity,
    text: String,
    again: u32,
}

/// The texts of the last while.
#[derive(Debug, Clone, Default)]
pub(super) struct Texts {
    since: SimTime,
    passed: Vec<Passed>,
    /// Texts beyond [`MOST`].
    others: u32,
}

impl Texts {
    /// Takes in a text: the event that passes it on, or none where it is counted.
    pub(super) fn take(
        &mut self,
        severity: Severity,
        text: &str,
        now: SimTime,
    ) -> Option<EventMessage> {
        if text.starts_with(UNKNOWN_MESSAGE) {
            return None;
        }
        if let Some(known) = self.passed.iter_mut().find(|p| p.text == text) {
            known.again += 1;
            return None;
        }
        if self.passed.len() >= MOST {
            self.others += 1;
            return None;
        }
        if self.passed.is_empty() {
            self.since = now;
        }
        self.passed.push(Passed {
            severity,
            text: text.to_owned(),
            again: 0,
        });
        Some(event(severity, CODE, text))
    }

    /// The counts, after the interval.
    pub(super) fn counted(&mut self, now: SimTime) -> Vec<EventMessage> {
        if self.passed.is_empty() || now.since_s(self.since) < WINDOW_S {
            return Vec::new();
        }
        let passed = std::mem::take(&mut self.passed);
        let again = passed.into_iter().filter(|p| p.again > 0).map(|p| {
            let text = format!("{} ({} more times in {WINDOW_S:.0} s)", p.text, p.again);
            event(p.severity, CODE, text)
        });
        let others = std::mem::take(&mut self.others);
        let others = (others > 0).then(|| {
            let text = format!("{others} further texts in {WINDOW_S:.0} s are not shown");
            event(Severity::Warning, CODE, text)
        });
        again.chain(others).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_is_counted_and_what_comes_every_half_minute_is_not() {
        let mut texts = Texts::default();
        let mut told = Vec::new();
        for k in 0..3000u32 {
            let now = SimTime::from_s(f64::from(k) / 50.0);
            told.extend(texts.counted(now));
            // The same text 50 times a second for half a minute, and another every 30 s.
            if k < 1500 {
                told.extend(texts.take(Severity::Warning, "PreArm: wait", now));
            }
            if k % 1500 == 0 {
                told.extend(texts.take(Severity::Info, "EKF3 ready", now));
            }
        }
        let words: Vec<&str> = told.iter().map(|e| e.text.as_str()).collect();
        let counted = "PreArm: wait (499 more times in 10 s)";
        assert_eq!(
            words,
            [
                "PreArm: wait",
                "EKF3 ready",
                counted,
                "PreArm: wait",
                counted,
                "PreArm: wait",
                counted,
                "EKF3 ready",
            ]
        );
    }

    #[test]
    fn a_hundred_different_texts_are_twenty_and_a_number() {
        let mut texts = Texts::default();
        let take = |k: u32| texts.take(Severity::Info, &format!("text {k}"), SimTime::ZERO);
        assert_eq!((0..100).filter_map(take).count(), 20);
        let counted = texts.counted(SimTime::from_s(10.0));
        assert_eq!(counted.len(), 1);
        assert_eq!(counted[0].text, "80 further texts in 10 s are not shown");
    }

    /// As ArduPlane and ArduCopter 4.7.0-dev write it.
    #[test]
    fn the_answer_to_a_request_of_the_bridge_is_no_news() {
        let mut texts = Texts::default();
        let text = "No ap_message for mavlink id (12920)";
        assert!(texts.take(Severity::Info, text, SimTime::ZERO).is_none());
    }
}
