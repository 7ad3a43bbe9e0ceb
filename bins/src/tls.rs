//! TLS on the bus: the threads of Zenoh that it needs.

use crate::Failure;
use anyhow::Context as _;
use std::process::Command;

/// Where Zenoh takes its threads from, once, when the first of them starts.
const VARIABLE: &str = "ZENOH_RUNTIME";
/// What reads and what writes takes turns on one thread.
const ONE_THREAD: &str = "(rx: (worker_threads: 1), tx: (handover: rx))";

/// Starts this program again, in its place, with one thread of Zenoh for all that is read and
/// written; comes back where that is so already, or where the user chose the threads.
///
/// Zenoh (1.10) reads and writes a TLS stream from two threads at once, which the stream does not
/// bear (eclipse-zenoh/zenoh#2557): writes fail by chance while something is read, and two agents
/// lose each other for good. Call it before anything is opened or written.
///
/// # Errors
/// The program cannot be started.
pub fn in_one_thread() -> Result<(), Failure> {
    if std::env::var_os(VARIABLE).is_some() {
        return Ok(());
    }
    let program =
        std::env::current_exe().context("cannot find the path of this program to restart it")?;
    let mut again = Command::new(program);
    again
        .args(std::env::args_os().skip(1))
        .env(VARIABLE, ONE_THREAD);
    let why = anyhow::Error::new(replace_by(again));
    Err(why.context("cannot restart this program for TLS").into())
}

#[cfg(unix)]
fn replace_by(mut program: Command) -> std::io::Error {
    use std::os::unix::process::CommandExt as _;
    program.exec()
}

#[cfg(not(unix))]
fn replace_by(_: Command) -> std::io::Error {
    std::io::Error::other(format!(
        "for TLS, set the environment variable {VARIABLE} to {ONE_THREAD}"
    ))
}
