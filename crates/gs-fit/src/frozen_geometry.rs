//! Determines which selected splats keep their geometry: those where colours alone explain the
//! pictures.
//!
//! A fit that moves every selected splat also moves those that need only a new colour, and these
//! lose the exact motion that the source has for them. Residuals show where geometry is wrong only
//! after colours have converged, so these are solved in closed form first.

use crate::FitError;
use crate::fit::Run;
use crate::subset::Subset;
use crate::votes::MIN_SEEN;
use gs_core::{Rasterizer, RenderGrads, RenderOutput, Splats, UpstreamGrads, sh};

/// Geometry is frozen where pictures and render differ by less than this (mean over a splat's
/// pixels, colours 0 to 1): about the rounding of 8-bit pictures and the remainder of the least
/// squares. Colours on wrong geometry leave more. `docs/BENCHMARKS.md` has the thresholds that were
/// tried.
const EXPLAINED: f32 = 3.0 / 255.0;
/// Frozen geometry is released where they later differ by more than this; twice [`EXPLAINED`], so
/// that noise does not release it.
const RELEASED: f32 = 6.0 / 255.0;
/// A pixel is unchanged if no channel changed by this, 0 to 1: a little more than the 8/255 from
/// which a pixel counts as edited. Half the value increases the end-point error by 7 to 11 %; twice
/// the value changes it by +1 and −9 %.
const UNCHANGED: f32 = 10.0 / 255.0;
/// Geometry is also frozen where more than this share of a splat's pixels is unchanged: the splat
/// lies next to the edit or in front of it, for example an arm in front of recoloured clothing.
/// With 0.3 and 0.7 the end-point error changes by at most 12 %.
const SAME_SHARE: f32 = 0.5;

/// What the edited pictures show of a splat, means over its visible pixels.
#[derive(Debug, Clone, Copy, Default)]
struct Shown {
    /// Visible pixels of all pictures.
    pixels: f32,
    /// Difference between pictures and render, largest channel, 0 to 1.
    left: f32,
    /// Share that differs from the scene before the edit by less than [`UNCHANGED`].
    same: f32,
}

impl Shown {
    fn is_same(self) -> bool {
        self.same > SAME_SHARE
    }
}

impl<R: Rasterizer + Sync> Run<'_, R> {
    /// Solves colours with the geometry of the start, and freezes the geometry of the splats where
    /// they explain the pictures; these get their colours. The others keep the colours of the
    /// start: solved colours would paint deleted objects in the colour of their background.
    pub(crate) fn freeze_explained(&mut self) -> Result<(), FitError> {
        let changes = self.color_changes()?;
        let solved = with_changes(&self.working.splats, &changes);
        let shown = self.shown(&solved)?;
        let working = &mut self.working;
        let coeffs = solved.sh_coeffs();
        for (i, shown) in shown.into_iter().enumerate() {
            let is_free = working.selected[i] && !working.fading[i] && !working.hidden[i];
            let is_explained = !self.options.geometry || shown.left < EXPLAINED;
            working.frozen[i] = is_free && (is_explained || shown.is_same());
            if is_free && is_explained {
                working.splats.sh[i * coeffs] = solved.sh[i * coeffs];
            }
        }
        Ok(())
    }

    /// Releases frozen splats where pictures and render differ.
    pub(crate) fn release(&mut self) -> Result<(), FitError> {
        if !self.options.geometry || !self.working.frozen.contains(&true) {
            return Ok(());
        }
        let shown = self.shown(&self.working.splats)?;
        for (frozen, shown) in self.working.frozen.iter_mut().zip(shown) {
            *frozen &= shown.left < RELEASED || shown.is_same();
        }
        Ok(())
    }

    /// Compares the edited pictures with a render of `splats`; one value per splat.
    fn shown(&self, splats: &Splats) -> Result<Vec<Shown>, FitError> {
        let (raster, params, mut prepared) = (self.raster, self.params(), self.unprepared()?);
        let (mut planes, mut sums) = (UpstreamGrads::default(), RenderGrads::default());
        let (mut part, mut output) = (Subset::default(), RenderOutput::default());
        let mut shown = vec![Shown::default(); splats.len()];
        for &v in &self.edited {
            let view = &self.views[v];
            part.gather(splats, &view.rows);
            let splats = &part.splats;
            raster.prepare_tiles_into(splats, &view.camera, &view.tiles, &mut prepared)?;
            raster.forward_into(&mut prepared, splats, &[], &params, &mut output)?;
            let rgb = &output.rgb;
            view.fill_planes(&view.tiles, &mut planes.v_features, |p| {
                let [ours, before, picture] =
                    [rgb, &view.original, &view.target].map(|rgb| &rgb[3 * p..3 * p + 3]);
                let is_same = difference(before, picture) < UNCHANGED;
                [1.0, difference(ours, picture), f32::from(u8::from(is_same))]
            });
            raster.lift_into(&mut prepared, splats, &planes, 3, &mut sums)?;
            for (&row, sum) in view.rows.iter().zip(sums.v_features.as_chunks::<3>().0) {
                let shown = &mut shown[row as usize];
                shown.pixels += sum[0];
                shown.left += sum[1];
                shown.same += sum[2];
            }
        }
        for shown in &mut shown {
            let total = shown.pixels.max(MIN_SEEN);
            shown.left /= total;
            shown.same /= total;
        }
        Ok(shown)
    }
}

/// Largest difference of a channel.
fn difference(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).fold(0.0, |most: f32, (a, b)| most.max((a.clamp(0.0, 1.0) - b).abs()))
}

/// `splats` with changed base colours (`[N,3]`). Changed colours stay between 0 and 1, as those of
/// the pictures, or do not leave these bounds further than before.
fn with_changes(splats: &Splats, changes: &[f32]) -> Splats {
    let mut changed = splats.clone();
    let coeffs = splats.sh_coeffs();
    for (i, change) in changes.as_chunks::<3>().0.iter().enumerate() {
        for (dc, change) in changed.sh[i * coeffs].iter_mut().zip(change) {
            if *change != 0.0 {
                let old = 0.5 + sh::C0 * *dc;
                let new = (old + change).clamp(old.min(0.0), old.max(1.0));
                *dc = (new - 0.5) / sh::C0;
            }
        }
    }
    changed
}
