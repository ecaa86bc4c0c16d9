//! [`Shape`] of a deformation network.

/// What the shapes of the tensors say about the network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "independent facts about a file")]
pub(super) struct Shape {
    pub(super) width: usize,
    pub(super) channels: usize,
    pub(super) levels: usize,
    /// Linear layers of the trunk.
    pub(super) depth: usize,
    /// Whether the trunk takes encoded features.
    pub(super) encoded: bool,
    pub(super) has_sh_head: bool,
    pub(super) has_static_mlp: bool,
    pub(super) has_empty_voxel: bool,
}
