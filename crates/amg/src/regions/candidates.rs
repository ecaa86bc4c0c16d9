//! Per edited splat: the regions it may belong to, grouped by the motion they would give it.

use super::edit::Edit;
use super::numeric::TINY;
use super::region_motion::{Path, RegionMotion};
use super::source::Regions;
use crate::binding::index;
use crate::rigid::{dot, norm, sub};
use anchors::{KdTree, NO_CELL, Neighbor};
use gs_core::Real;
use rayon::prelude::*;

/// Motions told apart per splat. Where more parts meet, the farthest are none of its.
pub(super) const MAX_HYPOTHESES: usize = 4;

/// Regions looked at per splat: all within a thick sleeve's reach.
const LOOKED_AT: usize = 160;

/// Regions kept per motion: the plane of one may be tilted, that of all of them is not.
const PER_HYPOTHESIS: usize = 8;

/// A region that may explain an edited splat.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    pub(super) region: u32,
    /// Which of the splat's motions the region has.
    pub(super) hypothesis: u8,
    /// Signed offset of the splat from the region along its outward normal, world units.
    pub(super) offset: f32,
    /// Squared distance within the region's tangent plane, world units².
    pub(super) tangent_squared: f32,
    /// Product of the two flatnesses: 0 if either is a ball.
    pub(super) flat: f32,
    /// `flat` less the inner product of the two normals, either sign of which is as good, both with their flatness.
    pub(super) misaligned: f32,
    /// Squared difference of the two flatnesses.
    pub(super) unlike: f32,
}

/// Candidates of all edited splats.
#[derive(Debug)]
pub(super) struct Candidates {
    /// Of splat `e`: entries `starts[e]..starts[e + 1]`, those of one hypothesis nearest first.
    starts: Vec<usize>,
    entries: Vec<Candidate>,
    /// Distance of the nearest region, world units; infinite if there is none, or none was looked for.
    pub(super) distance: Vec<f64>,
    /// Regions around the cube of each splat, nearest to its middle first, and which cube that is.
    around: Vec<Vec<u32>>,
    cube: Vec<u32>,
}

impl Candidates {
    /// Those of splat `e`.
    pub(super) fn of_splat(&self, e: usize) -> &[Candidate] {
        &self.entries[self.starts[e]..self.starts[e + 1]]
    }

    /// Regions around splat `e`, nearest first, with squared distances. Replaces `out`.
    pub(super) fn around(
        &self,
        regions: &Regions,
        edit: &Edit,
        e: usize,
        out: &mut Vec<(f64, u32)>,
    ) {
        by_distance(regions, edit.means[e], &self.around[self.cube[e] as usize], out);
    }

    /// Looks for the regions around every edited splat. Motions that differ by less than `tolerance` where the splat is are one.
    ///
    /// Splats that share a cube of edge `edge` share the search for regions, not its evaluation.
    pub(super) fn of(
        regions: &Regions,
        motion: &RegionMotion,
        normals: &[[f64; 3]],
        edit: &Edit,
        (axes, edge): ([[f64; 3]; 3], f64),
        tolerance: f32,
    ) -> Self {
        let kept: Vec<usize> = (0..regions.len()).filter(|&i| !motion.outlier[i]).collect();
        let points: Vec<[f64; 3]> = kept.iter().map(|&i| regions.centroids.rest[i]).collect();
        let tree = KdTree::<3>::new(&points);
        let cubes = cubes(edit, axes, edge);
        let around: Vec<Vec<u32>> = cubes
            .par_iter()
            .with_min_len(32)
            .map_init(Vec::new, |near: &mut Vec<Neighbor>, splats| {
                if splats.iter().all(|&e| edit.exact[e as usize].is_some()) {
                    return Vec::new();
                }
                let mut middle = [0.0; 3];
                for &e in splats {
                    for (m, x) in middle.iter_mut().zip(edit.means[e as usize]) {
                        *m += x / splats.len() as f64;
                    }
                }
                tree.nearest(&middle, LOOKED_AT, near);
                near.iter().map(|n| index(kept[n.id as usize])).collect()
            })
            .collect();
        let mut cube = vec![0; edit.len()];
        for (number, splats) in (0_u32..).zip(&cubes) {
            for &e in splats {
                cube[e as usize] = number;
            }
        }
        let find = Find { regions, motion, normals, edit, tolerance };
        let found: Vec<(Vec<Candidate>, f64)> = (0..edit.len())
            .into_par_iter()
            .with_min_len(64)
            .map_init(Scratch::default, |scratch, e| {
                find.of_splat(e, &around[cube[e] as usize], scratch)
            })
            .collect();
        let mut starts = vec![0];
        let mut entries = Vec::with_capacity(found.iter().map(|(of, _)| of.len()).sum());
        for (of, _) in &found {
            entries.extend_from_slice(of);
            starts.push(entries.len());
        }
        let distance = found.iter().map(|(_, distance)| *distance).collect();
        Self { starts, entries, distance, around, cube }
    }
}

