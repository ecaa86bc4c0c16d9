//! The default guide: regions of the source, relaxed transport of edited splats to regions, rigid
//! aggregation.
//!
//! `docs/MOTION.md` describes the model and its estimation. In the order of the code:
//!
//! 1. Source splats whose motion differs from that of all their neighbours are outliers; the others
//!    form regions that move together ([`source`], cells of the `anchors` crate).
//! 2. Regions get rigid motions at the key times ([`region_motion`]) and outward normals
//!    ([`normals`]).
//! 3. Edited splats are grouped in small cubes. The splats of a cube share a search for regions,
//!    which are grouped by motion ([`cubes`]); each splat keeps the nearest of every motion
//!    ([`candidates`]).
//! 4. Expectation–maximisation ([`posterior`]): costs ([`likelihood`], [`coverage`]) give the
//!    probability of each motion, and these give the statistics of each region: how the edit
//!    displaced it, smoothed by [`diffusion`].
//! 5. Unmatched splats follow the nearest matched ones along the neighbour graph ([`graph`]).
//! 6. New connected pieces that extend from the figure move as a whole with the part to which they
//!    are attached ([`attachment`]). [`followed_region`] combines 4 to 6.
//! 7. Each splat gets a support: sources with its motion that agree well ([`support`],
//!    [`consensus`]); their weighted rigid motion is its motion.
//!
//! The crate's documentation has a glossary.

mod attachment;
mod candidates;
mod consensus;
mod coverage;
mod cubes;
mod diffusion;
mod edit;
mod followed_region;
mod graph;
mod likelihood;
mod normals;
mod numeric;
mod posterior;
mod region_motion;
mod region_tree;
mod source;
mod support;

use crate::guide_input::{GuideInput, ProgressFn, Row};
use crate::keyframes::KeyFrames;
use crate::motion_params::MotionParams;
use crate::pose::Pose;
use crate::report::MotionReport;
use crate::rigid::{dot, sub};
use crate::row_kind::RowKind;
use anchors::RigidNeighbors;
use candidates::Candidates;
use consensus::Consensus;
use cubes::{Cube, Cubes, SearchSpace};
use edit::Edit;
use followed_region::{FollowInputs, Followed};
use gs_core::{Real, Splats};
use posterior::{ModelInputs, RegionModel};
use rayon::prelude::*;
use region_motion::RegionMotion;
use region_tree::RegionTree;
use source::Regions;
use std::cmp::Ordering;
use std::time::Instant;
use support::{SupportScratch, Supports};

/// Unchanged splats at most this far from an edited one, as a share of the figure, contribute to
/// the statistics: the width of a body part.
const NEIGHBORHOOD: f64 = 0.1;

/// Tolerance of the motions in a support, as a share of that of a hypothesis: parts that bend have
/// one hypothesis, but supports are rigid.
const RIGID: f64 = 0.4;

/// Minimum tolerance of motions, in units of the noise of the regions' trajectories.
const NOISES: f64 = 4.0;

/// One row per entry of `input.open`, and the factor on the weight of the sources' own rotations, 0
/// to 1.
pub(crate) fn bind(
    input: &GuideInput<'_>,
    params: &MotionParams,
    report: &mut MotionReport,
    progress: ProgressFn<'_>,
) -> (Vec<Row>, f64) {
    let all_static = (vec![static_row(); input.open.len()], 1.0);
    let keys = input.keys;
    let usable = (0..keys.at_edit.len()).filter(|&i| !keys.broken[i]).collect();
    let (ids, pose) = sources(usable, keys, &input.split.dynamic);
    if ids.is_empty() || report.num_dynamic == 0 {
        return all_static;
    }
    let size = input.split.figure_size;
    let involved = edit::involved(input.edited, &input.open, input.identity, NEIGHBORHOOD * size);
    let mut clock = Instant::now();
    let mut lap = |name: &'static str, report: &mut MotionReport| {
        report.timings.push((name, clock.elapsed().as_secs_f64()));
        clock = Instant::now();
    };
    let order = outwards(lexicographic(involved, input.edited, &[]), input.edited, &pose);

    progress("regions", 0.0);
    let Some(source) = SourceRegions::of(input, ids, &pose, params, report) else {
        return all_static;
    };
    let SourceRegions { regions, neighbors, motion, normals, tree } = &source;
    lap("regions", report);

    progress("candidates", 0.0);
    let edit = &Edit::of(keys, regions, input.edited, &order, input.identity, pose.origin);
    let tolerance = |share: f64| (share * size).max(NOISES * neighbors.noise).as_f32();
    let space = SearchSpace { regions, motion, edit, tolerance: tolerance(params.same_motion) };
    let cubes = Cubes::of(space, tree, pose.axes, params.region_size * size);
    let candidates = Candidates::of(space, normals, &cubes);
    lap("candidates", report);

    progress("posterior", 0.0);
    let inputs = ModelInputs {
        regions,
        neighbors,
        motion,
        candidates: &candidates,
        edit,
        params,
        figure_size: size,
    };
    let posteriors = &RegionModel::estimate(&inputs).posteriors();
    lap("posterior", report);

    progress("support", 0.0);
    let new_geometry = params.new_geometry * size;
    let reach = f64::from(input.options.reach) * size;
    let inputs = FollowInputs {
        regions,
        motion,
        edit,
        candidates: &candidates,
        posteriors,
        new_geometry,
        reach,
    };
    let followed = inputs.followed();
    // Large, and not needed any more.
    drop(candidates);
    let is_open = |e: usize| edit.exact[e].is_none();
    let out_of_reach = |&e: &usize| is_open(e) && matches!(followed[e], Followed::Nothing);
    report.out_of_reach = (0..edit.len()).filter(out_of_reach).count();
    let supports = Supports {
        regions,
        motion,
        spacing: &neighbors.spacing,
        tolerance: tolerance(RIGID * params.same_motion),
        sources_per_row: params.sources_per_row,
        consensus: Consensus::new(keys, regions, motion.rotation_quality),
        tree,
    };
    let found = cubes.map_splats(|scratch: &mut SupportScratch, cube: &Cube, e| {
        let x = edit.means[e];
        let sources = match followed[e] {
            _ if !is_open(e) => return None,
            Followed::Own(region) => supports.near(x, cube, region, scratch),
            Followed::Other(region) => supports.far(x, region, scratch),
            Followed::Nothing => Vec::new(),
        };
        Some(blended_row(sources, &input.split.dynamic))
    });
    lap("support", report);
    // Back from canonical order to that of `open`, which is ascending.
    let mut rows = vec![static_row(); input.open.len()];
    for (row, found) in order.iter().zip(found) {
        if let (Some(found), Ok(slot)) = (found, input.open.binary_search(row)) {
            rows[slot] = found;
        }
    }
    (rows, motion.rotation_quality)
}

