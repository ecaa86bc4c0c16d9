//! Camera paths of the reference's videos.
//!
//! The reference's spiral is mirrored horizontally (one axis of its average
//! pose points the other way); this one is not.

use super::pose::{self, Viewmat};
use super::poses_bounds::Row;
use glam::DVec3;
use gs_core::quantile;

/// Frames of a spiral.
pub(super) const SPIRAL_FRAMES: usize = 300;

/// Camera-to-world matrix, OpenGL's axes, of a camera that looks at the origin of a z-up world:
/// `F·R_θ·R_φ·T_z`.
pub(super) fn on_sphere(azimuth_rad: f64, elevation_rad: f64, radius: f64) -> [[f64; 4]; 3] {
    let (sin_a, cos_a) = azimuth_rad.sin_cos();
    let (sin_e, cos_e) = elevation_rad.sin_cos();
    // R_φ about x, then R_θ with rows (cosθ, 0, −sinθ), (0, 1, 0), (sinθ, 0, cosθ).
    let rotated = [
        [cos_a, -sin_a * sin_e, -sin_a * cos_e],
        [0.0, cos_e, -sin_e],
        [sin_a, cos_a * sin_e, cos_a * cos_e],
    ];
    // F takes y-up to z-up: rows (−1, 0, 0), (0, 0, 1), (0, 1, 0).
    let flipped = [rotated[0].map(|v| -v), rotated[2], rotated[1]];
    flipped.map(|[x, y, z]| [x, y, z, radius * z])
}

/// World-to-camera matrices on two revolutions of a spiral about the average of the poses, focused inside
/// their depth range.
pub(super) fn spiral(rows: &[Row]) -> Vec<Viewmat> {
    let count = rows.len().max(1) as f64;
    let mean = |pick: fn(&Row) -> DVec3| rows.iter().map(pick).sum::<DVec3>() / count;
    let centre = mean(|row| row.centre);
    let unit = |v: DVec3, otherwise: DVec3| v.try_normalize().unwrap_or(otherwise);
    let back = unit(mean(|row| row.back), DVec3::Z);
    let mean_up = unit(mean(|row| row.up), DVec3::Y);
    // This order of operands makes the axis point left, as in the
    // reference; the offsets below are along it.
    let left = unit(back.cross(mean_up), DVec3::X);
    let up = left.cross(back);
    let near = 0.9 * rows.iter().map(|row| row.near.min(row.far)).fold(f64::INFINITY, f64::min);
    let far = 5.0 * rows.iter().map(|row| row.near.max(row.far)).fold(f64::NEG_INFINITY, f64::max);
    let focus = 1.0 / (0.25 / near + 0.75 / far);
    let radii = [0, 1, 2].map(|k| {
        let mut distances: Vec<f64> = rows.iter().map(|row| row.centre[k].abs()).collect();
        quantile(&mut distances, 0.9).unwrap_or(0.0)
    });
    (0..SPIRAL_FRAMES)
        .map(|frame| {
            let angle = 2.0 * std::f64::consts::TAU * frame as f64 / SPIRAL_FRAMES as f64;
            let offset =
                [radii[0] * angle.cos(), -radii[1] * angle.sin(), -radii[2] * (angle / 2.0).sin()];
            let eye = centre + left * offset[0] + up * offset[1] + back * offset[2];
            let backward = unit(eye - (centre - back * focus), back);
            let right = unit(mean_up.cross(backward), -left);
            let upward = backward.cross(right);
            pose::from_axes(right, -upward, -backward, eye)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_of_the_circle_look_at_the_origin_from_above() {
        for azimuth in [0.0, 1.0, 3.0] {
            let viewmat = pose::from_opengl(&on_sphere(azimuth, -30.0_f64.to_radians(), 4.0));
            let at = |p: [f64; 3]| {
                [0, 1, 2].map(|i| {
                    let r: [f64; 4] = viewmat[i];
                    r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3]
                })
            };
            let origin = at([0.0; 3]);
            assert!(origin[0].abs() < 1e-12 && origin[1].abs() < 1e-12, "centred: {origin:?}");
            assert!((origin[2] - 4.0).abs() < 1e-12, "4 ahead: {origin:?}");
            assert!(at([0.0, 0.0, 1.0])[1] < -0.5, "z is up, and up is towards row 0");
        }
    }
}
