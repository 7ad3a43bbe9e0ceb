//! The rule of time on the bus: what is said in tick n is heard in tick n + 1, in order.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

use protocol::bus::Conductor;
use protocol::digest::Digest;
use protocol::message::{EventMessage, Severity};
use protocol::{Agent, AgentId, Event, Interest, Message, Outbox, SimTime, Topic};

/// Says what it heard, and its own count.
struct Echo {
    id: AgentId,
    heard: Vec<String>,
    count: u32,
}

impl Agent for Echo {
    fn id(&self) -> &AgentId {
        &self.id
    }
    fn interests(&self) -> Vec<Interest> {
        vec![Interest::Everything]
    }
    fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox) {
        match event {
            Event::Message(_, envelope) => {
                assert!(
                    envelope.time < now,
                    "heard in the tick in which it was said"
                );
                if let Message::Event(EventMessage { text, .. }) = &envelope.message {
                    self.heard.push(text.clone());
                }
            }
            Event::Tick | Event::Stop => {
                for _ in 0..2 {
                    self.count += 1;
                    out.event(
                        &self.id,
                        Severity::Info,
                        "count",
                        format!("{} {}", self.id, self.count),
                    );
                }
            }
        }
    }
}

fn team(order: [&str; 3]) -> Conductor<Echo> {
    let echo = |id: &str| Echo {
        id: AgentId::parse(id).unwrap(),
        heard: Vec::new(),
        count: 0,
    };
    Conductor::new(order.into_iter().map(echo).collect(), 20_000_000)
}

#[test]
fn heard_one_tick_later_in_order_of_sender_and_sequence() {
    let mut conductor = team(["ws/main", "va/2", "sc/main"]);
    conductor.step();
    conductor.step();
    let va = conductor
        .agents()
        .find(|a| a.id == AgentId::va("2").unwrap())
        .unwrap();
    assert_eq!(
        va.heard,
        ["sc/main 1", "sc/main 2", "ws/main 1", "ws/main 2"]
    );
}

#[test]
fn digest_does_not_depend_on_the_order_of_the_team() {
    let digest = |order| {
        let mut conductor = team(order);
        let mut digest = Digest::new();
        for _ in 0..5 {
            for (topic, envelope) in conductor.step() {
                assert!(matches!(topic, Topic::Event(_)));
                digest.add(topic, envelope);
            }
        }
        digest.hex()
    };
    assert_eq!(
        digest(["ws/main", "va/2", "sc/main"]),
        digest(["sc/main", "ws/main", "va/2"])
    );
    assert_ne!(
        digest(["ws/main", "va/2", "sc/main"]),
        digest(["sc/main", "ws/main", "va/3"])
    );
}
