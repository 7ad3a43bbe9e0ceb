//! The tokio runtimes of a program: each serves one kind of socket, with few threads, so that the processors are left to
//! the mission.

use crate::Failure;
use anyhow::Context as _;
use tokio::runtime::{Builder, Runtime};

/// Starts a runtime with `threads` worker threads called `name`. Zenoh needs at least two.
///
/// # Errors
/// The system has no thread left.
pub fn start(name: &str, threads: usize) -> Result<Runtime, Failure> {
    let runtime = Builder::new_multi_thread()
        .worker_threads(threads)
        .thread_name(name)
        .enable_all()
        .build();
    Ok(runtime.with_context(|| format!("cannot start the runtime {name}"))?)
}

/// Keeps `runtime` running until the program ends.
pub fn keep(runtime: Runtime) {
    std::mem::forget(runtime);
}
