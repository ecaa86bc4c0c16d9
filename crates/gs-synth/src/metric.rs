//! [`motion_error`]: errors of predicted motion.

use crate::{SynthError, Truth};
use glam::Vec3;
use gs_core::{DynamicScene, Splats, quantile, quat};

/// Scores of a predicted motion against the truth, over all times and scored splats.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct MotionError {
    /// Mean end-point error, % of the figure size.
    pub epe: f64,
    /// 95th percentile of the end-point errors, % of the figure size.
    pub p95: f64,
    /// Share of splats whose largest error over time exceeds 5 % of the figure size, %.
    pub bad5: f64,
    /// Mean end-point error over the contact zone, % of the figure size; 0 if there is none.
    pub contact: f64,
    /// Mean rotation error, degrees.
    pub rot_deg: f64,
    /// Mean absolute error of the logarithms of the scales, ×100.
    pub lns: f64,
    /// Splats scored.
    pub num_scored: usize,
    /// Of these, in the contact zone.
    pub num_contact: usize,
}

/// Errors of `predicted` (rows as in the truth) at `times`, on the truth's `eval_mask`. The error
/// of a non-finite position is infinite.
///
/// # Errors
/// If the numbers of splats differ or a scene cannot be evaluated at a time.
pub fn motion_error(
    predicted: &dyn DynamicScene,
    truth: &Truth,
    times: &[f32],
) -> Result<MotionError, SynthError> {
    motion_error_of(predicted, truth, times, &truth.eval_mask)
}

/// As [`motion_error`], on the rows of `mask` only (`[M]`), instead of the truth's own mask.
///
/// # Errors
/// As [`motion_error`], and if the length of the mask differs.
pub fn motion_error_of(
    predicted: &dyn DynamicScene,
    truth: &Truth,
    times: &[f32],
    mask: &[bool],
) -> Result<MotionError, SynthError> {
    let expected = truth.num_splats();
    for found in [predicted.num_splats(), mask.len()] {
        if found != expected {
            return Err(SynthError::Count { found, expected });
        }
    }
    let scored: Vec<usize> = (0..expected).filter(|&i| mask[i]).collect();
    let to_percent = 100.0 / f64::from(truth.figure_size());
    let mut errors = Vec::with_capacity(scored.len() * times.len());
    let mut worst = vec![0.0_f64; scored.len()];
    let (mut contact, mut rotation, mut scales) = (0.0, 0.0, 0.0);
    let (mut ours, mut theirs) = (Splats::default(), Splats::default());
    for &t in times {
        predicted.geometry_into(t, &mut ours)?;
        truth.geometry_into(t, &mut theirs)?;
        for (k, &i) in scored.iter().enumerate() {
            let offset = Vec3::from(ours.means[i]) - Vec3::from(theirs.means[i]);
            let error = f64::from(offset.length()) * to_percent;
            let error = if error.is_nan() { f64::INFINITY } else { error };
            errors.push(error);
            worst[k] = worst[k].max(error);
            if truth.contact_mask[i] {
                contact += error;
            }
            rotation += angle_between(ours.quats[i], theirs.quats[i]);
            scales += (0..3)
                .map(|axis| {
                    f64::from((ours.log_scales[i][axis] - theirs.log_scales[i][axis]).abs())
                })
                .sum::<f64>()
                / 3.0;
        }
    }
    let num_contact = scored.iter().filter(|&&i| truth.contact_mask[i]).count();
    let mean = |sum: f64, count: usize| if count == 0 { 0.0 } else { sum / count as f64 };
    let pairs = errors.len();
    let num_bad = worst.iter().filter(|&&error| error > 5.0).count();
    Ok(MotionError {
        epe: mean(errors.iter().sum(), pairs),
        p95: quantile(&mut errors, 0.95).unwrap_or(0.0),
        bad5: 100.0 * mean(num_bad as f64, scored.len()),
        contact: mean(contact, num_contact * times.len()),
        rot_deg: mean(rotation, pairs).to_degrees(),
        lns: 100.0 * mean(scales, pairs),
        num_scored: scored.len(),
        num_contact,
    })
}

/// Angle of the rotation between two quaternions `wxyz` of any length, radians; exact near 0.
pub(crate) fn angle_between(a: [f32; 4], b: [f32; 4]) -> f64 {
    let [a, b] = [a, b].map(|q| quat::normalize(q.map(f64::from)));
    let [w, x, y, z] = quat::mul(a, quat::conjugate(b));
    2.0 * (x * x + y * y + z * z).sqrt().atan2(w.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_ignore_sign_and_length() {
        let turn = quat::from_glam(glam::Quat::from_rotation_x(0.3));
        let angle = angle_between(turn.map(|c| -2.0 * c), quat::IDENTITY);
        assert!((angle - 0.3).abs() < 1e-6, "{angle}");
    }
}
