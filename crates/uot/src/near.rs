//! Geometry of the near field: the interacting pairs and their Welsch weights, one 8×8 block at a
//! time.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

use crate::simd::{LANES, Lane, dispatch, exp};
use crate::tree::{PointTree, box_distances};

/// Weights of one leaf of rows against one leaf of columns, `[row lane][column lane]`.
pub(crate) type Block = [Lane; LANES];

/// `(original row, weight)` of the near rows of each column of a column leaf.
pub(crate) type ColumnEntries = [Vec<(u32, f64)>; LANES];

/// Additional exponent of a pair, by original ids.
pub(crate) type Extra<'a> = Box<dyn Fn(usize, usize) -> f64 + Send + Sync + 'a>;

/// Two sorted clouds and the width of the cost between them.
pub(crate) struct NearField<'a> {
    pub(crate) rows: PointTree,
    pub(crate) cols: PointTree,
    /// `1/(2β²)`; the largest finite number when β = 0, so that only coincident points interact.
    inverse: f64,
    /// Pairs with a larger exponent `r²/(2β²) + extra` are far.
    largest_exponent: f64,
    extra: Option<Extra<'a>>,
}

impl std::fmt::Debug for NearField<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NearField")
            .field("rows", &self.rows.len())
            .field("cols", &self.cols.len())
            .field("inverse", &self.inverse)
            .field("largest_exponent", &self.largest_exponent)
            .field("extra", &self.extra.is_some())
            .finish()
    }
}

impl<'a> NearField<'a> {
    pub(crate) fn new(
        rows: PointTree,
        cols: PointTree,
        beta: f64,
        cutoff: f64,
        extra: Option<Extra<'a>>,
    ) -> Self {
        let largest_exponent = 0.5 * cutoff * cutoff;
        Self { rows, cols, inverse: inverse_width(beta), largest_exponent, extra }
    }

    /// Column leaves with a point near one of this row leaf, ascending.
    pub(crate) fn col_leaves_near(&self, leaf_box: &[[f64; 2]], out: &mut Vec<u32>) {
        self.leaves_near(&self.cols, leaf_box, out);
    }

    /// Row leaves with a point near one of this column leaf, ascending.
    pub(crate) fn row_leaves_near(&self, leaf_box: &[[f64; 2]], out: &mut Vec<u32>) {
        self.leaves_near(&self.rows, leaf_box, out);
    }

    fn leaves_near(&self, tree: &PointTree, leaf_box: &[[f64; 2]], out: &mut Vec<u32>) {
        out.clear();
        // the margin covers rounding of the box distance, so no pair that passes the exact test is
        // lost
        let limit = self.largest_exponent * (1.0 + 1e-9);
        tree.walk(|id| {
            let near = box_distances(leaf_box, tree.bounds(id)).0 * self.inverse <= limit;
            let node = tree.node(id);
            if near && node.num_leaves == 1 {
                out.push(node.first_leaf);
            }
            near
        });
    }

    /// Exponents `r²/(2β²) + extra` of a block, infinite for padding. True when any pair is within
    /// the cutoff: only then does the block belong to the near field, with all its pairs (far ones
    /// included, at no additional cost).
    #[inline(always)]
    pub(crate) fn exponents(&self, row_leaf: usize, col_leaf: usize, out: &mut Block) -> bool {
        *out = [[0.0; LANES]; LANES];
        for axis in 0..self.rows.dim() {
            let x = self.rows.axis(axis)[row_leaf];
            let y = self.cols.axis(axis)[col_leaf];
            for i in 0..LANES {
                for j in 0..LANES {
                    let t = x[i] - y[j];
                    out[i][j] = t.mul_add(t, out[i][j]);
                }
            }
        }
        if self.extra.is_some() {
            self.scale_and_add_extra(row_leaf, col_leaf, out);
        }
        let scale = if self.extra.is_some() { 1.0 } else { self.inverse };
        let mut near = 0_u32;
        for value in out.as_flattened_mut() {
            let exponent = *value * scale;
            // comparisons with the NaN of padding are false
            near += u32::from(exponent <= self.largest_exponent);
            *value = if exponent >= 0.0 { exponent } else { f64::INFINITY };
        }
        near > 0
    }

    fn scale_and_add_extra(&self, row_leaf: usize, col_leaf: usize, out: &mut Block) {
        let Some(extra) = &self.extra else { return };
        // not evaluated for pairs this far: their weight is zero in any case
        let reach = 2.0 * self.largest_exponent;
        for (i, row) in out.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                let exponent = *value * self.inverse;
                *value = if exponent <= reach {
                    let row = self.rows.order[row_leaf * LANES + i] as usize;
                    let col = self.cols.order[col_leaf * LANES + j] as usize;
                    exponent + extra(row, col).max(0.0)
                } else {
                    f64::INFINITY
                };
            }
        }
    }

    /// Fills `entries` with the near rows of the columns of one column leaf, in the order of the
    /// row tree. `leaves` is scratch.
    pub(crate) fn column_entries(
        &self,
        col_leaf: usize,
        col_box: &[[f64; 2]],
        leaves: &mut Vec<u32>,
        entries: &mut ColumnEntries,
    ) {
        self.row_leaves_near(col_box, leaves);
        entries.iter_mut().for_each(Vec::clear);
        let mut block = [[0.0; LANES]; LANES];
        for &row_leaf in leaves.iter() {
            let near = dispatch(
                #[inline(always)]
                || {
                    let near = self.exponents(row_leaf as usize, col_leaf, &mut block);
                    if near {
                        for value in block.as_flattened_mut() {
                            *value = exp(-*value);
                        }
                    }
                    near
                },
            );
            if near {
                for (i, row) in block.iter().enumerate() {
                    for (entry, &w) in entries.iter_mut().zip(row) {
                        if w > 0.0 {
                            entry.push((self.rows.order[row_leaf as usize * LANES + i], w));
                        }
                    }
                }
            }
        }
    }

    /// Near rows of one original column, in the order of the row tree.
    pub(crate) fn column(&self, j: usize) -> Vec<(u32, f64)> {
        let Some(position) = self.cols.order.iter().position(|&id| id as usize == j) else {
            return Vec::new();
        };
        let leaf = position / LANES;
        let node = self.cols.groups(1)[leaf];
        let mut entries = ColumnEntries::default();
        self.column_entries(leaf, self.cols.bounds(node), &mut Vec::new(), &mut entries);
        std::mem::take(&mut entries[position % LANES])
    }
}

/// `1/(2β²)`, saturated for β = 0 and for denormal β.
pub(crate) fn inverse_width(beta: f64) -> f64 {
    (0.5 / (beta * beta)).min(f64::MAX)
}
