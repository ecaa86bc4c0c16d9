//! [`RenderJob`]: scene, views and times of a render.

use super::views::Views;
use crate::args::Pass;
use crate::console::Console;
use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::overlays::{Layer, LayerSource, overlay_image};
use crate::part::Share;
use crate::passes::PassImage;
use crate::renderer::{self, Renderer};
use crate::scene::LoadedScene;
use crate::{memory, passes};
use gs_core::{Camera, DynamicScene, Image, RenderOutput, Splats};
use std::ops::Range;

/// Memory per pixel of an image, bytes: colour, coverage, depth and state of the rasteriser, two
/// images side by side, and a copy for the encoder.
const BYTES_PER_PIXEL: u64 = 64;

/// Scene, views and times of a render.
pub(crate) struct RenderJob<'a> {
    pub(crate) scene: &'a dyn DynamicScene,
    pub(crate) edit_time: f32,
    pub(crate) mask: passes::Mask,
    /// ξ′ of every splat, or empty.
    pub(crate) evidence: &'a [f32],
    /// Overlays of the passes that show one.
    pub(crate) layers: &'a [(Pass, Layer)],
    pub(crate) original: Option<&'a dyn DynamicScene>,
    pub(crate) times: &'a [f32],
    pub(crate) views: &'a Views,
    /// The images to render; all if `None`.
    pub(crate) share: Option<Share>,
    pub(crate) background: [f32; 3],
    pub(crate) device: &'a Device,
    pub(crate) console: &'a Console,
}

impl RenderJob<'_> {
    /// Calls `sink` for every image, frames in order. Warns about images
    /// in which no splat of the scene is visible.
    pub(crate) fn render(&self, mut sink: impl FnMut(&Exposure<'_>) -> Outcome) -> Outcome {
        let pixels = |camera: &Camera| u64::from(camera.width) * u64::from(camera.height);
        let largest = self.views.cameras().iter().map(pixels).max().unwrap_or(0);
        memory::require(
            &format!("an image of {largest} pixels"),
            largest * BYTES_PER_PIXEL,
            "Use a smaller --size.",
        )?;
        let (mut empty, mut count) = (0, 0);
        self.expose(|exposure| {
            count += 1;
            empty += usize::from(exposure.output.alpha.iter().all(|alpha| *alpha == 0.0));
            sink(exposure)
        })?;
        if empty > 0 {
            let what = if empty == count {
                "no image shows".to_owned()
            } else {
                format!("{empty} of {count} images show none")
            };
            self.console.warn(format!(
                "{what} any of the scene's splats: check that the cameras belong to \
                              it"
            ));
        }
        Ok(())
    }

    /// The image of `pass`; `then` are the splats of the edited frame, for passes relative to it.
    pub(crate) fn image_of(
        &self,
        pass: Pass,
        exposure: &Exposure<'_>,
        then: &Splats,
    ) -> Outcome<PassImage> {
        let Exposure { splats, camera, .. } = exposure;
        if let Some((_, layer)) = self.layers.iter().find(|(of, _)| *of == pass) {
            return overlay_image(self.device, layer, splats, camera, self.background);
        }
        if !pass.is_relative() {
            return Ok(PassImage::Grey(exposure.image(pass)));
        }
        passes::render(pass, self.mask, self.device, splats, (then, self.evidence), camera)
    }

    /// The splats of the edited frame if one of the passes is relative to it, else none.
    pub(crate) fn splats_of_edit(&self, passes: &[Pass]) -> Outcome<Splats> {
        if passes.iter().any(|pass| pass.is_relative()) {
            return self.scene.at(self.edit_time).map_err(Failure::input);
        }
        Ok(Splats::default())
    }

    pub(super) fn expose(&self, mut sink: impl FnMut(&Exposure<'_>) -> Outcome) -> Outcome {
        let mut edited = Renderer::new(self.device, self.background);
        let mut original =
            self.original.map(|scene| (scene, Renderer::new(self.device, self.background)));
        let images = self.images();
        let per_frame = self.views.of_frame(0).len();
        let mut progress = self.console.progress("render", images.len() as u64);
        for (frame, &t) in self.times.iter().enumerate() {
            let number = |view: usize| frame * per_frame + view;
            if number(per_frame) <= images.start || number(0) >= images.end {
                continue;
            }
            edited.seek(self.scene, t)?;
            if let Some((scene, renderer)) = &mut original {
                renderer.seek(*scene, t)?;
            }
            for (view, camera) in self.views.of_frame(frame).iter().enumerate() {
                if !images.contains(&number(view)) {
                    continue;
                }
                let original = match &mut original {
                    Some((_, renderer)) => Some(renderer.render(camera)?),
                    None => None,
                };
                let (output, splats) = edited.render_with_splats(camera)?;
                sink(&Exposure { frame, camera, splats, output, original })?;
                progress.step();
            }
        }
        let elapsed = progress.finish();
        self.console.detail(format!("{} images in {:.1} s", images.len(), elapsed.as_secs_f64()));
        Ok(())
    }

    /// Indices of the images to render: frames in order, all views of a frame together.
    pub(super) fn images(&self) -> Range<usize> {
        let count = self.times.len() * self.views.of_frame(0).len();
        self.share.map_or(0..count, |share| share.range(count))
    }
}

/// The overlays of the passes that show one.
pub(crate) fn layers(
    passes: &[Pass],
    opened: &LoadedScene,
    console: &Console,
) -> Outcome<Vec<(Pass, Layer)>> {
    let mut source = LayerSource::new(opened);
    let overlays = passes.iter().filter_map(|pass| Some((*pass, pass.overlay()?)));
    overlays.map(|(pass, kind)| Ok((pass, source.layer(kind, &[], console)?))).collect()
}

/// One rendered image with its view and time.
pub(crate) struct Exposure<'a> {
    pub(crate) frame: usize,
    pub(crate) camera: &'a Camera,
    pub(super) splats: &'a Splats,
    pub(super) output: &'a RenderOutput,
    original: Option<&'a RenderOutput>,
}

impl Exposure<'_> {
    /// The image of the pass, next to that of the original if there is one.
    pub(crate) fn image(&self, pass: Pass) -> Image {
        let image = pass_image(pass, self.output);
        match self.original {
            Some(original) => renderer::side_by_side(&pass_image(pass, original), &image),
            None => image,
        }
    }
}

fn pass_image(pass: Pass, output: &RenderOutput) -> Image {
    match pass {
        Pass::Alpha => output.alpha_image(),
        Pass::Depth => output.depth_image(),
        _ => output.rgb_image(),
    }
}
