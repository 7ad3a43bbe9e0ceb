//! Errors in words for people.

use std::error::Error;
use std::iter::successors;

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

/// What readers of numbers and of TOML said, in words for people.
pub fn in_words(said: &str) -> String {
    let words = WORDS.into_iter();
    words.fold(said.to_owned(), |said, (machine, human)| {
        said.replace(machine, human)
    })
}

/// An error with its causes; what an error already says of its cause is not said again.
pub fn with_causes(error: &dyn Error) -> String {
    let mut text = error.to_string();
    for cause in successors(error.source(), |cause: &&dyn Error| (**cause).source()) {
        let cause = cause.to_string();
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
        let file = |what: &str| {
            let source = std::io::Error::other(what.to_owned());
            crate::TaskError::Read {
                file: "a.csv".to_owned(),
                what: "observations",
                source,
            }
        };
        assert_eq!(
            with_causes(&file("disk on fire")),
            "a.csv: cannot read the observations: disk on fire"
        );
        assert_eq!(
            with_causes(&file("a.csv")),
            "a.csv: cannot read the observations"
        );
    }
}
