//! The regression solver: see [`crate::RegressionParams`].

use crate::{
    CuarError, RegressionParams,
    plan::SplitMix,
    problem::{Deltas, Problem, TracePoint, Watch},
    sample::Entry,
    state::State,
    visit::Ask,
};
use gs_core::{Rasterizer, sh};
use rayon::prelude::*;

/// Rows per task.
const CHUNK: usize = 512;

/// What one image asks of one splat: change of colour (RGB, before the clamp at 0) and weight. Weight 0 asks nothing.
type Request = [f32; 4];

/// Normal equations of every splat's fit.
struct Normals {
    coeffs: usize,
    /// `Σ w Y Yᵀ`, lower triangles, `[E, K(K+1)/2]`.
    gram: Vec<f64>,
    /// `Σ w Y τ`, `[E, K, 3]`.
    right: Vec<f64>,
}

impl Normals {
    fn new(rows: usize, coeffs: usize) -> Self {
        let gram = vec![0.0; rows * coeffs * (coeffs + 1) / 2];
        Self { coeffs, gram, right: vec![0.0; rows * coeffs * 3] }
    }

    /// Replaces what one image asks (`old`) by `new`. Entries are ascending by row, each row at most once.
    fn update(&mut self, degree: usize, entries: &[Entry], old: &[Request], new: &[Request]) {
        let coeffs = self.coeffs;
        let triangle = coeffs * (coeffs + 1) / 2;
        let grams = self.gram.par_chunks_mut(CHUNK * triangle);
        let rights = self.right.par_chunks_mut(CHUNK * coeffs * 3);
        grams.zip(rights).enumerate().for_each(|(chunk, (gram, right))| {
            let first = chunk * CHUNK;
            let begin = entries.partition_point(|entry| (entry.row as usize) < first);
            let end = entries.partition_point(|entry| (entry.row as usize) < first + CHUNK);
            for k in begin..end {
                let (entry, before, now) = (&entries[k], old[k], new[k]);
                let [lost, gained] = [before[3], now[3]].map(f64::from);
                if lost == 0.0 && gained == 0.0 {
                    continue;
                }
                let row = entry.row as usize - first;
                let gram = &mut gram[row * triangle..(row + 1) * triangle];
                let right = &mut right[row * coeffs * 3..(row + 1) * coeffs * 3];
                let basis = sh::basis(degree, entry.towards.map(f64::from));
                let pull = [0, 1, 2].map(|channel| {
                    gained * f64::from(now[channel]) - lost * f64::from(before[channel])
                });
                let mut at = 0;
                for i in 0..coeffs {
                    let scaled = (gained - lost) * basis[i];
                    for (sum, other) in gram[at..=at + i].iter_mut().zip(basis) {
                        *sum += scaled * other;
                    }
                    at += i + 1;
                    for channel in 0..3 {
                        right[i * 3 + channel] += basis[i] * pull[channel];
                    }
                }
            }
        });
    }

    /// Solves for every row that anything is asked of; the others are left as they are.
    fn solve(
        &self,
        params: &RegressionParams,
        base: &[[f32; 3]],
        doubts: &[f32],
        d_sh: &mut [[f32; 3]],
    ) {
        let coeffs = self.coeffs;
        let triangle = coeffs * (coeffs + 1) / 2;
        d_sh.par_chunks_mut(coeffs).with_min_len(CHUNK).enumerate().for_each(|(row, out)| {
            let gram = &self.gram[row * triangle..(row + 1) * triangle];
            // Y₀ is constant: its square times the total weight stands here
            let total = gram[0] / f64::from(sh::C0 * sh::C0);
            if total.is_nan() || total <= 0.0 {
                return;
            }
            let (mut ridge, mut right) = ([0.0; 16], [0.0; 48]);
            right[..coeffs * 3].copy_from_slice(&self.right[row * coeffs * 3..][..coeffs * 3]);
            ridge[0] = total * (params.prior * 1e-3 + CONDITIONING);
            for k in 1..coeffs {
                let degree = k.isqrt() as f64;
                let smooth = total * params.prior * degree * degree * f64::from(doubts[row]);
                ridge[k] = smooth + total * CONDITIONING;
                // it is the coefficients that are to be small, not their change
                for channel in 0..3 {
                    let stored = f64::from(base[row * coeffs + k][channel]);
                    right[k * 3 + channel] -= smooth * stored;
                }
            }
            if let Some(solution) = cholesky_solve(gram, right, &ridge, coeffs) {
                for (k, rgb) in out.iter_mut().enumerate() {
                    for channel in 0..3 {
                        #[expect(clippy::cast_possible_truncation, reason = "coefficients are f32")]
                        let value = solution[k * 3 + channel] as f32;
                        rgb[channel] = value;
                    }
                }
            }
        });
    }
}

/// Ridge on every change, relative to the total weight: directions that nothing tells about stay as they are.
const CONDITIONING: f64 = 1e-6;

