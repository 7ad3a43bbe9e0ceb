//! How a command ends when it does not end well.

use std::process::ExitCode;

/// Why a command failed, by whose fault.
#[derive(Debug)]
pub enum Failure {
    /// Wrong usage or input: exit code 2.
    Input(anyhow::Error),
    /// Anything else: exit code 1.
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
        message_with_causes(error)
    }
}

impl<E: Into<anyhow::Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Run(error.into())
    }
}

/// Ends a program: tells the failure on standard error and gives its exit code.
pub fn exit(result: Result<(), Failure>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Input(error)) => {
            eprintln!("error: {}", message_with_causes(&error));
            ExitCode::from(2)
        }
        Err(Failure::Run(error)) => {
            eprintln!("error: {}", message_with_causes(&error));
            ExitCode::FAILURE
        }
    }
}

/// An error with its causes; what an error already says of its cause is not said again.
fn message_with_causes(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text += ": ";
            text += &cause;
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context as _;

    #[test]
    fn each_cause_is_told_once() {
        let io = std::io::Error::other("disk on fire");
        let view = views::ViewError::Address {
            address: "here".to_owned(),
            source: io,
        };
        let error = anyhow::Error::from(view);
        assert_eq!(
            message_with_causes(&error),
            "cannot serve the page at here: disk on fire"
        );
        let outer = Err::<(), _>(std::io::Error::other("no such file")).context("a.csv");
        assert_eq!(
            message_with_causes(&outer.unwrap_err()),
            "a.csv: no such file"
        );
    }
}
