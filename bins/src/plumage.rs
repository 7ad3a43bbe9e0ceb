//! The one command a newcomer needs.

use clap::{CommandFactory as _, Parser, Subcommand};
use programs::commands::{
    calibrate, campaign, conduct, control, doctor, export, fdm_server, feed, foxglove, gap, import,
    keys, plan, replay, run, shell, swap, tune, watch,
};
use programs::failure;
use std::process::ExitCode;

/// Mixed-reality simulation of UAV teams that find and map the plume of an air-pollution source.
#[derive(Debug, Parser)]
#[command(name = "plumage", version, about, after_help = EXIT_CODES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 done; 1 it failed, or a comparison differs; 2 wrong usage or input; 141 nobody read what it said";

#[derive(Debug, Subcommand)]
enum Command {
    /// Fly a mission in one process
    Run(run::RunArguments),
    /// Correct a scenario by measured observations
    Calibrate(calibrate::CalibrateArguments),
    /// Show what a model gets wrong, name the cause, extend it and measure the gain
    #[command(subcommand)]
    Gap(gap::GapCommand),
    /// Make observations or a flight of logs as people have them
    Import(import::ImportArguments),
    /// Write a recording or observations in formats of other people's tools
    Export(export::ExportArguments),
    /// Conduct a lockstep run whose agents are processes of their own
    Conduct(conduct::ConductArguments),
    /// Hand vehicles back or take them over in a mission that runs in processes
    Control(control::ControlArguments),
    /// Put another aircraft in a vehicle's place in a mission that runs in processes
    Swap(swap::SwapArguments),
    /// Pass observations into a mission that runs in processes, as a real vehicle's
    Feed(feed::FeedArguments),
    /// Make what lets the hosts of a mission, and nobody else, onto its bus
    #[command(subcommand)]
    Keys(keys::KeysCommand),
    /// Show the page of a mission that runs in processes
    Watch(watch::WatchArguments),
    /// Show a mission that runs in processes live in Foxglove
    Foxglove(foxglove::FoxgloveArguments),
    /// Read a recording and, with --verify, fly it again and compare, or, with --serve, show it on a page
    Replay(replay::ReplayArguments),
    /// Fly one scenario with many seeds and tabulate what was found
    Campaign(campaign::CampaignArguments),
    /// Tell before a flight what the team could detect, and with what ±
    Plan(plan::PlanArguments),
    /// Find an aircraft's gains in simulation and judge them
    Tune(tune::TuneArguments),
    /// Fly an aircraft for an autopilot that runs elsewhere
    FdmServer(fdm_server::FdmServerArguments),
    /// Look at what this machine has of what missions need
    Doctor(doctor::DoctorArguments),
    /// Print the completions of a shell
    Completions(shell::CompletionsArguments),
    /// Write the manual pages
    Man(shell::ManArguments),
}

fn main() -> ExitCode {
    failure::exit(match &failure::arguments::<Arguments>().command {
        Command::Run(arguments) => run::run(arguments),
        Command::Calibrate(arguments) => calibrate::calibrate(arguments),
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
