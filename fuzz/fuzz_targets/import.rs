//! Logs of other people: no panic, and what is accepted is text.

#![no_main]

use import::map::{LogMap, Map};
use import::run::{Request, run};
use libfuzzer_sys::fuzz_target;
use std::io::{self, Cursor, Read};

fuzz_target!(|bytes: &[u8]| {
    let open = |_| -> io::Result<Box<dyn Read>> { Ok(Box::new(Cursor::new(bytes.to_vec()))) };
    for sorts in [false, true] {
        let mut out = Vec::new();
        let request = Request {
            names: &["log".to_owned()],
            open: &open,
            map: &Map::default(),
            stated: &LogMap::default(),
            offset_s: None,
            sorts,
        };
        if run(&request, &mut out).is_ok() {
            assert!(String::from_utf8(out).is_ok());
        }
    }
});
