//! Expectation–maximisation: probabilities of the motions of each edited splat, and the
//! displacement of each region by the edit.
//!
//! The expectation step is a relaxed transport of splats to regions. The maximisation step takes
//! weighted moments, smoothed over regions that move together. See `docs/MOTION.md`.

use super::candidates::{Candidate, Candidates};
use super::coverage;
use super::cubes::MAX_HYPOTHESES;
use super::diffusion::Diffusion;
use super::edit::Edit;
use super::likelihood::{Likelihood, Statistics};
use super::numeric::TINY;
use super::region_motion::RegionMotion;
use super::source::Regions;
use crate::MotionParams;
use anchors::RigidNeighbors;
use gs_core::Real;
use rayon::prelude::*;

/// Number of alternations of expectation and maximisation; more do not change the result
/// measurably.
const ROUNDS: usize = 6;

/// If an edit has at least twice as many splats, the alternations use every n-th splat, so that at
/// least this many remain. The statistics have far fewer unknowns.
const SAMPLE: usize = 20_000;

/// Number of diffusion steps that smooth the statistics over a patch of a body part.
const PATCH: usize = 5;

/// Prior means of the misalignment and of the squared difference of flatness, and constants added
/// to the estimates: the inaccuracy of normals and flatness of fitted splats.
const MISALIGNMENT: f64 = 0.2;
const MISALIGNMENT_NOISE: f64 = 0.05;
const FLATNESS_GAP: f64 = 0.1;
const FLATNESS_GAP_NOISE: f64 = 0.06;

/// Factor on estimated standard deviations, which are biased downwards by the current assignments.
const SPREAD: f64 = 1.4;

/// Cost of a region of which the edit kept all splats, nats: such a region is less likely to have
/// descendants. It separates an inflated sleeve from the bare hand that it overlaps.
const KEPT: f64 = 1.0;

/// Log-odds that a splat has the motion of its parent, nats. Equal bits do not occur by chance, but
/// a copy may have been moved to a different part.
const PARENT: f32 = 8.0;

/// Result for one edited splat.
#[derive(Debug, Clone, Copy)]
pub(super) struct RegionPosterior {
    /// The best region of the most probable hypothesis; `None` without candidates.
    pub(super) region: Option<u32>,
    /// Probability that the splat is unmatched.
    pub(super) unmatched: f32,
}

/// The candidate with the lowest cost of one hypothesis of a splat.
#[derive(Debug, Clone, Copy)]
struct BestCandidate {
    candidate: Candidate,
    /// Cost of the candidate, nats.
    cost: f32,
}

/// The model and its current parameters.
pub(super) struct RegionModel<'a> {
    regions: &'a Regions,
    neighbors: &'a RigidNeighbors,
    candidates: &'a Candidates,
    edit: &'a Edit,
    params: &'a MotionParams,
    diffusion: Diffusion,
    likelihoods: Vec<Likelihood>,
    /// Cost of each region for splats that the edit kept, see [`KEPT`], nats, `[R]`.
    kept_cost: Vec<f64>,
    /// Marginal penalty of each region, see [`coverage`], nats, `[R]`.
    marginal_penalty: Vec<f64>,
}

/// Input of the estimation.
pub(super) struct ModelInputs<'a> {
    pub(super) regions: &'a Regions,
    pub(super) neighbors: &'a RigidNeighbors,
    pub(super) motion: &'a RegionMotion,
    pub(super) candidates: &'a Candidates,
    pub(super) edit: &'a Edit,
    pub(super) params: &'a MotionParams,
    /// Size of the figure, world units.
    pub(super) figure_size: f64,
}

