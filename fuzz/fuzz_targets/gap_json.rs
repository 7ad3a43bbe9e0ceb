//! Findings that are to be applied: no panic, and a refusal says of which file.

#![no_main]

use gap::applied::Earlier;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Err(refused) = Earlier::parse("gap.json", text) {
        assert!(refused.to_string().contains("gap.json"), "{refused}");
    }
});
