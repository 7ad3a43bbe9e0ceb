//! Reported weather: no panic, and what is accepted makes a wind of finite speeds.

#![no_main]

use air::wind::WindProfile;
use libfuzzer_sys::fuzz_target;
use scenario::weather::WeatherReports;

fuzz_target!(|text: &str| {
    let Ok(profile) = WindProfile::new(7.0, 486.0, 240.0, 0.15) else {
        return;
    };
    for near_unix_s in [None, Some(1.795e9)] {
        let Ok(read) = WeatherReports::parse(text, 486.0, near_unix_s) else {
            continue;
        };
        let _ = read.air_at_start(340.0, near_unix_s);
        if let Ok(series) = read.series(&profile, near_unix_s) {
            assert!(series.at(0.0).speed_m_s().is_finite());
        }
    }
});
