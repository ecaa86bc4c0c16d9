//! [`Shape`]: parametrised surfaces, sampled evenly by area.

use crate::math::{r2, uniform};
use glam::{Mat3, Vec3};
use rand_pcg::Pcg64;
use std::f32::consts::{PI, TAU};

/// A cross-section of a [`Shape::Lathe`]: an ellipse around a point of the axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ring {
    /// Position along the axis.
    pub(crate) y: f32,
    /// Centre, across the axis.
    pub(crate) center: [f32; 2],
    /// Half-widths in x and z.
    pub(crate) radii: [f32; 2],
}

/// A ring centred at `(x, z)`.
pub(crate) const fn ring(y: f32, center: [f32; 2], radii: [f32; 2]) -> Ring {
    Ring { y, center, radii }
}

/// A surface over `(u, v) ∈ [0,1]²`, bind coordinates.
#[derive(Debug, Clone)]
pub(crate) enum Shape {
    /// Rings joined smoothly along y, then `origin + basis · p`. `u` along the axis, `v` around.
    Lathe { rings: Vec<Ring>, basis: Mat3, origin: Vec3 },
    /// `center + basis · (unit sphere)`; `u` from the +y pole to the −y pole.
    Ellipsoid { center: Vec3, basis: Mat3 },
    /// Parallelogram; its normal is `across × up`.
    Quad { corner: Vec3, across: Vec3, up: Vec3 },
    /// Ring in the plane spanned by `axes`, normal `axes[0] × axes[1]`.
    Annulus { center: Vec3, axes: [Vec3; 2], inner: f32 },
    /// Tapering tube around a quadratic Bézier curve.
    Horn { curve: [Vec3; 3], radii: [f32; 2] },
    /// Feathered sheet: `u` from the root to the tip, `v` from the leading to the trailing edge.
    Wing { root: Vec3, side: f32 },
}

/// One sample of a [`Shape`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) uv: [f32; 2],
    pub(crate) point: Vec3,
    /// Unit, outward.
    pub(crate) normal: Vec3,
    /// A point well inside the body, for interior splats; the point itself for sheets.
    pub(crate) core: Vec3,
}

impl Shape {
    pub(crate) fn lathe(rings: &[Ring]) -> Self {
        Self::Lathe { rings: rings.to_vec(), basis: Mat3::IDENTITY, origin: Vec3::ZERO }
    }

    pub(crate) fn ellipsoid(center: Vec3, radii: Vec3) -> Self {
        Self::Ellipsoid { center, basis: Mat3::from_diagonal(radii) }
    }

    /// The six faces of a box with half-extents `half` and axes `basis`.
    pub(crate) fn cuboid(center: Vec3, basis: Mat3, half: Vec3) -> Vec<Self> {
        let axes = [basis.x_axis * half.x, basis.y_axis * half.y, basis.z_axis * half.z];
        let mut faces = Vec::with_capacity(6);
        for k in 0..3 {
            let (n, a, b) = (axes[k], axes[(k + 1) % 3], axes[(k + 2) % 3]);
            faces.push(Self::Quad { corner: center + n - a - b, across: 2.0 * a, up: 2.0 * b });
            faces.push(Self::Quad { corner: center - n - a - b, across: 2.0 * b, up: 2.0 * a });
        }
        faces
    }

    /// The shape without a border of this width, so that discs do not extend beyond sharp edges.
    pub(crate) fn inset(&self, border: f32) -> Self {
        match self.clone() {
            Self::Quad { corner, across, up } => {
                let (cut_a, cut_u) = (
                    across * (border / across.length()).min(0.45),
                    up * (border / up.length()).min(0.45),
                );
                Self::Quad {
                    corner: corner + cut_a + cut_u,
                    across: across - 2.0 * cut_a,
                    up: up - 2.0 * cut_u,
                }
            }
            Self::Annulus { center, axes, inner } => {
                let share = 1.0 - (border / axes[0].length()).min(0.5);
                Self::Annulus { center, axes: axes.map(|axis| axis * share), inner: inner / share }
            }
            other => other,
        }
    }

