//! Rows that are damaged only in some frames of a sequence: there they are
//! invisible and have the geometry of the nearest undamaged frame, so that they do
//! not move while they fade in next to such a frame.

use crate::repair::TRANSPARENT_LOGIT;
use gs_core::Splats;
use std::collections::BTreeMap;

/// A damaged row, and the frame whose values replace it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Hidden {
    stand_in: u32,
    row: u32,
}

/// Rows to hide, by frame.
#[derive(Debug, Default)]
pub(super) struct HiddenRows(Vec<Vec<Hidden>>);

impl HiddenRows {
    /// From the damaged rows of each frame, ascending. Also returns the rows that are damaged in
    /// every frame, ascending. Frames and rows are counted in 32 bits.
    pub(super) fn of(damaged: &[Vec<usize>]) -> (Self, Vec<usize>) {
        let small = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        let mut frames_of: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
        for (frame, rows) in damaged.iter().enumerate() {
            for &row in rows {
                frames_of.entry(row).or_default().push(small(frame));
            }
        }
        let count = small(damaged.len());
        let mut hidden: Vec<Vec<Hidden>> = vec![Vec::new(); damaged.len()];
        let mut gone = Vec::new();
        for (row, frames) in frames_of {
            if frames.len() == damaged.len() {
                gone.push(row);
                continue;
            }
            // Runs of consecutive damaged frames, bounded by
            // undamaged ones or the ends of the clip.
            for run in frames.chunk_by(|a, b| a + 1 == *b) {
                let (first, last) = (run[0], run[run.len() - 1]);
                let before = first.checked_sub(1);
                let after = Some(last + 1).filter(|&after| after < count);
                for &frame in run {
                    let stand_in = match (before, after) {
                        (Some(before), Some(after)) if frame - before <= after - frame => before,
                        (Some(before), None) => before,
                        (_, after) => after.unwrap_or(frame),
                    };
                    hidden[frame as usize].push(Hidden { stand_in, row: small(row) });
                }
            }
        }
        for rows in &mut hidden {
            rows.sort_unstable();
        }
        (Self(hidden), gone)
    }

    /// The replacement frames for a frame, each with its rows.
    pub(super) fn of_frame(&self, frame: usize) -> impl Iterator<Item = (usize, Vec<usize>)> + '_ {
        let hidden = self.0.get(frame).map_or(&[][..], Vec::as_slice);
        hidden.chunk_by(|a, b| a.stand_in == b.stand_in).map(|group| {
            (group[0].stand_in as usize, group.iter().map(|hidden| hidden.row as usize).collect())
        })
    }
}

/// Sets `rows` of a frame to the values of `stand_in`, but invisible.
pub(super) fn hide(splats: &mut Splats, stand_in: &Splats, rows: Vec<usize>) {
    let coeffs = splats.sh_coeffs();
    for row in rows {
        splats.means[row] = stand_in.means[row];
        splats.quats[row] = stand_in.quats[row];
        splats.log_scales[row] = stand_in.log_scales[row];
        splats.sh[row * coeffs..(row + 1) * coeffs].copy_from_slice(stand_in.sh_of(row));
        splats.opacity_logits[row] = TRANSPARENT_LOGIT;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_undamaged_frame_replaces_damaged_rows() {
        // Row 1 is damaged at the start, row 2 in the middle, row
        // 3 at the end, row 4 in all frames.
        let damaged = [vec![1, 4], vec![1, 2, 4], vec![2, 4], vec![2, 4], vec![3, 4], vec![3, 4]];
        let (hidden, gone) = HiddenRows::of(&damaged);
        assert_eq!(gone, [4], "never valid");
        let of = |frame: usize| hidden.of_frame(frame).collect::<Vec<_>>();
        assert_eq!(of(0), [(2, vec![1])], "the first frame after the run");
        assert_eq!(of(1), [(0, vec![2]), (2, vec![1])], "either side");
        assert_eq!(of(2), [(0, vec![2])], "equally near: the one before");
        assert_eq!(of(3), [(4, vec![2])], "nearer: the one after");
        assert_eq!(of(5), [(3, vec![3])], "the last frame before the run");
        assert!(HiddenRows::default().of_frame(3).next().is_none(), "nothing is damaged");
    }
}
