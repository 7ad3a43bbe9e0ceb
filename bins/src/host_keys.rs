//! The folder of a host that `plumage keys new` writes: which files it holds. The mission's key is one of them too
//! ([`tasks::mission_key::FILE`]).

use crate::Failure;
use protocol::key::Name;
use std::fs;
use std::path::Path;

/// The authority's certificate in a host's folder.
pub const CA: &str = "ca.pem";
/// The host's certificate in its folder.
pub const CERTIFICATE: &str = "host.pem";
/// The host's private key in its folder.
pub const PRIVATE_KEY: &str = "host.key";
/// Who may say what, in a host's folder.
pub const ACCESS: &str = "access.json";
/// The host's name, in its folder.
pub const HOST: &str = "host.txt";

/// What a folder of `plumage keys new` holds for the bus: root certificate, certificate, private key, who may say what,
/// and the host's name.
///
/// # Errors
/// A file that is not there, as in a folder of an earlier version.
pub fn read(folder: &Path) -> Result<([String; 3], String, Name), Failure> {
    let file = |name: &str| {
        let file = folder.join(name);
        if !file.is_file() {
            return Err(Failure::usage(format!(
                "--keys {}: the folder has no {name}; expected the folder of this host from `plumage keys new`",
                folder.display()
            )));
        }
        Ok(file)
    };
    let path = |name: &str| Ok::<_, Failure>(file(name)?.display().to_string());
    let access = fs::read_to_string(file(ACCESS)?)?;
    let host = Name::new(fs::read_to_string(file(HOST)?)?.trim()).map_err(Failure::input)?;
    Ok((
        [path(CA)?, path(CERTIFICATE)?, path(PRIVATE_KEY)?],
        access,
        host,
    ))
}
