//! [`ColorChange`]: an affine change of colours, applicable to other splats.

use gs_core::symmetric_eigen as eigen;

/// Variance of colours, per channel, below which texture is too weak to determine the matrix:
/// 0.03².
const RIDGE: f64 = 1e-3;

/// `c ↦ A c + b` of colours (red, green, blue; 0 to 1), and a factor on the other harmonics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColorChange {
    /// `A`, row-major, no unit.
    pub matrix: [[f32; 3]; 3],
    /// `b`, unit of colours (0 to 1).
    pub offset: [f32; 3],
    /// Factor on the harmonics of degree 1 and above.
    pub harmonics: f32,
}

impl ColorChange {
    /// The identity.
    pub const NONE: Self = Self {
        matrix: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        offset: [0.0; 3],
        harmonics: 1.0,
    };

    /// `A c + b` for a colour `c`.
    pub fn apply(&self, color: [f32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|i| {
            let row = &self.matrix[i];
            self.offset[i] + (0..3).map(|j| row[j] * color[j]).sum::<f32>()
        })
    }

    /// A share of the change, 0 to 1.
    #[must_use]
    pub(crate) fn share(&self, share: f32) -> Self {
        let mix = |from: f32, to: f32| from + share * (to - from);
        Self {
            matrix: std::array::from_fn(|i| {
                std::array::from_fn(|j| mix(Self::NONE.matrix[i][j], self.matrix[i][j]))
            }),
            offset: self.offset.map(|b| share * b),
            harmonics: mix(1.0, self.harmonics),
        }
    }

    /// Whether all values are finite.
    pub(crate) fn is_finite(&self) -> bool {
        let values = self.matrix.iter().flatten().chain(&self.offset).chain([&self.harmonics]);
        values.into_iter().all(|value| value.is_finite())
    }
}

/// Weighted sums over pairs of colours before and after the edit.
#[derive(Debug, Clone, Default)]
pub(crate) struct ColorPairs {
    weight: f64,
    from: [f64; 3],
    to: [f64; 3],
    squares: [[f64; 3]; 3],
    /// Σ w to_i from_j.
    products: [[f64; 3]; 3],
    /// Sums over the harmonics: Σ w old·new, Σ w old².
    harmonics: (f64, f64),
}

impl ColorPairs {
    pub(crate) fn add(&mut self, weight: f64, from: [f64; 3], to: [f64; 3]) {
        self.weight += weight;
        for i in 0..3 {
            self.from[i] += weight * from[i];
            self.to[i] += weight * to[i];
            for j in 0..3 {
                self.squares[i][j] += weight * from[i] * from[j];
                self.products[i][j] += weight * to[i] * from[j];
            }
        }
    }

    pub(crate) fn add_harmonics(&mut self, weight: f64, from: &[[f32; 3]], to: &[[f32; 3]]) {
        for (from, to) in from.iter().flatten().zip(to.iter().flatten()) {
            self.harmonics.0 += weight * f64::from(*from) * f64::from(*to);
            self.harmonics.1 += weight * f64::from(*from) * f64::from(*from);
        }
    }

    /// The change that maps the mean exactly; the matrix is a ridge regression towards that of
    /// `like`.
    pub(crate) fn change(&self, like: &ColorChange) -> ColorChange {
        if self.weight <= 0.0 {
            return *like;
        }
        let mean = |sum: [f64; 3]| sum.map(|v| v / self.weight);
        let (from, to) = (mean(self.from), mean(self.to));
        let prior = like.matrix.map(|row| row.map(f64::from));
        let mut spread = [[0.0; 3]; 3];
        let mut missed = [[0.0; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                spread[i][j] = self.squares[i][j] / self.weight - from[i] * from[j];
                missed[i][j] = self.products[i][j] / self.weight - to[i] * from[j];
            }
        }
        let explained: [[f64; 3]; 3] = std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..3).map(|k| prior[i][k] * spread[k][j]).sum())
        });
        // (missed − prior·spread)·(spread + ridge)⁻¹, in the axes of the spread.
        let (values, axes) = eigen(spread);
        let mut matrix = prior;
        for (value, axis) in values.iter().zip(axes_of(axes)) {
            let gain = 1.0 / (value.max(0.0) + RIDGE);
            for i in 0..3 {
                let along: f64 = (0..3).map(|k| (missed[i][k] - explained[i][k]) * axis[k]).sum();
                for j in 0..3 {
                    matrix[i][j] += gain * along * axis[j];
                }
            }
        }
        let offset = [0, 1, 2].map(|i| to[i] - (0..3).map(|j| matrix[i][j] * from[j]).sum::<f64>());
        let harmonics = if self.harmonics.1 > 0.0 {
            self.harmonics.0 / self.harmonics.1
        } else {
            f64::from(like.harmonics)
        };
        let narrow = gs_core::Real::as_f32;
        ColorChange {
            matrix: matrix.map(|row| row.map(narrow)),
            offset: offset.map(narrow),
            harmonics: narrow(harmonics),
        }
    }
}

/// Columns of the matrix of eigenvectors.
fn axes_of(vectors: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|column| std::array::from_fn(|row| vectors[row][column]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MATRIX: [[f64; 3]; 3] = [[0.1, 0.8, 0.0], [0.0, 0.2, 0.6], [0.7, 0.0, 0.2]];
    const SHIFT: [f64; 3] = [0.05, 0.1, -0.02];

    fn changed(c: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| SHIFT[i] + (0..3).map(|j| MATRIX[i][j] * c[j]).sum::<f64>())
    }

    /// Colours of a texture with this contrast.
    fn pairs(contrast: f64) -> ColorPairs {
        let mut pairs = ColorPairs::default();
        for i in 0..60 {
            let wave = |k: f64| 0.5 + contrast * (k * f64::from(i)).sin();
            let color = [wave(0.7), wave(1.3), wave(2.9)];
            pairs.add(1.0, color, changed(color));
        }
        pairs
    }

    fn miss(change: &ColorChange, color: [f64; 3]) -> f64 {
        let (found, expected) = (change.apply(color.map(gs_core::Real::as_f32)), changed(color));
        (0..3).map(|i| (f64::from(found[i]) - expected[i]).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn changes_are_estimated_from_texture() {
        let found = pairs(0.4).change(&ColorChange::NONE);
        assert!(miss(&found, [0.2, 0.7, 0.4]) < 0.01, "{found:?}");
        // Without texture only the mean is determined; the rest equals the given prior, here the
        // identity.
        let flat = pairs(0.001);
        let (mean, other) = ([0.5; 3], [0.2, 0.7, 0.4]);
        let found = flat.change(&ColorChange::NONE);
        assert!(miss(&found, mean) < 1e-3 && miss(&found, other) > 0.1, "{found:?}");
        let with_prior = flat.change(&pairs(0.4).change(&ColorChange::NONE));
        assert!(miss(&with_prior, other) < 0.01, "{with_prior:?}");
    }

    #[test]
    fn a_share_of_a_change_is_an_interpolation() {
        let change = pairs(0.4).change(&ColorChange::NONE);
        assert_eq!(change.share(0.0), ColorChange::NONE, "none");
        let color = [0.3, 0.5, 0.6];
        let half = change.share(0.5).apply(color);
        for (i, half) in half.into_iter().enumerate() {
            let middle = f32::midpoint(color[i], change.apply(color)[i]);
            assert!((half - middle).abs() < 1e-6, "{half} {middle}");
        }
    }
}
