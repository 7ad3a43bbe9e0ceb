//! Which messages of a mission were said and did not come: every sender numbers what it says.

use protocol::key::AgentKind;
use protocol::{AgentId, Envelope, SimTime};
use std::collections::BTreeMap;

/// What was found of a sender's numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Found {
    /// So many messages, said between these two times, did not come.
    Missing {
        /// How many.
        messages: u64,
        /// When the last one before them was said.
        since: SimTime,
        /// When the first one after them was said.
        until: SimTime,
    },
    /// The sender began anew: its process was started again.
    Restarted,
}

impl Found {
    /// The same in words, of `sender`.
    pub fn words(&self, sender: &AgentId) -> String {
        match self {
            Self::Missing {
                messages,
                since,
                until,
            } => format!(
                "{messages} messages of {sender}, published from {:.1} to {:.1} s, were lost on the way",
                since.s(),
                until.s()
            ),
            Self::Restarted => format!("{sender} restarted: its message numbers begin again"),
        }
    }
}

/// Follows the numbers of all senders.
#[derive(Debug, Clone, Default)]
pub struct Gaps {
    last: BTreeMap<AgentId, (u64, SimTime)>,
    missing: u64,
}

impl Gaps {
    /// Takes in the next message of its sender. The first that is heard of a sender is where it begins.
    pub fn take(&mut self, envelope: &Envelope) -> Option<Found> {
        // Several programs may speak for the operator, and the clock's messages are numbered by ticks.
        if matches!(
            envelope.sender.kind(),
            AgentKind::Operator | AgentKind::Clock
        ) {
            return None;
        }
        let this = (envelope.sequence, envelope.time);
        let known = self.last.get(&envelope.sender).copied();
        if let Some((last, since)) = known
            && envelope.sequence <= last
            && envelope.time <= since
        {
            // Published before, and overtaken by a message on another key: it counted as lost.
            self.missing = self
                .missing
                .saturating_sub(u64::from(envelope.sequence < last));
            return None;
        }
        self.last.insert(envelope.sender.clone(), this);
        let (last, since) = known?;
        if envelope.sequence <= last {
            return Some(Found::Restarted);
        }
        let messages = envelope.sequence - last - 1;
        self.missing += messages;
        (messages > 0).then_some(Found::Missing {
            messages,
            since,
            until: envelope.time,
        })
    }

    /// How many messages did not come so far.
    pub fn missing(&self) -> u64 {
        self.missing
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::Message;
    use protocol::message::Severity;

    fn said(sender: AgentId, sequence: u64, s: f64) -> Envelope {
        Envelope {
            sender,
            sequence,
            time: SimTime::from_s(s),
            message: Message::event(Severity::Info, "x", "y"),
        }
    }

    #[test]
    fn what_did_not_come_is_counted_with_its_times() {
        let mut gaps = Gaps::default();
        // Begins where it is first heard.
        assert_eq!(gaps.take(&said(AgentId::sc(), 41, 4.0)), None);
        assert_eq!(gaps.take(&said(AgentId::ws(), 1, 4.0)), None);
        assert_eq!(gaps.take(&said(AgentId::sc(), 42, 4.0)), None);
        let found = gaps.take(&said(AgentId::sc(), 46, 9.0)).unwrap();
        assert_eq!(
            found.words(&AgentId::sc()),
            "3 messages of sc/main, published from 4.0 to 9.0 s, were lost on the way"
        );
        assert_eq!(gaps.take(&said(AgentId::ws(), 2, 9.0)), None);
        assert_eq!(gaps.missing(), 3);
    }

    #[test]
    fn a_message_that_others_overtook_is_neither_lost_nor_a_restart() {
        let mut gaps = Gaps::default();
        gaps.take(&said(AgentId::sc(), 41, 4.0));
        assert!(gaps.take(&said(AgentId::sc(), 44, 4.02)).is_some());
        assert_eq!(gaps.missing(), 2);
        for sequence in [42, 43, 44] {
            assert_eq!(gaps.take(&said(AgentId::sc(), sequence, 4.0)), None);
        }
        assert_eq!(gaps.take(&said(AgentId::sc(), 45, 4.04)), None);
        assert_eq!(gaps.missing(), 0);
    }

    #[test]
    fn a_sender_that_begins_anew_is_no_gap_and_operators_are_many() {
        let mut gaps = Gaps::default();
        gaps.take(&said(AgentId::sc(), 41, 4.0));
        assert_eq!(
            gaps.take(&said(AgentId::sc(), 1, 9.0)),
            Some(Found::Restarted)
        );
        assert_eq!(gaps.take(&said(AgentId::sc(), 2, 9.0)), None);
        for sequence in [1, 9, 1] {
            assert_eq!(gaps.take(&said(AgentId::operator(), sequence, 9.0)), None);
        }
        assert_eq!(gaps.missing(), 0);
    }
}
