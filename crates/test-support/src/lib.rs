//! Comparators that can fail, and readers of golden files. Development only.
//!
//! Works on plain slices, so that any crate of the workspace may use it in its tests. The feature
//! `raster` adds the golden cases of the rasteriser, with types of `gs-core`.

pub mod compare;
pub mod golden;
#[cfg(feature = "raster")]
pub mod raster;

use std::path::PathBuf;

/// Path of `fixtures/<relative>` at the top of the workspace.
pub fn fixture(relative: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(relative)
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
