//! Splats as dictionaries of arrays, and as a PLY.

use crate::arrays::{array, rows, values};
use crate::failures::value_error;
use gs_core::{Real, Splats, sh};
use gs_io::{AtomicFile, Existing, ply};
use numpy::{Element, PyReadonlyArrayDyn};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// `means` `[N,3]`, `quats` `[N,4]`, `log_scales` `[N,3]`, `opacity_logits` `[N]`, `sh` `[N,K,3]`.
/// With `activated`, `scales` and `opacities` instead of the raw values, and unit quaternions.
pub(crate) fn to_dict(
    py: Python<'_>,
    splats: Splats,
    activated: bool,
) -> PyResult<Bound<'_, PyDict>> {
    let (n, coeffs) = (splats.len(), splats.sh_coeffs());
    let dict = PyDict::new(py);
    if activated {
        let scales: Vec<[f32; 3]> = (0..n).map(|i| splats.scale(i)).collect();
        let opacities: Vec<f32> = (0..n).map(|i| splats.opacity(i)).collect();
        let quats: Vec<[f32; 4]> = (0..n).map(|i| splats.rotation(i)).collect();
        dict.set_item("means", array(py, splats.means.into_flattened(), &[n, 3])?)?;
        dict.set_item("quats", array(py, quats.into_flattened(), &[n, 4])?)?;
        dict.set_item("scales", array(py, scales.into_flattened(), &[n, 3])?)?;
        dict.set_item("opacities", array(py, opacities, &[n])?)?;
    } else {
        dict.set_item("means", array(py, splats.means.into_flattened(), &[n, 3])?)?;
        dict.set_item("quats", array(py, splats.quats.into_flattened(), &[n, 4])?)?;
        dict.set_item("log_scales", array(py, splats.log_scales.into_flattened(), &[n, 3])?)?;
        dict.set_item("opacity_logits", array(py, splats.opacity_logits, &[n])?)?;
    }
    dict.set_item("sh", array(py, splats.sh.into_flattened(), &[n, coeffs, 3])?)?;
    Ok(dict)
}

/// Splats from contiguous arrays, shapes as in [`to_dict`].
pub(crate) fn from_arrays<F: Real + Element + Copy>(
    means: &PyReadonlyArrayDyn<'_, F>,
    quats: &PyReadonlyArrayDyn<'_, F>,
    log_scales: &PyReadonlyArrayDyn<'_, F>,
    opacity_logits: &PyReadonlyArrayDyn<'_, F>,
    sh: &PyReadonlyArrayDyn<'_, F>,
) -> PyResult<Splats<F>> {
    let shape = sh.as_array().shape().to_vec();
    let sh_degree = match shape[..] {
        [_, coeffs, 3] => sh::degree_of(coeffs),
        _ => None,
    }
    .ok_or_else(|| {
        PyValueError::new_err(format!(
            "sh has shape {shape:?}, expected [N, K, 3] with K = 1, 4, 9 or 16"
        ))
    })?;
    let splats = Splats {
        means: rows("means", means)?,
        quats: rows("quats", quats)?,
        log_scales: rows("log_scales", log_scales)?,
        opacity_logits: values(opacity_logits)?,
        sh: rows("sh", sh)?,
        sh_degree,
    };
    splats.check_shapes().map_err(|error| value_error(&error))?;
    Ok(splats)
}

/// Writes a 3DGS PLY that keeps every bit.
#[pyfunction]
#[pyo3(signature = (path, means, quats, log_scales, opacity_logits, sh, overwrite=false))]
#[expect(clippy::too_many_arguments, reason = "the five arrays of splats")]
pub(crate) fn write_ply(
    py: Python<'_>,
    path: PathBuf,
    means: PyReadonlyArrayDyn<'_, f32>,
    quats: PyReadonlyArrayDyn<'_, f32>,
    log_scales: PyReadonlyArrayDyn<'_, f32>,
    opacity_logits: PyReadonlyArrayDyn<'_, f32>,
    sh: PyReadonlyArrayDyn<'_, f32>,
    overwrite: bool,
) -> PyResult<()> {
    let splats = from_arrays(&means, &quats, &log_scales, &opacity_logits, &sh)?;
    let existing = if overwrite { Existing::Replace } else { Existing::Refuse };
    py.detach(|| {
        let failed = |error: &dyn std::error::Error| {
            PyOSError::new_err(format!("cannot write {}: {error}", path.display()))
        };
        let mut file = AtomicFile::create(&path, existing).map_err(|error| failed(&error))?;
        let options = ply::WriteOptions { normals: false, comments: Vec::new(), sh_degree: None };
        ply::write(&splats, &options, &mut file).map_err(|error| failed(&error))?;
        file.commit().map_err(|error| failed(&error))
    })
}
