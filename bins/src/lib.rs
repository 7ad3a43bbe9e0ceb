//! The shell around Plumage's pure crates: files, clocks, sockets, terminals. Binaries only call
//! into here.

pub mod agent;
pub mod commands;
pub mod failure;
pub mod feeding;
pub mod flightgear;
pub mod flights;
pub mod ground_station;
pub mod host_keys;
pub mod importing;
pub mod interrupts;
pub mod links;
pub mod listener;
pub mod listening;
pub mod measured;
pub mod metrics;
pub mod mission_files;
pub mod outputs;
pub mod outside;
pub mod pace;
pub mod page;
pub mod plume_lines;
pub mod preflight;
pub mod presence;
pub mod progress;
pub mod ranges;
pub mod released;
pub mod reports;
pub mod resume;
pub mod ros2;
pub mod runtime;
pub mod site;
pub mod tls;
pub mod weather_file;

pub use failure::Failure;
