//! Masks that keep parts of a scene static.

use crate::{FieldError, Head};

/// Factor of the stored parameters before a head's output is added.
#[derive(Debug, Clone, PartialEq)]
pub enum Mask {
    /// No mask: the factor is 1.
    One,
    /// A head with one output and no final activation: any real number, varying over time.
    StaticMlp(Head),
    /// A voxel grid, constant in time.
    EmptyVoxel(EmptyVoxel),
}

/// A grid of mask values with its own box, fading to 0 outside.
#[derive(Debug, Clone, PartialEq)]
pub struct EmptyVoxel {
    /// Values `[R, R, R]`: x slowest, z fastest.
    pub grid: Vec<f32>,
    /// `R`.
    pub resolution: usize,
    /// Minimum corner, world units.
    pub xyz_min: [f32; 3],
    /// Maximum corner, world units.
    pub xyz_max: [f32; 3],
}

impl EmptyVoxel {
    /// Trilinear, corner-aligned value at a world point; corners outside the grid count as 0.
    pub fn at(&self, mean: [f32; 3]) -> f32 {
        let last = (self.resolution - 1) as f32;
        let mut low = [0_i32; 3];
        let mut weight = [0.0_f32; 3];
        for axis in 0..3 {
            let v = (mean[axis] - self.xyz_min[axis]) / (self.xyz_max[axis] - self.xyz_min[axis])
                * 2.0
                - 1.0;
            // The value is 0 from one cell beyond either end; the clamp keeps the cast exact.
            let position = ((v + 1.0) * 0.5 * last).clamp(-2.0, last + 2.0);
            #[expect(
                clippy::cast_possible_truncation,
                reason = "clamped to the grid's neighbourhood; NaN becomes 0"
            )]
            let floor = position.floor() as i32;
            low[axis] = floor;
            weight[axis] = position - floor as f32;
        }
        let mut sum = 0.0;
        for corner in 0..8_usize {
            let mut index = 0;
            let mut product = 1.0;
            let mut inside = true;
            for axis in 0..3 {
                let upper = corner >> axis & 1 == 1;
                product *= if upper { weight[axis] } else { 1.0 - weight[axis] };
                match usize::try_from(low[axis] + i32::from(upper)) {
                    Ok(i) if i < self.resolution => index = index * self.resolution + i,
                    _ => inside = false,
                }
            }
            if inside {
                sum += product * self.grid[index];
            }
        }
        sum
    }

    pub(crate) fn check(&self) -> Result<(), FieldError> {
        let cells = self.resolution.checked_pow(3);
        if self.resolution == 0 || cells != Some(self.grid.len()) {
            return Err(FieldError::Shape {
                tensor: "empty_voxel.grid".to_owned(),
                found: vec![self.grid.len()],
                expected: format!("[{r}, {r}, {r}]", r = self.resolution),
            });
        }
        if !self.grid.iter().all(|value| value.is_finite()) {
            return Err(FieldError::NotFinite { tensor: "empty_voxel.grid".to_owned() });
        }
        let proper = (0..3).all(|axis| {
            self.xyz_max[axis].is_finite()
                && self.xyz_min[axis].is_finite()
                && self.xyz_max[axis] != self.xyz_min[axis]
        });
        if proper {
            Ok(())
        } else {
            Err(FieldError::Box { maximum: self.xyz_max, minimum: self.xyz_min })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolates_inside_and_fades_outside() {
        let mut grid = vec![0.0; 27];
        grid[9 + 3 + 1] = 8.0; // the centre of 3×3×3
        let voxel = EmptyVoxel { grid, resolution: 3, xyz_min: [0.0; 3], xyz_max: [2.0; 3] };
        assert!(voxel.check().is_ok(), "valid");
        assert_eq!(voxel.at([1.0, 1.0, 1.0]), 8.0, "on the sample");
        assert_eq!(voxel.at([1.5, 1.0, 1.0]), 4.0, "half way");
        let ones = EmptyVoxel { grid: vec![1.0; 27], ..voxel };
        assert_eq!(ones.at([2.5, 1.0, 1.0]), 0.5, "half a cell outside");
        assert_eq!(ones.at([3.5, 1.0, 1.0]), 0.0, "beyond");
        assert_eq!(ones.at([-1e30, 1.0, f32::INFINITY]), 0.0, "far away");
        assert!(!ones.at([f32::NAN; 3]).is_infinite(), "NaN does not index out of bounds");
    }
}
