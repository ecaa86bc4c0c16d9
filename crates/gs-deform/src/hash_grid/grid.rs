//! [`HashGrid`]: the levels of a grid and their table.

use super::level::{IndexRule, Level, resolution};
use crate::FieldError;

/// Largest accepted number of levels; published models have 16.
const MAX_LEVELS: usize = 32;
/// Largest accepted resolution, log₂.
const MAX_LOG2_RESOLUTION: u32 = 30;

/// Parameters of a grid's layout, named as in the training options.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GridShape {
    /// `L`, `n_levels`.
    pub levels: usize,
    /// `F`, `n_features_per_level`: 1, 2, 4 or 8.
    pub features: usize,
    /// `T`, `hashmap_size`: log₂ of the largest number of entries per level.
    pub log2_table: u32,
    /// `B`, `base_resolution`; the resolution doubles from level to level.
    pub base: u32,
}

impl GridShape {
    /// Verifies the ranges of the parameters without allocating.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn check(&self) -> Result<(), FieldError> {
        let refuse = |what: String| Err(FieldError::Unsupported(what));
        if !(1..=MAX_LEVELS).contains(&self.levels) {
            return refuse(format!("n_levels = {}, expected 1 to {MAX_LEVELS}", self.levels));
        }
        if ![1, 2, 4, 8].contains(&self.features) {
            return refuse(format!(
                "n_features_per_level = {}, expected 1, 2, 4 or 8",
                self.features
            ));
        }
        if !(3..=MAX_LOG2_RESOLUTION).contains(&self.log2_table) {
            return refuse(format!(
                "hashmap_size = {}, expected log2 of a table's entries, 3 to {MAX_LOG2_RESOLUTION}",
                self.log2_table
            ));
        }
        let finest = u64::from(self.base) << (self.levels - 1);
        if self.base == 0 || finest > 1 << MAX_LOG2_RESOLUTION {
            return refuse(format!(
                "base_resolution = {} with {} levels ends at resolution {finest}, expected 1 to 2^{MAX_LOG2_RESOLUTION}",
                self.base, self.levels
            ));
        }
        Ok(())
    }

    /// `L·F`, length of the encoding.
    pub fn num_features(&self) -> usize {
        self.levels * self.features
    }

    /// Total number of entries. Valid for shapes that pass [`GridShape::check`].
    pub fn num_entries(&self) -> usize {
        (0..self.levels).map(|level| self.size(level) as usize).sum()
    }

    /// The levels under an index rule. Valid for shapes that pass [`GridShape::check`].
    pub fn levels(&self, rule: IndexRule) -> Vec<Level> {
        let mut start = 0;
        (0..self.levels)
            .map(|index| {
                let level = Level::new(self.scale(index), start, self.size(index), rule);
                start += level.size as usize;
                level
            })
            .collect()
    }

    /// Levels on which the index rules differ.
    pub fn ambiguous_levels(&self) -> Vec<usize> {
        let (current, older) = (self.levels(IndexRule::Current), self.levels(IndexRule::Older));
        (0..self.levels).filter(|&l| current[l].addressing != older[l].addressing).collect()
    }

    /// `base · 2^l − 1`, in single precision as the reference computes it.
    fn scale(&self, level: usize) -> f32 {
        #[expect(clippy::cast_possible_truncation, reason = "rounded to single on purpose")]
        let resolution = (u64::from(self.base) << level) as f64 as f32;
        resolution - 1.0
    }

    fn size(&self, level: usize) -> u32 {
        let points = u64::from(resolution(self.scale(level))).saturating_pow(4);
        let table = 1_u32 << self.log2_table;
        points
            .checked_next_multiple_of(8)
            .and_then(|n| u32::try_from(n).ok())
            .map_or(table, |n| n.min(table))
    }
}

/// Features at lattice points of several resolutions over the unit box and time.
#[derive(Debug, Clone, PartialEq)]
pub struct HashGrid {
    shape: GridShape,
    levels: Vec<Level>,
    /// `[entries, F]`, levels one after the other.
    table: Vec<f32>,
}

