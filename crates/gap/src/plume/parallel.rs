//! The same work on many items, on a few threads, with results in the items' order: they do
//! not depend on how many threads there are.

/// Applies `work` to every item on up to `threads` threads.
pub(crate) fn map<T: Sync, R: Send>(
    items: &[T],
    threads: usize,
    work: impl Fn(&T) -> R + Sync,
) -> Vec<R> {
    let threads = threads.clamp(1, items.len().max(1));
    if threads == 1 {
        return items.iter().map(work).collect();
    }
    let next = std::sync::atomic::AtomicUsize::new(0);
    let mut found: Vec<(usize, R)> = std::thread::scope(|scope| {
        let mut handles = Vec::with_capacity(threads);
        for _ in 0..threads {
            handles.push(scope.spawn(|| {
                let mut mine = Vec::new();
                loop {
                    let i = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    let Some(item) = items.get(i) else {
                        return mine;
                    };
                    mine.push((i, work(item)));
                }
            }));
        }
        let mut all = Vec::with_capacity(items.len());
        for handle in handles {
            match handle.join() {
                Ok(mine) => all.extend(mine),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        all
    });
    found.sort_by_key(|(i, _)| *i);
    found.into_iter().map(|(_, r)| r).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn order_is_that_of_the_items() {
        let items: Vec<u64> = (0..100).collect();
        let one = super::map(&items, 1, |i| i * i);
        assert_eq!(one, super::map(&items, 3, |i| i * i));
        assert_eq!(one[9], 81);
        assert!(super::map(&[] as &[u64], 2, |i| *i).is_empty());
    }
}
