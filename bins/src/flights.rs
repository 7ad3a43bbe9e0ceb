//! Many missions in virtual time, on all processors.

use crate::Failure;
use crate::commands::run::interrupt_flag;
use crate::progress::Bar;
use std::sync::atomic::{AtomicU64, Ordering};

/// What `fly` makes of each number from 1 to `count`, in their order, with a bar of progress; those that were flown
/// when an interrupt came.
///
/// # Errors
/// A mission that cannot be flown.
pub fn fly_all<T: Send>(
    count: u64,
    fly: impl Fn(u64) -> Result<T, Failure> + Sync,
) -> Result<Vec<T>, Failure> {
    let (bar, stop) = (
        Bar::new("flying missions", count, "{wide_bar} {pos}/{len}"),
        interrupt_flag()?,
    );
    let next = AtomicU64::new(1);
    let fly_some = || {
        let mut flown = Vec::new();
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number > count || stop.load(Ordering::Relaxed) {
                return Ok(flown);
            }
            flown.push((number, fly(number)?));
            bar.inc();
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut flights = std::thread::scope(|scope| -> Result<Vec<(u64, T)>, Failure> {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(fly_some)).collect();
        let mut flights = Vec::new();
        for worker in workers {
            let flown: Result<Vec<(u64, T)>, Failure> = worker
                .join()
                .map_err(|_| Failure::usage("a mission ended unexpectedly (internal error)"))?;
            flights.extend(flown?);
        }
        Ok(flights)
    })?;
    bar.finish_and_clear();
    flights.sort_by_key(|f| f.0);
    Ok(flights.into_iter().map(|f| f.1).collect())
}
