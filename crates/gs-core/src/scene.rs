//! [`DynamicScene`]: splats at any time.

use crate::{Splats, SplatsError};
use std::fmt::Debug;
use thiserror::Error;

/// Closed interval of scene times (network time, dimensionless; 0 to 1, or to the last trained
/// frame if a format states it).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeRange {
    /// First time.
    pub start: f32,
    /// Last time.
    pub end: f32,
}

impl TimeRange {
    /// `[0, 1]`.
    pub const UNIT: Self = Self { start: 0.0, end: 1.0 };

    /// Whether `t` lies in the range, ends included. False for NaN.
    pub fn contains(&self, t: f32) -> bool {
        (self.start..=self.end).contains(&t)
    }

    /// `count` times, evenly spaced from `start` to `end`, both
    /// included; only the start if `count` is 1.
    pub fn frames(&self, count: usize) -> Vec<f32> {
        let last = count.saturating_sub(1).max(1) as f64;
        let (start, end) = (f64::from(self.start), f64::from(self.end));
        (0..count)
            .map(|i| {
                let t = start + (end - start) * (i as f64 / last);
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "scene times are single precision"
                )]
                let t = t as f32;
                t
            })
            .collect()
    }
}

/// Error of a scene's evaluation.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The scene has no value at this time.
    #[error("scene: time {t} lies outside [{}, {}]", range.start, range.end)]
    Time {
        /// The requested time.
        t: f32,
        /// The valid times.
        range: TimeRange,
    },
    /// The scene's arrays have inconsistent lengths.
    #[error(transparent)]
    Shape(#[from] SplatsError),
    /// The scene's data could not be read.
    #[error("scene: {what}")]
    Source {
        /// The data that was being read.
        what: String,
        /// The cause.
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// A set of splats in motion. Rows persist: row `i` is the same Gaussian at every time.
///
/// All code downstream (rendering, refinement, export, further edits) uses only this trait.
pub trait DynamicScene: Debug + Send + Sync {
    /// `N`, the same at every time.
    fn num_splats(&self) -> usize;

    /// SH degree of the splats, the same at every time.
    fn sh_degree(&self) -> usize;

    /// Times at which [`DynamicScene::at_into`] is defined.
    fn time_range(&self) -> TimeRange;

    /// Number of frames the scene was stored with, if it is a sequence; frame `i` is then at
    /// `time_range().frames(n)[i]`. `None` for continuous fields.
    fn num_frames(&self) -> Option<usize> {
        None
    }

    /// Writes all splats at time `t` into `out`, reusing its memory. Stored parameters, world
    /// frame, deformation applied.
    ///
    /// # Errors
    /// If `t` is outside [`DynamicScene::time_range`] or the scene's data cannot be read.
    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError>;

    /// As [`DynamicScene::at_into`], but only `means`, `quats` and `log_scales` are
    /// guaranteed to be those of time `t`; the other arrays may be left unchanged,
    /// even empty. Cheaper for scenes that deform colour.
    ///
    /// # Errors
    /// As [`DynamicScene::at_into`].
    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.at_into(t, out)
    }

    /// The splats at time `t`, freshly allocated.
    ///
    /// # Errors
    /// As [`DynamicScene::at_into`].
    fn at(&self, t: f32) -> Result<Splats, SceneError> {
        let mut out = Splats::default();
        self.at_into(t, &mut out)?;
        Ok(out)
    }

    /// Whether opacities may change over time. If false, they are the same at every time, so that
    /// callers that need only geometry can use [`DynamicScene::geometry_into`].
    fn fades(&self) -> bool {
        true
    }

    /// Splats that the scene's format declares to be dynamic (`[N]`); `None` if the format has no
    /// such flag and motion has to be measured.
    fn dynamic_mask(&self) -> Option<&[bool]> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_include_both_ends() {
        assert_eq!(TimeRange::UNIT.frames(5), [0.0, 0.25, 0.5, 0.75, 1.0], "five");
        assert_eq!(TimeRange::UNIT.frames(1), [0.0], "one");
        assert!(TimeRange::UNIT.frames(0).is_empty(), "none");
        assert!(!TimeRange::UNIT.contains(f32::NAN), "NaN is not a valid time");
    }
}
