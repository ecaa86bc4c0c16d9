//! Removal of splats where the pictures show the background behind them.

use crate::fit::Run;
use crate::state::FitObserver;
use crate::subset::Subset;
use crate::view::View;
use crate::working::FAINT;
use crate::{FitError, votes};
use gs_core::{Footprint, Rasterizer, RenderGrads, RenderOutput, TileSet, UpstreamGrads};
use rayon::prelude::*;

/// Difference of a channel (0 to 1) below which a picture shows the background of the selection.
const BEHIND: f32 = 10.0 / 255.0;
/// This many times the noise of a picture is added to [`BEHIND`], up to [`MAX_BEHIND`], but not
/// more than the difference between the picture and the current render. Otherwise new colours close
/// to that of the background would count as background.
const NOISES: f32 = 1.5;
const MAX_BEHIND: f32 = 0.12;
/// A splat belongs to the background if more than this share of its pixels is unchanged.
const SAME_SHARE: f32 = 0.5;
/// Passes that separate foreground and background. A third changes a hundredth of the splats and
/// takes a third of the time.
const PASSES: usize = 2;
/// A splat is removed if the pictures show the background in more than this share of its visible
/// pixels.
const BEHIND_SHARE: f32 = 0.85;
/// A splat fades if the share is above this: for the first part of the fit only its opacity is
/// fitted, so that it does not take the colour of the background.
const FADING_SHARE: f32 = 0.3;
/// Maximum number of rounds of removal before the first step. Each can uncover hidden splats.
const ROUNDS: usize = 3;

