//! Every test of `views` outside its source, in one executable.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

mod foxglove;
mod made_up;
mod page;
mod report;
