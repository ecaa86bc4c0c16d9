//! SPZ frames (Niantic): versions 2 to 4 in, 3 and 4 out.
//!
//! Versions 2 and 3 are one gzip stream, version 4 is a plain header and one zstd stream per
//! attribute. Values: centres 24-bit fixed point, opacity and colour 8 bits, log-scales in steps of
//! 1/16, quaternions 8 bits a component (version 2) or the smallest three in 10 bits, SH 8 bits.
//!
//! Axes: by the format's description x right, y up, z back ([`Axes::RUB`](crate::Axes::RUB)),
//! unless an extension record names others. Converters that are not told the axes of their input
//! (splat-transform 3, gsply, Niantic's own by default) write those of the PLY instead, half a turn
//! about x away, and no record. See [`AxesReading`](crate::AxesReading).

mod layout;
mod quantize;
mod read;
mod write;

pub use read::read;
pub(crate) use read::shape;
pub use write::{WriteOptions, write};
