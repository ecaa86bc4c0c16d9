//! First pass over a clip: ranges of all values, which determine the
//! moving attributes and the storage order of splats.

use super::value::{Attribute, Steps, values};
use crate::clip::{Hemispheres, trimmed_diagonal};
use crate::error::IoError;
use gs_core::Splats;
use std::path::Path;

/// Range of every value over the clip.
#[derive(Debug)]
pub(super) struct ValueRanges {
    /// By attribute, then row.
    ranges: [Vec<Range>; 5],
    /// Positions of the first frame.
    first: Vec<[f32; 3]>,
}

#[derive(Debug, Clone, Copy)]
struct Range {
    min: [f32; 4],
    max: [f32; 4],
}

impl Range {
    const EMPTY: Self = Self { min: [f32::INFINITY; 4], max: [f32::NEG_INFINITY; 4] };

    fn add(&mut self, values: [f32; 4]) {
        for (k, value) in values.into_iter().enumerate() {
            self.min[k] = self.min[k].min(value);
            self.max[k] = self.max[k].max(value);
        }
    }
}

impl ValueRanges {
    pub(super) fn new(num_splats: usize) -> Self {
        Self { ranges: Attribute::ALL.map(|_| vec![Range::EMPTY; num_splats]), first: Vec::new() }
    }

    pub(super) fn add(&mut self, splats: &Splats, hemispheres: &Hemispheres) {
        if self.first.is_empty() {
            self.first.clone_from(&splats.means);
        }
        for attribute in Attribute::ALL {
            for (row, range) in self.ranges[attribute as usize].iter_mut().enumerate() {
                range.add(values(attribute, splats, hemispheres, row));
            }
        }
    }

    /// The scene's size, world units: see [`super::WriteOptions::tolerance`].
    pub(super) fn size(&self, rows: &[usize]) -> f64 {
        /// Splats that move by less than this share of the whole scene's size count as static.
        const MOVING_SHARE: f64 = 0.002;
        let first: Vec<[f32; 3]> = rows.iter().map(|&row| self.first[row]).collect();
        let minimum = MOVING_SHARE * trimmed_diagonal(&first);
        let ranges = &self.ranges[Attribute::Pos as usize];
        let moved: Vec<bool> = rows
            .iter()
            .map(|&row| {
                let range = &ranges[row];
                let squared: f64 =
                    (0..3).map(|k| f64::from(range.max[k] - range.min[k]).powi(2)).sum();
                squared.sqrt() > minimum
            })
            .collect();
        size_of(&first, &moved)
    }

    /// Largest absolute value of an attribute.
    fn largest(&self, attribute: Attribute, rows: &[usize]) -> f64 {
        let ranges = &self.ranges[attribute as usize];
        let largest = |row: &usize| {
            let range = &ranges[*row];
            (0..3).map(|k| range.min[k].abs().max(range.max[k].abs())).fold(0.0, f32::max)
        };
        f64::from(rows.iter().map(largest).fold(0.0, f32::max))
    }

    /// Rejects values whose grid indices, or differences of them, exceed 32 bits.
    pub(super) fn check_range(
        &self,
        path: &Path,
        steps: &Steps,
        rows: &[usize],
    ) -> Result<(), IoError> {
        const LARGEST: f64 = (1 << 29) as f64;
        for attribute in [Attribute::Pos, Attribute::Scale] {
            let largest = self.largest(attribute, rows);
            if largest / steps.fixed(attribute) > LARGEST {
                return Err(IoError::content(
                    path,
                    format!(
                        "a {} of {largest:.3e} is too large for a grid step of {:.3e}; remove \
                        that splat, or raise the tolerance",
                        if attribute == Attribute::Pos { "coordinate" } else { "logarithmic size" },
                        steps.fixed(attribute)
                    ),
                ));
            }
        }
        Ok(())
    }

    /// Bounding box of the positions of all frames: smallest x, y, z, then largest.
    pub(super) fn bounds(&self, rows: &[usize]) -> [f32; 6] {
        let mut all = Range::EMPTY;
        for &row in rows {
            all.add(self.ranges[Attribute::Pos as usize][row].min);
            all.add(self.ranges[Attribute::Pos as usize][row].max);
        }
        let ([x, y, z, _], [u, v, w, _]) = (all.min, all.max);
        [x, y, z, u, v, w]
    }

