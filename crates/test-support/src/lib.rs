//! Comparators that can fail, and readers of golden files. Development only.
//!
//! Works on plain slices, so that any crate of the workspace may use it in its tests. The feature
//! `raster` adds the golden cases of the rasteriser, with types of `gs-core`.

pub mod compare;
mod fixture;
pub mod golden;
#[cfg(feature = "raster")]
pub mod raster;

pub use fixture::fixture;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
