//! What a ground station or anybody sends to the stand-in: no panic, what it answers are frames, and it stays in the
//! world.
//!
//! An input whose first byte is odd is read as payloads and made into frames here.

#![no_main]

mod frames;

use frames::{decoded, frames};
use libfuzzer_sys::fuzz_target;
use mission::Setup;
use protocol::SimTime;
use rand::{SeedableRng as _, rngs::ChaCha8Rng};
use stand_in::{StandIn, StandInConfig};
use std::sync::OnceLock;

/// What ground stations send.
const NUMBERS: [u32; 32] = [
    0, 4, 11, 20, 21, 23, 39, 40, 41, 43, 44, 45, 47, 51, 66, 69, 70, 73, 75, 76, 77, 84, 86, 110, 111, 115, 124, 160,
    232, 244, 256, 300,
];

fn config() -> &'static StandInConfig {
    static CONFIG: OnceLock<StandInConfig> = OnceLock::new();
    CONFIG.get_or_init(|| {
        let no_files = |_: &str| Err("no such file".to_owned());
        let text = include_str!("../../scenarios/as-pontes.toml");
        let setup = Setup::load("as-pontes.toml", text, &no_files);
        match setup.and_then(|setup| setup.stand_in_config(5)) {
            Ok(config) => config,
            Err(refused) => panic!("{refused}"),
        }
    })
}

fuzz_target!(|data: &[u8]| {
    let Some((kind, data)) = data.split_first() else {
        return;
    };
    let stream = match kind % 2 {
        1 => frames(&NUMBERS, 255, data),
        _ => data.to_vec(),
    };
    let Ok(mut vehicle) = StandIn::new(config().clone(), ChaCha8Rng::seed_from_u64(1)) else {
        panic!("the reference's stand-in");
    };
    let pieces: Vec<Vec<u8>> = stream.chunks(64).map(<[u8]>::to_vec).collect();
    // It goes on for a second after the last frame.
    for tick in 0..pieces.len() + 50 {
        let now = SimTime::from_s(0.02 * tick as f64);
        let said = vehicle.step(now, &pieces[tick.min(pieces.len())..(tick + 1).min(pieces.len())]);
        let count = said.len();
        assert_eq!(decoded(said.into_iter()).len(), count);
    }
});
