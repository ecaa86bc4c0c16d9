//! Projection of splats to the image plane: covariance, conic, radius, tile rectangle
//! (`project_grad` is the derivative).

use crate::lanes::Lane;
use crate::vector::{GROUP, Quad, Vector, all_finite, registers};
use crate::view::{TILE, View, dot, each};
use gs_core::image_formation::{EPS2D, EXTENT_SIGMAS, MIN_DISCRIMINANT, MIN_QUAT_NORM};
use gs_core::{Ring, Splats, rotation_matrix};
use pulp::Simd;

/// Rank of a culled splat.
pub(crate) const CULLED: u32 = u32::MAX;

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
    /// Opacity for which the lists were built.
    pub opacity: F,
    /// Natural logarithm of `opacity`.
    pub log_opacity: F,
    /// Index among the caller's splats.
    pub id: u32,
    /// 3σ radius, pixels.
    pub radius: u32,
    /// Tile rectangle `x0, y0, x1, y1`, upper bounds exclusive. Never empty.
    pub rect: [u16; 4],
}

/// Stored geometry and opacity of a group of splats, side by side.
#[derive(Debug, Clone)]
pub(crate) struct Geometry<F> {
    /// Mean and opacity logit.
    pub means: Quad<F>,
    pub quats: Quad<F>,
    /// Log-scales and padding.
    pub log_scales: Quad<F>,
}

impl<F: Lane> Geometry<F> {
    pub(crate) fn zero() -> Self {
        Self { means: Quad::zero(), quats: Quad::zero(), log_scales: Quad::zero() }
    }

    /// Stages splat `id` at `place` of the group.
    #[inline(always)]
    pub(crate) fn put(&mut self, place: usize, splats: &Splats<F>, id: usize) {
        let ([x, y, z], [sx, sy, sz]) = (splats.means[id], splats.log_scales[id]);
        self.means.0[place] = [x, y, z, splats.opacity_logits[id]];
        self.quats.0[place] = splats.quats[id];
        self.log_scales.0[place] = [sx, sy, sz, F::zero()];
    }
}

/// Values shared by forward and backward projection.
#[derive(Clone, Copy)]
pub(crate) struct Projection<S: Simd, F: Lane> {
    pub opacity: Vector<S, F>,
    /// Camera-frame mean.
    pub t: [Vector<S, F>; 3],
    /// The mean's x, y clamped to the guard band.
    pub clamped: [Vector<S, F>; 2],
    /// 0 where the guard band is active, else 1.
    pub free: [Vector<S, F>; 2],
    /// Norm of the raw quaternion, at least 1e-12.
    pub norm: Vector<S, F>,
    /// The normalised quaternion; zero for a zero quaternion, as in the reference.
    pub quat: [Vector<S, F>; 4],
    /// Rotation matrix of `quat`.
    pub rotation: [[Vector<S, F>; 3]; 3],
    /// Standard deviations along the local axes.
    pub scale: [Vector<S, F>; 3],
    /// `R·diag(s)`.
    pub m: [[Vector<S, F>; 3]; 3],
    /// World covariance.
    pub sigma: [[Vector<S, F>; 3]; 3],
    /// Jacobian times rotation of the view, 2×3.
    pub t23: [[Vector<S, F>; 3]; 2],
    /// Projected covariance with low-pass, `a, b, c`.
    pub cov: [Vector<S, F>; 3],
}

impl<S: Simd, F: Lane> Projection<S, F> {
    /// Camera-frame mean, covariances and opacity for registers `k` of a group.
    #[inline(always)]
    pub(crate) fn new(s: S, view: &View<Vector<S, F>>, geometry: &Geometry<F>, k: usize) -> Self {
        let [mx, my, mz, logit] = geometry.means.load(s, k);
        let t = view.to_camera([mx, my, mz]);
        let [qw, qx, qy, qz] = geometry.quats.load(s, k);
        let norm = (qw * qw + qx * qx + qy * qy + qz * qz).sqrt().max(qw.like(MIN_QUAT_NORM));
        let quat = [qw / norm, qx / norm, qy / norm, qz / norm];
        let log_scale = geometry.log_scales.load(s, k);
        let scale = each!(k => log_scale[k].exp());
        let rotation = rotation_matrix(quat);
        let m = each!(i => each!(k => rotation[i][k] * scale[k]));
        let (s01, s02, s12) = (dot(m[0], m[1]), dot(m[0], m[2]), dot(m[1], m[2]));
        let sigma =
            [[dot(m[0], m[0]), s01, s02], [s01, dot(m[1], m[1]), s12], [s02, s12, dot(m[2], m[2])]];

        let z = t[2];
        let (x, x_free) = clamp(t[0], z, view.band[0]);
        let (y, y_free) = clamp(t[1], z, view.band[1]);
        let [fx, fy] = view.focal;
        let zz = z * z;
        let (j00, j02, j11, j12) = (fx / z, -fx * x / zz, fy / z, -fy * y / zz);
        let w = &view.rows;
        let t23 =
            [each!(k => j00 * w[0][k] + j02 * w[2][k]), each!(k => j11 * w[1][k] + j12 * w[2][k])];
        let st = [each!(k => dot(t23[0], sigma[k])), each!(k => dot(t23[1], sigma[k]))];
        let low_pass = z.like(EPS2D);
        let cov =
            [dot(st[0], t23[0]) + low_pass, dot(st[0], t23[1]), dot(st[1], t23[1]) + low_pass];
        Self {
            opacity: logit.sigmoid(),
            t,
            clamped: [x, y],
            free: [x_free, y_free],
            norm,
            quat,
            rotation,
            scale,
            m,
            sigma,
            t23,
            cov,
        }
    }
}

