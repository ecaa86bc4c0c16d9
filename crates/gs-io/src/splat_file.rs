//! `.splat` frames: 32 bytes a row, no header.
//!
//! Row: centre 3 × `f32`, standard deviations 3 × `f32` (linear), red, green, blue and opacity as bytes from 0 to 1, quaternion
//! `wxyz` as bytes `128·q + 128`. Colour does not depend on the view.

use crate::bytes8::{channel_of, dc_of, ends_note, logit_of, unorm8};
use crate::frame::{Frame, FrameError, FrameFormat};
use crate::losses::Losses;
use crate::repair::FLAT_LOG_SCALE;
use gs_core::sh::C0;
use gs_core::{Precision, RowPrecision, Splats, quat};
use rayon::prelude::*;
use std::io::{self, Write};
use std::sync::Arc;

/// Bytes of a row.
pub(crate) const ROW: usize = 32;
/// Rows looked at to tell such a file from any other.
const SAMPLE: usize = 256;
const FORMAT: &str = ".splat";

/// Whether `bytes`, at least the first rows of a file, make sense as rows: nothing else marks the format.
pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    let rows = bytes.as_chunks::<ROW>().0;
    let step = rows.len().div_ceil(SAMPLE).max(1);
    let sample = rows.iter().step_by(step);
    let (seen, sound) =
        sample.fold((0, 0), |(seen, sound), row| (seen + 1, sound + usize::from(plausible(row))));
    seen > 0 && sound * 10 >= seen * 9
}

fn float(row: &[u8; ROW], at: usize) -> f32 {
    f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]])
}

fn rotation(row: &[u8; ROW]) -> [f32; 4] {
    std::array::from_fn(|i| (f32::from(row[28 + i]) - 128.0) / 128.0)
}

fn plausible(row: &[u8; ROW]) -> bool {
    let place = (0..3).all(|axis| float(row, 4 * axis).abs() < 1e7);
    let size = (3..6).all(|axis| (0.0..1e5).contains(&float(row, 4 * axis)));
    let q = rotation(row);
    place && size && (0.9..1.1).contains(&quat::dot(q, q))
}

/// What of a row is off by rounding: whole steps of the bytes, since writers cut as often as they round.
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

/// Reads a `.splat` frame. Rows beyond the last whole one are an error; standard deviations of 0 become that of [`FLAT_LOG_SCALE`].
///
/// # Errors
/// If there are no rows or the last one is cut.
pub fn read(bytes: &[u8]) -> Result<Frame, FrameError> {
    let (rows, rest) = bytes.as_chunks::<ROW>();
    if !rest.is_empty() {
        return Err(FrameError::Truncated {
            format: FORMAT,
            part: "the last row",
            expected: ROW as u128,
            found: rest.len() as u128,
        });
    }
    if rows.is_empty() {
        return Err(FrameError::Empty { format: FORMAT });
    }
    let mut notes: Vec<String> = ends_note(rows.iter().map(|row| row[27])).into_iter().collect();
    let flat = rows.iter().filter(|row| (3..6).any(|axis| float(row, 4 * axis) == 0.0)).count();
    if flat > 0 {
        notes.push(format!("{flat} rows with a standard deviation of 0 are kept as flat splats"));
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

/// Writes a `.splat` frame and says what it does not keep.
///
/// # Errors
/// If the arrays of `splats` disagree ([`io::ErrorKind::InvalidInput`]) or writing fails.
pub fn write(splats: &Splats, out: &mut impl Write) -> io::Result<Losses> {
    splats.check_shapes().map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error))?;
    let rows: Vec<[u8; ROW]> =
        (0..splats.len()).into_par_iter().map(|i| format_row(splats, i)).collect();
    out.write_all(rows.as_flattened())?;
    let mut losses = Losses::none();
    if splats.sh_degree > 0 {
        losses.push(format!(
            "SH degree {} becomes 0: colour no longer depends on the view",
            splats.sh_degree
        ));
    }
    losses.push(
        "colour, opacity and rotation have 8 bits: ±1/510 of full scale, rotations within 2°",
    );
    let clipped = |dc: &f32| !(0.0..=1.0).contains(&channel_of(*dc));
    let coeffs = splats.sh_coeffs();
    let count = splats.sh.iter().step_by(coeffs).filter(|dc| dc.iter().any(clipped)).count();
    if count > 0 {
        losses.push(format!("colours of {count} splats beyond 0 to 1 are clipped"));
    }
    Ok(losses)
}

fn format_row(splats: &Splats, i: usize) -> [u8; ROW] {
    let mut row = [0; ROW];
    for (axis, value) in splats.means[i].into_iter().chain(splats.scale(i)).enumerate() {
        row[4 * axis..][..4].copy_from_slice(&value.to_le_bytes());
    }
    for channel in 0..3 {
        row[24 + channel] = unorm8(channel_of(splats.sh_of(i)[0][channel]));
    }
    row[27] = unorm8(splats.opacity(i));
    let q = quat::normalize(splats.quats[i]);
    for (component, value) in q.into_iter().enumerate() {
        // 1 does not fit: 127/128 is the largest.
        row[28 + component] = unorm8((value * 128.0 + 128.0) / 255.0);
    }
    row
}
