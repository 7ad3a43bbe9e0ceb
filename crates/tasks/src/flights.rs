//! Many missions in virtual time, on all processors.

use std::sync::atomic::{AtomicU64, Ordering};

/// What `fly` makes of each number from 1 to `count`, in their order; `flown` is called after each. Those that were
/// flown when `is_over` says so.
///
/// # Errors
/// A mission that cannot be flown.
pub fn fly_all<T: Send, E: Send>(
    count: u64,
    fly: impl Fn(u64) -> Result<T, E> + Sync,
    flown: impl Fn() + Sync,
    is_over: impl Fn() -> bool + Sync,
) -> Result<Vec<T>, E> {
    let next = AtomicU64::new(1);
    let fly_some = || {
        let mut some = Vec::new();
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number > count || is_over() {
                return Ok(some);
            }
            some.push((number, fly(number)?));
            flown();
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut flights = std::thread::scope(|scope| -> Result<Vec<(u64, T)>, E> {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(fly_some)).collect();
        let mut flights = Vec::new();
        for worker in workers {
            let some: Result<Vec<(u64, T)>, E> = worker
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            flights.extend(some?);
        }
        Ok(flights)
    })?;
    flights.sort_by_key(|f| f.0);
    Ok(flights.into_iter().map(|f| f.1).collect())
}
