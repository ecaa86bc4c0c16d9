//! Comparators and golden-file readers for tests. Development only.
//!
//! Uses plain slices, so that every crate of the workspace can use it in its tests. The feature
//! `raster` adds golden cases and checks of the rasterisers, with types of `gs-core`.

pub mod compare;
mod fixture;
pub mod golden;
pub mod noise;
#[cfg(feature = "raster")]
pub mod placement;
#[cfg(feature = "raster")]
pub mod raster;
mod seeded_weights;

pub use fixture::fixture;
pub use seeded_weights::{SeededTensor, seeded_weights};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
