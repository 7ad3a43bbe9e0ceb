//! Flies a mission from Rust, without any of the programs.
//!
//! ```sh
//! cargo run --release --example fly_a_mission
//! ```
//!
//! A [`Setup`] is a scenario with all files that it names; a [`Run`] is its whole team in this
//! process, in virtual time. Every [`Run::step`] runs one tick and returns its messages.

use anyhow::{Context, Result};
use mission::{Run, Setup};
use protocol::Topic;
use protocol::message::{Message, Model, Reading};
use std::collections::BTreeMap;
use std::fs;

const SCENARIO: &str = "scenarios/as-pontes.toml";

fn main() -> Result<()> {
    // The library opens no file: the caller reads the files that the scenario names.
    let text = fs::read_to_string(SCENARIO).context(SCENARIO)?;
    let read = |file: &str| fs::read(file).map_err(|e| e.to_string());
    let mut setup = Setup::load(SCENARIO, &text, &read)?;
    setup.scenario.mission.seed = 7;
    setup.scenario.mission.duration_s = 900.0;

    let mut highest: BTreeMap<String, Reading> = BTreeMap::new();
    let mut model: Option<Model> = None;
    let mut run = Run::new(&setup)?;
    while !run.ended() {
        for (topic, envelope) in run.step() {
            match (topic, &envelope.message) {
                (Topic::Reading(vehicle), Message::Reading(reading)) => {
                    let best = highest
                        .entry(vehicle.to_string())
                        .or_insert_with(|| reading.clone());
                    if reading.co2_ppm > best.co2_ppm {
                        *best = reading.clone();
                    }
                }
                // Readings of the real vehicles have corrected the model of the simulated world.
                (Topic::Model, Message::Model(corrected)) => model = Some((**corrected).clone()),
                (Topic::Event(agent), Message::Event(event)) => {
                    println!("{:7.1} s  {agent}: {}", envelope.time.s(), event.text);
                }
                _ => {}
            }
        }
    }

    for (vehicle, reading) in &highest {
        let kind = reading.kind;
        println!(
            "vehicle {vehicle} ({kind:?}) read at most {:.0} ppm, at {:.5} N, {:.5} E, {:.0} m AMSL",
            reading.co2_ppm, reading.lat_deg, reading.lon_deg, reading.alt_amsl_m
        );
    }
    if let Some(model) = model {
        println!(
            "after {} real readings the plume runs towards {:.1} ± {:.1}°",
            model.observations, model.axis_deg.value, model.axis_deg.sd
        );
    }
    // The same scenario and seed give the same digest, here and in separate processes.
    println!("digest {}", run.digest());
    Ok(())
}