    fn point(&self, u: f32, v: f32) -> Vec3 {
        match self {
            Self::Lathe { rings, basis, origin } => {
                let at = interpolate(rings, u);
                let (sin, cos) = (TAU * v).sin_cos();
                let p = Vec3::new(
                    at.center[0] + at.radii[0] * sin,
                    at.y,
                    at.center[1] + at.radii[1] * cos,
                );
                *origin + *basis * p
            }
            Self::Ellipsoid { center, basis } => {
                let (sin, cos) = (PI * u).sin_cos();
                let (sv, cv) = (TAU * v).sin_cos();
                *center + *basis * Vec3::new(sin * sv, cos, sin * cv)
            }
            Self::Quad { corner, across, up } => *corner + *across * u + *up * v,
            Self::Annulus { center, axes, inner } => {
                let radius = inner + (1.0 - inner) * u;
                let (sin, cos) = (TAU * v).sin_cos();
                *center + radius * (cos * axes[0] + sin * axes[1])
            }
            Self::Horn { curve, radii } => {
                let (center, tangent) = bezier(curve, u);
                let x = tangent.any_orthonormal_vector();
                let y = tangent.cross(x);
                let (sin, cos) = (TAU * v).sin_cos();
                let radius = (radii[0] + (radii[1] - radii[0]) * u) * (1.0 - u.powi(8)).max(0.0);
                center + radius * (cos * x + sin * y)
            }
            Self::Wing { root, side } => {
                let leading = Vec3::new(0.62 * u, 0.34 * (PI * 0.8 * u).sin(), -0.16 * u * u);
                let scallop = 1.0 - 0.16 * (0.5 + 0.5 * (TAU * 4.0 * u).cos());
                let chord = (0.13 + 0.34 * (PI * (0.25 + 0.75 * u)).sin()) * scallop;
                let trailing = Vec3::new(0.05 * v, -chord * v, 0.07 * (PI * v).sin());
                let p = leading + trailing;
                *root + Vec3::new(side * p.x, p.y, p.z)
            }
        }
    }

    fn core(&self, u: f32, point: Vec3) -> Vec3 {
        match self {
            Self::Lathe { rings, basis, origin } => {
                let at = interpolate(rings, u);
                // away from the ends, where the axis meets the surface
                let middle = f32::midpoint(rings[0].y, rings[rings.len() - 1].y);
                let y = middle + 0.7 * (at.y - middle);
                *origin + *basis * Vec3::new(at.center[0], y, at.center[1])
            }
            Self::Ellipsoid { center, .. } => *center,
            Self::Horn { curve, .. } => bezier(curve, u).0,
            Self::Quad { .. } | Self::Annulus { .. } | Self::Wing { .. } => point,
        }
    }

    /// Whether `∂u × ∂v` points inwards.
    fn flips(&self) -> bool {
        match self {
            Self::Lathe { rings, basis, .. } => {
                (rings[rings.len() - 1].y > rings[0].y) == (basis.determinant() > 0.0)
            }
            Self::Wing { side, .. } => *side > 0.0,
            Self::Horn { .. } => true,
            Self::Ellipsoid { .. } | Self::Quad { .. } | Self::Annulus { .. } => false,
        }
    }

    fn normal(&self, u: f32, v: f32) -> Vec3 {
        const H: f32 = 2e-3;
        // derivatives vanish at the poles
        let (u, v) = (u.clamp(0.01, 0.99), v);
        let along = self.point(u + H, v) - self.point(u - H, v);
        let around = self.point(u, v + H) - self.point(u, v - H);
        let n = along.cross(around).try_normalize().unwrap_or(Vec3::Y);
        if self.flips() { -n } else { n }
    }
}

/// Catmull–Rom through the rings.
fn interpolate(rings: &[Ring], u: f32) -> Ring {
    let last = rings.len() - 1;
    let x = u.clamp(0.0, 1.0) * last as f32;
    let i = crate::math::floor_index(x).min(last.saturating_sub(1));
    let f = x - i as f32;
    let pick = |k: usize| rings[k.min(last)];
    let (p0, p1, p2, p3) = (pick(i.saturating_sub(1)), pick(i), pick(i + 1), pick(i + 2));
    let spline = |a: f32, b: f32, c: f32, d: f32| {
        0.5 * (2.0 * b
            + (c - a) * f
            + (2.0 * a - 5.0 * b + 4.0 * c - d) * f * f
            + (3.0 * b - a - 3.0 * c + d) * f * f * f)
    };
    let pair = |get: fn(&Ring) -> [f32; 2]| {
        [0, 1].map(|k| spline(get(&p0)[k], get(&p1)[k], get(&p2)[k], get(&p3)[k]))
    };
    Ring {
        y: spline(p0.y, p1.y, p2.y, p3.y),
        center: pair(|r| r.center),
        radii: pair(|r| r.radii).map(|radius| radius.max(0.0)),
    }
}

/// Point and unit tangent.
fn bezier(curve: &[Vec3; 3], u: f32) -> (Vec3, Vec3) {
    let [a, b, c] = *curve;
    let w = 1.0 - u;
    let tangent = (b - a) * w + (c - b) * u;
    (a * w * w + b * 2.0 * w * u + c * u * u, tangent.try_normalize().unwrap_or(Vec3::Y))
}

const CELLS: [usize; 2] = [40, 32];

/// A [`Shape`] with its area table: draws samples evenly spread over the surface.
#[derive(Debug, Clone)]
pub(crate) struct Sampler<'a> {
    shape: &'a Shape,
    keep: fn(Vec3) -> bool,
    /// Running area of the rows, and within each row of its cells.
    rows: Vec<f32>,
    cells: Vec<f32>,
}

