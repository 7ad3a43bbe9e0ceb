//! How a command ends when it does not end well.

use std::process::ExitCode;

/// Exit code of a program whose output nobody takes any more, as shells have it of a signal SIGPIPE (128 + 13).
const NOBODY_READS: i32 = 141;
/// Exit code of wrong usage or input.
const WRONG_INPUT: u8 = 2;

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
        eprint!("{}", in_words(&error.to_string()));
        std::process::exit(i32::from(WRONG_INPUT));
    })
}

/// What readers of numbers and of TOML say, and the same for people.
const WORDS: [(&str, &str); 16] = [
    ("invalid float literal", "expected a number, such as 12.5"),
    (
        "invalid digit found in string",
        "expected a whole number, such as 12",
    ),
    (
        "cannot parse float from empty string",
        "expected a number, such as 12.5",
    ),
    (
        "cannot parse integer from empty string",
        "expected a whole number, such as 12",
    ),
    (
        "number too large to fit in target type",
        "expected a smaller number",
    ),
    (
        "number too small to fit in target type",
        "expected a larger number",
    ),
    ("expected f64", "expected a number"),
    ("expected f32", "expected a number"),
    ("expected u64", "expected a whole number, 0 or more"),
    ("expected u32", "expected a whole number, 0 or more"),
    ("expected usize", "expected a whole number, 0 or more"),
    ("expected i64", "expected a whole number"),
    ("expected a boolean", "expected true or false"),
    (
        "expected a sequence",
        "expected a list in brackets, such as [1, 2]",
    ),
    ("invalid type: ", ""),
    ("invalid value: ", ""),
];

fn in_words(said: &str) -> String {
    let words = WORDS.into_iter();
    words.fold(said.to_owned(), |said, (machine, human)| {
        said.replace(machine, human)
    })
}

/// Ends a program: tells the failure on standard error and gives its exit code.
pub fn exit(result: Result<(), Failure>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Input(error)) => {
            eprintln!("error: {}", in_words(&message_with_causes(&error)));
            ExitCode::from(WRONG_INPUT)
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
    fn what_readers_of_numbers_say_is_said_in_words() {
        let toml = "s.toml:2:12: invalid type: string \"a\", expected f64";
        assert_eq!(
            in_words(toml),
            "s.toml:2:12: string \"a\", expected a number"
        );
        let clap = "invalid value 'x' for '--seed <SEED>': invalid digit found in string";
        assert!(in_words(clap).ends_with("'--seed <SEED>': expected a whole number, such as 12"));
        let plain = "--duration 0: expected 1 to 1000000 simulated seconds";
        assert_eq!(in_words(plain), plain);
    }

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
