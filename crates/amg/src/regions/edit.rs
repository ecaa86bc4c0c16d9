//! The edited splats to be matched.

use super::normals::{RING, RingMean, thin_axis, typical_scatter};
use super::source::{MIN_OPACITY, Regions};
use crate::bit_map::BitMap;
use crate::identity::{Identity, IdentityMap};
use crate::keyframes::KeyFrames;
use crate::rigid::{dot, sub};
use anchors::{KdTree, Neighbor};
use gs_core::Splats;
use rayon::prelude::*;

/// Maximum distance of a split-off splat from the centre of its parent, in the parent's largest
/// standard deviation; and maximum difference of their log-scale ratios between axes.
const EXTENT: f64 = 3.0;
const PROPORTIONS: f32 = 1e-4;

/// Edited splats in canonical order, `[E]`.
#[derive(Debug)]
pub(super) struct Edit {
    /// Centres about the origin of the pose, world units.
    pub(super) means: Vec<[f64; 3]>,
    /// Thin axes, length = flatness, sign arbitrary. Averaged over neighbours if the edit's axes
    /// are noisier than the source's, see [`averaged`].
    pub(super) axes: Vec<[f64; 3]>,
    /// Parent: position in the source's `ids` of the only splat that has the same centre, or the
    /// same quaternion and scales, bit for bit (editors that change one property keep the others),
    /// or from which this one may have been split off.
    pub(super) parent: Vec<Option<u32>>,
    /// Position in the source's `ids` of the splat to which this one is identical. Such splats are
    /// not matched, but contribute to the statistics.
    pub(super) exact: Vec<Option<u32>>,
    /// Which of the source's `ids` the edit kept, `[N]`: anywhere, not only near these splats.
    pub(super) kept: Vec<bool>,
}

