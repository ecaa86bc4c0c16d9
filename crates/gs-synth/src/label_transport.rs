//! A control: labels propagated from splat to splat by a vote of the nearest neighbours.

use crate::oracle::{Tree, thin_axis};
use glam::Vec3;
use gs_core::{DynamicScene, SceneError, Splats};

/// Number of steps over the clip.
const STEPS: usize = 20;
/// Number of voters.
const NEIGHBORS: usize = 8;

/// Propagates labels over time, starting from `labelled` `[N]` for the splats that are visible at
/// the first time. Returns the label of each splat, `[N]`.
///
/// A splat that becomes visible gets the label of the majority of its 8 nearest visible neighbours
/// with known labels, weighted by opacity, `exp(−½(d/d₃)²)` and `exp(3(|n·n'| − 1))`.
///
/// # Errors
/// If the scene cannot be evaluated.
pub fn label_transport(
    scene: &dyn DynamicScene,
    labelled: &[bool],
) -> Result<Vec<bool>, SceneError> {
    let times = scene.time_range().frames(STEPS + 1);
    let frames = times.iter().map(|&t| scene.at(t)).collect::<Result<Vec<Splats>, _>>()?;
    let n = scene.num_splats();
    let peak = |row: usize| frames.iter().map(|f| f.opacity(row)).fold(0.0, f32::max);
    let floor: Vec<f32> = (0..n).map(|row| (0.05 * peak(row)).max(0.02)).collect();
    let mut labels: Vec<Option<bool>> =
        (0..n).map(|row| (frames[0].opacity(row) > floor[row]).then_some(labelled[row])).collect();
    for frame in &frames[1..] {
        let alive = |row: &usize| frame.opacity(*row) > floor[*row];
        let (judged, new): (Vec<usize>, Vec<usize>) =
            (0..n).filter(alive).partition(|&row| labels[row].is_some());
        let tree = Tree::new(frame, judged);
        let votes: Vec<Option<bool>> =
            new.iter().map(|&row| vote(frame, row, &tree, &labels)).collect();
        for (row, label) in new.into_iter().zip(votes) {
            labels[row] = label;
        }
    }
    Ok(labels.into_iter().map(|label| label == Some(true)).collect())
}

fn vote(frame: &Splats, row: usize, tree: &Tree, labels: &[Option<bool>]) -> Option<bool> {
    let near = tree.nearest(frame.means[row], NEIGHBORS);
    let third = near.get(2).or(near.last())?.1.max(f32::MIN_POSITIVE);
    let normal = |row: usize| Vec3::from(thin_axis(frame, row));
    let (mut yes, mut all) = (0.0, 0.0);
    for (voter, squared) in near {
        let facing = normal(row).dot(normal(voter)).abs();
        let near = (-0.5 * squared / third).exp();
        let weight = frame.opacity(voter) * near * (3.0 * (facing - 1.0)).exp();
        all += weight;
        if labels[voter] == Some(true) {
            yes += weight;
        }
    }
    Some(yes > 0.5 * all)
}
