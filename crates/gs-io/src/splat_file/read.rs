//! Reading `.splat`.

use super::SplatFileError;
use crate::bytes8::{dc_of, ends_note, logit_of};
use crate::content::splat_rows::{ROW, float, rotation};
use crate::frame::{Frame, FrameFormat};
use crate::repair::FLAT_LOG_SCALE;
use gs_core::sh::C0;
use gs_core::{Precision, RowPrecision, Splats, quat};
use rayon::prelude::*;
use std::sync::Arc;

/// Rounding errors of a row: whole steps of the bytes, because
/// some writers truncate and some round.
fn precision() -> RowPrecision {
    RowPrecision {
        rotation_rad: 4.0 / 128.0,
        opacity: 1.0 / 255.0,
        sh_dc: [1.0 / 255.0 / C0; 3],
        sh_dc_range: [dc_of(0.0), dc_of(1.0)],
        sh_rest: [f32::INFINITY; 3],
        ..RowPrecision::EXACT
    }
}

/// Reads a `.splat` frame. A partial last row is an error; standard
/// deviations of 0 become that of [`FLAT_LOG_SCALE`].
///
/// # Errors
/// If there are no rows or the last one is truncated.
pub fn read(bytes: &[u8]) -> Result<Frame, SplatFileError> {
    let (rows, rest) = bytes.as_chunks::<ROW>();
    if !rest.is_empty() {
        return Err(SplatFileError::Truncated {
            part: "the last row",
            expected: ROW as u128,
            found: rest.len() as u128,
        });
    }
    if rows.is_empty() {
        return Err(SplatFileError::Empty);
    }
    let mut notes: Vec<String> = ends_note(rows.iter().map(|row| row[27])).into_iter().collect();
    let flat = rows.iter().filter(|row| (3..6).any(|axis| float(row, 4 * axis) == 0.0)).count();
    if flat > 0 {
        notes.push(format!("{flat} rows with a standard deviation of 0 are read as flat splats"));
    }
    let log = |scale: f32| if scale == 0.0 { FLAT_LOG_SCALE } else { scale.ln() };
    let splats = Splats {
        means: rows.par_iter().map(|row| [0, 4, 8].map(|at| float(row, at))).collect(),
        quats: rows.par_iter().map(|row| quat::normalize(rotation(row))).collect(),
        log_scales: rows.par_iter().map(|row| [12, 16, 20].map(|at| log(float(row, at)))).collect(),
        opacity_logits: rows.par_iter().map(|row| logit_of(row[27])).collect(),
        sh: rows
            .par_iter()
            .map(|row| [24, 25, 26].map(|at| dc_of(f32::from(row[at]) / 255.0)))
            .collect(),
        sh_degree: 0,
    };
    Ok(Frame {
        splats,
        format: FrameFormat::Splat,
        axes: None,
        precision: Some(Arc::new(Precision::uniform(precision()))),
        notes,
        comments: Vec::new(),
    })
}
