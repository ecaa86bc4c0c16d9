//! The Adam solver.

use crate::{
    Adam, AdamParams, CuarError,
    plan::SplitMix,
    problem::{Deltas, Problem, TracePoint, Watch},
    state::State,
    visit::Ask,
};
use gs_core::{Rasterizer, sh};

/// Where a run stands.
pub(crate) struct Descent {
    pub d_sh: Vec<[f32; 3]>,
    pub d_logits: Vec<f32>,
    adam: Adam<f32>,
    adam_logits: Adam<f32>,
    losses: Vec<f64>,
}

impl Descent {
    pub(crate) fn new<R: Rasterizer<Prepared: Send> + Sync>(problem: &Problem<R>) -> Self {
        let len = problem.num_rows * problem.coeffs();
        let num_logits = if problem.options.opacity { problem.num_rows } else { 0 };
        Self {
            d_sh: vec![[0.0; 3]; len],
            d_logits: vec![0.0; problem.num_rows],
            adam: Adam::new(len * 3),
            adam_logits: Adam::new(num_logits),
            losses: vec![f64::NAN; problem.samples.len()],
        }
    }

    pub(crate) fn resume<R: Rasterizer<Prepared: Send> + Sync>(
        problem: &Problem<R>,
        state: &State,
    ) -> Result<Self, CuarError> {
        let mut own = Self::new(problem);
        own.d_sh = state.array("d_sh", own.d_sh.len() * 3)?.as_chunks::<3>().0.to_vec();
        own.d_logits = state.array("d_logits", own.d_logits.len())?.to_vec();
        for (name, adam) in [("sh", &mut own.adam), ("logits", &mut own.adam_logits)] {
            adam.m = state.array(&format!("{name}_m"), adam.m.len())?.to_vec();
            adam.v = state.array(&format!("{name}_v"), adam.v.len())?.to_vec();
            adam.step = state.step;
        }
        Ok(own)
    }

    fn state(&self, fingerprint: u64) -> State {
        let named = |name: &str, values: &[f32]| (name.to_owned(), values.to_vec());
        State {
            fingerprint,
            step: self.adam.step,
            arrays: vec![
                ("d_sh".to_owned(), self.d_sh.concat()),
                named("d_logits", &self.d_logits),
                named("sh_m", &self.adam.m),
                named("sh_v", &self.adam.v),
                named("logits_m", &self.adam_logits.m),
                named("logits_v", &self.adam_logits.v),
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
        let rates: Vec<f32> = (0..coeffs * 3)
            .map(|column| if column < 3 { params.rate_dc } else { params.rate_rest })
            .collect();
        let mut gradient = vec![0.0_f32; self.d_sh.len() * 3];
        let mut v_logits = vec![0.0_f32; self.adam_logits.m.len()];
        let opacity = problem.options.opacity;
        let ask = if opacity { Ask::Everything } else { Ask::Gradient };
        for step in usize::try_from(self.adam.step).unwrap_or(usize::MAX)..params.steps {
            let (epoch, within) = (step / count, step % count);
            let s = SplitMix(problem.options.seed ^ (epoch as u64 + 1)).order(count)[within];
            let d = Deltas { sh: &self.d_sh, logits: &self.d_logits };
            let parts = problem.visit(s..s + 1, d, ask)?.pop().unwrap_or_default();
            gradient.fill(0.0);
            v_logits.fill(0.0);
            let (work, entries) = (&problem.lanes[0], &problem.samples[s].entries);
            for (k, entry) in entries.iter().enumerate() {
                let (row, local) = (entry.row as usize, entry.local as usize);
                let out = &mut gradient[row * coeffs * 3..(row + 1) * coeffs * 3];
                if opacity {
                    let grads = work.grads();
                    out.copy_from_slice(grads.v_sh[local * coeffs..][..coeffs].as_flattened());
                    v_logits[row] = grads.v_opacity_logits[local];
                    continue;
                }
                let basis = sh::basis(problem.sh_degree, entry.towards);
                for channel in 0..3 {
                    // a colour clamped at 0 has no derivative
                    if entry.color[channel] + work.changes[k][channel] >= 0.0 {
                        for (i, value) in basis.iter().take(coeffs).enumerate() {
                            out[i * 3 + channel] = value * work.answers[k][channel];
                        }
                    }
                }
            }
            self.adam.step(self.d_sh.as_flattened_mut(), &gradient, &rates, |_| false);
            if opacity {
                let rate = [params.rate_opacity];
                self.adam_logits.step(&mut self.d_logits, &v_logits, &rate, |_| false);
            }
            self.losses[s] = parts.total(problem.options.weights);
            let known: Vec<f64> = self.losses.iter().copied().filter(|l| !l.is_nan()).collect();
            let loss = known.iter().sum::<f64>() / known.len().max(1) as f64;
            if within + 1 == count || step + 1 == params.steps {
                trace.push(TracePoint { secs: watch.elapsed(), step: self.adam.step, loss });
            }
            watch.step(step + 1, Some(loss));
            watch.preview(|| problem.preview(s, 0));
            watch.checkpoint(|| self.state(fingerprint))?;
        }
        Ok(())
    }
}
