//! Smoothness of motion and stability of neighbourhoods.

use gs_core::{DynamicScene, SceneError};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// Centres of every splat at every time, world units.
#[derive(Debug, Clone)]
pub struct MotionTrack {
    /// `[T][N]`.
    frames: Vec<Vec<[f32; 3]>>,
}

impl MotionTrack {
    /// Evaluates the centres of `scene` at `times`.
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

    /// Centres at the first time.
    pub fn first(&self) -> &[[f32; 3]] {
        self.frames.first().map_or(&[], Vec::as_slice)
    }

    /// Mean over splats and times of `‖x_{t+1} − 2x_t + x_{t−1}‖ / size`. Lower is
    /// smoother. Accelerated motion has jitter of its own, so compare with the ground
    /// truth or the source. 0 for fewer than three times.
    pub fn jitter(&self, size: f64) -> f64 {
        let mut total = 0.0;
        let mut count = 0_usize;
        for window in self.frames.windows(3) {
            for ((a, b), c) in window[0].iter().zip(&window[1]).zip(&window[2]) {
                let second: f64 =
                    (0..3).map(|k| f64::from(a[k] - 2.0 * b[k] + c[k]).powi(2)).sum::<f64>();
                total += second.sqrt();
                count += 1;
            }
        }
        total / count.max(1) as f64 / size
    }
}

/// Neighbours per point.
const NEIGHBOURS: usize = 8;

/// Neighbourhood distance deviation: relative change of the distances to the 8 nearest neighbours
/// of the first frame, averaged over splats and later times. Dimensionless. Real deformation raises
/// it and over-smoothed motion *lowers* it, so it measures stability across settings, not accuracy.
/// 0 for fewer than two times or nine splats.
pub fn neighbourhood_distance_deviation(track: &MotionTrack) -> f64 {
    let first = track.first();
    let Some(query) = NonZero::new(NEIGHBOURS + 1).filter(|_| first.len() > NEIGHBOURS) else {
        return 0.0;
    };
    let Ok(tree) = ImmutableKdTree::<f32, 3>::new_from_slice(first) else { return 0.0 };
    let per_splat: Vec<f64> = (0..first.len())
        .into_par_iter()
        .map(|i| {
            let neighbours: Vec<usize> = tree
                .query(&first[i])
                .nearest_n::<SquaredEuclidean<f32>>(query)
                .execute()
                .iter()
                .map(|hit| hit.item as usize)
                .filter(|&j| j != i)
                .take(NEIGHBOURS)
                .collect();
            let rest: f64 = neighbours.iter().map(|&j| distance(first[i], first[j])).sum();
            if rest <= 0.0 {
                return 0.0;
            }
            let changes = track.frames.iter().skip(1).map(|frame| {
                let change = |&j: &usize| {
                    (distance(frame[i], frame[j]) - distance(first[i], first[j])).abs()
                };
                neighbours.iter().map(change).sum::<f64>() / rest
            });
            changes.sum::<f64>()
        })
        .collect();
    let later = track.frames.len().saturating_sub(1).max(1);
    per_splat.iter().sum::<f64>() / (first.len() * later) as f64
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|k| f64::from(a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of points; `offset(time, point)` is added to each.
    fn track(offset: impl Fn(usize, usize) -> [f32; 3]) -> MotionTrack {
        let point = |i: usize| [(i % 4) as f32, (i / 4 % 4) as f32, (i / 16) as f32];
        let frame = |t: usize| {
            (0..64)
                .map(|i| {
                    let (p, d) = (point(i), offset(t, i));
                    [p[0] + d[0], p[1] + d[1], p[2] + d[2]]
                })
                .collect()
        };
        MotionTrack { frames: (0..4).map(frame).collect() }
    }

    #[test]
    fn uniform_motion_has_neither_jitter_nor_deviation() {
        let uniform = track(|t, _| [t as f32, 0.0, 0.0]);
        assert!(uniform.jitter(1.0) < 1e-6, "constant velocity");
        assert!(neighbourhood_distance_deviation(&uniform) < 1e-6, "rigid");
    }

    #[test]
    fn alternating_motion_increases_both_metrics() {
        let shaking = track(|t, i| [if (t + i) % 2 == 0 { 0.1 } else { -0.1 }, 0.0, 0.0]);
        assert!(
            (shaking.jitter(1.0) - 0.4).abs() < 1e-5,
            "±0.1 each frame: {}",
            shaking.jitter(1.0)
        );
        assert!(neighbourhood_distance_deviation(&shaking) > 0.01, "neighbours move apart");
    }
}
