//! The network during training: one vector of parameters, forward and backward passes.

use super::layer::{LayerAt, PANEL, Row, relu, relu_backward};
use super::params::FitParams;
use super::samples::Samples;
use crate::math::{floor_index, normal, uniform};
use gs_deform::{Head, Heads, HexPlane, HexPlaneNetwork, Linear, Mask, PLANE_AXES, Plane};
use rand_pcg::Pcg64;

/// Features per plane, and levels of resolution.
pub(super) const CHANNELS: usize = 16;
const LEVELS: usize = 2;
const FEATURES: usize = CHANNELS * LEVELS;
/// Width of trunk and heads.
const WIDTH: usize = 64;
/// Outputs: centres, then quaternions.
pub(super) const OUTPUTS: [usize; 2] = [3, 4];

#[derive(Debug, Clone, Copy)]
struct PlaneAt {
    first: usize,
    columns: usize,
    rows: usize,
}

/// Layout of the vector of parameters.
#[derive(Debug, Clone)]
pub(super) struct ParameterLayout {
    planes: [[PlaneAt; 6]; LEVELS],
    trunk: LayerAt,
    heads: [[LayerAt; 2]; 2],
    /// Parameters of the planes come first.
    pub(super) plane_params: usize,
    pub(super) len: usize,
}

/// Two neighbouring texels along an axis.
#[derive(Debug, Clone, Copy)]
struct Tap {
    low: usize,
    high: usize,
    w_high: f32,
}

impl Tap {
    /// Corner-aligned and clamped, as in [`HexPlane`].
    #[inline(always)]
    fn new(u: f32, resolution: usize) -> Self {
        let last = resolution - 1;
        let position = ((u + 1.0) * 0.5 * last as f32).clamp(0.0, last as f32);
        let low = floor_index(position);
        Self { low, high: (low + 1).min(last), w_high: position - low as f32 }
    }
}

impl PlaneAt {
    /// First parameters of the four texels around `(u, v)`, and their weights.
    #[inline(always)]
    fn taps(&self, u: f32, v: f32) -> [(usize, f32); 4] {
        let (i, j) = (Tap::new(u, self.columns), Tap::new(v, self.rows));
        let at = |row: usize, column: usize| self.first + (row * self.columns + column) * CHANNELS;
        let (a, b) = (1.0 - i.w_high, 1.0 - j.w_high);
        [
            (at(j.low, i.low), a * b),
            (at(j.low, i.high), i.w_high * b),
            (at(j.high, i.low), a * j.w_high),
            (at(j.high, i.high), i.w_high * j.w_high),
        ]
    }
}

impl ParameterLayout {
    pub(super) fn new(params: &FitParams) -> Self {
        let mut len = 0;
        let planes = [1, 2].map(|scale| {
            PLANE_AXES.map(|(_, second)| {
                let columns = params.resolution * scale;
                let rows = if second == 3 { params.time_resolution } else { columns };
                let first = len;
                len += rows * columns * CHANNELS;
                PlaneAt { first, columns, rows }
            })
        });
        let plane_params = len;
        let mut layer = |inputs, outputs| {
            let at = LayerAt { first: len, inputs, outputs };
            len += at.len();
            at
        };
        let trunk = layer(FEATURES, WIDTH);
        let heads = OUTPUTS.map(|outputs| [layer(WIDTH, WIDTH), layer(WIDTH, outputs)]);
        Self { planes, trunk, heads, plane_params, len }
    }

    /// Initialisation as in the reference: spatial planes uniform in 0.1–0.5, time planes 1, Glorot
    /// for layers. The last layers are small, so that training starts with little motion.
    pub(super) fn initial(&self, rng: &mut Pcg64) -> Vec<f32> {
        let mut params = vec![0.0; self.len];
        for plane in self.planes.iter().flatten().zip(PLANE_AXES.iter().cycle()) {
            let (plane, (_, second)) = plane;
            let texels = plane.rows * plane.columns * CHANNELS;
            for value in &mut params[plane.first..plane.first + texels] {
                *value = if *second == 3 { 1.0 } else { uniform(rng, 0.1, 0.5) };
            }
        }
        let layers = std::iter::once(&self.trunk).chain(self.heads.iter().flatten());
        for layer in layers {
            let last = layer.outputs != WIDTH;
            let spread = (2.0 / (layer.inputs + layer.outputs) as f32).sqrt();
            let spread = if last { 0.1 * spread } else { spread };
            for value in &mut params[layer.first..layer.first + layer.outputs * layer.inputs] {
                *value = spread * normal(rng);
            }
        }
        params
    }

    /// The trained network with the box of its planes.
    pub(super) fn network(&self, params: &[f32], aabb: [[f32; 3]; 2]) -> HexPlaneNetwork {
        let linear = |at: &LayerAt| {
            let (weight, bias) = at.split(params);
            Linear { weight: weight.to_vec(), bias: bias.to_vec() }
        };
        let head = |at: &[LayerAt; 2]| Some(Head { hidden: linear(&at[0]), out: linear(&at[1]) });
        let plane = |at: &PlaneAt| {
            let texels = at.rows * at.columns * CHANNELS;
            let texels = params[at.first..at.first + texels].to_vec();
            Plane { columns: at.columns, rows: at.rows, texels }
        };
        HexPlaneNetwork {
            planes: HexPlane {
                aabb,
                channels: CHANNELS,
                levels: self.planes.iter().map(|level| level.each_ref().map(plane)).collect(),
            },
            trunk: vec![linear(&self.trunk)],
            heads: Heads {
                means: head(&self.heads[0]),
                quats: head(&self.heads[1]),
                ..Heads::default()
            },
            mask: Mask::One,
            grid_pe: 0,
            apply_rotation: false,
        }
    }
}

