//! The pages `docs/gap-benchmark.md` and `docs/gap-flight-benchmark.md`: how often what was hidden in
//! synthetic data is found, named and mended. Run it from the repository's root.

#[path = "../../../tests/bar/mod.rs"]
mod bar;
mod one_case;
mod outcomes;
#[path = "../../speed-guard/src/provenance.rs"]
mod provenance;

use anyhow::Context as _;
use clap::{CommandFactory as _, Parser as _};
use gap_bench::Line;
use gap_bench::flight::{self, BenchAircraft, FIRST_SEED, FlightShare};
use indicatif::{ProgressBar, ProgressStyle};
use outcomes::Outcomes;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Instant;

/// Benchmark how often the reality gap detects, names and corrects effects hidden in synthetic data
#[derive(Debug, clap::Parser)]
#[command(
    name = "gap-bench",
    version,
    about,
    after_help = "Example: cargo run --release -p gap-bench -- --quick 60 --outcomes outcomes.jsonl"
)]
struct Arguments {
    /// Benchmark flights, not plumes
    #[arg(long, help_heading = "Cases")]
    flight: bool,
    /// Seeds per case, 1 or more
    #[arg(
        long,
        value_name = "COUNT",
        allow_negative_numbers = true,
        default_value_t = 20,
        value_parser = clap::value_parser!(u64).range(1..),
        help_heading = "Cases"
    )]
    seeds: u64,
    /// Run only this many plume cases, 1 or more, spread over all kinds; takes some minutes
    #[arg(
        long,
        value_name = "COUNT",
        conflicts_with = "flight",
        allow_negative_numbers = true,
        value_parser = count,
        help_heading = "Cases"
    )]
    quick: Option<usize>,
    /// What makes the plume cases of --quick
    #[arg(
        long,
        value_enum,
        default_value = "plume",
        requires = "quick",
        help_heading = "Cases"
    )]
    generator: gap_bench::Generator,
    /// Report how the results change when each policy number is halved and doubled, on the cases of --quick
    #[arg(long, requires = "quick")]
    sensitivity: bool,
    /// Threads, 1 or more, each with its own case [default: the number of processors]
    #[arg(long, value_name = "COUNT", allow_negative_numbers = true, value_parser = count)]
    threads: Option<usize>,
    /// Run only the plume case of this seed, 0 or more; write its files, truth and answer to --into
    #[arg(
        long,
        value_name = "SEED",
        allow_negative_numbers = true,
        help_heading = "Cases",
        requires = "into",
        conflicts_with = "flight"
    )]
    case: Option<u64>,
    /// Folder for the files of --case
    #[arg(long, value_name = "DIR", requires = "case", help_heading = "Outputs")]
    into: Option<PathBuf>,
    /// Offset added to every seed of the plume cases, 0 or more, to benchmark on new cases
    #[arg(
        long,
        value_name = "SEED",
        allow_negative_numbers = true,
        default_value_t = 0,
        conflicts_with = "flight",
        help_heading = "Cases"
    )]
    first_seed: u64,
    /// File with the outcome of each case (JSON lines: seed, truth, D, answer, seconds), from which an interrupted
    /// benchmark resumes
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with = "flight",
        help_heading = "Outputs"
    )]
    outcomes: Option<PathBuf>,
    /// Part K of N of the plume cases, every N-th from the K-th on
    #[arg(long, value_name = "K/N", value_parser = shard, conflicts_with = "flight", help_heading = "Cases")]
    shard: Option<(usize, usize)>,
    /// Run only cases whose name contains this text; prints the page, and writes it only to --out
    #[arg(long, value_name = "TEXT", default_value = "", help_heading = "Cases")]
    only: String,
    /// File for the tables (Markdown) [default: docs/gap-benchmark.md, or docs/gap-flight-benchmark.md with --flight]
    #[arg(long, value_name = "FILE", help_heading = "Outputs")]
    out: Option<PathBuf>,
}

/// Reads a count of 1 or more.
fn count(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|count| *count >= 1);
    count.ok_or_else(|| "expected a whole number, 1 or more".to_owned())
}

