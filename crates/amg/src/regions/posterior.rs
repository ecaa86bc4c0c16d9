//! Which motion each edited splat has, and how the edit displaced each region: expectation and
//! maximisation in turns.
//!
//! Expectation is relaxed transport of splats to regions; maximisation are weighted moments, smooth
//! over regions that move as one. See `docs/MOTION.md`.

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

/// Alternations; more change nothing.
const ROUNDS: usize = 6;

/// Splats that the alternation sees at most: the statistics have far fewer unknowns.
const SAMPLE: usize = 20_000;

/// Steps over which statistics are smoothed: a patch of a body part.
const PATCH: usize = 5;

/// Mean misalignment and mean squared difference of flatness believed in before anything is known;
/// some remains believed in however well splats agree: normals and flatness of fitted splats are no
/// better.
const MISALIGNED: f64 = 0.2;
const LEAST_MISALIGNED: f64 = 0.05;
const UNLIKE: f64 = 0.1;
const LEAST_UNLIKE: f64 = 0.06;

/// Factor on learned standard deviations: choices made so far are biased towards small ones.
const SPREAD: f64 = 1.4;

/// Cost of belonging to a region all of which the edit kept, nats: what is still there needs no
/// descendants. An inflated sleeve that comes to lie on a bare hand is told from it by this.
const KEPT: f64 = 1.0;

/// Log-odds of a splat with known parent having that one's motion. Equal bits are no accident; but
/// copies get moved.
const PARENT: f32 = 8.0;

/// What is believed of one edited splat.
#[derive(Debug, Clone, Copy)]
pub(super) struct Posterior {
    /// The best region of the likeliest motion; `None` if there is no region near.
    pub(super) region: Option<u32>,
    /// Probability of no region at all.
    pub(super) unmatched: f32,
}

/// The best region of one motion of a splat.
#[derive(Debug, Clone, Copy)]
struct Best {
    candidate: Candidate,
    /// What belonging to it costs, nats.
    cost: f32,
}

/// The model and what it has learned so far.
pub(super) struct Model<'a> {
    regions: &'a Regions,
    neighbors: &'a RigidNeighbors,
    candidates: &'a Candidates,
    edit: &'a Edit,
    params: &'a MotionParams,
    diffusion: Diffusion,
    likelihoods: Vec<Likelihood>,
    /// What belonging to each region costs because the edit kept its splats, and because of who
    /// else belongs to it, nats.
    kept: Vec<f64>,
    crowding: Vec<f64>,
}

/// What the model is made for.
pub(super) struct Given<'a> {
    pub(super) regions: &'a Regions,
    pub(super) neighbors: &'a RigidNeighbors,
    pub(super) motion: &'a RegionMotion,
    pub(super) candidates: &'a Candidates,
    pub(super) edit: &'a Edit,
    pub(super) params: &'a MotionParams,
    /// World units.
    pub(super) figure_size: f64,
}

impl<'a> Model<'a> {
    /// Estimates the model.
    pub(super) fn estimate(given: &Given<'a>) -> Self {
        let Given { regions, neighbors, motion, candidates, edit, params, .. } = *given;
        let kept = |i: usize| {
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
            kept: (0..regions.len()).map(kept).collect(),
            crowding: vec![0.0; regions.len()],
        };
        let believed = Statistics {
            mean: 0.0,
            sigma: model.first_sigma(given.figure_size),
            misaligned: MISALIGNED,
            unlike: UNLIKE + LEAST_UNLIKE,
        };
        model.set(&vec![believed; regions.len()]);
        let stride = (edit.len() / SAMPLE).max(1);
        let open = |e: &usize| edit.exact[*e].is_none();
        let sample: Vec<usize> = (0..edit.len()).step_by(stride).filter(open).collect();
        for _ in 0..ROUNDS {
            let best = model.best_of(&sample);
            model.maximise(&best, (stride as f64, believed));
        }
        model
    }

    /// Sets the costs of all regions.
    fn set(&mut self, statistics: &[Statistics]) {
        let alignment = self.params.alignment;
        self.likelihoods = statistics
            .iter()
            .zip(&self.neighbors.spacing)
            .map(|(statistics, &spacing)| Likelihood::of(statistics, spacing, alignment))
            .collect();
    }

