//! Derivative of `project`: from the moments of splats on the image plane to their stored
//! parameters.

use crate::lanes::Lane;
use crate::project::Projection;
use crate::tile_grad::MOMENTS;
use crate::vector::Vector;
use crate::view::{View, dot, each};
use gs_core::{GradientConvention, Ring};
use pulp::Simd;

/// Keeps the inverse of the covariance finite; part of the reference's gradient convention.
const EPS_INVERSE: f32 = 1e-7;

/// Gradients of geometry and opacity, one splat per lane.
#[derive(Clone, Copy)]
pub(crate) struct GeometryGrads<S: Simd, F: Lane> {
    pub mean: [Vector<S, F>; 3],
    pub quat: [Vector<S, F>; 4],
    pub log_scale: [Vector<S, F>; 3],
    pub opacity_logit: Vector<S, F>,
    pub mean2d: [Vector<S, F>; 2],
}

/// Chain rule of the projection, from the moments on the image plane to geometry and opacity; the
/// caller adds colour and depth.
#[inline(always)]
pub(crate) fn project_gradient<S: Simd, F: Lane>(
    view: &View<Vector<S, F>>,
    frame: &Projection<S, F>,
    moments: &[Vector<S, F>; MOMENTS],
    convention: GradientConvention,
) -> GeometryGrads<S, F> {
    let [a, b, c] = frame.cov;
    let (one, two, half) = (a.like(1.0), a.like(2.0), a.like(0.5));
    let det = a * c - b * b;
    let [ka, kb, kc] = [c / det, -b / det, a / det];
    let [s0, sx, sy, sxx, sxy, syy] = *moments;
    let mean2d = [-(ka * sx + kb * sy), -(kb * sx + kc * sy)];

    // D = ∂L/∂(projected covariance) = −κ K Γ K with Γ = −½ (second moments).
    let reference = convention == GradientConvention::Reference;
    let damping = if reference { one / (one + a.like(EPS_INVERSE) / (det * det)) } else { one };
    let factor = half * damping;
    let (g00, g01) = (ka * sxx + kb * sxy, ka * sxy + kb * syy);
    let (g10, g11) = (kb * sxx + kc * sxy, kb * sxy + kc * syy);
    let d00 = factor * (g00 * ka + g01 * kb);
    let d01 = factor * (g00 * kb + g01 * kc);
    let d11 = factor * (g10 * kb + g11 * kc);

    // ∂L/∂T = 2 D T Σ, and of the Jacobian's entries.
    let t23 = &frame.t23;
    let dt = [
        each!(k => d00 * t23[0][k] + d01 * t23[1][k]),
        each!(k => d01 * t23[0][k] + d11 * t23[1][k]),
    ];
    let sigma = &frame.sigma;
    let v_t23 = [each!(k => two * dot(dt[0], sigma[k])), each!(k => two * dot(dt[1], sigma[k]))];
    let w = each!(i => each!(k => view.rows[i][k]));
    let (v_j00, v_j02) = (dot(v_t23[0], w[0]), dot(v_t23[0], w[2]));
    let (v_j11, v_j12) = (dot(v_t23[1], w[1]), dot(v_t23[1], w[2]));

    let [fx, fy] = view.focal;
    let z = frame.t[2];
    let (zz, zzz) = (z * z, z * z * z);
    let free = frame.free;
    // The reference holds the clamped x fixed in the derivative by depth although it is
    // proportional to depth.
    let share = if reference { [two; 2] } else { [one + free[0], one + free[1]] };
    let mut v_t = [
        -free[0] * fx / zz * v_j02,
        -free[1] * fy / zz * v_j12,
        -fx / zz * v_j00 - fy / zz * v_j11
            + share[0] * fx * frame.clamped[0] / zzz * v_j02
            + share[1] * fy * frame.clamped[1] / zzz * v_j12,
    ];
    let r = one / (z + view.divide);
    for axis in 0..2 {
        let numerator = view.focal[axis] * frame.t[axis] + view.offset[axis] * z;
        v_t[axis] = v_t[axis] + mean2d[axis] * view.focal[axis] * r;
        v_t[2] = v_t[2] + mean2d[axis] * (view.offset[axis] * r - numerator * r * r);
    }
    let mean = each!(k => w[0][k] * v_t[0] + w[1][k] * v_t[1] + w[2][k] * v_t[2]);

    // ∂Σ = Tᵀ D T, ∂M = 2 ∂Σ M.
    let v_sigma = each!(i => each!(j => t23[0][i] * dt[0][j] + t23[1][i] * dt[1][j]));
    let v_m = each!(i => each!(k => two * dot(v_sigma[i], column(&frame.m, k))));
    let scale = frame.scale;
    let log_scale = each!(k => scale[k] * dot(column(&frame.rotation, k), column(&v_m, k)));
    let v_rotation = each!(i => each!(k => scale[k] * v_m[i][k]));
    GeometryGrads {
        mean,
        quat: quat_gradient(frame.norm, frame.quat, &v_rotation),
        log_scale,
        opacity_logit: (one - frame.opacity) * s0,
        mean2d,
    }
}

/// Column `k` of a matrix.
#[inline(always)]
fn column<V: Copy>(a: &[[V; 3]; 3], k: usize) -> [V; 3] {
    [a[0][k], a[1][k], a[2][k]]
}

/// Maps the gradient `n` of the rotation matrix to that of the raw
/// quaternion with length `norm` and normalised value `q`.
#[inline(always)]
fn quat_gradient<S: Simd, F: Lane>(
    norm: Vector<S, F>,
    q: [Vector<S, F>; 4],
    n: &[[Vector<S, F>; 3]; 3],
) -> [Vector<S, F>; 4] {
    let (two, four) = (norm.like(2.0), norm.like(4.0));
    let [w, x, y, z] = q;
    let v = [
        two * (x * (n[2][1] - n[1][2]) + y * (n[0][2] - n[2][0]) + z * (n[1][0] - n[0][1])),
        two * (y * (n[0][1] + n[1][0]) + z * (n[0][2] + n[2][0]) + w * (n[2][1] - n[1][2]))
            - four * x * (n[1][1] + n[2][2]),
        two * (x * (n[0][1] + n[1][0]) + z * (n[1][2] + n[2][1]) + w * (n[0][2] - n[2][0]))
            - four * y * (n[0][0] + n[2][2]),
        two * (x * (n[0][2] + n[2][0]) + y * (n[1][2] + n[2][1]) + w * (n[1][0] - n[0][1]))
            - four * z * (n[0][0] + n[1][1]),
    ];
    let along = q[0] * v[0] + q[1] * v[1] + q[2] * v[2] + q[3] * v[3];
    let mut tangent = v;
    for (tangent, q) in tangent.iter_mut().zip(q) {
        *tangent = (*tangent - q * along) / norm;
    }
    tangent
}
