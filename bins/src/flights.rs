//! Many missions in virtual time, on all processors.

use crate::Failure;
use crate::commands::run::interrupt_flag;
use crate::progress::Bar;
use std::sync::atomic::Ordering;

/// As [`tasks::flights::fly_all`], with a bar of progress; ends with those that were flown when an interrupt comes.
///
/// # Errors
/// A mission that cannot be flown.
pub fn fly_all<T: Send>(
    count: u64,
    fly: impl Fn(u64) -> Result<T, Failure> + Sync,
) -> Result<Vec<T>, Failure> {
    let stop = interrupt_flag()?;
    let bar = Bar::new("flying missions", count, "{wide_bar} {pos}/{len}");
    let is_over = || stop.load(Ordering::Relaxed);
    let flights = tasks::flights::fly_all(count, fly, || bar.inc(), is_over)?;
    bar.finish_and_clear();
    Ok(flights)
}
