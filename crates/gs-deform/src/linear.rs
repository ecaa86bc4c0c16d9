//! Fully connected layers on panels of Gaussians.
//!
//! Activations are feature-major panels `[features, PANEL]`: vector lanes are Gaussians, so a head
//! with three outputs is as efficient as a square layer, and bias, ReLU and the next layer touch
//! memory that is still in the first-level cache.

use crate::FieldError;
use pulp::{Simd, bytemuck};

/// Gaussians per panel: three AVX-512 vectors, six AVX2 vectors, twelve Neon vectors.
pub(crate) const PANEL: usize = 48;
/// Outputs whose weights are interleaved in memory.
const TILE: usize = 8;

/// A fully connected layer `y = W·x + b`.
#[derive(Debug, Clone, PartialEq)]
pub struct Linear {
    /// `W`, row-major `[outputs, inputs]`.
    pub weight: Vec<f32>,
    /// `b`, `[outputs]`; its length is the number of outputs.
    pub bias: Vec<f32>,
}

impl Linear {
    /// Number of outputs.
    pub fn num_outputs(&self) -> usize {
        self.bias.len()
    }

    /// Number of inputs; 0 for a layer without outputs.
    pub fn num_inputs(&self) -> usize {
        self.weight.len().checked_div(self.bias.len()).unwrap_or(0)
    }

    /// Verifies shape and values.
    pub(crate) fn check(
        &self,
        name: &str,
        inputs: usize,
        outputs: Option<usize>,
    ) -> Result<(), FieldError> {
        let rows = outputs.unwrap_or(self.bias.len());
        if rows == 0 || self.bias.len() != rows || self.weight.len() != rows * inputs {
            return Err(FieldError::Shape {
                tensor: name.to_owned(),
                found: vec![self.bias.len(), self.num_inputs()],
                expected: format!("[{rows}, {inputs}]"),
            });
        }
        if !self.weight.iter().chain(&self.bias).all(|value| value.is_finite()) {
            return Err(FieldError::NotFinite { tensor: name.to_owned() });
        }
        Ok(())
    }
}

/// Activation after a layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Activation {
    None,
    Relu,
}

/// A layer whose weights are stored in the order in which the kernel reads them.
#[derive(Debug, Clone)]
pub(crate) struct Packed {
    inputs: usize,
    outputs: usize,
    /// `[⌈outputs / TILE⌉][inputs][TILE]`, zero where there is no output.
    weights: Vec<[f32; TILE]>,
    bias: Vec<[f32; TILE]>,
}

impl Packed {
    pub(crate) fn new(layer: &Linear) -> Self {
        let (inputs, outputs) = (layer.num_inputs(), layer.num_outputs());
        let tiles = outputs.div_ceil(TILE);
        let mut weights = vec![[0.0; TILE]; tiles * inputs];
        let mut bias = vec![[0.0; TILE]; tiles];
        for o in 0..outputs {
            let (tile, lane) = (o / TILE, o % TILE);
            bias[tile][lane] = layer.bias[o];
            for i in 0..inputs {
                weights[tile * inputs + i][lane] = layer.weight[o * inputs + i];
            }
        }
        Self { inputs, outputs, weights, bias }
    }

    /// Number of inputs.
    pub(crate) fn num_inputs(&self) -> usize {
        self.inputs
    }

    /// Floats of an output panel: outputs are padded to whole tiles.
    pub(crate) fn panel_len(&self) -> usize {
        self.bias.len() * TILE * PANEL
    }

    /// `output = activation(W · input + b)`; `input` `[inputs, PANEL]`, `output` at least
    /// [`Packed::panel_len`].
    #[inline(always)]
    pub(crate) fn apply<S: Simd>(
        &self,
        simd: S,
        input: &[f32],
        output: &mut [f32],
        activation: Activation,
    ) {
        let input = &input[..self.inputs * PANEL];
        let rows = output.chunks_exact_mut(TILE * PANEL);
        let tiles = self.weights.chunks_exact(self.inputs).zip(&self.bias);
        for (index, ((weights, bias), out)) in tiles.zip(rows).enumerate() {
            let used = self.outputs - index * TILE;
            match Block::of(S::F32_LANES, S::REGISTER_COUNT) {
                Block::Large if used > 4 => {
                    tile::<S, 8, 3>(simd, input, weights, bias, 0, out, activation);
                }
                Block::Large => tile::<S, 4, 3>(simd, input, weights, bias, 0, out, activation),
                Block::Small => {
                    tile::<S, 4, 2>(simd, input, weights, bias, 0, out, activation);
                    if used > 4 {
                        tile::<S, 4, 2>(simd, input, weights, bias, 4, out, activation);
                    }
                }
            }
        }
    }
}

/// Accumulators of the kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Block {
    /// 8 outputs × 3 vectors; needs 32 registers.
    Large,
    /// 4 × 2, which leave room for the operands in 16 registers; 4 × 3 would spill.
    Small,
}

impl Block {
    /// The larger block that fits the registers, and whose vectors fill a panel.
    const fn of(lanes: usize, registers: usize) -> Self {
        if registers < 32 && PANEL.is_multiple_of(Self::Small.vectors() * lanes) {
            Self::Small
        } else {
            Self::Large
        }
    }

    const fn vectors(self) -> usize {
        match self {
            Self::Large => 3,
            Self::Small => 2,
        }
    }
}

