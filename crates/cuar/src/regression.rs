//! The regression solver: see [`crate::RegressionParams`].

use crate::{
    CuarError, Entry, RegressionParams,
    evaluator::Derivatives,
    normal_equations::{NormalEquations, Observation},
    problem::{Problem, TracePoint, Watch},
    state::State,
};
use gs_core::Rasterizer;

/// Observations of the image just evaluated. `changes` are the current changes of colour,
/// `color_grads` gradient and curvature.
fn observations(
    entries: &[Entry],
    changes: &[[f32; 3]],
    color_grads: &[[f32; 4]],
    relaxation: f32,
) -> Vec<Observation> {
    let observation =
        |((entry, change), &[red, green, blue, weight]): ((&Entry, &[f32; 3]), &[f32; 4])| {
            if weight.is_nan() || weight <= 0.0 || !entry.is_constrained {
                return [0.0; 4];
            }
            let mut observation = [0.0, 0.0, 0.0, weight];
            for (channel, slope) in [red, green, blue].into_iter().enumerate() {
                let color = entry.color[channel];
                observation[channel] = if color + change[channel] >= 0.0 {
                    change[channel] - relaxation * slope / weight
                } else if slope < 0.0 {
                    // clamped to 0 with a gradient towards a brighter colour: start at 0
                    -color - relaxation * slope / weight
                } else {
                    change[channel]
                };
            }
            if observation.iter().all(|value| value.is_finite()) { observation } else { [0.0; 4] }
        };
    entries.iter().zip(changes).zip(color_grads).map(observation).collect()
}

/// Current state of a run.
#[derive(Clone)]
pub(crate) struct Regression {
    pub d_sh: Vec<[f32; 3]>,
    /// Mean losses without offsets, exact and smooth; known after the first pass.
    pub before: [f64; 2],
    /// Sums over the pass so far.
    normals: NormalEquations,
    losses: [f64; 2],
    /// Smoothed loss of the previous pass.
    last: f64,
    /// Weight of each entry in the samples of the edited frame, for the term that keeps its colour.
    frame_weights: Vec<Vec<f32>>,
    /// Largest weight of each splat over images of other times in the first pass, `[E]`.
    peaks: Vec<f32>,
    /// The part of each row's weight from the edited frame that exceeds that of an ordinary
    /// observation, `[E]`.
    anchor_weights: Vec<f64>,
    /// Number of evaluations so far.
    step: usize,
}

impl Regression {
    pub(crate) fn new<R: Rasterizer>(problem: &Problem<R>) -> Self {
        let coeffs = gs_core::sh::num_coeffs(problem.sh_degree);
        let later = problem.samples.len() - problem.num_first;
        Self {
            d_sh: vec![[0.0; 3]; problem.num_rows * coeffs],
            before: [0.0; 2],
            normals: NormalEquations::new(problem.num_rows, coeffs),
            losses: [0.0; 2],
            last: f64::INFINITY,
            frame_weights: problem.samples[later..]
                .iter()
                .map(|s| vec![0.0; s.entries.len()])
                .collect(),
            peaks: vec![0.0; problem.num_rows],
            anchor_weights: vec![0.0; problem.num_rows],
            step: 0,
        }
    }

    pub(crate) fn resume<R: Rasterizer>(
        problem: &Problem<R>,
        state: &State,
    ) -> Result<Self, CuarError> {
        let mut own = Self::new(problem);
        let flat = state.array("d_sh", own.d_sh.len() * 3)?;
        own.d_sh = flat.as_chunks::<3>().0.to_vec();
        let mut flat =
            state.array("frame_weights", own.frame_weights.iter().map(Vec::len).sum())?;
        for weights in &mut own.frame_weights {
            let (head, tail) = flat.split_at(weights.len());
            weights.copy_from_slice(head);
            flat = tail;
        }
        let NormalEquations { gram, right, .. } = &mut own.normals;
        *gram = state.double("gram", gram.len())?.to_vec();
        *right = state.double("right", right.len())?.to_vec();
        own.peaks = state.array("peaks", own.peaks.len())?.to_vec();
        own.anchor_weights = state.double("anchor_weights", own.anchor_weights.len())?.to_vec();
        let losses = state.double("losses", 5)?;
        own.before.copy_from_slice(&losses[..2]);
        own.losses.copy_from_slice(&losses[2..4]);
        own.last = losses[4];
        own.step = usize::try_from(state.step).unwrap_or(usize::MAX);
        Ok(own)
    }

