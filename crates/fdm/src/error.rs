//! What this crate refuses, and where in a file the refused number stands.

/// What this crate refuses, with what would be right.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FdmError {
    /// An aircraft file that is not TOML of the expected shape.
    #[error("{file}:{line}:{column}: {message}")]
    Syntax {
        /// The file's name.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What was wrong and what was expected.
        message: String,
    },
    /// A number that no aircraft, gain or mechanism of this model can have.
    #[error("{place}{key} is {value}; expected {expected}")]
    Refused {
        /// `file:line: `, or empty when the value did not come from a file.
        place: String,
        /// Table and key.
        key: String,
        /// The value that came in.
        value: f64,
        /// What would be right.
        expected: String,
    },
    /// No steady flight exists at the asked speed.
    #[error("no trim at {airspeed_m_s} m/s and {density_kg_m3} kg/m³: {why}")]
    NoTrim {
        /// The airspeed asked for, m/s.
        airspeed_m_s: f64,
        /// The air density, kg/m³.
        density_kg_m3: f64,
        /// What fails.
        why: String,
    },
    /// A mechanism or parameter that the catalogue does not have.
    #[error("mechanism id \"{id}\" is not in the catalogue; expected one of: {known}")]
    UnknownMechanism {
        /// The id, with the parameter where that is unknown.
        id: String,
        /// Every id of the catalogue.
        known: String,
    },
    /// No gains with the margins asked for.
    #[error(
        "none of {candidates} gain sets keeps margins of {gain_db} dB and {phase_deg}° in every loop; with the \
         gains of the file: {before}"
    )]
    NoMargins {
        /// Gain margin asked for, dB.
        gain_db: f64,
        /// Phase margin asked for, degrees.
        phase_deg: f64,
        /// Sets tried.
        candidates: usize,
        /// The loops of the file's gains that lack margin.
        before: String,
    },
    /// Something that the model of fixed wings alone has.
    #[error("{aircraft} is a multirotor, and {what} is for fixed-wing aircraft")]
    NotOfMultirotors {
        /// The aircraft's name.
        aircraft: String,
        /// What was asked for.
        what: String,
    },
    /// An aircraft that cannot be written as TOML.
    #[error("aircraft cannot be written as TOML: {0}")]
    Unwritable(String),
}

/// A refusal that does not know its file yet.
pub(crate) fn refuse(key: &str, value: f64, expected: impl Into<String>) -> FdmError {
    FdmError::Refused {
        place: String::new(),
        key: key.to_owned(),
        value,
        expected: expected.into(),
    }
}

impl FdmError {
    /// A parser's complaint, with line and column counted from 1.
    pub(crate) fn syntax(file: &str, text: &str, error: &toml::de::Error) -> Self {
        let start = error.span().map_or(0, |span| span.start.min(text.len()));
        let before = &text.as_bytes()[..start];
        let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
        let column = start
            - before
                .iter()
                .rposition(|b| *b == b'\n')
                .map_or(0, |i| i + 1)
            + 1;
        Self::Syntax {
            file: file.to_owned(),
            line,
            column,
            message: error.message().to_owned(),
        }
    }

    /// Says in which file and line the refused key stands (or its table, when it is left out).
    pub(crate) fn located_in(self, file: &str, text: &str) -> Self {
        match self {
            Self::Refused {
                key,
                value,
                expected,
                ..
            } => Self::Refused {
                place: format!("{file}:{}: ", line_of(text, &key)),
                key,
                value,
                expected,
            },
            other => other,
        }
    }
}

/// The line, from 1, on which `table.key` is set.
fn line_of(text: &str, dotted: &str) -> usize {
    let (table, key) = dotted.split_once('.').unwrap_or(("", dotted));
    let mut current = "";
    let mut table_line = 1;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if let Some(header) = line.strip_prefix('[').and_then(|l| l.split(']').next()) {
            current = header.trim();
            if current == table {
                table_line = number + 1;
            }
        } else if current == table && line.split('=').next().map(str::trim) == Some(key) {
            return number + 1;
        }
    }
    table_line
}
