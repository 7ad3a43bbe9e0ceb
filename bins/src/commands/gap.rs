//! `plumage gap`: what the simulation gets wrong, why, and what mending it gains.

mod applied;
pub(super) mod flight;
mod output;

use crate::measured::ObservationInput;
use crate::{Failure, measured, mission_files};
use gap::tracer::table::Tables;
use gap::{plume, tracer};
use output::{OutputArguments, names, progress_bar, tell, write};
use record::files;
use std::path::{Path, PathBuf};

/// The kinds of gap.
#[derive(Debug, clap::Subcommand)]
#[command(
    after_help = "Example: plumage gap plume obs.csv --scenario scenarios/as-pontes.toml --out out/gap"
)]
pub enum GapCommand {
    /// Compare measured concentrations along tracks with the plume model
    Plume(PlumeArguments),
    /// Compare tracer trials at fixed samplers with the plume model
    Tracer(TracerArguments),
    /// Compare measured flights with an aircraft model
    Flight(flight::FlightArguments),
}

/// Arguments of `plumage gap plume`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: plumage gap plume obs.csv --scenario scenarios/as-pontes.toml --out out/gap"
)]
pub struct PlumeArguments {
    /// Observations and their scenario
    #[command(flatten)]
    pub input: ObservationInput,
    /// Score the causes in this gap.json, found with other readings, without fitting them again
    #[arg(long, value_name = "GAP_JSON", help_heading = "Input")]
    pub apply: Option<PathBuf>,
    /// Where the answers go
    #[command(flatten)]
    pub output: OutputArguments,
}

/// Arguments of `plumage gap tracer`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: plumage gap tracer --receptors receptors.csv --trials trials.csv --out out/tracer"
)]
pub struct TracerArguments {
    /// Samplers at the ground (CSV); docs/gap-tracer.md lists the columns of receptors.csv
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    pub receptors: PathBuf,
    /// Trials with weather and emission (CSV); docs/gap-tracer.md lists the columns of trials.csv
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    pub trials: PathBuf,
    /// Samplers on towers (CSV); docs/gap-tracer.md lists the columns of towers.csv
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    pub towers: Option<PathBuf>,
    /// Score the extension in this gap.json, found with other trials, without fitting anything
    #[arg(long, value_name = "GAP_JSON", help_heading = "Input")]
    pub apply: Option<PathBuf>,
    /// Where the answers go
    #[command(flatten)]
    pub output: OutputArguments,
}

/// Analyses a gap.
///
/// # Errors
/// Wrong input, or outputs that cannot be written.
pub fn gap(command: &GapCommand) -> Result<(), Failure> {
    match command {
        GapCommand::Plume(arguments) => of_plume(arguments),
        GapCommand::Tracer(arguments) => of_tracer(arguments),
        GapCommand::Flight(arguments) => flight::of_flight(arguments),
    }
}

fn of_plume(arguments: &PlumeArguments) -> Result<(), Failure> {
    let (setup, mut observations) = arguments.input.load()?;
    let title = names(&arguments.input.observations);
    let by_series = measured::fill_wind(&mut observations, &setup).map_err(Failure::input)?;
    measured::tell(&observations.notices);
    let apply = arguments.apply.as_deref();
    let earlier = apply.map(|file| applied::earlier(file, &arguments.output.out));
    let earlier = earlier.transpose()?;
    files::check_folder(&arguments.output.out, arguments.output.force).map_err(Failure::input)?;
    let bar = progress_bar();
    let mut progress = |progress: plume::Progress| {
        bar.set_position((progress.part * 100.0) as u64);
        bar.set_message(progress.doing);
    };
    let question = tasks::gap::Question {
        setup: &setup,
        observations: &observations,
        by_series,
        earlier: earlier.as_ref(),
        seed: arguments.output.seed,
    };
    let (analysis, mut extended) =
        tasks::gap::of_plume(&question, &mut progress).map_err(Failure::input)?;
    bar.finish_and_clear();
    if earlier.is_some() {
        return applied::of_plume(&analysis, &title, &arguments.output);
    }
    mission_files::keep_files(&mut extended, &arguments.input.scenario);
    let report = views::gap_report::plume(&title, &analysis.json, &analysis.report);
    write(
        &arguments.output.out,
        &analysis.json.to_json()?,
        &report,
        &extended.to_toml(),
    )?;
    measured::tell_flaws(&analysis.json.data_quality);
    tell(&analysis.json, "", &arguments.output.out);
    Ok(())
}

fn of_tracer(arguments: &TracerArguments) -> Result<(), Failure> {
    let read = |path: &Path| -> Result<(String, String), Failure> {
        Ok((path.display().to_string(), measured::read(path, "table")?))
    };
    let receptors = read(&arguments.receptors)?;
    let trials = read(&arguments.trials)?;
    let towers = arguments.towers.as_deref().map(read).transpose()?;
    let tables = Tables::parse(
        (&receptors.0, &receptors.1),
        (&trials.0, &trials.1),
        towers.as_ref().map(|t| (t.0.as_str(), t.1.as_str())),
    )
    .map_err(Failure::input)?;
    let title = names(&[arguments.receptors.clone(), arguments.trials.clone()]);
    if let Some(file) = &arguments.apply {
        return applied::to_tracer(&tables, file, &title, &arguments.output);
    }
    files::check_folder(&arguments.output.out, arguments.output.force).map_err(Failure::input)?;
    let bar = progress_bar();
    let report = tracer::analyse(&tables, arguments.output.seed, &mut |part| {
        bar.set_position((part * 100.0) as u64);
    })
    .map_err(Failure::input)?;
    bar.finish_and_clear();
    let page = views::gap_report::tracer(&title, &report);
    write(
        &arguments.output.out,
        &report.to_json()?,
        &page,
        &report.extended_toml,
    )?;
    tell(&report.gap, "air", &arguments.output.out);
    Ok(())
}
