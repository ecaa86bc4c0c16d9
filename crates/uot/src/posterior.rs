//! The plan as probabilities: of the rows for each column, or of the columns for each row.

use crate::problem::{Cost, id};
use crate::{UotError, UotOutput, UotProblem};

/// Distribution of the weight of each line (column or row), in compressed form: entries of line k
/// are `starts[k]..starts[k + 1]`.
///
/// Shares are `P_ij / max(b_j, mass_j)` for columns, where `mass_j` includes the unmatched mass,
/// and correspondingly with `a_i` for rows: shares and `unmatched` of a line with weight sum to 1.
/// A line without weight has shares 0 and `unmatched` 1.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Posterior {
    /// Start of each line's entries, and the end of the last, `[lines + 1]`.
    pub starts: Vec<usize>,
    /// Row ids (of columns) or column ids (of rows), `[nnz]`. By column: ascending. By row: in the
    /// problem's order.
    pub ids: Vec<u32>,
    /// Share of the line's weight transported there, in [0, 1], `[nnz]`.
    pub shares: Vec<f64>,
    /// Share that is not transported, in [0, 1], `[lines]`: unmatched, or lost because the marginal
    /// is relaxed.
    pub unmatched: Vec<f64>,
}

impl Posterior {
    /// Ids and shares of one line.
    ///
    /// # Panics
    /// If `line` is out of range.
    pub fn line(&self, line: usize) -> (&[u32], &[f64]) {
        let range = self.starts[line]..self.starts[line + 1];
        (&self.ids[range.clone()], &self.shares[range])
    }
}

impl UotOutput {
    /// Entries of the plan for the candidates of [`UotProblem::from_csr`], in the problem's order,
    /// `[nnz]`; for an explicit matrix as [`Self::plan`].
    ///
    /// # Errors
    /// [`UotError::Mismatch`] for a problem of another size, [`UotError::NotListed`] for a
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
    /// [`UotError::Mismatch`] for a problem of another size, [`UotError::NotListed`] for a
    /// structured one.
    pub fn col_posterior(&self, problem: &UotProblem<'_>) -> Result<Posterior, UotError> {
        self.check(problem)?;
        if let Cost::Near { .. } = problem.cost {
            let what = "the posterior of every column";
            return Err(UotError::NotListed { what, instead: "UotOutput::top_rows" });
        }
        let logs = self.log_factors(problem);
        let lines = problem.map_columns(|j, entries| -> Vec<(u32, f64)> {
            entries.iter().map(|&(i, w)| (i, logs.entry(i as usize, j, w))).collect()
        });
        let weights = problem.marginals.as_ref().map(|(_, b)| &b[..]);
        Ok(normalised(lines, weights, &self.unmatched_col_mass))
    }

    /// For each row, the distribution of its weight over the columns.
    ///
    /// # Errors
    /// As [`Self::col_posterior`].
    pub fn row_posterior(&self, problem: &UotProblem<'_>) -> Result<Posterior, UotError> {
        self.check(problem)?;
        let plan = self.plan_entries(problem).map_err(|error| match error {
            UotError::NotListed { .. } => {
                let what = "the posterior of every row";
                UotError::NotListed { what, instead: "the swapped problem and UotOutput::top_rows" }
            }
            other => other,
        })?;
        let (n, m) = (problem.num_rows(), problem.num_cols());
        let lines = match &problem.cost {
            Cost::Sparse(cost) => (0..n)
                .map(|i| {
                    let range = cost.row_starts[i]..cost.row_starts[i + 1];
                    cost.cols[range.clone()]
                        .iter()
                        .copied()
                        .zip(plan[range].iter().copied())
                        .collect()
                })
                .collect(),
            _ => plan
                .chunks(m)
                .map(|row| (0..m).map(id).zip(row.iter().copied()).collect())
                .collect(),
        };
        let weights = problem.marginals.as_ref().map(|(a, _)| &a[..]);
        Ok(normalised(lines, weights, &self.unmatched_row_mass))
    }
}

fn normalised(
    lines: Vec<Vec<(u32, f64)>>,
    weights: Option<&[f64]>,
    unmatched: &[f64],
) -> Posterior {
    let entries = lines.iter().map(Vec::len).sum();
    let uniform = 1.0 / lines.len() as f64;
    let mut found = Posterior {
        starts: vec![0],
        ids: Vec::with_capacity(entries),
        shares: Vec::with_capacity(entries),
        unmatched: Vec::with_capacity(lines.len()),
    };
    for (k, line) in lines.into_iter().enumerate() {
        let sent: f64 = line.iter().map(|entry| entry.1).sum();
        let total = sent + unmatched.get(k).copied().unwrap_or(0.0);
        let whole = total.max(weights.map_or(uniform, |weights| weights[k]));
        let share = |mass: f64| if whole > 0.0 { mass / whole } else { 0.0 };
        found.unmatched.push((1.0 - share(sent)).clamp(0.0, 1.0));
        for (id, mass) in line {
            found.ids.push(id);
            found.shares.push(share(mass));
        }
        found.starts.push(found.ids.len());
    }
    found
}
