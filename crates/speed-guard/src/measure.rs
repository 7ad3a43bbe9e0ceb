//! Runs benches, the mission and the reference loop, and reads how long they took at least.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, ensure};
use serde::Deserialize;
use serde::de::DeserializeOwned;

/// The suite that is no bench but the README's mission.
pub const MISSION: &str = "mission";
/// Runs of the mission, of which the fastest counts.
const MISSIONS: usize = 3;
/// Runs of the reference loop, of which the fastest counts.
const LOOPS: usize = 60;

/// What was measured of one bench.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figure {
    /// Least time of one iteration, s.
    pub least_s: f64,
    /// Elements of an iteration; for the mission its simulated seconds.
    pub elements: Option<f64>,
    /// Least time of the reference loop around it, s.
    pub reference_s: f64,
}

/// Measures all of `suite`, which is `package/bench` or [`MISSION`], by the bench's full name.
pub fn suite(root: &Path, suite: &str) -> anyhow::Result<BTreeMap<String, Figure>> {
    let before_s = reference_s();
    let mut figures = if let Some((package, bench)) = suite.split_once('/') {
        benches(root, package, bench)?
    } else {
        ensure!(
            suite == MISSION,
            "no suite '{suite}': expected package/bench or {MISSION}"
        );
        mission(root)?
    };
    let reference_s = before_s.min(reference_s());
    figures
        .values_mut()
        .for_each(|f| f.reference_s = reference_s);
    Ok(figures)
}

fn benches(root: &Path, package: &str, bench: &str) -> anyhow::Result<BTreeMap<String, Figure>> {
    let home = std::path::absolute(root.join("target/speed-guard/criterion"))?;
    if home.exists() {
        std::fs::remove_dir_all(&home)?;
    }
    let mut cargo = Command::new("cargo");
    cargo
        .current_dir(root)
        .args(["bench", "-p", package, "--bench", bench]);
    run(cargo.env("CRITERION_HOME", &home))?;
    read(&home)
}

/// What criterion left in its folder `home`.
pub fn read(home: &Path) -> anyhow::Result<BTreeMap<String, Figure>> {
    #[derive(Deserialize)]
    struct Named {
        full_id: String,
        throughput: Option<BTreeMap<String, f64>>,
    }
    #[derive(Deserialize)]
    struct Sample {
        iters: Vec<f64>,
        times: Vec<f64>,
    }
    let mut figures = BTreeMap::new();
    let mut folders = vec![home.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
            folders.extend(Some(entry?.path()).filter(|p| p.is_dir()));
        }
        if !folder.ends_with("new") {
            continue;
        }
        let named: Named = json(&folder.join("benchmark.json"))?;
        let sample: Sample = json(&folder.join("sample.json"))?;
        let each_ns = sample.times.iter().zip(&sample.iters).map(|(t, n)| t / n);
        let figure = Figure {
            least_s: each_ns.fold(f64::INFINITY, f64::min) * 1e-9,
            elements: named.throughput.and_then(|t| t.into_values().next()),
            reference_s: f64::NAN,
        };
        figures.insert(named.full_id, figure);
    }
    Ok(figures)
}

/// The README's mission with its recording and without the page.
fn mission(root: &Path) -> anyhow::Result<BTreeMap<String, Figure>> {
    #[derive(Deserialize)]
    struct Summary {
        sim_s: f64,
        wall_s: f64,
    }
    let out: PathBuf = root.join("target/speed-guard/mission");
    let mut best: Option<Summary> = None;
    for _ in 0..MISSIONS {
        let mut cargo = Command::new("cargo");
        cargo.current_dir(root).args([
            "run",
            "--quiet",
            "--release",
            "--bin",
            "plumage",
            "--",
            "run",
        ]);
        cargo.args([
            "scenarios/as-pontes-steady.toml",
            "--speed",
            "max",
            "--no-serve",
            "--force",
            "--out",
        ]);
        run(cargo.arg("target/speed-guard/mission"))?;
        let flown: Summary = json(&out.join("summary.json"))?;
        if best.as_ref().is_none_or(|b| flown.wall_s < b.wall_s) {
            best = Some(flown);
        }
    }
    let figure = best.map(|b| Figure {
        least_s: b.wall_s,
        elements: Some(b.sim_s),
        reference_s: f64::NAN,
    });
    Ok(figure
        .into_iter()
        .map(|f| (MISSION.to_owned(), f))
        .collect())
}

/// Least time of a fixed loop of what simulation does most: dependent sums and products, square
/// roots, exponentials, and reading and writing more memory than the inner caches hold.
fn reference_s() -> f64 {
    let mut cells = vec![0.5_f64; 1 << 18];
    let mut once = || {
        let start = Instant::now();
        let mut sum = 0.0_f64;
        for cell in &mut cells {
            sum = 0.999 * sum + (-*cell).exp() / (1.0 + *cell).sqrt();
            *cell = 0.5 + 0.1 * sum.fract();
        }
        black_box(sum);
        start.elapsed().as_secs_f64()
    };
    (0..LOOPS).map(|_| once()).fold(f64::INFINITY, f64::min)
}

fn run(command: &mut Command) -> anyhow::Result<()> {
    let status = command.status().with_context(|| format!("{command:?}"))?;
    ensure!(status.success(), "{command:?}: {status}");
    Ok(())
}

fn json<T: DeserializeOwned>(file: &Path) -> anyhow::Result<T> {
    let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
    serde_json::from_str(&text).with_context(|| file.display().to_string())
}
