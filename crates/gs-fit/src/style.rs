//! [`fit_style`]: colours with which renders have the patterns of a picture.

use crate::adam::Adam;
use crate::error::FitError;
use crate::gamut::Gamut;
use crate::patch_statistics::{MaskedImage, PatchStatistics};
use c4d_metrics::{add_halved_adjoint, halved};
use gs_core::{
    Camera, Image, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats, SplitMix64,
    UpstreamGrads, sh,
};

/// Side of a patch, pixels.
const SIDE: usize = 7;
/// Number of image sizes at which patches are compared, each half of the one before. In views of
/// 384 pixels, the largest patches span a seventh of the view.
const LEVELS: usize = 4;
/// Pixels, of the level, that the second largest standard deviation of a splat may have: broader
/// splats cannot show what is in a patch.
const BROADEST: f32 = 3.0;
/// Level at which the render keeps its colours: forms larger than 8 pixels stay recognisable.
const CONTENT_LEVEL: usize = 3;
/// Weight of the kept colours relative to the distance of the patches.
const CONTENT_WEIGHT: f32 = 1.0;
/// Learning rate of base colours at the start, per step; falls linearly to a tenth.
const RATE: f32 = 0.02;
/// Share of the selection in a pixel, and coverage of the picture, above which a pixel is used.
const COVERED: f32 = 0.5;

/// Options of [`fit_style`].
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct StyleOptions {
    /// Number of steps, one view each. Default 300.
    pub steps: usize,
    /// Random seed of the order of views, of patches and of directions. Default 0.
    pub seed: u64,
}

impl Default for StyleOptions {
    fn default() -> Self {
        Self { steps: 300, seed: 0 }
    }
}

/// Result of [`fit_style`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct StyleFit {
    /// The splats with new base colours.
    pub splats: Splats,
    /// Root of the mean squared distance between the patches of the views and those of the
    /// picture, per value of a patch, colours 0 to 1: before and after.
    pub distance: [f64; 2],
}

/// Changes the base colours of the `selected` splats (`[N]`) so that patches of 7×7 pixels, in
/// renders from `cameras` at four image sizes, have the distribution of those of `style`.
///
/// `style` has three channels, or four with coverage, 0 to 1. Scale it to the size of the views if
/// its patterns are to be as large in a view as in the picture. Geometry, opacities, bands of degree
/// 1 and above, and other splats are unchanged. Distributions are compared by the sliced
/// Wasserstein distance, where splats are small enough to show patches; another term keeps the
/// colours of the start at an eighth of the resolution, and colours stay in the range of those of
/// the picture. Match the colours of the start to those of the picture first.
///
/// `observe` is called after each step with the number of steps done, and returns `false` to
/// cancel. On a deterministic rasteriser, equal inputs and seeds give equal bits for any number of
/// threads.
///
/// # Errors
/// If there is no camera, the picture or the visible selection has too few patches, the rasteriser
/// fails, or the observer cancels.
///
/// # Panics
/// If `selected` does not have one flag per splat.
pub fn fit_style<R: Rasterizer>(
    raster: &R,
    splats: &Splats,
    selected: &[bool],
    cameras: &[Camera],
    style: &Image,
    options: &StyleOptions,
    observe: &mut dyn FnMut(usize) -> bool,
) -> Result<StyleFit, FitError> {
    assert_eq!(selected.len(), splats.len(), "one flag per splat");
    splats.check_shapes()?;
    let picture = covered_pixels(style);
    let colors = picture.image.data.as_chunks::<3>().0.iter().zip(&picture.mask);
    let colors: Vec<[f32; 3]> = colors.filter(|(_, used)| **used).map(|(rgb, _)| *rgb).collect();
    let gamut = Gamut::of(&colors);

    let mut run = StyleRun::new(raster, splats, selected, cameras, picture)?;
    let before = run.distance(options.seed)?;
    let coeffs = splats.sh_coeffs();
    let start = |row: usize| splats.sh[row * coeffs].map(|dc| 0.5 + sh::C0 * dc);
    let rows: Vec<usize> = (0..splats.len()).filter(|&row| selected[row]).collect();
    let mut adam = Adam::new(run.changes.len());
    let mut random = SplitMix64::new(options.seed);
    let mut order = Vec::new();
    for step in 0..options.steps {
        if order.is_empty() {
            order = random.order(run.views.len());
        }
        let view = order.pop().unwrap_or(0);
        let grads = run.gradient(view, random.next_u64())?;
        let rate = RATE * (1.0 - 0.9 * step as f32 / options.steps as f32);
        adam.step(&mut run.changes, &grads, &[rate; 3], rows.iter().map(|&row| [row, row]));
        for &row in &rows {
            let (start, change) = (start(row), &mut run.changes[3 * row..3 * row + 3]);
            let color = gamut.clamped([0, 1, 2].map(|c| start[c] + change[c]), start);
            for c in 0..3 {
                change[c] = color[c] - start[c];
            }
        }
        if !observe(step + 1) {
            return Err(FitError::Cancelled);
        }
    }
    let after = run.distance(options.seed)?;
    let mut styled = splats.clone();
    for &row in &rows {
        let changes = &run.changes[3 * row..3 * row + 3];
        for (dc, change) in styled.sh[row * coeffs].iter_mut().zip(changes) {
            *dc += change / sh::C0;
        }
    }
    Ok(StyleFit { splats: styled, distance: [before, after] })
}

