//! Rows of `.splat` files, a format without magic bytes.

use gs_core::quat;

/// Bytes of a row.
pub(crate) const ROW: usize = 32;
/// Number of rows examined to recognise such a file.
const SAMPLE: usize = 256;

/// Whether `bytes`, at least the first rows of a file, are plausible rows; the format has no magic.
pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    let rows = bytes.as_chunks::<ROW>().0;
    let step = rows.len().div_ceil(SAMPLE).max(1);
    let sample = rows.iter().step_by(step);
    let (seen, valid) =
        sample.fold((0, 0), |(seen, valid), row| (seen + 1, valid + usize::from(plausible(row))));
    seen > 0 && valid * 10 >= seen * 9
}

pub(crate) fn float(row: &[u8; ROW], at: usize) -> f32 {
    f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]])
}

pub(crate) fn rotation(row: &[u8; ROW]) -> [f32; 4] {
    std::array::from_fn(|i| (f32::from(row[28 + i]) - 128.0) / 128.0)
}

fn plausible(row: &[u8; ROW]) -> bool {
    let position = (0..3).all(|axis| float(row, 4 * axis).abs() < 1e7);
    let size = (3..6).all(|axis| (0.0..1e5).contains(&float(row, 4 * axis)));
    let q = rotation(row);
    position && size && (0.9..1.1).contains(&quat::dot(q, q))
}
