//! Exports a dynamic Gaussian-splat scene, and optionally its edited version, as **one HTML file**
//! that plays from disk in any browser with WebGL 2.
//!
//! [`encode()`] converts one or two scenes into a payload: values are quantised to configurable
//! steps and approximated over time by few linear segments within a tolerance; data that both
//! scenes share are stored once; the result is compressed with gzip, which browsers decompress
//! natively. [`page()`] embeds it in a page with the player (`player/`, plain JavaScript and GLSL).
//! The crate's `README.md` documents the byte layout.
//!
//! # Picking
//!
//! With [`Annotations::row_numbers`], the page returns the splat that contributes most to a pixel.
//!
//! Deliberately absent: files, rendering (the caller provides the poster), and network access,
//! which the page's policy forbids.
//!
//! ```
//! use gs_player::{EncodeOptions, encode};
//!
//! let scene = gs_synth::demo(&gs_synth::DemoParams { num_splats: 1500, ..Default::default() })?;
//! let encoded = encode(&scene, None, &[0.0, 0.5, 1.0], &EncodeOptions::default(), &mut |_, _| {})?;
//! assert_eq!(encoded.report.frames, 3);
//! assert!(encoded.payload.len() < 1500 * 60);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod axis_permutation;
mod base91;
mod encode;
mod error;
mod options;
mod overlay;
mod pack;
mod page;
mod row_groups;
mod tracks;

pub use encode::{EncodeReport, Encoded, MAGIC, encode, encode_annotated};
pub use error::{MAX_FRAMES, PlayerError};
pub use options::EncodeOptions;
pub use overlay::{Annotations, Legend, MAX_ENTRIES, Overlay};
pub use page::{Page, PageScenes, Poster, page, served_page, source_file};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
