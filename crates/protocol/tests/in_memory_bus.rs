//! The rule of time on the bus: what is said in tick n is heard in tick n + 1, in order.

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
            Event::Computed(_) => {}
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

/// Says an event, and remembers the topics of what it heard.
struct Picky {
    id: AgentId,
    interests: Vec<Interest>,
    heard: Vec<Topic>,
}

impl Agent for Picky {
    fn id(&self) -> &AgentId {
        &self.id
    }
    fn interests(&self) -> Vec<Interest> {
        self.interests.clone()
    }
    fn handle(&mut self, event: Event<'_>, _: SimTime, out: &mut Outbox) {
        match event {
            Event::Message(topic, _) => self.heard.push(topic.clone()),
            Event::Tick => out.event(&self.id, Severity::Info, "here", ""),
            Event::Computed(_) | Event::Stop => {}
        }
    }
}

#[test]
fn everybody_hears_what_its_interests_cover_once_and_in_order() {
    let event = |id: &str| Topic::Event(AgentId::parse(id).unwrap());
    let ids = ["sc/main", "va/1", "va/2", "va/3", "ws/main"];
    for interests in [
        vec![],
        vec![Interest::One(event("va/2"))],
        vec![
            Interest::One(event("ws/main")),
            Interest::One(event("sc/main")),
        ],
        vec![Interest::Everything],
        vec![
            Interest::One(event("va/3")),
            Interest::Everything,
            Interest::One(event("va/3")),
        ],
        vec![Interest::AllStates, Interest::One(event("va/1"))],
        vec![Interest::OfAny(event("va/9"))],
    ] {
        let picky = |id: &str| Picky {
            id: AgentId::parse(id).unwrap(),
            interests: interests.clone(),
            heard: Vec::new(),
        };
        let mut conductor = Conductor::new(ids.into_iter().map(picky).collect(), 20_000_000);
        conductor.step();
        conductor.step();
        for agent in conductor.agents() {
            let own = Topic::Event(agent.id.clone());
            let expected: Vec<Topic> = ids
                .iter()
                .map(|id| event(id))
                .filter(|topic| *topic != own && interests.iter().any(|i| i.covers(topic)))
                .collect();
            assert_eq!(agent.heard, expected, "{} by {interests:?}", agent.id);
        }
    }
}

/// Hands out a job in its first tick, and says each tick whether the result is there.
struct Worker {
    id: AgentId,
    started: bool,
    result: Option<u32>,
}

impl Agent for Worker {
    fn id(&self) -> &AgentId {
        &self.id
    }
    fn interests(&self) -> Vec<Interest> {
        Vec::new()
    }
    fn handle(&mut self, event: Event<'_>, _: SimTime, out: &mut Outbox) {
        if let Event::Computed(result) = event {
            assert_eq!(result.take::<String>(), None, "of another type");
            self.result = result.take::<u32>();
            return assert_eq!(result.take::<u32>(), None, "only once");
        }
        if !std::mem::replace(&mut self.started, true) {
            out.compute(|| {
                std::thread::sleep(std::time::Duration::from_millis(200));
                6_u32 * 7
            });
        }
        out.event(
            &self.id,
            Severity::Info,
            "knows",
            format!("{:?}", self.result),
        );
    }
}

fn worker() -> Conductor<Worker> {
    let worker = Worker {
        id: AgentId::sc(),
        started: false,
        result: None,
    };
    Conductor::new(vec![worker], 20_000_000)
}

/// How often the worker has spoken before it said `text`.
fn ticks_before(conductor: &mut Conductor<Worker>, text: &str) -> u64 {
    loop {
        let tick = conductor.next_tick();
        let Message::Event(event) = &conductor.step()[0].1.message else {
            panic!("an event")
        };
        if event.text == text {
            return tick;
        }
    }
}

#[test]
fn a_job_is_computed_beside_the_ticks_and_its_result_comes_at_a_fixed_one() {
    for _ in 0..2 {
        // 5 s of ticks of 20 ms, which take no time: the run waits for what is computed.
        assert_eq!(ticks_before(&mut worker(), "Some(42)"), 250);
    }
    // By the wall clock it comes when it is there, and the ticks go on meanwhile.
    assert!(ticks_before(&mut worker().in_real_time(), "Some(42)") > 1000);
}

#[test]
fn a_stop_waits_for_what_is_computed() {
    for mut conductor in [worker(), worker().in_real_time()] {
        conductor.step();
        let Message::Event(last) = &conductor.stop()[0].1.message else {
            panic!("an event")
        };
        assert_eq!(last.text, "Some(42)");
    }
}
