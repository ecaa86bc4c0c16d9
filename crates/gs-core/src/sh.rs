//! Real spherical harmonics up to degree 3 and their
//! derivatives, with the constants and signs of 3DGS.
#![expect(clippy::inline_always, reason = "inlined into vectorised loops of the rasterisers")]

use crate::{Real, Ring};

/// Highest supported degree.
pub const MAX_DEGREE: usize = 3;
/// Degree-0 basis value: `rgb = 0.5 + C0·dc`.
pub const C0: f32 = 0.282_094_8;
/// Magnitude of the degree-1 basis.
pub const C1: f32 = 0.488_602_52;
// Magnitudes of the higher bases, rounded to single precision as in the reference.
const C2: [f32; 3] = [1.092_548_5, 0.315_391_57, 0.546_274_24];
const C3: [f32; 5] = [0.590_043_6, 2.890_611_4, 0.457_045_8, 0.373_176_34, 1.445_305_7];

/// `(degree + 1)²` coefficients per colour channel.
pub const fn num_coeffs(degree: usize) -> usize {
    (degree + 1) * (degree + 1)
}

/// Degree with `coeffs` coefficients per channel, if there is one up to [`MAX_DEGREE`].
pub fn degree_of(coeffs: usize) -> Option<usize> {
    (0..=MAX_DEGREE).find(|&degree| num_coeffs(degree) == coeffs)
}

/// Basis values `Y_k(d)`, `k < 16`, at the unit direction `d` (camera centre to mean, world frame);
/// zero above `degree`.
#[inline(always)]
pub fn basis<V: Ring>(degree: usize, [x, y, z]: [V; 3]) -> [V; 16] {
    let mut out = [x.like(0.0); 16];
    out[0] = x.like(C0);
    if degree >= 1 {
        let c = x.like(C1);
        out[1..4].copy_from_slice(&[-c * y, c * z, -c * x]);
    }
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let (two, three, four) = (x.like(2.0), x.like(3.0), x.like(4.0));
    if degree >= 2 {
        let (a, b, e) = (x.like(C2[0]), x.like(C2[1]), x.like(C2[2]));
        out[4..9].copy_from_slice(&[
            a * x * y,
            -a * y * z,
            b * (two * zz - xx - yy),
            -a * x * z,
            e * (xx - yy),
        ]);
    }
    if degree >= 3 {
        let (k0, k1, k2) = (x.like(C3[0]), x.like(C3[1]), x.like(C3[2]));
        let (k3, k4) = (x.like(C3[3]), x.like(C3[4]));
        out[9..16].copy_from_slice(&[
            -k0 * y * (three * xx - yy),
            k1 * x * y * z,
            -k2 * y * (four * zz - xx - yy),
            k3 * z * (two * zz - three * xx - three * yy),
            -k2 * x * (four * zz - xx - yy),
            k4 * z * (xx - yy),
            -k0 * x * (xx - three * yy),
        ]);
    }
    out
}

