//! Distribution of a scene's rows over threads: contiguous segments
//! with at most one panel of moving rows each.

use crate::linear::PANEL;
use std::ops::Range;

/// Largest number of rows in a segment, so that several threads share long runs of static rows.
const MAX_ROWS: usize = 8192;

/// Contiguous rows, and the range of moving rows among them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Segment {
    pub(super) rows: Range<usize>,
    pub(super) moving: Range<usize>,
}

/// Splits `0..num_rows` so that each segment contains at most a
/// panel of the ascending rows `moving`.
pub(super) fn segments(num_rows: usize, moving: &[u32]) -> Vec<Segment> {
    let mut segments = Vec::new();
    let (mut row, mut first) = (0, 0);
    while row < num_rows {
        let limit = (row + MAX_ROWS).min(num_rows);
        let inside = moving[first..].iter().take(PANEL).take_while(|&&m| (m as usize) < limit);
        let last = first + inside.count();
        // A full panel ends before the next moving row.
        let end = if last - first == PANEL {
            moving.get(last).map_or(limit, |&next| (next as usize).min(limit))
        } else {
            limit
        };
        segments.push(Segment { rows: row..end, moving: first..last });
        (row, first) = (end, last);
    }
    segments
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_cover_every_row_once_with_at_most_a_panel_each() {
        let every = |step: u32, n: u32| (0..n).step_by(step as usize).collect::<Vec<u32>>();
        for (n, moving) in [
            (0, vec![]),
            (1, vec![0]),
            (100, vec![]),
            (100, every(1, 100)),
            (MAX_ROWS + 1, vec![0, 8192]),
            (20_000, every(7, 20_000)),
            (20_000, every(1000, 20_000)),
            (PANEL, every(1, 48)),
        ] {
            let found = segments(n, &moving);
            let (mut row, mut first) = (0, 0);
            for segment in &found {
                assert_eq!((segment.rows.start, segment.moving.start), (row, first), "contiguous");
                assert!(!segment.rows.is_empty() && segment.rows.len() <= MAX_ROWS, "{segment:?}");
                assert!(segment.moving.len() <= PANEL, "{segment:?}");
                for &m in &moving[segment.moving.clone()] {
                    assert!(segment.rows.contains(&(m as usize)), "{m} in {segment:?}");
                }
                (row, first) = (segment.rows.end, segment.moving.end);
            }
            assert_eq!((row, first), (n, moving.len()), "complete");
        }
    }
}
