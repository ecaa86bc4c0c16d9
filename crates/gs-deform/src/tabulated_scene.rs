//! [`TabulatedScene`]: a scene tabulated frame by frame, in memory.

use crate::frames;
use gs_core::{DynamicScene, SceneError, Splats, SplatsError, TimeRange};
use thiserror::Error;

/// Error of building [`TabulatedScene`].
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum TabulatedSceneError {
    /// No frames.
    #[error("trajectories: no frames, expected at least 1")]
    Empty,
    /// A frame differs from frame 0 in number of splats or SH degree.
    #[error(
        "trajectories: frame {frame} has {found} splats of SH degree {found_degree}, expected {expected} of degree {expected_degree} as in frame 0"
    )]
    Rows {
        /// Index of the frame.
        frame: usize,
        /// Number of splats in that frame.
        found: usize,
        /// SH degree of that frame.
        found_degree: usize,
        /// Number of splats in frame 0.
        expected: usize,
        /// SH degree of frame 0.
        expected_degree: usize,
    },
    /// The arrays of a frame have inconsistent lengths.
    #[error("trajectories: frame {frame}: {source}")]
    Splats {
        /// Index of the frame.
        frame: usize,
        /// Cause of the error.
        source: SplatsError,
    },
}

/// `n` frames with persistent rows at times `i/(n−1)`: exact at the frames
/// (stored bits), linear between them (rotations by normalised linear
/// interpolation). A single frame is valid at every time.
#[derive(Debug, Clone, PartialEq)]
pub struct TabulatedScene {
    frames: Vec<Splats>,
}

impl TabulatedScene {
    /// # Errors
    /// If there are no frames, or they differ in rows or SH degree.
    pub fn new(frames: Vec<Splats>) -> Result<Self, TabulatedSceneError> {
        let first = frames.first().ok_or(TabulatedSceneError::Empty)?;
        for (index, frame) in frames.iter().enumerate() {
            frame
                .check_shapes()
                .map_err(|source| TabulatedSceneError::Splats { frame: index, source })?;
            if (frame.len(), frame.sh_degree) != (first.len(), first.sh_degree) {
                return Err(TabulatedSceneError::Rows {
                    frame: index,
                    found: frame.len(),
                    found_degree: frame.sh_degree,
                    expected: first.len(),
                    expected_degree: first.sh_degree,
                });
            }
        }
        Ok(Self { frames })
    }

    /// The frames.
    pub fn frames(&self) -> &[Splats] {
        &self.frames
    }

    fn evaluate(&self, t: f32, geometry_only: bool, out: &mut Splats) -> Result<(), SceneError> {
        frames::evaluate(self.frames.len(), t, geometry_only, out, |i| Ok(&self.frames[i]))
    }
}

impl DynamicScene for TabulatedScene {
    fn num_splats(&self) -> usize {
        self.frames[0].len()
    }

    fn sh_degree(&self) -> usize {
        self.frames[0].sh_degree
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn num_frames(&self) -> Option<usize> {
        Some(self.frames.len())
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, false, out)
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, true, out)
    }

    fn fades(&self) -> bool {
        let logits = |frame: &Splats| frame.opacity_logits == self.frames[0].opacity_logits;
        !self.frames.iter().all(logits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(x: f32, q: [f32; 4]) -> Splats {
        Splats {
            means: vec![[x, 0.0, 1.0]],
            quats: vec![q],
            log_scales: vec![[x; 3]],
            opacity_logits: vec![x],
            sh: vec![[x; 3]],
            sh_degree: 0,
        }
    }

    #[test]
    fn exact_at_frames_and_linear_between() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        // The second quaternion has a different length and sign;
        // interpolation must use the same hemisphere.
        let frames = vec![
            frame(0.0, [2.0, 0.0, 0.0, 0.0]),
            frame(1.0, [-half, 0.0, 0.0, -half]),
            frame(3.0, [-half, 0.0, 0.0, -half]),
        ];
        let scene = TabulatedScene::new(frames.clone()).unwrap();
        for (i, t) in scene.time_range().frames(3).into_iter().enumerate() {
            assert_eq!(scene.at(t).unwrap(), frames[i], "frame {i}");
        }
        let between = scene.at(0.25).unwrap();
        assert_eq!(between.means[0], [0.5, 0.0, 1.0], "linear");
        let eighth = std::f32::consts::FRAC_PI_8;
        assert!((between.quats[0][0] - eighth.cos()).abs() < 1e-6, "{:?}", between.quats[0]);
        assert!((between.quats[0][3] - eighth.sin()).abs() < 1e-6, "{:?}", between.quats[0]);
        assert_eq!(scene.at(0.75).unwrap().log_scales[0], [2.0; 3], "second interval");
    }

    #[test]
    fn geometry_only_agrees_and_leaves_colour_unchanged() {
        let q = [1.0, 0.0, 0.0, 0.0];
        let scene = TabulatedScene::new(vec![frame(0.0, q), frame(1.0, q)]).unwrap();
        let mut out = frame(9.0, q);
        scene.geometry_into(0.25, &mut out).unwrap();
        assert_eq!(out.means, scene.at(0.25).unwrap().means, "centres");
        assert_eq!(out.sh, [[9.0; 3]], "untouched");
    }

    #[test]
    fn bad_frames_and_times_are_refused() {
        assert_eq!(TabulatedScene::new(Vec::new()), Err(TabulatedSceneError::Empty), "no frames");
        let q = [1.0, 0.0, 0.0, 0.0];
        let two = frame(0.0, q).select(&[0, 0]);
        let error = TabulatedScene::new(vec![frame(0.0, q), two]).unwrap_err().to_string();
        assert!(error.contains("frame 1 has 2 splats"), "{error}");
        let scene = TabulatedScene::new(vec![frame(0.0, q)]).unwrap();
        assert!(scene.at(1.5).is_err(), "outside");
        assert!(scene.at(f32::NAN).is_err(), "NaN");
        assert!(scene.at(0.3).is_ok(), "a single frame is valid at every time");
    }
}
