//! [`MotionReport`]: counts and numbers of a run.

use crate::inheritance::DescentReport;

/// What [`crate::propagate()`] found. Plain values, for reports and run folders.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MotionReport {
    /// Source splats.
    pub num_sources: usize,
    /// Source splats that move.
    pub num_dynamic: usize,
    /// Source splats that move with none of their neighbours; no edited splat follows them.
    pub num_floaters: usize,
    /// Source splats with a value that is not a number at the edit frame or a key time; never used.
    pub num_broken_sources: usize,
    /// Displacement from which a splat counted as moving, world units.
    pub dynamic_threshold: f64,
    /// Length unit of all shares: largest edge of the moving object's robust box at the edit frame,
    /// world units.
    pub figure_size: f64,
    /// Edited splats.
    pub num_edited_splats: usize,
    /// ... that are source splats, untouched.
    pub unchanged: usize,
    /// ... that are source splats with another appearance.
    pub recoloured: usize,
    /// ... that are source splats, moved, turned or scaled as groups.
    pub moved: usize,
    /// Splats of each such group, and what the edit did to it, in words.
    pub moved_groups: Vec<(usize, String)>,
    /// ... that are none of these, matched by the guide (`blended + static_rows + field_rows +
    /// beside_copies`).
    pub edited: usize,
    /// Edited rows beside a copy, which go with it.
    pub beside_copies: usize,
    /// Splats that inherit the edit, if edits belong to surfaces.
    pub descent: Option<DescentReport>,
    /// Source splats that no edited splat is.
    pub vanished: usize,
    /// Rows that blend sources.
    pub blended: usize,
    /// Edited rows that stay where they are, because the part they belong to does not move.
    pub static_rows: usize,
    /// Rows of the deformation-field baseline.
    pub field_rows: usize,
    /// Rows beyond reach of the source: they stay put.
    pub out_of_reach: usize,
    /// Edited splats with a value that is not a number: they stay as they are.
    pub broken_rows: usize,
    /// Anchors of the source and of the edit; zeros for guides without.
    pub anchors: [usize; 2],
    /// Anchors of the edit without a partner within the Welsch kernel's reach.
    pub unmatched_anchors: usize,
    /// The transport solve, if there was one.
    pub transport: Option<TransportReport>,
    /// Cells: groups of neighbouring source splats that move as one (default guide).
    pub num_parts: usize,
    /// Weight of the source's own rotations that was used.
    pub rotation_prior: f32,
    /// Seconds per stage, in order.
    pub timings: Vec<(&'static str, f64)>,
    /// Sentences for the user, each with a count and the consequence.
    pub warnings: Vec<String>,
}

/// Convergence of the transport solve.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
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
    /// Transported mass.
    pub total_mass: f64,
}
