//! A camera as stored in the file.

use crate::cameras::{CamerasError, Number, pixels};
use gs_core::image_formation::NEAR_PLANE;
use gs_core::{Camera, Intrinsics};
use serde::{Deserialize, Serialize};

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Entry {
    id: Option<serde_json::Value>,
    #[serde(default)]
    img_name: String,
    #[serde(serialize_with = "whole")]
    width: Number,
    #[serde(serialize_with = "whole")]
    height: Number,
    position: [Number; 3],
    rotation: [[Number; 3]; 3],
    fx: Number,
    fy: Number,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cx: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cy: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    near: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    time: Option<f32>,
}

/// Writes a size as an integer: strict readers refuse `960.0`.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn whole<S: serde::Serializer>(size: &Number, serializer: S) -> Result<S::Ok, S::Error> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "written from a u32"
    )]
    serializer.serialize_u32(size.0 as u32)
}

impl Entry {
    pub(super) fn into_camera(self, index: usize) -> Result<Camera, CamerasError> {
        let name = if self.img_name.is_empty() { format!("{index}") } else { self.img_name };
        let r = self.rotation.map(|row| row.map(|value| value.0));
        let p = self.position.map(|value| value.0);
        // The inverse of a camera-to-world pose: rows of the result are columns of `rotation`.
        let row = |k: usize| {
            let axis = [r[0][k], r[1][k], r[2][k]];
            let shift = -(axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2]);
            [axis[0], axis[1], axis[2], shift]
        };
        let camera = Camera {
            viewmat: [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
            intrinsics: Intrinsics {
                fx: self.fx.0,
                fy: self.fy.0,
                cx: self.cx.unwrap_or(self.width.0 / 2.0),
                cy: self.cy.unwrap_or(self.height.0 / 2.0),
            },
            // Invalid sizes become 0, which the check below reports with the camera's name.
            width: pixels(self.width.0),
            height: pixels(self.height.0),
            near: self.near.unwrap_or(NEAR_PLANE),
            time: self.time,
            name,
        };
        camera.check().map_err(|source| CamerasError::Camera { index, source })?;
        Ok(camera)
    }

    pub(super) fn from_camera(index: usize, camera: &Camera) -> Self {
        let v = &camera.viewmat;
        Self {
            id: Some(index.into()),
            img_name: camera.name.clone(),
            width: Number(camera.width.into()),
            height: Number(camera.height.into()),
            position: camera.position().map(Number),
            rotation: std::array::from_fn(|i| std::array::from_fn(|k| Number(v[k][i]))),
            fx: Number(camera.intrinsics.fx),
            fy: Number(camera.intrinsics.fy),
            cx: Some(camera.intrinsics.cx),
            cy: Some(camera.intrinsics.cy),
            // Compared bitwise: an omitted value is read as the default.
            near: (camera.near.to_bits() != NEAR_PLANE.to_bits()).then_some(camera.near),
            time: camera.time,
        }
    }
}
