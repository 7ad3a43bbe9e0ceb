//! Output folders, and files that appear whole or not at all.

use crate::RecordError;
use std::fs;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Names of all outputs that a command may write into its folder.
const OUTPUTS: [&str; 10] = [
    "mission.mcap",
    "tracks.kml",
    "summary.json",
    "report.html",
    "scenario.toml",
    "gap.json",
    "flux.json",
    "extended.toml",
    "campaign.csv",
    RESERVE,
];

pub(crate) fn failed(
    path: &Path,
    what: &'static str,
) -> impl FnOnce(std::io::Error) -> RecordError {
    let path = path.to_owned();
    move |source| RecordError::File { path, what, source }
}

/// Makes `dir` ready for outputs: creates it, checks that it can be written, and refuses one
/// that holds anything unless `force`; then earlier outputs of ours in it are removed and all
/// else is left alone.
///
/// # Errors
/// [`RecordError::Exists`] or [`RecordError::File`].
pub fn prepare_folder(dir: &Path, force: bool) -> Result<(), RecordError> {
    check_folder(dir, force)?;
    for name in OUTPUTS {
        let path = dir.join(name);
        match fs::remove_file(&path) {
            Err(e) if e.kind() != ErrorKind::NotFound => {
                return Err(failed(&path, "remove the earlier output")(e));
            }
            _ => {}
        }
    }
    Ok(())
}

/// The same without removing anything, for outputs that replace earlier ones only once they are
/// there.
///
/// # Errors
/// [`RecordError::Exists`] or [`RecordError::File`].
pub fn check_folder(dir: &Path, force: bool) -> Result<(), RecordError> {
    fs::create_dir_all(dir).map_err(failed(dir, "create the folder"))?;
    let mut entries = fs::read_dir(dir).map_err(failed(dir, "read the folder"))?;
    if entries.next().is_some() && !force {
        return Err(RecordError::Exists {
            path: dir.to_owned(),
            what: "the folder is not empty",
        });
    }
    let probe = dir.join(".plumage-probe");
    fs::write(&probe, b"").map_err(failed(dir, "write into the folder"))?;
    fs::remove_file(&probe).map_err(failed(&probe, "remove"))
}

/// Writes `bytes` to `path` so that it holds either what it held before or all of `bytes`:
/// into a temporary file beside it, then renamed.
///
/// # Errors
/// [`RecordError::File`].
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), RecordError> {
    write_set(&[(path.to_owned(), bytes)])
}

/// Writes several files that belong together, as [`write_whole`] does one: none is put in place
/// before all are written.
///
/// # Errors
/// [`RecordError::File`].
pub fn write_set(files: &[(PathBuf, &[u8])]) -> Result<(), RecordError> {
    let write = |(path, bytes): &(PathBuf, &[u8])| {
        // Synced before the rename: a system that crashes may else keep the new name with no bytes.
        let written = fs::File::create(beside(path)).and_then(|mut file| {
            file.write_all(bytes)?;
            file.sync_all()
        });
        written.map_err(failed(path, "write"))
    };
    let place = |(path, _): &(PathBuf, &[u8])| {
        fs::rename(beside(path), path).map_err(failed(path, "write"))
    };
    let done = files.iter().try_for_each(write);
    let done = done.and_then(|()| files.iter().try_for_each(place));
    if done.is_err() {
        for (path, _) in files {
            // What is left of the temporary files is of no use; their removal may fail as well.
            let _ = fs::remove_file(beside(path));
        }
    }
    done
}

/// A file that is written piece by piece and is there whole once it is [placed](Self::place), or not at all.
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    /// Where it is written until it is placed: a name of its own, so that two begun for one path do not meet.
    written: PathBuf,
    file: fs::File,
    placed: bool,
}

impl WholeFile {
    /// Begins the file that will be at `path`.
    ///
    /// # Errors
    /// [`RecordError::File`].
    pub fn create(path: &Path) -> Result<Self, RecordError> {
        static BEGUN: AtomicUsize = AtomicUsize::new(0);
        let number = BEGUN.fetch_add(1, Ordering::Relaxed);
        let written = beside(path).with_extension(format!("{number}.tmp"));
        let file = fs::File::create(&written).map_err(failed(path, "write"))?;
        Ok(Self {
            path: path.to_owned(),
            written,
            file,
            placed: false,
        })
    }

    /// Puts what was written in its place.
    ///
    /// # Errors
    /// [`RecordError::File`].
    pub fn place(mut self) -> Result<(), RecordError> {
        let synced = self.file.sync_all();
        synced
            .and_then(|()| fs::rename(&self.written, &self.path))
            .map_err(failed(&self.path, "write"))?;
        self.placed = true;
        Ok(())
    }
}

impl std::io::Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        if !self.placed {
            // What is left of it is of no use; its removal may fail as well.
            let _ = fs::remove_file(&self.written);
        }
    }
}