/// The RGB of a picture, and the pixels that have a colour.
fn covered_pixels(picture: &Image) -> MaskedImage {
    let pixels = picture.data.chunks_exact(picture.channels.max(1));
    let has_color = |pixel: &[f32]| {
        pixel.len() >= 3
            && pixel.iter().all(|v| v.is_finite())
            && pixel.get(3).is_none_or(|&coverage| coverage >= COVERED)
    };
    let mask = pixels.clone().map(has_color).collect();
    let data = pixels.flat_map(|pixel| [0, 1, 2].map(|c| pixel.get(c).copied().unwrap_or(0.0)));
    let (width, height) = (picture.width, picture.height);
    MaskedImage { image: Image { width, height, channels: 3, data: data.collect() }, mask }
}

/// The image at all levels, finest first.
fn pyramid(image: Image) -> Vec<Image> {
    let mut levels = vec![image];
    for level in 1..LEVELS {
        levels.push(halved(&levels[level - 1]));
    }
    levels
}

/// The second largest standard deviation of each splat at its distance from the camera, pixels,
/// `[N]`; at most 10⁴.
fn widths(splats: &Splats, camera: &Camera) -> Vec<f32> {
    let eye = camera.position();
    let focal = camera.intrinsics.fx.max(camera.intrinsics.fy);
    let width = |(mean, &[a, b, c]): (&[f32; 3], &[f32; 3])| {
        let second = a.min(b).max(a.max(b).min(c));
        let distance = (0..3).map(|k| (f64::from(mean[k]) - eye[k]).powi(2)).sum::<f64>().sqrt();
        #[expect(clippy::cast_possible_truncation, reason = "limited")]
        let scale = (focal / distance.max(1e-9)).min(1e9) as f32;
        (second.exp() * scale).min(1e4)
    };
    splats.means.iter().zip(&splats.log_scales).map(width).collect()
}

/// One view of the fit.
struct StyleView<'a> {
    camera: &'a Camera,
    /// Render of the start, `[H,W,3]`.
    start: Image,
    /// The start at [`CONTENT_LEVEL`], and its pixels within the selection.
    content: MaskedImage,
    /// Pixels whose colours are compared.
    pixels: Vec<u32>,
    /// Corners of the patches that are compared, per level.
    corners: Vec<Vec<u32>>,
}

impl<'a> StyleView<'a> {
    fn new<R: Rasterizer>(
        raster: &R,
        prepared: &mut R::Prepared,
        splats: &Splats,
        selected: &[bool],
        camera: &'a Camera,
    ) -> Result<Self, FitError> {
        raster.prepare_into(splats, camera, prepared)?;
        // Share of the selection, and its mean width times that share.
        let features: Vec<f32> = widths(splats, camera)
            .into_iter()
            .zip(selected)
            .flat_map(|(width, &selected)| if selected { [1.0, width] } else { [0.0; 2] })
            .collect();
        let params = RenderParams { depth: false, ..RenderParams::default() };
        let output = raster.forward(prepared, splats, &features, &params)?;
        let start = output.rgb_image();
        let shares = output.features.as_chunks::<2>().0;
        // Pixels with splats of at most this width, at this level.
        let level = |level: usize, broadest: f32| {
            let used = |&[share, width]: &[f32; 2]| share > COVERED && width < share * broadest;
            let mask = shares.iter().map(used).collect();
            let finest = MaskedImage { image: start.clone(), mask };
            (0..level).fold(finest, |image, _| image.halved())
        };
        let fine = |index: usize| level(index, BROADEST * (1_u32 << index) as f32);
        Ok(Self {
            camera,
            content: level(CONTENT_LEVEL, f32::INFINITY),
            pixels: fine(0).patch_corners(1),
            corners: (0..LEVELS).map(|index| fine(index).patch_corners(SIDE)).collect(),
            start,
        })
    }

