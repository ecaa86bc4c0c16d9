//! Deviation of unedited splats from the motion of the source splats with which they are identical.

use crate::MotionTrack;
use crate::track::distance;
use gs_core::nearest_rank;

/// Distances to the true motion, over splats and later times, relative to a given size.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Drift {
    /// Mean over splats and times.
    pub mean: f64,
    /// Median over splats of each splat's mean over time.
    pub median: f64,
    /// 95th percentile over splats of each splat's mean over time.
    pub p95: f64,
    /// Largest distance.
    pub max: f64,
}

/// `‖Δ_g^t − Δ_s^t‖ / size` of row `g` of `moved` and the same row of `truth`, where `Δ` is the
/// displacement since the first time; lower is better. `None` without rows or with fewer than two
/// times.
pub fn drift(moved: &MotionTrack, truth: &MotionTrack, size: f64) -> Option<Drift> {
    let (a1, b1) = (moved.first(), truth.first());
    let rows = a1.len().min(b1.len());
    let later = moved.frames().len().min(truth.frames().len()).saturating_sub(1);
    if rows == 0 || later == 0 {
        return None;
    }
    let mut means = vec![0.0; rows];
    let mut max = 0.0_f64;
    for (a, b) in moved.frames().iter().zip(truth.frames()).skip(1) {
        for row in 0..rows {
            let step = |at: [f32; 3], first: [f32; 3]| [0, 1, 2].map(|k| at[k] - first[k]);
            let gap = distance(step(a[row], a1[row]), step(b[row], b1[row])) / size;
            means[row] += gap / later as f64;
            max = max.max(gap);
        }
    }
    let mean = means.iter().sum::<f64>() / rows as f64;
    let (median, p95) = (nearest_rank(&mut means, 0.5)?, nearest_rank(&mut means, 0.95)?);
    Some(Drift { mean, median, p95, max })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_motion_at_another_position_does_not_drift() {
        let track = |offset: f32, speed: f32| {
            MotionTrack::from_frames(
                (0..3).map(|t| vec![[offset + speed * t as f32, 0.0, 0.0]; 4]).collect(),
            )
        };
        let still = drift(&track(5.0, 1.0), &track(0.0, 1.0), 2.0).unwrap();
        assert_eq!(still, Drift { mean: 0.0, median: 0.0, p95: 0.0, max: 0.0 }, "same motion");
        let off = drift(&track(0.0, 1.5), &track(0.0, 1.0), 2.0).unwrap();
        assert!((off.max - 0.5).abs() < 1e-6, "two steps of 0.5 over a size of 2: {off:?}");
        assert!((off.mean - 0.375).abs() < 1e-6, "0.25 and 0.5: {off:?}");
        assert_eq!(drift(&MotionTrack::default(), &track(0.0, 1.0), 1.0), None, "no rows");
    }
}
