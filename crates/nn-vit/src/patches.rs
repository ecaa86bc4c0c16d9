//! Patch embedding of vision transformers.

use crate::NetworkError;
use crate::preprocess::Planes;
use crate::transformer::Linear;
use crate::weights::{Weights, matrix};
use ndarray::{Array1, Array2};

/// A convolution whose stride is its size: one token per patch, in rows.
#[derive(Debug, Clone)]
pub(crate) struct Patches {
    linear: Linear,
    /// Side of a patch, pixels.
    pub(crate) size: usize,
}

impl Patches {
    /// `name` is that of the weight `[width, 3, size, size]`; `bias` that of the bias, if there is
    /// one.
    pub(crate) fn open(
        weights: &Weights,
        name: &str,
        bias: Option<&str>,
        width: usize,
        kind: &'static str,
    ) -> Result<Self, NetworkError> {
        let values = weights.values(name, &[width, 3, 0, 0], kind)?;
        let size = weights.shape(name)[2];
        weights.values(name, &[width, 3, size, size], kind)?;
        let bias = match bias {
            Some(bias) => weights.vector(bias, width, kind)?,
            None => Array1::zeros(width),
        };
        let weight = matrix(width, 3 * size * size, values.to_vec());
        Ok(Self { linear: Linear::new(weight, bias), size })
    }

    /// Rows and columns of patches; pixels beyond the last whole patch are not used.
    pub(crate) fn grid(&self, image: &Planes) -> [usize; 2] {
        [image.height / self.size, image.width / self.size]
    }

    /// `[patches, width]`.
    pub(crate) fn apply(&self, image: &Planes) -> Array2<f32> {
        let [rows, columns] = self.grid(image);
        let mut pixels = Vec::with_capacity(rows * columns * 3 * self.size * self.size);
        for row in 0..rows {
            for column in 0..columns {
                for channel in 0..3 {
                    for y in 0..self.size {
                        let at = image.index(channel, row * self.size + y, column * self.size);
                        pixels.extend_from_slice(&image.values[at..at + self.size]);
                    }
                }
            }
        }
        self.linear.apply(&matrix(rows * columns, 3 * self.size * self.size, pixels))
    }
}
