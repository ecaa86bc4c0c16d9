//! The pre-norm transformer that CLIP's towers and DINO share:
//! `x ← x + Attention(LN(x))`, `x ← x + MLP(LN(x))`.

use crate::NetworkError;
use crate::weights::Weights;
use ndarray::{Array1, Array2, ArrayView2, Axis, Slice};
use rayon::prelude::*;

/// Tokens per task of a layer; fixed, so that results do not depend on the number of threads.
const TOKENS: usize = 64;
/// Width of a head in all published sizes of these networks.
const HEAD: usize = 64;

/// `y = W x + b` of each row of `x`.
#[derive(Debug, Clone)]
pub(crate) struct Linear {
    /// `[outputs, inputs]`.
    weight: Array2<f32>,
    bias: Array1<f32>,
}

impl Linear {
    pub(crate) fn new(weight: Array2<f32>, bias: Array1<f32>) -> Self {
        Self { weight, bias }
    }

    /// From `{name}.weight` and `{name}.bias`.
    fn open(
        weights: &Weights,
        name: &str,
        size: [usize; 2],
        kind: &'static str,
    ) -> Result<Self, NetworkError> {
        Ok(Self {
            weight: weights.matrix(&format!("{name}.weight"), size, kind)?,
            bias: weights.vector(&format!("{name}.bias"), size[0], kind)?,
        })
    }

    /// `x` is `[N, inputs]`, the result `[N, outputs]`.
    pub(crate) fn apply(&self, x: &Array2<f32>) -> Array2<f32> {
        let mut y = Array2::zeros((x.nrows(), self.bias.len()));
        y.axis_chunks_iter_mut(Axis(0), TOKENS)
            .zip(x.axis_chunks_iter(Axis(0), TOKENS))
            .collect::<Vec<_>>()
            .into_par_iter()
            .for_each(|(mut y, x)| {
                y += &self.bias;
                ndarray::linalg::general_mat_mul(1.0, &x, &self.weight.t(), 1.0, &mut y);
            });
        y
    }
}

/// Layer normalisation with scale and shift.
#[derive(Debug, Clone)]
pub(crate) struct LayerNorm {
    weight: Array1<f32>,
    bias: Array1<f32>,
    epsilon: f32,
}

impl LayerNorm {
    pub(crate) fn open(
        weights: &Weights,
        name: &str,
        width: usize,
        epsilon: f32,
        kind: &'static str,
    ) -> Result<Self, NetworkError> {
        Ok(Self {
            weight: weights.vector(&format!("{name}.weight"), width, kind)?,
            bias: weights.vector(&format!("{name}.bias"), width, kind)?,
            epsilon,
        })
    }

    pub(crate) fn apply(&self, x: &Array2<f32>) -> Array2<f32> {
        let mut y = x.clone();
        for mut row in y.rows_mut() {
            let len = row.len() as f32;
            let mean = row.sum() / len;
            row -= mean;
            let variance = row.iter().map(|v| v * v).sum::<f32>() / len;
            row /= (variance + self.epsilon).sqrt();
            row *= &self.weight;
            row += &self.bias;
        }
        y
    }
}

/// Activation of the MLPs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Gelu {
    /// `x Φ(x)`, of DINO.
    Exact,
    /// `x sigmoid(1.702 x)`, of OpenAI's CLIP.
    Quick,
}

impl Gelu {
    fn apply(self, x: f32) -> f32 {
        match self {
            Self::Exact => 0.5 * x * (1.0 + libm::erff(x * std::f32::consts::FRAC_1_SQRT_2)),
            Self::Quick => x / (1.0 + (-1.702 * x).exp()),
        }
    }
}

/// Names of a layer's tensors.
pub(crate) struct LayerNames {
    pub(crate) norms: [String; 2],
    /// Queries, keys and values, in one tensor or in three.
    pub(crate) qkv: Vec<String>,
    pub(crate) out: String,
    pub(crate) mlp: [String; 2],
}

