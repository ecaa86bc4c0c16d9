//! Votes of masks: how much of each splat they show.

use crate::FitError;
use gs_core::{
    Camera, Rasterizer, RenderGrads, Splats, UpstreamGrads, visible_share, weighted_quantile,
};
use rayon::prelude::*;

/// Minimum sum over all views, pixels, of a splat that counts as visible.
pub(crate) const MIN_SEEN: f32 = 1e-3;

/// Visibility of each splat in masks of several views; one row per splat.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Votes {
    /// `Σ α T` over all pixels of all views, pixels.
    pub seen: Vec<f32>,
    /// `Σ α T` over the pixels of the masks, pixels.
    pub masked: Vec<f32>,
    /// Visible share: the largest `Σ α T / Σ α` of a view, 0 to 1.
    pub shown: Vec<f32>,
    /// Number of views whose mask shows at least [`Votes::NOTICEABLE`] pixels of the splat.
    pub views: Vec<u16>,
}

impl Votes {
    /// Minimum sum in a view that counts as showing the splat, pixels.
    pub const NOTICEABLE: f32 = 0.02;
    /// Visible share below which a splat counts as hidden: pictures do not constrain it. Also the
    /// default below which `cuar` takes a splat as hidden in frame 1, so that it repairs what a fit
    /// leaves.
    pub const HIDDEN: f32 = 0.1;

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
        let mut votes = Self {
            seen: vec![0.0; n],
            masked: vec![0.0; n],
            shown: vec![0.0; n],
            views: vec![0; n],
        };
        let mut prepared: Option<R::Prepared> = None;
        let (mut planes, mut sums) = (UpstreamGrads::default(), RenderGrads::default());
        for (camera, mask) in views {
            match &mut prepared {
                Some(prepared) => raster.prepare_into(splats, camera, prepared)?,
                none => *none = Some(raster.prepare(splats, camera)?),
            }
            planes.v_features.clear();
            planes.v_features.extend(mask.iter().flat_map(|&on| [1.0, f32::from(u8::from(on))]));
            if let Some(prepared) = &mut prepared {
                raster.lift_into(prepared, splats, &planes, 2, &mut sums)?;
            }
            for (i, sum) in sums.v_features.as_chunks::<2>().0.iter().enumerate() {
                votes.seen[i] += sum[0];
                votes.masked[i] += sum[1];
                votes.views[i] += u16::from(sum[1] > Self::NOTICEABLE);
            }
            let sums = sums.v_features.as_chunks::<2>().0.par_iter();
            votes.shown.par_iter_mut().zip(sums).enumerate().for_each(|(i, (shown, sum))| {
                if sum[0] > 0.0 {
                    *shown = shown.max(visible_share(splats, i, sum[0], camera, 1.0));
                }
            });
        }
        Ok(votes)
    }

    /// Splats that others hide in every view, `[N]`: their largest visible share is below
    /// [`Votes::HIDDEN`], or, where splats overlap so much that typical shares are small, a quarter
    /// of the typical share (the median of the `selected`, weighted by themselves).
    pub fn hidden(&self, selected: &[bool]) -> Vec<bool> {
        let shares = self.shown.iter().zip(selected).filter(|(_, selected)| **selected);
        let weighted = shares.map(|(share, _)| (*share, *share)).collect();
        let typical = weighted_quantile(weighted, 0.5).unwrap_or(0.0);
        let hidden = Self::HIDDEN.min(0.25 * typical);
        self.shown.iter().map(|share| *share < hidden).collect()
    }

    /// Share of the visible pixels of splat `i` that lie in masks; 0 if it is not visible.
    pub fn share(&self, i: usize) -> f32 {
        if self.seen[i] > MIN_SEEN { self.masked[i] / self.seen[i] } else { 0.0 }
    }
}
