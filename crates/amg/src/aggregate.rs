//! The motion of one blended row at one time (Eqs. 9, 10, 24, or their rigid counterparts).

use crate::keyframes::{FADED, still_seen};
use crate::options::{Aggregation, PositionRule, RotationRule, ScaleRule};
use crate::rigid::RigidFit;
use gs_core::{Real, Splats, quat};

/// Logarithm of the largest factor by which an isotropic blend may change scales (4): the ratio of
/// a source with zero scale at the edit frame is undefined. Ratios per axis are not limited.
const LN_MAX_SCALE_RATIO: f32 = 1.386_294_4;
/// Logarithm of the largest ratio per axis; keeps sums of ratios finite.
const LN_FINITE_RATIO: f64 = 700.0;

/// Geometry of one splat: mean, quaternion, log-scales.
pub(crate) type Geometry = ([f32; 3], [f32; 4], [f32; 3]);

/// Motion of one source splat from the edit frame to another time, shared by all rows that follow
/// it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SourceMotion {
    from: [f32; 3],
    to: [f32; 3],
    /// `q_t q_1⁻¹`, unit.
    rotation: [f32; 4],
    /// Logarithm of the ratio of scales per axis; 0 if it is undefined.
    ln_scale: [f32; 3],
    /// Presence, 0 to 1.
    seen: f32,
}

impl SourceMotion {
    /// With `fading`, which needs opacities, presence is computed; otherwise it is 1.
    pub(crate) fn between(source_1: &Splats, source_t: &Splats, id: usize, fading: bool) -> Self {
        let ln_scale = [0, 1, 2].map(|axis| {
            let ln = source_t.log_scales[id][axis] - source_1.log_scales[id][axis];
            if ln.is_nan() { 0.0 } else { ln }
        });
        Self {
            from: source_1.means[id],
            to: source_t.means[id],
            rotation: relative_rotation(source_1, source_t, id).map(f32::from_double),
            ln_scale,
            seen: if fading { still_seen(source_1, source_t, id) } else { 1.0 },
        }
    }

    /// Presence, 0 to 1.
    pub(crate) fn seen(&self) -> f32 {
        self.seen
    }
}

/// The source at the edit frame and at another time, and the motion of each followed splat.
#[derive(Clone, Copy)]
pub(crate) struct SourceAt<'a> {
    pub(crate) source_1: &'a Splats,
    pub(crate) source_t: &'a Splats,
    pub(crate) motions: &'a [SourceMotion],
}

/// Geometry, at the time of the source state, of the edited splat `edited` (its geometry at the
/// edit frame), which follows the source splats `ids`.
pub(crate) fn blend_geometry(
    edited: Geometry,
    (ids, weights): (&[u32], &[f32]),
    source: SourceAt<'_>,
    how: Aggregation,
) -> Geometry {
    let (mean, rotation, log_scale) = edited;
    let (fit, relative) = rigid_motion((ids, weights), source.motions, how);
    let new_mean = match how.position {
        PositionRule::Rigid => fit.apply(relative, mean.map(f64::from)).map(f32::from_double),
        PositionRule::Average => average_displacement((ids, weights), mean, source.motions),
    };
    let new_rotation = match how.rotation {
        RotationRule::Relative if quat::dot(rotation, rotation) == 0.0 => {
            relative.map(f32::from_double)
        }
        RotationRule::Relative => quat::mul(relative.map(f32::from_double), rotation),
        RotationRule::Additive => {
            add_rotations((ids, weights), rotation, source.source_1, source.source_t)
        }
    };
    (new_mean, new_rotation, blend_scale((ids, weights), log_scale, source.motions, how.scale))
}

/// Rigid motion of a row's sources. Under [`PositionRule::Average`] the rotation is the mean of the
/// sources' relative rotations.
fn rigid_motion(
    (ids, weights): (&[u32], &[f32]),
    motions: &[SourceMotion],
    how: Aggregation,
) -> (RigidFit, [f64; 4]) {
    let (mut from, mut to) = ([0.0; 3], [0.0; 3]);
    for (&id, &weight) in ids.iter().zip(weights) {
        let motion = &motions[id as usize];
        for axis in 0..3 {
            from[axis] += f64::from(weight) * f64::from(motion.from[axis]);
            to[axis] += f64::from(weight) * f64::from(motion.to[axis]);
        }
    }
    let mut fit = RigidFit::about(from, to);
    if how.position == PositionRule::Average && how.rotation == RotationRule::Additive {
        return (fit, [1.0, 0.0, 0.0, 0.0]);
    }
    let own_rotations = how.rotation_prior > 0.0 || how.position == PositionRule::Average;
    for (&id, &weight) in ids.iter().zip(weights) {
        let motion = &motions[id as usize];
        // A wider kernel: rotation varies less in space than translation.
        let wide = f64::from(weight).sqrt();
        if how.position == PositionRule::Rigid {
            fit.add(wide, motion.from.map(f64::from), motion.to.map(f64::from));
        }
        if own_rotations {
            fit.add_rotation(wide, motion.rotation.map(f64::from));
        }
    }
    let prior = if how.position == PositionRule::Rigid { how.rotation_prior } else { 1.0 };
    let relative = fit.rotation(f64::from(prior));
    (fit, relative)
}

