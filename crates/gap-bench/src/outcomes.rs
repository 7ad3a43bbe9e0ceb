//! Outcomes of a benchmark, kept in a file as they come, so that an interruption loses none.

use anyhow::{Context as _, bail};
use gap_bench::Outcome;
use sha2::{Digest, Sha256};
use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// A file of outcomes that more are appended to.
pub(super) struct Outcomes {
    path: PathBuf,
    /// The file, and the first error met.
    file: Mutex<(File, Option<std::io::Error>)>,
}

/// What tells this build of the program from others: their outcomes are not its own.
pub(super) fn this_build() -> anyhow::Result<String> {
    // By its bytes: a version number does not change with every change that may change a verdict.
    let program = std::env::current_exe().context("cannot find the path of this program")?;
    let bytes = std::fs::read(&program).with_context(|| program.display().to_string())?;
    let digest = Sha256::digest(&bytes);
    Ok(digest.iter().map(|b| format!("{b:02x}")).collect())
}

impl Outcomes {
    /// Opens or makes the file; gives the outcomes that are in it. Its first line says which
    /// `build` they are of. A last line that was cut off is dropped.
    pub fn open(path: &Path, build: &str) -> anyhow::Result<(Self, Vec<Outcome>)> {
        let name = path.display().to_string();
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(e) => return Err(e).context(name),
        };
        let whole = &text[..text.rfind('\n').map_or(0, |end| end + 1)];
        let mut lines = whole.lines();
        let head = serde_json::json!({ "build": build }).to_string();
        if lines.next().is_some_and(|first| first != head) {
            bail!(
                "{name}: line 1: outcomes of another build of this program; expected {head}, or another file"
            );
        }
        let read = |(k, line): (usize, &str)| {
            serde_json::from_str(line).with_context(|| format!("{name}: line {}", k + 2))
        };
        let known: anyhow::Result<Vec<Outcome>> = lines.enumerate().map(read).collect();
        let known = known?;
        let open = || -> std::io::Result<File> {
            let mut file = OpenOptions::new()
                .create(true)
                .truncate(false)
                .write(true)
                .open(path)?;
            file.set_len(whole.len() as u64)?;
            file.seek(SeekFrom::End(0))?;
            if whole.is_empty() {
                writeln!(file, "{head}")?;
            }
            Ok(file)
        };
        let file = open().with_context(|| name.clone())?;
        let kept = Self {
            path: path.to_path_buf(),
            file: Mutex::new((file, None)),
        };
        Ok((kept, known))
    }

    /// Appends an outcome; what goes wrong is said when the file is closed.
    pub fn keep(&self, outcome: &Outcome) {
        let Ok(mut file) = self.file.lock() else {
            return;
        };
        let line = serde_json::to_string(outcome).map_err(std::io::Error::from);
        let written = line.and_then(|line| writeln!(file.0, "{line}"));
        if let Err(error) = written {
            file.1.get_or_insert(error);
        }
    }

    /// Ends the file.
    pub fn close(self) -> anyhow::Result<()> {
        let failed = self.file.into_inner().ok().and_then(|f| f.1);
        failed.map_or(Ok(()), |error| {
            Err(error).context(self.path.display().to_string())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interrupted_benchmark_goes_on_where_it_was() {
        let mut tasks = gap_bench::plan(1, 0);
        tasks.retain(|t| t.row().starts_with("damaged"));
        tasks.truncate(3);
        let mut options = gap_bench::Options::new(tasks);
        let folder = std::env::temp_dir().join(format!("plumage-outcomes-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("outcomes.jsonl");

        let (kept, known) = Outcomes::open(&path, "one").unwrap();
        assert!(known.is_empty());
        let page = gap_bench::run_with(&options, &|o, _, _| kept.keep(o)).to_markdown();
        kept.close().unwrap();

        // Interrupted in the middle of its last line.
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, &text[..text.len() - 20]).unwrap();
        let (kept, known) = Outcomes::open(&path, "one").unwrap();
        let cases = text.lines().count() - 1;
        assert_eq!(known.len(), cases - 1);
        options.known = known;
        let judged = std::sync::atomic::AtomicUsize::new(0);
        let again = gap_bench::run_with(&options, &|o, _, _| {
            judged.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            kept.keep(o);
        });
        kept.close().unwrap();
        assert_eq!(judged.into_inner(), 1);
        assert_eq!(again.to_markdown(), page);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);

        let other = Outcomes::open(&path, "two").err().unwrap();
        assert!(other.to_string().contains("outcomes of another build"));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
