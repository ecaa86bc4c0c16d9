//! The problem: a cost between rows and columns, and the marginals.

use crate::median::median_of_trees;
use crate::near::{Extra, NearField, inverse_width};
use crate::simd::LANES;
use crate::sparse::SparseCost;
use crate::tree::PointTree;
use crate::{Bandwidth, Storage, UotError, WelschParams, points};
use rayon::prelude::*;

/// Maximum number of entries of a matrix that this crate builds (1.6 GB).
pub(crate) const MAX_DENSE_ENTRIES: usize = 200_000_000;

/// Cost and marginals of an unbalanced transport problem, `[n, m]`.
///
/// Marginals are uniform, `1/n` and `1/m`, unless [`Self::with_marginals`] is used.
#[derive(Debug)]
pub struct UotProblem<'a> {
    rows: usize,
    cols: usize,
    pub(crate) marginals: Option<(Vec<f64>, Vec<f64>)>,
    pub(crate) unmatched: Unmatched,
    pub(crate) cost: Cost<'a>,
    scale: Option<WelschScale>,
}

/// Costs of staying unmatched, one per row and one per column, for sides on which it is allowed.
#[derive(Debug, Default)]
pub(crate) struct Unmatched {
    pub(crate) rows: Option<Vec<f64>>,
    pub(crate) cols: Option<Vec<f64>>,
}

#[derive(Debug)]
pub(crate) enum Cost<'a> {
    Dense {
        values: Vec<f64>,
        smallest: f64,
        largest: f64,
        /// Cost of an unrelated pair: 1 for a Welsch cost, else the largest entry.
        far: f64,
    },
    Near {
        field: Box<NearField<'a>>,
        storage: Storage,
    },
    Sparse(SparseCost),
}

/// The length scale of a Welsch cost. All lengths in the unit of the points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WelschScale {
    /// Median pair distance; `None` for [`Bandwidth::Fixed`].
    pub median: Option<crate::MedianDistance>,
    /// Width β. Zero when the median is zero: then only coincident points have a cost below 1.
    pub beta: f64,
}

