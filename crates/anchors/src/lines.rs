//! Uniform random lines through a sphere (Eq. 5).

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::points::MAX_MAGNITUDE;
use crate::rng::uniforms;
use crate::vec3::{Vec3, add, cross, dot, scale, sub};
use crate::{AnchorError, BoundingSphere};

/// An infinite line, world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// A point on the line, world units. For sampled lines the middle of the chord, the point
    /// nearest to the sphere's centre.
    pub point: [f64; 3],
    /// Unit direction.
    pub direction: [f64; 3],
}

impl Line {
    /// Squared distance of point `p` (world units) from the line, world units² (`d_x`² of Eq. 6).
    #[inline]
    pub fn distance_squared(&self, p: &[f64; 3]) -> f64 {
        // |v × d|² keeps its relative accuracy for points near the line; |v|² - (v·d)² does not.
        let c = cross(&sub(p, &self.point), &self.direction);
        dot(&c, &c)
    }
}

/// Lines shared by every cloud that is to be compared; the index of a line is its identity.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines {
    lines: Vec<Line>,
}

/// Two points on the sphere closer than this, in radii, do not define a direction and are drawn
/// again.
const MIN_CHORD: f64 = 1e-9;

impl Lines {
    /// `num_lines` lines, each through two independent points uniform on the sphere (Eq. 5, with
    /// the centre added): isotropic uniform lines, so that a convex body is hit with probability
    /// proportional to its surface area for any orientation.
    ///
    /// Line `i` depends on `(seed, i)` and the sphere only: requesting more lines keeps the earlier
    /// ones. A sphere of radius 0 gives lines through its centre.
    ///
    /// # Panics
    /// If `num_lines` does not fit 32 bits, or the sphere is not finite.
    pub fn sample(sphere: &BoundingSphere, num_lines: usize, seed: u64) -> Self {
        assert!(num_lines < u32::MAX as usize, "{num_lines} lines: ids are 32 bits wide");
        assert!(
            sphere.radius.is_finite() && sphere.center.iter().all(|x| x.is_finite()),
            "the sphere must be finite, found {sphere:?}"
        );
        let line = |i: usize| sample_line(sphere, seed, i as u64);
        Self { lines: (0..num_lines).into_par_iter().with_min_len(4096).map(line).collect() }
    }

    /// The given lines, for example transformed samples or camera rays.
    ///
    /// # Errors
    /// A point that is not finite or beyond ±1e50, a direction whose length differs from 1 by more
    /// than 1e-9, or more lines than 32-bit ids can represent.
    pub fn from_lines(lines: Vec<Line>) -> Result<Self, AnchorError> {
        let limit = u32::MAX as usize - 1;
        if lines.len() > limit {
            return Err(AnchorError::TooMany { what: "lines", found: lines.len(), limit });
        }
        let usable = |line: &Line| {
            let length = dot(&line.direction, &line.direction).sqrt();
            line.point.iter().all(|x| x.abs() <= MAX_MAGNITUDE) && (length - 1.0).abs() <= 1e-9
        };
        match lines.iter().position(|line| !usable(line)) {
            Some(line) => Err(AnchorError::BadLine { line }),
            None => Ok(Self { lines }),
        }
    }

    /// All lines; a line's id is its index.
    pub fn as_slice(&self) -> &[Line] {
        &self.lines
    }

    /// Number of lines.
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// Whether there is no line.
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }
}

fn sample_line(sphere: &BoundingSphere, seed: u64, i: u64) -> Line {
    let mut attempt = 0;
    loop {
        let [u0, phi0, u1, phi1] = uniforms(seed, i, attempt);
        let (a, b) = (on_unit_sphere(u0, phi0), on_unit_sphere(u1, phi1));
        let chord = sub(&b, &a);
        let length = dot(&chord, &chord).sqrt();
        if length > MIN_CHORD {
            return Line {
                point: add(&sphere.center, &scale(&add(&a, &b), 0.5 * sphere.radius)),
                direction: scale(&chord, 1.0 / length),
            };
        }
        attempt += 1;
    }
}

/// Eq. 5 for r = 1, from two uniforms in [0,1).
fn on_unit_sphere(s: f64, t: f64) -> Vec3 {
    let u = 2.0 * s - 1.0;
    let ring = (1.0 - u * u).max(0.0).sqrt();
    let (sin, cos) = (TAU * t).sin_cos();
    [ring * cos, ring * sin, u]
}

/// Hits of one triple in units of L·(δ/r)², measured over surface-like clouds (0.343 to 0.357).
const HIT_CONSTANT: f64 = 0.35;

/// Lines expected to hit a typical triple under a global δ: 0.35 · L · (δ/r)². `delta` and
/// `sphere_radius` have the same unit.
///
/// The law holds for triples of a partition of a surface-like cloud, within 10 %. Below about 3
/// hits, the triples that are hit are a random subset.
pub fn expected_hits(num_lines: usize, delta: f64, sphere_radius: f64) -> f64 {
    HIT_CONSTANT * num_lines as f64 * (delta / sphere_radius).powi(2)
}

/// Lines needed for `mean_hits` expected hits per triple, the inverse of [`expected_hits`].
///
/// Saturates at the largest supported number of lines.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the value is clamped to the range of u32 before the cast; NaN becomes 0"
)]
pub fn lines_for_hits(mean_hits: f64, delta: f64, sphere_radius: f64) -> usize {
    let wanted = mean_hits / HIT_CONSTANT * (sphere_radius / delta).powi(2);
    wanted.ceil().clamp(0.0, f64::from(u32::MAX - 1)) as usize
}
