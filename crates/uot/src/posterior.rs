//! The plan as probabilities of the rows for each column.

use crate::problem::Cost;
use crate::{UotError, UotOutput, UotProblem};

/// Distribution of each column's weight over the rows, as a sparse matrix: entries of column j are
/// `starts[j]..starts[j + 1]`.
///
/// Shares are `P_ij / max(b_j, mass_j)`, where `mass_j` includes the unmatched mass: shares and
/// `unmatched` of a column with weight sum to 1. A column without weight has shares 0 and
/// `unmatched` 1.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Posterior {
    /// Start of each column's entries, and the end of the last, `[m + 1]`.
    pub starts: Vec<usize>,
    /// Row ids, ascending in each column, `[nnz]`.
    pub ids: Vec<u32>,
    /// Share of the column's weight that is transported to the row, 0 to 1, `[nnz]`.
    pub shares: Vec<f64>,
    /// Share of the column's weight that is not transported, 0 to 1, `[m]`: unmatched, or lost
    /// because the marginal is relaxed.
    pub unmatched: Vec<f64>,
}

impl Posterior {
    /// Row ids and shares of one column.
    ///
    /// # Panics
    /// If `column` is out of range.
    pub fn column(&self, column: usize) -> (&[u32], &[f64]) {
        let range = self.starts[column]..self.starts[column + 1];
        (&self.ids[range.clone()], &self.shares[range])
    }
}

impl UotOutput {
    /// Entries of the plan for the candidates of [`UotProblem::from_csr`], in the problem's order,
    /// `[nnz]`; for an explicit matrix as [`Self::plan`].
    ///
    /// # Errors
    /// [`UotError::Mismatch`] for a problem of a different size, [`UotError::NotListed`] for a
    /// structured one.
    pub fn plan_entries(&self, problem: &UotProblem<'_>) -> Result<Vec<f64>, UotError> {
        match &problem.cost {
            Cost::Dense { .. } => self.plan(problem),
            Cost::Sparse(cost) => {
                self.check(problem)?;
                let logs = self.log_factors(problem);
                let mut entries = Vec::with_capacity(cost.values.len());
                for i in 0..cost.num_rows() {
                    entries.extend(cost.row(i).map(|(j, d)| logs.entry(i, j, cost.largest - d)));
                }
                Ok(entries)
            }
            Cost::Near { .. } => {
                let what = "a list of the plan's entries";
                Err(UotError::NotListed { what, instead: "UotOutput::plan_column" })
            }
        }
    }

    /// For each column, the distribution of its weight over the rows.
    ///
    /// # Errors
    /// [`UotError::Mismatch`] for a problem of a different size, [`UotError::NotListed`] for a
    /// structured one.
    pub fn col_posterior(&self, problem: &UotProblem<'_>) -> Result<Posterior, UotError> {
        self.check(problem)?;
        if let Cost::Near { .. } = problem.cost {
            let what = "the posterior of every column";
            return Err(UotError::NotListed { what, instead: "UotOutput::top_rows" });
        }
        let logs = self.log_factors(problem);
        let columns = problem.map_columns(|j, entries| -> Vec<(u32, f64)> {
            entries.iter().map(|&(i, w)| (i, logs.entry(i as usize, j, w))).collect()
        });
        let weights = problem.marginals.as_ref().map(|(_, b)| &b[..]);
        Ok(normalised(columns, weights, &self.unmatched_col_mass))
    }
}

fn normalised(
    columns: Vec<Vec<(u32, f64)>>,
    weights: Option<&[f64]>,
    unmatched: &[f64],
) -> Posterior {
    let entries = columns.iter().map(Vec::len).sum();
    let uniform = 1.0 / columns.len() as f64;
    let mut found = Posterior {
        starts: vec![0],
        ids: Vec::with_capacity(entries),
        shares: Vec::with_capacity(entries),
        unmatched: Vec::with_capacity(columns.len()),
    };
    for (k, column) in columns.into_iter().enumerate() {
        let sent: f64 = column.iter().map(|entry| entry.1).sum();
        let total = sent + unmatched.get(k).copied().unwrap_or(0.0);
        let whole = total.max(weights.map_or(uniform, |weights| weights[k]));
        let share = |mass: f64| if whole > 0.0 { mass / whole } else { 0.0 };
        found.unmatched.push((1.0 - share(sent)).clamp(0.0, 1.0));
        for (id, mass) in column {
            found.ids.push(id);
            found.shares.push(share(mass));
        }
        found.starts.push(found.ids.len());
    }
    found
}
