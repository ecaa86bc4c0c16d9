//! Pictures as they are given, and as the fit uses them.

use crate::alignment::Alignment;
use crate::loss::Rect;
use crate::mask::{difference_mask, dilated, remove_specks};
use crate::{FitError, FitOptions};
use gs_core::{Camera, Image, Rasterizer, RenderParams, Splats};

/// Groups of differing pixels smaller than this share of the image are noise.
const SPECK_SHARE: f64 = 3e-5;

/// A picture of the scene, edited or not.
#[derive(Debug, Clone, PartialEq)]
pub struct EditedPicture {
    /// Where it was taken; its size is that of the picture.
    pub camera: Camera,
    /// Colours, 0 to 1, `[H,W,3]`.
    pub image: Image,
    /// Where it was edited, `[H,W]`; `None` for where it differs from the scene.
    pub mask: Option<Vec<bool>>,
}

/// A picture in the fit.
#[derive(Debug, Clone)]
pub(crate) struct View {
    pub camera: Camera,
    pub width: usize,
    pub height: usize,
    /// The picture as given.
    pub picture: Vec<f32>,
    /// Render of the start.
    pub original: Vec<f32>,
    /// Where the picture counts, dilated; empty for pictures that were not edited.
    pub mask: Vec<bool>,
    /// Edited·mask + original·(1 − mask), `[H,W,3]`.
    pub target: Vec<f32>,
    /// Weights of the loss; empty for 1.
    pub weights: Vec<f32>,
    /// Masked pixels and what selected splats reach.
    pub rect: Rect,
    pub alignment: Alignment,
}

impl View {
    pub(crate) fn is_edited(&self) -> bool {
        !self.mask.is_empty()
    }
}

/// Renders the start from every camera and finds what was edited.
pub(crate) fn open<R: Rasterizer>(
    raster: &R,
    start: &Splats,
    pictures: &[EditedPicture],
    options: &FitOptions,
) -> Result<Vec<View>, FitError> {
    let params =
        RenderParams { background: options.background, depth: false, ..RenderParams::default() };
    let mut views = Vec::with_capacity(pictures.len());
    for EditedPicture { camera, image, mask } in pictures {
        camera.check()?;
        let (width, height) = (camera.width as usize, camera.height as usize);
        let refuse = |what, found: String| FitError::Size {
            name: camera.name.clone(),
            what,
            found,
            expected: format!("{width}×{height}"),
        };
        if (image.width, image.height, image.channels) != (width, height, 3) {
            return Err(refuse(
                "picture",
                format!("{}×{} with {} channels", image.width, image.height, image.channels),
            ));
        }
        if let Some(mask) = mask
            && mask.len() != width * height
        {
            return Err(refuse("mask", format!("{} pixels", mask.len())));
        }
        let mut prepared = raster.prepare(start, camera)?;
        let render = raster.forward(&mut prepared, start, &[], &params)?;
        let mask = if let Some(mask) = mask {
            mask.clone()
        } else {
            // The picture has eight bits a channel; so must what it is compared with.
            let mut rounded = render.rgb_image();
            for value in &mut rounded.data {
                *value = (value.clamp(0.0, 1.0) * 255.0).round() / 255.0;
            }
            let mut mask = difference_mask(&rounded, image, options.threshold);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a share of a count"
            )]
            let smallest = (mask.len() as f64 * SPECK_SHARE).ceil() as usize;
            remove_specks(&mut mask, width, smallest);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a share of a count"
            )]
            let radius = (options.dilation * width.max(height) as f32).round() as usize;
            dilated(&mask, width, radius)
        };
        let mask = if mask.contains(&true) { mask } else { Vec::new() };
        let mut view = View {
            camera: camera.clone(),
            width,
            height,
            picture: if mask.is_empty() { Vec::new() } else { image.data.clone() },
            target: render.rgb.clone(),
            original: render.rgb,
            rect: Rect::around(&mask, width),
            mask,
            weights: Vec::new(),
            alignment: Alignment::default(),
        };
        view.retarget();
        views.push(view);
    }
    Ok(views)
}

impl View {
    /// Makes the target from the picture as aligned.
    pub(crate) fn retarget(&mut self) {
        if self.is_edited() {
            let mut target = std::mem::take(&mut self.target);
            self.alignment.apply(self.as_picture(), &self.mask, &self.original, &mut target);
            self.target = target;
        }
    }

    pub(crate) fn as_picture(&self) -> crate::alignment::Picture<'_> {
        crate::alignment::Picture { width: self.width, height: self.height, rgb: &self.picture }
    }
}
