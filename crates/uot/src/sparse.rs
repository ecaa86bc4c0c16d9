//! Costs of listed pairs only: compressed rows, and the same entries by column.

use crate::UotError;

/// Maximum number of listed pairs: positions are stored as `u32`.
const MAX_ENTRIES: usize = u32::MAX as usize;

/// A cost for every listed pair; all other pairs are excluded.
#[derive(Debug)]
pub(crate) struct SparseCost {
    /// Entries of row i are `row_starts[i]..row_starts[i + 1]`.
    pub(crate) row_starts: Vec<usize>,
    /// Column of each entry, in the order of the caller.
    pub(crate) cols: Vec<u32>,
    pub(crate) values: Vec<f64>,
    /// Entries of column j are `col_starts[j]..col_starts[j + 1]`, by ascending row.
    pub(crate) col_starts: Vec<usize>,
    pub(crate) rows: Vec<u32>,
    /// Position in `values` of each entry by column.
    pub(crate) positions: Vec<u32>,
    pub(crate) smallest: f64,
    pub(crate) largest: f64,
}

impl SparseCost {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rows and entries are checked to fit into 32 bits"
    )]
    pub(crate) fn new(
        row_starts: Vec<usize>,
        cols: Vec<u32>,
        values: Vec<f64>,
        num_cols: usize,
    ) -> Result<Self, UotError> {
        check_starts(&row_starts, cols.len())?;
        if values.len() != cols.len() {
            let (found, expected) = (values.len(), cols.len());
            return Err(UotError::BadLength { what: "costs", found, expected });
        }
        if values.is_empty() {
            return Err(UotError::Empty { side: "candidate" });
        }
        if values.len() > MAX_ENTRIES {
            let (what, needed) = ("the list of candidates", values.len());
            return Err(UotError::TooLarge { what, needed, limit: MAX_ENTRIES });
        }
        if let Some(index) = values.iter().position(|d| !d.is_finite()) {
            let expected = "a finite cost (omit a pair to exclude it)";
            return Err(UotError::BadValue {
                what: "costs",
                index,
                value: values[index],
                expected,
            });
        }
        if let Some(index) = cols.iter().position(|&j| j as usize >= num_cols) {
            let (value, expected) = (f64::from(cols[index]), "the id of a column");
            return Err(UotError::BadValue { what: "cols", index, value, expected });
        }
        let mut col_starts = vec![0; num_cols + 1];
        for &j in &cols {
            col_starts[j as usize + 1] += 1;
        }
        for j in 0..num_cols {
            col_starts[j + 1] += col_starts[j];
        }
        let mut next = col_starts.clone();
        let mut rows = vec![0_u32; cols.len()];
        let mut positions = vec![0_u32; cols.len()];
        for i in 0..row_starts.len() - 1 {
            for at in row_starts[i]..row_starts[i + 1] {
                let slot = &mut next[cols[at] as usize];
                // rows are visited in order, so repeated pairs are adjacent
                if *slot > col_starts[cols[at] as usize] && rows[*slot - 1] as usize == i {
                    let (value, expected) =
                        (f64::from(cols[at]), "each column at most once in a row");
                    return Err(UotError::BadValue { what: "cols", index: at, value, expected });
                }
                rows[*slot] = i as u32;
                positions[*slot] = at as u32;
                *slot += 1;
            }
        }
        let smallest = values.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Ok(Self { row_starts, cols, values, col_starts, rows, positions, smallest, largest })
    }

    pub(crate) fn num_rows(&self) -> usize {
        self.row_starts.len() - 1
    }

    pub(crate) fn num_cols(&self) -> usize {
        self.col_starts.len() - 1
    }

    /// `(column, cost)` of the entries of a row.
    pub(crate) fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + Clone {
        let range = self.row_starts[i]..self.row_starts[i + 1];
        self.cols[range.clone()].iter().map(|&j| j as usize).zip(self.values[range].iter().copied())
    }

    /// `(row, cost)` of the entries of a column.
    pub(crate) fn col(&self, j: usize) -> impl Iterator<Item = (usize, f64)> + Clone {
        let range = self.col_starts[j]..self.col_starts[j + 1];
        let costs = self.positions[range.clone()].iter().map(|&at| self.values[at as usize]);
        self.rows[range].iter().map(|&i| i as usize).zip(costs)
    }
}

fn check_starts(starts: &[usize], entries: usize) -> Result<(), UotError> {
    let bad = |index: usize, expected| {
        let value = starts.get(index).map_or(f64::NAN, |&start| start as f64);
        Err(UotError::BadValue { what: "row_starts", index, value, expected })
    };
    if starts.len() < 2 {
        return Err(UotError::Empty { side: "row" });
    }
    if starts[0] != 0 {
        return bad(0, "0 at the start");
    }
    if let Some(i) = starts.windows(2).position(|pair| pair[0] > pair[1]) {
        return bad(i + 1, "values that do not decrease");
    }
    if starts[starts.len() - 1] != entries {
        return bad(starts.len() - 1, "the number of entries at the end");
    }
    Ok(())
}
