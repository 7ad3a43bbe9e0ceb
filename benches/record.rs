//! How many messages a second the recorder writes, on one core.
//!
//! Peer in the same run: the `mcap` writer as it comes, given the JSON ready-made, so that it
//! shows what serialising and small chunks cost.

#![allow(clippy::unwrap_used, missing_docs)]

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use protocol::key::Name;
use protocol::{Envelope, Topic};
use record::{Recorder, RunInfo};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[path = "../crates/record/tests/synthetic/mod.rs"]
mod synthetic;

const TICKS: u64 = 1500;

fn fresh() -> PathBuf {
    let path = std::env::temp_dir().join(format!("plumage-bench-{}.mcap", std::process::id()));
    let _ = std::fs::remove_file(&path);
    path
}

fn ours(path: &Path, said: &[(Topic, Envelope)]) -> u64 {
    let info = RunInfo {
        mission: Name::new("bench").unwrap(),
        scenario_toml: String::new(),
        gas: plume::Gas::Co2,
        files: BTreeMap::new(),
        start_unix_ns: None,
        state_hz: None,
        seed: 1,
        versions: BTreeMap::new(),
    };
    let mut recorder = Recorder::create(path, &info).unwrap();
    for (topic, envelope) in said {
        recorder.record(topic, envelope).unwrap();
    }
    recorder.finish(None).unwrap().messages
}

fn peer(path: &Path, ready: &[(String, u64, String)]) {
    let file = std::io::BufWriter::new(std::fs::File::create(path).unwrap());
    let mut writer = mcap::Writer::new(file).unwrap();
    let mut channels = BTreeMap::new();
    for (key, time_ns, json) in ready {
        let id = *channels.entry(key).or_insert_with(|| {
            writer
                .add_channel(0, key, "json", &BTreeMap::new())
                .unwrap()
        });
        let header = mcap::records::MessageHeader {
            channel_id: id,
            sequence: 0,
            log_time: *time_ns,
            publish_time: *time_ns,
        };
        writer
            .write_to_known_channel(&header, json.as_bytes())
            .unwrap();
    }
    writer.finish().unwrap();
}

fn record(criterion: &mut Criterion) {
    let said: Vec<_> = synthetic::mission(TICKS).collect();
    let ready: Vec<_> = said
        .iter()
        .map(|(topic, e)| (topic.path(), e.time.ns() as u64, e.to_json()))
        .collect();
    let mut group = criterion.benchmark_group("record");
    group
        .throughput(Throughput::Elements(said.len() as u64))
        .sample_size(10);
    group.bench_function("plumage recorder", |b| {
        b.iter_batched(fresh, |path| ours(&path, &said), BatchSize::PerIteration);
    });
    group.bench_function("mcap writer, JSON ready-made", |b| {
        b.iter_batched(fresh, |path| peer(&path, &ready), BatchSize::PerIteration);
    });
    group.finish();
    let _ = std::fs::remove_file(fresh());
}

criterion_group!(benches, record);
criterion_main!(benches);