/// `x` clamped to the guard band at depth `z`, and 0 where the clamp is active, else 1.
#[inline(always)]
fn clamp<S: Simd, F: Lane>(
    x: Vector<S, F>,
    z: Vector<S, F>,
    limit: Vector<S, F>,
) -> (Vector<S, F>, Vector<S, F>) {
    let ratio = x / z;
    let below = limit.less(ratio).select(x.like(0.0), x.like(1.0));
    let free = ratio.less(-limit).select(x.like(0.0), below);
    (ratio.max(-limit).min(limit) * z, free)
}

/// A projected group, side by side.
#[derive(Debug, Clone)]
pub(crate) struct ProjectedGroup<F> {
    /// Centre, diagonal of the covariance.
    ellipse: Quad<F>,
    /// Conic, depth.
    conic: Quad<F>,
    /// Opacity; 3σ radius before rounding, −1 for a culled splat (behind the near plane, or not
    /// finite in single precision); padding.
    rest: Quad<F>,
}

impl<F: Lane> ProjectedGroup<F> {
    pub(crate) fn zero() -> Self {
        Self { ellipse: Quad::zero(), conic: Quad::zero(), rest: Quad::zero() }
    }

    /// Projects registers `k` of a group.
    #[inline(always)]
    pub(crate) fn project<S: Simd>(
        &mut self,
        s: S,
        view: &View<Vector<S, F>>,
        geometry: &Geometry<F>,
        k: usize,
    ) {
        let frame = Projection::new(s, view, geometry, k);
        let (t, [a, b, c]) = (frame.t, frame.cov);
        let (zero, one, half) = (a.like(0.0), a.like(1.0), a.like(0.5));
        let det = a * c - b * b;
        let conic = [c / det, -b / det, a / det];
        let mid = half * (a + c);
        // The square is tested because it overflows first in single precision: both float types
        // must cull the same splats.
        let mid2 = mid * mid;
        let lambda = mid + (mid2 - det).max(a.like(MIN_DISCRIMINANT)).sqrt();
        let radius = a.like(EXTENT_SIGMAS) * lambda.sqrt();
        let r = one / (t[2] + view.divide);
        let mut mean = view.centre;
        for axis in 0..2 {
            let numerator = view.focal[axis] * t[axis] + view.offset[axis] * t[2];
            mean[axis] = numerator * r + mean[axis];
        }
        let drawn = view
            .near
            .less(t[2])
            .and(zero.less(det))
            .and(all_finite([t[0], t[1], t[2], a, b, c, det, mid2, radius]))
            .and(all_finite([conic[0], conic[1], conic[2], mean[0], mean[1], frame.opacity]));
        let radius = drawn.select(radius, -one);
        self.ellipse.store(s, k, [mean[0], mean[1], a, c]);
        self.conic.store(s, k, [conic[0], conic[1], conic[2], t[2]]);
        self.rest.store(s, k, [frame.opacity, radius, zero, zero]);
    }

    /// The splat at `place`, whose index is `id`; `None` if it is culled for any reason.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "radius and tile bounds are clamped before they become integers"
    )]
    pub(crate) fn take(&self, place: usize, view: &View<F>, id: usize) -> Option<Projected<F>> {
        let [opacity, radius, ..] = self.rest.0[place];
        if radius < F::zero() {
            return None;
        }
        let radius = radius.ceil();
        let [x, y, a, c] = self.ellipse.0[place];
        let [conic_a, conic_b, conic_c, depth] = self.conic.0[place];
        let mean = [x, y];
        let tile = F::from_double(TILE as f64);
        let bound = |x: F, axis: usize| {
            let limit = F::from_double(view.tiles[axis] as f64);
            (x / tile).max(F::zero()).min(limit).as_f64() as u16
        };
        let lower = |axis: usize| bound(mean[axis] - radius, axis);
        let upper = |axis: usize| bound(mean[axis] + radius + (tile - F::one()), axis);
        let rect = [lower(0), lower(1), upper(0), upper(1)];
        if rect[0] >= rect[2] || rect[1] >= rect[3] {
            return None;
        }
        Some(Projected {
            mean,
            conic: [conic_a, conic_b, conic_c],
            spread: [a, c],
            depth,
            opacity,
            log_opacity: opacity.ln(),
            id: id as u32,
            radius: radius.as_f64().min(f64::from(i32::MAX)) as u32,
            rect,
        })
    }
}

/// Projects the splats from `first` into `rows`; calls `visible` for those that are not culled.
#[inline(always)]
pub(crate) fn project<S: Simd, F: Lane>(
    s: S,
    view: &View<F>,
    splats: &Splats<F>,
    first: usize,
    rows: &mut [Projected<F>],
    mut visible: impl FnMut(usize, F),
) {
    let wide_view = view.splat(s);
    let (mut geometry, mut projected) = (Geometry::zero(), ProjectedGroup::zero());
    for (group, rows) in rows.chunks_mut(GROUP).enumerate() {
        let first = first + group * GROUP;
        for place in 0..rows.len() {
            geometry.put(place, splats, first + place);
        }
        for k in 0..registers::<S, F>() {
            projected.project(s, &wide_view, &geometry, k);
        }
        for (place, row) in rows.iter_mut().enumerate() {
            if let Some(p) = projected.take(place, view, first + place) {
                visible(first + place, p.depth);
                *row = p;
            }
        }
    }
}
