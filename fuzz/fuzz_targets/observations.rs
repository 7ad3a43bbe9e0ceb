//! Observation tables: no panic, and accepted rows, written as CSV, are the same rows.

#![no_main]

use libfuzzer_sys::fuzz_target;
use scenario::observations::parse;

fuzz_target!(|text: &str| {
    if let Ok(read) = parse(&[("fuzz.csv", text)]) {
        let written = read.to_csv();
        match parse(&[("written.csv", &written)]) {
            Ok(again) => assert_eq!((again.rows, again.platforms), (read.rows, read.platforms)),
            Err(refused) => panic!("{refused}:\n{written}"),
        }
    }
});
