//! The edit in small cubes: splats of one cube share the search for regions around them.

use super::edit::Edit;
use super::numeric::TINY;
use super::region_motion::{Path, RegionMotion};
use super::source::Regions;
use crate::rigid::dot;
use crate::row_index::index;
use anchors::{KdTree, Neighbor};
use gs_core::Real;
use rayon::prelude::*;

/// Motions told apart per cube. Where more parts meet, the farthest are none of its.
pub(super) const MAX_HYPOTHESES: usize = 4;

/// Regions looked at per cube: all within a thick sleeve's reach.
const LOOKED_AT: usize = 160;

/// Cubes handed to a thread at a time. Neighbours among them share regions, and so caches.
const BLOCK: usize = 16;

/// Edited splats of one cube, and the regions around them.
#[derive(Debug, Default)]
pub(super) struct Cube {
    /// Edited splats, ascending.
    pub(super) splats: Vec<u32>,
    /// Regions, nearest to the middle of the splats first; none if all splats are source splats.
    pub(super) regions: Vec<u32>,
    /// Which of the motions around the cube each region has; [`MAX_HYPOTHESES`] if a farther one.
    pub(super) hypotheses: Vec<u8>,
}

/// All of them, in the order of their places, and which splat is in which.
#[derive(Debug)]
pub(super) struct Cubes {
    cubes: Vec<Cube>,
    num_splats: usize,
}

/// What cubes are made of.
#[derive(Clone, Copy)]
pub(super) struct Surroundings<'a> {
    pub(super) regions: &'a Regions,
    pub(super) motion: &'a RegionMotion,
    pub(super) edit: &'a Edit,
    /// Motions that differ by less than this, world units, are one.
    pub(super) tolerance: f32,
}

impl Cubes {
    /// Cuts the edit in cubes of edge `edge` along `axes`.
    pub(super) fn of(around: Surroundings<'_>, axes: [[f64; 3]; 3], edge: f64) -> Self {
        let Surroundings { regions, motion, edit, .. } = around;
        let kept: Vec<usize> = (0..regions.len()).filter(|&i| !motion.outlier[i]).collect();
        let points: Vec<[f64; 3]> = kept.iter().map(|&i| regions.centroids.rest[i]).collect();
        let tree = KdTree::<3>::new(&points);
        let make = |(near, grouping): &mut (Vec<Neighbor>, Grouping), splats: Vec<u32>| {
            if splats.iter().all(|&e| edit.exact[e as usize].is_some()) {
                return Cube { splats, ..Cube::default() };
            }
            let mut middle = [0.0; 3];
            for &e in &splats {
                for (m, x) in middle.iter_mut().zip(edit.means[e as usize]) {
                    *m += x / splats.len() as f64;
                }
            }
            tree.nearest(&middle, LOOKED_AT, near);
            let regions: Vec<u32> = near.iter().map(|n| index(kept[n.id as usize])).collect();
            let hypotheses = around.hypotheses(middle, &regions, grouping).to_vec();
            Cube { splats, regions, hypotheses }
        };
        let cubes = by_place(edit, axes, edge)
            .into_par_iter()
            .with_min_len(BLOCK)
            .map_init(Default::default, make)
            .collect();
        Self { cubes, num_splats: edit.len() }
    }

    /// What `each` makes of every splat, given its cube, in the order of the splats.
    pub(super) fn map_splats<S: Default, R: Send + Default>(
        &self,
        each: impl Fn(&mut S, &Cube, usize) -> R + Sync,
    ) -> Vec<R> {
        let found: Vec<Vec<R>> = self
            .cubes
            .par_chunks(BLOCK)
            .map_init(S::default, |scratch, cubes| {
                let splats = |cube: &Cube| cube.splats.len();
                let mut found = Vec::with_capacity(cubes.iter().map(splats).sum());
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

/// What is kept from cube to cube, so that nothing is allocated for each.
#[derive(Default)]
pub(super) struct Grouping {
    hypotheses: Vec<u8>,
    open: Vec<u32>,
    apart: Vec<f32>,
    path: Path,
}

impl Surroundings<'_> {
    /// Which of the motions at `x` each of `regions` has: the first region stands for its motion,
    /// the first that does not share it for the next, and so on; [`MAX_HYPOTHESES`] for regions
    /// that have none of these.
    pub(super) fn hypotheses<'b>(
        &self,
        x: [f64; 3],
        regions: &[u32],
        scratch: &'b mut Grouping,
    ) -> &'b [u8] {
        let Grouping { hypotheses, open, apart, path } = scratch;
        let none = u8::try_from(MAX_HYPOTHESES).unwrap_or(u8::MAX);
        let x = x.map(Real::as_f32);
        hypotheses.clear();
        hypotheses.resize(regions.len(), none);
        for hypothesis in 0..none {
            open.clear();
            let is_open = regions.iter().zip(&*hypotheses).filter(|(_, h)| **h == none);
            open.extend(is_open.map(|(&region, _)| region));
            let Some(&first) = open.first() else { break };
            self.motion.path(first as usize, x, path);
            self.motion.apart(path, open, apart);
            let slots = hypotheses.iter_mut().filter(|h| **h == none);
            for (slot, &squared) in slots.zip(&*apart) {
                if squared <= self.tolerance * self.tolerance {
                    *slot = hypothesis;
                }
            }
        }
        hypotheses
    }
}

/// Edited splats by cubes of edge `edge` along `axes`.
fn by_place(edit: &Edit, axes: [[f64; 3]; 3], edge: f64) -> Vec<Vec<u32>> {
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
