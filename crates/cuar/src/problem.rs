//! All supervised images together.

use crate::{
    Crop, CuarError, RefineOptions, Solver,
    evaluator::{Derivatives, Evaluator, Offsets},
    loss::LossParts,
    observer::{Preview, RefineObserver, RefineProgress},
    sample::{Sample, live_tiles},
    state::State,
    view_sampler::ViewTime,
};
use gs_core::{Camera, Image, Rasterizer};
use rayon::prelude::*;
use std::ops::Range;
use std::time::Instant;

/// Images, their rasteriser, and the shape of the unknowns.
pub(crate) struct Problem<'a, R: Rasterizer> {
    pub raster: &'a R,
    pub options: &'a RefineOptions,
    pub cameras: &'a [Camera],
    /// All samples; those of the edited frame come last.
    pub samples: Vec<Sample<R::Prepared>>,
    /// Number of samples of the edited frame.
    pub num_first: usize,
    /// One evaluator per sample that is evaluated concurrently. Results do not depend on their
    /// number.
    pub lanes: Vec<Evaluator<R::Prepared>>,
    /// `E`, edited splats.
    pub num_rows: usize,
    pub sh_degree: usize,
    /// SH of the edited splats at the edited frame, `[E,K,3]`.
    pub base_sh: Vec<[f32; 3]>,
    /// Share of the images in which each edited splat's colour is uncertain, `[E]`.
    pub uncertain_shares: Vec<f32>,
    /// Bytes of samples and of the prepared states kept with them.
    pub bytes: usize,
    /// Samples whose prepared state is kept.
    pub num_cached: usize,
}

/// Bytes of an [`Evaluator`] per pixel, roughly.
const LANE_BYTES: usize = 120;
/// Maximum number of samples evaluated at once; one evaluation also uses several threads.
const MAX_LANES: usize = 8;

/// Number of images evaluated at once, within a quarter of `memory`.
pub(crate) fn num_lanes(cameras: &[Camera], memory: usize) -> usize {
    let pixels = |camera: &Camera| camera.width as usize * camera.height as usize;
    let each = cameras.iter().map(pixels).max().unwrap_or(0) * LANE_BYTES;
    rayon::current_num_threads().min(memory / 4 / each.max(1)).clamp(1, MAX_LANES)
}

impl<R: Rasterizer<Prepared: Send> + Sync> Problem<'_, R> {
    /// `K`.
    pub(crate) fn coeffs(&self) -> usize {
        gs_core::sh::num_coeffs(self.sh_degree)
    }

    /// Prepares as many samples as the budget allows, and stores their prepared states.
    pub(crate) fn cache(&mut self) -> Result<(), CuarError> {
        let pixels = |camera: &Camera| camera.width as usize * camera.height as usize;
        let largest = self.cameras.iter().map(pixels).max().unwrap_or(0);
        self.bytes = self.samples.iter().map(Sample::bytes).sum();
        self.bytes += self.lanes.len() * largest * LANE_BYTES;
        self.num_cached = 0;
        for sample in &mut self.samples {
            let camera = &self.cameras[sample.at.view];
            let more = sample.prepared_bytes(camera);
            if self.bytes + more > self.options.memory {
                break;
            }
            let tiles = live_tiles(sample.crop, &sample.flags, camera);
            sample.prepared = Some(self.raster.prepare_tiles(&sample.splats, camera, &tiles)?);
            self.bytes += more;
            self.num_cached += 1;
        }
        Ok(())
    }

    /// Evaluates the samples `range` with the offsets `d_sh` (`[E,K,3]`), each with its own
    /// evaluator.
    pub(crate) fn evaluate(
        &mut self,
        range: Range<usize>,
        d_sh: &[[f32; 3]],
        derivatives: Derivatives,
    ) -> Result<Vec<LossParts>, CuarError> {
        let offsets = Offsets { d_sh, sh_degree: self.sh_degree };
        let Self { raster, options, cameras, samples, lanes, .. } = self;
        let evaluate = |(sample, work): (&mut Sample<R::Prepared>, &mut Evaluator<R::Prepared>)| {
            work.evaluate(*raster, sample, &cameras[sample.at.view], offsets, options, derivatives)
        };
        samples[range].par_iter_mut().zip(lanes.par_iter_mut()).map(evaluate).collect()
    }

    /// The next samples from `first` on that can be evaluated at once.
    pub(crate) fn group(&self, first: usize) -> Range<usize> {
        // samples of the edited frame separately: they need other derivatives
        let later = self.samples.len() - self.num_first;
        let end = if first < later { later } else { self.samples.len() };
        first..end.min(first + self.lanes.len())
    }

    /// Eq. 20, mean over the samples (0 without any): exact, smoothed, and its foreground part.
    pub(crate) fn loss(
        &mut self,
        d_sh: &[[f32; 3]],
        mut tick: impl FnMut(usize) -> Result<(), CuarError>,
    ) -> Result<[f64; 3], CuarError> {
        let delta = match &self.options.solver {
            Solver::Regression(params) => params.delta,
            Solver::Adam(_) => 0.0,
        };
        let mut sums = [0.0; 3];
        let mut done = 0;
        while done < self.samples.len() {
            let group = self.group(done);
            done = group.end;
            for parts in self.evaluate(group, d_sh, Derivatives::Loss(delta))? {
                sums[0] += parts.total(self.options.weights);
                sums[1] += parts.shaped_total(self.options.weights);
                sums[2] += LossParts { back_l1: 0.0, ..parts }.total(self.options.weights);
            }
            tick(done)?;
        }
        Ok(sums.map(|sum| sum / self.samples.len().max(1) as f64))
    }

    /// Sample `s` as last rendered by `lane`.
    pub(crate) fn preview(&self, s: usize, lane: usize) -> Preview {
        let sample = &self.samples[s];
        let Crop { x, y, width, height } = sample.crop;
        let image = |data: &[f32], channels| Image { width, height, channels, data: data.to_vec() };
        Preview {
            view: sample.at.view,
            time: sample.at.time,
            origin: [x, y],
            before: image(&sample.original, 3),
            now: image(&self.lanes[lane].render, 3),
            target: image(&sample.warp, 3),
            mask: image(&sample.fore(), 1),
        }
    }
}

