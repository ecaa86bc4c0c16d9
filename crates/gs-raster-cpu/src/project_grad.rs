//! Derivative of `project`: from a splat's moments on the image plane to its stored parameters.

use crate::project::Frame;
use crate::tile_grad::MOMENTS;
use crate::view::{EPS_DIVIDE, View, dot, each};
use gs_core::{GradientConvention, Real, Splats};

/// Keeps the reference's inverse of the covariance finite; part of its gradient convention.
const EPS_INVERSE: f32 = 1e-7;

/// Gradients of one splat's geometry and opacity.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SplatGrads<F> {
    pub mean: [F; 3],
    pub quat: [F; 4],
    pub log_scale: [F; 3],
    pub opacity_logit: F,
    pub mean2d: [F; 2],
}

impl<F: Real> SplatGrads<F> {
    /// Of a splat that draws nothing.
    pub(crate) fn zero() -> Self {
        let zero = F::zero();
        Self {
            mean: [zero; 3],
            quat: [zero; 4],
            log_scale: [zero; 3],
            opacity_logit: zero,
            mean2d: [zero; 2],
        }
    }

    /// Whether every entry is finite in single precision.
    pub(crate) fn is_finite(&self) -> bool {
        let finite = |x: &F| x.as_f32().is_finite();
        self.mean.iter().all(finite)
            && self.quat.iter().all(finite)
            && self.log_scale.iter().all(finite)
            && finite(&self.opacity_logit)
            && self.mean2d.iter().all(finite)
    }
}

/// Chain rule of steps 1 to 9; colour and depth are added by the caller.
#[inline(always)]
pub(crate) fn project_gradient<F: Real>(
    view: &View<F>,
    splats: &Splats<F>,
    id: usize,
    moments: &[F; MOMENTS],
    convention: GradientConvention,
) -> SplatGrads<F> {
    let (two, half) = (F::of(2.0), F::of(0.5));
    let (rotation, scale, opacity) = (splats.rotation(id), splats.scale(id), splats.opacity(id));
    let t = view.to_camera(splats.means[id]);
    let frame = Frame::new(view, t, rotation, scale);
    let [a, b, c] = frame.cov;
    let det = a * c - b * b;
    let [ka, kb, kc] = [c / det, -b / det, a / det];
    let [s0, sx, sy, sxx, sxy, syy] = *moments;
    let mean2d = [-(ka * sx + kb * sy), -(kb * sx + kc * sy)];

    // D = ∂L/∂(projected covariance) = −κ K Γ K with Γ = −½ (second moments).
    let reference = convention == GradientConvention::Reference;
    let damping =
        if reference { F::one() / (F::one() + F::of(EPS_INVERSE) / (det * det)) } else { F::one() };
    let factor = half * damping;
    let (g00, g01) = (ka * sxx + kb * sxy, ka * sxy + kb * syy);
    let (g10, g11) = (kb * sxx + kc * sxy, kb * sxy + kc * syy);
    let d00 = factor * (g00 * ka + g01 * kb);
    let d01 = factor * (g00 * kb + g01 * kc);
    let d11 = factor * (g10 * kb + g11 * kc);

    // ∂L/∂T = 2 D T Σ, and of the Jacobian's entries.
    let t23 = &frame.t23;
    let dt =
        [each(|k| d00 * t23[0][k] + d01 * t23[1][k]), each(|k| d01 * t23[0][k] + d11 * t23[1][k])];
    let row = |r: [F; 3]| each(|k| two * dot(r, frame.sigma[k]));
    let v_t23 = [row(dt[0]), row(dt[1])];
    let w = each(|i| each(|k| view.rows[i][k]));
    let (v_j00, v_j02) = (dot(v_t23[0], w[0]), dot(v_t23[0], w[2]));
    let (v_j11, v_j12) = (dot(v_t23[1], w[1]), dot(v_t23[1], w[2]));

    let [fx, fy] = view.focal;
    let z = frame.t[2];
    let (zz, zzz) = (z * z, z * z * z);
    let through = |axis: usize| if frame.active[axis] { F::zero() } else { F::one() };
    // The reference holds the clamped x fixed in the derivative by depth although it is proportional to depth.
    let share = |axis: usize| if frame.active[axis] && !reference { F::one() } else { two };
    let mut v_t = [
        -through(0) * fx / zz * v_j02,
        -through(1) * fy / zz * v_j12,
        -fx / zz * v_j00 - fy / zz * v_j11
            + share(0) * fx * frame.clamped[0] / zzz * v_j02
            + share(1) * fy * frame.clamped[1] / zzz * v_j12,
    ];
    let r = F::one() / (z + F::of(EPS_DIVIDE));
    for axis in 0..2 {
        let numerator = view.focal[axis] * frame.t[axis] + view.offset[axis] * z;
        v_t[axis] += mean2d[axis] * view.focal[axis] * r;
        v_t[2] += mean2d[axis] * (view.offset[axis] * r - numerator * r * r);
    }
    let mean = each(|k| w[0][k] * v_t[0] + w[1][k] * v_t[1] + w[2][k] * v_t[2]);

    // ∂Σ = Tᵀ D T, ∂M = 2 ∂Σ M.
    let v_sigma = each(|i| each(|j| t23[0][i] * dt[0][j] + t23[1][i] * dt[1][j]));
    let column = |a: &[[F; 3]; 3], k: usize| [a[0][k], a[1][k], a[2][k]];
    let v_m = each(|i| each(|k| two * dot(v_sigma[i], column(&frame.m, k))));
    let log_scale = each(|k| scale[k] * dot(column(&frame.rotation, k), column(&v_m, k)));
    let v_rotation = each(|i| each(|k| scale[k] * v_m[i][k]));
    SplatGrads {
        mean,
        quat: quat_gradient(splats.quats[id], rotation, &v_rotation),
        log_scale,
        opacity_logit: (F::one() - opacity) * s0,
        mean2d,
    }
}

/// From the gradient `n` of the rotation matrix to that of the raw quaternion, whose normalisation is `q`.
#[inline(always)]
fn quat_gradient<F: Real>(raw: [F; 4], q: [F; 4], n: &[[F; 3]; 3]) -> [F; 4] {
    let (two, four) = (F::of(2.0), F::of(4.0));
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
    let norm = gs_core::quat::dot(raw, raw).sqrt().max(F::of(1e-12));
    let along = gs_core::quat::dot(q, v);
    let tangent = |k: usize| (v[k] - q[k] * along) / norm;
    [tangent(0), tangent(1), tangent(2), tangent(3)]
}