impl HashGrid {
    /// A grid from its table, `[entries, F]`, levels one after the other.
    ///
    /// # Errors
    /// If the shape is out of range, or the table has a different size or non-finite values.
    pub fn new(shape: GridShape, rule: IndexRule, table: Vec<f32>) -> Result<Self, FieldError> {
        shape.check()?;
        let entries = shape.num_entries();
        if table.len() != entries * shape.features {
            return Err(FieldError::Shape {
                tensor: "hash table".to_owned(),
                found: vec![table.len()],
                expected: format!("[{entries}, {}]", shape.features),
            });
        }
        if !table.iter().all(|value| value.is_finite()) {
            return Err(FieldError::NotFinite { tensor: "hash table".to_owned() });
        }
        Ok(Self { shape, levels: shape.levels(rule), table })
    }

    /// The same table with a different index rule.
    #[must_use]
    pub fn with_rule(self, rule: IndexRule) -> Self {
        Self { levels: self.shape.levels(rule), ..self }
    }

    /// Layout of the grid.
    pub fn shape(&self) -> GridShape {
        self.shape
    }

    /// Levels, coarse to fine.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// Entries of one level, `[size, F]`.
    pub fn entries(&self, level: &Level) -> &[f32] {
        &self.table[level.start * self.shape.features..]
            [..level.size as usize * self.shape.features]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PUBLISHED: GridShape = GridShape { levels: 16, features: 4, log2_table: 15, base: 16 };

    #[test]
    fn table_sizes_of_published_models() {
        for (log2_table, floats) in
            [(15, 2_121_728), (16, 4_218_880), (17, 8_151_040), (18, 16_015_360), (19, 31_744_000)]
        {
            let shape = GridShape { log2_table, ..PUBLISHED };
            assert_eq!(shape.num_entries() * 4 + 24_576, floats, "2^{log2_table} entries");
        }
    }

    #[test]
    fn rules_differ_on_the_finest_levels_of_large_tables() {
        let levels = |log2_table| GridShape { log2_table, ..PUBLISHED }.ambiguous_levels();
        assert!(levels(13).is_empty() && levels(15).is_empty(), "small tables");
        assert_eq!(levels(16), [12], "2^16");
        assert_eq!(levels(17), [12, 13], "2^17");
        assert_eq!(levels(18), [12, 13, 14], "2^18");
        assert_eq!(levels(19), [12, 13, 14, 15], "2^19");
    }

    #[test]
    fn absurd_shapes_are_refused_without_allocating() {
        assert!(PUBLISHED.check().is_ok(), "published");
        for shape in [
            GridShape { levels: 0, ..PUBLISHED },
            GridShape { levels: usize::MAX, ..PUBLISHED },
            GridShape { levels: 28, ..PUBLISHED },
            GridShape { features: 3, ..PUBLISHED },
            GridShape { features: usize::MAX, ..PUBLISHED },
            GridShape { log2_table: 0, ..PUBLISHED },
            GridShape { log2_table: 31, ..PUBLISHED },
            GridShape { base: 0, ..PUBLISHED },
            GridShape { base: u32::MAX, ..PUBLISHED },
        ] {
            assert!(HashGrid::new(shape, IndexRule::Current, Vec::new()).is_err(), "{shape:?}");
        }
        let large = GridShape { log2_table: 30, levels: 27, ..PUBLISHED };
        let error = HashGrid::new(large, IndexRule::Older, vec![0.0; 8]).unwrap_err();
        assert!(matches!(error, FieldError::Shape { .. }), "{error}");
        let tiny = GridShape { levels: 1, features: 1, log2_table: 3, base: 1 };
        assert!(
            HashGrid::new(tiny, IndexRule::Older, vec![0.0; 8]).is_ok(),
            "one point, eight entries"
        );
        let nan = HashGrid::new(tiny, IndexRule::Older, vec![f32::NAN; 8]).unwrap_err();
        assert!(matches!(nan, FieldError::NotFinite { .. }), "{nan}");
    }
}
