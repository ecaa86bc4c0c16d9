//! [`Truth`]: the ground truth of a scene's images.

use super::photos::Photos;
use crate::device::Device;
use crate::failure::Outcome;
use crate::renderer::Renderer;
use gs_core::{Camera, DynamicScene, Image};

/// Pictures to compare with.
pub(crate) enum Truth<'a> {
    /// Renders of another scene.
    Scene {
        /// The scene.
        scene: &'a dyn DynamicScene,
        /// Its renderer, at the time last asked for.
        renderer: Box<Renderer>,
    },
    /// Photographs.
    Photos(&'a Photos),
}

impl<'a> Truth<'a> {
    /// Renders `scene` over `background`.
    pub(crate) fn scene(
        scene: &'a dyn DynamicScene,
        device: &Device,
        background: [f32; 3],
    ) -> Self {
        Self::Scene { scene, renderer: Box::new(Renderer::new(device, background)) }
    }

    /// Moves on to time `t`.
    pub(crate) fn seek(&mut self, t: f32) -> Outcome {
        match self {
            Self::Scene { scene, renderer } => renderer.seek(*scene, t),
            Self::Photos(_) => Ok(()),
        }
    }

    /// The picture of `camera` at time `t`, to which it was moved on; `None` where there is none.
    pub(crate) fn picture(&mut self, camera: &Camera, t: f32) -> Outcome<Option<Image>> {
        match self {
            Self::Scene { renderer, .. } => Ok(Some(renderer.render(camera)?.rgb_image())),
            Self::Photos(photos) => photos.picture(camera, t),
        }
    }
}
