//! Fully connected layers on panels, forward and backward.
//!
//! Activations are feature-major panels `[features][PANEL]`; columns are samples.
//! Loops are written so that the compiler vectorises over columns, without fused
//! operations, so that every processor computes the same bits.

/// Samples side by side.
pub(super) const PANEL: usize = 64;

/// One feature of a panel of samples.
pub(super) type Row = [f32; PANEL];

/// Position of a layer's weights (row-major `[outputs, inputs]`)
/// and bias in the vector of all parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct LayerAt {
    pub(super) first: usize,
    pub(super) inputs: usize,
    pub(super) outputs: usize,
}

impl LayerAt {
    pub(super) fn len(&self) -> usize {
        self.outputs * (self.inputs + 1)
    }

    pub(super) fn split<'a>(&self, all: &'a [f32]) -> (&'a [f32], &'a [f32]) {
        all[self.first..self.first + self.len()].split_at(self.outputs * self.inputs)
    }

    fn split_mut<'a>(&self, all: &'a mut [f32]) -> (&'a mut [f32], &'a mut [f32]) {
        all[self.first..self.first + self.len()].split_at_mut(self.outputs * self.inputs)
    }

    /// `out = W · input + b`.
    #[inline(always)]
    pub(super) fn forward(&self, params: &[f32], input: &[Row], out: &mut [Row]) {
        let (weights, bias) = self.split(params);
        for (o, out) in out[..self.outputs].iter_mut().enumerate() {
            *out = [bias[o]; PANEL];
        }
        let outputs = &mut out[..self.outputs];
        combine(input, outputs, |o, i| weights[o * self.inputs + i]);
    }

    /// Adds the gradient of weights and bias to `grads`, and that of the input to `d_input`.
    #[inline(always)]
    pub(super) fn backward(
        &self,
        params: &[f32],
        input: &[Row],
        d_out: &[Row],
        d_input: &mut [Row],
        grads: &mut [f32],
    ) {
        let (weights, _) = self.split(params);
        let (d_weights, d_bias) = self.split_mut(grads);
        let d_out = &d_out[..self.outputs];
        for (o, d_out) in d_out.iter().enumerate() {
            d_bias[o] += d_out.iter().sum::<f32>();
            let d_weights = &mut d_weights[o * self.inputs..][..self.inputs];
            for (d_weights, input) in d_weights.chunks_mut(TILE).zip(input.chunks(TILE)) {
                if let (Ok(d_weights), Ok(input)) =
                    (<&mut [f32; TILE]>::try_from(d_weights), <&[Row; TILE]>::try_from(input))
                {
                    inner(d_out, input, d_weights);
                }
            }
        }
        combine(d_out, &mut d_input[..self.inputs], |i, o| weights[o * self.inputs + i]);
    }
}

/// Rows computed together, so that their input is read once. Divides every number of inputs.
const TILE: usize = 4;
/// Columns of a tile.
const COLUMNS: usize = 32;

/// `out[o] += Σ_i weight(o, i) · input[i]`.
#[inline(always)]
fn combine(input: &[Row], out: &mut [Row], weight: impl Fn(usize, usize) -> f32) {
    for (tile, out) in out.chunks_mut(TILE).enumerate() {
        let first = tile * TILE;
        if let Ok(out) = <&mut [Row; TILE]>::try_from(&mut *out) {
            for column in (0..PANEL).step_by(COLUMNS) {
                let mut sums = [[0.0_f32; COLUMNS]; TILE];
                for (i, x) in input.iter().enumerate() {
                    let x = &x[column..column + COLUMNS];
                    for k in 0..TILE {
                        let w = weight(first + k, i);
                        for c in 0..COLUMNS {
                            sums[k][c] += w * x[c];
                        }
                    }
                }
                for k in 0..TILE {
                    let out = &mut out[k][column..column + COLUMNS];
                    for c in 0..COLUMNS {
                        out[c] += sums[k][c];
                    }
                }
            }
        } else {
            for (k, out) in out.iter_mut().enumerate() {
                for (i, x) in input.iter().enumerate() {
                    let w = weight(first + k, i);
                    for (out, x) in out.iter_mut().zip(x) {
                        *out += w * x;
                    }
                }
            }
        }
    }
}

/// Adds the inner products of `a` with each of `b`, in sixteen lanes.
#[inline(always)]
fn inner(a: &Row, b: &[Row; TILE], sums: &mut [f32; TILE]) {
    let mut lanes = [[0.0_f32; 16]; TILE];
    for at in (0..PANEL).step_by(16) {
        let a = &a[at..at + 16];
        for k in 0..TILE {
            let b = &b[k][at..at + 16];
            for c in 0..16 {
                lanes[k][c] += a[c] * b[c];
            }
        }
    }
    for k in 0..TILE {
        sums[k] += lanes[k].iter().sum::<f32>();
    }
}

/// `max(x, 0)` of whole panels.
#[inline(always)]
pub(super) fn relu(input: &[Row], out: &mut [Row]) {
    for (input, out) in input.iter().zip(out) {
        for (x, y) in input.iter().zip(out) {
            *y = x.max(0.0);
        }
    }
}

/// Zeroes `d` wherever the activation was not positive.
#[inline(always)]
pub(super) fn relu_backward(active: &[Row], d: &mut [Row]) {
    for (active, d) in active.iter().zip(d) {
        for (y, d) in active.iter().zip(d) {
            *d = if *y > 0.0 { *d } else { 0.0 };
        }
    }
}
