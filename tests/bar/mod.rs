//! A bar: a figure that has a goal and may miss it. Its test fails only where nothing can be measured;
//! `.ci/nightly` collects the lines, and docs/limits.md lists the bars that are missed.

use std::fmt::Display;

/// Reports a bar on standard output.
pub fn report(what: &str, goal: &str, figure: impl Display, reached: bool) {
    let outcome = if reached { "reached" } else { "missed" };
    println!("bar\t{what}\t{goal}\t{figure}\t{outcome}");
}
