//! Candidate regions of each edited splat, grouped by hypothesis.

use super::cubes::{Cube, Cubes, HypothesisScratch, MAX_HYPOTHESES, SearchSpace};
use crate::rigid::{dot, norm, sub};
use anchors::NO_CELL;
use gs_core::Real;

/// Maximum number of regions per hypothesis: more than one, because the plane of a single region
/// may be tilted.
const PER_HYPOTHESIS: usize = 8;

/// A region to which an edited splat may belong.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    pub(super) region: u32,
    /// Index of the splat's hypothesis with the motion of the region.
    pub(super) hypothesis: u8,
    /// Signed offset of the splat from the region along its outward normal, world units.
    pub(super) offset: f32,
    /// Squared distance within the region's tangent plane, world units².
    pub(super) tangent_squared: f32,
    /// Product of the flatness of splat and region: 0 if either is a ball.
    pub(super) flatness: f32,
    /// `flatness · (1 − |cos|)` of the angle between the normals, whose signs are ignored.
    pub(super) misalignment: f32,
    /// Squared difference of the flatness of splat and region.
    pub(super) flatness_gap: f32,
}

/// Candidate regions of all edited splats.
#[derive(Debug)]
pub(super) struct Candidates {
    /// Candidates of each splat by hypothesis, the nearest of each first.
    entries: Vec<Box<[Candidate]>>,
    /// Distance of the nearest candidate, world units; infinite for source splats and if there is
    /// none.
    pub(super) distance: Vec<f64>,
}

impl Candidates {
    /// Candidates of splat `e`.
    pub(super) fn of_splat(&self, e: usize) -> &[Candidate] {
        &self.entries[e]
    }

    /// Searches the candidates of every edited splat. `normals` `[R]` are those of the regions,
    /// with length = flatness.
    pub(super) fn of(space: SearchSpace<'_>, normals: &[[f64; 3]], cubes: &Cubes) -> Self {
        let flatness = normals.iter().map(|&n| norm(n)).collect();
        let search = CandidateSearch { space, normals, flatness };
        let found = cubes.map_splats(|scratch: &mut CandidateScratch, cube, e| {
            search.of_splat(e, cube, scratch)
        });
        let (entries, distance) = found.into_iter().unzip();
        Self { entries, distance }
    }
}

/// Buffers reused from splat to splat.
#[derive(Default)]
struct CandidateScratch {
    grouping: HypothesisScratch,
    regions: Vec<u32>,
    nearest: [Vec<(f64, u32)>; MAX_HYPOTHESES],
    found: Vec<Candidate>,
}

struct CandidateSearch<'a> {
    space: SearchSpace<'a>,
    normals: &'a [[f64; 3]],
    flatness: Vec<f64>,
}

impl CandidateSearch<'_> {
    fn of_splat(
        &self,
        e: usize,
        cube: &Cube,
        scratch: &mut CandidateScratch,
    ) -> (Box<[Candidate]>, f64) {
        let SearchSpace { regions, edit, .. } = self.space;
        let region_of = |point: u32| {
            let region = regions.cells.owners[point as usize];
            (region != NO_CELL).then_some(region)
        };
        if let Some(point) = edit.exact[e] {
            // The only candidate of a source splat is its own region; outliers have none.
            let own = region_of(point).map(|region| self.candidate(e, region, 0));
            return (own.into_iter().collect(), f64::INFINITY);
        }
        let x = edit.means[e];
        let CandidateScratch { grouping, regions: with_parent, nearest, found } = scratch;
        // A splat with a parent may have been moved: hypotheses are formed at its own position, and
        // the motion of the parent's region is the first.
        let (candidates, hypotheses) = if let Some(parent) = edit.parent[e].and_then(region_of) {
            with_parent.clear();
            with_parent.push(parent);
            with_parent.extend(cube.regions.iter().filter(|&&region| region != parent));
            (&with_parent[..], self.space.hypotheses(x, with_parent, grouping))
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
        let SearchSpace { regions, edit, .. } = self.space;
        let (ns, ne) = (self.normals[region as usize], edit.axes[e]);
        let (fs, fe) = (self.flatness[region as usize], norm(ne));
        let d = sub(edit.means[e], regions.centroids.rest[region as usize]);
        let offset = if fs > 1e-9 { dot(d, ns) / fs } else { 0.0 };
        Candidate {
            region,
            hypothesis,
            offset: offset.as_f32(),
            tangent_squared: (dot(d, d) - offset * offset).max(0.0).as_f32(),
            flatness: (fs * fe).as_f32(),
            misalignment: (fs * fe - dot(ns, ne).abs()).max(0.0).as_f32(),
            flatness_gap: (fs - fe).powi(2).as_f32(),
        }
    }
}

/// Inserts `found` (squared distance, region) into the sorted list of at most [`PER_HYPOTHESIS`].
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