impl<'a> Sampler<'a> {
    /// `keep` selects the parts of the surface that are sampled.
    pub(crate) fn new(shape: &'a Shape, keep: fn(Vec3) -> bool) -> Self {
        let [nu, nv] = CELLS;
        let corner = |i: usize, j: usize| shape.point(i as f32 / nu as f32, j as f32 / nv as f32);
        let mut grid = Vec::with_capacity((nu + 1) * (nv + 1));
        for i in 0..=nu {
            grid.extend((0..=nv).map(|j| corner(i, j)));
        }
        let (mut rows, mut cells) = (Vec::with_capacity(nu), Vec::with_capacity(nu * nv));
        let mut total = 0.0;
        for i in 0..nu {
            let mut row = 0.0;
            for j in 0..nv {
                let (a, b) = (grid[i * (nv + 1) + j], grid[i * (nv + 1) + j + 1]);
                let (c, d) = (grid[(i + 1) * (nv + 1) + j], grid[(i + 1) * (nv + 1) + j + 1]);
                if keep((a + b + c + d) / 4.0) {
                    row += (d - a).cross(c - b).length() / 2.0;
                }
                cells.push(row);
            }
            total += row;
            rows.push(total);
        }
        Self { shape, keep, rows, cells }
    }

    /// World units².
    pub(crate) fn area(&self) -> f32 {
        self.rows[CELLS[0] - 1]
    }

    /// Draws `count` samples; fewer only if `keep` rejects everything.
    pub(crate) fn draw(&self, count: usize, rng: &mut Pcg64) -> Vec<Sample> {
        let mut samples = Vec::with_capacity(count);
        if self.area() <= 0.0 {
            return samples;
        }
        let shift = [uniform(rng, 0.0, 1.0), uniform(rng, 0.0, 1.0)];
        // samples in partially kept cells may be rejected, hence more attempts than samples
        for k in 0..count.saturating_mul(64) {
            if samples.len() == count {
                break;
            }
            let uv = self.warp(r2(k, shift));
            let point = self.shape.point(uv[0], uv[1]);
            if (self.keep)(point) {
                let normal = self.shape.normal(uv[0], uv[1]);
                let core = self.shape.core(uv[0], point);
                samples.push(Sample { uv, point, normal, core });
            }
        }
        samples
    }

    /// Maps uniform points of the unit square to parameters that are uniform by area.
    fn warp(&self, [a, b]: [f32; 2]) -> [f32; 2] {
        let [nu, nv] = CELLS;
        let (i, fu) = invert(&self.rows, a);
        let (j, fv) = invert(&self.cells[i * nv..(i + 1) * nv], b);
        [(i as f32 + fu) / nu as f32, (j as f32 + fv) / nv as f32]
    }
}

/// Cell of a running sum at fraction `x` of the total, and the fraction inside that cell.
fn invert(running: &[f32], x: f32) -> (usize, f32) {
    let target = x * running[running.len() - 1];
    let cell = running.partition_point(|&sum| sum <= target).min(running.len() - 1);
    let below = if cell == 0 { 0.0 } else { running[cell - 1] };
    let width = (running[cell] - below).max(f32::MIN_POSITIVE);
    (cell, ((target - below) / width).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng;

    fn shapes() -> Vec<Shape> {
        let mut shapes = vec![
            Shape::ellipsoid(Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.3, 0.4, 0.2)),
            Shape::lathe(&[
                ring(0.0, [0.0; 2], [0.0; 2]),
                ring(0.5, [0.0; 2], [0.4, 0.3]),
                ring(1.0, [0.0; 2], [0.0; 2]),
            ]),
            Shape::lathe(&[
                ring(1.0, [0.0; 2], [0.0; 2]),
                ring(0.5, [0.0; 2], [0.4, 0.3]),
                ring(0.0, [0.0; 2], [0.0; 2]),
            ]),
            Shape::Horn {
                curve: [Vec3::ZERO, Vec3::new(0.2, 0.1, 0.0), Vec3::new(0.25, 0.4, 0.0)],
                radii: [0.05, 0.01],
            },
        ];
        shapes.extend(Shape::cuboid(Vec3::ZERO, Mat3::IDENTITY, Vec3::new(0.3, 0.2, 0.1)));
        shapes
    }

    #[test]
    fn normals_point_outwards_and_are_unit() {
        for shape in shapes() {
            let sampler = Sampler::new(&shape, |_| true);
            for sample in sampler.draw(200, &mut rng(0, 0)) {
                assert!((sample.normal.length() - 1.0).abs() < 1e-4, "{shape:?}");
                let inner = match shape {
                    Shape::Quad { .. } => Vec3::ZERO,
                    _ => sample.core,
                };
                assert!(sample.normal.dot(sample.point - inner) > -1e-4, "{shape:?} {sample:?}");
            }
        }
    }

    #[test]
    fn area_of_a_sphere() {
        let sphere = Shape::ellipsoid(Vec3::ZERO, Vec3::splat(0.5));
        let area = Sampler::new(&sphere, |_| true).area();
        assert!((area / PI - 1.0).abs() < 0.01, "{area}");
        let half = Sampler::new(&sphere, |p| p.z > 0.0).draw(1000, &mut rng(0, 0));
        assert!(half.len() == 1000 && half.iter().all(|s| s.point.z > 0.0), "cut");
    }
}
