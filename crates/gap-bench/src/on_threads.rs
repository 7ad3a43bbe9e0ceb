//! Long tasks shared out to a stated number of threads.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Returns what `of` makes of each item, in the order of the items, on `threads` threads. `of` also gets a counter of the
/// items that are done, its own included.
///
/// The threads are the system's and not rayon's: one of rayon's that waits for a part of its task begins another task on
/// the same stack.
pub(crate) fn on_threads<T: Sync, U: Send>(
    threads: usize,
    items: &[T],
    of: &(dyn Fn(&T, &dyn Fn() -> usize) -> U + Sync),
) -> Vec<U> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let count_done = || done.fetch_add(1, Ordering::Relaxed) + 1;
    let all: Mutex<Vec<(usize, U)>> = Mutex::new(Vec::new());
    let work = || {
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(i) else { break };
            let result = of(item, &count_done);
            if let Ok(mut all) = all.lock() {
                all.push((i, result));
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(work);
        }
    });
    let mut all = all.into_inner().unwrap_or_default();
    all.sort_by_key(|(i, _)| *i);
    all.into_iter().map(|(_, result)| result).collect()
}
