//! SPZ frames (Niantic): versions 2 to 4 in, 3 and 4 out.
//!
//! Versions 2 and 3 are one gzip stream, version 4 is a plain header and one zstd stream per
//! attribute. Values: centres 24-bit fixed point, opacity and colour 8 bits, log-scales in steps of
//! 1/16, quaternions 8 bits a component (version 2) or the smallest three in 10 bits, SH 8 bits.
//!
//! Axes: by the format's description x right, y up, z back ([`Axes::RUB`]), unless an extension
//! record names others. Converters that are not told the axes of their input (splat-transform 3,
//! gsply, Niantic's own by default) write those of the PLY instead, half a turn about x away, and
//! no record. See [`AxesReading`](crate::AxesReading).

use crate::axes::Axes;

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
/// Bits of the flags.
const FLAG_ANTIALIASED: u8 = 1;
const FLAG_EXTENSIONS: u8 = 2;
/// Extension record that names the axes: `u32` type, `u32` number of bytes (4), `u32` code of
/// [`Axes`].
const EXTENSION_AXES: u32 = 0xADBE_0003;
/// Axes in which files are written, the described ones first.
const USUAL_AXES: [Axes; 2] = [Axes::RUB, Axes::PLY];
/// Bits of SH coefficients of degree 1, and of the degrees above, that the reference encoder
/// leaves.
const SH_BITS: [u32; 2] = [5, 4];
