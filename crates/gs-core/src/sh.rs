//! Real spherical harmonics up to degree 3, 3DGS constants and signs.

use crate::Real;

/// Highest degree with a basis here.
pub const MAX_DEGREE: usize = 3;
/// Degree-0 basis value: `rgb = 0.5 + C0·dc`.
pub const C0: f32 = 0.282_094_79;
/// Magnitude of the degree-1 basis.
pub const C1: f32 = 0.488_602_5;
/// Degree-2 constants, 3DGS order.
pub const C2: [f32; 5] = [1.092_548_4, -1.092_548_4, 0.315_391_57, -1.092_548_4, 0.546_274_2];
/// Degree-3 constants, 3DGS order.
pub const C3: [f32; 7] = [
    -0.590_043_6,
    2.890_611_4,
    -0.457_045_8,
    0.373_176_34,
    -0.457_045_8,
    1.445_305_7,
    -0.590_043_6,
];

/// `(degree + 1)²` coefficients per colour channel.
pub const fn num_coeffs(degree: usize) -> usize {
    (degree + 1) * (degree + 1)
}

/// Degree with `coeffs` coefficients per channel, if there is one up to [`MAX_DEGREE`].
pub fn degree_of(coeffs: usize) -> Option<usize> {
    (0..=MAX_DEGREE).find(|&degree| num_coeffs(degree) == coeffs)
}

/// Basis values `Y_k(d)`, `k < K`, for the unit direction `d` (camera centre to mean, world frame); zero above `degree`.
pub fn basis<F: Real>(degree: usize, d: [F; 3]) -> [F; 16] {
    let mut y = [F::zero(); 16];
    y[0] = F::of(C0);
    if degree == 0 {
        return y;
    }
    let [x, yy, z] = d;
    let c1 = F::of(C1);
    (y[1], y[2], y[3]) = (-c1 * yy, c1 * z, -c1 * x);
    if degree == 1 {
        return y;
    }
    let c2 = C2.map(F::of);
    let (x2, y2, z2) = (x * x, yy * yy, z * z);
    let two = F::of(2.0);
    y[4] = c2[0] * x * yy;
    y[5] = c2[1] * yy * z;
    y[6] = c2[2] * (two * z2 - x2 - y2);
    y[7] = c2[3] * x * z;
    y[8] = c2[4] * (x2 - y2);
    if degree == 2 {
        return y;
    }
    let c3 = C3.map(F::of);
    let (three, four) = (F::of(3.0), F::of(4.0));
    y[9] = c3[0] * yy * (three * x2 - y2);
    y[10] = c3[1] * x * yy * z;
    y[11] = c3[2] * yy * (four * z2 - x2 - y2);
    y[12] = c3[3] * z * (two * z2 - three * x2 - three * y2);
    y[13] = c3[4] * x * (four * z2 - x2 - y2);
    y[14] = c3[5] * z * (x2 - y2);
    y[15] = c3[6] * x * (x2 - three * y2);
    y
}

/// `0.5 + Σ_k Y_k(d)·sh_k` **before** the clamp at 0 (`rasteriser.md` step 10), for `sh` of at least `num_coeffs(degree)` rows.
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

/// DC coefficient of a view-independent colour in [0,1] per channel.
pub fn dc_from_rgb<F: Real>(rgb: [F; 3]) -> [F; 3] {
    rgb.map(|channel| (channel - F::of(0.5)) / F::of(C0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Orthonormality over the sphere pins constants and polynomials at once (signs are pinned by the raster goldens).
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
    fn dc_round_trip() {
        let rgb = color(0, &[dc_from_rgb([0.2_f64, 0.5, 0.9])], [0.0, 0.0, 1.0]);
        for (ours, theirs) in rgb.iter().zip([0.2, 0.5, 0.9]) {
            assert!((ours - theirs).abs() < 1e-9, "{rgb:?}");
        }
    }
}
