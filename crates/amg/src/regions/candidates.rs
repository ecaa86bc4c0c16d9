//! Per edited splat: the regions it may belong to, grouped by the motion they would give it.

use super::cubes::{Cube, Cubes, Grouping, MAX_HYPOTHESES, Surroundings};
use crate::rigid::{dot, norm, sub};
use anchors::NO_CELL;
use gs_core::Real;

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
    /// `flat` less the inner product of the two normals, either sign of which is as good, both with
    /// their flatness.
    pub(super) misaligned: f32,
    /// Squared difference of the two flatnesses.
    pub(super) unlike: f32,
}

/// Candidates of all edited splats.
#[derive(Debug)]
pub(super) struct Candidates {
    /// Of each splat, those of one hypothesis nearest first.
    entries: Vec<Box<[Candidate]>>,
    /// Distance of the nearest region, world units; infinite if there is none, or none was looked
    /// for.
    pub(super) distance: Vec<f64>,
}

impl Candidates {
    /// Those of splat `e`.
    pub(super) fn of_splat(&self, e: usize) -> &[Candidate] {
        &self.entries[e]
    }

    /// Looks for the regions around every edited splat. `normals` are those of the regions, with
    /// their flatness for length.
    pub(super) fn of(around: Surroundings<'_>, normals: &[[f64; 3]], cubes: &Cubes) -> Self {
        let flatness = normals.iter().map(|&n| norm(n)).collect();
        let find = Find { around, normals, flatness };
        let found =
            cubes.map_splats(|scratch: &mut Scratch, cube, e| find.of_splat(e, cube, scratch));
        let (entries, distance) = found.into_iter().unzip();
        Self { entries, distance }
    }
}

/// What is kept from splat to splat, so that nothing is allocated for each.
#[derive(Default)]
struct Scratch {
    grouping: Grouping,
    regions: Vec<u32>,
    nearest: [Vec<(f64, u32)>; MAX_HYPOTHESES],
    found: Vec<Candidate>,
}

struct Find<'a> {
    around: Surroundings<'a>,
    normals: &'a [[f64; 3]],
    flatness: Vec<f64>,
}

impl Find<'_> {
    fn of_splat(&self, e: usize, cube: &Cube, scratch: &mut Scratch) -> (Box<[Candidate]>, f64) {
        let Surroundings { regions, edit, .. } = self.around;
        let region_of = |point: u32| {
            let region = regions.cells.owners[point as usize];
            (region != NO_CELL).then_some(region)
        };
        if let Some(point) = edit.exact[e] {
            // A splat that is a source splat has that one's region, or none if that one is an
            // outlier.
            let known = region_of(point).map(|region| self.candidate(e, region, 0));
            return (known.into_iter().collect(), f64::INFINITY);
        }
        let x = edit.means[e];
        let Scratch { grouping, regions: with_parent, nearest, found } = scratch;
        // What descends from a region may have moved: its motion comes first, and is looked at in
        // this place.
        let (candidates, hypotheses) = if let Some(parent) = edit.parent[e].and_then(region_of) {
            with_parent.clear();
            with_parent.push(parent);
            with_parent.extend(cube.regions.iter().filter(|&&region| region != parent));
            (&with_parent[..], self.around.hypotheses(x, with_parent, grouping))
        } else {
            (&cube.regions[..], &cube.hypotheses[..])
        };
        nearest.iter_mut().for_each(Vec::clear);
        let mut closest = f64::INFINITY;
        for (&region, &hypothesis) in candidates.iter().zip(hypotheses) {
            let d = sub(regions.centroids.rest[region as usize], x);
            let squared = dot(d, d);
            closest = closest.min(squared);
            if let Some(kept) = nearest.get_mut(usize::from(hypothesis)) {
                insert(kept, (squared, region));
            }
        }
        found.clear();
        for (hypothesis, kept) in (0..).zip(&*nearest) {
            found.extend(kept.iter().map(|&(_, region)| self.candidate(e, region, hypothesis)));
        }
        (found[..].into(), closest.sqrt())
    }

    fn candidate(&self, e: usize, region: u32, hypothesis: u8) -> Candidate {
        let Surroundings { regions, edit, .. } = self.around;
        let (ns, ne) = (self.normals[region as usize], edit.axes[e]);
        let (fs, fe) = (self.flatness[region as usize], norm(ne));
        let d = sub(edit.means[e], regions.centroids.rest[region as usize]);
        let offset = if fs > 1e-9 { dot(d, ns) / fs } else { 0.0 };
        Candidate {
            region,
            hypothesis,
            offset: offset.as_f32(),
            tangent_squared: (dot(d, d) - offset * offset).max(0.0).as_f32(),
            flat: (fs * fe).as_f32(),
            misaligned: (fs * fe - dot(ns, ne).abs()).max(0.0).as_f32(),
            unlike: (fs - fe).powi(2).as_f32(),
        }
    }
}

/// Puts `found` in its place among the nearest, of which [`PER_HYPOTHESIS`] are kept.
fn insert(kept: &mut Vec<(f64, u32)>, found: (f64, u32)) {
    let before = |a: &(f64, u32)| a.0.total_cmp(&found.0).then(a.1.cmp(&found.1)).is_lt();
    if kept.len() == PER_HYPOTHESIS {
        if kept.last().is_some_and(before) {
            return;
        }
        kept.pop();
    }
    let place = kept.iter().rposition(before).map_or(0, |i| i + 1);
    kept.insert(place, found);
}