/// Reads `K/N` with K from 1 to N.
fn shard(text: &str) -> Result<(usize, usize), String> {
    let parts = text.split_once('/');
    let parts = parts.and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
    parts
        .filter(|(k, n)| (1..=*n).contains(k))
        .ok_or_else(|| "expected K/N with K from 1 to N, such as 3/20".to_owned())
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    if let (Some(seed), Some(folder)) = (arguments.case, &arguments.into) {
        return one_case::write((seed, arguments.first_seed), arguments.generator, folder);
    }
    if let (true, Some(count)) = (arguments.sensitivity, arguments.quick) {
        gap_bench::sensitivity(count, arguments.first_seed, &mut |line| println!("{line}"));
        return Ok(());
    }
    let ((page, lines), subject, usual) = if arguments.flight {
        (
            of_flight(&arguments)?,
            "flight",
            "docs/gap-flight-benchmark.md",
        )
    } else {
        (of_plume(&arguments)?, "plume", "docs/gap-benchmark.md")
    };
    let page = with_provenance(&page)?;
    print!("{page}");
    for (what, goal, figure) in &lines {
        if let Some(reached) = gap_bench::reaches(goal, figure) {
            bar::report(
                &format!("benchmark of {subject}, {what}"),
                goal,
                figure,
                reached,
            );
        }
    }
    let part = arguments.quick.is_some() || arguments.shard.is_some() || !arguments.only.is_empty();
    if arguments.out.is_none() && part {
        // A part is no page to publish.
        return Ok(());
    }
    let file = arguments.out.as_deref().unwrap_or(Path::new(usual));
    std::fs::write(file, page).with_context(|| file.display().to_string())
}

/// The page with the date, the commit and the command that made it below its title.
fn with_provenance(page: &str) -> anyhow::Result<String> {
    let options: Vec<String> = std::env::args().skip(1).collect();
    let measured = provenance::date_and_commit(Path::new("."))?;
    let (title, rest) = page.split_once("\n\n").unwrap_or((page, ""));
    Ok(format!(
        "{title}\n\nMeasured: {measured}, by `cargo run --release -p gap-bench -- {}`.\n\n{rest}",
        options.join(" ")
    ))
}

/// The page of plumes, and its rates.
fn of_plume(arguments: &Arguments) -> anyhow::Result<(String, Vec<Line>)> {
    let bar = progress_bar(0);
    let mut tasks = match arguments.quick {
        Some(count) => gap_bench::share_by(count, arguments.first_seed, arguments.generator),
        None => gap_bench::plan(arguments.seeds, arguments.first_seed),
    };
    let rows: std::collections::BTreeSet<String> = tasks.iter().map(|t| t.row()).collect();
    tasks.retain(|t| t.row().contains(&arguments.only));
    if tasks.is_empty() {
        let rows = rows.into_iter().collect::<Vec<_>>().join(", ");
        refuse_only(arguments, "case", &format!("a part of one of: {rows}"));
    }
    if let Some((k, n)) = arguments.shard {
        tasks = tasks.into_iter().skip(k - 1).step_by(n).collect();
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
    Ok((summary.to_markdown(), summary.lines()))
}

/// Aircraft that are flown.
const AIRCRAFT: [&str; 2] = [
    include_str!("../../../aircraft/x8.toml"),
    include_str!("../../../aircraft/ultrastick-25e.toml"),
];

/// The page of flights, and its rates.
fn of_flight(arguments: &Arguments) -> anyhow::Result<(String, Vec<Line>)> {
    let share = FlightShare::published(&arguments.only);
    if !share.holds_any() {
        let expected = "a part of a name in docs/gap-flight-benchmark.md";
        refuse_only(arguments, "kind of flight", expected);
    }
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
    Ok((summary.to_markdown(), summary.lines()))
}

/// Ends the program with code 2, as clap does for an invalid value.
fn refuse_only(arguments: &Arguments, what: &str, expected: &str) -> ! {
    let only = &arguments.only;
    let words = format!("--only {only}: no {what} has this in its name; expected {expected}");
    Arguments::command()
        .error(clap::error::ErrorKind::ValueValidation, words)
        .exit()
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