/// `ROWS` outputs, starting at `first` within the tile, for the whole panel, `VECTORS` vectors of
/// Gaussians at a time.
#[inline(always)]
fn tile<S: Simd, const ROWS: usize, const VECTORS: usize>(
    simd: S,
    input: &[f32],
    weights: &[[f32; TILE]],
    bias: &[f32; TILE],
    first: usize,
    out: &mut [f32],
    activation: Activation,
) {
    let width = VECTORS * S::F32_LANES;
    let mut column = 0;
    while column < PANEL {
        let mut sums = [[simd.splat_f32s(0.0); VECTORS]; ROWS];
        for row in 0..ROWS {
            sums[row] = [simd.splat_f32s(bias[first + row]); VECTORS];
        }
        for (features, w) in input.chunks_exact(PANEL).zip(weights) {
            let features = &features[column..column + width];
            let mut x = [simd.splat_f32s(0.0); VECTORS];
            for v in 0..VECTORS {
                x[v] = load::<S>(&features[v * S::F32_LANES..(v + 1) * S::F32_LANES]);
            }
            for row in 0..ROWS {
                let weight = simd.splat_f32s(w[first + row]);
                for v in 0..VECTORS {
                    sums[row][v] = simd.mul_add_e_f32s(weight, x[v], sums[row][v]);
                }
            }
        }
        for row in 0..ROWS {
            let target = &mut out[(first + row) * PANEL + column..][..width];
            for v in 0..VECTORS {
                let value = match activation {
                    Activation::None => sums[row][v],
                    Activation::Relu => simd.max_f32s(sums[row][v], simd.splat_f32s(0.0)),
                };
                target[v * S::F32_LANES..(v + 1) * S::F32_LANES]
                    .copy_from_slice(bytemuck::cast_slice(bytemuck::bytes_of(&value)));
            }
        }
        column += width;
    }
}

#[inline(always)]
fn load<S: Simd>(values: &[f32]) -> S::f32s {
    bytemuck::pod_read_unaligned(bytemuck::cast_slice(values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::{Arch, WithSimd};
    use rand::{RngExt, SeedableRng};

    struct Apply<'a>(&'a Packed, &'a [f32], &'a mut [f32], Activation);
    impl WithSimd for Apply<'_> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            self.0.apply(simd, self.1, self.2, self.3);
        }
    }

    /// The vector units of this machine, and none.
    fn arches() -> Vec<Arch> {
        let mut arches = vec![Arch::new(), Arch::Scalar];
        #[cfg(target_arch = "x86_64")]
        arches.extend(pulp::x86::V3::try_new().map(Arch::V3));
        arches
    }

    /// For widths that this machine may not have.
    #[test]
    fn blocks_fill_a_panel_for_every_vector_width() {
        for lanes in [1, 2, 4, 8, 16] {
            for registers in [16, 32] {
                let block = Block::of(lanes, registers);
                assert_eq!(PANEL % (block.vectors() * lanes), 0, "{lanes} lanes, {block:?}");
            }
        }
        assert_eq!(Block::of(16, 32), Block::Large, "AVX-512");
        assert_eq!(Block::of(8, 16), Block::Small, "AVX2");
    }

    #[test]
    fn agrees_with_the_definition_at_awkward_sizes() {
        let mut rng = rand_pcg::Pcg64::seed_from_u64(3);
        for (inputs, outputs) in [(1, 1), (7, 3), (16, 4), (5, 12), (33, 48), (64, 65)] {
            let layer = Linear {
                weight: (0..inputs * outputs).map(|_| rng.random_range(-1.0..1.0)).collect(),
                bias: (0..outputs).map(|_| rng.random_range(-1.0..1.0)).collect(),
            };
            let input: Vec<f32> =
                (0..inputs * PANEL).map(|_| rng.random_range(-1.0..1.0)).collect();
            let packed = Packed::new(&layer);
            for relu in [Activation::None, Activation::Relu] {
                for simd in arches() {
                    let mut output = vec![f32::NAN; packed.panel_len()];
                    simd.dispatch(Apply(&packed, &input, &mut output, relu));
                    for o in 0..outputs {
                        for p in 0..PANEL {
                            let mut expected = f64::from(layer.bias[o]);
                            for i in 0..inputs {
                                expected += f64::from(layer.weight[o * inputs + i])
                                    * f64::from(input[i * PANEL + p]);
                            }
                            if relu == Activation::Relu {
                                expected = expected.max(0.0);
                            }
                            let found = f64::from(output[o * PANEL + p]);
                            assert!(
                                (found - expected).abs() < 1e-5,
                                "{inputs}→{outputs}, output {o}, column {p}: {found} {expected}"
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn wrong_shapes_and_values_are_refused() {
        let layer = Linear { weight: vec![0.0; 6], bias: vec![0.0; 2] };
        assert!(layer.check("w", 3, Some(2)).is_ok(), "fits");
        assert!(layer.check("w", 3, Some(3)).is_err(), "outputs");
        assert!(layer.check("w", 2, None).is_err(), "inputs");
        let nan = Linear { weight: vec![f32::NAN], bias: vec![0.0] };
        assert!(matches!(nan.check("w", 1, None), Err(FieldError::NotFinite { .. })), "NaN");
    }
}
