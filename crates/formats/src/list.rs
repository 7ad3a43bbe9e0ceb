//! Lists of names in a sentence.

/// Returns the first `most` names, separated by commas, and how many more there are.
///
/// ```
/// use formats::list::listed;
///
/// assert_eq!(listed(&["a", "b", "c"], 3), "a, b, c");
/// assert_eq!(listed(&["a", "b", "c"], 2), "a, b and 1 more");
/// ```
pub fn listed(names: &[&str], most: usize) -> String {
    let first = names[..names.len().min(most)].join(", ");
    match names.len().saturating_sub(most) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}
