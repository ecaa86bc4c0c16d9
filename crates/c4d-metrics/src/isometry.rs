//! Change of the distances between neighbours.

use crate::track::distance;
use crate::{MotionTrack, PointNeighbors};

/// Mean over later times and edges `(g, h)` to `neighbours` of
/// `|‖x_g^t − x_h^t‖ / ‖x_g^1 − x_h^1‖ − 1|`, excluding edges of zero length at the first time. 0
/// for rigid motion; lower is better. `None` without edges or with fewer than two times.
pub fn isometry(track: &MotionTrack, neighbors: &PointNeighbors) -> Option<f64> {
    let first = track.first();
    let (mut sum, mut count) = (0.0, 0_usize);
    for frame in track.frames().iter().skip(1) {
        for (g, near) in neighbors.rows().iter().enumerate() {
            for h in near.iter().map(|&h| h as usize) {
                let length = distance(first[g], first[h]);
                if length > 0.0 {
                    sum += (distance(frame[g], frame[h]) / length - 1.0).abs();
                    count += 1;
                }
            }
        }
    }
    (count > 0).then(|| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretching_is_measured() {
        let points: Vec<[f32; 3]> = (0..5).map(|i| [i as f32, 0.0, 0.0]).collect();
        let moved = |f: fn(f32) -> f32| points.iter().map(|p| [f(p[0]), 0.0, 0.0]).collect();
        let near = PointNeighbors::of(&points, 2);
        let value = |f: fn(f32) -> f32| {
            isometry(&MotionTrack::from_frames(vec![points.clone(), moved(f)]), &near).unwrap()
        };
        assert!(value(|x| x + 3.0) < 1e-6, "shifted");
        assert!((value(|x| 1.5 * x) - 0.5).abs() < 1e-6, "stretched by half");
        assert_eq!(isometry(&MotionTrack::default(), &near), None, "no frames");
    }
}
