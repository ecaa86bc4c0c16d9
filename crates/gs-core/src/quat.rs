//! Quaternions `wxyz`, and the only two conversions to and from `glam`, which stores `xyzw`.

use crate::{Real, image_formation::MIN_QUAT_NORM};

/// The identity rotation.
pub const IDENTITY: [f32; 4] = [1.0, 0.0, 0.0, 0.0];

/// `q / max(‖q‖, 1e-12)`: a zero quaternion stays zero, as in the reference.
pub fn normalize<F: Real>(q: [F; 4]) -> [F; 4] {
    let norm = dot(q, q).sqrt().max(F::of(MIN_QUAT_NORM));
    q.map(|component| component / norm)
}

/// Inner product of the four components.
pub fn dot<F: Real>(a: [F; 4], b: [F; 4]) -> F {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

/// Hamilton product `a ⊗ b`: rotates by `b`, then by `a`.
pub fn mul<F: Real>(a: [F; 4], b: [F; 4]) -> [F; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// Conjugate: the inverse of a unit quaternion.
pub fn conjugate<F: Real>(q: [F; 4]) -> [F; 4] {
    [q[0], -q[1], -q[2], -q[3]]
}

/// `q` or `−q` (the same rotation), whichever lies in the hemisphere of `reference`.
pub fn align<F: Real>(q: [F; 4], reference: [F; 4]) -> [F; 4] {
    if dot(q, reference) < F::zero() { q.map(|component| -component) } else { q }
}

/// Rotates vector `v` by the unit quaternion `q`.
pub fn rotate<F: Real>(q: [F; 4], v: [F; 3]) -> [F; 3] {
    let two = F::of(2.0);
    let u = [q[1], q[2], q[3]];
    let t = cross(u, v).map(|component| two * component);
    let second = cross(u, t);
    [v[0] + q[0] * t[0] + second[0], v[1] + q[0] * t[1] + second[1], v[2] + q[0] * t[2] + second[2]]
}

fn cross<F: Real>(a: [F; 3], b: [F; 3]) -> [F; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `wxyz` to `glam`.
pub fn to_glam(q: [f32; 4]) -> glam::Quat {
    glam::Quat::from_xyzw(q[1], q[2], q[3], q[0])
}

/// `glam` to `wxyz`.
pub fn from_glam(q: glam::Quat) -> [f32; 4] {
    [q.w, q.x, q.y, q.z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Quat, Vec3};

    #[test]
    fn agrees_with_glam() {
        let (a, b) = (Quat::from_rotation_x(0.7), Quat::from_rotation_y(-1.1));
        let v = Vec3::new(0.3, -2.0, 1.5);
        let ours = rotate(mul(from_glam(a), from_glam(b)), v.into());
        let theirs: [f32; 3] = (a * b * v).into();
        for axis in 0..3 {
            assert!((ours[axis] - theirs[axis]).abs() < 1e-6, "axis {axis}: {ours:?} {theirs:?}");
        }
        assert_eq!(to_glam(from_glam(a)), a, "round trip");
    }

    #[test]
    fn a_zero_quaternion_remains_zero() {
        assert_eq!(normalize([0.0_f32; 4]), [0.0; 4], "no NaN");
    }
}
