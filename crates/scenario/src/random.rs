//! Random numbers of a run: one seed, and a stream of its own for everything that draws.

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

/// The stream of random numbers called `name` (such as `"va/3/sensor"`) of the run with `seed`.
///
/// Streams of different names are independent, so that one more draw in one place changes
/// nothing elsewhere. The 256-bit key is SplitMix64 (Steele et al. 2014) over the seed and the
/// FNV-1a hash of the name.
pub fn stream(seed: u64, name: &str) -> ChaCha8Rng {
    let mut state = name.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let mut key = [0u8; 32];
    for (k, part) in key.chunks_exact_mut(8).enumerate() {
        // The seed enters in two ways, into the output for the first half of the key and into the
        // state for the second: by one alone, runs whose seed XOR hash is equal would share a stream.
        if k == 2 {
            state ^= seed;
        }
        let low = if k < 2 { seed } else { 0 };
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state ^ low;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        part.copy_from_slice(&(z ^ (z >> 31)).to_le_bytes());
    }
    ChaCha8Rng::from_seed(key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;

    #[test]
    fn streams_differ_by_name_and_seed_and_repeat() {
        let draw = |seed, name| stream(seed, name).next_u64();
        assert_eq!(draw(1, "va/3/gps"), draw(1, "va/3/gps"));
        assert_ne!(draw(1, "va/3/gps"), draw(1, "va/4/gps"));
        assert_ne!(draw(1, "va/3/gps"), draw(2, "va/3/gps"));
    }
}
