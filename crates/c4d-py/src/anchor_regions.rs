//! Region anchors of a point cloud.

use crate::arrays::{array, rows};
use crate::failures::value_error;
use crate::supervise::compute;
use anchors::{AnchorParams, AnchorSet, Grouping, Radius};
use numpy::PyReadonlyArrayDyn;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Anchors of `points` `[N,3]`.
#[pyfunction]
#[pyo3(signature = (points, k, grouping, max_edge_ratio, radius, radius_factor, num_lines, seed))]
#[expect(clippy::too_many_arguments, reason = "named in Python")]
pub(crate) fn build_anchors<'py>(
    py: Python<'py>,
    points: PyReadonlyArrayDyn<'py, f64>,
    k: usize,
    grouping: &str,
    max_edge_ratio: f64,
    radius: &Bound<'py, PyAny>,
    radius_factor: f64,
    num_lines: usize,
    seed: u64,
) -> PyResult<Bound<'py, PyDict>> {
    let grouping = match grouping {
        "disjoint" => Grouping::Disjoint,
        "overlapping" => Grouping::Overlapping,
        other => {
            return Err(PyValueError::new_err(format!(
                "grouping {other:?}: expected \"disjoint\" or \"overlapping\""
            )));
        }
    };
    let radius = match radius.extract::<String>().as_deref() {
        Ok("global") => Radius::Global,
        Ok("local") => Radius::Local,
        Ok(other) => {
            return Err(PyValueError::new_err(format!(
                "radius {other:?}: expected \"global\", \"local\" or a number"
            )));
        }
        Err(_) => Radius::Fixed(radius.extract()?),
    };
    let params = AnchorParams {
        k,
        grouping,
        max_edge_ratio,
        radius,
        radius_factor,
        num_lines,
        seed,
        ..AnchorParams::default()
    };
    let points = rows::<f64, 3>("points", &points)?;
    let work = move || AnchorSet::of(&points, &params);
    let set = compute(py, work)?.map_err(|error| value_error(&error))?;
    let dict = PyDict::new(py);
    let (count, num_points) = (set.positions.len(), set.owners.len());
    let (offsets, members) = (set.members.offsets().to_vec(), set.members.indices().to_vec());
    let (starts, entries) = (offsets.len(), members.len());
    dict.set_item("positions", array(py, set.positions.into_flattened(), &[count, 3])?)?;
    dict.set_item("member_offsets", array(py, offsets, &[starts])?)?;
    dict.set_item("members", array(py, members, &[entries])?)?;
    dict.set_item("owners", array(py, signed(&set.owners), &[num_points])?)?;
    dict.set_item("lines", array(py, signed(&set.lines), &[count])?)?;
    dict.set_item("delta", set.delta)?;
    dict.set_item("num_ungrouped", set.num_ungrouped)?;
    dict.set_item("num_unhit", set.num_unhit)?;
    Ok(dict)
}

/// Ids with −1 for "none".
fn signed(ids: &[u32]) -> Vec<i64> {
    ids.iter().map(|&id| if id == u32::MAX { -1 } else { i64::from(id) }).collect()
}
