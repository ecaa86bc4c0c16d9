//! [`GeometryScene`]: canonical splats whose geometry a network changes.

use crate::FieldError;
use crate::shape::RasterizedShapes;
use gs_core::{DynamicScene, SceneError, Splats, TimeRange};
use std::fmt::Debug;

/// A deformation of canonical splats that changes neither opacity nor colour.
pub trait GeometryField: Debug + Send + Sync {
    /// Input of the reference's rasteriser at time `t`, 0 to 1, one entry per canonical splat.
    fn rasterized(&self, canonical: &Splats, t: f32) -> RasterizedShapes;

    /// Which splats it moves, `[N]`; `None` for all.
    fn dynamic_mask(&self) -> Option<&[bool]> {
        None
    }
}

/// Canonical splats and the field that deforms them, at times 0 to 1.
///
/// The reference's rasteriser uses quaternions and scales as given; the returned splats have the
/// covariances that it computes from them. Opacity and colour are constant.
#[derive(Debug)]
pub struct GeometryScene<F> {
    canonical: Splats,
    field: F,
}

impl<F: GeometryField> GeometryScene<F> {
    /// A scene from a field that fits the splats.
    pub(crate) fn of(canonical: Splats, field: F) -> Result<Self, FieldError> {
        canonical.check_shapes()?;
        Ok(Self { canonical, field })
    }

    /// The stored splats, before any deformation.
    pub fn canonical(&self) -> &Splats {
        &self.canonical
    }

    /// The field.
    pub fn field(&self) -> &F {
        &self.field
    }

    /// Input of the reference's rasteriser at time `t`.
    pub fn rasterized(&self, t: f32) -> RasterizedShapes {
        self.field.rasterized(&self.canonical, t)
    }
}

impl<F: GeometryField> DynamicScene for GeometryScene<F> {
    fn num_splats(&self) -> usize {
        self.canonical.len()
    }

    fn sh_degree(&self) -> usize {
        self.canonical.sh_degree
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.geometry_into(t, out)?;
        out.opacity_logits.clone_from(&self.canonical.opacity_logits);
        out.sh.clone_from(&self.canonical.sh);
        out.sh_degree = self.canonical.sh_degree;
        Ok(())
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        let range = self.time_range();
        if !range.contains(t) {
            return Err(SceneError::Time { t, range });
        }
        self.rasterized(t).into_splats(out);
        Ok(())
    }

    fn fades(&self) -> bool {
        false
    }

    fn dynamic_mask(&self) -> Option<&[bool]> {
        self.field.dynamic_mask()
    }
}
