//! [`Precision`]: bounds of the difference between the values
//! written to a file and those read back.

/// Storage precision of one row: the largest difference, per attribute, between the
/// value read and the value written. Infinite if the file does not store the
/// attribute. Values outside a range are clamped to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowPrecision {
    /// Centres, world units, per axis.
    pub means: [f32; 3],
    /// Angle of the rotation, radians.
    pub rotation_rad: f32,
    /// Logarithms of the standard deviations, per stored axis.
    pub log_scales: [f32; 3],
    /// Smallest and largest log-scale that can be stored.
    pub log_scale_range: [f32; 2],
    /// Opacities after the sigmoid.
    pub opacity: f32,
    /// Coefficients of SH degree 0, per channel.
    pub sh_dc: [f32; 3],
    /// Smallest and largest such coefficient that can be stored.
    pub sh_dc_range: [f32; 2],
    /// Coefficients of SH degree 1, 2 and 3.
    pub sh_rest: [f32; 3],
    /// Smallest and largest such coefficient that can be stored.
    pub sh_rest_range: [f32; 2],
}

impl RowPrecision {
    /// Every value is stored exactly.
    pub const EXACT: Self = Self {
        means: [0.0; 3],
        rotation_rad: 0.0,
        log_scales: [0.0; 3],
        log_scale_range: [f32::NEG_INFINITY, f32::INFINITY],
        opacity: 0.0,
        sh_dc: [0.0; 3],
        sh_dc_range: [f32::NEG_INFINITY, f32::INFINITY],
        sh_rest: [0.0; 3],
        sh_rest_range: [f32::NEG_INFINITY, f32::INFINITY],
    };
}

/// [`RowPrecision`] of every row of a file, `[N]`: neighbouring rows share one.
#[derive(Debug, Clone, PartialEq)]
pub struct Precision {
    entries: Vec<RowPrecision>,
    rows_per_entry: usize,
}

impl Precision {
    /// The same precision for all rows.
    pub fn uniform(row: RowPrecision) -> Self {
        Self { entries: vec![row], rows_per_entry: usize::MAX }
    }

    /// Entry `i` applies to the rows from `i·rows_per_entry`; the
    /// last entry applies to all further rows.
    ///
    /// # Panics
    /// If there are no entries or `rows_per_entry` is 0.
    pub fn by_chunk(entries: Vec<RowPrecision>, rows_per_entry: usize) -> Self {
        assert!(!entries.is_empty() && rows_per_entry > 0, "a precision needs at least one entry");
        Self { entries, rows_per_entry }
    }

    /// Precision of row `row`.
    pub fn of(&self, row: usize) -> &RowPrecision {
        &self.entries[(row / self.rows_per_entry).min(self.entries.len() - 1)]
    }

    /// Precision of the rows `rows`, in that order.
    #[must_use]
    pub fn select(&self, rows: &[usize]) -> Self {
        if self.entries.len() == 1 || rows.is_empty() {
            return self.clone();
        }
        Self::by_chunk(rows.iter().map(|&row| *self.of(row)).collect(), 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_map_to_entries() {
        let entry = |opacity| RowPrecision { opacity, ..RowPrecision::EXACT };
        let chunks = Precision::by_chunk(vec![entry(1.0), entry(2.0)], 256);
        assert_eq!((chunks.of(255).opacity, chunks.of(256).opacity), (1.0, 2.0), "by chunk");
        assert_eq!(chunks.of(9999).opacity, 2.0, "the last entry applies to all further rows");
        let picked = chunks.select(&[300, 3]);
        assert_eq!((picked.of(0).opacity, picked.of(1).opacity), (2.0, 1.0), "selected");
        assert_eq!(Precision::uniform(entry(3.0)).select(&[7]).of(7).opacity, 3.0, "uniform");
    }
}
