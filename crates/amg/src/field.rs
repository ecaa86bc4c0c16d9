//! [`FieldAt`]: the source's deformation field, evaluated at splats it was not trained on.

use gs_core::{SceneError, Splats};
use std::fmt::Debug;

/// A deformation field defined everywhere in space: the hook of the baseline "w/o AMG".
///
/// Tabulated scenes have no such field, neural ones do.
pub trait FieldAt: Debug + Send + Sync {
    /// Writes into `out` what the field makes of `rest`, taken as canonical splats, at time `t`.
    /// Row `i` of `out` is row `i` of `rest`; stored parameters, world frame. SH degree of `out` is
    /// that of `rest`.
    ///
    /// The baseline takes the *difference* of two times, so a field that moves its canonical splats
    /// already at the edit frame leaves that frame unmoved.
    ///
    /// # Errors
    /// If the field has no value at `t` or its data cannot be read.
    fn displace_into(&self, rest: &Splats, t: f32, out: &mut Splats) -> Result<(), SceneError>;
}
