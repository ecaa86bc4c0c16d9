//! The arrays of a run folder.

use crate::arrays::array;
use crate::failures::exception;
use crate::splat_arrays::to_dict;
use amg::RowKind;
use c4d_cli::RunContents;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Reads a run folder: `edited` (arrays), `source` (path), `edit_time`, `is_refined`, and the
/// binding as compressed rows: `indptr`, `indices`, `data`, `num_sources`, `kinds`.
#[pyfunction]
pub(crate) fn read_run(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let run = py.detach(|| RunContents::read(&path)).map_err(|failure| exception(py, &failure))?;
    let RunContents { edited, binding, source, edit_time, is_refined } = run;
    let dict = PyDict::new(py);
    let (offsets, ids) = (binding.offsets().to_vec(), binding.source_ids().to_vec());
    let (rows, entries) = (offsets.len(), ids.len());
    dict.set_item("indptr", array(py, offsets, &[rows])?)?;
    dict.set_item("indices", array(py, ids, &[entries])?)?;
    dict.set_item("data", array(py, binding.weights().to_vec(), &[entries])?)?;
    dict.set_item("num_sources", binding.num_sources())?;
    let kinds: Vec<&str> = binding.kinds().iter().map(|kind| name(*kind)).collect();
    dict.set_item("kinds", kinds)?;
    dict.set_item("edited", to_dict(py, edited, false)?)?;
    dict.set_item("source", source)?;
    dict.set_item("edit_time", edit_time)?;
    dict.set_item("is_refined", is_refined)?;
    Ok(dict)
}

fn name(kind: RowKind) -> &'static str {
    match kind {
        RowKind::Unchanged => "unchanged",
        RowKind::Recolored => "recoloured",
        RowKind::Moved => "moved",
        RowKind::Blended => "blended",
        RowKind::Field => "field",
        RowKind::Static => "static",
        RowKind::Descendant => "descendant",
        RowKind::Copied => "copied",
    }
}