/// `q_t q_1⁻¹` of a source splat, unit; the identity if either quaternion is zero.
pub(crate) fn relative_rotation(source_1: &Splats, source_t: &Splats, id: usize) -> [f64; 4] {
    let q1 = quat::normalize(source_1.quats[id].map(f64::from));
    let qt = quat::normalize(source_t.quats[id].map(f64::from));
    let r = quat::mul(qt, quat::conjugate(q1));
    if quat::dot(r, r) > 0.5 { r } else { [1.0, 0.0, 0.0, 0.0] }
}

/// Eq. 9 with given weights.
fn average_displacement(
    (ids, weights): (&[u32], &[f32]),
    mean: [f32; 3],
    motions: &[SourceMotion],
) -> [f32; 3] {
    let mut moved = mean.map(f64::from);
    for (&id, &weight) in ids.iter().zip(weights) {
        let motion = &motions[id as usize];
        for axis in 0..3 {
            let step = f64::from(motion.to[axis]) - f64::from(motion.from[axis]);
            moved[axis] += f64::from(weight) * step;
        }
    }
    moved.map(f32::from_double)
}

/// Rotations of Eq. 24 as printed: unit quaternions, each Δq taken on its source's hemisphere.
fn add_rotations(
    (ids, weights): (&[u32], &[f32]),
    rotation: [f32; 4],
    source_1: &Splats,
    source_t: &Splats,
) -> [f32; 4] {
    let unit = quat::normalize(rotation.map(f64::from));
    let mut sum = unit;
    for (&id, &weight) in ids.iter().zip(weights) {
        let q1 = quat::normalize(source_1.quats[id as usize].map(f64::from));
        let qt = quat::align(quat::normalize(source_t.quats[id as usize].map(f64::from)), q1);
        for i in 0..4 {
            sum[i] += f64::from(weight) * (qt[i] - q1[i]);
        }
    }
    let length = quat::dot(sum, sum).sqrt();
    // If the differences cancel the quaternion, the sum cannot be normalised, and the edit's
    // rotation is kept.
    let sum = if length > 1e-9 { sum.map(|c| c / length) } else { unit };
    sum.map(f32::from_double)
}

/// Writes the normalised weights of a row's sources, multiplied by their presence, to `out`. If all
/// have faded, they keep their relative weights.
pub(crate) fn weights_seen(
    (ids, weights): (&[u32], &[f32]),
    seen: impl Fn(usize) -> f32,
    out: &mut Vec<f32>,
) {
    out.clear();
    out.extend(
        ids.iter()
            .zip(weights)
            .map(|(&id, &weight)| weight * (seen(id as usize) + f32::from_double(FADED))),
    );
    let total: f32 = out.iter().sum();
    for weight in out {
        *weight /= total;
    }
}

fn blend_scale(
    (ids, weights): (&[u32], &[f32]),
    log_scale: [f32; 3],
    motions: &[SourceMotion],
    rule: ScaleRule,
) -> [f32; 3] {
    let ln_ratio = |id: u32, axis: usize| motions[id as usize].ln_scale[axis];
    match rule {
        ScaleRule::PerAxis => [0, 1, 2].map(|axis| {
            let mut mean = 0.0;
            for (&id, &weight) in ids.iter().zip(weights) {
                let ln = f64::from(ln_ratio(id, axis)).clamp(-LN_FINITE_RATIO, LN_FINITE_RATIO);
                mean += f64::from(weight) * ln.exp();
            }
            log_scale[axis] + f32::from_double(mean.ln())
        }),
        ScaleRule::Isotropic => {
            let mut sums = [0.0_f32; 3];
            for (&id, &weight) in ids.iter().zip(weights) {
                for (axis, sum) in sums.iter_mut().enumerate() {
                    let ln = ln_ratio(id, axis).clamp(-LN_MAX_SCALE_RATIO, LN_MAX_SCALE_RATIO);
                    *sum += weight * ln;
                }
            }
            let ln = (sums[0] + sums[1] + sums[2]) / 3.0;
            log_scale.map(|s| s + ln)
        }
    }
}

/// `Σ w (x_t − x_1)` of a stored appearance value; non-finite values are skipped.
pub(crate) fn blend_change(
    (ids, weights): (&[u32], &[f32]),
    value: impl Fn(usize) -> (f32, f32),
) -> f32 {
    ids.iter().zip(weights).fold(0.0, |sum, (&id, &weight)| {
        let (from, to) = value(id as usize);
        let change = to - from;
        if change.is_finite() { sum + weight * change } else { sum }
    })
}
