//! What a mission is: the scenario a user writes in TOML, checked once, and the measured
//! observations that go with it.
//!
//! Pure: file contents come in as text. A [`Scenario`] is made by [`Scenario::parse`], which
//! checks every value and names the line of what is wrong and what would be right.
//!
//! - [`tables`]: the TOML tables, one struct each, with units and defaults;
//! - [`check`]: what is refused;
//! - [`reality`]: the stand-ins' own world, as differences from the scenario's;
//! - [`world`]: the plume model that a scenario describes;
//! - [`uncertain`]: the priors of the parameters that the scenario marks as uncertain;
//! - [`observations`]: measured rows;
//! - [`random`]: the streams of random numbers of a run.

pub mod check;
pub mod observations;
pub mod random;
pub mod reality;
pub mod tables;
pub mod uncertain;
pub mod world;

pub use tables::Scenario;

/// Why a scenario was refused.
#[derive(Debug, Clone, thiserror::Error, PartialEq)]
pub enum ScenarioError {
    /// The text is not TOML, or has keys or types that a scenario does not.
    #[error("{file}:{line}:{column}: {why}")]
    Syntax {
        /// File the text came from.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What is wrong and what was expected.
        why: String,
    },
    /// A value cannot be.
    #[error("{file}:{line}:{column}: {key} = {found}: expected {expected}")]
    Value {
        /// File the text came from.
        file: String,
        /// Line, from 1; 0 where the key is not in the text.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// Dotted key.
        key: String,
        /// The value found.
        found: String,
        /// What would be right.
        expected: String,
    },
}

/// One-based line and column of a byte offset in `text`.
pub(crate) fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = &text[..offset.min(text.len())];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
    (line, column)
}
