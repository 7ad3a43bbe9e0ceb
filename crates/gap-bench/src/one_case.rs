//! One case of the benchmark as files: what the finder gets, what is true, and what it says.

use anyhow::{Context as _, anyhow};
use gap_bench::{Generator, find, make, plan};
use std::path::Path;

/// Seeds a case that the plan is made for; those of a smaller benchmark are among them.
const SEEDS: u64 = 100;

/// Writes the case of `seed` that `generator` makes to `folder`: `scenario.toml`, the observations, `truth.json` and
/// `gap.json`.
pub(super) fn write(
    (seed, first_seed): (u64, u64),
    generator: Generator,
    folder: &Path,
) -> anyhow::Result<()> {
    let mut tasks = plan(SEEDS, first_seed)
        .into_iter()
        .filter_map(|t| t.by(generator));
    let task = &tasks.find(|t| t.seed == seed).with_context(|| {
        format!("no case has the seed {seed}; expected the --first-seed of the benchmark as well")
    })?;
    let made = make(task).with_context(|| format!("no scene shows {} so strongly", task.row()))?;
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let put = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).with_context(|| path.display().to_string())
    };
    put("scenario.toml", &made.case.scenario_toml)?;
    let files = &made.case.observations;
    for (name, text) in files {
        let name = if files.len() == 1 {
            "observations.csv"
        } else {
            name.as_str()
        };
        put(name, text)?;
    }
    let truth = serde_json::json!({
        "row": task.row(),
        "nats": made.nats,
        "truth": made.case.truth,
    });
    put("truth.json", &serde_json::to_string_pretty(&truth)?)?;
    let json = find(seed, &made.case.scenario_toml, files).map_err(|e| anyhow!(e))?;
    println!("{}: D = {:.1?}\n{}", task.row(), made.nats, json.summary);
    put("gap.json", &json.to_json()?)
}
