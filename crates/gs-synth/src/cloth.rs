//! A hanging sheet that stretches and billows: motion without rigid parts.
//!
//! At frame 1 the sheet is the rectangle `|x| ≤ 0.6`, `0.4 ≤ y ≤ 1.6` of the plane z = 0, so
//! frame-1 world coordinates are material coordinates. A point at distance `z` from the sheet keeps
//! that distance along the moving normal.

use crate::{
    math::{narrow, wide, wxyz},
    pose::Moved,
};
use glam::{DMat3, DQuat, DVec3, Quat, Vec3};
use gs_core::quat;
use std::f64::consts::{PI, TAU};

/// Height of the rod from which the sheet hangs, world units.
pub(crate) const TOP: f64 = 1.6;
/// Half the width of the sheet, world units.
pub(crate) const HALF_WIDTH: f64 = 0.6;
/// Height of the lower hem, world units.
pub(crate) const BOTTOM: f64 = 0.4;

/// The sheet at material `(x, y)`: position and its two derivatives.
fn surface(x: f64, y: f64, t: f64) -> (DVec3, DVec3, DVec3) {
    let grow = (PI * t / 2.0).sin().powi(2);
    let (wide, long) = (1.0 + 0.22 * grow, 1.0 + 0.35 * grow);
    let depth = (TOP - y) / (TOP - BOTTOM);
    let amplitude = 0.16 * (PI * t).sin().abs().min(1.0) * depth + 0.06 * grow * depth;
    let d_amplitude = -(0.16 * (PI * t).sin().abs().min(1.0) + 0.06 * grow) / (TOP - BOTTOM);
    let phase = 4.2 * x + 2.6 * y - TAU * t;
    let (sin, cos) = phase.sin_cos();
    (
        DVec3::new(wide * x, TOP + long * (y - TOP), amplitude * sin),
        DVec3::new(wide, 0.0, amplitude * cos * 4.2),
        DVec3::new(0.0, long, d_amplitude * sin + amplitude * cos * 2.6),
    )
}

fn normal(along_x: DVec3, along_y: DVec3) -> DVec3 {
    along_x.cross(along_y).try_normalize().unwrap_or(DVec3::Z)
}

/// Position at time `t` of a frame-1 point.
pub(crate) fn point(x: DVec3, t: f64) -> DVec3 {
    let (on_sheet, along_x, along_y) = surface(x.x, x.y, t);
    on_sheet + x.z * normal(along_x, along_y)
}

/// A frame-1 splat at time `t`. It rotates with the frame (normal, x
/// tangent); each local axis is scaled by its own stretch.
pub(crate) fn splat(mean: [f32; 3], rotation: [f32; 4], log_scales: [f32; 3], t: f64) -> Moved {
    let x = wide(mean);
    let (on_sheet, along_x, along_y) = surface(x.x, x.y, t);
    let n = normal(along_x, along_y);
    let first = along_x.try_normalize().unwrap_or(DVec3::X);
    let turn = DQuat::from_mat3(&DMat3::from_cols(first, n.cross(first), n));
    let jacobian = DMat3::from_cols(along_x, along_y, n);
    let axes: Quat = quat::to_glam(quat::normalize(rotation));
    let mut scales = log_scales;
    for (axis, unit) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
        let stretched = jacobian * (axes * unit).as_dvec3();
        scales[axis] += narrow(stretched.length().ln());
    }
    Moved {
        mean: (on_sheet + x.z * n).as_vec3().into(),
        quat: quat::mul(wxyz(turn), rotation),
        log_scales: scales,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_match_differences() {
        let (x, y, t, h) = (0.3, 0.9, 0.6, 1e-6);
        let (_, along_x, along_y) = surface(x, y, t);
        let numeric_x = (surface(x + h, y, t).0 - surface(x - h, y, t).0) / (2.0 * h);
        let numeric_y = (surface(x, y + h, t).0 - surface(x, y - h, t).0) / (2.0 * h);
        assert!((along_x - numeric_x).length() < 1e-8, "{along_x} {numeric_x}");
        assert!((along_y - numeric_y).length() < 1e-8, "{along_y} {numeric_y}");
    }

    #[test]
    fn frame_1_is_flat() {
        let x = DVec3::new(0.2, 0.7, 0.03);
        assert!((point(x, 0.0) - x).length() < 1e-12, "identity at t = 0");
    }
}
