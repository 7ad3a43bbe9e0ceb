//! Payloads of the bus: no panic, no allocation beyond the limit, and what is accepted is written back
//! as the same message.
//!
//! The first byte chooses the topic, the second bincode or JSON.

#![no_main]

use libfuzzer_sys::fuzz_target;
use protocol::{Envelope, Topic};

const PATHS: [&str; 16] = [
    "va/1/state",
    "va/1/reading",
    "va/1/mode",
    "va/1/event",
    "va/1/setpoint",
    "va/1/control",
    "va/1/mavlink/rx",
    "ws/main/ambient/1",
    "ws/main/model",
    "ws/main/event",
    "sc/main/population",
    "sc/main/observation",
    "sc/main/plan",
    "sc/main/extension",
    "clock/main/tick",
    "clock/main/done/va/1",
];

fuzz_target!(|data: &[u8]| {
    let [topic, coding, payload @ ..] = data else {
        return;
    };
    let path = PATHS[usize::from(*topic) % PATHS.len()];
    let Ok(topic) = Topic::parse_path(path) else {
        panic!("{path} is a topic");
    };
    if coding % 2 == 0 {
        if let Ok(envelope) = Envelope::from_bytes(&topic, payload) {
            // By bytes, for a number that is not one does not equal itself.
            let bytes = envelope.to_bytes();
            let again = Envelope::from_bytes(&topic, &bytes).map(|e| e.to_bytes());
            assert_eq!(again, Ok(bytes));
        }
    } else if let Ok(text) = std::str::from_utf8(payload)
        && let Ok(envelope) = Envelope::from_json(&topic, text)
    {
        let again = Envelope::from_json(&topic, &envelope.to_json());
        assert_eq!(again, Ok(envelope));
    }
});
