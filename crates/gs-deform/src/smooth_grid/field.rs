//! [`SmoothGridField`]: grids and the network on their features.

use super::grid::SmoothGrid;
use crate::FieldError;
use crate::linear::{Activation, Linear, PANEL, Packed};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Factor of the space-time features, computed from position alone: `σ(layer(grid))`, or `2σ − 1`.
#[derive(Debug, Clone, PartialEq)]
pub struct Attention {
    /// Grid of x, y, z.
    pub grid: SmoothGrid,
    /// `spatial_mlp`; its outputs are the width of the network.
    pub layer: Linear,
    /// Whether the factor is `2σ − 1`.
    pub directional: bool,
}

/// The parts of a field as a checkpoint stores them; [`SmoothGridField::new`] verifies that they
/// fit.
#[derive(Debug, Clone, PartialEq)]
pub struct SmoothGridNetwork {
    /// Half the side of the cube covered by the grids, in scaled positions.
    pub bound: f32,
    /// Factor of positions per axis.
    pub scale: [f32; 3],
    /// Attention, if there is one.
    pub attention: Option<Attention>,
    /// Grids of space and time; their features are concatenated in this order.
    pub grids: Vec<SmoothGrid>,
    /// First layer, on their features.
    pub trunk: Linear,
    /// Further layers, a ReLU after each.
    pub hidden: Vec<Linear>,
    /// Motion: 3 outputs (a translation), or 7 (a quaternion about the world origin with 1
    /// subtracted from its real part, then a translation).
    pub warp: Linear,
    /// Change of the quaternion, 4 outputs.
    pub rotation: Linear,
    /// Change of the scales, 3 outputs.
    pub scaling: Linear,
}

/// A verified field.
#[derive(Debug, Clone)]
pub struct SmoothGridField {
    bound: f32,
    scale: [f32; 3],
    attention: Option<(SmoothGrid, Packed, bool)>,
    grids: Vec<SmoothGrid>,
    trunk: Packed,
    hidden: Vec<Packed>,
    warp: Packed,
    pub(super) rotates: bool,
    rotation: Packed,
    scaling: Packed,
    width: usize,
}

/// Outputs of the field, one row per point.
#[derive(Debug, Clone, Default)]
pub(super) struct Outputs {
    pub(super) warp: Vec<[f32; 7]>,
    pub(super) rotation: Vec<[f32; 4]>,
    pub(super) scaling: Vec<[f32; 3]>,
}

impl SmoothGridField {
    /// Verifies that all shapes fit and all values are finite.
    ///
    /// # Errors
    /// Names the first part that does not fit.
    pub fn new(network: SmoothGridNetwork) -> Result<Self, FieldError> {
        let SmoothGridNetwork { bound, scale, attention, grids, trunk, hidden, warp, .. } = network;
        let finite = bound.is_finite() && scale.iter().all(|factor| factor.is_finite());
        if !(finite && bound > 0.0) {
            return Err(FieldError::Unsupported(format!(
                "bound = {bound} and scale_xyz = {scale:?}, expected a positive and three finite numbers"
            )));
        }
        let features = grids.iter().map(SmoothGrid::num_features).sum();
        trunk.check("temporal layer", features, None)?;
        let width = trunk.num_outputs();
        let attention = attention
            .map(|Attention { grid, layer, directional }| {
                layer.check("spatial_mlp.0", grid.num_features(), Some(width))?;
                Ok::<_, FieldError>((grid, Packed::new(&layer), directional))
            })
            .transpose()?;
        let mut inputs = width;
        for (index, layer) in hidden.iter().enumerate() {
            layer.check(&format!("grid_mlp.{}", 2 * index), inputs, None)?;
            inputs = layer.num_outputs();
        }
        let rotates = warp.num_outputs() == 7;
        warp.check("gaussian_warp", inputs, Some(if rotates { 7 } else { 3 }))?;
        network.rotation.check("gaussian_rotation", inputs, Some(4))?;
        network.scaling.check("gaussian_scaling", inputs, Some(3))?;
        Ok(Self {
            bound,
            scale,
            attention,
            grids,
            trunk: Packed::new(&trunk),
            hidden: hidden.iter().map(Packed::new).collect(),
            warp: Packed::new(&warp),
            rotates,
            rotation: Packed::new(&network.rotation),
            scaling: Packed::new(&network.scaling),
            width,
        })
    }

