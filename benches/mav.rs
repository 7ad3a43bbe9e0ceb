//! What the MAVLink side of a mission costs: a tick of the stand-in, a tick of the bridge, and
//! finding frames in a stream, beside the reader of the crate `mavlink`.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use mav_bridge::dialect::MavMessage;
use mav_bridge::wire::FrameDecoder;
use mav_bridge::{Bridge, BridgeConfig, BridgeOutput};
use mavlink::{MavlinkReader, MavlinkVersion};
use protocol::SimTime;
use protocol::message::{PathKind, Setpoint};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use scenario::Scenario;
use stand_in::{StandIn, StandInConfig};

const TICK_NS: i64 = 20_000_000;

/// A stand-in and its bridge in flight, with what is on its way between them.
struct Pair {
    bridge: Bridge,
    vehicle: StandIn,
    tick: u64,
    up: Vec<Vec<u8>>,
    down: Vec<Vec<u8>>,
}

impl Pair {
    fn in_flight() -> Self {
        let scenario = Scenario::parse(
            "as-pontes.toml",
            include_str!("../scenarios/as-pontes.toml"),
        )
        .unwrap();
        let aircraft =
            fdm::Airframe::from_toml("x8.toml", include_str!("../aircraft/x8.toml")).unwrap();
        let config = StandInConfig::from_scenario(&scenario, 5, aircraft).unwrap();
        let bridge = BridgeConfig {
            may_arm: true,
            ..BridgeConfig::default()
        };
        let mut pair = Self {
            bridge: Bridge::new(bridge).unwrap(),
            vehicle: StandIn::new(config, ChaCha8Rng::seed_from_u64(1)).unwrap(),
            tick: 0,
            up: Vec::new(),
            down: Vec::new(),
        };
        let setpoint = Setpoint {
            path: PathKind::TakeOff,
            lat_deg: 43.44,
            lon_deg: -7.84,
            alt_amsl_m: 700.0,
            airspeed_m_s: 18.0,
            orbit_radius_m: 100.0,
        };
        let mut out = BridgeOutput::default();
        for _ in 0..5000 {
            pair.vehicle_tick();
            pair.bridge.setpoint(&setpoint, pair.now(), &mut out);
            pair.bridge_tick();
        }
        assert!(pair.vehicle.truth().alt_amsl_m > 500.0);
        pair
    }

    fn now(&self) -> SimTime {
        SimTime::of_tick(self.tick, TICK_NS)
    }

    fn vehicle_tick(&mut self) {
        self.tick += 1;
        let up = std::mem::take(&mut self.up);
        self.down = self.vehicle.step(self.now(), &up);
    }

    fn bridge_tick(&mut self) {
        let now = self.now();
        let mut out = BridgeOutput::default();
        for bytes in std::mem::take(&mut self.down) {
            self.bridge.receive(&bytes, now, &mut out);
        }
        self.bridge.tick(now, &mut out);
        self.up = out.frames_to_vehicle;
    }
}

fn ticks(c: &mut Criterion) {
    let mut pair = Pair::in_flight();
    c.bench_function("stand-in tick of 20 ms", |b| b.iter(|| pair.vehicle_tick()));
    let mut pair = Pair::in_flight();
    c.bench_function("stand-in and bridge tick of 20 ms", |b| {
        b.iter(|| {
            pair.vehicle_tick();
            pair.bridge_tick();
        });
    });
}

fn frames(c: &mut Criterion) {
    let mut pair = Pair::in_flight();
    let mut stream = Vec::new();
    let mut count = 0;
    for _ in 0..5000 {
        pair.vehicle_tick();
        count += pair.down.len();
        stream.extend(pair.down.concat());
        pair.bridge_tick();
    }
    let mut group = c.benchmark_group("frames of 100 s of telemetry");
    group.throughput(Throughput::Elements(count as u64));
    group.bench_function("found, checked and read here", |b| {
        b.iter_batched(
            FrameDecoder::new,
            |mut decoder| {
                let mut read = 0;
                for datagram in stream.chunks(1000) {
                    decoder.push(datagram);
                    while let Some(frame) = decoder.next_frame(SimTime::ZERO) {
                        read += usize::from(frame.message().is_some());
                    }
                }
                assert_eq!(read, count);
            },
            BatchSize::SmallInput,
        );
    });
    group.bench_function("by the reader of the crate mavlink", |b| {
        b.iter(|| {
            let mut reader = MavlinkReader::new(stream.as_slice());
            let mut read = 0;
            while reader
                .read_message::<MavMessage>(MavlinkVersion::V2)
                .is_ok()
            {
                read += 1;
            }
            assert_eq!(read, count);
        });
    });
    group.finish();
}

criterion_group!(benches, ticks, frames);
criterion_main!(benches);
