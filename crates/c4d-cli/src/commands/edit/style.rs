//! `--style IMAGE`: patterns of a picture, fitted in views around the scene.

use crate::camera_rig::CameraRig;
use crate::console::Console;
use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::scene::LoadedScene;
use gs_core::{Camera, Image, Splats};
use gs_edit::StyleTransfer;
use gs_fit::{StyleFit, StyleOptions, fit_style};
use gs_raster_cpu::CpuRasterizer;
use image::imageops::FilterType;
use image::{ImageBuffer, Rgba};
use std::error::Error;

/// Number of views.
const VIEWS: usize = 24;
/// Size of a view, pixels.
const SIZE: (u32, u32) = (384, 384);

/// Fits styles in views of the scene.
#[derive(Debug)]
pub(super) struct ViewStyle<'a> {
    cameras: Vec<Camera>,
    device: Device,
    console: &'a Console,
}

impl<'a> ViewStyle<'a> {
    pub(super) fn new(
        opened: &LoadedScene,
        up: [f64; 3],
        device: Device,
        console: &'a Console,
    ) -> Outcome<Self> {
        let rig = CameraRig::of_scene(opened.scene.as_ref(), up).map_err(Failure::input)?;
        Ok(Self { cameras: rig.views(VIEWS, SIZE), device, console })
    }
}

impl StyleTransfer for ViewStyle<'_> {
    fn transfer(
        &mut self,
        splats: &Splats,
        selected: &[bool],
        picture: &Image,
    ) -> Result<Splats, Box<dyn Error + Send + Sync>> {
        let picture = scaled(picture)?;
        let options = StyleOptions::default();
        let mut progress = self.console.progress("style", options.steps as u64);
        let mut observe = |done| {
            progress.set(done as u64);
            true
        };
        let fitted = match &self.device {
            Device::Cpu => fit_style(
                &CpuRasterizer::default(),
                splats,
                selected,
                &self.cameras,
                &picture,
                &options,
                &mut observe,
            ),
            #[cfg(feature = "gpu")]
            Device::Gpu(raster) => {
                fit_style(raster, splats, selected, &self.cameras, &picture, &options, &mut observe)
            }
        };
        let StyleFit { splats, distance: [before, after], .. } = fitted?;
        self.console.detail(format!(
            "--style: the patches of the views differ from those of the picture by {before:.3} before and {after:.3} after (colours 0 to 1)"
        ));
        Ok(splats)
    }
}

/// The picture with its longer side as long as that of the views.
fn scaled(picture: &Image) -> Result<Image, Box<dyn Error + Send + Sync>> {
    let side = |pixels: usize| u32::try_from(pixels);
    let (width, height) = (side(picture.width)?, side(picture.height)?);
    let rgba = ImageBuffer::<Rgba<f32>, _>::from_raw(width, height, picture.data.clone())
        .ok_or("the picture is not RGBA")?;
    let scale = f64::from(SIZE.0.max(SIZE.1)) / f64::from(width.max(height).max(1));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most SIZE")]
    let new = |side: u32| (scale * f64::from(side)).round().max(1.0) as u32;
    let (width, height) = (new(width), new(height));
    let small = image::imageops::resize(&rgba, width, height, FilterType::Triangle);
    Ok(Image::from_data(width as usize, height as usize, 4, small.into_raw())?)
}
