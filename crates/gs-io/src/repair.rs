//! Interpretation of stored values: meaningful infinities, and rows that no renderer can use.
//!
//! Exporters write `logit(1)` for an opaque splat and `ln(0)` for a flat one. Such rows are valid,
//! and get finite values that stay finite in every later computation and format: [`OPAQUE_LOGIT`],
//! [`TRANSPARENT_LOGIT`], [`FLAT_LOG_SCALE`]. Damage is NaN anywhere, an infinite position, SH
//! coefficient or rotation, a log-scale of +∞, and a zero quaternion. Every reader of this crate
//! uses these rules. (Formats with one byte per opacity have no infinities: their end values
//! represent all opacities that round to them.)

use gs_core::Splats;
use thiserror::Error;

/// Opacity logit that replaces +∞ (opacity exactly 1): the largest integer whose opacity is below 1
/// in single precision, so that the logit of that opacity is finite. The opacity is 1 − 1.2·10⁻⁷,
/// above the cap of every rasteriser.
pub const OPAQUE_LOGIT: f32 = 16.0;
/// Opacity logit that replaces −∞ (opacity exactly 0): opacity 1.1·10⁻⁷,
/// far below the 1/255 that rasterisers draw.
pub const TRANSPARENT_LOGIT: f32 = -OPAQUE_LOGIT;
/// Log-scale that replaces −∞ (no extent): a standard deviation of 2·10⁻⁹. Its square,
/// its inverse and the square of its inverse are normal single-precision numbers, and
/// it is the smallest value that compressed PLY stores.
pub const FLAT_LOG_SCALE: f32 = -20.0;

/// Treatment of damaged rows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Damage {
    /// Drop them and report their number.
    #[default]
    Drop,
    /// Fail.
    Fail,
    /// Keep and count them.
    Keep,
}

/// Numbers of damaged rows and of meaningful infinities.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct RepairReport {
    /// Rows examined.
    pub rows: usize,
    /// Rows with NaN or a meaningless infinity.
    pub not_finite: usize,
    /// Finite rows whose quaternion is zero.
    pub zero_quaternion: usize,
    /// Damaged rows of a clip that are valid in other frames: they
    /// are invisible only in the damaged frames.
    pub hidden: usize,
    /// Infinities replaced by finite values, over all frames read.
    pub infinities: Infinities,
}

impl RepairReport {
    /// Damaged rows of either kind.
    pub fn damaged(&self) -> usize {
        self.not_finite + self.zero_quaternion
    }

    /// Warning about damaged rows, if there are any; `dropped` is whether they were dropped.
    pub fn warning(&self, dropped: bool) -> Option<String> {
        let (damaged, hidden) = (self.damaged(), self.hidden);
        if damaged == 0 {
            return None;
        }
        let fate = match (dropped, damaged - hidden) {
            (false, _) => "were kept".to_owned(),
            (true, _) if hidden == 0 => "were dropped".to_owned(),
            (true, 0) => "are invisible in the frames in which they are damaged".to_owned(),
            (true, gone) => format!(
                "are invisible in the frames in which they are damaged; {gone}, damaged in all frames, were dropped"
            ),
        };
        Some(format!(
            "{damaged} of {} Gaussians are damaged ({} with NaN or infinite values, {} with a zero quaternion) and {fate}",
            self.rows, self.not_finite, self.zero_quaternion
        ))
    }
}

/// Numbers of meaningful infinities.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Infinities {
    /// Opacities of exactly 1 (logit +∞).
    pub opaque: usize,
    /// Opacities of exactly 0 (logit −∞).
    pub transparent: usize,
    /// Rows with an axis of no extent (log-scale −∞).
    pub flat: usize,
}

impl Infinities {
    /// Note on the infinities, if there were any.
    pub fn note(&self) -> Option<String> {
        let parts = [
            (self.opaque, "opacities of exactly 1"),
            (self.transparent, "opacities of exactly 0"),
            (self.flat, "splats with an axis without extent"),
        ];
        let counts: Vec<String> = parts
            .into_iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, what)| format!("{count} {what}"))
            .collect();
        (!counts.is_empty()).then(|| {
            format!("{} (stored as infinities) were replaced by finite values", counts.join(", "))
        })
    }

    pub(crate) fn add(&mut self, other: Self) {
        self.opaque += other.opaque;
        self.transparent += other.transparent;
        self.flat += other.flat;
    }
}