    /// Adds the gradient of `CONTENT_WEIGHT · mean (image − start)²` over the selection's pixels.
    fn add_content_gradient(&self, image: &Image, v_image: &mut Image) {
        let MaskedImage { image: start, mask } = &self.content;
        let used = mask.iter().filter(|&&used| used).count();
        let factor = 2.0 * CONTENT_WEIGHT / (3 * used.max(1)) as f32;
        for (p, _) in mask.iter().enumerate().filter(|(_, used)| **used) {
            for at in 3 * p..3 * p + 3 {
                v_image.data[at] += factor * (image.data[at] - start.data[at]);
            }
        }
    }
}

/// The state of a fit.
struct StyleRun<'a, R: Rasterizer> {
    raster: &'a R,
    prepared: R::Prepared,
    splats: &'a Splats,
    views: Vec<StyleView<'a>>,
    /// Colours of the picture.
    palette: Option<PatchStatistics>,
    /// Patches of the picture per level; `None` where it is too small.
    targets: Vec<Option<PatchStatistics>>,
    /// Changes of the base colours, `[N,3]`.
    changes: Vec<f32>,
}

impl<'a, R: Rasterizer> StyleRun<'a, R> {
    fn new(
        raster: &'a R,
        splats: &'a Splats,
        selected: &[bool],
        cameras: &'a [Camera],
        mut picture: MaskedImage,
    ) -> Result<Self, FitError> {
        let palette = PatchStatistics::of(&picture, 1);
        let mut targets = Vec::new();
        for _ in 0..LEVELS {
            targets.push(PatchStatistics::of(&picture, SIDE));
            picture = picture.halved();
        }
        if targets[0].is_none() {
            return Err(FitError::SmallPicture);
        }
        let mut prepared = raster.unprepared(cameras.first().ok_or(FitError::NoPictures)?)?;
        let mut views = Vec::new();
        for camera in cameras {
            views.push(StyleView::new(raster, &mut prepared, splats, selected, camera)?);
        }
        views.retain(|view| view.corners.iter().any(|corners| !corners.is_empty()));
        if views.is_empty() {
            return Err(FitError::BroadSplats);
        }
        let changes = vec![0.0; 3 * splats.len()];
        Ok(Self { raster, prepared, splats, views, palette, targets, changes })
    }

    /// The levels of the render with the current colours: the start plus the blended changes.
    fn render(&mut self, view: usize) -> Result<Vec<Image>, FitError> {
        let Self { raster, prepared, splats, .. } = self;
        raster.prepare_into(splats, self.views[view].camera, prepared)?;
        let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
        let mut output = RenderOutput::default();
        raster.forward_into(prepared, splats, &self.changes, &params, &mut output)?;
        let mut image = output.features_image();
        for (value, start) in image.data.iter_mut().zip(&self.views[view].start.data) {
            *value += start;
        }
        Ok(pyramid(image))
    }

    /// Gradient of the loss of one view with respect to the changes, `[N,3]`.
    fn gradient(&mut self, view: usize, seed: u64) -> Result<Vec<f32>, FitError> {
        let levels = self.render(view)?;
        let view = &self.views[view];
        let mut v_levels: Vec<Image> =
            levels.iter().map(|image| Image::zeros(image.width, image.height, 3)).collect();
        if let Some(palette) = &self.palette {
            palette.distance(&levels[0], &view.pixels, !seed, Some(&mut v_levels[0]));
        }
        view.add_content_gradient(&levels[CONTENT_LEVEL], &mut v_levels[CONTENT_LEVEL]);
        for (index, image) in levels.iter().enumerate() {
            if let Some(target) = &self.targets[index] {
                let seed = seed ^ index as u64;
                target.distance(image, &view.corners[index], seed, Some(&mut v_levels[index]));
            }
        }
        for index in (1..LEVELS).rev() {
            let (fine, coarse) = v_levels.split_at_mut(index);
            add_halved_adjoint(&coarse[0], &mut fine[index - 1]);
        }
        let v_features = v_levels.swap_remove(0).data;
        let planes = UpstreamGrads { v_features, ..UpstreamGrads::default() };
        let mut grads = RenderGrads::default();
        self.raster.lift_into(&mut self.prepared, self.splats, &planes, 3, &mut grads)?;
        Ok(grads.v_features)
    }

    /// Root of the mean squared distance over views and levels.
    fn distance(&mut self, seed: u64) -> Result<f64, FitError> {
        let mut found = Vec::new();
        for view in 0..self.views.len() {
            let levels = self.render(view)?;
            let corners = &self.views[view].corners;
            for ((image, corners), target) in levels.iter().zip(corners).zip(&self.targets) {
                found.extend(target.as_ref().and_then(|t| t.distance(image, corners, seed, None)));
            }
        }
        Ok((found.iter().sum::<f64>() / found.len().max(1) as f64).sqrt())
    }
}
