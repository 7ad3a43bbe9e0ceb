//! Every test of `mav-bridge` outside its source, in one executable.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

mod checklist;
mod faults;
mod frames;
mod golden;
mod laws;
mod px4;
mod two_links;