impl<'a> RegionModel<'a> {
    /// Estimates the parameters of the model.
    pub(super) fn estimate(inputs: &ModelInputs<'a>) -> Self {
        let ModelInputs { regions, neighbors, motion, candidates, edit, params, .. } = *inputs;
        let kept_cost = |i: usize| {
            let members = regions.members(i);
            let kept = members.iter().filter(|&&p| edit.kept[p as usize]).count();
            KEPT * kept as f64 / members.len() as f64
        };
        let mut model = Self {
            regions,
            neighbors,
            candidates,
            edit,
            params,
            diffusion: Diffusion::of(neighbors, motion),
            likelihoods: Vec::new(),
            kept_cost: (0..regions.len()).map(kept_cost).collect(),
            marginal_penalty: vec![0.0; regions.len()],
        };
        let undisplaced = Statistics {
            mean: 0.0,
            sigma: model.initial_sigma(inputs.figure_size),
            misalignment: MISALIGNMENT,
            flatness_gap: FLATNESS_GAP + FLATNESS_GAP_NOISE,
        };
        model.set_likelihoods(&vec![undisplaced; regions.len()]);
        let stride = (edit.len() / SAMPLE).max(1);
        let open = |e: &usize| edit.exact[*e].is_none();
        let sample: Vec<usize> = (0..edit.len()).step_by(stride).filter(open).collect();
        for _ in 0..ROUNDS {
            let best = model.best_of(&sample);
            let (sums, counts) = model.expectation(&best, stride as f64);
            let statistics = model.maximisation(sums, undisplaced.sigma);
            model.set_likelihoods(&statistics);
            let penalty = &mut model.marginal_penalty;
            coverage::update(&model.diffusion, counts, params.source_marginal, penalty);
        }
        model
    }

    /// Sets the cost functions of all regions.
    fn set_likelihoods(&mut self, statistics: &[Statistics]) {
        let alignment = self.params.alignment;
        self.likelihoods = statistics
            .iter()
            .zip(&self.neighbors.spacing)
            .map(|(statistics, &spacing)| Likelihood::of(statistics, spacing, alignment))
            .collect();
    }

    /// Initial spread of the offsets, world units: the upper quartile over the splats of the
    /// smallest offset. Large, so that the first alternation does not exclude correct parts.
    fn initial_sigma(&self, figure_size: f64) -> f64 {
        let smallest = |e: usize| {
            let offsets = self.candidates.of_splat(e).iter().map(|c| f64::from(c.offset.abs()));
            offsets.fold(f64::INFINITY, f64::min)
        };
        let mut offsets: Vec<f64> =
            (0..self.edit.len()).map(smallest).filter(|offset| offset.is_finite()).collect();
        let spacing = self.neighbors.typical_spacing(&self.regions.centroids);
        let quartile = if offsets.is_empty() {
            0.0
        } else {
            let rank = offsets.len() * 3 / 4;
            *offsets.select_nth_unstable_by(rank, f64::total_cmp).1
        };
        quartile.min(0.05 * figure_size).max(0.1 * spacing).max(TINY)
    }

    /// The best candidate of each hypothesis of splat `e`. Replaces `out`.
    fn best(&self, e: usize, out: &mut Vec<BestCandidate>) {
        out.clear();
        let has_parent = self.edit.parent[e].is_some();
        let candidates = self.candidates.of_splat(e);
        // Relative to the minimum: if all candidates were kept, the cost does not discriminate.
        let kept_costs = candidates.iter().map(|c| self.kept_cost[c.region as usize]);
        let smallest = kept_costs.fold(f64::INFINITY, f64::min);
        for candidate in candidates {
            let region = candidate.region as usize;
            let penalty = self.marginal_penalty[region] + self.kept_cost[region] - smallest;
            let mut cost = self.likelihoods[region].cost(candidate) + penalty.as_f32();
            if has_parent && candidate.hypothesis == 0 {
                cost -= PARENT;
            }
            // Candidates are grouped by hypothesis.
            match out.last_mut() {
                Some(best) if best.candidate.hypothesis == candidate.hypothesis => {
                    if cost < best.cost {
                        *best = BestCandidate { candidate: *candidate, cost };
                    }
                }
                _ => out.push(BestCandidate { candidate: *candidate, cost }),
            }
        }
    }

    /// The best candidates of each sampled splat.
    fn best_of(&self, sample: &[usize]) -> Vec<Vec<BestCandidate>> {
        sample
            .par_iter()
            .with_min_len(64)
            .map(|&e| {
                let mut best = Vec::with_capacity(MAX_HYPOTHESES);
                self.best(e, &mut best);
                best
            })
            .collect()
    }

