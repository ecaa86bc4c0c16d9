//! [`missing_changes`]: the difference between expected and actual colour change of hidden splats.

use super::{
    change::expected_changes, edited_frame::EditedFrame, hidden::Hidden, hidden_color::HiddenColor,
    params::EvidenceParams,
};

/// Missing change of one splat.
pub(super) struct MissingChange {
    pub(super) row: usize,
    /// Share of the surface around it that has the expected change.
    pub(super) share: f32,
    /// Expected change of SH minus its own, `[K,3]`.
    pub(super) change: Vec<[f32; 3]>,
}

/// The missing changes of the open rows of `hidden`, ascending by row; and the number of open rows
/// on a surface that the edit changed, but without supervised splats to compare with.
///
/// On a surface that the edit changed, this is the rest of its change; elsewhere, it is the change
/// that restores the old colour of a splat with a meaningless one.
pub(super) fn missing_changes(
    frame: &EditedFrame<'_>,
    hidden: &Hidden,
    params: &EvidenceParams,
) -> (Vec<MissingChange>, usize) {
    let EditedFrame { first, old, .. } = *frame;
    let coeffs = first.sh_coeffs();
    let share = |row: usize| hidden.shares[row].unwrap_or_default();
    let on_changed = |row: &usize| !hidden.is_reached && share(*row)[0] > params.min_agreement;
    let missed: Vec<usize> = hidden.open().filter(on_changed).collect();
    let expected = expected_changes(frame, &missed, &hidden.references);
    let num_without = expected.iter().filter(|change| change.is_none()).count();
    let mut found: Vec<MissingChange> = missed
        .iter()
        .zip(expected)
        .filter_map(|(&row, change)| {
            Some(MissingChange { row, share: share(row)[0], change: change? })
        })
        .collect();
    for row in hidden.with_color(HiddenColor::Meaningless) {
        let Some([changed, deleted]) = hidden.shares[row] else { continue };
        let share = 1.0 - changed - deleted;
        if share > params.min_agreement {
            found.push(MissingChange { row, share, change: vec![[0.0; 3]; coeffs] });
        }
    }
    found.sort_by_key(|missing_change| missing_change.row);
    for MissingChange { row, change, .. } in &mut found {
        let (now, then) = (first.sh_of(*row), &old[*row * coeffs..]);
        for (k, change) in change.iter_mut().enumerate() {
            (0..3).for_each(|c| change[c] -= now[k][c] - then[k][c]);
        }
    }
    (found, num_without)
}
