//! What a ground station asks, and what the stand-in answers.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![allow(deprecated, reason = "ground stations still send the older forms")]

mod missions;
mod questions;
mod station;
mod team;
