//! The default guide: regions of the source, relaxed transport of edited splats to regions, rigid
//! aggregation.
//!
//! The model and its estimation are written down in `docs/MOTION.md`. In the order of the code:
//!
//! 1. Source splats that move with none of their neighbours are outliers; the others form regions
//!    that move as one ([`source`], cells of the `anchors` crate).
//! 2. Regions get rigid motions at the key times ([`region_motion`]) and outward normals
//!    ([`normals`]).
//! 3. Edited splats of one small cube share the search for the regions around them and for the
//!    motions these have ([`cubes`]); each collects some of every motion ([`candidates`]).
//! 4. Costs ([`likelihood`], [`coverage`]) say how probable each motion is; the regions'
//!    statistics, how the edit displaced them, follow, smoothed by [`diffusion`]; and so on in
//!    turns ([`posterior`]).
//! 5. Splats that no region explains follow the nearest ones that some region does ([`graph`]).
//! 6. New connected pieces that stand out follow what they are attached to, as a whole
//!    ([`new_pieces`]).
//! 7. Each takes some sources of its motion, those that agree best ([`support`], [`consensus`]);
//!    their weighted rigid motion is its own.
//!
//! Words are those of the glossary at the head of the crate.

mod candidates;
mod consensus;
mod coverage;
mod cubes;
mod diffusion;
mod edit;
mod graph;
mod likelihood;
mod new_pieces;
mod normals;
mod numeric;
mod posterior;
mod region_motion;
mod source;
mod support;

use crate::keyframes::KeyFrames;
use crate::motion_params::MotionParams;
use crate::pose::Pose;
use crate::report::MotionReport;
use crate::rigid::{dot, sub};
use crate::row_kind::RowKind;
use crate::work::{Progress, Row, Work};
use anchors::{KdTree, RigidNeighbors};
use candidates::Candidates;
use consensus::Consensus;
use cubes::{Cubes, Surroundings};
use edit::Edit;
use gs_core::{Real, Splats};
use posterior::{Given, Model};
use rayon::prelude::*;
use region_motion::RegionMotion;
use source::Regions;
use std::cmp::Ordering;

/// Untouched splats this near to an edited one, as a share of the figure, help to decide what it
/// belongs to: a body part's width.
const NEIGHBORHOOD: f64 = 0.1;

/// Motions of sources that support one splat differ by less than this share of those that are two
/// hypotheses: a hypothesis may bend, a support must not.
const RIGID: f64 = 0.4;

/// Motions are told apart no better than this many times the noise of the regions' trajectories.
const NOISES: f64 = 4.0;