/// Solves `(gram + diag(ridge))·X = x` for three right-hand sides `x`; `None` if the system is not positive definite.
fn cholesky_solve(
    gram: &[f64],
    mut x: [f64; 48],
    ridge: &[f64; 16],
    coeffs: usize,
) -> Option<[f64; 48]> {
    let mut factor = [0.0_f64; 136];
    let start = |row: usize| row * (row + 1) / 2;
    for i in 0..coeffs {
        for j in 0..=i {
            let mut sum = gram[start(i) + j];
            if i == j {
                sum += ridge[i];
            }
            for k in 0..j {
                sum -= factor[start(i) + k] * factor[start(j) + k];
            }
            if i == j {
                if sum.is_nan() || sum <= 0.0 {
                    return None;
                }
                factor[start(i) + i] = sum.sqrt();
            } else {
                factor[start(i) + j] = sum / factor[start(j) + j];
            }
        }
    }
    for channel in 0..3 {
        for i in 0..coeffs {
            let mut sum = x[i * 3 + channel];
            for k in 0..i {
                sum -= factor[start(i) + k] * x[k * 3 + channel];
            }
            x[i * 3 + channel] = sum / factor[start(i) + i];
        }
        for i in (0..coeffs).rev() {
            let mut sum = x[i * 3 + channel];
            for k in i + 1..coeffs {
                sum -= factor[start(k) + i] * x[k * 3 + channel];
            }
            x[i * 3 + channel] = sum / factor[start(i) + i];
        }
    }
    x[..coeffs * 3].iter().all(|value| value.is_finite()).then_some(x)
}

/// Renews what the image just visited asks. `changes` are the splats' present colour changes, `answers` gradient and curvature.
fn renew(
    entries: &[Entry],
    changes: &[[f32; 3]],
    answers: &[[f32; 4]],
    relaxation: f32,
    requests: &mut [Request],
) {
    for (k, request) in requests.iter_mut().enumerate() {
        let ([red, green, blue, weight], change) = (answers[k], changes[k]);
        if weight.is_nan() || weight <= 0.0 {
            *request = [0.0; 4];
            continue;
        }
        for (channel, slope) in [red, green, blue].into_iter().enumerate() {
            let color = entries[k].color[channel];
            request[channel] = if color + change[channel] >= 0.0 {
                change[channel] - relaxation * slope / weight
            } else if slope < 0.0 {
                // shown as 0 but wanted brighter: from 0 upwards
                -color - relaxation * slope / weight
            } else {
                change[channel]
            };
        }
        request[3] = weight;
        if !request.iter().all(|value| value.is_finite()) {
            *request = [0.0; 4];
        }
    }
}

/// Where a run stands.
#[derive(Clone)]
pub(crate) struct Regression {
    pub d_sh: Vec<[f32; 3]>,
    requests: Vec<Vec<Request>>,
    /// Visits done.
    step: usize,
    losses: Vec<f64>,
}

impl Regression {
    pub(crate) fn new<R: Rasterizer>(problem: &Problem<R>) -> Self {
        Self {
            d_sh: vec![[0.0; 3]; problem.num_rows * problem.coeffs()],
            requests: problem.samples.iter().map(|s| vec![[0.0; 4]; s.entries.len()]).collect(),
            step: 0,
            losses: vec![f64::NAN; problem.samples.len()],
        }
    }

    pub(crate) fn resume<R: Rasterizer>(
        problem: &Problem<R>,
        state: &State,
    ) -> Result<Self, CuarError> {
        let mut own = Self::new(problem);
        let flat = state.array("d_sh", own.d_sh.len() * 3)?;
        own.d_sh = flat.as_chunks::<3>().0.to_vec();
        let count: usize = own.requests.iter().map(Vec::len).sum();
        let mut flat = state.array("requests", count * 4)?.as_chunks::<4>().0;
        for requests in &mut own.requests {
            let (head, tail) = flat.split_at(requests.len());
            requests.copy_from_slice(head);
            flat = tail;
        }
        own.step = usize::try_from(state.step).unwrap_or(usize::MAX);
        Ok(own)
    }

    fn state(&self, fingerprint: u64) -> State {
        State {
            fingerprint,
            step: self.step as u64,
            arrays: vec![
                ("d_sh".to_owned(), self.d_sh.concat()),
                ("requests".to_owned(), self.requests.concat().concat()),
            ],
        }
    }

    /// Fits what was asked last with another smoothness.
    pub(crate) fn refit<R: Rasterizer>(
        &self,
        problem: &Problem<R>,
        params: &RegressionParams,
    ) -> Vec<[f32; 3]> {
        let mut d_sh = vec![[0.0; 3]; self.d_sh.len()];
        let normals = self.normals(problem);
        normals.solve(params, &problem.base_sh, &problem.doubts, &mut d_sh);
        d_sh
    }

