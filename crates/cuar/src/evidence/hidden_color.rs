//! [`HiddenColor`]: kind of colour, after the edit, of splats that frame 1 hides.

use super::{
    change::{References, expected_changes},
    edited_frame::EditedFrame,
};
use gs_core::{sh, weighted_quantile};

/// Kind of colour after an edit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum HiddenColor {
    /// The colour from before the edit.
    Old,
    /// A colour that the edit intended.
    Meant,
    /// Neither.
    Meaningless,
}

/// Number of supervised splats whose change is compared with that of their surface.
const COMPARED: usize = 2000;
/// Colours of hidden splats are meaningless if their median error exceeds that of supervised splats
/// by this factor.
const FACTOR: f32 = 2.0;
/// Minimum of this error, summed over the channels: errors of an edit in one colour are zero.
const MIN_ERROR: f32 = 0.1;

/// Median error of supervised splats: the difference between their change and the expected one.
pub(super) fn supervised_error(frame: &EditedFrame<'_>, references: &References) -> f32 {
    let step = references.rows.len().div_ceil(COMPARED).max(1);
    let compared: Vec<usize> = references.rows.iter().copied().step_by(step).collect();
    let errors = errors(frame, &compared, references);
    let known = errors.into_iter().filter(|error| error.is_finite());
    weighted_quantile(known.map(|error| (error, 1.0)).collect(), 0.5).unwrap_or(0.0)
}

/// Whether most hidden splats with these errors and weights have meaningless colours, given the
/// median error of supervised splats.
pub(super) fn are_meaningless(hidden: Vec<(f32, f32)>, supervised: f32) -> bool {
    weighted_quantile(hidden, 0.5).unwrap_or(0.0) > (FACTOR * supervised).max(MIN_ERROR)
}

/// Whether a colour with this error is meaningless, if [`are_meaningless`] is true.
pub(super) fn is_meaningless(error: f32, supervised: f32) -> bool {
    error > supervised.max(MIN_ERROR)
}

/// Difference between the change of base colour of each row and the expected one, summed over the
/// channels; infinite without references.
pub(super) fn errors(frame: &EditedFrame<'_>, rows: &[usize], references: &References) -> Vec<f32> {
    let EditedFrame { first, old, .. } = *frame;
    let coeffs = first.sh_coeffs();
    let error = |(&i, change): (&usize, Option<Vec<[f32; 3]>>)| {
        let Some(change) = change else { return f32::INFINITY };
        let (expected, now, then) = (change[0], first.sh_of(i)[0], old[i * coeffs]);
        (0..3).map(|c| ((expected[c] - (now[c] - then[c])) * sh::C0).abs()).sum()
    };
    rows.iter().zip(expected_changes(frame, rows, references)).map(error).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_with_larger_errors_are_meaningless() {
        assert!(are_meaningless(vec![(0.5, 1.0)], 0.2), "larger");
        assert!(!are_meaningless(vec![(0.5, 1.0)], 0.3), "of the same size");
        assert!(!are_meaningless(Vec::new(), 0.0), "none");
    }
}
