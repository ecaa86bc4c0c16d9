//! [`index`]: conversion of row numbers to `u32`.

/// Row numbers are 32 bits wide in memory and in files.
#[expect(
    clippy::cast_possible_truncation,
    reason = "clouds are checked to have fewer than 2^32 rows"
)]
pub(crate) fn index(i: usize) -> u32 {
    i as u32
}