/// Regions of the source, and their motions and normals.
struct SourceRegions {
    regions: Regions,
    neighbors: RigidNeighbors,
    motion: RegionMotion,
    /// Outward normals, length = flatness, `[R]`.
    normals: Vec<[f64; 3]>,
    tree: RegionTree,
}

impl SourceRegions {
    /// Forms the regions of the source rows `ids`; `None` if all of them are outliers.
    fn of(
        input: &GuideInput<'_>,
        ids: Vec<usize>,
        pose: &Pose,
        params: &MotionParams,
        report: &mut MotionReport,
    ) -> Option<Self> {
        let shape = (params.region_size * input.split.figure_size, params.strain);
        let regions = Regions::of(input.keys, ids, &input.split.dynamic, pose, shape);
        report.num_floaters = regions.num_outliers;
        report.num_regions = regions.len();
        if regions.len() == 0 {
            return None;
        }
        let neighbors = RigidNeighbors::of(&regions.centroids, params.strain);
        let motion = RegionMotion::of(&regions.centroids, &regions.rotations, &neighbors);
        if motion.outlier.iter().all(|&o| o) {
            return None;
        }
        let mut normals = regions.axes.clone();
        normals::orient(&regions.centroids, &neighbors, &mut normals);
        let tree = RegionTree::new(&regions, &motion);
        Some(Self { regions, neighbors, motion, normals, tree })
    }
}

fn static_row() -> Row {
    (RowKind::Static, Vec::new())
}

/// A row that blends `sources`, or a static one unless more than half of their weight moves.
fn blended_row(sources: Vec<(u32, f32)>, dynamic: &[bool]) -> Row {
    let (mut moving, mut total) = (0.0, 0.0);
    for &(id, w) in &sources {
        total += w;
        moving += if dynamic[id as usize] { w } else { 0.0 };
    }
    if moving * 2.0 > total { (RowKind::Blended, sources) } else { static_row() }
}

/// The `usable` sources by distance from the origin of the pose, and the pose of those that move.
fn sources(usable: Vec<usize>, keys: &KeyFrames, dynamic: &[bool]) -> (Vec<usize>, Pose) {
    let ids = lexicographic(usable, &keys.at_edit, &keys.means);
    let moving = ids.iter().filter(|&&i| dynamic[i]);
    let pose = Pose::of(&moving.map(|&i| keys.at_edit.means[i].map(f64::from)).collect::<Vec<_>>());
    (outwards(ids, &keys.at_edit, &pose), pose)
}

fn compare(a: &[f32], b: &[f32]) -> Ordering {
    let different = a.iter().zip(b).map(|(x, y)| x.total_cmp(y)).find(|order| order.is_ne());
    different.unwrap_or(Ordering::Equal)
}

/// Rows sorted by the values of the splats, and by their positions `later`, so that the order does
/// not depend on the file.
fn lexicographic(rows: Vec<usize>, splats: &Splats, later: &[Vec<[f32; 3]>]) -> Vec<usize> {
    let compare_rest = |a: usize, b: usize| {
        compare(&splats.quats[a], &splats.quats[b])
            .then_with(|| compare(&splats.log_scales[a], &splats.log_scales[b]))
            .then_with(|| splats.opacity_logits[a].total_cmp(&splats.opacity_logits[b]))
            .then_with(|| {
                let mut orders = later.iter().map(|means| compare(&means[a], &means[b]));
                orders.find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
            })
    };
    // Centres are stored with the rows: they nearly always determine the order.
    let mut keyed: Vec<([f32; 3], usize)> =
        rows.into_iter().map(|row| (splats.means[row], row)).collect();
    keyed.par_sort_by(|a, b| compare(&a.0, &b.0).then_with(|| compare_rest(a.1, b.1)));
    keyed.into_iter().map(|(_, row)| row).collect()
}

/// Rows sorted by distance from the origin of the pose: an order that does not depend on the pose
/// and scale of the scene.
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
