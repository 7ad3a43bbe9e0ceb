//! How a command ends when it does not end well.

use net::NetError;
use protocol::text::printable_lines;
use std::process::ExitCode;
use tasks::words::{in_words, with_causes};

/// Exit code of a program whose output nobody takes any more, as shells have it of a signal SIGPIPE (128 + 13).
const NOBODY_READS: i32 = 141;
/// Exit code of wrong usage or input.
const WRONG_INPUT: u8 = 2;

/// Exit code of a mission in lockstep that ended since somebody was missing.
const SOMEBODY_MISSING: u8 = 3;

/// Why a command failed, by whose fault.
#[derive(Debug)]
pub enum Failure {
    /// Wrong usage or input: exit code 2.
    Input(anyhow::Error),
    /// Anything else: exit code 3 where somebody was missing in lockstep, else 1.
    Run(anyhow::Error),
}

impl Failure {
    /// Wrong usage or input.
    pub fn input(error: impl Into<anyhow::Error>) -> Self {
        Self::Input(error.into())
    }

    /// Wrong usage or input, as a message.
    pub fn usage(message: impl Into<String>) -> Self {
        Self::Input(anyhow::Error::msg(message.into()))
    }

    /// What went wrong, with its causes.
    pub fn words(&self) -> String {
        let (Self::Input(error) | Self::Run(error)) = self;
        for_people(&with_causes(error.as_ref()))
    }
}

/// An error in words, whatever a file or another host has put into it.
fn for_people(error: &str) -> String {
    printable_lines(error).into_owned()
}

impl<E: Into<anyhow::Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Run(error.into())
    }
}

/// Reads the arguments of a program, or ends it with what is wrong about them; the first thing that a program does.
/// From then on it ends in silence once nobody reads what it says (`plumage … | head`).
pub fn arguments<T: clap::Parser>() -> T {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        // The standard library panics where it cannot print, and says no more of it than this.
        if panic
            .payload_as_str()
            .is_some_and(|said| said.contains("Broken pipe"))
        {
            std::process::exit(NOBODY_READS);
        }
        usual(panic);
    }));
    T::try_parse().unwrap_or_else(|error| {
        if !error.use_stderr() {
            error.exit();
        }
        eprint!("{}", for_people(&in_words(&error.to_string())));
        std::process::exit(i32::from(WRONG_INPUT));
    })
}

/// Ends a program: tells the failure on standard error and gives its exit code.
pub fn exit(result: Result<(), Failure>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Input(error)) => {
            eprintln!(
                "error: {}",
                for_people(&in_words(&with_causes(error.as_ref())))
            );
            ExitCode::from(WRONG_INPUT)
        }
        Err(Failure::Run(error)) => {
            eprintln!("error: {}", for_people(&with_causes(error.as_ref())));
            match error.downcast_ref::<NetError>() {
                Some(NetError::Gone { .. } | NetError::Lost { .. }) => {
                    ExitCode::from(SOMEBODY_MISSING)
                }
                _ => ExitCode::FAILURE,
            }
        }
    }
}
