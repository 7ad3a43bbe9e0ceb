//! Holds the speed of benches and of a mission against `benches/baseline.toml`, and writes the
//! figures into BENCHMARKS.md.
//!
//! Machines differ, so no time is compared as it is: the least time of a bench is divided by the
//! least time of a peer in the same run, or of a reference loop run before and after it, and that
//! ratio is compared with the one in the repository. A suite in which something seems too slow is
//! measured again, twice at most, and the least ratios count: a busy machine only ever slows down.

mod baseline;
mod measure;
mod provenance;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, ensure};
use baseline::{Baseline, Row};
use clap::Parser;

/// How often a suite is measured at most.
const TRIES: usize = 3;

/// Holds the speed of benches and of a mission against that in the repository: exit code 1 if
/// something is slower than allowed.
#[derive(Parser)]
struct Arguments {
    /// Root of the clone.
    #[arg(long, default_value = ".")]
    root: PathBuf,
    /// Only suites whose name contains this; BENCHMARKS.md is left alone then.
    #[arg(long, default_value = "", conflicts_with = "set_baseline")]
    only: String,
    /// Take the ratios measured for the baseline.
    #[arg(long)]
    set_baseline: bool,
}

fn main() -> anyhow::Result<ExitCode> {
    let arguments = Arguments::parse();
    let root = &arguments.root;
    let file = root.join("benches/baseline.toml");
    let text = std::fs::read_to_string(&file).with_context(|| file.display().to_string())?;
    let mut baseline: Baseline = toml::from_str(&text).context("benches/baseline.toml")?;
    let mut rows = Vec::new();
    for suite in baseline
        .suites
        .iter()
        .filter(|s| s.contains(&arguments.only))
    {
        let tries = if arguments.set_baseline { 1 } else { TRIES };
        rows.extend(best_of(root, &baseline, suite, tries)?);
    }
    let head = format!("{}, {}", provenance::date_and_commit(root)?, machine());
    if arguments.set_baseline {
        baseline.set(&rows, &head);
        std::fs::write(&file, toml::to_string(&baseline)?)?;
    } else if arguments.only.is_empty() {
        baseline.check_all_ran(&rows)?;
    }
    if arguments.only.is_empty() {
        let page = root.join("BENCHMARKS.md");
        let text = std::fs::read_to_string(&page)?;
        std::fs::write(&page, baseline.write_into(&text, &head, &rows)?)?;
    }
    let slow = rows.iter().filter(|r| baseline.is_slow(r));
    let told = slow.inspect(|r| eprintln!("too slow: {}: {:?} of its ratio", r.name, r.change));
    Ok(ExitCode::from(u8::from(told.count() > 0)))
}

/// The rows of a suite, measured again while one is slow, `tries` times at most.
fn best_of(root: &Path, known: &Baseline, suite: &str, tries: usize) -> anyhow::Result<Vec<Row>> {
    let mut best: Vec<Row> = Vec::new();
    for _ in 0..tries {
        let again = known.rows(&measure::suite(root, suite)?)?;
        if best.is_empty() {
            best = again;
        } else {
            for (row, other) in best.iter_mut().zip(again) {
                ensure!(row.name == other.name, "'{}' was run only once", row.name);
                if other.ratio < row.ratio {
                    *row = other;
                }
            }
        }
        if !best.iter().any(|r| known.is_slow(r)) {
            break;
        }
    }
    Ok(best)
}

/// How many cores, and the processor's name as far as the system tells.
fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let told = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = told
        .lines()
        .find_map(|l| l.strip_prefix("model name")?.split_once(": "));
    format!(
        "{cores} cores of {}",
        name.map_or("an unknown processor", |n| n.1)
    )
}
