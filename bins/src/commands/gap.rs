//! `plumage gap`: what the simulation gets wrong, why, and what mending it gains.

mod extended;
pub(super) mod flight;
mod outcomes;

use crate::{Failure, measured, mission_files};
use gap::tracer::table::Tables;
use gap::{plume, tracer};
use indicatif::{ProgressBar, ProgressStyle};
use outcomes::Outcomes;
use record::files;
use std::path::{Path, PathBuf};

/// The kinds of gap.
#[derive(Debug, clap::Subcommand)]
pub enum GapCommand {
    /// Concentrations along tracks against the plume model
    Plume(PlumeArguments),
    /// A tracer experiment: fixed samplers over many trials
    Tracer(TracerArguments),
    /// Measured flights against the aircraft of a file
    Flight(flight::FlightArguments),
    /// Effects hidden in synthetic data: how often they are found, named and mended
    Benchmark(BenchmarkArguments),
}

/// Arguments of `plumage gap plume`.
#[derive(Debug, clap::Args)]
pub struct PlumeArguments {
    /// Observations (CSV, or MCAP recordings)
    #[arg(required = true)]
    pub observations: Vec<PathBuf>,
    /// Scenario that describes the site and the base model (TOML)
    #[arg(long, value_name = "FILE")]
    pub scenario: PathBuf,
    /// Where the answers go
    #[command(flatten)]
    pub output: OutputArguments,
}

/// Arguments of `plumage gap tracer`.
#[derive(Debug, clap::Args)]
pub struct TracerArguments {
    /// Samplers: receptors.csv
    #[arg(long, value_name = "FILE")]
    pub receptors: PathBuf,
    /// Trials: trials.csv
    #[arg(long, value_name = "FILE")]
    pub trials: PathBuf,
    /// Samplers on towers: towers.csv
    #[arg(long, value_name = "FILE")]
    pub towers: Option<PathBuf>,
    /// Where the answers go
    #[command(flatten)]
    pub output: OutputArguments,
}

