//! [`EditedPicture`], the input, and [`View`], the state of a picture during the fit.

use crate::alignment::Alignment;
use crate::mask::{difference_mask, dilated, remove_specks};
use crate::working::Working;
use crate::{FitError, FitOptions};
use gs_core::{Camera, Image, Rasterizer, RenderParams, Splats, TileSet, nearest_rank};
use rayon::prelude::*;

/// Groups of differing pixels smaller than this share of the image count as noise.
const SPECK_SHARE: f64 = 3e-5;

/// A picture of the scene, edited or not.
#[derive(Debug, Clone, PartialEq)]
pub struct EditedPicture {
    /// The camera of the picture, with the picture's size.
    pub camera: Camera,
    /// Colours, 0 to 1, `[H,W,3]`.
    pub image: Image,
    /// Edited pixels, `[H,W]`; if `None`, those that differ from the scene.
    pub mask: Option<Vec<bool>>,
}

/// The state of a picture in the fit.
#[derive(Debug, Clone)]
pub(crate) struct View {
    pub camera: Camera,
    pub width: usize,
    pub height: usize,
    /// The picture, `[H,W,3]`; empty for pictures that were not edited.
    pub picture: Vec<f32>,
    /// Render of the splats at the start, `[H,W,3]`.
    pub original: Vec<f32>,
    /// Edited pixels, `[H,W]`; empty for pictures that were not edited.
    pub changed: Vec<bool>,
    /// Edited pixels, dilated unless a mask was given, `[H,W]`; empty for pictures that were not
    /// edited. Splats that are mainly visible in them are selected.
    pub mask: Vec<bool>,
    /// Difference between aligned picture and fit, median over edited pixels, 0 to 1; 0 for
    /// pictures that agree.
    pub noise: f32,
    /// The aligned picture at edited pixels, the scene elsewhere, `[H,W,3]`: a displaced picture
    /// would also displace the unedited background around the edit.
    pub target: Vec<f32>,
    /// Weights of the loss, `[H,W]`; empty for 1.
    pub weights: Vec<f32>,
    /// Tiles with the masked pixels and those that selected splats reach.
    pub tiles: TileSet,
    /// Rows of the splats on which the pixels of `tiles` depend; ascending. Includes all selected
    /// rows.
    pub rows: Vec<u32>,
    pub alignment: Alignment,
}

impl View {
    pub(crate) fn is_edited(&self) -> bool {
        !self.mask.is_empty()
    }
}

/// Renders the start from every camera and finds the edited pixels.
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
            tiles: TileSet::around(&mask, width, height),
            rows: Vec::new(),
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

/// Flags of the pixels that differ from the scene, without specks.
fn found(scene: &Image, picture: &Image, threshold: f32) -> Vec<bool> {
    // The picture has eight bits per channel; the render is rounded to the same precision.
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
    /// Updates the target after a change of the alignment.
    pub(crate) fn retarget(&mut self) {
        if self.is_edited() {
            let mut target = std::mem::take(&mut self.target);
            self.alignment.apply(self.as_picture(), &self.changed, &self.original, &mut target);
            self.target = target;
        }
    }

    /// Finds the splats on which the pixels of `tiles` depend.
    pub(crate) fn find_rows<R: Rasterizer>(&mut self, raster: &R, working: &Working) {
        self.rows.clear();
        for (row, &selected) in working.selected.iter().enumerate() {
            let reaches = || {
                let found = raster.footprint(&working.splats, row, &self.camera);
                found.is_some_and(|footprint| self.tiles.overlaps(footprint.pixels))
            };
            if selected || reaches() {
                self.rows.extend(u32::try_from(row));
            }
        }
    }

    /// Overwrites `planes` with `K` values for each pixel of `tiles`, and 0 elsewhere, `[H,W,K]`.
    pub(crate) fn fill_planes<const K: usize>(
        &self,
        tiles: &TileSet,
        planes: &mut Vec<f32>,
        values: impl Fn(usize) -> [f32; K] + Sync,
    ) {
        planes.clear();
        planes.resize(K * self.width * self.height, 0.0);
        planes.par_chunks_mut(K * self.width).enumerate().for_each(|(y, row)| {
            for (x, out) in row.as_chunks_mut::<K>().0.iter_mut().enumerate() {
                if tiles.contains(x, y) {
                    *out = values(y * self.width + x);
                }
            }
        });
    }

    /// Measures the difference between target and `render` (`[H,W,3]`).
    pub(crate) fn measure_noise(&mut self, render: &[f32]) {
        let pixels = self.target.chunks_exact(3).zip(render.chunks_exact(3)).zip(&self.changed);
        let mut differences: Vec<f32> = pixels
            .filter(|(_, on)| **on)
            .map(|((a, b), _)| (0..3).fold(0.0, |most, c| f32::max(most, (a[c] - b[c]).abs())))
            .collect();
        if let Some(median) = nearest_rank(&mut differences, 0.5) {
            self.noise = median;
        }
    }

    pub(crate) fn as_picture(&self) -> crate::alignment::Picture<'_> {
        crate::alignment::Picture { width: self.width, height: self.height, rgb: &self.picture }
    }
}
