//! Tests of the crate `study`, on made and on measured data.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

mod field;
mod made;
mod methods;
mod tracer;

use libtest_mimic::{Arguments, Completion, Trial};
use plume::Gas;
use scenario::Scenario;
use scenario::observations::{Observations, parse};
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut trials = methods::trials();
    trials.extend(tracer::trials());
    trials.extend(field::trials());
    libtest_mimic::run(&Arguments::from_args(), trials).exit_code()
}

fn trial(name: &'static str, test: fn()) -> Trial {
    Trial::test(name, move || {
        test();
        Ok(())
    })
}

/// A test on field data, ignored without them.
fn measured(name: &'static str, test: fn(&Path)) -> Trial {
    Trial::ignorable_test(name, move || {
        let Some(folder) = std::env::var_os("PLUMAGE_DATA") else {
            return Ok(Completion::ignored_with(
                "needs PLUMAGE_DATA, the folder of measured data",
            ));
        };
        test(&Path::new(&folder).join("field"));
        Ok(Completion::Completed)
    })
}

fn observed(text: &str) -> Observations {
    parse(&[("made.csv", text)], Gas::Ch4).unwrap()
}

fn scenario(text: &str) -> Scenario {
    Scenario::parse("made.toml", text).unwrap()
}
