//! The world simulator in a process of its own.

use clap::Parser;
use mission::Member;
use programs::agent::HostedMember;
use programs::weather_file::WeatherFile;
use programs::{Failure, agent, failure};
use std::process::ExitCode;

/// Run the world simulator: wind, air and plume for simulated vehicles, corrected by real readings
#[derive(Debug, Parser)]
#[command(
    name = "ws",
    version,
    about,
    after_help = "Example: ws --scenario scenarios/as-pontes.toml"
)]
struct Arguments {
    #[command(flatten)]
    bus: agent::BusArguments,
}

fn main() -> ExitCode {
    let arguments = failure::arguments::<Arguments>();
    failure::exit(agent::run(&arguments.bus, false, |setup| {
        let member = Member::world(setup).map_err(Failure::input)?;
        let weather = WeatherFile::of(setup, &arguments.bus.scenario)?;
        Ok(vec![HostedMember::from(member).with_weather(weather)])
    }))
}
