//! [`Truth`]: the ground truth of a scene's images.

use super::photos::Photos;
use crate::device::Device;
use crate::failure::Outcome;
use crate::renderer::Renderer;
use gs_core::{Camera, DynamicScene, Image};

/// Ground-truth images.
pub(crate) enum Truth<'a> {
    /// Renders of another scene.
    Scene {
        /// The scene.
        scene: &'a dyn DynamicScene,
        /// Renderer, at the time set by [`Truth::seek`].
        renderer: Box<Renderer>,
    },
    /// Photographs.
    Photos(&'a Photos),
}

impl<'a> Truth<'a> {
    /// Ground truth rendered from `scene` over `background`.
    pub(crate) fn scene(
        scene: &'a dyn DynamicScene,
        device: &Device,
        background: [f32; 3],
    ) -> Self {
        Self::Scene { scene, renderer: Box::new(Renderer::new(device, background)) }
    }

    /// Sets the time.
    pub(crate) fn seek(&mut self, t: f32) -> Outcome {
        match self {
            Self::Scene { scene, renderer } => renderer.seek(*scene, t),
            Self::Photos(_) => Ok(()),
        }
    }

    /// The image of `camera` at time `t`, which must be the time last set; `None` if there is no
    /// photograph.
    pub(crate) fn picture(&mut self, camera: &Camera, t: f32) -> Outcome<Option<Image>> {
        match self {
            Self::Scene { renderer, .. } => Ok(Some(renderer.render(camera)?.rgb_image())),
            Self::Photos(photos) => photos.picture(camera, t),
        }
    }
}
