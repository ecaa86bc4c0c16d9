//! [`MotionTrack`]: centres of splats over time.

use gs_core::{DynamicScene, SceneError};

/// Centres of every splat at every time, world units.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MotionTrack {
    /// `[T][N]`.
    frames: Vec<Vec<[f32; 3]>>,
}

impl MotionTrack {
    /// From centres, `[T][N]`, world units. In a frame shorter than the first, the missing rows are
    /// not measured.
    pub fn from_frames(frames: Vec<Vec<[f32; 3]>>) -> Self {
        Self { frames }
    }

    /// Centres of `scene` at `times`.
    ///
    /// # Errors
    /// If the scene cannot be evaluated.
    pub fn of(scene: &dyn DynamicScene, times: &[f32]) -> Result<Self, SceneError> {
        let frames = times
            .iter()
            .map(|&t| {
                let mut splats = gs_core::Splats::default();
                scene.geometry_into(t, &mut splats)?;
                Ok(splats.means)
            })
            .collect::<Result<_, SceneError>>()?;
        Ok(Self { frames })
    }

    /// Centres, `[T][N]`.
    pub fn frames(&self) -> &[Vec<[f32; 3]>] {
        &self.frames
    }

    /// Centres at the first time.
    pub fn first(&self) -> &[[f32; 3]] {
        self.frames.first().map_or(&[], Vec::as_slice)
    }

    /// The given splats, in this order; rows may be repeated.
    ///
    /// # Panics
    /// If a row is out of range.
    #[must_use]
    pub fn select(&self, rows: &[usize]) -> Self {
        let frames = self.frames.iter().map(|frame| rows.iter().map(|&row| frame[row]).collect());
        Self { frames: frames.collect() }
    }
}

/// Distance of two points.
pub(crate) fn distance(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|k| f64::from(a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}
