//! SPZ frames (Niantic): reads versions 2 to 4, writes 3 and 4.
//!
//! Versions 2 and 3 are one gzip stream, version 4 is a plain header and one zstd stream per
//! attribute. Values: centres 24-bit fixed point, opacity and colour 8 bits, log-scales in steps of
//! 1/16, quaternions 8 bits per component (version 2) or the smallest three in 10 bits, SH 8 bits.
//!
//! Axes: the specification is x right, y up, z back ([`Axes::RUB`](crate::Axes::RUB)), unless an
//! extension record states others. Converters that do not know the axes of their input
//! (splat-transform 3, gsply, Niantic's own by default) write those of the PLY instead, rotated by
//! 180° about x, and no record. See [`AxesReading`](crate::AxesReading).

mod error;
mod layout;
mod quantize;
mod read;
mod write;

pub use error::SpzError;
pub use read::read;
pub(crate) use read::shape;
pub use write::{WriteOptions, write};
