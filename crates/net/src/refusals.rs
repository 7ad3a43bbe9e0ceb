//! Reports of rejected messages at a limited rate, so that their sender cannot flood the recording.

use protocol::message::Severity;
use protocol::{AgentId, Outbox, ProtocolError, SimTime};

/// Interval of these reports, s: a person reads no faster, and a stranger must not fill a disk.
const SAY_EVERY_S: f64 = 1.0;

/// Counts rejected messages and reports them at most once a second.
#[derive(Debug, Default)]
pub(crate) struct Refusals {
    first: Option<ProtocolError>,
    untold: u64,
    all: u64,
    last_said: Option<SimTime>,
}

impl Refusals {
    /// Counts one more.
    pub(crate) fn add(&mut self, error: ProtocolError) {
        self.untold += 1;
        self.all += 1;
        self.first.get_or_insert(error);
    }

    /// Publishes the report that is due at `now` through `own`.
    pub(crate) fn say(&mut self, own: &AgentId, now: SimTime, outbox: &mut Outbox) {
        let too_soon = self
            .last_said
            .is_some_and(|last| now.since_s(last) < SAY_EVERY_S);
        let Some(first) = self.first.take_if(|_| !too_soon) else {
            return;
        };
        let text = if self.untold == 1 {
            first.to_string()
        } else {
            format!(
                "{} messages rejected, {} in all; the first: {first}",
                self.untold, self.all
            )
        };
        outbox.event(own, Severity::Warning, "bad-message", text);
        (self.untold, self.last_said) = (0, Some(now));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::message::Message;

    #[test]
    fn a_flood_is_counted_and_told_once_a_second() {
        let own = AgentId::sc();
        let (mut refusals, mut outbox) = (Refusals::default(), Outbox::default());
        // 8,000 a second for 10 s, in ticks of 20 ms; the last tick is that of 9.98 s.
        for tick in 0..500 {
            for _ in 0..160 {
                refusals.add(ProtocolError::UnknownKey("x".to_owned()));
            }
            refusals.say(&own, SimTime::of_tick(tick, 20_000_000), &mut outbox);
        }
        let said: Vec<_> = outbox.drain().collect();
        assert_eq!(said.len(), 10);
        let Message::Event(last) = &said[9].1 else {
            panic!("an event")
        };
        // At 9 s: 50 ticks of 160 since 8 s, and 451 ticks in all.
        assert!(
            last.text
                .starts_with("8000 messages rejected, 72160 in all;"),
            "{}",
            last.text
        );
    }
}
