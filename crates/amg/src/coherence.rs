//! Separates coherent motion from jitter.
//!
//! Trajectories fitted to images are arbitrary where images do not constrain them: splats on a
//! textureless wall slide along it independently, which is visible only if other splats follow
//! them. Motion, unlike jitter, is shared by neighbours.

use crate::keyframes::KeyFrames;
use anchors::{KdTree, Neighbor};

/// Sizes of the neighbourhoods, the splat itself included: large enough to detect little shared
/// motion, and small enough for a small object.
const NEIGHBORHOODS: [usize; 2] = [8, 25];

/// Number of standard errors by which the mean displacement of a neighbourhood must differ from
/// zero; with independent displacements, one neighbourhood in a thousand exceeds it.
const SIGNIFICANT: f64 = 3.3;

/// Clears `moves` of splats whose neighbourhood does not move at any key time: its mean
/// displacement, weighted by visibility, is within the range expected of independent displacements.
/// Has no effect on scenes with fewer than 25 splats.
pub(crate) fn keep_coherent(keys: &KeyFrames, moves: &mut [bool]) {
    let ids: Vec<usize> = (0..moves.len()).filter(|&i| !keys.broken[i]).collect();
    if ids.len() < NEIGHBORHOODS[1] || !moves.contains(&true) {
        return;
    }
    let points: Vec<[f64; 3]> = ids.iter().map(|&i| keys.at_edit.means[i].map(f64::from)).collect();
    let tree = KdTree::<3>::new(&points);
    let opacity: Vec<f64> = ids.iter().map(|&i| f64::from(keys.at_edit.opacity(i))).collect();
    let is_shared_at = |k: usize, near: &[Neighbor]| {
        let around = near.iter().map(|n| {
            let (n, id) = (n.id as usize, ids[n.id as usize]);
            (opacity[n] * keys.seen(k, id), keys.displacement(k, id))
        });
        is_shared(around)
    };
    let is_moving = |near: &[Neighbor]| (0..keys.times.len()).any(|k| is_shared_at(k, near));
    let mut incoherent: Vec<usize> = (0..ids.len()).filter(|&n| moves[ids[n]]).collect();
    // The smaller neighbourhood first: it suffices for most moving splats.
    for count in NEIGHBORHOODS {
        let places: Vec<[f64; 3]> = incoherent.iter().map(|&n| points[n]).collect();
        let is_moving = tree.map(&places, count, |_, near| is_moving(near));
        let mut is_moving = is_moving.into_iter();
        incoherent.retain(|_| is_moving.next() == Some(false));
    }
    for n in incoherent {
        moves[ids[n]] = false;
    }
}

/// Whether the weighted mean displacement is significant.
fn is_shared(around: impl Iterator<Item = (f64, [f64; 3])>) -> bool {
    let (mut total, mut squares, mut mean, mut second) = (0.0_f64, 0.0, [0.0_f64; 3], 0.0_f64);
    for (weight, d) in around {
        total += weight;
        squares += weight * weight;
        for axis in 0..3 {
            mean[axis] += weight * d[axis];
            second += weight * d[axis] * d[axis];
        }
    }
    if total <= 0.0 {
        return false;
    }
    let shared: f64 = mean.iter().map(|m| (m / total).powi(2)).sum();
    let variance = (second / total - shared).max(0.0);
    let effective = total * total / squares;
    shared * (effective - 1.0) > SIGNIFICANT * SIGNIFICANT * variance
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_motion_differs_from_independent_displacements() {
        // A low-discrepancy scatter of directions whose sum is almost zero.
        let scatter = |i: usize| {
            let angle = i as f64 * 2.399_963;
            let z = 1.0 - (2.0 * i as f64 + 1.0) / 25.0;
            let r = (1.0 - z * z).sqrt();
            [r * angle.cos(), r * angle.sin(), z]
        };
        let around = |drift: f64| -> Vec<(f64, [f64; 3])> {
            (0..25)
                .map(|i| (0.8, scatter(i)))
                .map(|(w, d)| (w, [d[0] + drift, d[1], d[2]]))
                .collect()
        };
        assert!(!is_shared(around(0.0).into_iter()), "independent");
        assert!(is_shared(around(1.0).into_iter()), "common motion as large as the scatter");
        assert!(
            is_shared([(1.0, [1e-9, 0.0, 0.0]); 25].into_iter()),
            "small but identical displacements"
        );
        assert!(!is_shared([(0.0, [1.0; 3]); 25].into_iter()), "invisible splats");
    }
}
