//! The world simulator in a process of its own.

use clap::Parser;
use mission::Member;
use programs::agent::HostedMember;
use programs::weather_file::WeatherFile;
use programs::{Failure, agent, failure};
use std::process::ExitCode;

/// Wind, air and plume around the simulated vehicles, corrected by what real ones measure.
#[derive(Debug, Parser)]
#[command(name = "ws", version, about)]
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
