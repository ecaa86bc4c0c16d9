//! Pinhole cameras.

use crate::image_formation::NEAR_PLANE;
use glam::{DMat3, DVec3};
use thiserror::Error;

/// Focal lengths and principal point, pixels; pixel centres at half-integers, so the image centre
/// is `(width/2, height/2)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// Horizontal focal length, pixels.
    pub fx: f64,
    /// Vertical focal length, pixels.
    pub fy: f64,
    /// Principal point column, pixels.
    pub cx: f64,
    /// Principal point row, pixels.
    pub cy: f64,
}

/// A pinhole camera. OpenCV axes: x right, y down, z forward.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// World to camera, row by row, column-vector convention (translation in the last column).
    pub viewmat: [[f64; 4]; 4],
    /// Focal lengths and principal point.
    pub intrinsics: Intrinsics,
    /// Image columns, pixels.
    pub width: u32,
    /// Image rows, pixels.
    pub height: u32,
    /// Near plane: splats whose centres lie at this camera depth or nearer are not drawn, world
    /// units.
    ///
    /// [`NEAR_PLANE`] for cameras a model was trained with; otherwise it follows the scene's size
    /// ([`crate::Extent::near_plane`]).
    pub near: f64,
    /// Scene time of the camera's image, for cameras of a data set;
    /// `None` for cameras used at any time.
    pub time: Option<f32>,
    /// Name of the view (the image name in a data set); used in names of output files.
    pub name: String,
}

/// An invalid camera.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CameraError {
    /// Size, focal length or pose out of range.
    #[error("camera `{name}`: {what}")]
    Invalid {
        /// Name of the view.
        name: String,
        /// Description of the invalid value.
        what: String,
    },
}

/// Largest image side, pixels: bounds the memory that a hostile camera file can request.
const MAX_SIDE: u32 = 16_384;

impl Camera {
    /// Camera at `eye` looking at `target` (world frame and units), with the world direction `up`
    /// towards row 0, vertical field of view `fov_y_rad` in radians, an image of `width` × `height`
    /// square pixels, centred principal point, near plane [`NEAR_PLANE`], no time and no name.
    pub fn look_at(
        eye: [f64; 3],
        target: [f64; 3],
        up: [f64; 3],
        fov_y_rad: f64,
        width: u32,
        height: u32,
    ) -> Self {
        let (eye, target, up) = (DVec3::from(eye), DVec3::from(target), DVec3::from(up));
        let forward = (target - eye).try_normalize().unwrap_or(DVec3::Z);
        let right =
            forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
        let down = forward.cross(right);
        let focal = f64::from(height) / (2.0 * (fov_y_rad / 2.0).tan());
        let row = |axis: DVec3| [axis.x, axis.y, axis.z, -axis.dot(eye)];
        Self {
            viewmat: [row(right), row(down), row(forward), [0.0, 0.0, 0.0, 1.0]],
            intrinsics: Intrinsics {
                fx: focal,
                fy: focal,
                cx: f64::from(width) / 2.0,
                cy: f64::from(height) / 2.0,
            },
            width,
            height,
            near: NEAR_PLANE,
            time: None,
            name: String::new(),
        }
    }

    /// Camera centre, world frame and units: translation of the inverse of `viewmat`. Solved rather than
    /// `−Rᵀt`, because rotations rounded to single precision are not exactly orthonormal.
    pub fn position(&self) -> [f64; 3] {
        let v = &self.viewmat;
        let rotation = DMat3::from_cols_array_2d(&[
            [v[0][0], v[1][0], v[2][0]],
            [v[0][1], v[1][1], v[2][1]],
            [v[0][2], v[1][2], v[2][2]],
        ]);
        let translation = DVec3::new(v[0][3], v[1][3], v[2][3]);
        (rotation.inverse() * -translation).into()
    }

    /// Tangents of half the horizontal and half the vertical field of view, `W/(2fx)` and `H/(2fy)`;
    /// no unit.
    pub fn tan_half_fov(&self) -> [f64; 2] {
        [
            f64::from(self.width) / (2.0 * self.intrinsics.fx),
            f64::from(self.height) / (2.0 * self.intrinsics.fy),
        ]
    }

    /// A world point in the camera frame (x right, y down, z forward), world units.
    pub fn to_camera(&self, point: [f64; 3]) -> [f64; 3] {
        let row = |r: [f64; 4]| r[0] * point[0] + r[1] * point[1] + r[2] * point[2] + r[3];
        [row(self.viewmat[0]), row(self.viewmat[1]), row(self.viewmat[2])]
    }