impl<R: Rasterizer + Sync> Run<'_, R> {
    /// Removes selected splats where the pictures show the background behind them, before the first
    /// step. Returns the number of removed splats.
    pub(crate) fn carve_first(
        &mut self,
        observer: &mut dyn FitObserver,
    ) -> Result<usize, FitError> {
        let mut removed = 0;
        for round in 0..ROUNDS {
            self.reach();
            observer.carving(round, ROUNDS);
            let now = self.carve()?;
            removed += now;
            if now == 0 {
                break;
            }
            // Splats hidden by the removed ones are visible now.
            self.select_more()?;
        }
        Ok(removed)
    }

    /// Finds selected splats where the pictures show the background behind them. They are removed
    /// if all pictures show it, and fade if some do. Returns the number of removed splats.
    pub(crate) fn carve(&mut self) -> Result<usize, FitError> {
        let n = self.working.splats.len();
        // Only splats whose appearance has changed can be foreground. Unchanged splats next to an
        // edit are background.
        let current = self.current()?;
        let (seen, same) =
            self.agreement(&current, None, |view, _, _| Ok(view.original.clone()))?;
        let mut front: Vec<bool> =
            (0..n).map(|i| self.working.selected[i] && same[i] < SAME_SHARE * seen[i]).collect();
        let mut gone = vec![false; n];
        for _ in 0..PASSES {
            if !front.contains(&true) {
                break;
            }
            let share = self.share_behind(&current, &front)?;
            let before = front.clone();
            for i in 0..n {
                gone[i] |= front[i] && share[i] > BEHIND_SHARE;
                front[i] &= share[i] > FADING_SHARE || gone[i];
            }
            if front == before {
                break;
            }
        }
        self.working.fading = front;
        Ok(self.working.prune(&gone, FAINT))
    }

    /// Share of each splat's visible pixels whose picture equals the render without the splats in
    /// `front`; 1 for splats of `front` that are hidden by others of `front`.
    fn share_behind(&self, current: &[Vec<f32>], front: &[bool]) -> Result<Vec<f32>, FitError> {
        let (raster, params) = (self.raster, self.params());
        let (mut prepared, mut output) = (self.unprepared()?, RenderOutput::default());
        let mut behind = Subset::default();
        let (seen, open) = self.agreement(current, Some(front), |view, tiles, rows| {
            let kept: Vec<u32> = rows.iter().copied().filter(|&row| !front[row as usize]).collect();
            behind.gather(&self.working.splats, &kept);
            let splats = &behind.splats;
            raster.prepare_tiles_into(splats, &view.camera, tiles, &mut prepared)?;
            raster.forward_into(&mut prepared, splats, &[], &params, &mut output)?;
            Ok(std::mem::take(&mut output.rgb))
        })?;
        let share = |i: usize| {
            if seen[i] > votes::MIN_SEEN { open[i] / seen[i] } else { 1.0 }
        };
        Ok((0..front.len()).map(share).collect())
    }

    /// The tiles of a view that some of its splats reach, and the rows of all splats on which these
    /// tiles depend.
    fn reached(&self, view: &View, some: &[bool]) -> (TileSet, Vec<u32>) {
        let (raster, splats) = (self.raster, &self.working.splats);
        let footprint = |&row: &u32| raster.footprint(splats, row as usize, &view.camera);
        let footprints: Vec<_> = view.rows.par_iter().map(footprint).collect();
        let mut tiles = TileSet::new(view.width, view.height);
        let rows = || view.rows.iter().zip(&footprints);
        for (_, footprint) in rows().filter(|(row, _)| some[**row as usize]) {
            if let Some(footprint) = footprint {
                tiles.insert(footprint.pixels);
            }
        }
        tiles.intersect(&view.tiles);
        let is_needed = |footprint: &Option<Footprint>| {
            footprint.is_some_and(|footprint| tiles.overlaps(footprint.pixels))
        };
        let needed = rows().filter(|(_, at)| is_needed(at)).map(|(&row, _)| row).collect();
        (tiles, needed)
    }

    /// Memory for renders, of no splats.
    pub(crate) fn unprepared(&self) -> Result<R::Prepared, FitError> {
        Ok(self.raster.unprepared(&self.views[0].camera)?)
    }

    /// Current renders of the edited views, `[H,W,3]` each; empty for pictures without noise, for
    /// which they are not needed.
    fn current(&self) -> Result<Vec<Vec<f32>>, FitError> {
        let (raster, params, mut prepared) = (self.raster, self.params(), self.unprepared()?);
        let render = |&v: &usize| {
            let view = &self.views[v];
            if view.noise <= 0.0 {
                return Ok(Vec::new());
            }
            let rows: Vec<usize> = view.rows.iter().map(|&row| row as usize).collect();
            let splats = self.working.splats.select(&rows);
            raster.prepare_tiles_into(&splats, &view.camera, &view.tiles, &mut prepared)?;
            Ok(raster.forward(&mut prepared, &splats, &[], &params)?.rgb)
        };
        self.edited.iter().map(render).collect()
    }

    /// Per splat, the number of pixels of the edited pictures that show it, and the number of these
    /// where the picture equals `other` (`[H,W,3]`). Counts pixels that the selection can
    /// change, and splats on which these depend; if `only` is given, those of its splats alone are
    /// complete. `other` is called with a view, the tiles of it that are needed, and the rows of the
    /// splats on which these depend.
    fn agreement(
        &self,
        current: &[Vec<f32>],
        only: Option<&[bool]>,
        mut other: impl FnMut(&View, &TileSet, &[u32]) -> Result<Vec<f32>, FitError>,
    ) -> Result<(Vec<f32>, Vec<f32>), FitError> {
        let splats = &self.working.splats;
        let (mut seen, mut same) = (vec![0.0_f32; splats.len()], vec![0.0_f32; splats.len()]);
        let (raster, mut prepared) = (self.raster, self.unprepared()?);
        let (mut planes, mut sums) = (UpstreamGrads::default(), RenderGrads::default());
        let mut shown = Subset::default();
        for (&v, current) in self.edited.iter().zip(current) {
            let view = &self.views[v];
            let parts = only.map(|only| self.reached(view, only));
            let (tiles, rows) =
                parts.as_ref().map_or((&view.tiles, &view.rows), |(tiles, rows)| (tiles, rows));
            if tiles.is_empty() {
                continue;
            }
            let other = other(view, tiles, rows)?;
            let noise = (NOISES * view.noise).min(MAX_BEHIND - BEHIND);
            let differ = |a: &[f32], b: &[f32]| {
                a.iter().zip(b).fold(0.0, |most: f32, (a, b)| most.max((a - b).abs()))
            };
            view.fill_planes(tiles, &mut planes.v_features, |p| {
                let (a, b) = (&other[3 * p..3 * p + 3], &view.target[3 * p..3 * p + 3]);
                let now = current.get(3 * p..3 * p + 3);
                let slack = now.map_or(0.0, |now| differ(now, b).min(noise));
                [1.0, f32::from(u8::from(differ(a, b) < BEHIND + slack))]
            });
            shown.gather(splats, rows);
            raster.prepare_tiles_into(&shown.splats, &view.camera, tiles, &mut prepared)?;
            raster.lift_into(&mut prepared, &shown.splats, &planes, 2, &mut sums)?;
            for (&i, sum) in rows.iter().zip(sums.v_features.as_chunks::<2>().0) {
                seen[i as usize] += sum[0];
                same[i as usize] += sum[1];
            }
        }
        Ok((seen, same))
    }
}
