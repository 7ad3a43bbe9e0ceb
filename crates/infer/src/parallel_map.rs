//! Several independent computations on as many threads as there are processors.

use rayon::prelude::*;

/// Returns what `of` makes of each item, in the order of the items: the result does not depend on the number of threads.
pub fn parallel_map<T: Sync, U: Send>(items: &[T], of: impl Fn(&T) -> U + Sync + Send) -> Vec<U> {
    items.par_iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::parallel_map;

    #[test]
    fn results_stand_in_the_order_of_the_items_nested_too() {
        let items: Vec<usize> = (0..100).collect();
        let of = |k: &usize| parallel_map(&items, |j| j * k).iter().sum::<usize>();
        let sums: Vec<usize> = items.iter().map(|k| 4950 * k).collect();
        assert_eq!(parallel_map(&items, of), sums);
    }
}