/// One point of the loss curve.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct TracePoint {
    /// Wall-clock seconds since the solver started.
    pub secs: f64,
    /// Completed steps.
    pub step: u64,
    /// Eq. 20, mean over the last evaluation of every image; of the regression solver, before the
    /// fit that ends the pass.
    pub loss: f64,
}

/// Progress, previews, checkpoints and cancelling of one stage.
pub(crate) struct Watch<'a> {
    observer: &'a mut dyn RefineObserver,
    stage: &'static str,
    total: usize,
    begun: Instant,
    first: usize,
    previewed: Instant,
    saved: Instant,
    preview_secs: Option<f64>,
    checkpoint_secs: Option<f64>,
}

impl<'a> Watch<'a> {
    /// `first` of `total` steps were done by an earlier run.
    pub(crate) fn new(
        observer: &'a mut dyn RefineObserver,
        options: &RefineOptions,
        stage: &'static str,
        total: usize,
        first: usize,
    ) -> Self {
        let now = Instant::now();
        Self {
            observer,
            stage,
            total,
            begun: now,
            first,
            previewed: now,
            saved: now,
            preview_secs: options.preview_secs,
            checkpoint_secs: options.checkpoint_secs,
        }
    }

    pub(crate) fn elapsed(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// Reports that `done` steps are done.
    pub(crate) fn step(&mut self, done: usize, loss: Option<f64>) {
        let elapsed_secs = self.elapsed();
        let since = done.saturating_sub(self.first);
        let eta_secs = (since > 0)
            .then(|| elapsed_secs / since as f64 * self.total.saturating_sub(done) as f64);
        let (stage, total) = (self.stage, self.total);
        self.observer.progress(&RefineProgress {
            stage,
            done,
            total,
            loss,
            elapsed_secs,
            eta_secs,
        });
    }

    pub(crate) fn preview(
        &mut self,
        make: impl FnOnce() -> Result<Preview, CuarError>,
    ) -> Result<(), CuarError> {
        let due = |secs: f64| self.previewed.elapsed().as_secs_f64() >= secs;
        if self.preview_secs.is_some_and(due) {
            self.observer.preview(&make()?);
            self.previewed = Instant::now();
        }
        Ok(())
    }

    /// Passes a state to the observer if it is due; ends the run if it was cancelled.
    pub(crate) fn checkpoint(
        &mut self,
        make: impl FnOnce() -> Result<State, CuarError>,
    ) -> Result<(), CuarError> {
        let due = |secs: f64| self.saved.elapsed().as_secs_f64() >= secs;
        let cancelled = self.observer.cancelled();
        if cancelled || self.checkpoint_secs.is_some_and(due) {
            let state = make()?;
            self.observer.checkpoint(&state);
            self.saved = Instant::now();
            if cancelled {
                return Err(CuarError::Cancelled { step: state.step });
            }
        }
        Ok(())
    }

    pub(crate) fn begin_images(&mut self, fingerprint: u64) {
        self.observer.begin_images(fingerprint);
    }

    pub(crate) fn stored_image(&mut self, at: ViewTime) -> Option<Vec<u8>> {
        self.observer.stored_image(at)
    }

    pub(crate) fn store_image(&mut self, at: ViewTime, bytes: &[u8]) {
        self.observer.store_image(at, bytes);
    }

    /// Ends the run if it was cancelled, for stages without a state.
    pub(crate) fn stop_if_cancelled(&mut self) -> Result<(), CuarError> {
        if self.observer.cancelled() { Err(CuarError::Cancelled { step: 0 }) } else { Ok(()) }
    }
}