impl UotProblem<'static> {
    /// Any finite cost matrix, `[n, m]` row-major.
    ///
    /// # Errors
    /// [`UotError`] when a side is empty, the length is not `n·m`, or an entry is not finite.
    pub fn from_cost(cost: Vec<f64>, n: usize, m: usize) -> Result<Self, UotError> {
        Self::dense(cost, n, m, None, None)
    }

    /// Costs of candidate pairs in compressed rows: the entries of row i are
    /// `row_starts[i]..row_starts[i + 1]` of `cols` and `costs` `[nnz]`, in any order. Pairs that
    /// are not listed are excluded, as if their cost were +∞. A row or column without candidates
    /// carries no mass and has potential 0.
    ///
    /// # Errors
    /// [`UotError`] when there is no row, column or candidate, `row_starts` `[n + 1]` does not rise
    /// from 0 to `nnz`, a column is out of range or repeated in a row, a cost is not finite, or
    /// there are 2³² candidates or more.
    pub fn from_csr(
        row_starts: Vec<usize>,
        cols: Vec<u32>,
        costs: Vec<f64>,
        num_cols: usize,
    ) -> Result<Self, UotError> {
        check_sides(row_starts.len().saturating_sub(1), num_cols)?;
        let cost = SparseCost::new(row_starts, cols, costs, num_cols)?;
        Ok(Self::of(cost.num_rows(), num_cols, Cost::Sparse(cost), None))
    }

    /// The Welsch cost `1 − exp(−r²/(2β²))` as an explicit matrix, for small problems and as a
    /// reference for [`Self::welsch`]; `cutoff` and `storage` of the parameters have no effect.
    ///
    /// # Errors
    /// [`UotError`] for empty or non-finite clouds, bad parameters, and more than 2e8 pairs.
    pub fn welsch_dense<const D: usize>(
        rows: &[[f64; D]],
        cols: &[[f64; D]],
        params: &WelschParams,
    ) -> Result<Self, UotError> {
        params.validate()?;
        let (row_tree, col_tree) = sorted(rows, cols)?;
        let (n, m) = (rows.len(), cols.len());
        check_dense_size("the cost matrix", n, m)?;
        let scale = measure(&row_tree, &col_tree, params)?;
        let inverse = inverse_width(scale.beta);
        let mut cost = vec![0.0; n * m];
        cost.par_chunks_mut(m).zip(rows).for_each(|(row, p)| {
            for (value, q) in row.iter_mut().zip(cols) {
                let squared: f64 = p.iter().zip(q).map(|(x, y)| (x - y) * (x - y)).sum();
                *value = -(-squared * inverse).exp_m1();
            }
        });
        Self::dense(cost, n, m, Some(1.0), Some(scale))
    }

    /// The Welsch cost between two clouds `rows` `[n, D]` and `cols` `[m, D]`, without storing the
    /// matrix: pairs beyond `cutoff · β` cost exactly 1, the others are stored sparsely. Memory is
    /// proportional to the number of near pairs.
    ///
    /// Degenerate clouds are valid: one point on a side, coincident and duplicate points, and
    /// clouds that do not overlap all give a problem whose plan is the exact one for the cost above
    /// (with β = 0 taken as the limit).
    ///
    /// # Errors
    /// [`UotError`] for empty or non-finite clouds and bad parameters.
    pub fn welsch<const D: usize>(
        rows: &[[f64; D]],
        cols: &[[f64; D]],
        params: &WelschParams,
    ) -> Result<Self, UotError> {
        Self::near(rows, cols, params, None)
    }

    fn dense(
        values: Vec<f64>,
        n: usize,
        m: usize,
        far: Option<f64>,
        scale: Option<WelschScale>,
    ) -> Result<Self, UotError> {
        check_sides(n, m)?;
        let expected = n.saturating_mul(m);
        if values.len() != expected {
            return Err(UotError::BadLength { what: "cost", found: values.len(), expected });
        }
        if let Some(index) = values.iter().position(|d| !d.is_finite()) {
            let (value, expected) = (values[index], "finite costs");
            return Err(UotError::BadValue { what: "cost", index, value, expected });
        }
        let smallest = values.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let cost = Cost::Dense { values, smallest, largest, far: far.unwrap_or(largest) };
        Ok(Self::of(n, m, cost, scale))
    }
}

impl<'a> UotProblem<'a> {
    fn of(rows: usize, cols: usize, cost: Cost<'a>, scale: Option<WelschScale>) -> Self {
        Self { rows, cols, marginals: None, unmatched: Unmatched::default(), cost, scale }
    }

    /// [`UotProblem::welsch`] with a second term in the exponent:
    /// `w_ij = exp(−r²/(2β²) − extra(i, j))`, `D_ij = 1 − w_ij`. `extra` gets original ids and may
    /// be called several times for a pair, from several threads; it must always return the same
    /// value. Negative values and NaN count as 0; +∞ gives an unrelated pair.
    ///
    /// # Errors
    /// As [`UotProblem::welsch`].
    pub fn welsch_with<const D: usize>(
        rows: &[[f64; D]],
        cols: &[[f64; D]],
        params: &WelschParams,
        extra: impl Fn(usize, usize) -> f64 + Send + Sync + 'a,
    ) -> Result<Self, UotError> {
        Self::near(rows, cols, params, Some(Box::new(extra)))
    }

    fn near<const D: usize>(
        rows: &[[f64; D]],
        cols: &[[f64; D]],
        params: &WelschParams,
        extra: Option<Extra<'a>>,
    ) -> Result<Self, UotError> {
        params.validate()?;
        let (row_tree, col_tree) = sorted(rows, cols)?;
        let scale = measure(&row_tree, &col_tree, params)?;
        let field = NearField::new(row_tree, col_tree, scale.beta, params.cutoff, extra);
        let cost = Cost::Near { field: Box::new(field), storage: params.storage };
        Ok(Self::of(rows.len(), cols.len(), cost, Some(scale)))
    }

