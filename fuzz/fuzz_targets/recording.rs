//! Recordings: a damaged file is refused or read up to its damage, and never brings the reader down.

#![no_main]

use libfuzzer_sys::fuzz_target;
use record::{observations, read_mcap};

fuzz_target!(|data: &[u8]| {
    let path = std::env::temp_dir().join(format!("plumage-fuzz-{}", std::process::id()));
    if std::fs::write(&path, data).is_ok()
        && let Ok(recording) = read_mcap(&path)
    {
        let _ = recording.digest();
        let _ = observations::of_recording(&recording);
    }
});
