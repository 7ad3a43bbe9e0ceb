//! Reads a recording of a mission.
//!
//! ```sh
//! cargo run --release --example read_a_recording -- out/as-pontes-1/mission.mcap
//! ```
//!
//! Without a path it records two minutes of a mission first and reads those. A recording holds every
//! message on the bus, the scenario and the seed, so that the file alone suffices. A truncated file
//! is read up to its end.

use anyhow::{Context, Result};
use mission::{Run, Setup};
use protocol::key::Name;
use record::recording::RecordingEnd;
use record::{Recorder, RunInfo, read_mcap};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

fn main() -> Result<()> {
    if let Some(given) = std::env::args().nth(1) {
        return read(Path::new(&given));
    }
    let own = std::env::temp_dir().join(format!("plumage-{}.mcap", std::process::id()));
    record_two_minutes(&own)?;
    read(&own)?;
    fs::remove_file(&own)?;
    Ok(())
}

fn read(path: &Path) -> Result<()> {
    let recording = read_mcap(path)?;
    println!(
        "{}: mission {}, seed {}",
        path.display(),
        recording.info.mission,
        recording.info.seed
    );

    // Every message with its topic, in the order in which it was handled.
    let mut count_by_key: BTreeMap<String, u64> = BTreeMap::new();
    let mut messages = recording.in_order()?;
    for message in messages.by_ref() {
        let (topic, _) = message?;
        *count_by_key.entry(topic.path()).or_default() += 1;
    }
    for (key, count) in &count_by_key {
        println!("{count:7} {key}");
    }
    match messages.ending() {
        RecordingEnd::Complete { .. } => println!("the recording is whole"),
        lost => println!("{}", lost.loss().unwrap_or_default()),
    }

    // Readings of the real vehicles, as rows for calibration and gap analysis.
    let measured = record::observations::of_recording(&recording)?;
    println!(
        "{} readings of real vehicles; the first as CSV:",
        measured.readings()
    );
    for line in measured.to_csv().lines().take(3) {
        println!("  {line}");
    }
    println!("digest {}", recording.digest()?.0);
    Ok(())
}

fn record_two_minutes(path: &Path) -> Result<()> {
    let file = "scenarios/as-pontes.toml";
    let read = |file: &str| fs::read(file).map_err(|e| e.to_string());
    let text = fs::read_to_string(file).context(file)?;
    let mut setup = Setup::load(file, &text, &read)?;
    setup.scenario.mission.duration_s = 120.0;
    let info = RunInfo {
        mission: Name::new(&setup.scenario.mission.name)?,
        scenario_toml: setup.scenario.to_toml(),
        gas: setup.scenario.gas(),
        files: BTreeMap::clone(&setup.files),
        start_unix_ns: setup.scenario.mission.start_unix_ns(),
        state_hz: None,
        seed: setup.scenario.mission.seed,
        versions: BTreeMap::from([("example".to_owned(), "read_a_recording".to_owned())]),
    };
    let mut recorder = Recorder::create(path, &info)?;
    let mut run = Run::new(&setup)?;
    while !run.ended() {
        for (topic, envelope) in run.step() {
            recorder.record(topic, envelope)?;
        }
    }
    recorder.finish(Some(&run.digest()))?;
    Ok(())
}