/// Where the answers go.
#[derive(Debug, clap::Args)]
pub struct OutputArguments {
    /// Folder for gap.json, report.html and extended.toml
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Write into a folder that holds something, replacing earlier outputs
    #[arg(long)]
    pub force: bool,
    /// Seed of the bootstrap
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// Arguments of `plumage gap benchmark`.
#[derive(Debug, clap::Args)]
pub struct BenchmarkArguments {
    /// Effects in flights instead of plumes
    #[arg(long)]
    pub flight: bool,
    /// Seeds a case
    #[arg(long, default_value_t = 20)]
    pub seeds: u64,
    /// Added to every seed of the plume cases, for figures on cases that nobody has seen
    #[arg(long, default_value_t = 0, conflicts_with = "flight")]
    pub first_seed: u64,
    /// File that keeps each case's outcome (JSON lines): a benchmark that was interrupted goes on
    /// from there
    #[arg(long, value_name = "FILE", conflicts_with = "flight")]
    pub outcomes: Option<PathBuf>,
    /// Only cases whose name contains this
    #[arg(long, default_value = "")]
    pub only: String,
    /// File for the tables (Markdown); docs/gap-benchmark.md or docs/gap-flight-benchmark.md where
    /// none is given
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

impl BenchmarkArguments {
    fn page(&self) -> PathBuf {
        let usual = if self.flight {
            "docs/gap-flight-benchmark.md"
        } else {
            "docs/gap-benchmark.md"
        };
        self.out.clone().unwrap_or_else(|| PathBuf::from(usual))
    }
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
        GapCommand::Benchmark(arguments) if arguments.flight => flight::benchmark(arguments),
        GapCommand::Benchmark(arguments) => benchmark(arguments),
    }
}

fn of_plume(arguments: &PlumeArguments) -> Result<(), Failure> {
    let setup = mission_files::load(&arguments.scenario)?;
    let mut observations = measured::load(&arguments.observations)?;
    let by_series = measured::fill_wind(&mut observations, &setup).map_err(Failure::input)?;
    measured::tell(&observations.notices);
    let base = plume::Setup::new(&setup.scenario).map_err(Failure::input)?;
    files::check_folder(&arguments.output.out, arguments.output.force).map_err(Failure::input)?;
    let bar = progress_bar();
    let options = plume::Options {
        seed: arguments.output.seed,
        ..plume::Options::default()
    };
    let analysis = plume::analyse(&base, &observations, &options, &mut |progress| {
        bar.set_position((progress.part * 100.0) as u64);
        bar.set_message(progress.doing);
    })
    .map_err(Failure::input)?;
    bar.finish_and_clear();
    let mut extended = extended::extended(&setup.scenario, &analysis, by_series);
    mission_files::keep_files(&mut extended, &arguments.scenario);
    let title = names(&arguments.observations);
    let report = views::gap_report::plume(&title, &analysis.json, &analysis.report);
    write(
        &arguments.output.out,
        &analysis.json.to_json()?,
        &report,
        &extended.to_toml(),
    )?;
    tell(&analysis.json, &arguments.output.out);
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
    files::check_folder(&arguments.output.out, arguments.output.force).map_err(Failure::input)?;
    let bar = progress_bar();
    let report = tracer::analyse(&tables, arguments.output.seed, &mut |part| {
        bar.set_position((part * 100.0) as u64);
    })
    .map_err(Failure::input)?;
    bar.finish_and_clear();
    let title = names(&[arguments.receptors.clone(), arguments.trials.clone()]);
    let page = views::gap_report::tracer(&title, &report);
    write(
        &arguments.output.out,
        &report.to_json()?,
        &page,
        &report.extended_toml,
    )?;
    tell(&report.gap, &arguments.output.out);
    Ok(())
}

fn benchmark(arguments: &BenchmarkArguments) -> Result<(), Failure> {
    let bar = progress_bar();
    let mut options = gap_bench::Options::new(arguments.seeds);
    options.only.clone_from(&arguments.only);
    options.first_seed = arguments.first_seed;
    options.threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut kept = None;
    if let Some(file) = &arguments.outcomes {
        let (file, known) = Outcomes::open(file, &outcomes::this_build()?)?;
        options.known = known;
        kept = Some(file);
    }
    let summary = gap_bench::run_with(&options, &|outcome, done, of| {
        if let Some(kept) = &kept {
            kept.keep(outcome);
        }
        bar.set_length(of as u64);
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    kept.map_or(Ok(()), Outcomes::close)?;
    let page = summary.to_markdown();
    files::write_whole(&arguments.page(), page.as_bytes()).map_err(Failure::input)?;
    print!("{page}");
    Ok(())
}

fn progress_bar() -> ProgressBar {
    let bar = ProgressBar::new(100);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} {msg}") {
        bar.set_style(style);
    }
    bar.tick();
    bar
}

fn names(files: &[PathBuf]) -> String {
    let names: Vec<String> = files
        .iter()
        .filter_map(|f| Some(f.file_name()?.to_string_lossy().into_owned()))
        .collect();
    names.join(", ")
}

fn write(folder: &Path, json: &str, report: &str, extended: &str) -> Result<(), Failure> {
    let outputs = [
        ("extended.toml", extended),
        ("report.html", report),
        ("gap.json", json),
    ];
    let outputs = outputs.map(|(name, text)| (folder.join(name), text.as_bytes()));
    Ok(files::write_set(&outputs)?)
}

fn tell(json: &gap::verdict::GapJson, folder: &Path) {
    let verdict = serde_json::to_value(json.verdict).ok();
    println!(
        "verdict: {}",
        verdict.as_ref().and_then(|v| v.as_str()).unwrap_or("?")
    );
    if json.causes.is_empty() {
        println!("  {}", json.summary);
    }
    for cause in &json.causes {
        println!(
            "  {} (probability {:.2})",
            cause.mechanisms.join(" or "),
            cause.probability
        );
        for p in &cause.parameters {
            println!(
                "    {} = {:.4} ± {:.4}{}",
                p.name,
                p.value,
                p.sd,
                p.unit_after()
            );
        }
    }
    println!(
        "Outputs in {}: gap.json, report.html, extended.toml",
        folder.display()
    );
}
