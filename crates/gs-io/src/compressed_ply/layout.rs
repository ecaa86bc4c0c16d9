//! Constants of the format.

/// Splats per row of `chunk`.
pub(super) const CHUNK: usize = 256;
/// Columns of `chunk`, in the order in which they are written. Files of older tools have no colour
/// columns; their colour range is 0 to 1.
pub(super) const COLUMNS: [&str; 18] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
    "min_r",
    "min_g",
    "min_b",
    "max_r",
    "max_g",
    "max_b",
];
/// Columns of `vertex`.
pub(super) const WORDS: [&str; 4] =
    ["packed_position", "packed_rotation", "packed_scale", "packed_color"];
/// Largest absolute log-scale; larger ones are clamped on writing.
pub(super) const MAX_LOG_SCALE: f32 = 20.0;
/// Largest absolute SH coefficient.
pub(super) const MAX_SH: f32 = 4.0;
/// Bits of the three coordinates of a packed vector.
pub(super) const BITS: [u32; 3] = [11, 10, 11];
