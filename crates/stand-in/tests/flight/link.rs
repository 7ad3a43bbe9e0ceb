//! What goes over the link, and what becomes of it there.

use mav_bridge::BridgeOutput;
use protocol::SimTime;
use protocol::message::{ControlLevel, PathKind};

use crate::flight::pair::{Pair, setpoint, stand_in_config};

#[test]
fn signed_on_both_sides() {
    let mut config = stand_in_config();
    config.signing = Some(mav_bridge::signing::SigningConfig {
        key: [7; 32],
        link_id: 1,
        epoch_10us: 37_000_000_000_000,
    });
    let mut pair = Pair::with(config, 11);
    pair.take_off();
    assert!(pair.received.iter().all(|f| f[2] & 1 == 1));
    assert_eq!(pair.bridge.statistics().refused_frames, 0);
    // A stranger without the key is not heard.
    let mut out = BridgeOutput::default();
    let forged = Pair::new(1).vehicle.step(SimTime::ZERO, &[]);
    pair.bridge.receive(&forged[0], pair.now(), &mut out);
    assert_eq!(pair.bridge.statistics().refused_frames, 1);
}

#[test]
fn same_seed_same_bytes() {
    let fly = |seed| {
        let mut pair = Pair::new(seed);
        pair.take_off();
        pair.run(20.0);
        (pair.received, pair.sent)
    };
    let first = fly(12);
    assert_eq!(first, fly(12));
    assert_ne!(first.0, fly(13).0);
}

/// Loses every fifth datagram, cuts one in seven short, flips a bit in one in eleven, and puts
/// garbage with start bytes between them.
fn noisy(tick: u64, frames: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
    let mut out = Vec::new();
    for (k, mut frame) in frames.into_iter().enumerate() {
        let n = tick.wrapping_mul(2654435761).wrapping_add(k as u64 * 40503) >> 4;
        if n.is_multiple_of(5) {
            continue;
        }
        if n.is_multiple_of(7) {
            frame.truncate(frame.len() / 2);
        }
        if n.is_multiple_of(11) {
            let at = (n as usize / 11) % frame.len();
            frame[at] ^= 1 << (n % 8);
        }
        out.push(vec![0xFD, 0xFE, (n % 256) as u8]);
        out.push(frame);
    }
    out
}

#[test]
fn flies_over_a_noisy_link() {
    let mut pair = Pair::new(14);
    pair.up = noisy;
    pair.down = noisy;
    pair.take_off();
    pair.setpoint = Some(setpoint(PathKind::GoTo, -800.0, 1500.0, 650.0));
    pair.run(150.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    assert!((pair.distance_m() - 100.0).abs() < 40.0);
    let statistics = pair.bridge.statistics();
    assert!(
        statistics.bad_frames > 100 && statistics.lost_frames > 100,
        "{statistics:?}"
    );
}
