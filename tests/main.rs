//! Every test of the programs, in one executable.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

mod bar;
mod bridge;
mod clients;
mod command_line;
mod determinism;
mod faults;
mod fdm_server;
mod feed;
mod flightgear;
mod hidden_effect;
mod hosts;
mod import;
mod mission;
mod program;
mod purity;
mod ranks;
mod runner;
mod security;
mod team;

fn main() -> std::process::ExitCode {
    let tests = [
        // The longest first.
        hosts::tests(),
        faults::tests(),
        clients::tests(),
        bridge::tests(),
        feed::tests(),
        hidden_effect::tests(),
        mission::tests(),
        command_line::tests(),
        determinism::tests(),
        fdm_server::tests(),
        flightgear::tests(),
        import::tests(),
        purity::tests(),
        ranks::tests(),
        security::tests(),
    ];
    runner::run(tests.into_iter().flatten().collect())
}
