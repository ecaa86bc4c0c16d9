//! The Adam solver.

use crate::{
    AdamParams, CuarError, DescentEngine, DescentTask,
    evaluator::Derivatives,
    problem::{Problem, TracePoint, Watch},
    state::State,
};
use gs_core::{Rasterizer, SplitMix64, sh};
use gs_fit::Adam;
use std::time::{Duration, Instant};

/// Minimum time between reads of the engine's losses within a pass over the images; reading waits
/// for the device.
const READ_INTERVAL: Duration = Duration::from_millis(250);

/// Current state of a run.
pub(crate) struct Descent {
    pub d_sh: Vec<[f32; 3]>,
    adam: Adam<f32>,
    losses: Vec<f64>,
}

impl Descent {
    pub(crate) fn new<R: Rasterizer<Prepared: Send> + Sync>(problem: &Problem<R>) -> Self {
        let len = problem.num_rows * problem.coeffs();
        Self {
            d_sh: vec![[0.0; 3]; len],
            adam: Adam::new(len * 3),
            losses: vec![f64::NAN; problem.samples.len()],
        }
    }

    pub(crate) fn resume<R: Rasterizer<Prepared: Send> + Sync>(
        problem: &Problem<R>,
        state: &State,
    ) -> Result<Self, CuarError> {
        let mut own = Self::new(problem);
        own.d_sh = state.array("d_sh", own.d_sh.len() * 3)?.as_chunks::<3>().0.to_vec();
        own.adam.m = state.array("sh_m", own.adam.m.len())?.to_vec();
        own.adam.v = state.array("sh_v", own.adam.v.len())?.to_vec();
        own.adam.step = state.step;
        Ok(own)
    }

    fn state(&self, fingerprint: u64) -> State {
        let named = |name: &str, values: &[f32]| (name.to_owned(), values.to_vec());
        State {
            fingerprint,
            step: self.adam.step,
            arrays: vec![
                ("d_sh".to_owned(), self.d_sh.concat()),
                named("sh_m", &self.adam.m),
                named("sh_v", &self.adam.v),
            ],
            doubles: Vec::new(),
        }
    }

    /// Runs to the last step.
    pub(crate) fn run<R: Rasterizer<Prepared: Send> + Sync>(
        &mut self,
        problem: &mut Problem<R>,
        params: &AdamParams,
        fingerprint: u64,
        watch: &mut Watch,
        trace: &mut Vec<TracePoint>,
    ) -> Result<(), CuarError> {
        let count = problem.samples.len();
        let coeffs = problem.coeffs();
        let rates = rates(params, coeffs);
        let mut gradient = vec![0.0_f32; self.d_sh.len() * 3];
        for step in usize::try_from(self.adam.step).unwrap_or(usize::MAX)..params.steps {
            let s = image_of_step(problem.options.seed, step, count);
            let evaluated = problem.evaluate(s..s + 1, &self.d_sh, Derivatives::Gradient)?;
            let parts = evaluated.into_iter().next().unwrap_or_default();
            gradient.fill(0.0);
            let (work, entries) = (&problem.lanes[0], &problem.samples[s].entries);
            for (k, entry) in entries.iter().enumerate() {
                let row = entry.row as usize;
                let out = &mut gradient[row * coeffs * 3..(row + 1) * coeffs * 3];
                let basis = sh::basis(problem.sh_degree, entry.towards);
                for channel in 0..3 {
                    // a colour clamped at 0 has no derivative
                    if entry.color[channel] + work.changes[k][channel] >= 0.0 {
                        for (i, value) in basis.iter().take(coeffs).enumerate() {
                            out[i * 3 + channel] = value * work.color_grads[k][channel];
                        }
                    }
                }
            }
            let rows = (0..gradient.len() / rates.len()).map(|row| [row, row]);
            self.adam.step(self.d_sh.as_flattened_mut(), &gradient, &rates, rows);
            self.losses[s] = parts.total(problem.options.weights);
            let loss = self.loss();
            if ends_pass(step, count, params.steps) {
                trace.push(TracePoint { secs: watch.elapsed(), step: self.adam.step, loss });
            }
            watch.step(step + 1, Some(loss));
            watch.preview(|| Ok(problem.preview(s, 0)))?;
            watch.checkpoint(|| Ok(self.state(fingerprint)))?;
        }
        Ok(())
    }

    /// As [`Descent::run`], with every step executed by `engine`. Losses are read at intervals;
    /// offsets and moments at checkpoints and at the end.
    pub(crate) fn run_on<R: Rasterizer<Prepared: Send> + Sync>(
        &mut self,
        engine: &mut dyn DescentEngine<R::Prepared>,
        problem: &mut Problem<R>,
        params: &AdamParams,
        fingerprint: u64,
        watch: &mut Watch,
        trace: &mut Vec<TracePoint>,
    ) -> Result<(), CuarError> {
        let (count, weights) = (problem.samples.len(), problem.options.weights);
        let rates = rates(params, problem.coeffs());
        let memory = problem.options.memory.saturating_sub(problem.bytes);
        let task = DescentTask { sh_degree: problem.sh_degree, rates: &rates, weights, memory };
        engine.begin(&task, &self.d_sh, &self.adam)?;
        let mut pending = Vec::new();
        let mut last_read = Instant::now();
        for step in usize::try_from(self.adam.step).unwrap_or(usize::MAX)..params.steps {
            let s = image_of_step(problem.options.seed, step, count);
            let (raster, sample) = (problem.raster, &mut problem.samples[s]);
            let camera = &problem.cameras[sample.at.view];
            problem.lanes[0].step_on(engine, raster, (s, sample), camera)?;
            self.adam.step += 1;
            pending.push(s);
            let ends_pass = ends_pass(step, count, params.steps);
            if ends_pass || last_read.elapsed() >= READ_INTERVAL {
                for (s, parts) in pending.drain(..).zip(engine.losses()?) {
                    self.losses[s] = parts.total(weights);
                }
                last_read = Instant::now();
            }
            let loss = self.loss();
            if ends_pass {
                trace.push(TracePoint { secs: watch.elapsed(), step: self.adam.step, loss });
            }
            watch.step(step + 1, Some(loss).filter(|loss| !loss.is_nan()));
            watch.preview(|| {
                problem.lanes[0].render = engine.render()?;
                Ok(problem.preview(s, 0))
            })?;
            watch.checkpoint(|| {
                engine.read(&mut self.d_sh, &mut self.adam)?;
                Ok(self.state(fingerprint))
            })?;
        }
        Ok(engine.read(&mut self.d_sh, &mut self.adam)?)
    }

    /// Mean over the images evaluated so far; NaN before the first.
    fn loss(&self) -> f64 {
        let known = self.losses.iter().filter(|loss| !loss.is_nan());
        known.clone().sum::<f64>() / known.count() as f64
    }
}

/// Index of the image of a step. Every pass over the images has a different order.
fn image_of_step(seed: u64, step: usize, count: usize) -> usize {
    SplitMix64::new(seed ^ ((step / count) as u64 + 1)).order(count)[step % count]
}

/// Whether a pass over the images, or the run, ends with this step.
fn ends_pass(step: usize, count: usize, steps: usize) -> bool {
    (step + 1).is_multiple_of(count) || step + 1 == steps
}

/// One rate per column of the offsets.
fn rates(params: &AdamParams, coeffs: usize) -> Vec<f32> {
    let rate = |column| if column < 3 { params.rate_dc } else { params.rate_rest };
    (0..coeffs * 3).map(rate).collect()
}
