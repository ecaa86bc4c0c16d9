//! [`Skeleton`]: poses of all bones at any time, and [`BoneMotions`]: the
//! motion between two poses, applied to splats.

use crate::{
    cloth,
    dance::{self, Dance},
    math::{narrow, wide, wxyz},
    part::Bone,
    pose::{Moved, Pose},
};
use glam::{DQuat, DVec3};
use gs_core::quat;

const NUM_BONES: usize = Bone::ALL.len();

/// Poses of all bones at times `t` in `[0,1]`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Skeleton {
    pub(crate) dance: Dance,
}

impl Skeleton {
    /// Bind pose to world at time `t`, per bone.
    fn poses(&self, t: f64) -> [Pose; NUM_BONES] {
        let mut poses = [Pose::IDENTITY; NUM_BONES];
        for bone in Bone::ALL {
            let parent = poses[bone.parent() as usize];
            poses[bone as usize] = parent.after(&self.dance.local(bone, t));
        }
        poses
    }

    /// From the bind pose to frame 1.
    pub(crate) fn posing(&self) -> BoneMotions {
        self.pose_at(0.0)
    }

    /// From the bind pose to time `t`.
    pub(crate) fn pose_at(&self, t: f64) -> BoneMotions {
        BoneMotions::between(&[Pose::IDENTITY; NUM_BONES], &self.poses(t), t)
    }

    /// From frame 1 to time `t`.
    pub(crate) fn motion(&self, t: f64) -> BoneMotions {
        BoneMotions::between(&self.poses(0.0), &self.poses(t), t)
    }
}

/// Attachment of a splat: to a bone, or between a bone (`weight` 1) and its parent (`weight` 0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Attach {
    pub(crate) bone: Bone,
    pub(crate) weight: f32,
}

impl Attach {
    pub(crate) const WORLD: Self = Self { bone: Bone::World, weight: 1.0 };

    pub(crate) const fn rigid(bone: Bone) -> Self {
        Self { bone, weight: 1.0 }
    }

    /// Between the parent of `bone` (0) and `bone` (1); the ends are rigid.
    pub(crate) fn joint(bone: Bone, weight: f32) -> Self {
        if weight <= 0.0 {
            Self::rigid(bone.parent())
        } else {
            Self { bone, weight: weight.min(1.0) }
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Joint {
    /// Motion of the bone itself.
    whole: Pose,
    whole_wxyz: [f32; 4],
    ln_scale: f32,
    /// Motion of the parent, and of the bone relative to it: a rotation about `pivot`.
    parent: Pose,
    pivot: DVec3,
    axis: DVec3,
    angle: f64,
    ratio: f64,
    still: bool,
}

/// The motion of all bones from one pose to another. Every point moves by
/// the similarity transform of its [`Attach`].
#[derive(Debug, Clone)]
pub(crate) struct BoneMotions {
    joints: [Joint; NUM_BONES],
    t: f64,
}

impl BoneMotions {
    fn between(from: &[Pose; NUM_BONES], to: &[Pose; NUM_BONES], t: f64) -> Self {
        let joints = Bone::ALL.map(|bone| {
            let id = bone as usize;
            let up = bone.parent() as usize;
            let whole = to[id].after(&from[id].inverse());
            let parent = to[up].after(&from[up].inverse());
            let against = parent.inverse().after(&whole);
            // the shorter rotation: a half-way joint must not swing through the body
            let turn = if against.rotation.w < 0.0 { -against.rotation } else { against.rotation };
            let (axis, angle) = turn.to_axis_angle();
            Joint {
                whole,
                whole_wxyz: wxyz(whole.rotation),
                ln_scale: narrow(whole.scale.ln()),
                parent,
                pivot: from[up].apply(dance::pivot(bone)),
                axis,
                angle,
                ratio: against.scale,
                still: to[id] == from[id],
            }
        });
        Self { joints, t }
    }

    /// Whether splats of this attachment do not move, for any weight.
    pub(crate) fn is_still(&self, attach: Attach) -> bool {
        attach.bone != Bone::Cloth
            && self.joints[attach.bone as usize].still
            && (attach.weight >= 1.0 || self.joints[attach.bone.parent() as usize].still)
    }

    /// The similarity transform of an attached point; undefined for cloth.
    pub(crate) fn pose(&self, attach: Attach) -> Pose {
        let joint = &self.joints[attach.bone as usize];
        if attach.weight >= 1.0 {
            return joint.whole;
        }
        let weight = f64::from(attach.weight);
        let turn = DQuat::from_axis_angle(joint.axis, joint.angle * weight);
        let part = Pose::about(joint.pivot, joint.ratio.powf(weight), turn, DVec3::ZERO);
        joint.parent.after(&part)
    }

    /// New position of an attached point.
    pub(crate) fn point(&self, attach: Attach, x: DVec3) -> DVec3 {
        if attach.bone == Bone::Cloth {
            return cloth::point(x, self.t);
        }
        self.pose(attach).apply(x)
    }

    /// New position, rotation and scale of an attached splat.
    pub(crate) fn splat(
        &self,
        attach: Attach,
        mean: [f32; 3],
        rotation: [f32; 4],
        log_scales: [f32; 3],
    ) -> Moved {
        if attach.bone == Bone::Cloth {
            return cloth::splat(mean, rotation, log_scales, self.t);
        }
        let joint = &self.joints[attach.bone as usize];
        let (pose, turn, ln_scale) = if attach.weight >= 1.0 {
            (joint.whole, joint.whole_wxyz, joint.ln_scale)
        } else {
            let pose = self.pose(attach);
            (pose, wxyz(pose.rotation), narrow(pose.scale.ln()))
        };
        Moved {
            mean: pose.apply(wide(mean)).as_vec3().into(),
            quat: quat::mul(turn, rotation),
            log_scales: log_scales.map(|value| value + ln_scale),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_are_continuous_in_weight_and_keep_their_pivot() {
        let frame = Skeleton { dance: Dance::default() }.motion(0.4);
        let bone = Bone::ForearmL;
        let pivot = frame.joints[bone as usize].pivot;
        let ends = [
            frame.point(Attach::rigid(bone.parent()), pivot),
            frame.point(Attach::rigid(bone), pivot),
        ];
        assert!((ends[0] - ends[1]).length() < 1e-12, "pivot: {ends:?}");
        let x = pivot + DVec3::new(0.05, 0.02, -0.03);
        let near = |weight| frame.point(Attach { bone, weight }, x);
        assert!(
            (near(1.0 - 1e-6) - frame.point(Attach::rigid(bone), x)).length() < 1e-6,
            "weight 1"
        );
        assert!(
            (near(1e-6) - frame.point(Attach::rigid(bone.parent()), x)).length() < 1e-6,
            "weight 0"
        );
    }
}
