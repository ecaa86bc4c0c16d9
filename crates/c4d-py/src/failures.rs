//! Failures as Python exceptions with the text of the command line.

use c4d_cli::Failure;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::error::Error;

/// The exception for a failure: a class of `catalyst4d` chosen by the exit code, with the text and
/// the next step.
pub(crate) fn exception(py: Python<'_>, failure: &Failure) -> PyErr {
    let arguments = (failure.exit as u8, failure.what.as_str(), failure.next_step());
    match py
        .import("catalyst4d._errors")
        .and_then(|module| module.call_method1("exception_of", arguments))
    {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// A `ValueError` with the error and its sources.
pub(crate) fn value_error(error: &dyn Error) -> PyErr {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        let cause_text = cause.to_string();
        if !text.contains(&cause_text) {
            text.push_str(": ");
            text.push_str(&cause_text);
        }
        source = cause.source();
    }
    PyValueError::new_err(text)
}