    fn state(&self, fingerprint: u64) -> State {
        let named = |name: &str, values: Vec<f32>| (name.to_owned(), values);
        let doubles = |name: &str, values: &[f64]| (name.to_owned(), values.to_vec());
        let losses = [self.before.as_slice(), &self.losses, &[self.last]].concat();
        State {
            fingerprint,
            step: self.step as u64,
            arrays: vec![
                named("d_sh", self.d_sh.concat()),
                named("frame_weights", self.frame_weights.concat()),
                named("peaks", self.peaks.clone()),
            ],
            doubles: vec![
                doubles("anchor_weights", &self.anchor_weights),
                doubles("gram", &self.normals.gram),
                doubles("right", &self.normals.right),
                doubles("losses", &losses),
            ],
        }
    }

    /// Fits the last observations with a different smoothness.
    pub(crate) fn refit<R: Rasterizer>(
        &self,
        problem: &Problem<R>,
        params: &RegressionParams,
    ) -> Vec<[f32; 3]> {
        let mut d_sh = vec![[0.0; 3]; self.d_sh.len()];
        self.normals.solve(
            params,
            &problem.base_sh,
            &problem.uncertain_shares,
            &self.anchor_weights,
            &mut d_sh,
        );
        d_sh
    }

    /// Runs to the last pass, or to the first that lowers the loss by less than [`MIN_GAIN`].
    pub(crate) fn run<R: Rasterizer<Prepared: Send> + Sync>(
        &mut self,
        problem: &mut Problem<R>,
        params: &RegressionParams,
        fingerprint: u64,
        watch: &mut Watch,
        trace: &mut Vec<TracePoint>,
    ) -> Result<(), CuarError> {
        let count = problem.samples.len();
        while self.step < params.passes * count {
            let (pass, within) = (self.step / count, self.step % count);
            if within == 0 {
                self.normals.clear();
                self.losses = [0.0; 2];
            }
            let group = problem.group(within);
            let first = within >= count - problem.num_first && params.anchor_weight > 0.0;
            let derivatives = if first && pass > 0 {
                Derivatives::Loss(params.delta)
            } else {
                Derivatives::Curvature(params.delta)
            };
            for parts in problem.evaluate(group.clone(), &self.d_sh, derivatives)? {
                self.losses[0] += parts.total(problem.options.weights);
                self.losses[1] += parts.shaped_total(problem.options.weights);
            }
            if derivatives != Derivatives::Loss(params.delta) {
                for (lane, s) in group.clone().enumerate() {
                    self.observe(problem, params, s, lane, first);
                }
            }
            self.step += group.len();
            let done = group.end as f64;
            watch.step(self.step, Some(self.losses[0] / done));
            watch.preview(|| Ok(problem.preview(group.start, 0)))?;
            if group.end == count {
                let loss = self.losses.map(|sum| sum / done);
                trace.push(TracePoint {
                    secs: watch.elapsed(),
                    step: self.step as u64,
                    loss: loss[0],
                });
                if pass == 0 {
                    self.before = loss;
                    self.weigh_anchors(problem, params);
                }
                self.fit(problem, params);
                if loss[1] > (1.0 - MIN_GAIN) * self.last {
                    self.step = params.passes * count;
                }
                self.last = loss[1];
            }
            watch.checkpoint(|| Ok(self.state(fingerprint)))?;
        }
        Ok(())
    }

