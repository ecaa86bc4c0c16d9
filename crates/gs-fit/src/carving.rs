//! Removal of splats where the pictures show the background behind them.

use crate::fit::Run;
use crate::state::FitObserver;
use crate::view::View;
use crate::votes::lift;
use crate::working::FAINT;
use crate::{FitError, votes};
use gs_core::Rasterizer;

/// Difference of a channel (0 to 1) below which a picture shows the background of the selection.
const BEHIND: f32 = 10.0 / 255.0;
/// This many times the noise of a picture is added to [`BEHIND`], up to [`MOST_BEHIND`], but not
/// more than the difference between the picture and the current render. Otherwise new colours close
/// to that of the background would count as background.
const NOISES: f32 = 1.5;
const MOST_BEHIND: f32 = 0.12;
/// A splat belongs to the background if more than this share of it looks as it did before.
const SAME_SHARE: f32 = 0.5;
/// Passes that separate foreground and background.
const PASSES: usize = 3;
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
        // Only splats whose look has changed can be foreground. Unchanged splats beside an edit are
        // background.
        let current = self.current()?;
        let (seen, same) = self.agreement(&current, |view| Ok(view.original.clone()))?;
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

    /// Share of each splat's visible pixels that look the same as without the splats in `front`; 1
    /// for splats of `front` that are hidden by others of `front`.
    fn share_behind(&self, current: &[Vec<f32>], front: &[bool]) -> Result<Vec<f32>, FitError> {
        let (raster, params) = (self.raster, self.params());
        let (seen, open) = self.agreement(current, |view| {
            let kept: Vec<usize> =
                view.rows.iter().map(|&row| row as usize).filter(|&row| !front[row]).collect();
            let behind = self.working.splats.select(&kept);
            let mut prepared = raster.prepare(&behind, &view.camera)?;
            Ok(raster.forward(&mut prepared, &behind, &[], &params)?.rgb)
        })?;
        let share = |i: usize| {
            if seen[i] > votes::LEAST_SEEN { open[i] / seen[i] } else { 1.0 }
        };
        Ok((0..front.len()).map(share).collect())
    }

    /// Current renders of the edited views, `[H,W,3]` each; empty for pictures without noise, for
    /// which they are not needed.
    fn current(&self) -> Result<Vec<Vec<f32>>, FitError> {
        let (raster, params) = (self.raster, self.params());
        let render = |&v: &usize| {
            let view = &self.views[v];
            if view.noise <= 0.0 {
                return Ok(Vec::new());
            }
            let rows: Vec<usize> = view.rows.iter().map(|&row| row as usize).collect();
            let splats = self.working.splats.select(&rows);
            let mut prepared = raster.prepare(&splats, &view.camera)?;
            Ok(raster.forward(&mut prepared, &splats, &[], &params)?.rgb)
        };
        self.edited.iter().map(render).collect()
    }

    /// Per splat, the number of pixels of the edited pictures that show it, and the number of these
    /// where the picture looks like `other` (`[H,W,3]`). Counts pixels that the selection can
    /// change, and splats on which these depend.
    fn agreement(
        &self,
        current: &[Vec<f32>],
        other: impl Fn(&View) -> Result<Vec<f32>, FitError>,
    ) -> Result<(Vec<f32>, Vec<f32>), FitError> {
        let splats = &self.working.splats;
        let (mut seen, mut same) = (vec![0.0_f32; splats.len()], vec![0.0_f32; splats.len()]);
        for (&v, current) in self.edited.iter().zip(current) {
            let view = &self.views[v];
            let other = other(view)?;
            let noise = (NOISES * view.noise).min(MOST_BEHIND - BEHIND);
            let differ = |a: &[f32], b: &[f32]| {
                a.iter().zip(b).fold(0.0, |most: f32, (a, b)| most.max((a - b).abs()))
            };
            let pixels = other.chunks_exact(3).zip(view.target.chunks_exact(3)).enumerate();
            let planes: Vec<f32> = pixels
                .flat_map(|(p, (a, b))| {
                    if !view.rect.contains(p % view.width, p / view.width) {
                        return [0.0; 2];
                    }
                    let now = current.get(3 * p..3 * p + 3);
                    let slack = now.map_or(0.0, |now| differ(now, b).min(noise));
                    [1.0, f32::from(u8::from(differ(a, b) < BEHIND + slack))]
                })
                .collect();
            let rows: Vec<usize> = view.rows.iter().map(|&row| row as usize).collect();
            let sums = lift(self.raster, &splats.select(&rows), &view.camera, planes, 2)?;
            for (&i, sum) in rows.iter().zip(sums.as_chunks::<2>().0) {
                seen[i] += sum[0];
                same[i] += sum[1];
            }
        }
        Ok((seen, same))
    }
}