    /// Width of the network.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Position and time in the unit box. Time spans nine tenths of its axis.
    fn locate(&self, x: [f32; 3], t: f32) -> [f32; 4] {
        let unit = |value: f32| (value + self.bound) / (2.0 * self.bound);
        let [x, y, z] = [0, 1, 2].map(|k| unit(x[k] * self.scale[k]));
        [x, y, z, unit((2.0 * t - 1.0) * (0.9 * self.bound))]
    }

    /// Outputs of the field at `points` (world units) and time `t`.
    pub(super) fn outputs(&self, points: &[[f32; 3]], t: f32) -> Outputs {
        let mut outputs = Outputs {
            warp: vec![[0.0; 7]; points.len()],
            rotation: vec![[0.0; 4]; points.len()],
            scaling: vec![[0.0; 3]; points.len()],
        };
        let arch = Arch::new();
        points
            .par_chunks(PANEL)
            .zip(outputs.warp.par_chunks_mut(PANEL))
            .zip(outputs.rotation.par_chunks_mut(PANEL))
            .zip(outputs.scaling.par_chunks_mut(PANEL))
            .for_each_init(
                || Scratch::new(self),
                |scratch, (((points, warp), rotation), scaling)| {
                    arch.dispatch(Evaluate {
                        field: self,
                        t,
                        points,
                        warp,
                        rotation,
                        scaling,
                        scratch,
                    });
                },
            );
        outputs
    }
}

/// Working memory of one thread, feature-major panels.
struct Scratch {
    features: Vec<f32>,
    a: Vec<f32>,
    b: Vec<f32>,
    out: Vec<f32>,
}

impl Scratch {
    fn new(field: &SmoothGridField) -> Self {
        let features = field.grids.iter().map(SmoothGrid::num_features).sum::<usize>();
        let spatial = field.attention.as_ref().map_or(0, |(grid, _, _)| grid.num_features());
        let layers = field.hidden.iter().chain([&field.trunk]);
        let layers = layers.chain(field.attention.as_ref().map(|(_, layer, _)| layer));
        let widest = layers.map(Packed::panel_len).max().unwrap_or(0);
        let heads = [&field.warp, &field.rotation, &field.scaling];
        Self {
            features: vec![0.0; features.max(spatial) * PANEL],
            a: vec![0.0; widest],
            b: vec![0.0; widest],
            out: vec![0.0; heads.map(Packed::panel_len).into_iter().max().unwrap_or(0)],
        }
    }
}

struct Evaluate<'a> {
    field: &'a SmoothGridField,
    t: f32,
    points: &'a [[f32; 3]],
    warp: &'a mut [[f32; 7]],
    rotation: &'a mut [[f32; 4]],
    scaling: &'a mut [[f32; 3]],
    scratch: &'a mut Scratch,
}

impl WithSimd for Evaluate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { field, t, points, warp, rotation, scaling, scratch } = self;
        let Scratch { features, a, b, out } = scratch;
        let mut start = 0;
        for grid in &field.grids {
            for (i, point) in points.iter().enumerate() {
                let put = |k: usize, value: f32| features[(start + k) * PANEL + i] = value;
                grid.encode(field.locate(*point, t), put);
            }
            start += grid.num_features();
        }
        field.trunk.apply(simd, features, a, Activation::Relu);
        if let Some((grid, layer, directional)) = &field.attention {
            for (i, point) in points.iter().enumerate() {
                let put = |k: usize, value: f32| features[k * PANEL + i] = value;
                grid.encode(field.locate(*point, t), put);
            }
            layer.apply(simd, features, b, Activation::None);
            for (value, logit) in a.iter_mut().zip(b.iter()) {
                let weight = 1.0 / (1.0 + (-logit).exp());
                *value *= if *directional { 2.0 * weight - 1.0 } else { weight };
            }
        }
        for layer in &field.hidden {
            layer.apply(simd, a, b, Activation::Relu);
            std::mem::swap(a, b);
        }
        field.warp.apply(simd, a, out, Activation::None);
        let outputs = if field.rotates { 7 } else { 3 };
        for (i, row) in warp.iter_mut().enumerate() {
            for (k, value) in row[..outputs].iter_mut().enumerate() {
                *value = out[k * PANEL + i];
            }
        }
        field.rotation.apply(simd, a, out, Activation::None);
        take(out, rotation);
        field.scaling.apply(simd, a, out, Activation::None);
        take(out, scaling);
    }
}

#[inline(always)]
fn take<const D: usize>(panel: &[f32], rows: &mut [[f32; D]]) {
    for (i, row) in rows.iter_mut().enumerate() {
        for (k, value) in row.iter_mut().enumerate() {
            *value = panel[k * PANEL + i];
        }
    }
}
