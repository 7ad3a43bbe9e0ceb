//! Payloads of the bus: no panic, no allocation beyond the limit, and what is accepted is written back
//! as the same message.
//!
//! The first byte chooses the topic, the second bincode, JSON or a bundle.

#![no_main]

mod topics;

use libfuzzer_sys::fuzz_target;
use protocol::bundle::{Bundle, entries};
use protocol::{Envelope, Topic};

fuzz_target!(|data: &[u8]| {
    let [topic, coding, payload @ ..] = data else {
        return;
    };
    let topic = topics::topic(*topic);
    if coding % 3 == 2 {
        let (mut again, mut read) = (Bundle::default(), 0);
        for (path, bytes) in entries(payload).map_while(Result::ok) {
            let Ok(topic) = Topic::parse_path(path) else {
                return;
            };
            again.add(&topic, bytes);
            read += 2 * size_of::<u32>() + path.len() + bytes.len();
        }
        assert_eq!(again.take(), payload[..read]);
    } else if coding % 3 == 0 {
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
