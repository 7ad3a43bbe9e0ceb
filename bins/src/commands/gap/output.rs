//! What the kinds of gap share of their outputs: options, files and what is printed.

use crate::progress::Bar;
use crate::{Failure, ranges, reports};
use formats::number::plus_minus;
use record::files;
use std::path::{Path, PathBuf};
use views::Document;

/// Where the answers go.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Outputs")]
pub struct OutputArguments {
    /// Folder for gap.json, report.html and extended.toml
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Write into a folder that is not empty, and replace earlier outputs
    #[arg(long)]
    pub force: bool,
    /// Seed of the bootstrap, 0 to 2^63 - 1
    #[arg(
        long,
        value_name = "N",
        value_parser = ranges::seed,
        default_value_t = 1
    )]
    pub seed: u64,
}

pub(super) fn progress_bar() -> Bar {
    Bar::new(
        "analysing the reality gap, %",
        100,
        "{wide_bar} {pos}/{len} {msg}",
    )
}

pub(super) fn names(files: &[PathBuf]) -> String {
    let names: Vec<String> = files
        .iter()
        .filter_map(|f| Some(f.file_name()?.to_string_lossy().into_owned()))
        .collect();
    names.join(", ")
}

pub(super) fn write(
    folder: &Path,
    json: &str,
    report: &Document,
    extended: &str,
) -> Result<(), Failure> {
    let report = reports::html(report);
    let outputs = [
        ("extended.toml", extended),
        ("report.html", &report),
        ("gap.json", json),
    ];
    let outputs = outputs.map(|(name, text)| (folder.join(name), text.as_bytes()));
    Ok(files::write_set(&outputs)?)
}

/// Prints the verdict and its causes; `platforms` names those to which a cause applies, such
/// as a kind of air.
pub(super) fn tell(json: &gap::verdict::GapJson, platforms: &str, folder: &Path) {
    let verdict = serde_json::to_value(json.verdict).ok();
    println!(
        "verdict: {}",
        verdict.as_ref().and_then(|v| v.as_str()).unwrap_or("?")
    );
    println!("  {}", json.summary);
    tell_causes(&json.causes, platforms);
    let own = json.base.iter().filter(|b| b.platform.is_some());
    for parameter in own {
        let (label, stated) = (parameter.label(), plus_minus(parameter.value, parameter.sd));
        println!("  {label:32} {stated}");
    }
    println!(
        "Outputs in {}: gap.json, report.html, extended.toml",
        folder.display()
    );
}

pub(super) fn tell_causes(causes: &[gap::verdict::Cause], platforms: &str) {
    for cause in causes {
        let of = match &cause.platforms[..] {
            [] => String::new(),
            own if platforms.is_empty() => format!(" of {}", own.join(", ")),
            own => format!(" in {} {platforms}", own.join(", ")),
        };
        println!(
            "  {}{of}{} (probability {:.2})",
            cause.mechanisms.join(" or "),
            cause.onset_after(),
            cause.probability
        );
        for p in &cause.parameters {
            println!(
                "    {} = {}{}",
                p.name,
                plus_minus(p.value, p.sd),
                p.unit_after()
            );
        }
    }
}
