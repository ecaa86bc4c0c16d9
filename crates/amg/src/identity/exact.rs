//! Edited splats that equal source splats bit for bit.

use super::row::Identity;
use super::tolerance::appearance_within;
use crate::row_index::index;
use gs_core::{Fnv1a, Splats};
use rayon::prelude::*;
use std::cmp::Ordering;

/// Fields that must be equal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fields {
    All,
    /// Centre, rotation and scales.
    Geometry,
}

/// Fills the entries of `rows` that are equal to source splats: first in all fields, so that rows
/// of coincident source splats are matched by colour, then in geometry. Rows with equal bits are
/// paired with equal source splats in order, surplus rows with the last one.
pub(super) fn match_by_bits(
    source: &Splats,
    edited: &Splats,
    tolerance: f64,
    rows: &mut [Identity],
) {
    let mut used = vec![false; source.len()];
    let all: Vec<u32> = (0..source.len()).map(index).collect();
    let open: Vec<u32> = (0..edited.len()).map(index).collect();
    for_each_pair((source, &all), (edited, &open), Fields::All, |id, row| {
        used[id as usize] = true;
        rows[row as usize] = Identity::Unchanged(id);
    });
    let open: Vec<u32> =
        open.into_iter().filter(|&row| rows[row as usize] == Identity::Edited).collect();
    if open.is_empty() {
        return;
    }
    // Source splats without a row are paired first.
    let (mut ids, matched): (Vec<u32>, Vec<u32>) =
        all.into_iter().partition(|&id| !used[id as usize]);
    ids.extend(matched);
    for_each_pair((source, &ids), (edited, &open), Fields::Geometry, |id, row| {
        let same = appearance_within(source, id as usize, edited, row as usize, tolerance);
        rows[row as usize] = if same { Identity::Unchanged(id) } else { Identity::Recolored(id) };
    });
}

/// Calls `each` with pairs of a splat of `a` and one of `b` that are equal in `fields`: equal
/// splats of `b` are paired with those of `a` in the order of ids, surplus ones with the last.
fn for_each_pair(
    (a, a_ids): (&Splats, &[u32]),
    (b, b_ids): (&Splats, &[u32]),
    fields: Fields,
    mut each: impl FnMut(u32, u32),
) {
    let (a_sorted, b_sorted) = (sorted(a, a_ids, fields), sorted(b, b_ids, fields));
    let mut at = 0;
    let mut previous: Option<u32> = None;
    for &(hash, place) in &b_sorted {
        let row = b_ids[place as usize];
        let is_new = previous
            .is_none_or(|other| compare((b, other as usize), (b, row as usize), fields).is_ne());
        previous = Some(row);
        let order = |&(other, place): &(u64, u32)| {
            let id = a_ids[place as usize] as usize;
            other.cmp(&hash).then_with(|| compare((a, id), (b, row as usize), fields))
        };
        if is_new {
            at += a_sorted[at..].iter().take_while(|entry| order(entry).is_lt()).count();
        } else if a_sorted.get(at + 1).is_some_and(|entry| order(entry).is_eq()) {
            at += 1;
        }
        if let Some(entry) = a_sorted.get(at).filter(|entry| order(entry).is_eq()) {
            each(a_ids[entry.1 as usize], row);
        }
    }
}

/// Hash and index in `ids` of each splat, in the order of (hash, fields, index).
fn sorted(splats: &Splats, ids: &[u32], fields: Fields) -> Vec<(u64, u32)> {
    let mut entries: Vec<(u64, u32)> = ids
        .par_iter()
        .zip(0_u32..index(ids.len()))
        .with_min_len(1024)
        .map(|(&id, place)| (hash(splats, id as usize, fields), place))
        .collect();
    entries.par_sort_unstable_by(|a, b| {
        let by_fields = || {
            let [a, b] = [a, b].map(|entry| (splats, ids[entry.1 as usize] as usize));
            compare(a, b, fields)
        };
        a.0.cmp(&b.0).then_with(by_fields).then(a.1.cmp(&b.1))
    });
    entries
}

/// Bits of a value, `−0` as `0`. NaN payloads are kept: equal bits are equal values in a file.
fn bits(value: f32) -> u32 {
    if value == 0.0 { 0 } else { value.to_bits() }
}

fn geometry(splats: &Splats, i: usize) -> impl Iterator<Item = u32> + '_ {
    let values = splats.means[i].iter().chain(&splats.quats[i]).chain(&splats.log_scales[i]);
    values.map(|&value| bits(value))
}

/// Opacity and colour without trailing zero coefficients: a missing degree equals a degree of
/// zeros.
fn appearance(splats: &Splats, i: usize) -> impl Iterator<Item = u32> + '_ {
    let sh = splats.sh_of(i);
    let kept = sh.iter().rposition(|rgb| rgb.map(bits) != [0; 3]).map_or(0, |last| last + 1);
    let opacity = std::iter::once(&splats.opacity_logits[i]);
    opacity.chain(sh[..kept].iter().flatten()).map(|&value| bits(value))
}

fn hash(splats: &Splats, i: usize, fields: Fields) -> u64 {
    let mut hash = Fnv1a::default();
    geometry(splats, i).for_each(|word| hash.word(word.into()));
    if fields == Fields::All {
        appearance(splats, i).for_each(|word| hash.word(word.into()));
    }
    hash.finish()
}

fn compare((a, i): (&Splats, usize), (b, j): (&Splats, usize), fields: Fields) -> Ordering {
    let by_geometry = geometry(a, i).cmp(geometry(b, j));
    match fields {
        Fields::Geometry => by_geometry,
        Fields::All => by_geometry.then_with(|| appearance(a, i).cmp(appearance(b, j))),
    }
}
