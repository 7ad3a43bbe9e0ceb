//! Reports as files: what made them, and as PDF.

use crate::Failure;
use anyhow::Context as _;
use formats::calendar::rfc_3339;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{SystemTime, UNIX_EPOCH};
use tasks::flux::Input;
use views::{Document, Origin};

/// The report as a page that names its program, time, command and inputs.
pub fn html(document: &Document) -> String {
    document.html(&origin())
}

/// This run of this program. Inputs are the files that its command names.
fn origin() -> Origin {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let quoted = words
        .iter()
        .map(|word| match word.contains(char::is_whitespace) {
            true => format!("\"{word}\""),
            false => word.clone(),
        });
    let command: Vec<String> = std::iter::once("plumage".to_owned())
        .chain(quoted)
        .collect();
    let input = |name: &String| {
        let is_file = Path::new(name).is_file();
        let bytes = is_file.then(|| std::fs::read(name).ok()).flatten()?;
        Some((name.clone(), Input::new(name.clone(), &bytes).sha256))
    };
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    Origin {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        made: rfc_3339(now.map_or(0, |now| now.as_secs() as i64 * 1_000_000_000))
            .replace(".000Z", "Z"),
        command: command.join(" "),
        inputs: words.iter().filter_map(input).collect(),
    }
}

/// Names under which Chromium and its relatives are installed.
const BROWSERS: [&str; 6] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
];
/// Time for a report to draw its figures, in milliseconds of the page's own clock.
const DRAWING_MS: u32 = 10_000;

/// Prints a report as PDF to `out`.
///
/// # Errors
/// No browser on the path, or one that prints nothing.
pub fn pdf(report: &Path, out: &Path) -> Result<(), Failure> {
    let browser = browser().ok_or_else(|| {
        Failure::usage(
            "--to pdf: needs Chromium or Chrome on the PATH to print the report; install it (apt install chromium, \
             dnf install chromium, brew install --cask chromium), or print the report in any browser",
        )
    })?;
    let report = report.canonicalize().map_err(Failure::input)?;
    let profile = std::env::temp_dir().join(format!("plumage-pdf-{}", std::process::id()));
    let made = profile.join("report.pdf");
    std::fs::create_dir_all(&profile)?;
    let mut command = Command::new(&browser);
    command
        .args(["--headless", "--disable-gpu", "--no-pdf-header-footer"])
        .arg(format!("--virtual-time-budget={DRAWING_MS}"))
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("--print-to-pdf={}", made.display()))
        .stdin(Stdio::null());
    if is_root() {
        // Chromium refuses its sandbox to root; the page is a local file that loads nothing.
        command.arg("--no-sandbox");
    }
    let printed = command.arg(&report).output();
    let pdf = std::fs::read(&made);
    let _ = std::fs::remove_dir_all(&profile);
    let printed = printed
        .with_context(|| format!("cannot start {}", browser.display()))
        .map_err(Failure::Run)?;
    let pdf = pdf.map_err(|_| {
        let said = String::from_utf8_lossy(&printed.stderr);
        let last = said.lines().last().unwrap_or("no message").to_owned();
        Failure::Run(anyhow::anyhow!(
            "{} printed no PDF: {last}",
            browser.display()
        ))
    })?;
    record::files::write_whole(out, &pdf).map_err(Failure::input)
}

fn browser() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let in_folders = |name: &&str| folders.iter().map(|f| f.join(name)).find(|f| f.is_file());
    BROWSERS.iter().find_map(in_folders)
}

#[cfg(unix)]
fn is_root() -> bool {
    use std::os::unix::fs::MetadataExt as _;
    std::fs::metadata("/proc/self").is_ok_and(|own| own.uid() == 0)
}

#[cfg(not(unix))]
fn is_root() -> bool {
    false
}
