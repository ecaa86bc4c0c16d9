//! [`BeforeEdit`]: the scene before the edit.

use gs_core::DynamicScene;

/// The scene before the edit, and which of its splats the edit kept.
#[derive(Debug, Clone, Copy)]
pub struct BeforeEdit<'a> {
    /// The scene that was edited, with `N` splats.
    pub scene: &'a dyn DynamicScene,
    /// For each edited splat, the source splat with the same geometry, possibly moved; `None` for
    /// new geometry. `[M]`, values below `N`.
    pub source_rows: &'a [Option<u32>],
}
