//! [`MovedGroup`]: source splats that the edit moved together, and the splats whose motion they
//! follow.
//!
//! The edit placed the group by a similarity `T` at the edit time. The centre of that similarity
//! moves with the scene: a pan that was scaled about its centre is still in a hand. With `M(t)`,
//! the rigid motion of the group's own source splats since the edit time, a splat that was at
//! `x(t)` is at
//!
//! ```text
//! x'(t) = S(t) x(t),   S(t) = M(t) T M(t)⁻¹
//! ```
//!
//! At every time the group is similar to its source splats and in their place; at the edit time `S
//! = T`. Groups that do not move, and whole scenes, have `S(t) = T`.

use crate::aggregate::{relative_rotation, weights_seen};
use crate::keyframes::still_seen;
use crate::rigid::{RigidFit, sub};
use crate::similarity::Similarity;
use gs_core::{Real, Splats, quat};

/// Weight of the carriers' own rotations: small, so that it matters only where positions do not
/// determine the rotation, as with fewer than three carriers.
const OPEN_CASES: f64 = 1e-3;

/// Source splats that were moved by one similarity and move as one.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedGroup {
    /// Similarity of the edit at the edit time, from the source's frame to the edit's.
    pub similarity: Similarity,
    /// Source splats whose rigid motion the group follows, with weights above 0; empty for a static
    /// group.
    pub carriers: Vec<(u32, f32)>,
}

/// Pose of a group at a time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GroupPose {
    /// `T`.
    pub(crate) at_edit: Similarity,
    /// `S(t)`.
    pub(crate) now: Similarity,
    /// Rotation of `M(t)`.
    pub(crate) turn: [f64; 4],
}

impl MovedGroup {
    /// Pose of the group at the source state `source_t`. With `fading`, which needs opacities,
    /// faded carriers have less weight.
    pub(crate) fn pose(
        &self,
        source_1: &Splats,
        source_t: &Splats,
        fading: bool,
        scratch: &mut Vec<f32>,
    ) -> GroupPose {
        let still = GroupPose {
            at_edit: self.similarity,
            now: self.similarity,
            turn: Similarity::IDENTITY.rotation,
        };
        if self.carriers.is_empty() {
            return still;
        }
        let (ids, weights): (Vec<u32>, Vec<f32>) = self.carriers.iter().copied().unzip();
        if fading {
            weights_seen((&ids, &weights), |id| still_seen(source_1, source_t, id), scratch);
        } else {
            scratch.clone_from(&weights);
        }
        let point = |splats: &Splats, id: u32| splats.means[id as usize].map(f64::from);
        let pairs = ids
            .iter()
            .zip(scratch.iter())
            .map(|(&id, &w)| (f64::from(w), point(source_1, id), point(source_t, id)));
        let mut fit = RigidFit::of(pairs);
        for (&id, &weight) in ids.iter().zip(scratch.iter()) {
            fit.add_rotation(f64::from(weight), relative_rotation(source_1, source_t, id as usize));
        }
        let turn = fit.rotation(OPEN_CASES);
        let motion = Similarity {
            scale: 1.0,
            rotation: turn,
            mirrored: false,
            translation: fit.apply(turn, [0.0; 3]),
        };
        if !motion.is_valid() {
            return still;
        }
        GroupPose { now: motion.after(&self.similarity).after(&motion.inverse()), turn, ..still }
    }
}

/// Moves a splat that represents a group's surface, but was not placed by the edit, to the group's
/// pose.
pub(crate) fn carry(
    pose: &GroupPose,
    mean: &mut [f32; 3],
    rotation: &mut [f32; 4],
    log_scale: &mut [f32; 3],
) {
    *mean = pose.now.apply(mean.map(f64::from)).map(Real::as_f32);
    *rotation = quat::mul(pose.now.rotation.map(Real::as_f32), *rotation);
    *log_scale = log_scale.map(|value| value + pose.now.scale.ln().as_f32());
}

/// Geometry of a moved row at a time; see the documentation of this module. `edited` is the row at
/// the edit time. Its differences from the similarity are kept: residuals of its centre, and
/// rotations and scales that the tool did not transform.
pub(crate) fn place(
    edited: ([f32; 3], [f32; 4], [f32; 3]),
    id: usize,
    pose: &GroupPose,
    source_1: &Splats,
    source_t: &Splats,
) -> ([f32; 3], [f32; 4], [f32; 3]) {
    let (mean, rotation, log_scale) = edited;
    let x_1 = pose.at_edit.apply(source_1.means[id].map(f64::from));
    let residual = quat::rotate(pose.turn, sub(mean.map(f64::from), x_1));
    let x_t = pose.now.apply(source_t.means[id].map(f64::from));
    let new_mean = [0, 1, 2].map(|k| (x_t[k] + residual[k]).as_f32());

    let unit = |q: [f32; 4]| quat::normalize(q.map(f64::from));
    let (q_1, q_t, q_e) = (unit(source_1.quats[id]), unit(source_t.quats[id]), unit(rotation));
    // Rotation from the placed source splat to the edited one, in the axes of the splat.
    let placed = quat::mul(pose.at_edit.rotation, q_1);
    let own = quat::mul(quat::conjugate(placed), q_e);
    if quat::dot(own, own) < 0.5 || quat::dot(q_t, q_t) < 0.5 {
        return (new_mean, rotation, log_scale);
    }
    let turned = quat::mul(quat::mul(pose.now.rotation, q_t), own);
    let new_rotation = quat::align(turned, q_e).map(Real::as_f32);
    // Editors reorder axes: the share of each source axis in each edited one.
    let axes = gs_core::rotation_matrix(own);
    let change = [0, 1, 2].map(|k| source_t.log_scales[id][k] - source_1.log_scales[id][k]);
    let new_scale = std::array::from_fn(|k| {
        let sum: f64 = (0..3).map(|from| axes[from][k].powi(2) * f64::from(change[from])).sum();
        if sum.is_finite() { (f64::from(log_scale[k]) + sum).as_f32() } else { log_scale[k] }
    });
    (new_mean, new_rotation, new_scale)
}