    /// Column and row of a world point in the image, pixels (pixel centres at half-integers), also
    /// outside the image; `None` if its camera depth is 0 or negative.
    pub fn project(&self, point: [f64; 3]) -> Option<[f64; 2]> {
        let [x, y, z] = self.to_camera(point);
        let k = &self.intrinsics;
        (z > 0.0).then(|| [k.fx * x / z + k.cx, k.fy * y / z + k.cy])
    }

    /// The same view at a different image size in pixels: intrinsics scale with the width and
    /// height.
    #[must_use]
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let (sx, sy) = (
            f64::from(width) / f64::from(self.width.max(1)),
            f64::from(height) / f64::from(self.height.max(1)),
        );
        let k = self.intrinsics;
        Self {
            intrinsics: Intrinsics { fx: k.fx * sx, fy: k.fy * sy, cx: k.cx * sx, cy: k.cy * sy },
            width,
            height,
            ..self.clone()
        }
    }

    /// The same view with a different near plane, world units.
    #[must_use]
    pub fn with_near(self, near: f64) -> Self {
        Self { near, ..self }
    }

    /// Verifies size, focal lengths, principal point, near plane and pose.
    ///
    /// # Errors
    /// [`CameraError::Invalid`] if a value is out of range; the message names it.
    pub fn check(&self) -> Result<(), CameraError> {
        let invalid = |what: String| Err(CameraError::Invalid { name: self.name.clone(), what });
        if self.width == 0 || self.height == 0 || self.width.max(self.height) > MAX_SIDE {
            return invalid(format!(
                "image size {}×{}, expected 1 to {MAX_SIDE} pixels per side",
                self.width, self.height
            ));
        }
        let k = &self.intrinsics;
        if !(k.fx > 0.0 && k.fy > 0.0 && k.fx.is_finite() && k.fy.is_finite()) {
            return invalid(format!(
                "focal lengths {} and {}, expected positive pixels",
                k.fx, k.fy
            ));
        }
        if !(k.cx.is_finite() && k.cy.is_finite()) {
            return invalid(format!(
                "principal point ({}, {}), expected finite pixels",
                k.cx, k.cy
            ));
        }
        if !(self.near > 0.0 && self.near.is_finite()) {
            return invalid(format!("near plane {}, expected a positive depth", self.near));
        }
        let v = &self.viewmat;
        if !v.iter().flatten().all(|entry| entry.is_finite()) {
            return invalid("the pose contains NaN or infinity, expected finite values".to_owned());
        }
        let rows = [v[0], v[1], v[2]].map(|r| DVec3::new(r[0], r[1], r[2]));
        let orthonormal = (0..3).all(|i| {
            (0..3).all(|j| (rows[i].dot(rows[j]) - f64::from(u8::from(i == j))).abs() < 1e-2)
        });
        if !orthonormal {
            return invalid(
                "the 3×3 block of the pose is not a rotation, expected orthonormal rows".to_owned(),
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_at_puts_target_in_the_centre_and_up_upwards() {
        let camera =
            Camera::look_at([0.0, 1.0, -4.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], 0.8, 64, 48);
        let centre = camera.project([0.0, 1.0, 0.0]).unwrap();
        assert!((centre[0] - 32.0).abs() < 1e-9 && (centre[1] - 24.0).abs() < 1e-9, "{centre:?}");
        assert!(camera.project([0.0, 2.0, 0.0]).unwrap()[1] < 24.0, "up is towards row 0");
        assert!(camera.check().is_ok(), "valid");
        let position = camera.position();
        assert!((position[2] + 4.0).abs() < 1e-12, "{position:?}");
        assert!(camera.project([0.0, 1.0, -9.0]).is_none(), "behind");
    }

    #[test]
    fn bad_cameras_are_refused() {
        let good = Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 0.8, 64, 48);
        let mut bad = good.clone();
        bad.intrinsics.fx = f64::NAN;
        assert!(bad.check().is_err(), "NaN focal length");
        let mut bad = good.clone();
        bad.width = 0;
        assert!(bad.check().is_err(), "no columns");
        for near in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(good.clone().with_near(near).check().is_err(), "near plane {near}");
        }
        let mut bad = good;
        bad.viewmat[0] = [2.0, 0.0, 0.0, 0.0];
        assert!(bad.check().is_err(), "scaled pose");
    }
}
