//! [`FieldAt`]: the source's deformation field, evaluated at other splats than those that it was
//! trained on.

use gs_core::{SceneError, Splats};
use std::fmt::Debug;

/// A deformation field defined everywhere in space, for the baseline "w/o AMG".
///
/// Neural scenes have such a field, tabulated scenes do not.
pub trait FieldAt: Debug + Send + Sync {
    /// Writes `rest`, taken as canonical splats and deformed to time `t`, into `out`. Row `i` of
    /// `out` is row `i` of `rest`; stored parameters, world frame. The SH degree of `out` is that
    /// of `rest`.
    ///
    /// The baseline uses the *difference* between two times, so the edit frame is unchanged even if
    /// the field deforms its canonical splats at that time.
    ///
    /// # Errors
    /// If the field has no value at `t` or its data cannot be read.
    fn displace_into(&self, rest: &Splats, t: f32, out: &mut Splats) -> Result<(), SceneError>;
}
