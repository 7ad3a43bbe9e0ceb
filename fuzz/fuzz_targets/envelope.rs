//! Payloads of the bus: no panic, no allocation beyond the limit, and what is accepted is written back
//! as the same message.
//!
//! The first byte chooses the topic, the second bincode or JSON.

#![no_main]

mod topics;

use libfuzzer_sys::fuzz_target;
use protocol::Envelope;

fuzz_target!(|data: &[u8]| {
    let [topic, coding, payload @ ..] = data else {
        return;
    };
    let topic = topics::topic(*topic);
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