    /// Grid point within the bound of all values of the clip, by channel; `None` if there is none.
    pub(super) fn constant_bins(
        &self,
        attribute: Attribute,
        row: usize,
        steps: &Steps,
    ) -> Option<[i32; 4]> {
        let range = &self.ranges[attribute as usize][row];
        let (step, bound) = (steps.fixed(attribute), steps.bound(attribute));
        let mut bins = [0; 4];
        for k in 0..attribute.channels() {
            let (low, high) = (f64::from(range.min[k]), f64::from(range.max[k]));
            #[expect(clippy::cast_possible_truncation, reason = "as Steps::bin")]
            let bin = (0.5 * (low + high) / step).round() as i32;
            let value = f64::from(bin) * step;
            if (value - low).abs() > bound || (value - high).abs() > bound {
                return None;
            }
            bins[k] = bin;
        }
        Some(bins)
    }

    /// Storage order of the splats: by their changing attributes, then along a
    /// space-filling curve, so that neighbours in the file are neighbours in the scene and
    /// the changing splats of each attribute form few runs.
    pub(super) fn order(&self, rows: &[usize], steps: &Steps) -> Order {
        let bounds = self.bounds(rows);
        let mut keyed: Vec<(u8, u64, usize)> = rows
            .iter()
            .map(|&row| {
                let changing = Attribute::ALL
                    .into_iter()
                    .filter(|&attribute| self.constant_bins(attribute, row, steps).is_none())
                    .fold(0, |mask, attribute| mask | 1 << attribute.id());
                (changing, morton(self.first[row], bounds), row)
            })
            .collect();
        keyed.sort_unstable();
        Order {
            changing: keyed.iter().map(|(changing, ..)| *changing).collect(),
            rows: keyed.into_iter().map(|(.., row)| row).collect(),
        }
    }
}

/// Size of the moving splats, or of all splats if none move.
fn size_of(first: &[[f32; 3]], moved: &[bool]) -> f64 {
    let whole = trimmed_diagonal(first);
    let moving: Vec<[f32; 3]> =
        first.iter().zip(moved).filter(|(_, moved)| **moved).map(|(mean, _)| *mean).collect();
    if moving.len() >= MIN_MOVING.max(first.len() / 100) {
        trimmed_diagonal(&moving)
    } else {
        whole
    }
}

/// If fewer splats move than this, or than one in a hundred,
/// the scene's size is that of all splats.
const MIN_MOVING: usize = 50;

/// Morton code of a point in the box, 21 bits per axis.
fn morton(point: [f32; 3], bounds: [f32; 6]) -> u64 {
    const CELLS: f64 = ((1 << 21) - 1) as f64;
    let mut code = 0;
    for k in 0..3 {
        let span = (f64::from(bounds[k + 3]) - f64::from(bounds[k])).max(f64::MIN_POSITIVE);
        let position = (f64::from(point[k]) - f64::from(bounds[k])) / span * CELLS;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let position = position.clamp(0.0, CELLS) as u64;
        for bit in 0..21 {
            code |= (position >> bit & 1) << (3 * bit + k as u64);
        }
    }
    code
}

/// Storage order of the splats.
#[derive(Debug)]
pub(super) struct Order {
    /// Rows of the scene in the order of the file.
    pub(super) rows: Vec<usize>,
    /// Bit `a` is set where attribute `a` changes, in the order of the file.
    pub(super) changing: Vec<u8>,
}

impl Order {
    pub(super) fn changes(&self, position: usize, attribute: Attribute) -> bool {
        self.changing[position] >> attribute.id() & 1 == 1
    }

    /// Scene rows of the splats whose attribute changes, in the order of the file.
    pub(super) fn dynamic_rows(&self, attribute: Attribute) -> impl Iterator<Item = usize> + '_ {
        (0..self.rows.len())
            .filter(move |&position| self.changes(position, attribute))
            .map(|position| self.rows[position])
    }

    pub(super) fn dynamic_count(&self, attribute: Attribute) -> usize {
        self.dynamic_rows(attribute).count()
    }

    /// Runs of equal change.
    pub(super) fn groups(&self) -> Vec<(u8, usize)> {
        self.changing.chunk_by(|a, b| a == b).map(|run| (run[0], run.len())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curve_visits_octants_in_order() {
        let bounds = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
        let octants: Vec<u64> = (0..8_u8)
            .map(|i| morton([0, 1, 2].map(|k| if i >> k & 1 == 1 { 0.9 } else { 0.1 }), bounds))
            .collect();
        assert!(octants.is_sorted(), "{octants:?}");
        assert_eq!(morton([0.5; 3], [0.5; 6]), 0, "a box without extent");
    }
}
