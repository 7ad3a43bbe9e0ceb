//! Errors and exit codes of the programs.

use net::NetError;
use protocol::text::printable_lines;
use std::process::ExitCode;
use tasks::words::{in_words, with_causes};

/// Exit code after the reader has closed the output, as shells report the signal SIGPIPE (128 + 13).
const NOBODY_READS: i32 = 141;
/// Exit code of wrong usage or input.
const WRONG_INPUT: u8 = 2;

/// Exit code of a lockstep mission in which a process stopped responding.
const SOMEBODY_MISSING: u8 = 3;

/// Error of a command, by its origin.
#[derive(Debug)]
pub enum Failure {
    /// Wrong usage or input: exit code 2.
    Input(anyhow::Error),
    /// Anything else: exit code 3 if a process of a lockstep mission stopped responding, else 1.
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

/// An error as text, without control characters from files or other hosts.
fn for_people(error: &str) -> String {
    printable_lines(error).into_owned()
}

impl<E: Into<anyhow::Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Run(error.into())
    }
}

/// Reads the arguments of a program, or ends it with what is wrong about them; the first thing that a program does.
/// From then on it ends without a message when its reader closes the output (`plumage … | head`).
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
    let mut command = accept_negative_numbers(T::command());
    let matches = command.try_get_matches_from_mut(std::env::args_os());
    let parsed = matches.and_then(|mut matches| T::from_arg_matches_mut(&mut matches));
    parsed.unwrap_or_else(|error| {
        let error = error.format(&mut command);
        if !error.use_stderr() {
            error.exit();
        }
        eprint!("{}", for_people(&in_words(&error.to_string())));
        std::process::exit(i32::from(WRONG_INPUT));
    })
}

/// Lets every option have a negative number as its value, so that one outside the range is rejected by the error that
/// states the range, not as an unknown option.
fn accept_negative_numbers(command: clap::Command) -> clap::Command {
    let command = command.mut_args(|argument| {
        let is_option_with_value =
            !argument.is_positional() && argument.get_action().takes_values();
        argument.allow_negative_numbers(is_option_with_value)
    });
    command.mut_subcommands(accept_negative_numbers)
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
