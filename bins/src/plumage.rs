//! The one command a newcomer needs.

use clap::{CommandFactory as _, Parser, Subcommand};
use programs::commands::{
    calibrate, campaign, conduct, control, doctor, export, fdm_server, feed, flux, foxglove, gap,
    import, keys, plan, replay, run, shell, swap, tune, watch,
};
use programs::failure;
use std::process::ExitCode;
use std::sync::LazyLock;

/// Fly teams of simulated and real aircraft that find and map the plume of an air-pollution source
#[derive(Debug, Parser)]
#[command(name = "plumage", version = version(), about, after_help = AFTER_HELP)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

/// Version, commit and features. The commit is that of the environment variable `PLUMAGE_COMMIT` while it is built: a build
/// that looked for it by itself would be linked anew after each commit.
fn version() -> &'static str {
    static VERSION: LazyLock<String> = LazyLock::new(version_words);
    &VERSION
}

fn version_words() -> String {
    let commit = option_env!("PLUMAGE_COMMIT").filter(|commit| !commit.is_empty());
    let features = [
        ("mbtiles", cfg!(feature = "mbtiles")),
        ("spreadsheets", cfg!(feature = "spreadsheets")),
    ];
    let features: Vec<&str> = features.iter().filter(|f| f.1).map(|f| f.0).collect();
    let features = match &features[..] {
        [] => "none".to_owned(),
        some => some.join(", "),
    };
    format!(
        "{} (commit {}; features: {features})",
        env!("CARGO_PKG_VERSION"),
        commit.unwrap_or("not stated")
    )
}

const AFTER_HELP: &str = "\
Example: plumage run scenarios/as-pontes.toml

Each command has an example: plumage COMMAND --help

Exit codes:
  0    success
  1    failure, or a comparison that found a difference
  2    wrong usage or input; the error states what was expected
  3    a process of a lockstep run stopped responding; the error names it
  130  interrupted (Ctrl-C) before the program could finish
  141  the reader of the output closed it";

#[derive(Debug, Subcommand)]
enum Command {
    /// Fly a mission in one process
    Run(run::RunArguments),
    /// Calibrate a scenario with measured observations
    Calibrate(calibrate::CalibrateArguments),
    /// Estimate an emission rate from measured observations
    Flux(flux::FluxArguments),
    /// Find what the simulation gets wrong about measured data, and extend it
    #[command(subcommand)]
    Gap(gap::GapCommand),
    /// Convert logs (CSV, ULog, DataFlash, tlog, DJI …) to observations or flights
    Import(import::ImportArguments),
    /// Export a recording or observations to CSV, GeoJSON, NetCDF, KML, ROS 2 …
    Export(export::ExportArguments),
    /// Conduct a lockstep run of agents in separate processes
    Conduct(conduct::ConductArguments),
    /// Take over, hand back or call home vehicles of a running mission
    Control(control::ControlArguments),
    /// Replace a vehicle of a running mission by a real or simulated aircraft
    Swap(swap::SwapArguments),
    /// Feed measured observations into a running mission
    Feed(feed::FeedArguments),
    /// Create keys and certificates for the hosts of a mission
    #[command(subcommand)]
    Keys(keys::KeysCommand),
    /// Serve the live page of a running mission
    Watch(watch::WatchArguments),
    /// Stream a running mission to Foxglove
    Foxglove(foxglove::FoxgloveArguments),
    /// Check a recording, re-simulate it or show it on a page
    Replay(replay::ReplayArguments),
    /// Fly a scenario with many seeds, strategies and team sizes, and compare
    Campaign(campaign::CampaignArguments),
    /// Predict what a mission would detect, and with what uncertainty
    Plan(plan::PlanArguments),
    /// Tune the autopilot gains of an aircraft in simulation
    Tune(tune::TuneArguments),
    /// Serve the flight model to an external ArduPilot SITL
    FdmServer(fdm_server::FdmServerArguments),
    /// Check that this machine has what missions need
    Doctor(doctor::DoctorArguments),
    /// Print shell completions
    Completions(shell::CompletionsArguments),
    /// Write manual pages
    Man(shell::ManArguments),
}

fn main() -> ExitCode {
    failure::exit(match &failure::arguments::<Arguments>().command {
        Command::Run(arguments) => run::run(arguments),
        Command::Calibrate(arguments) => calibrate::calibrate(arguments),
        Command::Flux(arguments) => flux::flux(arguments),
        Command::Gap(command) => gap::gap(command),
        Command::Import(arguments) => import::import(arguments),
        Command::Export(arguments) => export::export(arguments),
        Command::Conduct(arguments) => conduct::conduct(arguments),
        Command::Control(arguments) => control::control(arguments),
        Command::Swap(arguments) => swap::swap(arguments),
        Command::Feed(arguments) => feed::feed(arguments),
        Command::Keys(command) => keys::keys(command),
        Command::Watch(arguments) => watch::watch(arguments),
        Command::Foxglove(arguments) => foxglove::foxglove(arguments),
        Command::Replay(arguments) => replay::replay(arguments),
        Command::Campaign(arguments) => campaign::campaign(arguments),
        Command::Plan(arguments) => plan::plan(arguments),
        Command::Tune(arguments) => tune::tune(arguments),
        Command::FdmServer(arguments) => fdm_server::fdm_server(arguments),
        Command::Doctor(arguments) => doctor::doctor(arguments),
        Command::Completions(arguments) => shell::completions(arguments, Arguments::command()),
        Command::Man(arguments) => shell::man(arguments, Arguments::command()),
    })
}
