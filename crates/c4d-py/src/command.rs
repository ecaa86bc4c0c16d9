//! Commands of `c4d`, and the thread pool.

use crate::failures::exception;
use crate::supervise::{Callbacks, Interrupted, supervise};
use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs `c4d ARGUMENTS` in this process.
#[pyfunction]
#[pyo3(signature = (arguments, on_message=None, on_progress=None))]
pub(crate) fn run_command(
    py: Python<'_>,
    arguments: Vec<OsString>,
    on_message: Option<Py<PyAny>>,
    on_progress: Option<Py<PyAny>>,
) -> PyResult<()> {
    let callbacks = Callbacks { on_message, on_progress };
    supervise(py, &callbacks, Interrupted::Stops, move |observer| {
        c4d_cli::run_command(&arguments, observer)
    })?
    .map_err(|failure| exception(py, &failure))
}

/// Starts the thread pool of the process.
#[pyfunction]
#[pyo3(signature = (threads=None))]
pub(crate) fn set_num_threads(py: Python<'_>, threads: Option<usize>) -> PyResult<()> {
    c4d_cli::start_threads(threads).map_err(|failure| exception(py, &failure))
}
