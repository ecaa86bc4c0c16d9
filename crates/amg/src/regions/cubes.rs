//! Edited splats grouped in small cubes: the splats of a cube share one search for candidate
//! regions.

use super::edit::Edit;
use super::numeric::TINY;
use super::region_motion::{Path, RegionMotion};
use super::region_tree::RegionTree;
use super::source::Regions;
use crate::rigid::dot;
use anchors::Neighbor;
use gs_core::Real;
use rayon::prelude::*;

/// Maximum number of motions distinguished per cube. Where more parts meet, the farthest are not
/// candidates.
pub(super) const MAX_HYPOTHESES: usize = 4;

/// Number of candidate regions per cube: enough to contain the arm below a thick sleeve.
const CANDIDATES: usize = 160;

/// Cubes per task. Neighbouring cubes share regions, and thus cache lines.
const BLOCK: usize = 16;

/// Edited splats of one cube and their candidate regions.
#[derive(Debug, Default)]
pub(super) struct Cube {
    /// Edited splats, ascending.
    pub(super) splats: Vec<u32>,
    /// Candidate regions, those nearest to the mean of the splats first; empty if all splats are
    /// source splats.
    pub(super) regions: Vec<u32>,
    /// Hypothesis of each candidate region; [`MAX_HYPOTHESES`] if it has none of these motions.
    pub(super) hypotheses: Vec<u8>,
}

/// All cubes, in the order of their positions.
#[derive(Debug)]
pub(super) struct Cubes {
    cubes: Vec<Cube>,
    num_splats: usize,
}

/// Regions and edited splats between which candidates are searched.
#[derive(Clone, Copy)]
pub(super) struct SearchSpace<'a> {
    pub(super) regions: &'a Regions,
    pub(super) motion: &'a RegionMotion,
    pub(super) edit: &'a Edit,
    /// Maximum distance between images of a point under two motions that count as one, world units.
    pub(super) tolerance: f32,
}

impl Cubes {
    /// Groups the edited splats in cubes of edge `edge` along `axes`. `tree` contains the regions.
    pub(super) fn of(
        space: SearchSpace<'_>,
        tree: &RegionTree,
        axes: [[f64; 3]; 3],
        edge: f64,
    ) -> Self {
        let edit = space.edit;
        let make = |(near, grouping): &mut (Vec<Neighbor>, HypothesisScratch), splats: Vec<u32>| {
            if splats.iter().all(|&e| edit.exact[e as usize].is_some()) {
                return Cube { splats, ..Cube::default() };
            }
            let mut mean = [0.0; 3];
            for &e in &splats {
                for (m, x) in mean.iter_mut().zip(edit.means[e as usize]) {
                    *m += x / splats.len() as f64;
                }
            }
            tree.nearest(&mean, CANDIDATES, near);
            let regions: Vec<u32> = near.iter().map(|n| n.id).collect();
            let hypotheses = space.hypotheses(mean, &regions, grouping).to_vec();
            Cube { splats, regions, hypotheses }
        };
        let cubes = splats_by_cube(edit, axes, edge)
            .into_par_iter()
            .with_min_len(BLOCK)
            .map_init(Default::default, make)
            .collect();
        Self { cubes, num_splats: edit.len() }
    }

    /// Calls `each` with every splat and its cube; returns the results in the order of the splats.
    pub(super) fn map_splats<S: Default, R: Send + Default>(
        &self,
        each: impl Fn(&mut S, &Cube, usize) -> R + Sync,
    ) -> Vec<R> {
        let found: Vec<Vec<R>> = self
            .cubes
            .par_chunks(BLOCK)
            .map_init(S::default, |scratch, cubes| {
                let num_splats = cubes.iter().map(|cube| cube.splats.len()).sum();
                let mut found = Vec::with_capacity(num_splats);
                for cube in cubes {
                    found.extend(cube.splats.iter().map(|&e| each(scratch, cube, e as usize)));
                }
                found
            })
            .collect();
        let mut by_splat: Vec<R> = (0..self.num_splats).map(|_| R::default()).collect();
        let splats = self.cubes.iter().flat_map(|cube| &cube.splats);
        for (&e, value) in splats.zip(found.into_iter().flatten()) {
            by_splat[e as usize] = value;
        }
        by_splat
    }
}

/// Buffers reused from search to search.
#[derive(Default)]
pub(super) struct HypothesisScratch {
    hypotheses: Vec<u8>,
    remaining: Vec<u32>,
    deviations: Vec<f32>,
    path: Path,
}

impl SearchSpace<'_> {
    /// Hypothesis of each of `regions` at `x`. The first region and all that share its motion have
    /// hypothesis 0, the first of the others and all that share its motion 1, and so on;
    /// [`MAX_HYPOTHESES`] for the rest.
    pub(super) fn hypotheses<'b>(
        &self,
        x: [f64; 3],
        regions: &[u32],
        scratch: &'b mut HypothesisScratch,
    ) -> &'b [u8] {
        let HypothesisScratch { hypotheses, remaining, deviations, path } = scratch;
        let none = u8::try_from(MAX_HYPOTHESES).unwrap_or(u8::MAX);
        let x = x.map(Real::as_f32);
        hypotheses.clear();
        hypotheses.resize(regions.len(), none);
        for hypothesis in 0..none {
            remaining.clear();
            let without = regions.iter().zip(&*hypotheses).filter(|(_, h)| **h == none);
            remaining.extend(without.map(|(&region, _)| region));
            let Some(&first) = remaining.first() else { break };
            self.motion.path(first as usize, x, path);
            self.motion.max_squared_distances(path, remaining, deviations);
            let slots = hypotheses.iter_mut().filter(|h| **h == none);
            for (slot, &squared) in slots.zip(&*deviations) {
                if squared <= self.tolerance * self.tolerance {
                    *slot = hypothesis;
                }
            }
        }
        hypotheses
    }
}

/// Ids of the edited splats of each cube of edge `edge` along `axes`.
fn splats_by_cube(edit: &Edit, axes: [[f64; 3]; 3], edge: f64) -> Vec<Vec<u32>> {
    let edge = edge.max(TINY);
    let cube = |x: [f64; 3]| axes.map(|axis| (dot(axis, x) / edge).round());
    let mut keyed: Vec<([f64; 3], u32)> =
        edit.means.iter().map(|&x| cube(x)).zip(0_u32..).collect();
    let order = |a: &([f64; 3], u32), b: &([f64; 3], u32)| {
        let unlike = a.0.iter().zip(&b.0).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne());
        unlike.unwrap_or(std::cmp::Ordering::Equal).then(a.1.cmp(&b.1))
    };
    keyed.par_sort_unstable_by(order);
    keyed.chunk_by(|a, b| a.0 == b.0).map(|of| of.iter().map(|&(_, e)| e).collect()).collect()
}
