//! The squadron controller in a process of its own; it listens for the others and keeps the
//! mission's time.

use clap::Parser;
use mission::Member;
use programs::{Failure, agent, failure};
use std::process::ExitCode;

/// Sends the team through its mission and says where the peak is.
#[derive(Debug, Parser)]
#[command(name = "sc", version, about)]
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
