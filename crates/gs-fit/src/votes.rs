//! Sums of per-pixel values per splat, and the votes of masks.

use crate::FitError;
use gs_core::{Camera, RasterError, Rasterizer, RenderParams, Splats, UpstreamGrads};

/// Sums over the pixels of one view, per splat: `Σ_p plane_p α T` for each of `planes` (`[P,F]`,
/// channels innermost), `[N,F]`.
///
/// # Errors
/// If the rasteriser fails.
pub fn lift<R: Rasterizer>(
    raster: &R,
    splats: &Splats,
    camera: &Camera,
    planes: Vec<f32>,
    channels: usize,
) -> Result<Vec<f32>, RasterError> {
    let mut prepared = raster.prepare(splats, camera)?;
    let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
    let features = vec![0.0; splats.len() * channels];
    raster.forward(&mut prepared, splats, &features, &params)?;
    let upstream = UpstreamGrads { v_features: planes, ..UpstreamGrads::default() };
    let grads = raster.backward_colors(&mut prepared, splats, &features, &params, &upstream)?;
    Ok(grads.v_features)
}

/// Minimum sum over all views, pixels, of a splat that counts as visible.
pub(crate) const LEAST_SEEN: f32 = 1e-3;

/// Visibility of each splat in masks of several views; one row per splat.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Votes {
    /// `Σ α T` over all pixels of all views, pixels.
    pub seen: Vec<f32>,
    /// `Σ α T` over the pixels of the masks, pixels.
    pub masked: Vec<f32>,
    /// Number of views whose mask shows at least [`Votes::NOTICEABLE`] pixels of the splat.
    pub views: Vec<u16>,
}

impl Votes {
    /// Minimum sum in a view that counts as showing the splat, pixels.
    pub const NOTICEABLE: f32 = 0.02;

    /// Votes of the given views and masks (`[H,W]`).
    ///
    /// # Errors
    /// If the rasteriser fails.
    pub fn of<'a, R: Rasterizer>(
        raster: &R,
        splats: &Splats,
        views: impl Iterator<Item = (&'a Camera, &'a [bool])>,
    ) -> Result<Self, FitError> {
        let n = splats.len();
        let mut votes = Self { seen: vec![0.0; n], masked: vec![0.0; n], views: vec![0; n] };
        for (camera, mask) in views {
            let planes = mask.iter().flat_map(|&on| [1.0, f32::from(u8::from(on))]).collect();
            let sums = lift(raster, splats, camera, planes, 2)?;
            for (i, sum) in sums.as_chunks::<2>().0.iter().enumerate() {
                votes.seen[i] += sum[0];
                votes.masked[i] += sum[1];
                votes.views[i] += u16::from(sum[1] > Self::NOTICEABLE);
            }
        }
        Ok(votes)
    }

    /// Share of the visible pixels of splat `i` that lie in masks; 0 if it is not visible.
    pub fn share(&self, i: usize) -> f32 {
        if self.seen[i] > LEAST_SEEN { self.masked[i] / self.seen[i] } else { 0.0 }
    }
}
