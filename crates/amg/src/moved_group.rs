//! [`MovedGroup`]: source splats that the edit moved together, and the splats (carriers) whose
//! motion they follow.
//!
//! At the edit time, the edit transformed the group by a similarity `T`, whose centre moves with
//! the scene: a pan that was scaled about its centre remains in the hand. Let `M(t)` be the rigid
//! motion of the group's source splats since the edit time. A source splat at `x(t)` is then moved
//! to
//!
//! ```text
//! x'(t) = S(t) x(t),   S(t) = M(t) T M(t)⁻¹
//! ```
//!
//! The group is at every time a similar copy of its source splats; at the edit time `S = T`. Static
//! groups and whole scenes have `S(t) = T`.

use crate::aggregate::{relative_rotation, weights_seen};
use crate::keyframes::still_seen;
use crate::rigid::{RigidFit, sub};
use crate::similarity::Similarity;
use gs_core::{Real, Splats, quat};

/// Weight of the carriers' own rotations: small, so that they matter only if positions do not
/// determine the rotation, as with fewer than three carriers.
const ROTATION_WEIGHT: f64 = 1e-3;

/// Source splats that the edit moved by one similarity, and that follow one rigid motion.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedGroup {
    /// `T`, from source to edited positions at the edit time, world frame and units.
    pub similarity: Similarity,
    /// Ids of the source splats whose rigid motion the group follows, and weights above 0; empty
    /// for a static group.
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
    pub(crate) rotation: [f64; 4],
}

impl MovedGroup {
    /// Pose of the group at the source state `source_t`. With `fading`, which needs opacities,
    /// faded carriers have lower weights.
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
            rotation: Similarity::IDENTITY.rotation,
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
        let rotation = fit.rotation(ROTATION_WEIGHT);
        let motion = Similarity {
            scale: 1.0,
            rotation,
            mirrored: false,
            translation: fit.apply(rotation, [0.0; 3]),
        };
        if !motion.is_valid() {
            return still;
        }
        GroupPose {
            now: motion.after(&self.similarity).after(&motion.inverse()),
            rotation,
            ..still
        }
    }
}

/// Applies the group's pose to a splat that represents the group's surface at other times, and that
/// the edit did not move itself.
pub(crate) fn transform_with_group(
    pose: &GroupPose,
    mean: &mut [f32; 3],
    rotation: &mut [f32; 4],
    log_scale: &mut [f32; 3],
) {
    *mean = pose.now.apply(mean.map(f64::from)).map(Real::as_f32);
    *rotation = quat::mul(pose.now.rotation.map(Real::as_f32), *rotation);
    *log_scale = log_scale.map(|value| value + pose.now.scale.ln().as_f32());
}

/// Geometry of a moved row at the time of `pose` and `source_t`; see the documentation of this
/// module. `edited` is the row at the edit time. Its differences from the similarity are kept: the
/// residual of its centre, and rotation and scales that the editor did not transform.
pub(crate) fn moved_geometry(
    edited: ([f32; 3], [f32; 4], [f32; 3]),
    id: usize,
    pose: &GroupPose,
    source_1: &Splats,
    source_t: &Splats,
) -> ([f32; 3], [f32; 4], [f32; 3]) {
    let (mean, rotation, log_scale) = edited;
    let x_1 = pose.at_edit.apply(source_1.means[id].map(f64::from));
    let residual = quat::rotate(pose.rotation, sub(mean.map(f64::from), x_1));
    let x_t = pose.now.apply(source_t.means[id].map(f64::from));
    let new_mean = [0, 1, 2].map(|k| (x_t[k] + residual[k]).as_f32());

    let unit = |q: [f32; 4]| quat::normalize(q.map(f64::from));
    let (q_1, q_t, q_e) = (unit(source_1.quats[id]), unit(source_t.quats[id]), unit(rotation));
    // Rotation from the transformed source splat to the edited one, in the axes of the splat.
    let placed = quat::mul(pose.at_edit.rotation, q_1);
    let own = quat::mul(quat::conjugate(placed), q_e);
    if quat::dot(own, own) < 0.5 || quat::dot(q_t, q_t) < 0.5 {
        return (new_mean, rotation, log_scale);
    }
    let rotated = quat::mul(quat::mul(pose.now.rotation, q_t), own);
    let new_rotation = quat::align(rotated, q_e).map(Real::as_f32);
    // Editors reorder axes: share of each source axis in each edited axis.
    let axes = gs_core::rotation_matrix(own);
    let change = [0, 1, 2].map(|k| source_t.log_scales[id][k] - source_1.log_scales[id][k]);
    let new_scale = std::array::from_fn(|k| {
        let sum: f64 = (0..3).map(|from| axes[from][k].powi(2) * f64::from(change[from])).sum();
        if sum.is_finite() { (f64::from(log_scale[k]) + sum).as_f32() } else { log_scale[k] }
    });
    (new_mean, new_rotation, new_scale)
}