    /// Replaces the uniform marginals by `a` `[n]` and `b` `[m]`: non-negative, finite, not all
    /// zero. Rows and columns of zero weight carry no mass.
    ///
    /// # Errors
    /// [`UotError::BadLength`] and [`UotError::BadValue`].
    pub fn with_marginals(mut self, a: Vec<f64>, b: Vec<f64>) -> Result<Self, UotError> {
        for (what, weights, expected) in [("a", &a, self.rows), ("b", &b, self.cols)] {
            if weights.len() != expected {
                return Err(UotError::BadLength { what, found: weights.len(), expected });
            }
            let bad = weights.iter().position(|&w| !(w >= 0.0 && w.is_finite()));
            let all_zero = weights.iter().all(|&w| w <= 0.0);
            if let Some(index) = bad.or(all_zero.then_some(0)) {
                let expected = "finite weights, zero or above, at least one above zero";
                return Err(UotError::BadValue { what, index, value: weights[index], expected });
            }
        }
        self.marginals = Some((a, b));
        Ok(self)
    }

    /// Allows columns to stay unmatched: mass `N_j` without a counterpart, at `costs[j]` per unit.
    /// Adds `Σ_j c_j N_j + λ0 KL(N ‖ b)` to the objective and `N` to the column sums that are
    /// compared with `b`. With λ2 = ∞ the column's weight is distributed over its rows and
    /// "unmatched": the posterior of a mixture with an outlier class.
    ///
    /// # Errors
    /// [`UotError::BadLength`], [`UotError::BadValue`] for a cost that is not finite.
    pub fn with_unmatched_cols(mut self, costs: Vec<f64>) -> Result<Self, UotError> {
        check_costs("unmatched_cols", &costs, self.cols)?;
        self.unmatched.cols = Some(costs);
        Ok(self)
    }

    /// Allows rows to stay unmatched, as [`Self::with_unmatched_cols`] does for columns.
    ///
    /// # Errors
    /// [`UotError::BadLength`], [`UotError::BadValue`] for a cost that is not finite.
    pub fn with_unmatched_rows(mut self, costs: Vec<f64>) -> Result<Self, UotError> {
        check_costs("unmatched_rows", &costs, self.rows)?;
        self.unmatched.rows = Some(costs);
        Ok(self)
    }

    /// `ln a` and `ln b` in original order.
    pub(crate) fn log_marginals(&self) -> (Vec<f64>, Vec<f64>) {
        if let Some((a, b)) = &self.marginals {
            (a.iter().map(|w| w.ln()).collect(), b.iter().map(|w| w.ln()).collect())
        } else {
            let (n, m) = (self.num_rows(), self.num_cols());
            (vec![-(n as f64).ln(); n], vec![-(m as f64).ln(); m])
        }
    }

    /// Number of rows, n.
    pub fn num_rows(&self) -> usize {
        self.rows
    }

    /// Number of columns, m.
    pub fn num_cols(&self) -> usize {
        self.cols
    }

    /// Length scale of a Welsch problem; `None` for other costs.
    pub fn scale(&self) -> Option<WelschScale> {
        self.scale
    }

    /// The cost matrix of a dense problem, cost units, `[n, m]` row-major; `None` for structured
    /// and sparse costs.
    pub fn cost_matrix(&self) -> Option<&[f64]> {
        match &self.cost {
            Cost::Dense { values, .. } => Some(values),
            Cost::Near { .. } | Cost::Sparse(_) => None,
        }
    }

    /// Cost of an unrelated pair: 1 for a Welsch cost, the largest one given for explicit costs.
    pub fn far_cost(&self) -> f64 {
        match self.cost {
            Cost::Dense { far, .. } => far,
            Cost::Sparse(SparseCost { largest, .. }) => largest,
            Cost::Near { .. } => 1.0,
        }
    }

