//! Why a log cannot be imported.

/// Why a log cannot be imported: where, what is wrong, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// A log, or a part of it, is not what can be read.
    #[error("{place}: {what}; {todo}")]
    Log {
        /// File, and line and column where there are such.
        place: String,
        /// What is wrong.
        what: String,
        /// What to do about it.
        todo: String,
    },
    /// A mapping file is wrong.
    #[error("{file}: {what}")]
    Map {
        /// Name of the mapping file.
        file: String,
        /// What is wrong, with its line, and what would be right.
        what: String,
    },
    /// Rows of one platform run back in time: they have to be sorted, and so to be held in memory.
    #[error("{file}: line {line}: rows run back in time; expected rows in order of time")]
    Disorder {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: u64,
    },
    /// Bytes could not be read or written.
    #[error("{file}: {source}")]
    Bytes {
        /// Name of the file.
        file: String,
        /// What failed.
        source: std::io::Error,
    },
}

impl ImportError {
    /// A log that is not what can be read.
    pub(crate) fn log(
        place: impl Into<String>,
        what: impl Into<String>,
        todo: impl Into<String>,
    ) -> Self {
        Self::Log {
            place: place.into(),
            what: what.into(),
            todo: todo.into(),
        }
    }

    /// A failed read or write of `file`.
    pub(crate) fn bytes(file: &str) -> impl FnOnce(std::io::Error) -> Self {
        let file = file.to_owned();
        move |source| Self::Bytes { file, source }
    }
}