/// One row per entry of `work.open`, and the factor by which the sources' own rotations may be
/// believed.
pub(crate) fn bind(
    work: &Work<'_>,
    params: &MotionParams,
    report: &mut MotionReport,
    progress: Progress<'_>,
) -> (Vec<Row>, f64) {
    let keys = work.keys;
    let usable = (0..keys.at_edit.len()).filter(|&i| !keys.broken[i]).collect();
    let (ids, pose) = sources(usable, keys, &work.split.dynamic);
    let size = work.split.figure_size;
    let none = || (vec![(RowKind::Static, Vec::new()); work.open.len()], 1.0);
    if ids.is_empty() || report.num_dynamic == 0 {
        return none();
    }
    let involved = edit::involved(work.edited, &work.open, work.identity, NEIGHBORHOOD * size);
    let mut clock = std::time::Instant::now();
    let mut lap = |name: &'static str, report: &mut MotionReport| {
        report.timings.push((name, clock.elapsed().as_secs_f64()));
        clock = std::time::Instant::now();
    };
    let order = outwards(lexicographic(involved, work.edited, &[]), work.edited, &pose);
    progress("regions", 0.0);
    let edge = params.region_size * size;
    let regions = Regions::of(keys, ids, &work.split.dynamic, &pose, (edge, params.strain));
    report.num_floaters = regions.num_outliers;
    report.num_parts = regions.len();
    if regions.len() == 0 {
        return none();
    }
    let neighbors = RigidNeighbors::of(&regions.centroids, params.strain);
    let motion = RegionMotion::of(&regions.centroids, &regions.turns, &neighbors);
    if motion.outlier.iter().all(|&o| o) {
        return none();
    }
    let mut normals = regions.axes.clone();
    normals::orient(&regions.centroids, &neighbors, &mut normals);
    lap("regions", report);

    progress("candidates", 0.0);
    let edit = Edit::of(keys, &regions.ids, work.edited, &order, work.identity, pose.origin);
    let tolerance = |share: f64| (share * size).max(NOISES * neighbors.noise).as_f32();
    let around = Surroundings {
        regions: &regions,
        motion: &motion,
        edit: &edit,
        tolerance: tolerance(params.same_motion),
    };
    let cubes = Cubes::of(around, pose.axes, edge);
    let candidates = Candidates::of(around, &normals, &cubes);
    lap("candidates", report);

    progress("posterior", 0.0);
    let model = Model::estimate(&Given {
        regions: &regions,
        neighbors: &neighbors,
        motion: &motion,
        candidates: &candidates,
        edit: &edit,
        params,
        figure_size: size,
    });
    let posteriors = model.posteriors();
    lap("posterior", report);

    progress("support", 0.0);
    let reach = f64::from(work.options.reach) * size;
    let within_reach = |e: usize| candidates.distance[e] <= reach;
    // The likeliest region, if it is likelier than none.
    let matched: Vec<Option<u32>> = (0..edit.len())
        .map(|e| {
            let explained =
                posteriors[e].unmatched < 0.5 && (within_reach(e) || edit.exact[e].is_some());
            posteriors[e].region.filter(|_| explained)
        })
        .collect();
    let (links, spacing) = graph::links(&edit.means);
    let seeds = graph::nearest_seed(&edit.means, &links, |e| matched[e].is_some());
    let pieces = new_pieces::NewPieces {
        regions: &regions,
        motion: &motion,
        edit: &edit,
        matched: &matched,
        links: &links,
        spacing: &spacing,
        stands_out: params.new_geometry * size,
        reach,
    };
    let carriers = pieces.carriers();
    let kept: Vec<usize> = (0..regions.len()).filter(|&i| !motion.outlier[i]).collect();
    let points: Vec<[f64; 3]> = kept.iter().map(|&i| regions.centroids.rest[i]).collect();
    let supports = support::Supports {
        regions: &regions,
        motion: &motion,
        spacing: &neighbors.spacing,
        tolerance: tolerance(RIGID * params.same_motion),
        sources_per_row: params.sources_per_row,
        consensus: Consensus::new(keys, &regions, motion.rotation_quality),
        kept: &kept,
        tree: &KdTree::<3>::new(&points),
    };
    let nothing = || (RowKind::Static, Vec::new());
    let row_of = |scratch: &mut support::Scratch,
                  cube: &cubes::Cube,
                  e: usize|
     -> Option<(Row, bool)> {
        if edit.exact[e].is_some() {
            return None;
        }
        let x = edit.means[e];
        let seed = seeds[e].map(|seed| seed as usize);
        let likeliest = posteriors[e].region.filter(|_| within_reach(e));
        let sources = match (carriers[e], seed.and_then(|seed| matched[seed]), likeliest) {
            (Some(carrier), _, _) => supports.far(x, carrier, scratch),
            (None, Some(region), _) if seed == Some(e) => supports.near(x, cube, region, scratch),
            (None, Some(region), _) | (None, None, Some(region)) => {
                supports.far(x, region, scratch)
            }
            (None, None, None) => return Some((nothing(), true)),
        };
        let (mut moving, mut total) = (0.0, 0.0);
        for &(id, w) in &sources {
            total += w;
            moving += if work.split.dynamic[id as usize] { w } else { 0.0 };
        }
        let blends = moving * 2.0 > total;
        Some((if blends { (RowKind::Blended, sources) } else { nothing() }, false))
    };
    let found = cubes.map_splats(row_of);
    lap("support", report);
    report.out_of_reach = found.iter().flatten().filter(|(_, far)| *far).count();
    // Back from canonical order to that of `open`, which is ascending.
    let mut rows = vec![(RowKind::Static, Vec::new()); work.open.len()];
    for (row, result) in order.iter().zip(found) {
        if let (Some((result, _)), Ok(slot)) = (result, work.open.binary_search(row)) {
            rows[slot] = result;
        }
    }
    (rows, motion.rotation_quality)
}

/// Usable sources from the inside out, and the frame of those that move.
fn sources(usable: Vec<usize>, keys: &KeyFrames, dynamic: &[bool]) -> (Vec<usize>, Pose) {
    let ids = lexicographic(usable, &keys.at_edit, &keys.means);
    let moving = ids.iter().filter(|&&i| dynamic[i]);
    let pose = Pose::of(&moving.map(|&i| keys.at_edit.means[i].map(f64::from)).collect::<Vec<_>>());
    (outwards(ids, &keys.at_edit, &pose), pose)
}

fn compare(a: &[f32], b: &[f32]) -> Ordering {
    let unlike = a.iter().zip(b).map(|(x, y)| x.total_cmp(y)).find(|order| order.is_ne());
    unlike.unwrap_or(Ordering::Equal)
}

/// Rows in an order that depends on what the splats are, `later` too, not on how the file lists
/// them.
fn lexicographic(mut rows: Vec<usize>, splats: &Splats, later: &[Vec<[f32; 3]>]) -> Vec<usize> {
    rows.par_sort_by(|&a, &b| {
        compare(&splats.means[a], &splats.means[b])
            .then_with(|| compare(&splats.quats[a], &splats.quats[b]))
            .then_with(|| compare(&splats.log_scales[a], &splats.log_scales[b]))
            .then_with(|| splats.opacity_logits[a].total_cmp(&splats.opacity_logits[b]))
            .then_with(|| {
                let mut parted = later.iter().map(|means| compare(&means[a], &means[b]));
                parted.find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
            })
    });
    rows
}

/// Rows by their distance from the origin: an order that a rigid motion or a scale of the scene
/// leaves as it is.
fn outwards(rows: Vec<usize>, splats: &Splats, pose: &Pose) -> Vec<usize> {
    let mut keyed: Vec<(f64, usize)> = rows
        .into_iter()
        .map(|row| {
            let d = sub(splats.means[row].map(f64::from), pose.origin);
            (dot(d, d), row)
        })
        .collect();
    keyed.par_sort_by(|a, b| a.0.total_cmp(&b.0));
    keyed.into_iter().map(|(_, row)| row).collect()
}
