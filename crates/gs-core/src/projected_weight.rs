//! The weight of a splat in an image if nothing covers it, and the share of it that is visible.

use crate::image_formation::{ALPHA_THRESHOLD, EPS2D};
use crate::{Camera, Real, Splats, rotation_matrix};

/// The axes of splat `row` (columns, one standard deviation long) on the screen, pixels, `[2,3]`:
/// the linearised projection at its centre. Infinite or NaN for centres at camera depth 0.
///
/// # Panics
/// If `row` is out of range.
pub fn projected_axes(splats: &Splats, row: usize, camera: &Camera) -> [[f64; 3]; 2] {
    let rotation = rotation_matrix(splats.rotation(row).map(f64::from));
    let scale = splats.scale(row).map(f64::from);
    let [x, y, z] = camera.to_camera(splats.means[row].map(f64::from));
    let (k, v) = (&camera.intrinsics, &camera.viewmat);
    let along = |focal: f64, slope: f64, view: [f64; 4]| {
        let world = [0, 1, 2].map(|c| focal / z * (view[c] - slope * v[2][c]));
        [0, 1, 2]
            .map(|axis| scale[axis] * (0..3).map(|c| world[c] * rotation[c][axis]).sum::<f64>())
    };
    [along(k.fx, x / z, v[0]), along(k.fy, y / z, v[1])]
}

/// `Σ_p α` of splat `row` over all pixels, with nothing in front of it: the volume of its projected
/// Gaussian above the faintest alpha that is drawn, pixels. The denominator of the visible share
/// `Σ_p α T / Σ_p α` of a splat.
///
/// # Panics
/// If `row` is out of range.
pub fn unoccluded_weight(splats: &Splats, row: usize, camera: &Camera) -> f64 {
    let [u, v] = projected_axes(splats, row, camera);
    let dot = |x: [f64; 3], y: [f64; 3]| x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
    let blur = f64::from(EPS2D);
    let det = (dot(u, u) + blur) * (dot(v, v) + blur) - dot(u, v).powi(2);
    let above = (f64::from(splats.opacity(row)) - f64::from(ALPHA_THRESHOLD)).max(0.0);
    std::f64::consts::TAU * det.max(0.0).sqrt() * above
}

/// Visible share of splat `row`, 0 to 1: its weight `Σ_p α T` in an image, relative to `enough` of
/// its [`unoccluded_weight`]. 1 for splats that are too faint to be drawn, which nothing hides (0 of
/// 0), and for splats without a finite weight.
///
/// # Panics
/// If `row` is out of range.
pub fn visible_share(
    splats: &Splats,
    row: usize,
    weight: f32,
    camera: &Camera,
    enough: f32,
) -> f32 {
    let whole = f64::from(enough) * unoccluded_weight(splats, row, camera);
    // `min` returns the other operand if the ratio is NaN.
    (f64::from(weight) / whole).min(1.0).as_f32()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::activation;

    /// A ball in front of the camera projects to an isotropic Gaussian.
    #[test]
    fn the_weight_of_a_ball_is_the_volume_of_its_gaussian() {
        let camera = Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 0.8, 160, 96);
        let (sigma, depth, opacity) = (0.05_f64, 2.0_f32, 0.6_f64);
        let splats = Splats {
            means: vec![[0.0, 0.0, depth]],
            quats: vec![[0.5, 0.1, -0.7, 0.2]],
            log_scales: vec![[sigma.ln().as_f32(); 3]],
            opacity_logits: vec![activation::logit(opacity).as_f32()],
            sh: vec![[0.0; 3]],
            sh_degree: 0,
        };
        let pixels = sigma * camera.intrinsics.fx / f64::from(depth);
        let variance = pixels * pixels + f64::from(EPS2D);
        let expected = std::f64::consts::TAU * variance * (opacity - f64::from(ALPHA_THRESHOLD));
        let found = unoccluded_weight(&splats, 0, &camera);
        assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
        let share =
            |weight: f64, enough| visible_share(&splats, 0, weight.as_f32(), &camera, enough);
        assert!((share(0.25 * expected, 1.0) - 0.25).abs() < 1e-5, "a quarter");
        assert!((share(0.25 * expected, 0.5) - 0.5).abs() < 1e-5, "half of what is enough");
        assert_eq!(share(2.0 * expected, 1.0), 1.0, "at most 1");
        let invisible = Splats { opacity_logits: vec![-20.0], ..splats };
        assert_eq!(visible_share(&invisible, 0, 0.0, &camera, 1.0), 1.0, "0 of 0");
    }
}
