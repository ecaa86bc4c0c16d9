//! Matches from the plan, column by column.

use crate::output::LogFactors;
use crate::problem::Cost;
use crate::{UotError, UotOutput, UotProblem};

/// Entries of a column within this relative distance of the largest are ties.
const TIE: f64 = 1e-9;

/// Row id that stands for no row, for columns without (further) candidates.
pub const NO_ROW: u32 = u32::MAX;

/// The best row of every column; all arrays are `[m]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Correspondence {
    /// Row of the largest entry of the column; among ties the lowest row. [`NO_ROW`] for a column
    /// without candidates.
    pub rows: Vec<u32>,
    /// Number of rows within a relative 1e-9 of the largest entry.
    pub tie_counts: Vec<u32>,
    /// `1 − second/first` of the column's entries; 1 if there is only one row.
    pub margins: Vec<f64>,
    /// Share of the column's mass above the constant background of unrelated pairs, in [0, 1]; 1
    /// where costs are sparse. Depends strongly on λ0: compare values of one result only; a fixed
    /// threshold is not meaningful.
    pub near_share: Vec<f64>,
    /// `far_cost − D` of the best row: for a Welsch cost the weight w in [0, 1], negligible beyond
    /// the cutoff. It shows whether a column has a match: `w_best > 0.02` means that the match is
    /// closer than 2.8 β. Transported mass does not show this: even an unrelated column keeps
    /// `exp(−1/(λ0+λ2))` of its mass.
    pub w_best: Vec<f64>,
}

/// One of the best rows of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TopRow {
    /// Row id; [`NO_ROW`], with share 0, if the column has fewer than `k` candidates.
    pub row: u32,
    /// `P_ij / Σ_i P_ij`, in [0, 1].
    pub share: f64,
    /// `far_cost − D_ij`: for a Welsch cost the weight w in [0, 1], negligible beyond the cutoff.
    pub weight: f64,
}

/// Rows by decreasing factor, for rows that a column does not list.
struct Ranking<'l> {
    logs: &'l LogFactors,
    rows: Vec<u32>,
    complete: bool,
}

impl<'l> Ranking<'l> {
    fn new(logs: &'l LogFactors, complete: bool) -> Self {
        let mut rows: Vec<u32> = (0_u32..).take(logs.rows.len()).collect();
        if complete {
            rows.clear();
        } else {
            rows.sort_unstable_by(|&p, &q| {
                logs.rows[q as usize].total_cmp(&logs.rows[p as usize]).then(p.cmp(&q))
            });
        }
        Self { logs, rows, complete }
    }

    /// `(row, ln P without the column factor, w)` of the `k` best rows, best first, ties by row;
    /// then any further rows that tie with the best are counted. At least two rows are ranked if
    /// the column has two.
    fn best(&self, entries: &[(u32, f64)], k: usize) -> Best {
        let mut top: Vec<Ranked> = Vec::with_capacity(k + 1);
        let mut listed: Vec<u32> = Vec::new();
        for &(row, w) in entries {
            insert(&mut top, k, Ranked { row, log: self.log(row) + w * self.logs.inverse, w });
        }
        let floor = |top: &[Ranked]| if top.len() < k { f64::NEG_INFINITY } else { top[k - 1].log };
        for &row in &self.rows {
            let log = self.log(row);
            if log < floor(&top) || (top.len() == k && log <= f64::NEG_INFINITY) {
                break;
            }
            if self.is_listed(row, entries, &mut listed) {
                continue;
            }
            if !insert(&mut top, k, Ranked { row, log, w: 0.0 }) {
                break;
            }
        }
        if top.is_empty() {
            return Best { top, ties: 0, lowest: NONE };
        }
        let limit = top[0].log - TIE;
        let mut ties = 0;
        let mut lowest = top[0];
        let mut tie = |ranked: Ranked| {
            ties += 1;
            if ranked.row < lowest.row {
                lowest = ranked;
            }
        };
        for &(row, w) in entries {
            let log = self.log(row) + w * self.logs.inverse;
            if log >= limit {
                tie(Ranked { row, log, w });
            }
        }
        for &row in &self.rows {
            let log = self.log(row);
            if log < limit {
                break;
            }
            if !self.is_listed(row, entries, &mut listed) {
                tie(Ranked { row, log, w: 0.0 });
            }
        }
        Best { top, ties, lowest }
    }

