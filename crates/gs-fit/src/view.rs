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
    /// Where the picture was edited, `[H,W]`; empty for pictures that were not.
    pub changed: Vec<bool>,
    /// The same, dilated, if it was found and not given: splats that are seen here are selected.
    pub mask: Vec<bool>,
    /// How far the aligned picture is from the fit, median over what was edited, 0 to 1; 0 for
    /// pictures that agree.
    pub noise: f32,
    /// Aligned picture where it was edited, scene elsewhere, `[H,W,3]`. Around an edit, a displaced
    /// picture would put background that nobody edited in the wrong place.
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
        let changed = match mask {
            Some(mask) => mask.clone(),
            None => found(&render.rgb_image(), image, options.threshold),
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a count"
        )]
        let radius = (options.dilation * width.max(height) as f32).round() as usize;
        let is_edited = changed.contains(&true);
        let dilation = if mask.is_some() { 0 } else { radius };
        let (changed, mask) = if is_edited {
            let mask = dilated(&changed, width, dilation);
            (changed, mask)
        } else {
            (Vec::new(), Vec::new())
        };
        let mut view = View {
            camera: camera.clone(),
            width,
            height,
            picture: if is_edited { image.data.clone() } else { Vec::new() },
            target: render.rgb.clone(),
            original: render.rgb,
            rect: Rect::around(&mask, width),
            changed,
            mask,
            noise: 0.0,
            weights: Vec::new(),
            alignment: Alignment::default(),
        };
        view.retarget();
        views.push(view);
    }
    Ok(views)
}

/// Pixels that differ from the scene, without specks.
fn found(scene: &Image, picture: &Image, threshold: f32) -> Vec<bool> {
    // The picture has eight bits a channel; so must what it is compared with.
    let mut rounded = scene.clone();
    for value in &mut rounded.data {
        *value = (value.clamp(0.0, 1.0) * 255.0).round() / 255.0;
    }
    let mut mask = difference_mask(&rounded, picture, threshold);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a count"
    )]
    let smallest = (mask.len() as f64 * SPECK_SHARE).ceil() as usize;
    remove_specks(&mut mask, scene.width, smallest);
    mask
}

impl View {
    /// Makes the target from the picture as aligned.
    pub(crate) fn retarget(&mut self) {
        if self.is_edited() {
            let mut target = std::mem::take(&mut self.target);
            self.alignment.apply(self.as_picture(), &self.changed, &self.original, &mut target);
            self.target = target;
        }
    }

    /// Finds how far the target is from `render` (`[H,W,3]`).
    pub(crate) fn measure_noise(&mut self, render: &[f32]) {
        let pixels = self.target.chunks_exact(3).zip(render.chunks_exact(3)).zip(&self.changed);
        let mut differences: Vec<f32> = pixels
            .filter(|(_, on)| **on)
            .map(|((a, b), _)| (0..3).fold(0.0, |most, c| f32::max(most, (a[c] - b[c]).abs())))
            .collect();
        if !differences.is_empty() {
            let middle = differences.len() / 2;
            self.noise = *differences.select_nth_unstable_by(middle, f32::total_cmp).1;
        }
    }

    pub(crate) fn as_picture(&self) -> crate::alignment::Picture<'_> {
        crate::alignment::Picture { width: self.width, height: self.height, rgb: &self.picture }
    }
}
