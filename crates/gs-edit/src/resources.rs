//! [`Resources`] of a script that the caller loads: files, masks, motion.

use gs_core::{Image, Splats};
use std::collections::{BTreeMap, BTreeSet};

/// Motion of the input.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Flags of the splats that move, `[N]`.
    pub moving: Vec<bool>,
    /// Part of each splat, numbered from 1 without gaps, `[N]`; 0 for splats without a part.
    pub parts: Vec<u32>,
}

/// Resources that steps refer to. Keys are the names as written in the steps.
#[derive(Debug, Clone, Default)]
pub struct Resources {
    /// Number of splats of the input, `N`.
    pub num_splats: usize,
    /// Motion of the input, for `moving` and `part`.
    pub motion: Option<Motion>,
    /// Flags of the splats in masks, `[N]` each ([`crate::lift_masks`]).
    pub masks: BTreeMap<String, Vec<bool>>,
    /// Ranges of rows of the input, from 0, both ends included ([`crate::parse_ids`]).
    pub ids: BTreeMap<String, Vec<(u64, u64)>>,
    /// Pictures with three or four channels, 0 to 1; the fourth is coverage.
    pub images: BTreeMap<String, Image>,
    /// Splats to graft, of any SH degree, in the frames of their files.
    pub splats: BTreeMap<String, Splats>,
}

/// Names of the resources that steps use, so that a caller can load them before any change.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ResourceNames {
    /// Whether [`Resources::motion`] is needed.
    pub motion: bool,
    /// Keys of [`Resources::masks`].
    pub masks: BTreeSet<String>,
    /// Keys of [`Resources::ids`].
    pub ids: BTreeSet<String>,
    /// Keys of [`Resources::images`].
    pub images: BTreeSet<String>,
    /// Keys of [`Resources::splats`].
    pub splats: BTreeSet<String>,
}
