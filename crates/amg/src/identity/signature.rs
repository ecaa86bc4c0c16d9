//! Properties of a splat that a similarity does not change, and lookup of source splats by them.

use crate::bit_map::BitMap;
use crate::row_index::index;
use gs_core::{Precision, Splats};
use rayon::prelude::*;
use std::ops::Range;

/// Number of source splats paired with a row.
const CANDIDATES: usize = 6;
/// Values of a signature: two proportions, opacity, base colour.
const SIGNATURE: usize = 6;
/// Maximum difference of proportions if only these are compared: lossless files preserve them more
/// accurately.
const PROPORTIONS: f64 = 1e-4;

/// Properties by which rows and source splats are paired.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum By {
    /// Proportions, opacity and base colour.
    All,
    /// Proportions only: rows may be recoloured.
    Proportions,
}

fn signature(splats: &Splats, i: usize) -> [f64; SIGNATURE] {
    let mut sizes = splats.log_scales[i].map(f64::from);
    sizes.sort_by(f64::total_cmp);
    let [r, g, b] = splats.sh_of(i)[0].map(f64::from);
    [sizes[1] - sizes[0], sizes[2] - sizes[1], f64::from(splats.opacity(i)), r, g, b]
}

/// Maximum difference of each value of a signature due to the rounding of one row.
fn signature_limits(
    precision: Option<&Precision>,
    tolerance: f64,
    row: usize,
    by: By,
) -> [f64; SIGNATURE] {
    const ANY: f64 = f64::INFINITY;
    if by == By::Proportions {
        let size = tolerance * PROPORTIONS;
        return [size, size, ANY, ANY, ANY, ANY];
    }
    // As in the identity map: sizes 1e-3, opacity 2e-3, colour 1e-3.
    let base = [2e-3, 2e-3, 2e-3, 1e-3, 1e-3, 1e-3].map(|v| tolerance * v);
    let Some(precision) = precision else { return base };
    let row = precision.of(row);
    let size = 2.0 * f64::from(row.log_scales.into_iter().fold(0.0_f32, f32::max));
    let [r, g, b] = row.sh_dc.map(f64::from);
    let stored = [size, size, f64::from(row.opacity), r, g, b];
    std::array::from_fn(|k| stored[k] + 0.1 * base[k])
}

/// Source splats with the signature of each open row, nearest first.
pub(super) fn candidates(
    source: &Splats,
    edited: &Splats,
    precision: Option<&Precision>,
    tolerance: f64,
    open: &[usize],
    by: By,
) -> Vec<Vec<u32>> {
    let ids: Vec<u32> = (0..source.len()).filter(|&i| source.is_finite(i)).map(index).collect();
    // One grid for all rows, with the coarsest rounding of any row. Values that are not stored are
    // ignored.
    let mut coarsest = [f64::MIN_POSITIVE; SIGNATURE];
    for &row in open {
        let limits = signature_limits(precision, tolerance, row, by);
        for (c, limit) in coarsest.iter_mut().zip(limits) {
            *c = c.max(limit);
        }
    }
    let table = SignatureTable::of(source, ids, coarsest);
    open.par_iter()
        .with_min_len(128)
        .map_init(Vec::new, |found, &row| {
            let limits = signature_limits(precision, tolerance, row, by);
            table.nearest(&signature(edited, row), &limits, found);
            found.iter().map(|&(_, id)| id).collect()
        })
        .collect()
}

/// Lookup table of source splats by signature; cells are two limits wide.
struct SignatureTable {
    /// Source splats in the order of (cell, id).
    ids: Vec<u32>,
    /// Range of `ids` in each cell.
    cells: BitMap<Cell, Range<u32>>,
    signatures: Vec<[f64; SIGNATURE]>,
    width: [f64; SIGNATURE],
}

/// Indices of the signature values that define the cells: the proportions, red and green.
const CELL_VALUES: [usize; 4] = [0, 1, 3, 4];
type Cell = [i64; CELL_VALUES.len()];
/// Maximum number of splats of a cell that are compared. Signatures shared by more splats are not
/// distinctive.
const MAX_OF_CELL: usize = 256;

impl SignatureTable {
    fn of(source: &Splats, ids: Vec<u32>, limits: [f64; SIGNATURE]) -> Self {
        let signatures: Vec<[f64; SIGNATURE]> =
            (0..source.len()).into_par_iter().map(|i| signature(source, i)).collect();
        let width = limits.map(|limit| 2.0 * limit);
        let mut table = Self { ids: Vec::new(), cells: BitMap::default(), signatures, width };
        let cell_of =
            |id: u32| CELL_VALUES.map(|k| table.cells(k, table.signatures[id as usize][k]).0);
        let mut sorted: Vec<(Cell, u32)> =
            ids.into_par_iter().with_min_len(1024).map(|id| (cell_of(id), id)).collect();
        sorted.par_sort_unstable();
        let (mut cells, mut first) = (BitMap::default(), 0);
        for members in sorted.chunk_by(|a, b| a.0 == b.0) {
            let compared = index(members.len().min(MAX_OF_CELL));
            cells.insert(members[0].0, first..first + compared);
            first += index(members.len());
        }
        table.ids = sorted.into_iter().map(|(_, id)| id).collect();
        table.cells = cells;
        table
    }

    /// Cell of a value, and the neighbouring cell that also contains values within a limit of it.
    #[expect(clippy::cast_possible_truncation, reason = "saturates for values beyond any file's")]
    fn cells(&self, k: usize, value: f64) -> (i64, i64) {
        let at = value / self.width[k];
        let cell = at.floor();
        let neighbor = if at - cell < 0.5 { -1 } else { 1 };
        (cell as i64, (cell as i64).saturating_add(neighbor))
    }

    /// The nearest splats whose values differ by at most `limits`, nearest first, with squared
    /// distances in units of the table's limits.
    fn nearest(
        &self,
        wanted: &[f64; SIGNATURE],
        limits: &[f64; SIGNATURE],
        found: &mut Vec<(f64, u32)>,
    ) {
        found.clear();
        let places = CELL_VALUES.map(|k| self.cells(k, wanted[k]));
        let split = CELL_VALUES.map(|k| self.width[k].is_finite());
        for corner in 0..1_usize << CELL_VALUES.len() {
            // Ignored values share one cell.
            if (0..CELL_VALUES.len()).any(|k| (corner >> k) & 1 == 1 && !split[k]) {
                continue;
            }
            let cell: Cell =
                std::array::from_fn(
                    |k| {
                        if (corner >> k) & 1 == 1 { places[k].1 } else { places[k].0 }
                    },
                );
            let Some(members) = self.cells.get(&cell) else { continue };
            for &id in &self.ids[members.start as usize..members.end as usize] {
                let other = &self.signatures[id as usize];
                if (0..SIGNATURE).all(|k| (other[k] - wanted[k]).abs() <= limits[k]) {
                    let apart = |k: usize| ((other[k] - wanted[k]) / self.width[k]).powi(2);
                    found.push(((0..SIGNATURE).map(apart).sum(), id));
                }
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.truncate(CANDIDATES);
    }
}