/// Replaces meaningful infinities by finite values; other values are unchanged.
pub fn replace_infinities(splats: &mut Splats) -> Infinities {
    let mut found = Infinities::default();
    for logit in &mut splats.opacity_logits {
        if *logit == f32::INFINITY {
            (*logit, found.opaque) = (OPAQUE_LOGIT, found.opaque + 1);
        } else if *logit == f32::NEG_INFINITY {
            (*logit, found.transparent) = (TRANSPARENT_LOGIT, found.transparent + 1);
        }
    }
    for log_scale in &mut splats.log_scales {
        let mut flat = false;
        for axis in log_scale.iter_mut().filter(|axis| **axis == f32::NEG_INFINITY) {
            (*axis, flat) = (FLAT_LOG_SCALE, true);
        }
        found.flat += usize::from(flat);
    }
    found
}

/// Splats after [`sanitize`].
#[derive(Debug, Clone, PartialEq)]
pub struct Sanitized {
    /// The remaining splats.
    pub splats: Splats,
    /// Their input rows, if any were dropped.
    pub kept: Option<Vec<usize>>,
    /// Counts of damaged rows and infinities.
    pub report: RepairReport,
}

/// Error: damaged rows where none are allowed, or no rows left without them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error(
    "{} of {} Gaussians are damaged ({} with NaN or infinite values, {} with a zero quaternion), first at row {first}; {}",
    report.damaged(), report.rows, report.not_finite, report.zero_quaternion,
    if report.damaged() == report.rows { "none would be left" } else { "allow dropping them, or clean the file" }
)]
pub struct DamagedRows {
    /// Counts of damaged rows and infinities.
    pub report: RepairReport,
    /// First damaged row.
    pub first: usize,
}

/// Counts rows that are not usable, or `broken` for another
/// reason; [`replace_infinities`] must run first.
pub(crate) fn count_damage(
    splats: &Splats,
    broken: impl Fn(usize) -> bool,
) -> (RepairReport, Vec<usize>) {
    let mut report = RepairReport { rows: splats.len(), ..RepairReport::default() };
    let mut damaged = Vec::new();
    for i in 0..splats.len() {
        if splats.is_finite(i) && !broken(i) {
            continue;
        }
        damaged.push(i);
        let zero = !broken(i) && only_rotation_missing(splats, i);
        *if zero { &mut report.zero_quaternion } else { &mut report.not_finite } += 1;
    }
    (report, damaged)
}

/// Whether the only damage of a row is a zero quaternion.
pub(crate) fn only_rotation_missing(splats: &Splats, row: usize) -> bool {
    splats.quats[row] == [0.0; 4]
        && splats.means[row].iter().chain(&splats.log_scales[row]).all(|v| v.is_finite())
        && splats.opacity_logits[row].is_finite()
        && splats.sh_of(row).iter().flatten().all(|v| v.is_finite())
}

/// Replaces meaningful infinities of `splats` (arrays of equal length) by finite values, counts
/// damaged rows, and drops, keeps or rejects them.
///
/// # Errors
/// With [`Damage::Fail`], if there are any; with [`Damage::Drop`], if no row would be left.
pub fn sanitize(splats: Splats, damage: Damage) -> Result<Sanitized, DamagedRows> {
    sanitize_with(splats, damage, |_row| false)
}

