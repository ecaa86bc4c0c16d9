//! [`Gaussian4dScene`]: Gaussians in space and time, as in 4D
//! Gaussian Splatting (Yang et al. 2024).

use crate::polynomial::{FadeLimits, Polynomial, PolynomialError, PolynomialScene};
use crate::shape;
use gs_core::{DynamicScene, SceneError, Splats, SplatsError, TimeRange, quat};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Gaussians whose marginal is at most this are not drawn, as in the reference's rasteriser.
const MIN_MARGINAL: f32 = 0.05;

/// The stored parameters of Gaussians in space and time, `[N]` each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gaussians4d {
    /// The spatial part: centres, `_rotation` as quaternions, `_scaling`, `_opacity`, and the
    /// colour at the Gaussian's own time.
    pub splats: Splats,
    /// Centres in time, `_t`.
    pub times: Vec<f32>,
    /// Logarithms of the extents in time, `_scaling_t`.
    pub log_scales_t: Vec<f32>,
    /// The right quaternion of the rotation of space and time, `_rotation_r`. Empty
    /// if space and time are not mixed: then nothing moves, and the stored extent
    /// in time is a variance, not a standard deviation.
    pub right_quats: Vec<[f32; 4]>,
    /// Colour that changes with time, `[N, 2, K, 3]`: coefficients of `cos(2πΔ/T)` and
    /// `cos(4πΔ/T)`, where `Δ` is the Gaussian's own time minus the current time and `T` the
    /// scene's duration. Empty if colours are constant.
    pub waves: Vec<[f32; 3]>,
    /// Added to the variance in time before the marginal is computed; 0 for none.
    pub prefilter_var: f64,
}

/// Gaussians in space and time, sliced at any time from 0 to 1.
///
/// Each slice is a spatial Gaussian of constant shape whose centre moves along a line and whose
/// opacity is scaled by its marginal in time; it is not drawn where the marginal is at most 0.05.
/// Colours are returned as SH coefficients; the reference evaluates them in the direction of the
/// stored centre, renderers of these splats in the direction of the moved centre.
#[derive(Debug, Clone, PartialEq)]
pub struct Gaussian4dScene {
    cut: PolynomialScene,
    waves: Vec<[f32; 3]>,
    length: f64,
}

/// The 4×4 rotation of the quaternions `l` and `r` (unit), axes x, y, z, t.
fn rotation(l: [f64; 4], r: [f64; 4]) -> [[f64; 4]; 4] {
    let [a, b, c, d] = l;
    let [p, q, s, u] = r;
    let left = [[a, -b, -c, -d], [b, a, -d, c], [c, d, a, -b], [d, -c, b, a]];
    let right = [[p, q, s, u], [-q, p, -u, s], [-s, u, p, -q], [-u, -s, q, p]];
    let mut out = [[0.0; 4]; 4];
    for i in 0..4 {
        for j in 0..4 {
            // Time is the first axis of the product and the last axis of the result.
            out[3 - i][3 - j] = (0..4).map(|k| left[i][k] * right[k][j]).sum();
        }
    }
    out
}

/// A time slice of a Gaussian in space and time.
struct Cut {
    quat: [f32; 4],
    log_scale: [f32; 3],
    /// World units per unit of time.
    velocity: [f32; 3],
    /// Variance in time.
    variance: f64,
}

fn cut_mixed(l: [f32; 4], r: [f32; 4], log_scale: [f32; 3], log_scale_t: f32) -> Cut {
    let unit = |q: [f32; 4]| quat::normalize(q.map(f64::from));
    let rotation = rotation(unit(l), unit(r));
    let [x, y, z] = log_scale.map(|log| f64::from(log).exp());
    let squares = [x, y, z, f64::from(log_scale_t).exp()].map(|scale| scale * scale);
    let entry = |i: usize, j: usize| -> f64 {
        (0..4).map(|k| rotation[i][k] * squares[k] * rotation[j][k]).sum()
    };
    let variance = entry(3, 3);
    let across = [entry(0, 3), entry(1, 3), entry(2, 3)];
    let mut covariance = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            covariance[i][j] = entry(i, j) - across[i] * across[j] / variance;
        }
    }
    let (quat, log_scale) = shape::principal_axes(covariance, unit(l));
    #[expect(clippy::cast_possible_truncation, reason = "motions are single precision")]
    let velocity = across.map(|covariance| (covariance / variance) as f32);
    Cut { quat, log_scale, velocity, variance }
}