#[derive(Debug, Clone)]
struct Layer {
    norms: [LayerNorm; 2],
    qkv: Vec<Linear>,
    out: Linear,
    mlp: [Linear; 2],
}

/// A stack of layers.
#[derive(Debug, Clone)]
pub(crate) struct Transformer {
    layers: Vec<Layer>,
    heads: usize,
    gelu: Gelu,
    /// Whether a token attends to itself and earlier ones only.
    causal: bool,
}

impl Transformer {
    pub(crate) fn open(
        weights: &Weights,
        layers: &[LayerNames],
        (width, epsilon): (usize, f32),
        (gelu, causal): (Gelu, bool),
        kind: &'static str,
    ) -> Result<Self, NetworkError> {
        let norm = |name: &String| LayerNorm::open(weights, name, width, epsilon, kind);
        let linear = |name: &String, size| Linear::open(weights, name, size, kind);
        let layer = |names: &LayerNames| {
            let hidden = weights.shape(&format!("{}.weight", names.mlp[0])).first().copied();
            let hidden = hidden.unwrap_or_default();
            let parts = names.qkv.len();
            Ok(Layer {
                norms: [norm(&names.norms[0])?, norm(&names.norms[1])?],
                qkv: names
                    .qkv
                    .iter()
                    .map(|name| linear(name, [3 * width / parts, width]))
                    .collect::<Result<_, _>>()?,
                out: linear(&names.out, [width, width])?,
                mlp: [
                    linear(&names.mlp[0], [hidden, width])?,
                    linear(&names.mlp[1], [width, hidden])?,
                ],
            })
        };
        let layers = layers.iter().map(layer).collect::<Result<_, _>>()?;
        Ok(Self { layers, heads: (width / HEAD).max(1), gelu, causal })
    }

    /// `x` is `[tokens, width]`.
    pub(crate) fn apply(&self, mut x: Array2<f32>) -> Array2<f32> {
        for layer in &self.layers {
            let normed = layer.norms[0].apply(&x);
            let qkv: Vec<Array2<f32>> = layer.qkv.iter().map(|part| part.apply(&normed)).collect();
            x += &layer.out.apply(&self.attend(&qkv));
            let mut hidden = layer.mlp[0].apply(&layer.norms[1].apply(&x));
            if let Some(values) = hidden.as_slice_mut() {
                values.par_iter_mut().for_each(|v| *v = self.gelu.apply(*v));
            }
            x += &layer.mlp[1].apply(&hidden);
        }
        x
    }

    /// Softmax attention of all heads, `[tokens, width]`.
    fn attend(&self, qkv: &[Array2<f32>]) -> Array2<f32> {
        let width = qkv.iter().map(Array2::ncols).sum::<usize>() / 3;
        let size = width / self.heads;
        // Part 0, 1, 2 of head `h`, in one array or in three.
        let of = |part: usize, h: usize| -> ArrayView2<'_, f32> {
            let (array, first) = match qkv {
                [all] => (all, part * width + h * size),
                parts => (&parts[part], h * size),
            };
            array.slice_axis(Axis(1), Slice::from(first..first + size))
        };
        let heads: Vec<Array2<f32>> = (0..self.heads)
            .into_par_iter()
            .map(|h| {
                let mut scores = of(0, h).dot(&of(1, h).t());
                let scale = 1.0 / (size as f32).sqrt();
                for (token, mut row) in scores.rows_mut().into_iter().enumerate() {
                    let seen = if self.causal { token + 1 } else { row.len() };
                    let (mut row, mut later) = row.view_mut().split_at(Axis(0), seen);
                    later.fill(0.0);
                    let most = row.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
                    row.mapv_inplace(|v| (scale * (v - most)).exp());
                    let total = row.sum();
                    row /= total;
                }
                scores.dot(&of(2, h))
            })
            .collect();
        let mut out = Array2::zeros((qkv[0].nrows(), width));
        for (h, head) in heads.iter().enumerate() {
            let columns = Slice::from(h * size..(h + 1) * size);
            out.slice_axis_mut(Axis(1), columns).assign(head);
        }
        out
    }
}
