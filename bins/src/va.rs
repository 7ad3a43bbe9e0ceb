//! Virtual aircraft, one or several, in a process of their own.

use clap::Parser;
use programs::agent::{self, VehicleOptions};
use programs::failure;
use std::process::ExitCode;

/// Vehicles of the team: simulated, stand-ins, or the bridges to real ones, as the scenario says.
#[derive(Debug, Parser)]
#[command(name = "va", version, about)]
struct Arguments {
    #[command(flatten)]
    bus: agent::BusArguments,
    /// Ids of the vehicles in the scenario's team, apart by commas; may be repeated
    #[arg(long, visible_aliases = ["id", "vehicle"], value_name = "ID", value_delimiter = ',', required = true)]
    vehicles: Vec<String>,
    /// FlightGear that shows a vehicle, 50 packets a second (ID= if there are several vehicles);
    /// may be repeated
    #[arg(long, value_name = "[ID=]HOST:PORT")]
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
