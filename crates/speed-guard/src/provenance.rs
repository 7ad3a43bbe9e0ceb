//! When figures were measured, and of which commit.

use anyhow::{Context as _, ensure};
use std::path::Path;
use std::process::Command;

/// Date and commit as a page of figures names them: `2026-11-28, commit 1a2b3c4`, with `-dirty` behind the commit
/// where the work tree differs from it in more than its pages.
///
/// # Errors
///
/// Without `git`, or where `root` is not in a clone.
pub fn date_and_commit(root: &Path) -> anyhow::Result<String> {
    let date = output(Command::new("date").args(["-u", "+%F"]))?;
    let git = |arguments: &[&str]| output(Command::new("git").arg("-C").arg(root).args(arguments));
    let commit = git(&["rev-parse", "--short", "HEAD"])?;
    let status = ["status", "--porcelain", "-uno", "--", "."];
    let changed = git(&[&status[..], &[":!docs", ":!BENCHMARKS.md"]].concat())?;
    let dirty = if changed.is_empty() { "" } else { "-dirty" };
    Ok(format!("{date}, commit {commit}{dirty}"))
}

fn output(command: &mut Command) -> anyhow::Result<String> {
    let output = command.output().with_context(|| format!("{command:?}"))?;
    let told = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "{command:?}: {told}");
    Ok(String::from_utf8(output.stdout)?.trim().to_owned())
}
