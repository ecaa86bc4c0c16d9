//! Conversions between NumPy arrays and Rust vectors.

use numpy::{Element, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// An array that takes over the memory of `values`.
///
/// # Errors
/// If `shape` has a different number of elements.
pub(crate) fn array<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    PyArray1::from_vec(py, values).reshape(shape.to_vec())
}

/// `[n]` values of a contiguous array of any shape, copied.
pub(crate) fn values<T: Element + Copy>(array: &PyReadonlyArrayDyn<'_, T>) -> PyResult<Vec<T>> {
    array.as_slice().map(<[T]>::to_vec).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Rows of `D` values of a contiguous array whose last axis has `D`, copied.
pub(crate) fn rows<T: Element + Copy, const D: usize>(
    name: &str,
    array: &PyReadonlyArrayDyn<'_, T>,
) -> PyResult<Vec<[T; D]>> {
    let shape = array.as_array().shape().to_vec();
    if shape.len() < 2 || shape.last() != Some(&D) {
        return Err(PyValueError::new_err(format!(
            "{name} has shape {shape:?}, expected [N, {D}]"
        )));
    }
    let flat = array.as_slice().map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(flat.as_chunks::<D>().0.to_vec())
}

/// `value` as a contiguous array of 64-bit floats of this shape.
pub(crate) fn matrix<const R: usize, const C: usize>(
    name: &str,
    value: &Bound<'_, PyAny>,
) -> PyResult<[[f64; C]; R]> {
    let numpy = value.py().import("numpy")?;
    let array: PyReadonlyArrayDyn<'_, f64> =
        numpy.call_method1("ascontiguousarray", (value, "float64"))?.extract()?;
    let shape = array.as_array().shape().to_vec();
    if shape == [R, C]
        && let Ok(matrix) = <[[f64; C]; R]>::try_from(rows::<f64, C>(name, &array)?)
    {
        return Ok(matrix);
    }
    Err(PyValueError::new_err(format!("{name} has shape {shape:?}, expected [{R}, {C}]")))
}
