//! The key of a mission, by which its processes know each other's word: where a process finds it.

use crate::{TaskError, loopback};
use protocol::key::Name;
use protocol::seal::MissionKey;
use std::fs::{self, DirBuilder, OpenOptions};
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The environment variable that may hold the key itself.
pub const VARIABLE: &str = "PLUMAGE_MISSION_KEY";
/// The key in a folder of `plumage keys new`.
pub const FILE: &str = "mission.key";
/// How long another process may take to write the key that it has begun, in looks of [`LOOK`].
const LOOKS: u32 = 50;
const LOOK: Duration = Duration::from_millis(20);

/// Finds the key of `mission`: in `file`, else in the environment, else, where all of `endpoints` are on this host,
/// in a file of this user's that the first process makes.
///
/// # Errors
/// A file that is no key or that others may read, or no key for a mission on several hosts.
pub fn find(
    mission: &Name,
    file: Option<&Path>,
    endpoints: &[String],
) -> Result<MissionKey, TaskError> {
    if let Some(file) = file {
        return read(file);
    }
    if let Ok(text) = std::env::var(VARIABLE) {
        return MissionKey::parse(&text)
            .map_err(|e| TaskError::Argument(format!("{VARIABLE}: {e}")));
    }
    if let Some(afar) = endpoints.iter().find(|e| !loopback::is_endpoint(e)) {
        return Err(TaskError::Argument(format!(
            "{afar} is not on this host, and anyone who can reach it could command the team; expected --keys \
             with a folder from `plumage keys new`, --mission-key with a file, or {VARIABLE}, the same for all \
             processes of the mission"
        )));
    }
    let folder = folder()?;
    let mut private = DirBuilder::new();
    private.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut private, 0o700);
    private
        .create(&folder)
        .map_err(|source| TaskError::MakeKey {
            path: folder.clone(),
            source,
        })?;
    read_or_make(&folder.join(format!("{mission}.key")))
}

/// The folder of this user's keys: that of what runs, which is gone after a restart of the host, where there is one.
fn folder() -> Result<PathBuf, TaskError> {
    let of_user = dirs::runtime_dir()
        .or_else(dirs::state_dir)
        .or_else(dirs::data_local_dir);
    of_user.map(|folder| folder.join("plumage")).ok_or_else(|| {
        TaskError::Argument(format!(
            "no folder for the mission key; expected XDG_RUNTIME_DIR or HOME to be set, --mission-key with a \
             file, or {VARIABLE}"
        ))
    })
}

/// Random bytes from the system, fit for keys.
///
/// # Errors
/// The system has no random numbers.
pub fn random<const N: usize>() -> Result<[u8; N], TaskError> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).map_err(|e| TaskError::Random(e.to_string()))?;
    Ok(bytes)
}

/// A new random key, as the text of a file.
///
/// # Errors
/// The system has no random numbers.
pub fn new_text() -> Result<String, TaskError> {
    let key = MissionKey::new(random()?);
    Ok(format!("{}\n", key.to_hex()))
}

/// Writes a new file that only its owner may read; fails if it exists.
///
/// # Errors
/// It is there, or cannot be written.
pub fn write_private(file: &Path, text: &str) -> std::io::Result<()> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(file)?.write_all(text.as_bytes())
}

fn read_or_make(file: &Path) -> Result<MissionKey, TaskError> {
    match write_private(file, &new_text()?) {
        Ok(()) => {}
        Err(e) if e.kind() == ErrorKind::AlreadyExists => {
            // The process that came first may not have written it yet.
            for _ in 0..LOOKS {
                if fs::metadata(file).is_ok_and(|file| file.len() > 0) {
                    break;
                }
                std::thread::sleep(LOOK);
            }
        }
        Err(source) => {
            return Err(TaskError::MakeKey {
                path: file.to_owned(),
                source,
            });
        }
    }
    read(file)
}

fn read(file: &Path) -> Result<MissionKey, TaskError> {
    let shown = file.display();
    let unread = |source| TaskError::Read {
        file: shown.to_string(),
        what: "mission key",
        source,
    };
    let text = fs::read_to_string(file).map_err(unread)?;
    #[cfg(unix)]
    {
        let mode = std::os::unix::fs::PermissionsExt::mode(
            &fs::metadata(file).map_err(unread)?.permissions(),
        );
        if mode & 0o077 != 0 {
            return Err(TaskError::Argument(format!(
                "{shown}: other users can read or write the mission key (mode {:o}); expected mode 600: run \
                 chmod 600 {shown}, and create a new key if they must not command the team",
                mode & 0o777
            )));
        }
    }
    MissionKey::parse(&text).map_err(|e| TaskError::Argument(format!("{shown}: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn empty_folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("plumage-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn processes_that_start_at_once_agree_on_a_key() {
        let file = empty_folder("first-key").join("m.key");
        let found = std::thread::scope(|scope| {
            let all: Vec<_> = (0..20)
                .map(|_| scope.spawn(|| read_or_make(&file).unwrap()))
                .collect();
            all.into_iter()
                .map(|one| one.join().unwrap())
                .collect::<Vec<_>>()
        });
        assert!(found.iter().all(|key| *key == found[0]));
    }

    #[cfg(unix)]
    #[test]
    fn a_key_that_others_may_read_is_refused() {
        use std::os::unix::fs::PermissionsExt as _;
        let file = empty_folder("read-key").join("m.key");
        read_or_make(&file).unwrap();
        let mode = fs::metadata(&file).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        fs::set_permissions(&file, fs::Permissions::from_mode(0o640)).unwrap();
        assert!(read(&file).unwrap_err().to_string().contains("chmod 600"));
        fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
        fs::write(&file, "secret").unwrap();
        assert!(
            read(&file)
                .unwrap_err()
                .to_string()
                .contains("64 hexadecimal")
        );
    }

    #[test]
    fn several_hosts_need_a_key_that_is_given() {
        let name = Name::new("m").unwrap();
        let afar = ["tcp/127.0.0.1:1".to_owned(), "tcp/0.0.0.0:7447".to_owned()];
        let words = find(&name, None, &afar).unwrap_err().to_string();
        assert!(
            words.contains("plumage keys new") && words.contains("tcp/0.0.0.0:7447"),
            "{words}"
        );
    }
}
