//! Virtual aircraft, one or several, in a process of their own.

use clap::Parser;
use programs::agent::{self, VehicleOptions};
use programs::failure;
use std::process::ExitCode;

/// Run vehicles of the team: simulated aircraft, stand-ins or bridges to real aircraft
#[derive(Debug, Parser)]
#[command(
    name = "va",
    version,
    about,
    after_help = "Example: va --scenario scenarios/as-pontes.toml --vehicles 1,2,3"
)]
struct Arguments {
    #[command(flatten)]
    bus: agent::BusArguments,
    /// Ids of the vehicles in the scenario, separated by commas; repeatable
    #[arg(
        long,
        visible_aliases = ["id", "vehicle"],
        value_name = "ID",
        value_delimiter = ',',
        required = true,
        help_heading = "Vehicles"
    )]
    vehicles: Vec<String>,
    /// Show a vehicle in the FlightGear at HOST:PORT, with 50 packets a second; several vehicles need ID=; repeatable
    #[arg(long, value_name = "[ID=]HOST:PORT", help_heading = "Integrations")]
    flightgear: Vec<String>,
}

fn main() -> ExitCode {
    let arguments = failure::arguments::<Arguments>();
    let mut ids: Vec<&str> = arguments.vehicles.iter().map(String::as_str).collect();
    ids.sort_unstable();
    ids.dedup();
    let options = VehicleOptions {
        flightgear: arguments.flightgear.clone(),
        ..VehicleOptions::default()
    };
    failure::exit(agent::run(&arguments.bus, false, |setup| {
        agent::vehicles(setup, &ids, &options)
    }))
}
