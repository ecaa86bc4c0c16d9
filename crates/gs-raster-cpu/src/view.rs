//! [`View`]: all camera values that the per-splat stages read, in the rasteriser's float type.

use crate::lanes::Lane;
use crate::vector::{Vector, splat};
use gs_core::image_formation::{self, EPS_DIVIDE, GUARD_BAND};
use gs_core::{Camera, Real, Ring};
use pulp::Simd;

/// Side of a tile, pixels.
pub(crate) const TILE: usize = image_formation::TILE_SIZE as usize;
/// Pixels per tile.
pub(crate) const TILE_PIXELS: usize = TILE * TILE;

#[derive(Debug, Clone, Default)]
pub(crate) struct View<F> {
    /// Rows of the world-to-camera matrix for points relative to `position`. The last entry is the
    /// remaining translation, which is the rounding error of `position`.
    pub rows: [[F; 4]; 3],
    /// Focal lengths, pixels.
    pub focal: [F; 2],
    /// Principal point relative to the image centre, pixels.
    pub offset: [F; 2],
    /// Centre of the image in pixel coordinates whose integers are pixel centres.
    pub centre: [F; 2],
    /// Guard band: largest |x/z| and |y/z| in the projection's derivative.
    pub band: [F; 2],
    /// Camera centre, world frame.
    pub position: [F; 3],
    /// Near plane: splats at this camera depth or nearer are culled, world units.
    pub near: F,
    /// Added to the depth in the perspective divide, world units.
    pub divide: F,
    pub width: usize,
    pub height: usize,
    /// Tiles across and down.
    pub tiles: [usize; 2],
}

impl<F: Real> View<F> {
    pub(crate) fn new(camera: &Camera) -> Self {
        let cast = F::from_double;
        let k = &camera.intrinsics;
        let (w, h) = (f64::from(camera.width), f64::from(camera.height));
        let band = camera.tan_half_fov().map(|tan| F::of(GUARD_BAND) * cast(tan));
        let (width, height) = (camera.width as usize, camera.height as usize);
        let position = camera.position().map(cast);
        // Subtracting the camera centre first preserves precision in scenes far from the origin.
        let rest = camera.to_camera(position.map(F::as_f64));
        let row = |i: usize| {
            let [x, y, z, _] = camera.viewmat[i];
            [x, y, z, rest[i]].map(cast)
        };
        // Single precision for every float type, so that all cull the same splats.
        #[expect(clippy::cast_possible_truncation, reason = "the near plane fits single precision")]
        let single = |value: f64| F::of(value as f32);
        Self {
            rows: [0, 1, 2].map(row),
            focal: [cast(k.fx), cast(k.fy)],
            offset: [cast(k.cx - w / 2.0), cast(k.cy - h / 2.0)],
            centre: [cast((w - 1.0) / 2.0), cast((h - 1.0) / 2.0)],
            band,
            position,
            near: single(camera.near),
            divide: single(EPS_DIVIDE * camera.near),
            width,
            height,
            tiles: [width.div_ceil(TILE), height.div_ceil(TILE)],
        }
    }
}

impl<F: Lane> View<F> {
    /// The same view in every lane.
    #[inline(always)]
    pub(crate) fn splat<S: Simd>(&self, s: S) -> View<Vector<S, F>> {
        View {
            rows: each!(i => splat(s, self.rows[i])),
            focal: splat(s, self.focal),
            offset: splat(s, self.offset),
            centre: splat(s, self.centre),
            band: splat(s, self.band),
            position: splat(s, self.position),
            near: Vector::splat(s, self.near),
            divide: Vector::splat(s, self.divide),
            width: self.width,
            height: self.height,
            tiles: self.tiles,
        }
    }
}

impl<S: Simd, F: Lane> View<Vector<S, F>> {
    /// World to camera.
    #[inline(always)]
    pub(crate) fn to_camera(&self, mean: [Vector<S, F>; 3]) -> [Vector<S, F>; 3] {
        let d = each!(k => mean[k] - self.position[k]);
        each!(i => {
            let r = &self.rows[i];
            r[0] * d[0] + r[1] * d[1] + r[2] * d[2] + r[3]
        })
    }

    /// Unit vector from the camera centre to `mean`, and the distance.
    #[inline(always)]
    pub(crate) fn direction(&self, mean: [Vector<S, F>; 3]) -> ([Vector<S, F>; 3], Vector<S, F>) {
        let d = each!(k => mean[k] - self.position[k]);
        let length = dot(d, d).sqrt();
        (each!(k => d[k] / length), length)
    }
}

/// `each!(k => f(k))`: `[f(0), f(1), f(2)]`. A macro, because a closure that is not inlined would
/// be compiled for the baseline instruction set.
macro_rules! each {
    ($k:ident => $value:expr) => {
        [
            {
                let $k = 0;
                $value
            },
            {
                let $k = 1;
                $value
            },
            {
                let $k = 2;
                $value
            },
        ]
    };
}
pub(crate) use each;

/// Inner product.
#[inline(always)]
pub(crate) fn dot<V: Ring>(a: [V; 3], b: [V; 3]) -> V {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