impl Edit {
    pub(super) fn of(
        keys: &KeyFrames,
        regions: &Regions,
        edited: &Splats,
        rows: &[usize],
        identity: &IdentityMap,
        origin: [f64; 3],
    ) -> Self {
        let (source, ids) = (&keys.at_edit, &regions.ids);
        let mut point_of = vec![None; source.len()];
        for (&id, point) in ids.iter().zip(0_u32..) {
            point_of[id] = Some(point);
        }
        let exact = |is: Identity| is.in_place().and_then(|id| point_of[id as usize]);
        let mut kept = vec![false; ids.len()];
        let point = |is: &Identity| is.source().and_then(|id| point_of[id as usize]);
        for point in identity.rows.iter().filter_map(point) {
            kept[point as usize] = true;
        }
        let ((centres, shapes), by_rotation) = rayon::join(
            || {
                rayon::join(
                    || unique(ids.iter().map(|&i| centre_bits(source, i))),
                    || unique(ids.iter().map(|&i| shape_bits(source, i))),
                )
            },
            || unique(ids.iter().map(|&i| quat_bits(source, i))),
        );
        let parent = |&row: &usize| {
            let by_centre = centres.get(&centre_bits(edited, row)).copied().flatten();
            by_centre.or_else(|| shapes.get(&shape_bits(edited, row)).copied().flatten()).or_else(
                || {
                    let whole = by_rotation.get(&quat_bits(edited, row)).copied().flatten();
                    whole.filter(|&point| may_be_split(source, ids[point as usize], edited, row))
                },
            )
        };
        let means: Vec<[f64; 3]> =
            rows.iter().map(|&row| sub(edited.means[row].map(f64::from), origin)).collect();
        let exact: Vec<Option<u32>> = rows.iter().map(|&row| exact(identity.rows[row])).collect();
        let axes = rows.par_iter().with_min_len(256).map(|&row| thin_axis(edited, row)).collect();
        let opacity = |&row: &usize| f64::from(edited.opacity(row)).max(MIN_OPACITY);
        let weights: Vec<f64> = rows.iter().map(opacity).collect();
        Self {
            axes: averaged(axes, &means, &weights, &exact, regions.scatter),
            parent: rows.par_iter().with_min_len(256).map(parent).collect(),
            means,
            exact,
            kept,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.means.len()
    }
}

/// Denoised thin axes. Splats fitted to images are less well aligned with their surface than those
/// of a trained scene. The scatter s of the edited splats' axes on smooth surfaces is compared with
/// that of the source, s₀: each axis is blended with the mean over its neighbours, which has the
/// weight max(0, 1 − s₀/s). Source splats keep their axes.
fn averaged(
    mut axes: Vec<[f64; 3]>,
    means: &[[f64; 3]],
    weights: &[f64],
    exact: &[Option<u32>],
    source_scatter: Option<f64>,
) -> Vec<[f64; 3]> {
    let open: Vec<usize> = (0..means.len()).filter(|&e| exact[e].is_none()).collect();
    let tree = KdTree::<3>::new(means);
    let ring = |e: usize, near: &[Neighbor]| {
        let members: Vec<u32> = near.iter().map(|n| n.id).collect();
        RingMean::of(axes[e], &members, &axes, weights)
    };
    let scatter = typical_scatter(open.len(), |at| {
        let mut near = Vec::new();
        tree.nearest(&means[open[at]], RING + 1, &mut near);
        ring(open[at], &near)
    });
    let (Some(source_scatter), Some(scatter)) = (source_scatter, scatter) else { return axes };
    if scatter <= source_scatter {
        return axes;
    }
    let noise = 1.0 - source_scatter / scatter;
    let places: Vec<[f64; 3]> = open.iter().map(|&e| means[e]).collect();
    let mixed = tree.map(&places, RING + 1, |at, near| {
        let own = axes[open[at]];
        let mean = ring(open[at], near).map_or(own, |ring| ring.axis);
        [0, 1, 2].map(|a| (1.0 - noise) * own[a] + noise * mean[a])
    });
    for (e, axis) in open.into_iter().zip(mixed) {
        axes[e] = axis;
    }
    axes
}

fn quat_bits(splats: &Splats, i: usize) -> [u32; 4] {
    splats.quats[i].map(|c| (c + 0.0).to_bits())
}

/// Whether `row` may have been split off from source splat `i` by densification: smaller, inside
/// it, with the same proportions.
fn may_be_split(source: &Splats, i: usize, edited: &Splats, row: usize) -> bool {
    let d = sub(edited.means[row].map(f64::from), source.means[i].map(f64::from));
    let reach = source.scale(i).into_iter().fold(0.0_f32, f32::max);
    let shrunk = [0, 1, 2].map(|a| source.log_scales[i][a] - edited.log_scales[row][a]);
    let alike = shrunk.iter().all(|s| (s - shrunk[0]).abs() <= PROPORTIONS);
    alike && shrunk[0] > 0.0 && dot(d, d).sqrt() <= EXTENT * f64::from(reach)
}

/// Position of each key that occurs once; `None` for ambiguous keys.
fn unique<K: std::hash::Hash + Eq>(keys: impl Iterator<Item = K>) -> BitMap<K, Option<u32>> {
    let mut map = BitMap::default();
    for (key, i) in keys.zip(0_u32..) {
        map.entry(key).and_modify(|found| *found = None).or_insert(Some(i));
    }
    map
}

fn centre_bits(splats: &Splats, i: usize) -> [u32; 3] {
    splats.means[i].map(|c| (c + 0.0).to_bits())
}

fn shape_bits(splats: &Splats, i: usize) -> [u32; 7] {
    let ([w, x, y, z], [a, b, c]) = (splats.quats[i], splats.log_scales[i]);
    [w, x, y, z, a, b, c].map(|v| (v + 0.0).to_bits())
}

/// The `open` rows and those source splats that have an open row within `reach`, world units. Rows
/// with non-finite values are excluded.
pub(super) fn involved(
    edited: &Splats,
    open: &[usize],
    identity: &IdentityMap,
    reach: f64,
) -> Vec<usize> {
    let points: Vec<[f64; 3]> = open.iter().map(|&row| edited.means[row].map(f64::from)).collect();
    let tree = KdTree::<3>::new(&points);
    let mut rows: Vec<usize> =
        (0..edited.len()).filter(|&row| identity.rows[row].in_place().is_some()).collect();
    let near_enough: Vec<bool> = rows
        .par_iter()
        .with_min_len(256)
        .map(|&row| tree.any_within(&edited.means[row].map(f64::from), reach))
        .collect();
    let mut near_enough = near_enough.into_iter();
    rows.retain(|_| near_enough.next() == Some(true));
    rows.extend_from_slice(open);
    rows
}