    /// Calls `visit(column, entries)` for every column; returns the results in the order of
    /// columns. `entries` are `(row, far_cost − D)` of the near rows, in an order that depends on
    /// the points only.
    pub(crate) fn map_columns<R: Send>(
        &self,
        visit: impl Fn(usize, &[(u32, f64)]) -> R + Sync,
    ) -> Vec<R> {
        match &self.cost {
            Cost::Dense { values, far, .. } => (0..self.cols)
                .into_par_iter()
                .map_init(Vec::new, |entries, j| {
                    entries.clear();
                    let column = values.iter().skip(j).step_by(self.cols);
                    entries.extend((0_u32..).zip(column.map(|d| far - d)));
                    visit(j, entries)
                })
                .collect(),
            Cost::Sparse(cost) => (0..self.cols)
                .into_par_iter()
                .map_init(Vec::new, |entries, j| {
                    entries.clear();
                    entries.extend(cost.col(j).map(|(i, d)| (id(i), cost.largest - d)));
                    visit(j, entries)
                })
                .collect(),
            Cost::Near { field, .. } => {
                let leaves = field.cols.groups(1);
                let parts: Vec<Vec<R>> = leaves
                    .par_iter()
                    .enumerate()
                    .map_init(Default::default, |(near, entries), (leaf, &node)| {
                        field.column_entries(leaf, field.cols.bounds(node), near, entries);
                        let count = field.cols.count(field.cols.node(node));
                        let ids = &field.cols.order[leaf * LANES..leaf * LANES + count];
                        ids.iter().zip(&*entries).map(|(&id, e)| visit(id as usize, e)).collect()
                    })
                    .collect();
                let mut slots: Vec<Option<R>> = (0..self.cols).map(|_| None).collect();
                for (&id, result) in field.cols.order.iter().zip(parts.into_iter().flatten()) {
                    slots[id as usize] = Some(result);
                }
                slots.into_iter().flatten().collect()
            }
        }
    }

    /// The near entries of one column, as for [`Self::map_columns`].
    pub(crate) fn column(&self, j: usize) -> Vec<(u32, f64)> {
        match &self.cost {
            Cost::Dense { values, far, .. } => {
                let column = values.iter().skip(j).step_by(self.cols);
                (0_u32..).zip(column.map(|d| far - d)).collect()
            }
            Cost::Sparse(cost) => cost.col(j).map(|(i, d)| (id(i), cost.largest - d)).collect(),
            Cost::Near { field, .. } => field.column(j),
        }
    }

    /// Whether [`Self::map_columns`] lists every row that can carry mass.
    pub(crate) fn lists_every_row(&self) -> bool {
        !matches!(self.cost, Cost::Near { .. })
    }
}

#[expect(clippy::cast_possible_truncation, reason = "sides are checked to fit into 32 bits")]
pub(crate) fn id(i: usize) -> u32 {
    i as u32
}

fn check_costs(what: &'static str, costs: &[f64], expected: usize) -> Result<(), UotError> {
    if costs.len() != expected {
        return Err(UotError::BadLength { what, found: costs.len(), expected });
    }
    match costs.iter().position(|cost| !cost.is_finite()) {
        Some(index) => {
            let (value, expected) = (costs[index], "finite costs");
            Err(UotError::BadValue { what, index, value, expected })
        }
        None => Ok(()),
    }
}

pub(crate) fn check_dense_size(what: &'static str, n: usize, m: usize) -> Result<(), UotError> {
    let needed = n.saturating_mul(m);
    if needed > MAX_DENSE_ENTRIES {
        return Err(UotError::TooLarge { what, needed, limit: MAX_DENSE_ENTRIES });
    }
    Ok(())
}

fn check_sides(n: usize, m: usize) -> Result<(), UotError> {
    if n == 0 {
        return Err(UotError::Empty { side: "row" });
    }
    if m == 0 {
        return Err(UotError::Empty { side: "column" });
    }
    for (what, needed) in [("n", n), ("m", m)] {
        if u32::try_from(needed).is_err() {
            return Err(UotError::TooLarge { what, needed, limit: u32::MAX as usize });
        }
    }
    Ok(())
}

fn sorted<const D: usize>(
    rows: &[[f64; D]],
    cols: &[[f64; D]],
) -> Result<(PointTree, PointTree), UotError> {
    points::validate("rows", "row", rows)?;
    points::validate("cols", "column", cols)?;
    Ok(rayon::join(|| PointTree::new(rows), || PointTree::new(cols)))
}

fn measure(
    rows: &PointTree,
    cols: &PointTree,
    params: &WelschParams,
) -> Result<WelschScale, UotError> {
    Ok(match params.bandwidth {
        Bandwidth::Fixed(beta) => WelschScale { median: None, beta },
        Bandwidth::MedianTimes(gamma) => {
            let median = median_of_trees(rows, cols, params.median)?;
            WelschScale { median: Some(median), beta: gamma * median.value }
        }
    })
}