/// `∇Y_k(d)`, treating the components of `d` as independent.
#[inline(always)]
pub fn basis_gradient<V: Ring>(degree: usize, [x, y, z]: [V; 3]) -> [[V; 3]; 16] {
    let o = x.like(0.0);
    let mut out = [[o; 3]; 16];
    if degree >= 1 {
        let c = x.like(C1);
        out[1..4].copy_from_slice(&[[o, -c, o], [o, o, c], [-c, o, o]]);
    }
    let (two, three, four) = (x.like(2.0), x.like(3.0), x.like(4.0));
    let (six, eight) = (x.like(6.0), x.like(8.0));
    if degree >= 2 {
        let (a, b, e) = (x.like(C2[0]), x.like(C2[1]), x.like(C2[2]));
        out[4..9].copy_from_slice(&[
            [a * y, a * x, o],
            [o, -a * z, -a * y],
            [-two * b * x, -two * b * y, four * b * z],
            [-a * z, o, -a * x],
            [two * e * x, -two * e * y, o],
        ]);
    }
    if degree >= 3 {
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let (k0, k1, k2) = (x.like(C3[0]), x.like(C3[1]), x.like(C3[2]));
        let (k3, k4) = (x.like(C3[3]), x.like(C3[4]));
        out[9..16].copy_from_slice(&[
            [-k0 * six * x * y, -k0 * (three * xx - three * yy), o],
            [k1 * y * z, k1 * x * z, k1 * x * y],
            [k2 * two * x * y, -k2 * (four * zz - xx - three * yy), -k2 * eight * y * z],
            [-k3 * six * x * z, -k3 * six * y * z, k3 * (six * zz - three * xx - three * yy)],
            [-k2 * (four * zz - three * xx - yy), k2 * two * x * y, -k2 * eight * x * z],
            [k4 * two * x * z, -k4 * two * y * z, k4 * (xx - yy)],
            [-k0 * (three * xx - three * yy), k0 * six * x * y, o],
        ]);
    }
    out
}

/// `0.5 + Σ_k Y_k(d)·sh_k` per channel, **before** the clamp at 0, for `sh` of at least
/// `num_coeffs(degree)` rows.
#[inline(always)]
pub fn color<F: Real>(degree: usize, sh: &[[F; 3]], direction: [F; 3]) -> [F; 3] {
    let y = basis(degree, direction);
    let mut rgb = [F::of(0.5); 3];
    for (coefficient, value) in sh.iter().zip(y).take(num_coeffs(degree)) {
        for channel in 0..3 {
            rgb[channel] += value * coefficient[channel];
        }
    }
    rgb
}

/// DC coefficient of a view-independent colour from 0 to 1 per channel.
pub fn dc_from_rgb<F: Real>(rgb: [F; 3]) -> [F; 3] {
    rgb.map(|channel| (channel - F::of(0.5)) / F::of(C0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Orthonormality over the sphere verifies constants and polynomials
    /// together; the rasteriser goldens verify the signs.
    #[test]
    fn basis_is_orthonormal() {
        let (rings, sectors) = (64_u32, 128_u32);
        let mut gram = [[0.0_f64; 16]; 16];
        for i in 0..rings {
            let theta = std::f64::consts::PI * (f64::from(i) + 0.5) / f64::from(rings);
            for j in 0..sectors {
                let phi = std::f64::consts::TAU * f64::from(j) / f64::from(sectors);
                let d = [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()];
                let area = theta.sin() * std::f64::consts::PI / f64::from(rings)
                    * std::f64::consts::TAU
                    / f64::from(sectors);
                let y = basis(3, d);
                for a in 0..16 {
                    for b in 0..16 {
                        gram[a][b] += y[a] * y[b] * area;
                    }
                }
            }
        }
        for a in 0..16 {
            for b in 0..16 {
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!((gram[a][b] - expected).abs() < 2e-3, "{a},{b}: {}", gram[a][b]);
            }
        }
    }

    #[test]
    fn gradient_is_the_derivative() {
        let d = [0.48_f64, -0.6, 0.64];
        let gradient = basis_gradient(3, d);
        for axis in 0..3 {
            let at = |step: f64| {
                let mut moved = d;
                moved[axis] += step;
                basis(3, moved)
            };
            let (plus, minus) = (at(1e-5), at(-1e-5));
            for k in 0..16 {
                let difference = (plus[k] - minus[k]) / 2e-5;
                assert!((gradient[k][axis] - difference).abs() < 1e-8, "Y{k}, axis {axis}");
            }
        }
    }

    #[test]
    fn dc_round_trip() {
        let rgb = color(0, &[dc_from_rgb([0.2_f64, 0.5, 0.9])], [0.0, 0.0, 1.0]);
        for (ours, theirs) in rgb.iter().zip([0.2, 0.5, 0.9]) {
            assert!((ours - theirs).abs() < 1e-9, "{rgb:?}");
        }
    }
}
