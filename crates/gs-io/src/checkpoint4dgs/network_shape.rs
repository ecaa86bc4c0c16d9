//! [`NetworkShape`]: the shape of a deformation network.

/// Properties of the network inferred from the shapes of the tensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "independent facts about a file")]
pub(super) struct NetworkShape {
    pub(super) width: usize,
    pub(super) channels: usize,
    pub(super) levels: usize,
    /// Number of linear layers of the trunk.
    pub(super) depth: usize,
    /// Whether the trunk expects encoded features.
    pub(super) encoded: bool,
    pub(super) has_sh_head: bool,
    pub(super) has_static_mlp: bool,
    pub(super) has_empty_voxel: bool,
}
