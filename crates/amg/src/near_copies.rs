//! Edited splats next to a copy, for example a hat on the copy of a dancer.
//!
//! Such splats move with the copy, not with the source splats around them. Each is assigned the
//! source splat that is nearest under the inverse of the copy's similarity, and moves as the copy
//! of that splat. Splats next to a selection that was moved, not copied, are left to the motion
//! guide.

use crate::carriers::copies;
use crate::identity::{Identity, IdentityMap};
use crate::keyframes::KeyFrames;
use anchors::KdTree;
use gs_core::Splats;

/// A row that moves with a copy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Companion {
    /// Row of the edit.
    pub(crate) row: usize,
    /// Source splat whose trajectory it follows.
    pub(crate) source: u32,
    /// The nearest moved row, whose group it joins.
    pub(crate) neighbor: usize,
}

/// Edited rows whose nearest recognised splat belongs to a copy, within `reach` (world units).
pub(crate) fn companions(
    keys: &KeyFrames,
    edited: &Splats,
    identity: &IdentityMap,
    reach: f64,
) -> Vec<Companion> {
    if identity.similarities.is_empty() || identity.edited == 0 {
        return Vec::new();
    }
    let copies = copies(identity, keys.at_edit.len());
    if !copies.contains(&true) {
        return Vec::new();
    }
    let place = |row: usize| edited.means[row].map(f64::from);
    let rows = |wanted: fn(&Identity) -> bool| -> Vec<usize> {
        let finite = |&row: &usize| edited.is_finite(row) && wanted(&identity.rows[row]);
        (0..edited.len()).filter(finite).collect()
    };
    let known = rows(|row| *row != Identity::Edited);
    let open = rows(|row| *row == Identity::Edited);
    let usable: Vec<usize> = (0..keys.at_edit.len()).filter(|&id| !keys.broken[id]).collect();
    if known.is_empty() || usable.is_empty() {
        return Vec::new();
    }
    let known_tree = KdTree::<3>::new(&known.iter().map(|&row| place(row)).collect::<Vec<_>>());
    let at_edit = |&id: &usize| keys.at_edit.means[id].map(f64::from);
    let source_tree = KdTree::<3>::new(&usable.iter().map(at_edit).collect::<Vec<_>>());
    let mut near = Vec::new();
    let mut found = Vec::new();
    for row in open {
        known_tree.nearest(&place(row), 1, &mut near);
        let neighbor = known[near[0].id as usize];
        let Identity::Moved { group, .. } = identity.rows[neighbor] else { continue };
        if !copies[group as usize] || near[0].distance_squared.sqrt() > reach {
            continue;
        }
        let undone = identity.similarities[group as usize].inverse().apply(place(row));
        source_tree.nearest(&undone, 1, &mut near);
        let source = crate::row_index::index(usable[near[0].id as usize]);
        found.push(Companion { row, source, neighbor });
    }
    found
}
