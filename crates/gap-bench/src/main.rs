//! The pages `docs/gap-benchmark.md` and `docs/gap-flight-benchmark.md`: how often what was hidden in
//! synthetic data is found, named and mended. Run it from the repository's root.

mod one_case;
mod outcomes;

use anyhow::Context as _;
use clap::Parser as _;
use gap_bench::flight::{self, BenchAircraft, FIRST_SEED, FlightShare};
use indicatif::{ProgressBar, ProgressStyle};
use outcomes::Outcomes;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Instant;

/// Effects hidden in synthetic data: how often they are found, named and mended
#[derive(Debug, clap::Parser)]
#[command(name = "gap-bench", version, about)]
struct Arguments {
    /// Effects in flights instead of plumes
    #[arg(long)]
    flight: bool,
    /// Seeds a case
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..))]
    seeds: u64,
    /// Only so many plume cases, spread over all kinds: a look of some minutes
    #[arg(long, value_name = "COUNT", conflicts_with = "flight")]
    quick: Option<usize>,
    /// What moves when each number of the finder's policy is halved and doubled, on the cases of --quick
    #[arg(long, requires = "quick")]
    sensitivity: bool,
    /// Threads, each with a case of its own; as many as there are where none is given
    #[arg(long, value_name = "COUNT")]
    threads: Option<usize>,
    /// Only the plume case of this seed: its files, the truth and the answer are written to --into
    #[arg(
        long,
        value_name = "SEED",
        requires = "into",
        conflicts_with = "flight"
    )]
    case: Option<u64>,
    /// Folder for --case
    #[arg(long, value_name = "FOLDER", requires = "case")]
    into: Option<PathBuf>,
    /// Added to every seed of the plume cases, for figures on cases that nobody has seen
    #[arg(long, default_value_t = 0, conflicts_with = "flight")]
    first_seed: u64,
    /// File that keeps each case's outcome (JSON lines: seed, truth, D, what was said, seconds): a
    /// benchmark that was interrupted goes on from there
    #[arg(long, value_name = "FILE", conflicts_with = "flight")]
    outcomes: Option<PathBuf>,
    /// Only cases whose name contains this; the page is then printed, and written only to --out
    #[arg(long, default_value = "")]
    only: String,
    /// File for the tables (Markdown); docs/gap-benchmark.md or docs/gap-flight-benchmark.md where
    /// none is given
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    if let (Some(seed), Some(folder)) = (arguments.case, &arguments.into) {
        return one_case::write(seed, arguments.first_seed, folder);
    }
    if let (true, Some(count)) = (arguments.sensitivity, arguments.quick) {
        gap_bench::sensitivity(count, arguments.first_seed, &mut |line| println!("{line}"));
        return Ok(());
    }
    let (page, usual) = if arguments.flight {
        (of_flight(&arguments)?, "docs/gap-flight-benchmark.md")
    } else {
        (of_plume(&arguments)?, "docs/gap-benchmark.md")
    };
    print!("{page}");
    if arguments.out.is_none() && (arguments.quick.is_some() || !arguments.only.is_empty()) {
        // A part is no page to publish.
        return Ok(());
    }
    let file = arguments.out.as_deref().unwrap_or(Path::new(usual));
    std::fs::write(file, page).with_context(|| file.display().to_string())
}

fn of_plume(arguments: &Arguments) -> anyhow::Result<String> {
    let bar = progress_bar(0);
    let mut tasks = match arguments.quick {
        Some(count) => gap_bench::share_of(count, arguments.first_seed),
        None => gap_bench::plan(arguments.seeds, arguments.first_seed),
    };
    let rows: std::collections::BTreeSet<String> = tasks.iter().map(|t| t.row()).collect();
    tasks.retain(|t| t.row().contains(&arguments.only));
    if tasks.is_empty() {
        let rows = rows.into_iter().collect::<Vec<_>>().join(", ");
        anyhow::bail!(
            "--only {}: no case is called so; expected a part of one of: {rows}",
            arguments.only
        );
    }
    let mut options = gap_bench::Options::new(tasks);
    options.threads = threads(arguments);
    options.judging = gap_bench::Judging {
        clock_s,
        fly_on: arguments.quick.is_none(),
    };
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
    Ok(summary.to_markdown())
}

/// Aircraft that are flown.
const AIRCRAFT: [&str; 2] = [
    include_str!("../../../aircraft/x8.toml"),
    include_str!("../../../aircraft/ultrastick-25e.toml"),
];

fn of_flight(arguments: &Arguments) -> anyhow::Result<String> {
    let share = FlightShare::published(&arguments.only);
    anyhow::ensure!(
        share.holds_any(),
        "--only {}: no kind of flight is called so; expected a part of a name in docs/gap-flight-benchmark.md",
        arguments.only
    );
    let fleet: Result<Vec<BenchAircraft<'_>>, _> = AIRCRAFT
        .iter()
        .map(|toml| BenchAircraft::new(toml))
        .collect();
    let bar = progress_bar(arguments.seeds);
    let summary = flight::run(
        &fleet?,
        FIRST_SEED,
        arguments.seeds,
        &share,
        threads(arguments),
        &|done, _| bar.set_position(done),
    );
    bar.finish_and_clear();
    Ok(summary.to_markdown())
}

fn threads(arguments: &Arguments) -> usize {
    let all = || std::thread::available_parallelism().map_or(1, usize::from);
    arguments.threads.unwrap_or_else(all)
}

/// Seconds since this was first asked.
fn clock_s() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}

fn progress_bar(of: u64) -> ProgressBar {
    let bar = ProgressBar::new(of);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len}") {
        bar.set_style(style);
    }
    bar.tick();
    bar
}
