//! The one command a newcomer needs.

use clap::{Parser, Subcommand};
use programs::commands::{
    calibrate, campaign, conduct, control, fdm_server, feed, gap, import, plan, replay, run, swap,
    tune, watch,
};
use programs::failure;
use std::process::ExitCode;

/// Mixed-reality simulation of UAV teams that find and map the plume of an air-pollution source.
#[derive(Debug, Parser)]
#[command(name = "plumage", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

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
    /// Conduct a lockstep run whose agents are processes of their own
    Conduct(conduct::ConductArguments),
    /// Hand vehicles back or take them over in a mission that runs in processes
    Control(control::ControlArguments),
    /// Put another aircraft in a vehicle's place in a mission that runs in processes
    Swap(swap::SwapArguments),
    /// Pass observations into a mission that runs in processes, as a real vehicle's
    Feed(feed::FeedArguments),
    /// Show the page of a mission that runs in processes
    Watch(watch::WatchArguments),
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
}

fn main() -> ExitCode {
    failure::exit(match &Arguments::parse().command {
        Command::Run(arguments) => run::run(arguments),
        Command::Calibrate(arguments) => calibrate::calibrate(arguments),
        Command::Gap(command) => gap::gap(command),
        Command::Import(arguments) => import::import(arguments),
        Command::Conduct(arguments) => conduct::conduct(arguments),
        Command::Control(arguments) => control::control(arguments),
        Command::Swap(arguments) => swap::swap(arguments),
        Command::Feed(arguments) => feed::feed(arguments),
        Command::Watch(arguments) => watch::watch(arguments),
        Command::Replay(arguments) => replay::replay(arguments),
        Command::Campaign(arguments) => campaign::campaign(arguments),
        Command::Plan(arguments) => plan::plan(arguments),
        Command::Tune(arguments) => tune::tune(arguments),
        Command::FdmServer(arguments) => fdm_server::fdm_server(arguments),
    })
}