/// Edited splats by cubes of edge `edge` along `axes`.
fn cubes(edit: &Edit, axes: [[f64; 3]; 3], edge: f64) -> Vec<Vec<u32>> {
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

fn by_distance(regions: &Regions, x: [f64; 3], of: &[u32], out: &mut Vec<(f64, u32)>) {
    out.clear();
    out.extend(of.iter().map(|&region| {
        let d = sub(regions.centroids.rest[region as usize], x);
        (dot(d, d), region)
    }));
    out.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
}

#[derive(Default)]
struct Scratch {
    near: Vec<(f64, u32)>,
    open: Vec<u32>,
    rest: Vec<u32>,
    apart: Vec<f32>,
    path: Path,
}

struct Find<'a> {
    regions: &'a Regions,
    motion: &'a RegionMotion,
    normals: &'a [[f64; 3]],
    edit: &'a Edit,
    tolerance: f32,
}

impl Find<'_> {
    fn of_splat(&self, e: usize, around: &[u32], scratch: &mut Scratch) -> (Vec<Candidate>, f64) {
        if let Some(point) = self.edit.exact[e] {
            // A splat that is a source splat has that one's region, or none if that one is an outlier.
            let region = self.regions.cells.owners[point as usize];
            let known = (region != NO_CELL).then(|| self.candidate(e, region, 0));
            return (known.into_iter().collect(), f64::INFINITY);
        }
        let Scratch { near, open, rest, apart, path } = scratch;
        by_distance(self.regions, self.edit.means[e], around, near);
        let distance = near.first().map_or(f64::INFINITY, |n| n.0.sqrt());
        open.clear();
        open.extend(self.parent(e));
        open.extend(near.iter().map(|n| n.1).filter(|region| Some(*region) != self.parent(e)));
        let mut found = Vec::with_capacity(2 * PER_HYPOTHESIS);
        let x = self.edit.means[e].map(Real::as_f32);
        // The nearest region stands for its motion; what does not share it is looked at again.
        for hypothesis in 0..MAX_HYPOTHESES {
            let Some(&first) = open.first() else { break };
            self.motion.path(first as usize, x, path);
            self.motion.apart(path, open, apart);
            rest.clear();
            let mut count = 0;
            for (&region, &squared) in open.iter().zip(&*apart) {
                if squared > self.tolerance * self.tolerance {
                    rest.push(region);
                } else if count < PER_HYPOTHESIS {
                    count += 1;
                    found.push(self.candidate(e, region, hypothesis));
                }
            }
            std::mem::swap(open, rest);
        }
        (found, distance)
    }

    /// The region of the splat that this one descends from, if both are known.
    fn parent(&self, e: usize) -> Option<u32> {
        let region = self.regions.cells.owners[self.edit.parent[e]? as usize];
        (region != NO_CELL).then_some(region)
    }

    fn candidate(&self, e: usize, region: u32, hypothesis: usize) -> Candidate {
        let (ns, ne) = (self.normals[region as usize], self.edit.axes[e]);
        let (fs, fe) = (norm(ns), norm(ne));
        let d = sub(self.edit.means[e], self.regions.centroids.rest[region as usize]);
        let offset = if fs > 1e-9 { dot(d, ns) / fs } else { 0.0 };
        Candidate {
            region,
            hypothesis: u8::try_from(hypothesis).unwrap_or(u8::MAX),
            offset: offset.as_f32(),
            tangent_squared: (dot(d, d) - offset * offset).max(0.0).as_f32(),
            flat: (fs * fe).as_f32(),
            misaligned: (fs * fe - dot(ns, ne).abs()).max(0.0).as_f32(),
            unlike: (fs - fe).powi(2).as_f32(),
        }
    }
}
