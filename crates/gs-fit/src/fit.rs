//! [`fit()`]: fits splats to pictures.

use crate::alignment::{Aligning, Alignment, needed, remove_common};
use crate::loss::{PictureLoss, Target};
use crate::optimizer::RowFlags;
use crate::report::{self, FitReport};
use crate::state::{FitObserver, FitPreview, FitProgress, FitState};
use crate::subset::Subset;
use crate::view::{self, EditedPicture, View};
use crate::votes::Votes;
use crate::working::{NEW, Working};
use crate::{FitError, FitOptions, FitRates};
use gs_core::image_formation::ALPHA_THRESHOLD;
use gs_core::{
    Camera, Image, Rasterizer, RenderOutput, RenderParams, Splats, TileSet, UpstreamGrads,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::time::Instant;

/// Densification: the number of steps between two densifications is the fit's length divided by
/// this, and the share of the fit after which they end. Every 100 steps of 1000 instead of every
/// 125: the same quality (`docs/BENCHMARKS.md`).
const DENSIFY_TIMES: usize = 8;
const DENSIFY_UNTIL: f64 = 0.7;
/// Registration of the pictures: first step, steps between two registrations, and share of the fit
/// after which they end.
const ALIGN_FROM: usize = 40;
const ALIGN_EVERY: usize = 30;
const ALIGN_UNTIL: f64 = 0.9;
/// Share of the fit until which only the opacity of fading splats is fitted.
const FADE_UNTIL: f64 = 0.5;
/// Splats below this opacity are removed at a given share of the fit, so that the last steps adapt
/// the others. They are barely visible in eight-bit pictures.
const FAINT_AT_END: f32 = 0.02;
const LAST_PRUNE: f64 = 0.9;
/// Number of estimates from which the fit determines whether the pictures disagree, and how.
const NUM_ESTIMATES: usize = 2;
/// Unedited pictures have no weight within this distance of the selection, as a share of the longer
/// image side.
const UNSURE_BAND: f32 = 0.03;
/// Share of the rate of the harmonics that is lost over the fit, linearly.
const SH_DECAY: f32 = 0.9;
/// Selected splats may move by this many pixels before the pixels that they reach are found again;
/// also more than the radius of an SSIM window.
const REACH_MARGIN: usize = 8;

/// Result of a fit.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Fitted {
    /// Unselected splats, bit for bit, and the remaining selected ones, in the order of the start;
    /// then new ones.
    pub splats: Splats,
    /// Row of each splat at the start; `None` for new ones.
    pub source_rows: Vec<Option<u32>>,
    /// Rows of the start that were selected initially or when they became visible.
    pub selected: Vec<bool>,
    /// Counts, and regions that few pictures show.
    pub report: FitReport,
}

