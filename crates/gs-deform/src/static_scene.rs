//! [`StaticScene`]: splats that do not change over time.

use gs_core::{DynamicScene, SceneError, Splats, SplatsError, TimeRange};

/// The same splats at every time from 0 to 1: a plain 3DGS scene, or a model saved before its
/// deformation was trained.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticScene {
    splats: Splats,
}

impl StaticScene {
    /// # Errors
    /// If the arrays have inconsistent lengths.
    pub fn new(splats: Splats) -> Result<Self, SplatsError> {
        splats.check_shapes()?;
        Ok(Self { splats })
    }

    /// The splats.
    pub fn splats(&self) -> &Splats {
        &self.splats
    }
}

impl DynamicScene for StaticScene {
    fn num_splats(&self) -> usize {
        self.splats.len()
    }

    fn sh_degree(&self) -> usize {
        self.splats.sh_degree
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        let range = self.time_range();
        if !range.contains(t) {
            return Err(SceneError::Time { t, range });
        }
        out.clone_from(&self.splats);
        Ok(())
    }

    fn fades(&self) -> bool {
        false
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        let range = self.time_range();
        if !range.contains(t) {
            return Err(SceneError::Time { t, range });
        }
        out.means.clone_from(&self.splats.means);
        out.quats.clone_from(&self.splats.quats);
        out.log_scales.clone_from(&self.splats.log_scales);
        Ok(())
    }
}