    /// Upper quartile of the smallest offsets: generous, since the first round must not lock onto
    /// wrong parts.
    fn first_sigma(&self, figure_size: f64) -> f64 {
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

    /// The best region of each motion of splat `e`. Replaces `out`.
    fn best(&self, e: usize, out: &mut Vec<Best>) {
        out.clear();
        let has_parent = self.edit.parent[e].is_some();
        let candidates = self.candidates.of_splat(e);
        // Where all around was kept, that tells nothing.
        let kept = candidates.iter().map(|c| self.kept[c.region as usize]);
        let spared = kept.fold(f64::INFINITY, f64::min);
        for candidate in candidates {
            let region = candidate.region as usize;
            let taken = self.crowding[region] + self.kept[region] - spared;
            let mut cost = self.likelihoods[region].cost(candidate) + taken.as_f32();
            if has_parent && candidate.hypothesis == 0 {
                cost -= PARENT;
            }
            // Candidates come motion by motion.
            match out.last_mut() {
                Some(best) if best.candidate.hypothesis == candidate.hypothesis => {
                    if cost < best.cost {
                        *best = Best { candidate: *candidate, cost };
                    }
                }
                _ => out.push(Best { candidate: *candidate, cost }),
            }
        }
    }

    /// The best regions of each sampled splat.
    fn best_of(&self, sample: &[usize]) -> Vec<Vec<Best>> {
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

    /// Expectation and maximisation: statistics of the regions from the probabilities of the
    /// splats' best regions, and how full the regions are. Each splat stands for `weight` of them.
    fn maximise(&mut self, best: &[Vec<Best>], (weight, believed): (f64, Statistics)) {
        let (mut sums, mut counts) = self.known();
        for best in best {
            let lowest = best.iter().map(|b| b.cost).fold(f32::INFINITY, f32::min);
            let odds = |b: &Best| (f64::from(lowest - b.cost) / self.params.entropy).exp();
            let total: f64 = best.iter().map(odds).sum();
            // What nothing explains well says little.
            let evidence = (-0.5 * f64::from(lowest.max(0.0))).exp();
            for b in best {
                let region = b.candidate.region as usize;
                let share = weight * odds(b) / total;
                add(&mut sums[region], &b.candidate, share * evidence);
                counts[region][0] += share;
            }
        }
        let prior = self.params.prior;
        let square = believed.sigma * believed.sigma;
        let statistics: Vec<Statistics> = self
            .diffusion
            .spread(sums, PATCH)
            .into_iter()
            .map(|[mass, offset, squares, misaligned, unlike]| {
                let total = mass + prior;
                let mean = offset / total;
                let variance = (squares + prior * square) / total - mean * mean;
                Statistics {
                    mean,
                    sigma: SPREAD * variance.max(0.0).sqrt(),
                    misaligned: (misaligned + prior * MISALIGNED) / total + LEAST_MISALIGNED,
                    unlike: (unlike + prior * UNLIKE) / total + LEAST_UNLIKE,
                }
            })
            .collect();
        self.set(&statistics);
        coverage::update(&self.diffusion, counts, self.params.source_marginal, &mut self.crowding);
    }

    /// Sums and counts of the splats that the edit kept, per region: they are where they were.
    /// Beside the counts, those of the source.
    fn known(&self) -> (Vec<[f64; 5]>, Vec<[f64; 2]>) {
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

    /// Posteriors of all edited splats, those outside the sample too: expectation with what was
    /// learned.
    pub(super) fn posteriors(&self) -> Vec<Posterior> {
        (0..self.edit.len())
            .into_par_iter()
            .with_min_len(64)
            .map_init(Vec::new, |best, e| {
                self.best(e, best);
                self.posterior(best)
            })
            .collect()
    }

    fn posterior(&self, best: &[Best]) -> Posterior {
        let entropy = self.params.entropy.as_f32();
        let none = self.params.unmatched.as_f32();
        let order = |a: &&Best, b: &&Best| {
            a.cost.total_cmp(&b.cost).then(a.candidate.region.cmp(&b.candidate.region))
        };
        let likeliest = best.iter().min_by(order);
        let lowest = likeliest.map_or(none, |b| b.cost.min(none));
        let odds = |cost: f32| ((lowest - cost) / entropy).exp();
        let total = odds(none) + best.iter().map(|b| odds(b.cost)).sum::<f32>();
        Posterior { region: likeliest.map(|b| b.candidate.region), unmatched: odds(none) / total }
    }
}

/// Adds what one candidate says of its region.
fn add(sums: &mut [f64; 5], candidate: &Candidate, weight: f64) {
    // Balls say nothing of surfaces.
    let flat = f64::from(candidate.flat);
    let offset = f64::from(candidate.offset);
    let misaligned = (f64::from(candidate.misaligned) / flat.max(1e-3)).clamp(0.0, 1.0);
    let values = [1.0, offset, offset * offset, misaligned, f64::from(candidate.unlike)];
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += weight * flat * value;
    }
}
