//! scenario

pub mod observations;