/// Fits splats to edited pictures; see the crate's documentation. With `state`, an interrupted fit
/// is resumed; its result is bit-identical.
///
/// If no picture differs from the scene, the result is `start`.
///
/// # Errors
/// If pictures, masks, options or state do not fit the scene, nothing is selected, the rasteriser
/// fails, or the observer stops the fit.
pub fn fit<R: Rasterizer + Sync>(
    raster: &R,
    start: &Splats,
    pictures: &[EditedPicture],
    options: &FitOptions,
    state: Option<&FitState>,
    observer: &mut dyn FitObserver,
) -> Result<Fitted, FitError> {
    start.check_shapes()?;
    if pictures.is_empty() {
        return Err(FitError::NoPictures);
    }
    options.check(pictures.len())?;
    let mut views = view::open(raster, start, pictures, options)?;
    let edited: Vec<usize> = (0..views.len()).filter(|&v| views[v].is_edited()).collect();
    let mut report = FitReport::of(&views);
    if edited.is_empty() {
        let rows = (0..start.len()).map(|i| u32::try_from(i).ok()).collect();
        let selected = vec![false; start.len()];
        return Ok(Fitted { splats: start.clone(), source_rows: rows, selected, report });
    }
    let votes = vote(raster, start, &views)?;
    let selected: Vec<bool> =
        (0..start.len()).map(|i| votes.share(i) > options.vote && start.is_finite(i)).collect();
    report.selected = selected.iter().filter(|on| **on).count();
    if report.selected == 0 {
        return Err(FitError::NothingSelected {
            pixels: report.masked_pixels,
            views: report.edited_views,
        });
    }
    report.poorly_seen = report::poorly_seen(raster, start, &views, &selected, &votes)?;
    weigh_unedited(raster, start, &mut views, &selected)?;

    let fingerprint = crate::fingerprint::of(start, pictures, options);
    // Fewer pictures do not determine the position of a surface.
    report.geometry_frozen = options.geometry && edited.len() < usize::from(report::ENOUGH_VIEWS);
    let options =
        &FitOptions { geometry: options.geometry && !report.geometry_frozen, ..options.clone() };
    let prepared = raster.unprepared(&pictures[0].camera)?;
    let mut run = Run {
        raster,
        options,
        working: Working { hidden: votes.hidden(&selected), ..Working::new(start, selected) },
        views,
        edited,
        subset: Subset::default(),
        prepared,
        losses: Vec::new(),
        previewed: 0,
    };
    let mut step = 0;
    if let Some(state) = state {
        if state.fingerprint != fingerprint {
            return Err(FitError::State {
                what: "the state is from a fit with different inputs or options".to_owned(),
            });
        }
        step = crate::checkpoint::restore(state, &mut run.working, &mut run.views)?;
        run.find_rows();
    } else {
        if run.carves() {
            report.carved = run.carve_first(observer)?;
        }
        run.reach();
        run.freeze_explained()?;
    }
    run.descend(step, fingerprint, observer)?;
    // Removes splats that are too faint to be drawn at any pixel.
    run.working.prune_faint(ALPHA_THRESHOLD);
    let selected = std::mem::take(&mut run.working.chosen);
    report.finish(&run.working.source, &selected);
    let source_rows = run.working.source.iter().map(|&row| (row != NEW).then_some(row)).collect();
    Ok(Fitted { splats: run.working.splats, source_rows, selected, report })
}

/// Votes of the edited pictures.
fn vote<R: Rasterizer>(raster: &R, splats: &Splats, views: &[View]) -> Result<Votes, FitError> {
    let edited = views.iter().filter(|view| view.is_edited());
    Votes::of(raster, splats, edited.map(|view| (&view.camera, view.mask.as_slice())))
}

/// Sets the weights of unedited pictures: 0 where they show the selection, because the edit of
/// other pictures applies there, too.
fn weigh_unedited<R: Rasterizer>(
    raster: &R,
    start: &Splats,
    views: &mut [View],
    selected: &[bool],
) -> Result<(), FitError> {
    let features: Vec<f32> = selected.iter().map(|&on| f32::from(u8::from(on))).collect();
    let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
    for view in views.iter_mut().filter(|view| !view.is_edited()) {
        let mut prepared = raster.prepare(start, &view.camera)?;
        let shown = raster.forward(&mut prepared, start, &features, &params)?.features;
        let shown: Vec<bool> = shown.iter().map(|&share| share > 0.02).collect();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a count"
        )]
        let band = (UNSURE_BAND * view.width.max(view.height) as f32).ceil() as usize;
        let unsure = crate::mask::dilated(&shown, view.width, band);
        view.weights = unsure.iter().map(|&on| f32::from(u8::from(!on))).collect();
    }
    Ok(())
}

/// A running fit.
pub(crate) struct Run<'a, R: Rasterizer> {
    pub raster: &'a R,
    pub options: &'a FitOptions,
    pub working: Working,
    pub views: Vec<View>,
    /// Views whose pictures were edited.
    pub edited: Vec<usize>,
    /// The splats of the last render.
    subset: Subset,
    prepared: R::Prepared,
    losses: Vec<f32>,
    previewed: usize,
}