    /// Expectation: probabilities of the best candidates of the sampled splats, each of which
    /// counts `weight` times. Returns their weighted sums and the counts of splats per region,
    /// `[R]` each, those of kept splats included.
    fn expectation(
        &self,
        best: &[Vec<BestCandidate>],
        weight: f64,
    ) -> (Vec<[f64; 5]>, Vec<[f64; 2]>) {
        let (mut sums, mut counts) = self.sums_of_kept();
        for best in best {
            let lowest = best.iter().map(|b| b.cost).fold(f32::INFINITY, f32::min);
            let odds = |b: &BestCandidate| (f64::from(lowest - b.cost) / self.params.entropy).exp();
            let total: f64 = best.iter().map(odds).sum();
            // Splats that fit no region well contribute little.
            let evidence = (-0.5 * f64::from(lowest.max(0.0))).exp();
            for b in best {
                let region = b.candidate.region as usize;
                let share = weight * odds(b) / total;
                add(&mut sums[region], &b.candidate, share * evidence);
                counts[region][0] += share;
            }
        }
        (sums, counts)
    }

    /// Maximisation: statistics of the regions from the sums of [`Self::expectation`]. `sigma` is
    /// the spread of the prior, world units.
    fn maximisation(&self, sums: Vec<[f64; 5]>, sigma: f64) -> Vec<Statistics> {
        let prior = self.params.prior;
        let statistics = |[mass, offset, squares, misalignment, flatness_gap]: [f64; 5]| {
            let total = mass + prior;
            let mean = offset / total;
            let variance = (squares + prior * (sigma * sigma)) / total - mean * mean;
            let misalignment = (misalignment + prior * MISALIGNMENT) / total;
            let flatness_gap = (flatness_gap + prior * FLATNESS_GAP) / total;
            Statistics {
                mean,
                sigma: SPREAD * variance.max(0.0).sqrt(),
                misalignment: misalignment + MISALIGNMENT_NOISE,
                flatness_gap: flatness_gap + FLATNESS_GAP_NOISE,
            }
        };
        self.diffusion.spread(sums, PATCH).into_iter().map(statistics).collect()
    }

    /// Sums over the splats that the edit kept, `[R]`, and counts of these and of the source
    /// splats, `[R]`.
    fn sums_of_kept(&self) -> (Vec<[f64; 5]>, Vec<[f64; 2]>) {
        let mut sums = vec![[0.0; 5]; self.regions.len()];
        let mut counts: Vec<[f64; 2]> =
            (0..self.regions.len()).map(|i| [0.0, self.regions.members(i).len() as f64]).collect();
        for e in (0..self.edit.len()).filter(|&e| self.edit.exact[e].is_some()) {
            if let [candidate] = self.candidates.of_splat(e) {
                add(&mut sums[candidate.region as usize], candidate, 1.0);
                counts[candidate.region as usize][0] += 1.0;
            }
        }
        (sums, counts)
    }

    /// Posteriors of all edited splats under the estimated parameters, `[E]`.
    pub(super) fn posteriors(&self) -> Vec<RegionPosterior> {
        (0..self.edit.len())
            .into_par_iter()
            .with_min_len(64)
            .map_init(Vec::new, |best, e| {
                self.best(e, best);
                self.posterior(best)
            })
            .collect()
    }

    fn posterior(&self, best: &[BestCandidate]) -> RegionPosterior {
        let entropy = self.params.entropy.as_f32();
        let unmatched = self.params.unmatched.as_f32();
        let order = |a: &&BestCandidate, b: &&BestCandidate| {
            a.cost.total_cmp(&b.cost).then(a.candidate.region.cmp(&b.candidate.region))
        };
        let likeliest = best.iter().min_by(order);
        let lowest = likeliest.map_or(unmatched, |b| b.cost.min(unmatched));
        let odds = |cost: f32| ((lowest - cost) / entropy).exp();
        let total = odds(unmatched) + best.iter().map(|b| odds(b.cost)).sum::<f32>();
        RegionPosterior {
            region: likeliest.map(|b| b.candidate.region),
            unmatched: odds(unmatched) / total,
        }
    }
}

/// Adds the offset, its square, the misalignment and the flatness gap of one candidate to the sums
/// of its region.
fn add(sums: &mut [f64; 5], candidate: &Candidate, weight: f64) {
    // Balls have no offset.
    let flatness = f64::from(candidate.flatness);
    let offset = f64::from(candidate.offset);
    let misalignment = (f64::from(candidate.misalignment) / flatness.max(1e-3)).clamp(0.0, 1.0);
    let values = [1.0, offset, offset * offset, misalignment, f64::from(candidate.flatness_gap)];
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += weight * flatness * value;
    }
}
