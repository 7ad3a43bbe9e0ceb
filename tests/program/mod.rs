//! `plumage` run as a program, processes that end with their test, and folders for what they make.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};

/// The scenario that most of these tests fly.
pub const SCENARIO: &str = "../scenarios/as-pontes-steady.toml";

/// Runs `plumage` to its end.
pub fn plumage(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_plumage"))
        .args(arguments)
        .output()
        .unwrap()
}

/// A process that ends with its owner.
pub struct Ends(pub Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// An empty folder of this test's own.
pub fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Checks for an exit code and words on standard error.
pub fn refused(output: &Output, code: i32, words: &[&str]) {
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{told}");
    for word in words {
        assert!(told.contains(word), "'{word}' is not in: {told}");
    }
}
