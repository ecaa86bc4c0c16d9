//! [`MotionReport`]: counts and numbers of a run.

use crate::inheritance::InheritanceReport;

/// Result of [`crate::propagate()`] as plain values, for reports and run folders.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct MotionReport {
    /// Source splats.
    pub num_sources: usize,
    /// Source splats that move.
    pub num_dynamic: usize,
    /// Source splats whose motion differs from that of all their neighbours; no edited splat
    /// follows them.
    pub num_floaters: usize,
    /// Source splats with a non-finite value at the edit frame or a key time; never used.
    pub num_broken_sources: usize,
    /// Displacement above which a splat counts as moving, world units.
    pub dynamic_threshold: f64,
    /// Length unit of all shares, world units; see [`crate::DynamicSplit::figure_size`].
    pub figure_size: f64,
    /// Edited splats.
    pub num_edited_splats: usize,
    /// Edited splats that are unchanged source splats.
    pub unchanged: usize,
    /// Edited splats that are source splats with a different appearance.
    pub recolored: usize,
    /// Edited splats that are source splats, moved, rotated or scaled as groups.
    pub moved: usize,
    /// Number of splats of each such group, and a description of its similarity.
    pub moved_groups: Vec<(usize, String)>,
    /// Edited splats that are none of these, matched by the guide
    /// (`blended + static_rows + field_rows + near_copies`).
    pub edited: usize,
    /// Edited splats next to a copy, which move with it.
    pub near_copies: usize,
    /// Splats that inherit the edit, if edits apply to surfaces.
    pub inheritance: Option<InheritanceReport>,
    /// Source splats without an identical edited splat.
    pub removed: usize,
    /// Rows that blend sources.
    pub blended: usize,
    /// Edited rows that are static, because the part to which they belong does not move.
    pub static_rows: usize,
    /// Rows of the deformation-field baseline.
    pub field_rows: usize,
    /// Rows beyond the reach of the source, which are static.
    pub out_of_reach: usize,
    /// Edited splats with a non-finite value, which are left unchanged.
    pub broken_rows: usize,
    /// Anchors of the source and of the edit; zeros for guides without anchors.
    pub anchors: [usize; 2],
    /// Anchors of the edit without a partner within the Welsch kernel's reach.
    pub unmatched_anchors: usize,
    /// The transport solve, if there was one.
    pub transport: Option<TransportReport>,
    /// Regions: groups of neighbouring source splats that move as one (default guide).
    pub num_regions: usize,
    /// Weight that was used for the source's own rotations; see
    /// [`crate::Aggregation::rotation_prior`].
    pub rotation_prior: f32,
    /// Seconds per stage, in order.
    pub timings: Vec<(&'static str, f64)>,
    /// Messages for the user: a count and the consequence.
    pub warnings: Vec<String>,
}

/// Convergence of the transport solve.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct TransportReport {
    /// Whether the tolerance was reached.
    pub converged: bool,
    /// Sweeps made.
    pub sweeps: usize,
    /// Last residual, units of λ0.
    pub residual: f64,
    /// Median anchor distance d_med, world units.
    pub d_med: f64,
    /// Welsch scale β = γ·d_med, world units.
    pub beta: f64,
    /// Transported mass; the masses of each cloud sum to 1.
    pub total_mass: f64,
}
