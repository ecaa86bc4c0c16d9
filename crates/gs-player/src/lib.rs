//! A dynamic Gaussian-splat scene, and what an edit made of it, as **one HTML file** that plays
//! from disk in any browser with WebGL 2.
//!
//! [`encode()`] turns one or two scenes into a payload: values on a grid of stated steps, over time
//! as few straight pieces within a stated tolerance, what both scenes share stored once, compressed
//! with gzip (which browsers undo themselves). [`page()`] puts it into a page with the player
//! (`player/`, plain JavaScript and GLSL). The crate's `README.md` documents the bytes.
//!
//! Deliberately absent: files, rendering (the poster is given), networks: the page's own policy
//! forbids any.
//!
//! ```
//! use gs_player::{Options, encode};
//!
//! let scene = gs_synth::demo(&gs_synth::DemoParams { num_splats: 1500, ..Default::default() })?;
//! let encoded = encode(&scene, None, &[0.0, 0.5, 1.0], &Options::default(), &mut |_, _| {})?;
//! assert_eq!(encoded.report.frames, 3);
//! assert!(encoded.payload.len() < 1500 * 60);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod axis_permutation;
mod base91;
mod encode;
mod error;
mod options;
mod pack;
mod page;
mod survey;
mod tracks;

pub use encode::{EncodeReport, Encoded, MAGIC, encode};
pub use error::{MAX_FRAMES, PlayerError};
pub use options::Options;
pub use page::{Page, Poster, page};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
