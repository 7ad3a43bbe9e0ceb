//! `plumage replay`: a recording flown again, and whether it comes out the same; or shown on a page.

mod show;

use crate::progress::Waiting;
use crate::{Failure, mission_files};
use mission::fed_vehicle::FedVehicle;
use mission::{Member, Run};
use protocol::key::Name;
use protocol::message::Weather;
use protocol::text::printable;
use protocol::{Message, Topic};
use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;

/// Arguments of `plumage replay`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: plumage replay out/seed-7/mission.mcap --verify")]
pub struct ReplayArguments {
    /// Recording of a mission (MCAP)
    pub recording: PathBuf,
    /// Re-simulate the mission and compare the digests
    #[arg(long, conflicts_with = "serve")]
    pub verify: bool,
    #[command(flatten)]
    show: show::ShowArguments,
}

/// Reads a recording and, if asked, flies it again.
///
/// # Errors
/// A file that is no recording, or a replay that differs.
pub fn replay(arguments: &ReplayArguments) -> Result<(), Failure> {
    let path = &arguments.recording;
    let recording = record::read_mcap(path).map_err(Failure::input)?;
    if arguments.show.serve {
        return show::show(&recording, &arguments.show);
    }
    let reading = Waiting::new("reading the recording");
    let (recorded, ending) = recording.digest().map_err(Failure::input)?;
    drop(reading);
    if let Some(loss) = ending.loss() {
        eprintln!("warning: {}: {}", path.display(), printable(&loss));
    }
    println!(
        "mission {}, seed {}",
        recording.info.mission, recording.info.seed
    );
    println!("digest of the recording     {recorded}");
    if !arguments.verify {
        return Ok(());
    }
    let flying = Waiting::new("re-simulating the mission");
    let setup = mission_files::load_recorded(&recording)?;
    // Where somebody outside has said where to look, the recording has it.
    let mut run = Run::led(&setup).map_err(Failure::input)?;
    let mut last = None;
    let (mut operated, mut weather) = (VecDeque::new(), VecDeque::new());
    let mut fed: BTreeMap<Name, FedVehicle> = BTreeMap::new();
    for envelope in recording.in_order().map_err(Failure::input)? {
        let (topic, envelope) = envelope.map_err(Failure::input)?;
        last = Some(envelope.time);
        match topic {
            Topic::Control(_) | Topic::Destination(_) => {
                operated.push_back((envelope.time, topic, envelope.message));
            }
            Topic::Weather => {
                if let Message::Weather(news) = envelope.message {
                    weather.push_back((envelope.time, news));
                }
            }
            // What was fed in comes from nowhere else than the recording.
            Topic::State(name) | Topic::Reading(name) | Topic::Mode(name)
                if setup.index_of(name.as_str()).is_err() =>
            {
                if !fed.contains_key(&name) {
                    let vehicle = FedVehicle::new(&setup, name.as_str()).map_err(Failure::input)?;
                    fed.insert(name.clone(), vehicle);
                }
                if let Some(vehicle) = fed.get_mut(&name) {
                    vehicle.repeat(envelope.time, envelope.message);
                }
            }
            _ => {}
        }
    }
    for vehicle in fed.into_values() {
        run.join(vehicle).map_err(Failure::input)?;
    }
    // A recording cut short is compared as far as it goes.
    while last.is_some_and(|last| run.now() <= last) && !run.ended() {
        // What an operator did then is done again.
        while let Some((_, topic, message)) = operated.pop_front_if(|o| o.0 <= run.now()) {
            run.say_as_operator(topic, message)
                .map_err(Failure::input)?;
        }
        // What the world learnt of the weather then it learns again.
        while let Some((_, news)) = weather.pop_front_if(|w| w.0 <= run.now()) {
            set_weather(&mut run, news);
        }
        run.step();
    }
    drop(flying);
    let simulated = run.digest();
    println!("digest of the re-simulation {simulated}");
    if simulated != recorded {
        return Err(Failure::Run(anyhow::anyhow!(
            "the re-simulation has another digest than {}",
            path.display()
        )));
    }
    println!("the re-simulation is identical, bit for bit");
    Ok(())
}

fn set_weather(run: &mut Run, weather: Weather) {
    let world = run.members_mut().find_map(|member| match member {
        Member::World(world) => Some(world),
        _ => None,
    });
    if let Some(world) = world {
        world.set_weather(weather);
    }
}