/// Name of the file that holds space.
const RESERVE: &str = ".plumage-reserve";

/// Space set aside in a folder until it is dropped, so that what is written last finds some on a disk that has
/// filled up meanwhile.
#[derive(Debug)]
pub struct Reserve {
    path: PathBuf,
}

impl Reserve {
    /// Sets `bytes` aside in `dir`.
    ///
    /// # Errors
    /// [`RecordError::File`]: there is no such space.
    pub fn create(dir: &Path, bytes: usize) -> Result<Self, RecordError> {
        let reserve = Self {
            path: dir.join(RESERVE),
        };
        // Written and not only made longer: a file system gives no space to what was never written.
        fs::write(&reserve.path, vec![0; bytes])
            .map_err(failed(&reserve.path, "set space aside"))?;
        Ok(reserve)
    }
}

impl Drop for Reserve {
    fn drop(&mut self) {
        // Where it cannot be removed, what is written next says that there is no space.
        let _ = fs::remove_file(&self.path);
    }
}

fn beside(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.tmp", std::process::id()));
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_set_all_is_replaced_or_nothing() {
        let dir = empty_folder("set");
        fs::create_dir_all(&dir).unwrap();
        let (one, other) = (dir.join("one"), dir.join("no-folder").join("other"));
        write_set(&[(one.clone(), b"before")]).unwrap();
        assert!(write_set(&[(one.clone(), b"after"), (other, b"after")]).is_err());
        assert_eq!(fs::read(&one).unwrap(), b"before");
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 1);
        write_set(&[(one.clone(), b"after"), (dir.join("two"), b"2")]).unwrap();
        assert_eq!(fs::read(&one).unwrap(), b"after");
        fs::remove_dir_all(&dir).unwrap();
    }

    fn empty_folder(name: &str) -> PathBuf {
        let dir = std::env::temp_dir().join(format!("plumage-files-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&dir);
        dir
    }

    #[test]
    fn a_file_in_pieces_is_there_whole_or_not_at_all() {
        let dir = empty_folder("pieces");
        fs::create_dir_all(&dir).unwrap();
        let path = dir.join("x");
        let mut file = WholeFile::create(&path).unwrap();
        file.write_all(b"one").unwrap();
        drop(file);
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 0);
        let mut file = WholeFile::create(&path).unwrap();
        file.write_all(b"one").unwrap();
        file.place().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"one");
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 1);
        fs::remove_dir_all(dir).unwrap();
    }

    #[test]
    fn two_files_begun_for_one_path_do_not_meet() {
        let dir = empty_folder("twice");
        fs::create_dir_all(&dir).unwrap();
        let path = dir.join("x");
        let mut first = WholeFile::create(&path).unwrap();
        let mut second = WholeFile::create(&path).unwrap();
        first.write_all(b"one").unwrap();
        second.write_all(b"two").unwrap();
        drop(first);
        second.place().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 1);
        fs::remove_dir_all(dir).unwrap();
    }

    #[test]
    fn a_folder_with_something_in_it_needs_force() {
        let dir = empty_folder("force");
        prepare_folder(&dir, false).unwrap();
        fs::write(dir.join("mission.mcap"), b"old").unwrap();
        fs::write(dir.join("notes.txt"), b"mine").unwrap();
        let refused = prepare_folder(&dir, false).unwrap_err().to_string();
        assert!(refused.contains("--force"), "{refused}");
        prepare_folder(&dir, true).unwrap();
        assert!(!dir.join("mission.mcap").exists());
        assert_eq!(fs::read(dir.join("notes.txt")).unwrap(), b"mine");
        fs::remove_dir_all(dir).unwrap();
    }

    #[test]
    fn a_folder_below_a_file_is_refused_with_its_path() {
        let dir = empty_folder("below");
        fs::create_dir_all(&dir).unwrap();
        fs::write(dir.join("file"), b"").unwrap();
        let refused = prepare_folder(&dir.join("file/out"), false).unwrap_err();
        assert!(refused.to_string().contains("file/out"), "{refused}");
        fs::remove_dir_all(dir).unwrap();
    }

    #[test]
    fn a_failed_write_leaves_the_old_file() {
        let dir = empty_folder("whole");
        fs::create_dir_all(dir.join("a")).unwrap();
        write_whole(&dir.join("x"), b"one").unwrap();
        write_whole(&dir.join("x"), b"two").unwrap();
        assert_eq!(fs::read(dir.join("x")).unwrap(), b"two");
        // A folder in the way: the rename fails and nothing is left beside it.
        fs::write(dir.join("a/b"), b"").unwrap();
        assert!(write_whole(&dir.join("a"), b"three").is_err());
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 2);
        fs::remove_dir_all(dir).unwrap();
    }
}
