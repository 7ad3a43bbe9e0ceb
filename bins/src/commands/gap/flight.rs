//! `plumage gap flight`: measured flights against the aircraft of a file.

use super::{BenchmarkArguments, OutputArguments, names, progress_bar, tell, write};
use crate::Failure;
use crate::measured::{self, AircraftFile};
use fdm::Aircraft;
use gap::flight::FlightReport;
use gap::flight::log::FlightLog;
use gap_bench::flight::{Bird, FIRST_SEED, FlightShare, run};
use record::files;
use std::path::PathBuf;

/// Arguments of `plumage gap flight`.
#[derive(Debug, clap::Args)]
pub struct FlightArguments {
    /// Flight files (CSV), one a flight
    #[arg(required = true)]
    pub flights: Vec<PathBuf>,
    /// The aircraft that flew, as the simulator has it (TOML)
    #[arg(long, value_name = "FILE")]
    pub aircraft: PathBuf,
    /// Where the answers go
    #[command(flatten)]
    pub output: OutputArguments,
}

/// Analyses flights.
pub(super) fn of_flight(arguments: &FlightArguments) -> Result<(), Failure> {
    let aircraft = AircraftFile::read(&arguments.aircraft)?.aircraft;
    let logs: Result<Vec<FlightLog>, Failure> = arguments
        .flights
        .iter()
        .map(|file| measured::flight(file))
        .collect();
    let logs = logs?;
    files::check_folder(&arguments.output.out, arguments.output.force).map_err(Failure::input)?;
    let report = analysed(&logs, &aircraft)?;
    let title = format!("{} of {}", names(&arguments.flights), aircraft.name);
    let page = views::gap_report::flight(&title, &report);
    let extended = report.extended.to_toml().map_err(Failure::input)?;
    write(&arguments.output.out, &report.to_json()?, &page, &extended)?;
    println!("{}", report.gap.summary);
    tell(&report.gap, &arguments.output.out);
    Ok(())
}

/// The gap of flights, behind a progress bar.
pub(in crate::commands) fn analysed(
    logs: &[FlightLog],
    aircraft: &Aircraft,
) -> Result<FlightReport, Failure> {
    let bar = progress_bar();
    let report = gap::flight::analyse(logs, aircraft, &mut |part| {
        bar.set_position((part * 100.0) as u64);
    })
    .map_err(Failure::input)?;
    bar.finish_and_clear();
    Ok(report)
}

/// Aircraft that the benchmark flies.
const BENCHMARK_AIRCRAFT: [&str; 2] = [
    include_str!("../../../../aircraft/x8.toml"),
    include_str!("../../../../aircraft/ultrastick-25e.toml"),
];

/// Runs the benchmark of flight.
pub(super) fn benchmark(arguments: &BenchmarkArguments) -> Result<(), Failure> {
    let birds: Result<Vec<Bird<'_>>, _> = BENCHMARK_AIRCRAFT
        .iter()
        .map(|toml| Bird::new(toml))
        .collect();
    let birds = birds.map_err(Failure::input)?;
    let bar = progress_bar();
    bar.set_length(arguments.seeds);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let summary = run(
        &birds,
        FIRST_SEED,
        arguments.seeds,
        &FlightShare::published(&arguments.only),
        threads,
        &|done, _| bar.set_position(done),
    );
    bar.finish_and_clear();
    let page = summary.to_markdown();
    files::write_whole(&arguments.page(), page.as_bytes()).map_err(Failure::input)?;
    print!("{page}");
    Ok(())
}
