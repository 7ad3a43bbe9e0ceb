//! Errors as exceptions, in the words of the commands.

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::{PyErr, create_exception};
use std::error::Error;
use tasks::TaskError;
use tasks::words::{in_words, with_causes};

create_exception!(
    plumage,
    InputError,
    PyValueError,
    "Wrong input; the message says what came in, where, and what was expected."
);
create_exception!(
    plumage,
    RunError,
    PyRuntimeError,
    "Failure although the input was right."
);

/// Wrong input.
pub(crate) fn input(error: &dyn Error) -> PyErr {
    InputError::new_err(in_words(&with_causes(error)))
}

/// Wrong input of a task.
pub(crate) fn of_task(error: TaskError) -> PyErr {
    input(&error)
}

/// Anything else.
pub(crate) fn run(error: &dyn Error) -> PyErr {
    RunError::new_err(with_causes(error))
}
