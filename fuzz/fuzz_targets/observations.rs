//! Tables of observations: no panic, and accepted rows, written as CSV, are the same rows.

#![no_main]

use libfuzzer_sys::fuzz_target;
use plume::Gas;
use scenario::observations::{ObservationRow, Observations, parse};

/// The rows with their platforms' names. Platforms are numbered as they appear, and rows of one time
/// stand in the order of these numbers, which is another in a file that is ordered by time.
fn rows(of: &Observations) -> Vec<(String, String)> {
    let named = |row: &ObservationRow| {
        let unnumbered = ObservationRow {
            platform: 0,
            ..*row
        };
        (
            of.platforms[row.platform].clone(),
            format!("{unnumbered:?}"),
        )
    };
    let mut rows: Vec<_> = of.rows.iter().map(named).collect();
    rows.sort();
    rows
}

fuzz_target!(|text: &str| {
    for gas in Gas::ALL {
        let Ok(read) = parse(&[("fuzz.csv", text)], gas) else {
            continue;
        };
        let written = read.to_csv();
        match parse(&[("written.csv", &written)], gas) {
            Ok(again) => assert_eq!(rows(&again), rows(&read)),
            Err(refused) => panic!("{refused}:\n{written}"),
        }
    }
});
