//! The squadron controller in a process of its own; it listens for the others and keeps the
//! mission's time.

use clap::Parser;
use mission::Member;
use programs::{Failure, agent, failure};
use std::process::ExitCode;

/// Run the squadron controller: it plans the mission, searches for the peak and keeps the mission's time
#[derive(Debug, Parser)]
#[command(
    name = "sc",
    version,
    about,
    after_help = "Example: sc --scenario scenarios/as-pontes.toml"
)]
struct Arguments {
    #[command(flatten)]
    bus: agent::BusArguments,
}

fn main() -> ExitCode {
    let arguments = failure::arguments::<Arguments>();
    failure::exit(agent::run(&arguments.bus, true, |setup| {
        let member = Member::controller(setup).map_err(Failure::input)?;
        Ok(vec![member.into()])
    }))
}