/// As [`sanitize`]; `broken` selects rows that are unusable for
/// another reason, which count as not finite.
pub(crate) fn sanitize_with(
    mut splats: Splats,
    damage: Damage,
    broken: impl Fn(usize) -> bool,
) -> Result<Sanitized, DamagedRows> {
    let infinities = replace_infinities(&mut splats);
    let (mut report, damaged) = count_damage(&splats, broken);
    report.infinities = infinities;
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
    fn valid_rows_are_unchanged() {
        let out = sanitize(three(), Damage::Fail).unwrap();
        assert_eq!((out.splats, out.kept), (three(), None), "nothing to do");
    }

    #[test]
    fn damaged_rows_are_counted_by_kind() {
        let mut splats = three();
        splats.sh[0][1] = f32::NAN;
        splats.quats[2] = [0.0; 4];
        let out = sanitize(splats.clone(), Damage::Drop).unwrap();
        assert_eq!(out.kept, Some(vec![1]), "row 1 remains");
        assert_eq!((out.report.not_finite, out.report.zero_quaternion), (1, 1), "one of each");
        assert_eq!(out.splats.means, [[1.0; 3]], "row 1");
        let error = sanitize(splats.clone(), Damage::Fail).unwrap_err();
        assert_eq!((error.first, error.report.damaged()), (0, 2), "{error}");
        assert_eq!(sanitize(splats.clone(), Damage::Keep).unwrap().splats.len(), 3, "kept");
        splats.log_scales[1][0] = f32::INFINITY;
        let error = sanitize(splats, Damage::Drop).unwrap_err().to_string();
        assert!(error.contains("none would be left"), "{error}");
    }

    #[test]
    fn meaningful_infinities_are_not_damage() {
        let mut splats = three();
        splats.opacity_logits = vec![f32::INFINITY, f32::NEG_INFINITY, 0.5];
        splats.log_scales[2][1] = f32::NEG_INFINITY;
        for damage in [Damage::Drop, Damage::Fail, Damage::Keep] {
            let out = sanitize(splats.clone(), damage).unwrap();
            assert_eq!((out.kept, out.report.damaged()), (None, 0), "{damage:?}: all rows");
            let found = Infinities { opaque: 1, transparent: 1, flat: 1 };
            assert_eq!(out.report.infinities, found, "{damage:?}: counted");
            assert_eq!(out.splats.opacity_logits, [16.0, -16.0, 0.5], "{damage:?}: opacities");
            assert_eq!(out.splats.log_scales[2], [0.0, -20.0, 0.0], "{damage:?}: only that axis");
        }
        let note = sanitize(splats, Damage::Drop).unwrap().report.infinities.note().unwrap();
        assert!(
            note.contains("1 opacities of exactly 1") && note.contains("without extent"),
            "{note}"
        );
        assert_eq!(sanitize(three(), Damage::Drop).unwrap().report.infinities.note(), None, "none");
    }

    #[test]
    fn meaningless_infinities_are_damage() {
        let changes: [fn(&mut Splats); 6] = [
            |s| s.means[1][0] = f32::INFINITY,
            |s| s.means[1][0] = f32::NEG_INFINITY,
            |s| s.sh[1][2] = f32::NEG_INFINITY,
            |s| s.quats[1][3] = f32::INFINITY,
            |s| s.log_scales[1][0] = f32::INFINITY,
            |s| s.opacity_logits[1] = f32::NAN,
        ];
        for (index, change) in changes.into_iter().enumerate() {
            let mut splats = three();
            change(&mut splats);
            let out = sanitize(splats, Damage::Drop).unwrap();
            assert_eq!(out.kept, Some(vec![0, 2]), "change {index}");
        }
    }

    #[test]
    fn replaced_values_are_finite_after_activation() {
        use gs_core::activation::{logit, sigmoid};
        for value in [OPAQUE_LOGIT, TRANSPARENT_LOGIT] {
            assert!(logit(sigmoid(value)).is_finite(), "{value}");
            assert!(
                (logit(sigmoid(value)) - value).abs() < 0.1,
                "{value} is finite after activation"
            );
        }
        assert!(!logit(sigmoid(OPAQUE_LOGIT + 2.0)).is_finite(), "a larger one would not");
        assert!(sigmoid(OPAQUE_LOGIT) > 0.99 && sigmoid(TRANSPARENT_LOGIT) < 1.0 / 255.0, "ends");
        let scale = FLAT_LOG_SCALE.exp();
        for value in [scale, scale * scale, 1.0 / scale, 1.0 / (scale * scale).powi(2)] {
            assert!(value.is_normal(), "{value}");
        }
    }
}
