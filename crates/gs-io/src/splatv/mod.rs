//! `.splatv`: splats that move along cubic polynomials of time, the format of splaTV and gsplat.js.
//!
//! ```text
//! 0  4  u32 0x674B
//! 4  4  u32 length of the JSON
//! 8  …  JSON: [{"type":"splat","size":S,"texwidth":4096,"texheight":H,"cameras":[…]}]
//! …  S  64 bytes per splat, zero padded to whole rows of the texture
//! ```
//!
//! Little-endian; a splat is sixteen 32-bit words, where `h` denotes two IEEE halves: `0–2`
//! position · `3–4` h quaternion wxyz · `5–6` h standard deviations · `7` bytes R, G, B, A · `8–12`
//! h velocities v₁, v₂, v₃ · `13–14` h ω · `15` h centre and width in time. Time runs from 0 to 1;
//! see [`gs_deform::Polynomial`] for the motion. Colour is not view-dependent; sizes and colours
//! are constant over time.

mod error;
mod fit;
mod read;
mod row;
mod write;

pub use error::SplatvError;
pub use read::{OpenedClip, open, read};
pub use write::{DEFAULT_TOLERANCE, PASSES, WriteOptions, WriteReport, write};
