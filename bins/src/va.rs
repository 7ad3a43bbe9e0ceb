//! A virtual aircraft in a process of its own.

use clap::Parser;
use mission::Member;
use shell::{Failure, agent, failure};
use std::process::ExitCode;

/// One vehicle of the team: simulated, a stand-in, or the bridge to a real one, as the scenario
/// says.
#[derive(Debug, Parser)]
#[command(name = "va", version, about)]
struct Arguments {
    #[command(flatten)]
    bus: agent::BusArguments,
    /// Id of the vehicle in the scenario's team
    #[arg(long)]
    id: String,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    failure::exit(agent::run(&arguments.bus, false, |setup| {
        let index = setup.index_of(&arguments.id).map_err(Failure::input)?;
        Member::vehicle(setup, index).map_err(Failure::input)
    }))
}
