//! What a ground station asks, and what the stand-in answers.
#![allow(deprecated, reason = "ground stations still send the older forms")]

mod missions;
mod questions;
mod station;
mod team;
