//! The weight that a splat would have in an image if nothing covered it.

use crate::image_formation::{ALPHA_THRESHOLD, EPS2D};
use crate::{Camera, Splats, rotation_matrix};

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