impl<R: Rasterizer + Sync> Run<'_, R> {
    pub(crate) fn params(&self) -> RenderParams {
        RenderParams {
            background: self.options.background,
            depth: false,
            ..RenderParams::default()
        }
    }

    /// The view of a step. Each pass has every edited view, and at most as many others, once, in
    /// random order.
    fn view_of(&self, step: usize) -> usize {
        let others: Vec<usize> =
            (0..self.views.len()).filter(|&v| !self.views[v].is_edited()).collect();
        let length = self.edited.len() + others.len().min(self.edited.len());
        let mut rng = Pcg64::seed_from_u64(self.options.seed ^ (step / length) as u64);
        let mut shuffle = |list: &mut Vec<usize>| {
            for i in (1..list.len()).rev() {
                list.swap(i, rng.random_range(0..=i));
            }
        };
        let mut others = others;
        shuffle(&mut others);
        others.truncate(self.edited.len());
        let mut order = self.edited.clone();
        order.extend(others);
        shuffle(&mut order);
        order[step % length]
    }

    /// Renders the pixels of a view that the selection can change; other pixels are incomplete.
    fn render(
        &mut self,
        view: usize,
        params: &RenderParams,
        output: &mut RenderOutput,
    ) -> Result<(), FitError> {
        let view = &self.views[view];
        self.subset.gather(&self.working.splats, &view.rows);
        let splats = &self.subset.splats;
        let prepared = &mut self.prepared;
        self.raster.prepare_tiles_into(splats, &view.camera, &view.tiles, prepared)?;
        self.raster.forward_into(prepared, splats, &[], params, output)?;
        Ok(())
    }

    fn descend(
        &mut self,
        first: usize,
        fingerprint: u64,
        observer: &mut dyn FitObserver,
    ) -> Result<(), FitError> {
        let FitOptions { steps, dssim, rates, .. } = *self.options;
        let params = self.params();
        let mut loss = PictureLoss::new(dssim);
        let (mut output, mut upstream) = (RenderOutput::default(), UpstreamGrads::default());
        let (mut saved, mut shown) = (Instant::now(), Instant::now());
        for step in first..steps {
            if step > 0
                && step.is_multiple_of(self.densify_every())
                && self.carves()
                && (step as f64) < DENSIFY_UNTIL * steps as f64
            {
                self.densify(step)?;
            }
            if self.options.align
                && self.working.aligning != Aligning::Nothing
                && self.edited.len() > 1
                && step >= ALIGN_FROM
                && (step - ALIGN_FROM).is_multiple_of(ALIGN_EVERY)
                && (step as f64) < ALIGN_UNTIL * steps as f64
            {
                self.align(step)?;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a share of a count"
            )]
            if step > 0 && step == (LAST_PRUNE * steps as f64) as usize {
                self.working.prune_faint(FAINT_AT_END);
                self.reach();
            }
            let view = self.view_of(step);
            self.render(view, &params, &mut output)?;
            let at = &self.views[view];
            let target = Target {
                width: at.width,
                height: at.height,
                rgb: &at.target,
                weights: &at.weights,
                tiles: &at.tiles,
            };
            let value = loss.evaluate(&output.rgb, &target, &mut upstream.v_rgb);
            self.losses.push(value);
            let Subset { splats, grads: own } = &mut self.subset;
            self.raster.backward_into(&mut self.prepared, splats, &[], &params, &upstream, own)?;
            self.update(step, view, &rates);
            self.report(step + 1, observer);
            if self.options.preview_secs.is_some_and(|secs| shown.elapsed().as_secs_f64() >= secs) {
                observer.preview(&self.preview()?);
                shown = Instant::now();
            }
            let stop = observer.cancelled();
            if stop || saved.elapsed().as_secs_f64() >= self.options.checkpoint_secs {
                let (working, views) = (&mut self.working, &self.views);
                observer.checkpoint(&crate::checkpoint::save(
                    fingerprint,
                    step + 1,
                    working,
                    views,
                ));
                saved = Instant::now();
            }
            if stop {
                return Err(FitError::Cancelled);
            }
        }
        Ok(())
    }

    /// Whether splats are removed where the pictures show the background behind them, which needs
    /// enough pictures.
    fn carves(&self) -> bool {
        self.options.densify && self.edited.len() >= usize::from(report::ENOUGH_VIEWS)
    }

    fn densify_every(&self) -> usize {
        (self.options.steps / DENSIFY_TIMES).max(1)
    }

    /// One step along the gradient of a view, and its share of the densification statistic.
    fn update(&mut self, step: usize, view: usize, rates: &FitRates) {
        let View { rows, width, height, .. } = &self.views[view];
        let (half, grads) = ([*width as f32 / 2.0, *height as f32 / 2.0], &self.subset.grads);
        for (&row, v) in rows.iter().zip(&grads.v_means2d) {
            let row = row as usize;
            if self.working.selected[row] && *v != [0.0; 2] {
                self.working.gradient[row] += (v[0] * half[0]).hypot(v[1] * half[1]);
                self.working.num_visible_steps[row] += 1;
            }
        }
        let done = step as f64 / self.options.steps as f64;
        #[expect(clippy::cast_possible_truncation, reason = "a factor")]
        let decay = 0.1_f64.powf(done) as f32;
        let sh_decay = 1.0 - SH_DECAY * (step as f32 / self.options.steps as f32);
        let options = self.options;
        let working = &mut self.working;
        let rates = FitRates {
            means: rates.means * working.size * decay,
            sh: rates.sh * sh_decay,
            ..*rates
        };
        let Working { splats, optimizer, selected, fading, frozen, hidden, .. } = working;
        let flags = RowFlags { selected, fading, frozen, hidden };
        optimizer.step(splats, (rows, grads), &rates, options.geometry, flags);
        working.limit_scales();
    }

    fn report(&mut self, done: usize, observer: &mut dyn FitObserver) {
        if done.is_multiple_of(10) || done == self.options.steps {
            let mean = self.losses.iter().sum::<f32>() / self.losses.len().max(1) as f32;
            self.losses.clear();
            observer.progress(&FitProgress {
                done,
                total: self.options.steps,
                loss: Some(mean),
                splats: self.working.splats.len(),
            });
        }
    }

    fn preview(&mut self) -> Result<FitPreview, FitError> {
        let view = self.edited[self.previewed % self.edited.len()];
        self.previewed += 1;
        let params = self.params();
        let (raster, splats) = (self.raster, &self.working.splats);
        let mut prepared = raster.prepare(splats, &self.views[view].camera)?;
        let now = raster.forward(&mut prepared, splats, &[], &params)?.rgb_image();
        let View { camera, width, height, original, target, .. } = &self.views[view];
        let image = |data: &[f32]| Image {
            width: *width,
            height: *height,
            channels: 3,
            data: data.to_vec(),
        };
        Ok(FitPreview {
            name: camera.name.clone(),
            original: image(original),
            target: image(target),
            now,
        })
    }

    /// Removes splats that contradict the pictures, clones and splits others (if geometry is
    /// fitted), and selects splats that became visible.
    fn densify(&mut self, step: usize) -> Result<(), FitError> {
        self.carve()?;
        if step as f64 >= FADE_UNTIL * self.options.steps as f64 {
            self.working.fading.fill(false);
        }
        if self.options.geometry {
            self.working.densify(self.options.seed ^ (0x5_0000_0000 + step as u64));
        }
        self.select_more()?;
        self.reach();
        self.release()
    }

    /// Selects splats that are now mainly visible in the masks.
    pub(crate) fn select_more(&mut self) -> Result<(), FitError> {
        let votes = vote(self.raster, &self.working.splats, &self.views)?;
        self.working.select_more(&votes, self.options.vote);
        let hidden = votes.hidden(&self.working.selected);
        for (was, is) in self.working.hidden.iter_mut().zip(hidden) {
            *was &= is;
        }
        Ok(())
    }

    /// Finds the pixels that the selection can change in each view, and the splats on which these
    /// pixels depend.
    pub(crate) fn reach(&mut self) {
        let (raster, working) = (self.raster, &self.working);
        let rows = working.rows();
        self.views.par_iter_mut().for_each(|view| {
            let mut tiles = TileSet::around(&view.mask, view.width, view.height);
            for &row in &rows {
                if let Some(footprint) = raster.footprint(&working.splats, row, &view.camera) {
                    tiles.insert(footprint.pixels);
                }
            }
            view.tiles = tiles.grown(REACH_MARGIN);
        });
        self.find_rows();
    }

    /// Finds the splats on which the pixels of each view's tiles depend.
    fn find_rows(&mut self) {
        let (raster, working) = (self.raster, &self.working);
        self.views.par_iter_mut().for_each(|view| view.find_rows(raster, working));
    }

    /// Registers the pictures to the current render.
    fn align(&mut self, step: usize) -> Result<(), FitError> {
        let params = self.params();
        let mut output = RenderOutput::default();
        for &v in &self.edited.clone() {
            self.render(v, &params, &mut output)?;
            let view = &mut self.views[v];
            if step > ALIGN_FROM + NUM_ESTIMATES * ALIGN_EVERY {
                view.measure_noise(&output.rgb);
            }
            let mut alignment = std::mem::take(&mut view.alignment);
            let radius =
                self.local_radius(step, v).filter(|_| self.working.aligning == Aligning::Local);
            let view = &self.views[v];
            alignment.estimate(view.as_picture(), &output.rgb, &view.changed, radius);
            self.views[v].alignment = alignment;
        }
        let centre = self.centre();
        let mut alignments: Vec<_> =
            self.edited.iter().map(|&v| std::mem::take(&mut self.views[v].alignment)).collect();
        let cameras: Vec<&Camera> = self.edited.iter().map(|&v| &self.views[v].camera).collect();
        let reference = self
            .options
            .reference
            .and_then(|reference| self.edited.iter().position(|&v| v == reference));
        remove_common(&mut alignments, &cameras, centre, reference);
        let is_last = step == ALIGN_FROM + NUM_ESTIMATES * ALIGN_EVERY;
        // Gains also compensate colours that are not fitted yet, so pictures that agree can appear
        // to disagree at first.
        if is_last || self.working.aligning == Aligning::Whole {
            self.working.aligning = needed(&alignments);
            for alignment in &mut alignments {
                match self.working.aligning {
                    Aligning::Nothing => *alignment = Alignment::default(),
                    Aligning::Whole => alignment.local.clear(),
                    Aligning::Local => {}
                }
            }
        }
        for (&v, alignment) in self.edited.iter().zip(alignments) {
            self.views[v].alignment = alignment;
            self.views[v].retarget();
        }
        Ok(())
    }

    /// Half the width of the windows of local registration, pixels: `None` at first, then
    /// decreasing.
    fn local_radius(&self, step: usize, view: usize) -> Option<usize> {
        let done = step as f64 / self.options.steps as f64;
        let side = self.views[view].width.max(self.views[view].height);
        match done {
            _ if step == ALIGN_FROM => None,
            ..0.5 => Some(side / 20),
            _ => Some(side / 32),
        }
    }

    /// Mean of the selected centres.
    fn centre(&self) -> [f64; 3] {
        let rows = self.working.rows();
        let mut sum = [0.0; 3];
        for &row in &rows {
            for (sum, &x) in sum.iter_mut().zip(&self.working.splats.means[row]) {
                *sum += f64::from(x);
            }
        }
        sum.map(|x| x / rows.len().max(1) as f64)
    }
}
