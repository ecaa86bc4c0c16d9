//! [`Clip`]: input of the writers of animated formats.

use crate::error::IoError;
use gs_core::{DynamicScene, Splats, quat};
use rayon::prelude::*;
use std::path::Path;

/// A scene and the times of its frames.
#[derive(Debug, Clone, Copy)]
pub struct Clip<'a> {
    /// The scene.
    pub scene: &'a dyn DynamicScene,
    /// Scene times of the frames, in the order played.
    pub times: &'a [f32],
    /// Frames per second.
    pub fps: f64,
}

impl Clip<'_> {
    /// Verifies the requirements of all formats.
    ///
    /// # Errors
    /// If there are no frames or no splats, or the frame rate is not a positive number.
    pub(crate) fn check(&self, path: &Path) -> Result<(), IoError> {
        if self.times.is_empty() {
            return Err(IoError::content(path, "no frames to write; expected at least one"));
        }
        if self.scene.num_splats() == 0 {
            return Err(IoError::content(path, "the scene has no splats; nothing to write"));
        }
        if !(self.fps.is_finite() && self.fps > 0.0) {
            return Err(IoError::content(
                path,
                format!("{} frames per second; expected a positive number", self.fps),
            ));
        }
        Ok(())
    }

    /// [`each_frame`] of the clip.
    pub(crate) fn each_frame(
        &self,
        path: &Path,
        visit: impl FnMut(usize, &Splats) -> Result<(), IoError>,
    ) -> Result<(), IoError> {
        each_frame(self.scene, self.times, path, visit)
    }
}

/// Calls `visit` with every frame in order; one frame is in memory at a time. `path` is for
/// messages.
///
/// # Errors
/// If the scene cannot be evaluated or changes its number of splats, or `visit` fails.
pub(crate) fn each_frame(
    scene: &dyn DynamicScene,
    times: &[f32],
    path: &Path,
    mut visit: impl FnMut(usize, &Splats) -> Result<(), IoError>,
) -> Result<(), IoError> {
    let failed = |source| IoError::Scene { path: path.to_owned(), source };
    let mut splats = Splats::default();
    for (index, &t) in times.iter().enumerate() {
        scene.at_into(t, &mut splats).map_err(failed)?;
        splats.check_shapes().map_err(|error| failed(error.into()))?;
        if splats.len() != scene.num_splats() {
            return Err(IoError::content(
                path,
                format!(
                    "frame {index} has {} splats, expected the scene's {}",
                    splats.len(),
                    scene.num_splats()
                ),
            ));
        }
        visit(index, &splats)?;
    }
    Ok(())
}

/// Rows that are valid (finite, with a non-zero quaternion) in every frame so far.
#[derive(Debug)]
pub(crate) struct ValidRows(Vec<bool>);

impl ValidRows {
    pub(crate) fn new(num_splats: usize) -> Self {
        Self(vec![true; num_splats])
    }

    pub(crate) fn add(&mut self, splats: &Splats) {
        self.0.par_iter_mut().enumerate().for_each(|(row, valid)| {
            *valid = *valid && splats.is_finite(row);
        });
    }

    /// The usable rows in order.
    ///
    /// # Errors
    /// If there are none.
    pub(crate) fn rows(&self, path: &Path) -> Result<Vec<usize>, IoError> {
        let rows: Vec<usize> = (0..self.0.len()).filter(|&row| self.0[row]).collect();
        if rows.is_empty() {
            return Err(IoError::content(
                path,
                "every splat has NaN or infinite values or a zero quaternion in some frame; \
                nothing to write",
            ));
        }
        Ok(rows)
    }
}

/// Rotations as unit quaternions with signs that are continuous over
/// frames; those of the first frame have `w ≥ 0`.
#[derive(Debug, Default)]
pub(crate) struct Hemispheres(Vec<[f32; 4]>);

impl Hemispheres {
    /// Advances to the next frame.
    pub(crate) fn follow(&mut self, splats: &Splats) {
        self.0.resize(splats.len(), quat::IDENTITY);
        self.0.par_iter_mut().zip(&splats.quats).for_each(|(held, &raw)| {
            *held = quat::align(quat::normalize(raw), *held);
        });
    }

    pub(crate) fn get(&self, row: usize) -> [f32; 4] {
        self.0[row]
    }
}

/// Note on omitted rows.
pub(crate) fn dropped_sentence(dropped: usize, of: usize) -> Option<String> {
    (dropped > 0).then(|| {
        format!(
            "{dropped} of {of} splats are omitted: NaN or infinite values or a zero quaternion in \
            some frame"
        )
    })
}

/// Size of a set of points, world units: the diagonal of the box that contains the middle 98 %
/// along each axis, so that single floaters have no influence.
pub(crate) fn trimmed_diagonal(points: &[[f32; 3]]) -> f64 {
    const TAIL: f64 = 0.01;
    let mut squared = 0.0_f64;
    for axis in 0..3 {
        let mut values: Vec<f32> =
            points.iter().map(|point| point[axis]).filter(|value| value.is_finite()).collect();
        if values.is_empty() {
            return 0.0;
        }
        let last = values.len() - 1;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
        let tail = ((last as f64 * TAIL).ceil() as usize).min(last / 4);
        let low = *values.select_nth_unstable_by(tail, f32::total_cmp).1;
        let high = *values.select_nth_unstable_by(last - tail, f32::total_cmp).1;
        squared += (f64::from(high) - f64::from(low)).powi(2);
    }
    squared.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_do_not_affect_the_size() {
        let mut points: Vec<[f32; 3]> =
            (0..1000_u16).map(|i| [f32::from(i) / 999.0, 0.0, 0.0]).collect();
        points[500][0] = 1e9;
        points[501][1] = f32::NAN;
        let size = trimmed_diagonal(&points);
        assert!((0.97..1.0).contains(&size), "{size}");
        assert_eq!(trimmed_diagonal(&[]), 0.0, "no points have size 0");
        assert_eq!(trimmed_diagonal(&[[3.0; 3]]), 0.0, "one point has size 0");
    }

    #[test]
    fn signs_are_continuous() {
        let frame = |q| Splats {
            means: vec![[0.0; 3]],
            quats: vec![q],
            log_scales: vec![[0.0; 3]],
            opacity_logits: vec![0.0],
            sh: vec![[0.0; 3]],
            sh_degree: 0,
        };
        let mut hemispheres = Hemispheres::default();
        hemispheres.follow(&frame([-0.6, 0.0, 0.8, 0.0]));
        assert_eq!(hemispheres.get(0), [0.6, 0.0, -0.8, 0.0], "w ≥ 0 at first");
        hemispheres.follow(&frame([0.1, 0.0, 1.0, 0.0]));
        assert!(hemispheres.get(0)[2] < 0.0, "the sign closest to the previous rotation");
    }
}
