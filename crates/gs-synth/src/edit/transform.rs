//! Scales, rotates and translates a part of the scene as a whole.

use super::{Draft, Region};
use crate::{
    math::{narrow, wide, wxyz},
    part::{Bone, Tag},
    pose::Pose,
    skeleton::BoneMotions,
};
use glam::{DQuat, DVec3, Vec3};
use gs_core::quat;

/// Scales and rotates the region about its centre, then translates it; `shift` in world units.
///
/// The attachment to bones does not change: an enlarged lantern stays in the hand.
pub(super) fn transform(
    draft: &mut Draft,
    posing: &BoneMotions,
    region: &Region,
    (scale, rotation, shift): (f32, [f32; 3], [f32; 3]),
) {
    let rows = draft.rows_in(region);
    let sum: DVec3 = rows.iter().map(|&i| wide(draft.splats.means[i])).sum();
    let middle = sum / rows.len().max(1) as f64;
    let rotation = DQuat::from_scaled_axis(wide(rotation));
    let pose = Pose::about(middle, f64::from(scale), rotation, wide(shift));
    let coeffs = draft.splats.sh_coeffs();
    for i in rows {
        let (splats, row) = (&mut draft.splats, &mut draft.rows[i]);
        splats.means[i] = pose.apply(wide(splats.means[i])).as_vec3().into();
        splats.quats[i] = quat::mul(wxyz(rotation), splats.quats[i]);
        for value in &mut splats.log_scales[i] {
            *value += narrow(pose.scale.ln());
        }
        row.normal = (rotation.as_quat() * Vec3::from(row.normal)).into();
        row.spacing *= scale;
        if row.attach.bone != Bone::Cloth {
            let back = posing.pose(row.attach).inverse();
            row.rest = back.apply(wide(splats.means[i])).as_vec3().into();
        }
        if coeffs > 1 {
            rotate_highlight(&mut splats.sh[i * coeffs + 1..i * coeffs + 4], rotation);
        }
        draft.tags[i] = Tag::Transformed;
    }
}

/// Rotates the linear harmonics, the only ones of these scenes; basis functions −y, z, −x.
fn rotate_highlight(linear: &mut [[f32; 3]], rotation: DQuat) {
    for channel in 0..3 {
        let slope = [-linear[2][channel], -linear[0][channel], linear[1][channel]];
        let slope = (rotation * wide(slope)).as_vec3();
        (linear[2][channel], linear[0][channel], linear[1][channel]) =
            (-slope.x, -slope.y, slope.z);
    }
}
