//! Convolutions with ReLU, and max pooling, on planes `[channels, height, width]`.

use crate::NetworkError;
use crate::weights::{Weights, matrix};
use ndarray::{Array1, Array2, Axis};
use rayon::prelude::*;

/// Output rows per task; fixed, so that results do not depend on the number of threads.
const ROWS: usize = 8;

/// Feature maps.
#[derive(Debug, Clone)]
pub(crate) struct Maps {
    pub(crate) channels: usize,
    pub(crate) height: usize,
    pub(crate) width: usize,
    /// `[channels, height, width]`.
    pub(crate) values: Vec<f32>,
}

/// `relu(W * x + b)`.
#[derive(Debug, Clone)]
pub(crate) struct Convolution {
    /// `[outputs, inputs · size²]`.
    weight: Array2<f32>,
    bias: Array1<f32>,
    inputs: usize,
    size: usize,
    stride: usize,
    padding: usize,
}

impl Convolution {
    /// From `{name}.weight` and `{name}.bias`. The kernel is `size` pixels wide.
    pub(crate) fn open(
        weights: &Weights,
        name: &str,
        [outputs, inputs, size]: [usize; 3],
        [stride, padding]: [usize; 2],
        kind: &'static str,
    ) -> Result<Self, NetworkError> {
        let shape = [outputs, inputs, size, size];
        let values = weights.values(&format!("{name}.weight"), &shape, kind)?;
        let bias = weights.vector(&format!("{name}.bias"), outputs, kind)?;
        let weight = matrix(outputs, inputs * size * size, values.to_vec());
        Ok(Self { weight, bias, inputs, size, stride, padding })
    }

    /// The image must be at least as large as the kernel.
    pub(crate) fn apply(&self, x: &Maps) -> Maps {
        let out = |side: usize| (side + 2 * self.padding - self.size) / self.stride + 1;
        let (height, width) = (out(x.height), out(x.width));
        let outputs = self.bias.len();
        let bands: Vec<(usize, Array2<f32>)> = (0..height)
            .step_by(ROWS)
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|first| {
                let rows = ROWS.min(height - first);
                let mut y = self.weight.dot(&self.patches(x, first, rows, width));
                y += &self.bias.view().insert_axis(Axis(1));
                y.mapv_inplace(|v| v.max(0.0));
                (first, y)
            })
            .collect();
        let mut values = vec![0.0; outputs * height * width];
        for (first, band) in bands {
            for (channel, line) in band.rows().into_iter().enumerate() {
                let at = (channel * height + first) * width;
                for (value, from) in values[at..].iter_mut().zip(line) {
                    *value = *from;
                }
            }
        }
        Maps { channels: outputs, height, width, values }
    }

    /// The pixels below the kernel, one column for each output pixel of `rows` rows.
    fn patches(&self, x: &Maps, first: usize, rows: usize, width: usize) -> Array2<f32> {
        let mut patches = Vec::with_capacity(self.inputs * self.size * self.size * rows * width);
        let inside = |at: usize, side: usize| at.checked_sub(self.padding).filter(|&at| at < side);
        for channel in 0..self.inputs {
            for ky in 0..self.size {
                for kx in 0..self.size {
                    for row in first..first + rows {
                        let y = inside(row * self.stride + ky, x.height);
                        for column in 0..width {
                            let x_at = inside(column * self.stride + kx, x.width);
                            patches.push(y.zip(x_at).map_or(0.0, |(y, x_at)| {
                                x.values[(channel * x.height + y) * x.width + x_at]
                            }));
                        }
                    }
                }
            }
        }
        matrix(self.inputs * self.size * self.size, rows * width, patches)
    }
}

/// The largest value of each window of `size` × `size`.
pub(crate) fn max_pool(x: &Maps, size: usize, stride: usize) -> Maps {
    let out = |side: usize| (side - size) / stride + 1;
    let (height, width) = (out(x.height), out(x.width));
    let mut values = Vec::with_capacity(x.channels * height * width);
    for plane in x.values.chunks_exact(x.height * x.width) {
        for row in 0..height {
            for column in 0..width {
                let mut most = f32::NEG_INFINITY;
                for y in row * stride..row * stride + size {
                    let at = y * x.width + column * stride;
                    most = plane[at..at + size].iter().fold(most, |a, &b| a.max(b));
                }
                values.push(most);
            }
        }
    }
    Maps { channels: x.channels, height, width, values }
}