/// Working memory of one panel.
#[derive(Debug, Clone)]
pub(super) struct Scratch {
    /// Values of the planes, `[PANEL][LEVELS][6][CHANNELS]`.
    values: Vec<[[[f32; CHANNELS]; 6]; LEVELS]>,
    features: Vec<Row>,
    trunk: Vec<Row>,
    active: Vec<Row>,
    hidden: [Vec<Row>; 2],
    out: [Vec<Row>; 2],
    d_features: Vec<Row>,
    d_trunk: Vec<Row>,
    d_hidden: Vec<Row>,
}

impl Default for Scratch {
    fn default() -> Self {
        let rows = |count: usize| vec![[0.0; PANEL]; count];
        Self {
            values: vec![[[[0.0; CHANNELS]; 6]; LEVELS]; PANEL],
            features: rows(FEATURES),
            trunk: rows(WIDTH),
            active: rows(WIDTH),
            hidden: [rows(WIDTH), rows(WIDTH)],
            out: OUTPUTS.map(rows),
            d_features: rows(FEATURES),
            d_trunk: rows(WIDTH),
            d_hidden: rows(WIDTH),
        }
    }
}

impl ParameterLayout {
    #[inline(always)]
    fn forward(&self, params: &[f32], coords: &[[f32; 4]; PANEL], scratch: &mut Scratch) {
        for (s, (coords, values)) in coords.iter().zip(&mut scratch.values).enumerate() {
            for (level, (planes, values)) in self.planes.iter().zip(values).enumerate() {
                let mut product = [1.0_f32; CHANNELS];
                for ((plane, (first, second)), value) in
                    planes.iter().zip(PLANE_AXES).zip(values.iter_mut())
                {
                    *value = [0.0; CHANNELS];
                    for (at, weight) in plane.taps(coords[first], coords[second]) {
                        for (value, texel) in value.iter_mut().zip(&params[at..at + CHANNELS]) {
                            *value += weight * texel;
                        }
                    }
                    for (product, value) in product.iter_mut().zip(value) {
                        *product *= *value;
                    }
                }
                for (c, product) in product.into_iter().enumerate() {
                    scratch.features[level * CHANNELS + c][s] = product;
                }
            }
        }
        self.trunk.forward(params, &scratch.features, &mut scratch.trunk);
        relu(&scratch.trunk, &mut scratch.active);
        for (h, [hidden, out]) in self.heads.iter().enumerate() {
            hidden.forward(params, &scratch.active, &mut scratch.d_hidden);
            relu(&scratch.d_hidden, &mut scratch.hidden[h]);
            out.forward(params, &scratch.hidden[h], &mut scratch.out[h]);
        }
    }

    /// Adds the gradient of the loss over the panel's samples to `grads`; returns the summed loss.
    #[inline(always)]
    pub(super) fn backward(
        &self,
        params: &[f32],
        samples: &Samples<'_>,
        picks: &[(u32, u32); PANEL],
        scratch: &mut Scratch,
        grads: &mut [f32],
    ) -> f32 {
        let coords = picks.map(|pick| samples.coords(pick));
        self.forward(params, &coords, scratch);
        let loss = samples.residuals(picks, &mut scratch.out);
        for row in scratch.d_trunk.iter_mut().chain(&mut scratch.d_features) {
            *row = [0.0; PANEL];
        }
        for (h, [hidden, out]) in self.heads.iter().enumerate() {
            for row in &mut scratch.d_hidden {
                *row = [0.0; PANEL];
            }
            let d_out = &scratch.out[h];
            out.backward(params, &scratch.hidden[h], d_out, &mut scratch.d_hidden, grads);
            relu_backward(&scratch.hidden[h], &mut scratch.d_hidden);
            let (d_hidden, d_trunk) = (&scratch.d_hidden, &mut scratch.d_trunk);
            hidden.backward(params, &scratch.active, d_hidden, d_trunk, grads);
        }
        relu_backward(&scratch.active, &mut scratch.d_trunk);
        let d_features = &mut scratch.d_features;
        self.trunk.backward(params, &scratch.features, &scratch.d_trunk, d_features, grads);
        self.planes_backward(&coords, scratch, grads);
        loss
    }

    /// Gradient of the planes: for each plane, the upstream gradient
    /// times the product of the other five planes.
    #[inline(always)]
    fn planes_backward(&self, coords: &[[f32; 4]; PANEL], scratch: &Scratch, grads: &mut [f32]) {
        for (s, (coords, values)) in coords.iter().zip(&scratch.values).enumerate() {
            for (level, (planes, values)) in self.planes.iter().zip(values).enumerate() {
                let mut before = [0.0_f32; CHANNELS];
                for (c, d) in before.iter_mut().enumerate() {
                    *d = scratch.d_features[level * CHANNELS + c][s];
                }
                let mut after = [[1.0_f32; CHANNELS]; 6];
                for p in (0..5).rev() {
                    for c in 0..CHANNELS {
                        after[p][c] = after[p + 1][c] * values[p + 1][c];
                    }
                }
                for (p, (plane, (first, second))) in planes.iter().zip(PLANE_AXES).enumerate() {
                    let mut d = [0.0_f32; CHANNELS];
                    for c in 0..CHANNELS {
                        d[c] = before[c] * after[p][c];
                        before[c] *= values[p][c];
                    }
                    for (at, weight) in plane.taps(coords[first], coords[second]) {
                        for (grad, d) in grads[at..at + CHANNELS].iter_mut().zip(&d) {
                            *grad += weight * d;
                        }
                    }
                }
            }
        }
    }
}
