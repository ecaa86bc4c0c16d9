//! Neighbourhood distance deviation (NDD).

use crate::track::distance;
use crate::{MotionTrack, PointNeighbors};
use rayon::prelude::*;

/// Number of neighbours of each point.
pub const NDD_NEIGHBORS: usize = 8;

/// Neighbourhood distance deviation over the 8 nearest neighbours in the first frame, see
/// [`deviation_among`]. 0 for fewer than two times or nine splats.
pub fn neighborhood_distance_deviation(track: &MotionTrack) -> f64 {
    deviation_among(track, &PointNeighbors::of(track.first(), NDD_NEIGHBORS))
}

/// Relative change of the distances to `neighbours` since the first frame:
/// `1/(T−1) Σ_{t≥2} 1/N Σ_i Σ_k |‖x_i^t − x_k^t‖ − ‖x_i^1 − x_k^1‖| / Σ_k ‖x_i^1 − x_k^1‖`.
/// Dimensionless; a point that coincides with all its neighbours counts as 0. True deformation
/// raises it, and averaging the motions of different parts *lowers* it, so it measures stability,
/// not accuracy: compare it with the value of the source.
pub fn deviation_among(track: &MotionTrack, neighbors: &PointNeighbors) -> f64 {
    let (first, rows) = (track.first(), neighbors.rows());
    if first.is_empty() || rows.len() != first.len() {
        return 0.0;
    }
    let per_splat: Vec<f64> = rows
        .par_iter()
        .enumerate()
        .map(|(i, near)| {
            let rest: f64 = near.iter().map(|&j| distance(first[i], first[j as usize])).sum();
            if rest <= 0.0 {
                return 0.0;
            }
            let changes = track.frames().iter().skip(1).map(|frame| {
                let change = |&j: &u32| {
                    let j = j as usize;
                    (distance(frame[i], frame[j]) - distance(first[i], first[j])).abs()
                };
                near.iter().map(change).sum::<f64>() / rest
            });
            changes.sum::<f64>()
        })
        .collect();
    let later = track.frames().len().saturating_sub(1).max(1);
    per_splat.iter().sum::<f64>() / (first.len() * later) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid whose points are moved by `at`.
    fn track(at: impl Fn(usize, [f32; 3]) -> [f32; 3]) -> MotionTrack {
        let point = |i: usize| [(i % 4) as f32, (i / 4 % 4) as f32, (i / 16) as f32];
        let frame = |t: usize| (0..64).map(|i| at(t, point(i))).collect();
        MotionTrack::from_frames((0..4).map(frame).collect())
    }

    #[test]
    fn rigid_motion_gives_zero_and_scaling_its_factor() {
        let turned = track(|t, [x, y, z]| {
            let (sin, cos) = (0.4 * t as f32).sin_cos();
            [cos * x - sin * y + t as f32, sin * x + cos * y, z]
        });
        assert!(neighborhood_distance_deviation(&turned) < 1e-6, "rigid");
        let scaled = track(|t, p| if t == 0 { p } else { p.map(|x| 1.3 * x) });
        let value = neighborhood_distance_deviation(&scaled);
        assert!((value - 0.3).abs() < 1e-6, "scaled by 1.3: {value}");
    }

    #[test]
    fn shaking_gives_a_positive_value() {
        let shaking = track(|t, [x, y, z]| {
            let odd = (t as f32 + x + y) % 2.0 > 0.5;
            let sign = if odd { -0.1 } else { 0.1 };
            [x + sign, y, z]
        });
        assert!(neighborhood_distance_deviation(&shaking) > 0.01, "neighbours move apart");
    }
}
