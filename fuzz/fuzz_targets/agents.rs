//! A message of the bus to the agents of a mission: no panic, and no number that is none is said after it.
//!
//! The first byte chooses the topic, the second bincode or JSON, as for `envelope`.

#![no_main]

mod topics;

use libfuzzer_sys::fuzz_target;
use mission::Setup;
use mission::team::Member;
use protocol::{Agent as _, Envelope, Event, Outbox, SimTime};
use std::sync::OnceLock;

/// Ticks before and after the message.
const TICKS: u64 = 25;

fn setup() -> &'static Setup {
    static SETUP: OnceLock<Setup> = OnceLock::new();
    SETUP.get_or_init(|| {
        let no_files = |_: &str| Err("no such file".to_owned());
        let text = include_str!("../../scenarios/as-pontes.toml");
        match Setup::load("as-pontes.toml", text, &no_files) {
            Ok(mut setup) => {
                // Two simulated ones and the stand-in are a team.
                setup.scenario.vehicles.drain(2..5);
                setup
            }
            Err(refused) => panic!("{refused}"),
        }
    })
}

fuzz_target!(|data: &[u8]| {
    let [topic, coding, payload @ ..] = data else {
        return;
    };
    let topic = topics::topic(*topic);
    let envelope = match (coding % 2, std::str::from_utf8(payload)) {
        (1, Ok(text)) => Envelope::from_json(&topic, text),
        (1, _) => return,
        _ => Envelope::from_bytes(&topic, payload),
    };
    let Ok(envelope) = envelope else { return };
    // What the bus lets through.
    if envelope.message.check_numbers(&topic).is_err() {
        return;
    }
    let Ok(mut members) = Member::all(setup()) else {
        panic!("the reference's team");
    };
    for tick in 0..2 * TICKS {
        let now = SimTime::of_tick(tick, setup().tick_ns());
        for member in &mut members {
            let mut out = Outbox::default();
            if tick == TICKS && member.interests().iter().any(|i| i.covers(&topic)) {
                member.handle(Event::Message(&topic, &envelope), now, &mut out);
            }
            member.handle(Event::Tick, now, &mut out);
            for (on, said) in out.messages() {
                assert_eq!(said.check_numbers(on), Ok(()), "{topic:?}");
            }
        }
    }
});
