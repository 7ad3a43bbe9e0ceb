//! `plumage tune`: gains for an aircraft, found in simulation.

use crate::measured::{self, AircraftFile};
use crate::progress::Bar;
use crate::{Failure, ranges, reports};
use fdm::Aircraft;
use fdm::tune::{TuneOrder, TuneReport, tune as search, with_gains};
use record::files;
use std::path::{Path, PathBuf};

/// Most gain sets that are tried: some days of work.
const CANDIDATES: usize = 100_000;

/// Arguments of `plumage tune`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: plumage tune --aircraft aircraft/x8.toml --out out/tune-x8")]
pub struct TuneArguments {
    /// Aircraft to tune (TOML)
    #[arg(long, value_name = "FILE")]
    pub aircraft: PathBuf,
    /// Tune for the aircraft as measured: a flight log (CSV, as for `plumage gap flight`), or the extended.toml from
    /// `plumage gap flight`
    #[arg(long, value_name = "FILE")]
    pub from: Option<PathBuf>,
    /// Seed of the search and its gusts, 0 to 2^63 - 1
    #[arg(
        long,
        value_name = "N",
        value_parser = ranges::seed,
        default_value_t = 1
    )]
    pub seed: u64,
    /// Number of gain sets to try, 1 to 100000
    #[arg(
        long,
        value_name = "N",
        value_parser = ranges::whole(1..=CANDIDATES),
        default_value_t = 300
    )]
    pub candidates: usize,
    /// Folder for report.html, tune.json and the tuned aircraft
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Write into a folder that is not empty, and replace earlier outputs
    #[arg(long)]
    pub force: bool,
}

/// Finds gains and writes them with their report.
///
/// # Errors
/// Wrong input, an aircraft for which no gains with margins are found, or outputs that cannot be
/// written.
pub fn tune(arguments: &TuneArguments) -> Result<(), Failure> {
    let source = source(arguments)?;
    files::prepare_folder(&arguments.out, arguments.force).map_err(Failure::input)?;
    let of = arguments.candidates as u64;
    let bar = Bar::new("trying gains", of, "{wide_bar} {pos}/{len}");
    let order = TuneOrder {
        candidates: arguments.candidates,
        ..TuneOrder::new(arguments.seed)
    };
    let report = search(&source.aircraft, &order, &mut |done, of| {
        bar.set_length(of as u64);
        bar.set_position(done as u64);
    })
    .map_err(Failure::input)?;
    bar.finish_and_clear();
    let name = arguments.aircraft.file_name().map_or_else(
        || "aircraft.toml".to_owned(),
        |n| n.to_string_lossy().into_owned(),
    );
    let toml = with_gains(&source.name, &source.text, &report.after.gains)?;
    let json = format!("{:#}\n", serde_json::to_value(&report)?);
    let page = reports::html(&views::tune_report::page(&report, &name));
    let write =
        |name: &str, text: &str| files::write_whole(&arguments.out.join(name), text.as_bytes());
    write(&name, &toml)?;
    write("report.html", &page)?;
    write("tune.json", &json)?;
    tell(&report, &arguments.out, &name);
    Ok(())
}

/// The aircraft that flies, and the text that its new file is made from: that of `--aircraft`; with
/// `--from`, the one that the flight or that file shows, with the gains of `--aircraft`.
fn source(arguments: &TuneArguments) -> Result<AircraftFile, Failure> {
    let base = AircraftFile::read(&arguments.aircraft).map_err(Failure::input)?;
    let Some(from) = &arguments.from else {
        return Ok(base);
    };
    let is_file_of_gap = from.extension().is_some_and(|e| e == "toml");
    if !is_file_of_gap {
        return as_flown(base, from);
    }
    let mut extended = AircraftFile::read(from).map_err(Failure::input)?;
    if extended.aircraft.name != base.aircraft.name {
        return Err(Failure::usage(format!(
            "--from {}: describes aircraft \"{}\", but --aircraft describes \"{}\"; expected the same aircraft",
            from.display(),
            extended.aircraft.name,
            base.aircraft.name
        )));
    }
    if extended.aircraft.mechanism.is_empty() {
        eprintln!(
            "note: {} has no [[mechanism]]; the flight agreed with the aircraft file",
            from.display()
        );
    }
    extended.aircraft.control = base.aircraft.control;
    Ok(extended)
}

/// The aircraft `base` as a measured flight shows it.
fn as_flown(base: AircraftFile, flight: &Path) -> Result<AircraftFile, Failure> {
    let log = measured::flight(flight)?;
    let found = super::gap::flight::analysed(&[log], &base.aircraft)?;
    println!("{}", found.gap.summary);
    let control = base.aircraft.control;
    let text = found.extended.to_toml().map_err(Failure::input)?;
    Ok(AircraftFile {
        name: base.name,
        text,
        aircraft: Aircraft {
            control,
            ..found.extended
        },
    })
}

fn tell(report: &TuneReport, folder: &Path, file: &str) {
    let (before, after) = (&report.before, &report.after);
    println!(
        "{}: hold-out cost {:.2} -> {:.2}{}",
        report.aircraft,
        before.held_out_cost,
        after.held_out_cost,
        if report.changed {
            ""
        } else {
            "; no better gains were found, those of the file are kept"
        }
    );
    for (b, a) in before.margins.iter().zip(&after.margins) {
        println!(
            "  {:8} at {:4.1} m/s: {:5.1} -> {:5.1} dB, {:4.0} -> {:4.0}°",
            a.name,
            a.airspeed_m_s,
            b.gain_margin_db,
            a.gain_margin_db,
            b.phase_margin_deg,
            a.phase_margin_deg
        );
    }
    println!(
        "Outputs in {}: {file}, report.html, tune.json",
        folder.display()
    );
}
