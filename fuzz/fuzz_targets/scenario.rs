//! Scenario files: no panic, and an accepted one, written with its defaults, is the same scenario.

#![no_main]

use libfuzzer_sys::fuzz_target;
use scenario::Scenario;

fuzz_target!(|text: &str| {
    match Scenario::parse("fuzz.toml", text) {
        Ok(scenario) => {
            let written = scenario.to_toml();
            assert_eq!(
                Scenario::parse("written.toml", &written),
                Ok(scenario.clone()),
                "{written}"
            );
            // What was accepted describes a world or is refused in words.
            let _ = (scenario.dispersion_model(), scenario.in_reality().dispersion_model());
        }
        Err(refused) => assert!(refused.to_string().starts_with("fuzz.toml:")),
    }
});