    fn normals<R: Rasterizer>(&self, problem: &Problem<R>) -> Normals {
        let mut normals = Normals::new(problem.num_rows, problem.coeffs());
        for (sample, requests) in problem.samples.iter().zip(&self.requests) {
            let none = vec![[0.0; 4]; requests.len()];
            normals.update(problem.sh_degree, &sample.entries, &none, requests);
        }
        normals
    }

    /// Runs to the end of the last pass.
    pub(crate) fn run<R: Rasterizer>(
        &mut self,
        problem: &mut Problem<R>,
        params: &RegressionParams,
        fingerprint: u64,
        watch: &mut Watch,
        trace: &mut Vec<TracePoint>,
    ) -> Result<(), CuarError> {
        let count = problem.samples.len();
        let degree = problem.sh_degree;
        #[expect(clippy::cast_possible_truncation, reason = "requests are single precision")]
        let relaxation = params.relaxation as f32;
        let logits = vec![0.0; problem.num_rows];
        let mut normals = None;
        while self.step < params.passes * count {
            let (pass, within) = (self.step / count, self.step % count);
            // sums are made anew once a pass: no drift, and a resumed run adds in the same order
            if within == 0 || normals.is_none() {
                normals = Some(self.normals(problem));
            }
            let Some(normals) = &mut normals else { break };
            let order = SplitMix(problem.options.seed ^ (pass as u64 + 1)).order(count);
            let s = order[within];
            let d = Deltas { sh: &self.d_sh, logits: &logits };
            let parts = problem.visit(s, d, Ask::Curvature(params.delta))?;
            let entries = &problem.samples[s].entries;
            let mut requests = self.requests[s].clone();
            let (changes, answers) = (&problem.work.changes, &problem.work.answers);
            renew(entries, changes, answers, relaxation, &mut requests);
            normals.update(degree, entries, &self.requests[s], &requests);
            self.requests[s] = requests;
            self.losses[s] = parts.total(problem.options.weights);
            self.step += 1;

            let pass_done = within + 1 == count;
            let fit_every = count.div_ceil(params.fits_per_pass);
            if pass_done || (pass > 0 && (within + 1) % fit_every == 0) {
                normals.solve(params, &problem.base_sh, &problem.doubts, &mut self.d_sh);
            }
            let known: Vec<f64> = self.losses.iter().copied().filter(|l| !l.is_nan()).collect();
            let loss = known.iter().sum::<f64>() / known.len().max(1) as f64;
            if pass_done {
                trace.push(TracePoint { secs: watch.elapsed(), step: self.step as u64, loss });
            }
            watch.step(self.step, Some(loss));
            watch.preview(|| problem.preview(s));
            // only here do the sums follow from the requests alone
            if pass_done {
                watch.checkpoint(|| self.state(fingerprint))?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fit_recovers_coefficients_from_enough_directions() {
        let (degree, coeffs) = (3, 16);
        let truth: Vec<[f32; 3]> =
            (0..coeffs).map(|k| [0.1 * k as f32, 0.5 - 0.03 * k as f32, 0.2]).collect();
        let mut normals = Normals::new(2, coeffs);
        for k in 0..60 {
            // a spiral over the sphere
            let z = 1.0 - 2.0 * (k as f32 + 0.5) / 60.0;
            let (sin, cos) = (2.4 * k as f32).sin_cos();
            let towards = [(1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z];
            let entry = Entry { local: 0, row: 1, towards, color: [0.0; 3] };
            let [r, g, b] = sh::color(degree, &truth, towards).map(|value| value - 0.5);
            let request = [r, g, b, 0.5 + (k % 3) as f32];
            normals.update(degree, &[entry], &[[0.0; 4]], &[request]);
        }
        let mut d_sh = vec![[0.0; 3]; 2 * coeffs];
        let params = RegressionParams { prior: 0.0, ..RegressionParams::default() };
        normals.solve(&params, &vec![[0.0; 3]; 2 * coeffs], &[1.0; 2], &mut d_sh);
        for (ours, theirs) in d_sh[coeffs..].iter().zip(&truth) {
            for channel in 0..3 {
                assert!((ours[channel] - theirs[channel]).abs() < 1e-3, "{ours:?} {theirs:?}");
            }
        }
        assert!(d_sh[..coeffs].iter().all(|rgb| *rgb == [0.0; 3]), "nothing was asked of row 0");
    }

    #[test]
    fn clamped_colours_can_come_back() {
        let entries =
            [Entry { local: 0, row: 0, towards: [0.0, 0.0, 1.0], color: [-0.5, -0.5, 0.5] }];
        let mut requests = [[0.0; 4]];
        renew(&entries, &[[0.0; 3]], &[[-1.0, 1.0, 1.0, 10.0]], 1.0, &mut requests);
        let expected = [0.6, 0.0, -0.1, 10.0]; // up from 0; stay; down
        for (ours, theirs) in requests[0].iter().zip(expected) {
            assert!((ours - theirs).abs() < 1e-6, "{requests:?}");
        }
    }
}