    /// Adds the observations of sample `s`, evaluated in `lane`.
    fn observe<R: Rasterizer>(
        &mut self,
        problem: &Problem<R>,
        params: &RegressionParams,
        s: usize,
        lane: usize,
        first: bool,
    ) {
        let entries = &problem.samples[s].entries;
        let work = &problem.lanes[lane];
        if first {
            let later = problem.samples.len() - problem.num_first;
            for (weight, color_grad) in
                self.frame_weights[s - later].iter_mut().zip(&work.color_grads)
            {
                *weight = if color_grad[3].is_finite() { color_grad[3].max(0.0) } else { 0.0 };
            }
            return;
        }
        #[expect(clippy::cast_possible_truncation, reason = "observations are single precision")]
        let relaxation = params.relaxation as f32;
        let observed = observations(entries, &work.changes, &work.color_grads, relaxation);
        self.normals.add(problem.sh_degree, entries, &observed);
        if self.step < problem.samples.len() {
            for (entry, observation) in entries.iter().zip(&observed) {
                let peak = &mut self.peaks[entry.row as usize];
                *peak = peak.max(observation[3]);
            }
        }
    }

    /// Sets the weights of the terms that keep the colours of the edited frame; they are low for
    /// splats that are barely visible there.
    fn weigh_anchors<R: Rasterizer>(&mut self, problem: &Problem<R>, params: &RegressionParams) {
        if params.anchor_weight <= 0.0 {
            return;
        }
        let later = problem.samples.len() - problem.num_first;
        #[expect(clippy::cast_possible_truncation, reason = "weights are single precision")]
        let anchor_weight = params.anchor_weight as f32;
        for (weights, sample) in self.frame_weights.iter_mut().zip(&problem.samples[later..]) {
            for (anchored, entry) in weights.iter_mut().zip(&sample.entries) {
                let row = entry.row as usize;
                let peak = self.peaks[row].max(*anchored);
                if peak > 0.0 {
                    let weight = *anchored;
                    *anchored *= anchor_weight * (weight / (VISIBLE_SHARE * peak)).min(1.0);
                    self.anchor_weights[row] += f64::from((*anchored - weight).max(0.0));
                }
            }
        }
    }

    /// Ends a pass: every splat's least-squares fit.
    fn fit<R: Rasterizer>(&mut self, problem: &Problem<R>, params: &RegressionParams) {
        let later = problem.samples.len() - problem.num_first;
        if params.anchor_weight > 0.0 {
            for (weights, sample) in self.frame_weights.iter().zip(&problem.samples[later..]) {
                let observed: Vec<Observation> =
                    weights.iter().map(|&w| [0.0, 0.0, 0.0, w]).collect();
                self.normals.add(problem.sh_degree, &sample.entries, &observed);
            }
        }
        let (base, uncertain_shares) = (&problem.base_sh, &problem.uncertain_shares);
        self.normals.solve(params, base, uncertain_shares, &self.anchor_weights, &mut self.d_sh);
    }
}

/// Share of a splat's largest weight in any image, from which it counts as visible in the edited
/// frame. Hidden splats have a small weight there, too.
const VISIBLE_SHARE: f32 = 0.025;

/// A pass that lowers the loss by less than this share is the last.
const MIN_GAIN: f64 = 0.005;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clamped_colours_can_become_positive_again() {
        let entries = [Entry {
            local: 0,
            row: 0,
            towards: [0.0, 0.0, 1.0],
            color: [-0.5, -0.5, 0.5],
            is_constrained: true,
        }];
        let observed = observations(&entries, &[[0.0; 3]], &[[-1.0, 1.0, 1.0, 10.0]], 1.0);
        let expected = [0.6, 0.0, -0.1, 10.0]; // up from 0; unchanged; down
        for (ours, theirs) in observed[0].iter().zip(expected) {
            assert!((ours - theirs).abs() < 1e-6, "{observed:?}");
        }
    }
}
