//! What is to be solved: a cost between rows and columns, and the marginals.

use crate::median::median_of_trees;
use crate::near::{Extra, NearField, inverse_width};
use crate::simd::LANES;
use crate::tree::PointTree;
use crate::{Bandwidth, Storage, UotError, WelschParams, points};
use rayon::prelude::*;

/// Most entries of a matrix that this crate builds itself (1.6 GB).
pub(crate) const MAX_DENSE_ENTRIES: usize = 200_000_000;

/// Cost and marginals of an unbalanced transport problem, `[n, m]`: rows are sources, columns are edited points.
///
/// Marginals are uniform, `1/n` and `1/m`, unless [`Self::with_marginals`] is used.
#[derive(Debug)]
pub struct UotProblem<'a> {
    rows: usize,
    cols: usize,
    pub(crate) marginals: Option<(Vec<f64>, Vec<f64>)>,
    pub(crate) cost: Cost<'a>,
    scale: Option<WelschScale>,
}

#[derive(Debug)]
pub(crate) enum Cost<'a> {
    Dense {
        values: Vec<f64>,
        least: f64,
        largest: f64,
        /// Cost of an unrelated pair: 1 for a Welsch cost, else the largest entry.
        far: f64,
    },
    Near {
        field: Box<NearField<'a>>,
        storage: Storage,
    },
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

    /// The Welsch cost `1 − exp(−r²/(2β²))` (Eq. 21) as an explicit matrix. For small problems and as an oracle:
    /// `cutoff` and `storage` of the parameters have no effect.
    ///
    /// # Errors
    /// [`UotError`] for empty or non-finite clouds, bad parameters, and more than 2e8 pairs.
    pub fn welsch_dense<const D: usize>(
        src: &[[f64; D]],
        edit: &[[f64; D]],
        params: &WelschParams,
    ) -> Result<Self, UotError> {
        params.validate()?;
        let (src_tree, edit_tree) = sorted(src, edit)?;
        let (n, m) = (src.len(), edit.len());
        check_dense_size("the cost matrix", n, m)?;
        let scale = measure(&src_tree, &edit_tree, params)?;
        let inverse = inverse_width(scale.beta);
        let mut cost = vec![0.0; n * m];
        cost.par_chunks_mut(m).zip(src).for_each(|(row, p)| {
            for (value, q) in row.iter_mut().zip(edit) {
                let squared: f64 = p.iter().zip(q).map(|(x, y)| (x - y) * (x - y)).sum();
                *value = -(-squared * inverse).exp_m1();
            }
        });
        Self::dense(cost, n, m, Some(1.0), Some(scale))
    }

    /// The Welsch cost between two clouds (Eq. 21), never stored: pairs beyond `cutoff · β` cost exactly 1, the
    /// others are kept sparse. Memory is proportional to the number of near pairs.
    ///
    /// Degenerate clouds are defined: one point on a side, coincident and duplicate points, and clouds that do not
    /// overlap all give a problem whose plan is the exact one for the cost above (with β = 0 read as the limit).
    ///
    /// # Errors
    /// [`UotError`] for empty or non-finite clouds and bad parameters.
    pub fn welsch<const D: usize>(
        src: &[[f64; D]],
        edit: &[[f64; D]],
        params: &WelschParams,
    ) -> Result<Self, UotError> {
        Self::near(src, edit, params, None)
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
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let cost = Cost::Dense { values, least, largest, far: far.unwrap_or(largest) };
        Ok(Self { rows: n, cols: m, marginals: None, cost, scale })
    }
}

impl<'a> UotProblem<'a> {
    /// [`UotProblem::welsch`] with a second term in the exponent: `w_ij = exp(−r²/(2β²) − extra(i, j))`,
    /// `D_ij = 1 − w_ij`. `extra` gets original ids and may be called several times for a pair, from several threads;
    /// it must always return the same value. Negative values count as 0, +∞ as "not related", NaN as 0.
    ///
    /// # Errors
    /// As [`UotProblem::welsch`].
    pub fn welsch_with<const D: usize>(
        src: &[[f64; D]],
        edit: &[[f64; D]],
        params: &WelschParams,
        extra: impl Fn(usize, usize) -> f64 + Send + Sync + 'a,
    ) -> Result<Self, UotError> {
        Self::near(src, edit, params, Some(Box::new(extra)))
    }

