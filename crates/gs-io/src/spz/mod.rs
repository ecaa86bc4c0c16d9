//! SPZ frames (Niantic): versions 2 to 4 in, 3 and 4 out.
//!
//! Versions 2 and 3 are one gzip stream, version 4 is a plain header and one zstd stream per attribute. Values: centres 24-bit fixed
//! point, opacity and colour 8 bits, log-scales in steps of 1/16, quaternions 8 bits a component (version 2) or the smallest three in
//! 10 bits, SH 8 bits. The frame of the file is x right, y up, z back (OpenGL); ours is x right, y down, z forward (COLMAP), half a turn
//! about x away.

mod quantize;
mod read;
mod write;

pub use read::read;
pub(crate) use read::shape;
pub use write::{WriteOptions, write};

/// First bytes, before any compression.
pub(crate) const MARK: [u8; 4] = *b"NGSP";
const FORMAT: &str = "SPZ";
/// Bytes of the header before version 4.
const HEADER: usize = 16;
/// Bytes of the header of version 4.
const HEADER_4: usize = 32;
/// Log-scale of byte 0, and bytes a unit.
const LOG_SCALE_MIN: f32 = -10.0;
const LOG_SCALE_STEPS: f32 = 16.0;
/// Channel per DC coefficient: less than C0, so that bytes reach beyond the colours shown.
const COLOR_SCALE: f32 = 0.15;
/// Bits of the fraction of a centre, as every writer puts it.
const FRACTIONAL_BITS: u8 = 12;

/// Sign of each SH coefficient under half a turn about x (y and z change sign).
const FLIPS: [f32; 16] =
    [1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0];

/// Half a turn about x.
fn flip_point([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, -y, -z]
}

/// The same, of a rotation `wxyz`.
fn flip_quat([w, x, y, z]: [f32; 4]) -> [f32; 4] {
    [w, x, -y, -z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_core::sh;

    #[test]
    fn half_a_turn_keeps_colours() {
        let direction = [0.48, -0.6, 0.64];
        let (here, there) = (sh::basis(3, direction), sh::basis(3, flip_point(direction)));
        for k in 0..16 {
            assert!((here[k] - FLIPS[k] * there[k]).abs() < 1e-6, "coefficient {k}");
        }
        let (q, v) = ([0.5, 0.1, -0.7, 0.2], [0.3, -1.0, 2.0]);
        let turned = gs_core::quat::rotate(gs_core::quat::normalize(q), v);
        let other = gs_core::quat::rotate(gs_core::quat::normalize(flip_quat(q)), flip_point(v));
        for axis in 0..3 {
            assert!((flip_point(turned)[axis] - other[axis]).abs() < 1e-5, "axis {axis}");
        }
    }
}
