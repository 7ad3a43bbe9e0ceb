//! `plumage gap flight`: measured flights against the aircraft of a file.

use super::output::{OutputArguments, names, progress_bar, tell, write};
use crate::measured::{self, AircraftFile};
use crate::{Failure, reports};
use fdm::Aircraft;
use formats::number::{significant, value_and_sd};
use gap::flight::log::FlightLog;
use gap::flight::{FlightReport, estimate};
use record::files;
use std::path::PathBuf;

/// Arguments of `plumage gap flight`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: plumage gap flight flight.csv --aircraft aircraft/ultrastick-25e.toml --out out/gap-flight"
)]
pub struct FlightArguments {
    /// Measured flights (CSV), one file per flight
    #[arg(required = true)]
    pub flights: Vec<PathBuf>,
    /// Mapping file (TOML) to read logs of other formats, as from `plumage import`
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    pub map: Option<PathBuf>,
    /// Simulator's model of the aircraft that flew (TOML)
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    pub aircraft: PathBuf,
    /// Estimate the aerodynamic coefficients of the aircraft. Mass, inertia and dimensions are kept from the file; its
    /// coefficients are starting values, such as those of a similar aircraft
    #[arg(long, help_heading = "Input")]
    pub estimate: bool,
    /// Where the answers go
    #[command(flatten)]
    pub output: OutputArguments,
}

/// Analyses flights.
pub(super) fn of_flight(arguments: &FlightArguments) -> Result<(), Failure> {
    let file = AircraftFile::read(&arguments.aircraft).map_err(Failure::input)?;
    let aircraft = file.aircraft;
    let logs: Result<Vec<FlightLog>, Failure> = arguments
        .flights
        .iter()
        .map(|file| measured::flight_by(file, arguments.map.as_deref()))
        .collect();
    let logs = logs?;
    files::check_folder(&arguments.output.out, arguments.output.force).map_err(Failure::input)?;
    if arguments.estimate {
        return estimated(&logs, &aircraft, arguments);
    }
    let report = analysed(&logs, &aircraft)?;
    let title = format!("{} of {}", names(&arguments.flights), aircraft.name);
    let page = views::gap_report::flight(&title, &report);
    let extended = report.extended.to_toml().map_err(Failure::input)?;
    write(&arguments.output.out, &report.to_json()?, &page, &extended)?;
    println!("{}", report.gap.summary);
    tell(&report.gap, "", &arguments.output.out);
    Ok(())
}

/// Estimates the aircraft that flew.
fn estimated(
    logs: &[FlightLog],
    aircraft: &Aircraft,
    arguments: &FlightArguments,
) -> Result<(), Failure> {
    let bar = progress_bar();
    let found = estimate::estimate(logs, aircraft, &mut |part| {
        bar.set_position((part * 100.0) as u64);
        bar.set_message("coefficients");
    });
    bar.finish_and_clear();
    let found = found.map_err(Failure::input)?;
    let (out, force) = (&arguments.output.out, arguments.output.force);
    files::prepare_folder(out, force).map_err(Failure::input)?;
    let (json, toml) = (
        found.to_json()?,
        found.aircraft.to_toml().map_err(Failure::input)?,
    );
    let title = format!("{} of {}", names(&arguments.flights), aircraft.name);
    let page = reports::html(&views::gap_report::estimate(&title, &found));
    let outputs = [
        ("estimate.json", json),
        ("aircraft.toml", toml),
        ("report.html", page),
    ];
    let outputs: Vec<_> = outputs
        .iter()
        .map(|(name, text)| (out.join(name), text.as_bytes()))
        .collect();
    files::write_set(&outputs)?;
    measured::tell_flaws(&found.data_quality);
    measured::tell(&found.notices);
    println!("{}", found.summary);
    println!(
        "  {:<28} {:>9} {:>9}   in the file",
        "coefficient", "estimate", "±"
    );
    for c in &found.coefficients {
        let told = if c.told { "" } else { "   not identifiable" };
        let [value, sd] = value_and_sd(c.value, c.sd);
        println!(
            "  {:<28} {value:>9} {sd:>9} {:>9}{told}",
            c.name,
            significant(c.start)
        );
    }
    println!(
        "Outputs in {}: report.html, aircraft.toml, estimate.json",
        out.display()
    );
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
        bar.set_message(gap::flight::doing(part));
    })
    .map_err(Failure::input)?;
    bar.finish_and_clear();
    Ok(report)
}
