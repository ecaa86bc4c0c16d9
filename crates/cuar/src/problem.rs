//! All supervised images together.

use crate::{
    CuarError, RefineOptions, Solver,
    loss::LossParts,
    sample::{Crop, Sample},
    state::{Observer, Preview, Progress, State},
    visit::{Ask, Offsets, Work},
};
use gs_core::{Camera, Image, Rasterizer};
use std::time::Instant;

/// Images, their rasteriser and the shape of what is refined.
pub(crate) struct Problem<'a, R: Rasterizer> {
    pub raster: &'a R,
    pub options: &'a RefineOptions,
    pub cameras: &'a [Camera],
    pub samples: Vec<Sample<R::Prepared>>,
    pub work: Work<R::Prepared>,
    /// `E`, edited splats.
    pub num_rows: usize,
    pub sh_degree: usize,
    /// SH of the edited splats at the edited frame, `[E,K,3]`.
    pub base_sh: Vec<[f32; 3]>,
    /// Share of the images in which each edited splat's colour is uncertain, `[E]`.
    pub doubts: Vec<f32>,
    /// Bytes of samples and of the prepared states kept with them.
    pub bytes: usize,
    /// Samples whose prepared state is kept.
    pub num_cached: usize,
}

impl<R: Rasterizer> Problem<'_, R> {
    /// `K`.
    pub(crate) fn coeffs(&self) -> usize {
        gs_core::sh::num_coeffs(self.sh_degree)
    }

    /// Prepares as many samples for good as the budget allows.
    pub(crate) fn cache(&mut self) -> Result<(), CuarError> {
        self.bytes = self.samples.iter().map(Sample::bytes).sum();
        self.num_cached = 0;
        for sample in &mut self.samples {
            let camera = &self.cameras[sample.at.view];
            let more = sample.prepared_bytes(camera);
            if self.bytes + more > self.options.memory {
                break;
            }
            sample.prepared = Some(self.raster.prepare(&sample.splats, camera)?);
            self.bytes += more;
            self.num_cached += 1;
        }
        Ok(())
    }

    /// Visits sample `s`.
    pub(crate) fn visit(&mut self, s: usize, d: Deltas, ask: Ask) -> Result<LossParts, CuarError> {
        let offsets = Offsets { d_sh: d.sh, sh_degree: self.sh_degree, d_logits: d.logits };
        let sample = &mut self.samples[s];
        let camera = &self.cameras[sample.at.view];
        self.work.visit(self.raster, sample, camera, offsets, self.options, ask)
    }

    /// Eq. 20, mean over the samples (0 without any): as it is, and as the solver smooths it.
    pub(crate) fn loss(
        &mut self,
        d: Deltas,
        mut tick: impl FnMut(usize) -> Result<(), CuarError>,
    ) -> Result<[f64; 2], CuarError> {
        let delta = match &self.options.solver {
            Solver::Regression(params) => params.delta,
            Solver::Adam(_) => 0.0,
        };
        let mut sums = [0.0; 2];
        for s in 0..self.samples.len() {
            let parts = self.visit(s, d, Ask::Loss(delta))?;
            sums[0] += parts.total(self.options.weights);
            sums[1] += parts.shaped_total(self.options.weights);
            tick(s)?;
        }
        Ok(sums.map(|sum| sum / self.samples.len().max(1) as f64))
    }

    /// How the sample visited last looks.
    pub(crate) fn preview(&self, s: usize) -> Preview {
        let sample = &self.samples[s];
        let Crop { x, y, width, height } = sample.crop;
        let image = |data: &[f32], channels| Image { width, height, channels, data: data.to_vec() };
        Preview {
            view: sample.at.view,
            time: sample.at.time,
            origin: [x, y],
            before: image(&sample.original, 3),
            now: image(&self.work.render, 3),
            target: image(&sample.warp, 3),
            mask: image(&sample.fore(), 1),
        }
    }
}

/// What is refined: offsets of SH (`[E,K,3]`) and logits (`[E]`).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Deltas<'a> {
    pub sh: &'a [[f32; 3]],
    pub logits: &'a [f32],
}

/// One point of the loss curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracePoint {
    /// Since the solver began.
    pub secs: f64,
    /// Steps done.
    pub step: u64,
    /// Eq. 20, mean over the last visit of every image (so a little behind the present).
    pub loss: f64,
}

/// Progress, previews, checkpoints and cancelling of one stage.
pub(crate) struct Watch<'a> {
    observer: &'a mut dyn Observer,
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
        observer: &'a mut dyn Observer,
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

    /// Says that `done` steps are done.
    pub(crate) fn step(&mut self, done: usize, loss: Option<f64>) {
        let elapsed_secs = self.elapsed();
        let since = done.saturating_sub(self.first);
        let eta_secs = (since > 0)
            .then(|| elapsed_secs / since as f64 * self.total.saturating_sub(done) as f64);
        let (stage, total) = (self.stage, self.total);
        self.observer.progress(&Progress { stage, done, total, loss, elapsed_secs, eta_secs });
    }

    pub(crate) fn preview(&mut self, make: impl FnOnce() -> Preview) {
        let due = |secs: f64| self.previewed.elapsed().as_secs_f64() >= secs;
        if self.preview_secs.is_some_and(due) {
            self.observer.preview(&make());
            self.previewed = Instant::now();
        }
    }

    /// Stores the state if it is time; ends the run if that is wished.
    pub(crate) fn checkpoint(&mut self, make: impl FnOnce() -> State) -> Result<(), CuarError> {
        let due = |secs: f64| self.saved.elapsed().as_secs_f64() >= secs;
        let cancelled = self.observer.cancelled();
        if cancelled || self.checkpoint_secs.is_some_and(due) {
            let state = make();
            self.observer.checkpoint(&state);
            self.saved = Instant::now();
            if cancelled {
                return Err(CuarError::Cancelled { step: state.step });
            }
        }
        Ok(())
    }

    /// For stages that keep no state.
    pub(crate) fn stop_if_cancelled(&mut self) -> Result<(), CuarError> {
        if self.observer.cancelled() { Err(CuarError::Cancelled { step: 0 }) } else { Ok(()) }
    }
}
