//! Several answers at once, on as many threads as there are processors. An answer does not depend on
//! how many there are.

use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{available_parallelism, scope};

thread_local! {
    /// Whether this thread is one of several already.
    static IS_ONE_OF_SEVERAL: Cell<bool> = const { Cell::new(false) };
}

/// What `of` makes of each item, in their order.
pub fn at_once<T: Sync, U: Send>(items: &[T], of: impl Fn(&T) -> U + Sync) -> Vec<U> {
    let threads = available_parallelism().map_or(1, usize::from);
    let threads = threads.min(items.len());
    if threads < 2 || IS_ONE_OF_SEVERAL.get() {
        return items.iter().map(of).collect();
    }
    let next = AtomicUsize::new(0);
    let work = || -> Vec<(usize, U)> {
        IS_ONE_OF_SEVERAL.set(true);
        let mut done = Vec::new();
        loop {
            let k = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(k) else { break };
            done.push((k, of(item)));
        }
        IS_ONE_OF_SEVERAL.set(false);
        done
    };
    let mut all = scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(work)).collect();
        let mut all = work();
        for other in others {
            match other.join() {
                Ok(done) => all.extend(done),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        all
    });
    all.sort_by_key(|done| done.0);
    all.into_iter().map(|done| done.1).collect()
}

#[cfg(test)]
mod tests {
    use super::at_once;

    #[test]
    fn answers_stand_in_order_and_threads_start_no_more_of_them() {
        let items: Vec<usize> = (0..100).collect();
        let of = |k: &usize| at_once(&items, |j| j * k).iter().sum::<usize>();
        let sums: Vec<usize> = items.iter().map(|k| 4950 * k).collect();
        assert_eq!(at_once(&items, of), sums);
    }
}