    fn near<const D: usize>(
        src: &[[f64; D]],
        edit: &[[f64; D]],
        params: &WelschParams,
        extra: Option<Extra<'a>>,
    ) -> Result<Self, UotError> {
        params.validate()?;
        let (src_tree, edit_tree) = sorted(src, edit)?;
        let scale = measure(&src_tree, &edit_tree, params)?;
        let field = NearField::new(src_tree, edit_tree, scale.beta, params.cutoff, extra);
        let cost = Cost::Near { field: Box::new(field), storage: params.storage };
        Ok(Self { rows: src.len(), cols: edit.len(), marginals: None, cost, scale: Some(scale) })
    }

    /// Replaces the uniform marginals by `a` `[n]` and `b` `[m]`: non-negative, finite, not all zero. A zero weight
    /// gives an empty row or column.
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

    /// Number of rows (source points), n.
    pub fn num_rows(&self) -> usize {
        self.rows
    }

    /// Number of columns (edited points), m.
    pub fn num_cols(&self) -> usize {
        self.cols
    }

    /// Length scale of a Welsch problem; `None` for [`UotProblem::from_cost`].
    pub fn scale(&self) -> Option<WelschScale> {
        self.scale
    }

    /// The cost matrix of a dense problem, `[n, m]` row-major; `None` for a structured one.
    pub fn cost_matrix(&self) -> Option<&[f64]> {
        match &self.cost {
            Cost::Dense { values, .. } => Some(values),
            Cost::Near { .. } => None,
        }
    }

    /// Cost of an unrelated pair: 1 for a Welsch cost, the largest entry for a given matrix.
    pub fn far_cost(&self) -> f64 {
        match self.cost {
            Cost::Dense { far, .. } => far,
            Cost::Near { .. } => 1.0,
        }
    }

    /// Calls `visit(column, entries)` for every column and returns the results in column order. `entries` are
    /// `(row, far_cost − D)` of the near rows, in an order that depends on the points only.
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
            Cost::Near { field, .. } => {
                let leaves = field.edit.groups(1);
                let parts: Vec<Vec<R>> = leaves
                    .par_iter()
                    .enumerate()
                    .map_init(Default::default, |(near, entries), (leaf, &node)| {
                        field.column_entries(leaf, field.edit.bounds(node), near, entries);
                        let count = field.edit.count(field.edit.node(node));
                        let ids = &field.edit.order[leaf * LANES..leaf * LANES + count];
                        ids.iter().zip(&*entries).map(|(&id, e)| visit(id as usize, e)).collect()
                    })
                    .collect();
                let mut slots: Vec<Option<R>> = (0..self.cols).map(|_| None).collect();
                for (&id, result) in field.edit.order.iter().zip(parts.into_iter().flatten()) {
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
            Cost::Near { field, .. } => field.column(j),
        }
    }

    /// Whether [`Self::map_columns`] lists every row.
    pub(crate) fn lists_every_row(&self) -> bool {
        matches!(self.cost, Cost::Dense { .. })
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
        return Err(UotError::Empty { side: "source" });
    }
    if m == 0 {
        return Err(UotError::Empty { side: "edited" });
    }
    for (what, needed) in [("n", n), ("m", m)] {
        if u32::try_from(needed).is_err() {
            return Err(UotError::TooLarge { what, needed, limit: u32::MAX as usize });
        }
    }
    Ok(())
}

fn sorted<const D: usize>(
    src: &[[f64; D]],
    edit: &[[f64; D]],
) -> Result<(PointTree, PointTree), UotError> {
    points::validate("src", "source", src)?;
    points::validate("edit", "edited", edit)?;
    Ok(rayon::join(|| PointTree::new(src), || PointTree::new(edit)))
}

fn measure(
    src: &PointTree,
    edit: &PointTree,
    params: &WelschParams,
) -> Result<WelschScale, UotError> {
    Ok(match params.bandwidth {
        Bandwidth::Fixed(beta) => WelschScale { median: None, beta },
        Bandwidth::MedianTimes(gamma) => {
            let median = median_of_trees(src, edit, params.median)?;
            WelschScale { median: Some(median), beta: gamma * median.value }
        }
    })
}
