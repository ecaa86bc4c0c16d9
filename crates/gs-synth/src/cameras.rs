//! Cameras that frame a scene.

use crate::{SynthScene, math::wide};
use glam::DVec3;
use gs_core::Camera;

/// Vertical field of view, radians.
const FOV_Y_RAD: f64 = 0.52;
/// Distance of the cameras, in extents of the framed box.
const DISTANCE: f64 = 2.35;

impl SynthScene {
    /// The front view, then an orbit of twelve: `front`, `orbit_00` … `orbit_11`. Images of
    /// `width × height` pixels.
    pub fn suggested_cameras(&self, width: u32, height: u32) -> Vec<Camera> {
        let mut cameras = vec![self.front_camera(width, height)];
        cameras.extend(self.orbit_cameras(12, width, height));
        cameras
    }

    /// View from the front, slightly to the figure's left and above its middle, which shows its
    /// front and the depth of the arm.
    pub fn front_camera(&self, width: u32, height: u32) -> Camera {
        self.camera(10.0_f64.to_radians(), 0.10, "front".to_owned(), width, height)
    }

    /// `count` views evenly around the scene, beginning in front; names `orbit_00`, `orbit_01`, ….
    pub fn orbit_cameras(&self, count: usize, width: u32, height: u32) -> Vec<Camera> {
        (0..count)
            .map(|i| {
                let angle = std::f64::consts::TAU * i as f64 / count.max(1) as f64;
                self.camera(angle, 0.24, format!("orbit_{i:02}"), width, height)
            })
            .collect()
    }

    fn camera(
        &self,
        angle_rad: f64,
        elevation_rad: f64,
        name: String,
        width: u32,
        height: u32,
    ) -> Camera {
        let size = f64::from(self.view.extent);
        let target = wide(self.view.center);
        let (sin, cos) = angle_rad.sin_cos();
        let (lift, flat) = elevation_rad.sin_cos();
        let eye = target + DVec3::new(sin * flat, lift, cos * flat) * (DISTANCE * size);
        let up = [0.0, 1.0, 0.0];
        let mut camera = Camera::look_at(eye.into(), target.into(), up, FOV_Y_RAD, width, height);
        camera.name = name;
        camera
    }
}
