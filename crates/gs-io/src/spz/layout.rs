//! Constants of the format.

use crate::axes::Axes;

/// Bytes of the header before version 4.
pub(super) const HEADER: usize = 16;
/// Bytes of the header of version 4.
pub(super) const HEADER_4: usize = 32;
/// Log-scale of byte 0, and steps per unit.
pub(super) const LOG_SCALE_MIN: f32 = -10.0;
pub(super) const LOG_SCALE_STEPS: f32 = 16.0;
/// Channel per DC coefficient; less than C0, so that bytes extend beyond displayable colours.
pub(super) const COLOR_SCALE: f32 = 0.15;
/// Fractional bits of a centre, the same for every known writer.
pub(super) const FRACTIONAL_BITS: u8 = 12;
/// Bits of the flags.
pub(super) const FLAG_ANTIALIASED: u8 = 1;
pub(super) const FLAG_EXTENSIONS: u8 = 2;
/// Extension record with the axes: `u32` type, `u32` number of bytes (4), `u32` code of [`Axes`].
pub(super) const EXTENSION_AXES: u32 = 0xADBE_0003;
/// Axes in which files are written, those of the specification first.
pub(super) const USUAL_AXES: [Axes; 2] = [Axes::RUB, Axes::PLY];
/// Bits of SH coefficients of degree 1, and of higher degrees, in the reference encoder.
pub(super) const SH_BITS: [u32; 2] = [5, 4];
