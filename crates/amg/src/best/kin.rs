//! Which source splat an edited one descends from, as far as anything tells.
//!
//! Editors that change one property keep the others, bit for bit: that is proof. Where an optimiser has moved splats less than
//! half the way to their neighbours, the nearest source of like size and facing is the parent; but in swollen clothes some
//! clones lie on strangers by chance, so resemblance counts only where it is the rule.

use super::cells::Cells;
use super::cloud::{TINY, spacing};
use super::edit::{Edit, ascending};
use super::graph::Link;
use super::surface::thin_axis;
use crate::keyframes::KeyFrames;
use crate::rigid::{dot, norm};
use anchors::{KdTree, Neighbor};
use gs_core::Real;
use rayon::prelude::*;

/// What proven descent is worth, and the most that resemblance is.
const PROVEN: f32 = 8.0;
const LIKELY: f64 = 1.5;

/// Sources looked at; the last tells the spacing.
const NEAREST: usize = 7;

/// Distance, in spacings of the sources, and difference of the logarithms of scales at which resemblance fades.
const PLACE: f64 = 0.35;
const SIZE: f64 = 0.5;

/// What facing otherwise costs.
const FACING: f64 = 4.0;

/// Mean resemblance of a neighbourhood that chance explains, and what more of it is worth.
const CHANCE: f64 = 0.15;
const RULE: f64 = 50.0;

/// Parent (a point of `cells`) of each splat, and what that is worth as evidence.
pub(super) fn of(
    keys: &KeyFrames,
    cells: &Cells,
    edit: &Edit,
    links: &[Link],
) -> Vec<Option<(u32, f32)>> {
    let tree = KdTree::<3>::new(&cells.means);
    let found: Vec<Option<(u32, f64)>> = (0..edit.len())
        .into_par_iter()
        .with_min_len(256)
        .map_init(Vec::new, |near, e| {
            if let Some(point) = edit.exact[e].or(edit.lineage[e]) {
                return Some((point, 1.0));
            }
            tree.nearest(&edit.means[e], NEAREST, near);
            let h = spacing(std::slice::from_ref(near))[0].max(TINY);
            let candidates = near.iter().map(|n| (n.id, resemblance(keys, cells, edit, e, n, h)));
            let likely = candidates.filter(|candidate| candidate.1.is_finite());
            likely.reduce(|best, next| if next.1 > best.1 { next } else { best })
        })
        .collect();
    let proven = |e: usize| edit.exact[e].is_some() || edit.lineage[e].is_some();
    // The proven say nothing about how far the others were moved.
    let mut around: Vec<(f64, f64)> = (0..edit.len())
        .map(|e| if proven(e) { (0.0, 0.0) } else { (found[e].map_or(0.0, |k| k.1), 1.0) })
        .collect();
    let own = around.clone();
    for &(a, b) in links {
        for (to, from) in [(a, b), (b, a)] {
            around[to as usize].0 += own[from as usize].0;
            around[to as usize].1 += own[from as usize].1;
        }
    }
    (0..edit.len())
        .map(|e| {
            let (parent, evidence) = found[e]?;
            let rule = RULE * (around[e].0 / around[e].1 - CHANCE).max(0.0).powi(2);
            let worth = if proven(e) { PROVEN } else { (evidence * rule.min(LIKELY)).as_f32() };
            (worth > 0.05).then_some((parent, worth))
        })
        .collect()
}

/// 1 for a splat in the place of source `n`, as large and facing the same way.
fn resemblance(
    keys: &KeyFrames,
    cells: &Cells,
    edit: &Edit,
    e: usize,
    n: &Neighbor,
    spacing: f64,
) -> f64 {
    let i = cells.ids[n.id as usize];
    let place = n.distance_squared / (PLACE * spacing).powi(2);
    let (a, b) = (edit.log_scales[e], ascending(keys.at_edit.log_scales[i]));
    let sizes = (0..3).map(|k| f64::from(a[k] - b[k]).powi(2)).sum::<f64>() / 3.0;
    let (a, b) = (edit.axes[e], thin_axis(&keys.at_edit, i));
    let misaligned = norm(a) * norm(b) - dot(a, b).abs();
    (-0.5 * (place + sizes / (SIZE * SIZE)) - FACING * misaligned).exp()
}