    fn log(&self, row: u32) -> f64 {
        self.logs.rows[row as usize]
    }

    /// Whether a column lists a row; sorts the list on first use.
    fn is_listed(&self, row: u32, entries: &[(u32, f64)], sorted: &mut Vec<u32>) -> bool {
        if self.complete {
            return true;
        }
        if sorted.len() != entries.len() {
            sorted.extend(entries.iter().map(|entry| entry.0));
            sorted.sort_unstable();
        }
        sorted.binary_search(&row).is_ok()
    }
}

#[derive(Debug, Clone, Copy)]
struct Ranked {
    row: u32,
    log: f64,
    w: f64,
}

const NONE: Ranked = Ranked { row: NO_ROW, log: f64::NEG_INFINITY, w: 0.0 };

struct Best {
    top: Vec<Ranked>,
    ties: u32,
    lowest: Ranked,
}

/// Inserts into a list of at most `k`, best first; returns false if the entry is worse than all of
/// them.
fn insert(top: &mut Vec<Ranked>, k: usize, new: Ranked) -> bool {
    let better = |old: &Ranked| old.log > new.log || (old.log >= new.log && old.row < new.row);
    if top.len() == k && better(&top[k - 1]) {
        return false;
    }
    let at = top.iter().rposition(better).map_or(0, |last| last + 1);
    top.insert(at, new);
    top.truncate(k);
    true
}

impl UotOutput {
    /// Best row of every column, with measures of its quality.
    ///
    /// # Errors
    /// [`UotError::Mismatch`] for a problem of a different size.
    pub fn correspondence(&self, problem: &UotProblem<'_>) -> Result<Correspondence, UotError> {
        self.check(problem)?;
        let logs = self.log_factors(problem);
        let ranking = Ranking::new(&logs, problem.lists_every_row());
        let k = 2.min(problem.num_rows());
        let top = logs.rows.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // if only candidates are listed, no row is unrelated
        let top = if matches!(problem.cost, Cost::Sparse(_)) { f64::NEG_INFINITY } else { top };
        let background = top + logs.rows.iter().map(|s| (s - top).exp()).sum::<f64>().ln();
        let columns = problem.map_columns(|j, entries| {
            let best = ranking.best(entries, k);
            let margin = match &best.top[..] {
                [] => 0.0,
                [_] => 1.0,
                [first, second, ..] => -(second.log - first.log).exp_m1(),
            };
            let far = (background + logs.cols[j]).exp() / self.col_mass[j];
            // an empty column (weight zero) has no near mass
            let near_share = if far.is_nan() { 0.0 } else { (1.0 - far).clamp(0.0, 1.0) };
            (best.lowest.row, best.ties, margin, near_share, best.lowest.w)
        });
        Ok(Correspondence {
            rows: columns.iter().map(|c| c.0).collect(),
            tie_counts: columns.iter().map(|c| c.1).collect(),
            margins: columns.iter().map(|c| c.2).collect(),
            near_share: columns.iter().map(|c| c.3).collect(),
            w_best: columns.iter().map(|c| c.4).collect(),
        })
    }

    /// The `k` best rows of every column, `[m, min(k, n)]` row-major, best first, equal entries by
    /// row.
    ///
    /// # Errors
    /// [`UotError::Mismatch`] for a problem of a different size, [`UotError::BadParam`] for
    /// `k = 0`.
    pub fn top_rows(&self, problem: &UotProblem<'_>, k: usize) -> Result<Vec<TopRow>, UotError> {
        self.check(problem)?;
        if k == 0 {
            let expected = "at least one row";
            return Err(UotError::BadParam { name: "k", value: 0.0, expected });
        }
        let logs = self.log_factors(problem);
        let ranking = Ranking::new(&logs, problem.lists_every_row());
        let k = k.min(problem.num_rows());
        let columns = problem.map_columns(|j, entries| {
            let scale = logs.cols[j] - self.col_mass[j].ln();
            let best = ranking.best(entries, k);
            let convert = |ranked: Ranked| {
                let share = (ranked.log + scale).exp();
                let share = if share.is_nan() { 0.0 } else { share };
                TopRow { row: ranked.row, share, weight: ranked.w }
            };
            let mut top: Vec<TopRow> = best.top.into_iter().map(convert).collect();
            top.resize(k, TopRow { row: NO_ROW, share: 0.0, weight: 0.0 });
            top
        });
        Ok(columns.into_iter().flatten().collect())
    }
}
