//! Rows that no renderer can use: NaN, infinities, zero quaternions.

use gs_core::Splats;
use thiserror::Error;

/// What to do with damaged rows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Damage {
    /// Drop them and say how many.
    #[default]
    Drop,
    /// Fail.
    Fail,
    /// Leave them in, counted.
    Keep,
}

/// Count of damaged rows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RepairReport {
    /// Rows examined.
    pub rows: usize,
    /// Rows with NaN or an infinity.
    pub not_finite: usize,
    /// Finite rows whose quaternion is zero.
    pub zero_quaternion: usize,
}

impl RepairReport {
    /// Damaged rows of either kind.
    pub fn damaged(&self) -> usize {
        self.not_finite + self.zero_quaternion
    }
}

/// Splats after [`sanitize`].
#[derive(Debug, Clone, PartialEq)]
pub struct Sanitized {
    /// The splats left.
    pub splats: Splats,
    /// Which input rows they are, if any were dropped.
    pub kept: Option<Vec<usize>>,
    /// What was found.
    pub report: RepairReport,
}

/// Damaged rows where none are allowed, or none left without them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error(
    "{} of {} Gaussians are damaged ({} with NaN or infinite values, {} with a zero quaternion), first at row {first}; {}",
    report.damaged(), report.rows, report.not_finite, report.zero_quaternion,
    if report.damaged() == report.rows { "none would be left" } else { "allow dropping them, or clean the file" }
)]
pub struct DamagedRows {
    /// What was found.
    pub report: RepairReport,
    /// First damaged row.
    pub first: usize,
}

/// Rows that are not usable, counted.
pub(crate) fn survey(splats: &Splats) -> (RepairReport, Vec<usize>) {
    let mut report = RepairReport { rows: splats.len(), ..RepairReport::default() };
    let mut damaged = Vec::new();
    for i in 0..splats.len() {
        if splats.is_finite(i) {
            continue;
        }
        damaged.push(i);
        let zero = only_rotation_missing(splats, i);
        *if zero { &mut report.zero_quaternion } else { &mut report.not_finite } += 1;
    }
    (report, damaged)
}

/// Whether a row that is not usable is finite, and has a zero quaternion only.
pub(crate) fn only_rotation_missing(splats: &Splats, row: usize) -> bool {
    splats.quats[row] == [0.0; 4]
        && splats.means[row].iter().chain(&splats.log_scales[row]).all(|v| v.is_finite())
        && splats.opacity_logits[row].is_finite()
        && splats.sh_of(row).iter().flatten().all(|v| v.is_finite())
}

/// Counts damaged rows of `splats` (arrays of equal length) and drops, keeps or refuses them.
///
/// # Errors
/// With [`Damage::Fail`], if there are any; with [`Damage::Drop`], if nothing would be left.
pub fn sanitize(splats: Splats, damage: Damage) -> Result<Sanitized, DamagedRows> {
    let (report, damaged) = survey(&splats);
    let Some(&first) = damaged.first() else {
        return Ok(Sanitized { splats, kept: None, report });
    };
    match damage {
        Damage::Keep => Ok(Sanitized { splats, kept: None, report }),
        Damage::Drop if damaged.len() < splats.len() => {
            let kept = without(splats.len(), &damaged);
            Ok(Sanitized { splats: splats.select(&kept), kept: Some(kept), report })
        }
        Damage::Drop | Damage::Fail => Err(DamagedRows { report, first }),
    }
}

/// `0..n` without the ascending `dropped`.
pub(crate) fn without(n: usize, dropped: &[usize]) -> Vec<usize> {
    let mut dropped = dropped.iter().copied().peekable();
    (0..n).filter(|row| dropped.next_if_eq(row).is_none()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn three() -> Splats {
        Splats {
            means: vec![[0.0; 3], [1.0; 3], [2.0; 3]],
            quats: vec![[1.0, 0.0, 0.0, 0.0]; 3],
            log_scales: vec![[0.0; 3]; 3],
            opacity_logits: vec![0.0; 3],
            sh: vec![[0.0; 3]; 3],
            sh_degree: 0,
        }
    }

    #[test]
    fn whole_rows_pass_untouched() {
        let out = sanitize(three(), Damage::Fail).unwrap();
        assert_eq!((out.splats, out.kept), (three(), None), "nothing to do");
    }

    #[test]
    fn damaged_rows_are_counted_by_kind() {
        let mut splats = three();
        splats.sh[0][1] = f32::NAN;
        splats.quats[2] = [0.0; 4];
        let out = sanitize(splats.clone(), Damage::Drop).unwrap();
        assert_eq!(out.kept, Some(vec![1]), "row 1 is left");
        assert_eq!((out.report.not_finite, out.report.zero_quaternion), (1, 1), "one of each");
        assert_eq!(out.splats.means, [[1.0; 3]], "row 1");
        let error = sanitize(splats.clone(), Damage::Fail).unwrap_err();
        assert_eq!((error.first, error.report.damaged()), (0, 2), "{error}");
        assert_eq!(sanitize(splats.clone(), Damage::Keep).unwrap().splats.len(), 3, "kept");
        splats.log_scales[1][0] = f32::NEG_INFINITY;
        let error = sanitize(splats, Damage::Drop).unwrap_err().to_string();
        assert!(error.contains("none would be left"), "{error}");
    }
}
