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
        // Pictures also change splats that they show a little of, and move and add splats, some of
        // which are then hidden by others. Only an edit in 3D changes, in place, what none shows.
        let hidden_in_place = |&&i: &&usize| {
            supervision[i] <= 0.0
                && frame.source_rows[i].is_some()
                && by_seen[i].is_some_and(|[changed, _]| changed > 0.5)
        };
        let all = rows.iter().filter(hidden_in_place).count();
        let reached = rows.iter().filter(hidden_in_place).filter(|&&i| changed[i]).count();
        let is_reached = !has_meaningless && 2 * reached > all;
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
