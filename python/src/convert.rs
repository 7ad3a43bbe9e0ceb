//! Between the simulator's values and Python's.

use crate::error;
use formats::table::{Cells, Column};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyList;

/// What a JSON document says, as Python's own objects.
pub(crate) fn json<'py>(py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (text,))
}

/// The JSON of what serde writes, as Python's own objects.
pub(crate) fn said<'py>(
    py: Python<'py>,
    value: Result<String, serde_json::Error>,
) -> PyResult<Bound<'py, PyAny>> {
    json(py, &value.map_err(|e| error::run(&e))?)
}

/// Columns as (name, kind, values): numbers as arrays, what is not known as NaN, text as a list.
pub(crate) type Columns<'py> = Vec<(String, &'static str, Bound<'py, PyAny>)>;

/// A table for Python.
pub(crate) fn columns(py: Python<'_>, columns: Vec<Column>) -> PyResult<Columns<'_>> {
    let column = |column: Column| {
        let (kind, values) = match column.cells {
            Cells::Text(texts) => ("text", texts_of(py, &texts)?.into_any()),
            Cells::Whole(cells) => ("whole", cells.into_pyarray(py).into_any()),
            Cells::Time(cells) => ("time", cells.into_pyarray(py).into_any()),
            Cells::Number(cells) => {
                let numbers = cells.into_iter().map(|n| n.unwrap_or(f64::NAN));
                ("number", PyArray1::from_iter(py, numbers).into_any())
            }
        };
        Ok((column.name, kind, values))
    };
    columns.into_iter().map(column).collect()
}

/// Few names stand in many rows: each is one object.
fn texts_of<'py>(py: Python<'py>, texts: &[String]) -> PyResult<Bound<'py, PyList>> {
    let mut known: Vec<(&str, Bound<'py, PyAny>)> = Vec::new();
    let mut all = Vec::with_capacity(texts.len());
    for text in texts {
        let one = match known.iter().find(|(name, _)| name == text) {
            Some((_, one)) => one.clone(),
            None => {
                let one = text.as_str().into_pyobject(py)?.into_any();
                known.push((text, one.clone()));
                one
            }
        };
        all.push(one);
    }
    PyList::new(py, all)
}
