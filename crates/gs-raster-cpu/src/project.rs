//! One splat to the image plane: covariance, conic, radius, tile rectangle (forward; `project_grad` is its derivative).

use crate::view::{EPS_2D, EPS_DIVIDE, NEAR, TILE, View, dot, each};
use gs_core::{Real, Splats, rotation_matrix};

/// A visible splat on the image plane.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Projected<F> {
    /// Centre, pixels; integers are pixel centres.
    pub mean: [F; 2],
    /// Inverse covariance `A, B, C`, pixels⁻².
    pub conic: [F; 3],
    /// Diagonal of the covariance, pixels².
    pub spread: [F; 2],
    /// Camera depth.
    pub depth: F,
    /// Opacity when the lists were made.
    pub opacity: F,
    /// Its natural logarithm.
    pub log_opacity: F,
    /// Index among the caller's splats.
    pub id: u32,
    /// 3σ radius, pixels.
    pub radius: u32,
    /// Tile rectangle `x0, y0, x1, y1`, upper bounds exclusive. Never empty.
    pub rect: [u16; 4],
}

/// What forward and backward projection share.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame<F> {
    /// Camera-frame mean.
    pub t: [F; 3],
    /// The mean's x, y clamped to the guard band.
    pub clamped: [F; 2],
    /// Whether the guard band is active.
    pub active: [bool; 2],
    /// Rotation matrix of the normalised quaternion.
    pub rotation: [[F; 3]; 3],
    /// `R·diag(s)`.
    pub m: [[F; 3]; 3],
    /// World covariance.
    pub sigma: [[F; 3]; 3],
    /// Jacobian times rotation of the view, 2×3.
    pub t23: [[F; 3]; 2],
    /// Projected covariance with low-pass, `a, b, c`.
    pub cov: [F; 3],
}

impl<F: Real> Frame<F> {
    /// Steps 3 to 6 for the camera-frame mean `t`, unit quaternion and activated scale.
    #[inline(always)]
    pub(crate) fn new(view: &View<F>, t: [F; 3], rotation: [F; 4], scale: [F; 3]) -> Self {
        let rotation = rotation_matrix(rotation);
        let m = each(|i| each(|k| rotation[i][k] * scale[k]));
        let (s01, s02, s12) = (dot(m[0], m[1]), dot(m[0], m[2]), dot(m[1], m[2]));
        let sigma =
            [[dot(m[0], m[0]), s01, s02], [s01, dot(m[1], m[1]), s12], [s02, s12, dot(m[2], m[2])]];

        let z = t[2];
        let clamp = |x: F, limit: F| {
            let ratio = x / z;
            let bounded = ratio.max(-limit).min(limit);
            (bounded * z, ratio < -limit || ratio > limit)
        };
        let (x, x_active) = clamp(t[0], view.band[0]);
        let (y, y_active) = clamp(t[1], view.band[1]);
        let [fx, fy] = view.focal;
        let zz = z * z;
        let (j00, j02, j11, j12) = (fx / z, -fx * x / zz, fy / z, -fy * y / zz);
        let w = &view.rows;
        let t23 =
            [each(|k| j00 * w[0][k] + j02 * w[2][k]), each(|k| j11 * w[1][k] + j12 * w[2][k])];
        let st = [each(|k| dot(t23[0], sigma[k])), each(|k| dot(t23[1], sigma[k]))];
        let low_pass = F::of(EPS_2D);
        let cov =
            [dot(st[0], t23[0]) + low_pass, dot(st[0], t23[1]), dot(st[1], t23[1]) + low_pass];
        Self { t, clamped: [x, y], active: [x_active, y_active], rotation, m, sigma, t23, cov }
    }
}

/// Projects splat `id`; `None` when it is culled, for whatever reason: behind, off-screen, or not finite in single precision.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "radius and tile bounds are clamped before they become integers"
)]
pub(crate) fn project<F: Real>(
    view: &View<F>,
    splats: &Splats<F>,
    id: usize,
) -> Option<Projected<F>> {
    let finite = |x: F| x.as_f32().is_finite();
    let t = view.to_camera(splats.means[id]);
    let near = t[2] > F::of(NEAR);
    if !(near && t.iter().all(|&x| finite(x))) {
        return None;
    }
    let frame = Frame::new(view, t, splats.rotation(id), splats.scale(id));
    let [a, b, c] = frame.cov;
    let det = a * c - b * b;
    if !(finite(a) && finite(b) && finite(c) && finite(det) && det > F::zero()) {
        return None;
    }
    let conic = [c / det, -b / det, a / det];
    let half = F::of(0.5);
    let mid = half * (a + c);
    // The square is tested because it overflows first in single precision: both float types must cull the same splats.
    let mid2 = mid * mid;
    let lambda = mid + (mid2 - det).max(F::of(0.1)).sqrt();
    let radius = (F::of(3.0) * lambda.sqrt()).ceil();
    let r = F::one() / (t[2] + F::of(EPS_DIVIDE));
    let pixel = |axis: usize| {
        (view.focal[axis] * t[axis] + view.offset[axis] * t[2]) * r + view.centre[axis]
    };
    let mean = [pixel(0), pixel(1)];
    let opacity = splats.opacity(id);
    let all = [conic[0], conic[1], conic[2], mid2, radius, mean[0], mean[1], opacity];
    if !all.iter().all(|&x| finite(x)) {
        return None;
    }

    let tile = F::from_double(TILE as f64);
    let lower = |x: F, axis: usize| {
        let limit = F::from_double(view.tiles[axis] as f64);
        ((x - radius) / tile).trunc().max(F::zero()).min(limit).as_f64() as u16
    };
    let upper = |x: F, axis: usize| {
        let limit = F::from_double(view.tiles[axis] as f64);
        ((x + radius + (tile - F::one())) / tile).trunc().max(F::zero()).min(limit).as_f64() as u16
    };
    let rect = [lower(mean[0], 0), lower(mean[1], 1), upper(mean[0], 0), upper(mean[1], 1)];
    if rect[0] >= rect[2] || rect[1] >= rect[3] {
        return None;
    }
    Some(Projected {
        mean,
        conic,
        spread: [a, c],
        depth: t[2],
        opacity,
        log_opacity: opacity.ln(),
        id: id as u32,
        radius: radius.as_f64().min(f64::from(i32::MAX)) as u32,
        rect,
    })
}