impl Gaussian4dScene {
    /// A scene whose times 0 to 1 are `start` to `end` in the unit of the Gaussians' times.
    ///
    /// # Errors
    /// If the arrays have inconsistent lengths.
    pub fn new(gaussians: Gaussians4d, start: f64, end: f64) -> Result<Self, PolynomialError> {
        let Gaussians4d { mut splats, times, log_scales_t, right_quats, waves, prefilter_var } =
            gaussians;
        splats.check_shapes()?;
        let n = splats.len();
        let shape = |field: &'static str, found: usize, expected: usize| {
            if found == expected {
                return Ok(());
            }
            Err(SplatsError::Shape { field, found, expected, num_splats: n })
        };
        shape("times", times.len(), n)?;
        shape("log_scales_t", log_scales_t.len(), n)?;
        if !right_quats.is_empty() {
            shape("right_quats", right_quats.len(), n)?;
        }
        if !waves.is_empty() {
            shape("waves", waves.len(), 2 * splats.sh.len())?;
        }
        let cuts: Vec<Cut> = (0..n)
            .into_par_iter()
            .map(|i| match right_quats.get(i) {
                Some(&right) => {
                    cut_mixed(splats.quats[i], right, splats.log_scales[i], log_scales_t[i])
                }
                None => Cut {
                    quat: splats.quats[i],
                    log_scale: splats.log_scales[i],
                    velocity: [0.0; 3],
                    variance: f64::from(log_scales_t[i]).exp(),
                },
            })
            .collect();
        let mut motions = Vec::with_capacity(n);
        for (i, cut) in cuts.into_iter().enumerate() {
            splats.quats[i] = cut.quat;
            splats.log_scales[i] = cut.log_scale;
            #[expect(clippy::cast_possible_truncation, reason = "motions are single precision")]
            let width = (2.0 * (cut.variance + prefilter_var.max(0.0))).sqrt() as f32;
            motions.push(Polynomial {
                velocity: [cut.velocity, [0.0; 3], [0.0; 3]],
                omega: [0.0; 4],
                centre: times[i],
                width,
            });
        }
        let cut = PolynomialScene::new(splats, motions)?
            .with_fade_limits(FadeLimits { floor: 0.0, cutoff: MIN_MARGINAL })
            .with_clock(start, end);
        Ok(Self { cut, waves, length: end - start })
    }

    /// The Gaussians at their own times: stored centres, sliced shapes.
    pub fn rest(&self) -> &Splats {
        self.cut.rest()
    }

    /// The motions of the Gaussians, in the unit of their times.
    pub fn motions(&self) -> &[Polynomial] {
        self.cut.motions()
    }

    /// Marginal of a Gaussian at time `t`: the factor of its opacity where it is drawn.
    ///
    /// # Panics
    /// If `row` is out of range.
    pub fn marginal(&self, row: usize, t: f32) -> f64 {
        let motion = &self.cut.motions()[row];
        let dt = self.cut.clock_time(t) - f64::from(motion.centre);
        (-(dt / f64::from(motion.width)).powi(2)).exp()
    }
}

impl DynamicScene for Gaussian4dScene {
    fn num_splats(&self) -> usize {
        self.cut.num_splats()
    }

    fn sh_degree(&self) -> usize {
        self.cut.sh_degree()
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.cut.at_into(t, out)?;
        if self.waves.is_empty() {
            return Ok(());
        }
        let (time, coeffs) = (self.cut.clock_time(t), self.cut.rest().sh_coeffs());
        out.sh.par_chunks_mut(coeffs).zip(self.waves.par_chunks(2 * coeffs)).enumerate().for_each(
            |(row, (sh, waves))| {
                let before = f64::from(self.cut.motions()[row].centre) - time;
                let angle = TAU * before / self.length;
                #[expect(clippy::cast_possible_truncation, reason = "colours are single precision")]
                let factors = [angle.cos() as f32, (2.0 * angle).cos() as f32];
                for (wave, factor) in waves.chunks(coeffs).zip(factors) {
                    for (sum, term) in sh.as_flattened_mut().iter_mut().zip(wave.as_flattened()) {
                        *sum += factor * term;
                    }
                }
            },
        );
        Ok(())
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.cut.geometry_into(t, out)
    }
}
