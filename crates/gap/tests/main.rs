//! Every test of `gap` outside its source, in one executable.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

use gap::plume::Setup;
use scenario::observations::Observations;

#[path = "../../../tests/bar/mod.rs"]
mod bar;
mod bars;
mod made;
mod network;
mod next_flight;
mod tracer;
