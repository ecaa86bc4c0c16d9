//! [`Footprint`]: the part of an image that a splat can affect, found without rendering.

use crate::image_formation::{EPS2D, EXTENT_SIGMAS, GUARD_BAND, MIN_DISCRIMINANT, TILE_SIZE};
use crate::{Camera, Real, Splats};

/// A rectangle of pixels outside which a splat draws nothing, and the splat's depth.
///
/// Conservative: the rectangle may be larger than what is drawn, never smaller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// Columns and rows `x0, y0, x1, y1`, pixels; upper bounds exclusive; never empty, never
    /// outside the image.
    pub pixels: [usize; 4],
    /// Camera depth of the centre, world units.
    pub depth: f64,
}

impl Footprint {
    /// Footprint of splat `row` under the image formation of [`crate::image_formation`]; `None` if
    /// it draws nothing: behind the near plane, outside the image, or not finite.
    ///
    /// The margins cover the rounding of rasterisers that compute in single precision: 5 % of the
    /// near plane and 2 pixels of radius.
    ///
    /// # Panics
    /// If `row` is out of range.
    pub fn of<F: Real>(splats: &Splats<F>, row: usize, camera: &Camera) -> Option<Self> {
        let [x, y, z] = camera.to_camera(splats.means[row].map(Real::as_f64));
        if z.is_nan() || z <= 0.95 * camera.near {
            return None;
        }
        let quat = splats.quats[row].map(Real::as_f64);
        let norm = quat.iter().map(|q| q * q).sum::<f64>();
        if !(norm > 0.0 && norm.is_finite()) {
            return None;
        }
        let k = &camera.intrinsics;
        let band = camera.tan_half_fov().map(|tan| f64::from(GUARD_BAND) * tan);
        let slope = [(x / z).clamp(-band[0], band[0]), (y / z).clamp(-band[1], band[1])];
        let focal = k.fx.max(k.fy) / z;
        let stretch = 1.0 + slope[0] * slope[0] + slope[1] * slope[1];
        let log_scale =
            splats.log_scales[row].iter().fold(f64::NEG_INFINITY, |a, b| a.max(b.as_f64()));
        // The floor of the discriminant adds at most its square root to the larger eigenvalue;
        // rounded up to 0.01 pixels².
        let dilation =
            f64::from(EPS2D) + (100.0 * f64::from(MIN_DISCRIMINANT).sqrt()).ceil() / 100.0;
        let variance = (2.0 * log_scale).exp() * focal * focal * stretch + dilation;
        let radius = f64::from(EXTENT_SIGMAS) * variance.sqrt() + 2.0;
        let (u, v) = (k.fx * x / z + k.cx, k.fy * y / z + k.cy);
        if !(radius.is_finite() && u.is_finite() && v.is_finite()) {
            return None;
        }
        let side = f64::from(TILE_SIZE);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the image"
        )]
        let tile_start = |pixel: f64, limit: u32| {
            ((pixel / side).floor() * side).clamp(0.0, f64::from(limit)) as usize
        };
        let pixels = [
            tile_start(u - radius, camera.width),
            tile_start(v - radius, camera.height),
            tile_start(u + radius + side, camera.width),
            tile_start(v + radius + side, camera.height),
        ];
        (pixels[0] < pixels[2] && pixels[1] < pixels[3]).then_some(Self { pixels, depth: z })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(mean: [f32; 3]) -> Splats {
        Splats {
            means: vec![mean],
            quats: vec![[1.0, 0.0, 0.0, 0.0]],
            log_scales: vec![[-4.0; 3]],
            opacity_logits: vec![2.0],
            sh: vec![[0.0; 3]],
            sh_degree: 0,
        }
    }

    #[test]
    fn a_small_splat_covers_only_the_tiles_around_its_centre() {
        let camera = Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 0.8, 160, 96);
        let found = Footprint::of(&one([0.0, 0.0, 4.0]), 0, &camera).unwrap();
        assert!((found.depth - 4.0).abs() < 1e-9, "{found:?}");
        // The centre (80, 48) is a corner of four tiles.
        assert_eq!(found.pixels, [64, 32, 96, 64], "those four tiles");
    }

    #[test]
    fn invisible_splats_have_no_footprint() {
        let camera = Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 0.8, 160, 96);
        let none = |splats: Splats| Footprint::of(&splats, 0, &camera).is_none();
        assert!(none(one([0.0, 0.0, 0.1])), "in front of the near plane");
        assert!(none(one([0.0, 0.0, -4.0])), "behind the camera");
        assert!(none(one([90.0, 0.0, 4.0])), "outside the image");
        assert!(none(one([f32::NAN, 0.0, 4.0])), "not a number");
        let mut zero = one([0.0, 0.0, 4.0]);
        zero.quats[0] = [0.0; 4];
        assert!(none(zero), "no rotation");
    }
}
