//! [`EditedFrame`]: frame 1 and its surfaces.

use super::surface::{Nodes, SurfaceGraph};
use gs_core::Splats;

/// Frame 1 with its surfaces, and its state before the edit.
#[derive(Clone, Copy)]
pub(super) struct EditedFrame<'a> {
    pub(super) nodes: &'a Nodes,
    pub(super) surface: &'a SurfaceGraph,
    pub(super) first: &'a Splats,
    /// SH before the edit, `[M,K,3]`.
    pub(super) old: &'a [[f32; 3]],
    /// Source splats with the same geometry; for these, the state before the edit is exact.
    pub(super) source_rows: &'a [Option<u32>],
}
