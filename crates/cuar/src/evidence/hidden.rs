//! [`Hidden`]: splats that frame 1 hides, the kind of colour they have after the edit, and the
//! surface around them.

use super::{
    change::References,
    edited_frame::EditedFrame,
    harmonic::extend_labels,
    hidden_color::{HiddenColor, are_meaningless, errors, is_meaningless, supervised_error},
    params::EvidenceParams,
};

/// Splats with a source that frame 1 hides, at least in part.
pub(super) struct Hidden {
    /// Ascending.
    rows: Vec<usize>,
    /// Kind of colour of each after the edit.
    colors: Vec<HiddenColor>,
    /// For every splat, the shares of the surface around it that the edit changed and deleted;
    /// `None` where that surface has no supervised splats.
    pub(super) shares: Vec<Option<[f32; 2]>>,
    /// Whether the edit changed most hidden splats of the surfaces that it changed.
    pub(super) is_reached: bool,
    pub(super) references: References,
}

impl Hidden {
    pub(super) fn of(
        frame: &EditedFrame<'_>,
        changed: &[bool],
        supervision: &[f32],
        params: &EvidenceParams,
    ) -> Self {
        let EditedFrame { nodes, surface, .. } = *frame;
        let label = |i: usize| match changed.get(i) {
            Some(&changed) => [f32::from(u8::from(changed)), 0.0],
            None => [0.0, 1.0],
        };
        // deleted splats count as supervised, visible or not; splats without a source have no known
        // change
        let seen = |i: usize| match supervision.get(i) {
            Some(&supervision) if nodes.has_source[i] => supervision,
            Some(_) => 0.0,
            None => 1.0,
        };
        let by_seen = extend_labels(surface, &label, &seen);
        let hidden = (0..changed.len()).filter(|&i| nodes.has_source[i] && supervision[i] < 1.0);
        let rows: Vec<usize> = hidden.collect();
        let references = References::of(frame, changed, supervision, params);
        let supervised_error = supervised_error(frame, &references);
        let is_known = |i: &usize| changed[*i] && frame.source_rows[*i].is_some();
        let of_changed: Vec<usize> = rows.iter().copied().filter(is_known).collect();
        let mut error_of = vec![0.0; changed.len()];
        for (&i, error) in of_changed.iter().zip(errors(frame, &of_changed, &references)) {
            error_of[i] = error;
        }
        let weight = |i: usize| 1.0 - supervision[i];
        let on_edited = |i: &usize| by_seen[*i].is_some_and(|[changed, gone]| changed + gone > 0.5);
        let errors = of_changed.iter().copied().filter(on_edited).map(|i| (error_of[i], weight(i)));
        let has_meaningless = are_meaningless(errors.collect(), supervised_error);
        let is_hidden = |&i: &usize| {
            supervision[i] <= 0.0 && by_seen[i].is_some_and(|[changed, _]| changed > 0.5)
        };
        let hidden: Vec<usize> = rows.iter().copied().filter(is_hidden).collect();
        let is_reached = !has_meaningless && is_reached(&hidden, changed, frame.source_rows);
        let color = |&i: &usize| {
            if !changed[i] {
                HiddenColor::Old
            } else if has_meaningless
                && supervision[i] < 0.5
                && is_meaningless(error_of[i], supervised_error)
            {
                HiddenColor::Meaningless
            } else {
                HiddenColor::Meant
            }
        };
        let colors: Vec<HiddenColor> = rows.iter().map(color).collect();
        let mut is_meaningless = vec![false; changed.len()];
        for (&i, color) in rows.iter().zip(&colors) {
            is_meaningless[i] = *color == HiddenColor::Meaningless;
        }
        let known = |i: usize| match changed.get(i) {
            Some(_) if is_meaningless[i] => 0.0,
            Some(true) if nodes.has_source[i] => 1.0,
            _ => seen(i),
        };
        let mut shares = extend_labels(surface, &label, &known);
        shares.truncate(changed.len());
        Self { rows, colors, shares, is_reached, references }
    }

    /// Rows whose colour is not the one that the edit intended.
    pub(super) fn open(&self) -> impl Iterator<Item = usize> + '_ {
        let all = self.rows.iter().zip(&self.colors);
        all.filter(|(_, color)| **color != HiddenColor::Meant).map(|(row, _)| *row)
    }

    /// Rows with this kind of colour.
    pub(super) fn with_color(&self, color: HiddenColor) -> impl Iterator<Item = usize> + '_ {
        let all = self.rows.iter().zip(&self.colors);
        all.filter(move |(_, own)| **own == color).map(|(row, _)| *row)
    }

    /// Number of open rows near a change for which the surface does not determine whether they
    /// belong to it.
    pub(super) fn num_ambiguous(&self, params: &EvidenceParams) -> usize {
        let is_ambiguous = |row: &usize| {
            self.shares[*row].is_some_and(|[changed, deleted]| {
                changed + deleted > 0.2 && changed.max(deleted) <= params.min_agreement
            })
        };
        self.open().filter(is_ambiguous).count()
    }
}

/// Whether the edit changed most of these `hidden` rows: an edit in 3D. An edit in pictures leaves
/// those that no picture shows, but moves and adds others that are then hidden; so only rows with
/// the geometry of a source splat count, unless these are fewer than a quarter.
fn is_reached(hidden: &[usize], changed: &[bool], source_rows: &[Option<u32>]) -> bool {
    let mut counted: Vec<usize> =
        hidden.iter().copied().filter(|&i| source_rows[i].is_some()).collect();
    if 4 * counted.len() < hidden.len() {
        counted = hidden.to_vec();
    }
    2 * counted.iter().filter(|&&i| changed[i]).count() > counted.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moved_splats_count_only_if_there_are_few_others() {
        let hidden: Vec<usize> = (0..12).collect();
        let changed: Vec<bool> = (0..12).map(|i| i >= 4).collect();
        let in_place = |count: usize| -> Vec<Option<u32>> {
            (0..12).map(|i| (i < count).then_some(7)).collect()
        };
        assert!(!is_reached(&hidden, &changed, &in_place(5)), "4 of 5 in place are unchanged");
        assert!(is_reached(&hidden, &changed, &in_place(2)), "8 of 12 are changed");
        assert!(is_reached(&hidden, &changed, &in_place(12)), "all in place");
        assert!(!is_reached(&[], &changed, &in_place(12)), "none");
    }
}
