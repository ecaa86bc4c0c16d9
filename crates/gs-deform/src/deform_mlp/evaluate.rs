//! Evaluation of the network at many points and one time.

use super::encoding;
use super::network::{DeformMlp, POSITION};
use crate::linear::{Activation, PANEL, Packed};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Outputs of the network, one row per point. Empty for
/// optional heads that the network does not have.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MlpOutputs {
    /// Translation in the first three entries, or the twist of a screw motion, `[P, 6]`.
    pub warp: Vec<[f32; 6]>,
    /// Change of the quaternion `wxyz`, `[P, 4]`.
    pub rotation: Vec<[f32; 4]>,
    /// Change of the scales, world units, `[P, 3]`.
    pub scaling: Vec<[f32; 3]>,
    /// Change of the opacity, `[P]`.
    pub opacity: Vec<f32>,
    /// Change of the DC coefficient, `[P, 3]`.
    pub color: Vec<[f32; 3]>,
    /// Rotation about a control node, before 1 is added to its real part, `[P, 4]`.
    pub local_rotation: Vec<[f32; 4]>,
}

/// Working memory of one thread, feature-major panels.
struct Scratch {
    /// Encoded position and time, then room for a layer's output.
    joined: Vec<f32>,
    a: Vec<f32>,
    b: Vec<f32>,
    out: Vec<f32>,
}

impl Scratch {
    fn new(mlp: &DeformMlp) -> Self {
        let inner = mlp.layers.iter().map(|(layer, _)| layer).chain(&mlp.color);
        let widest = inner.map(Packed::panel_len).max().unwrap_or(0);
        let heads = mlp.warp.iter().chain([&mlp.rotation, &mlp.scaling]);
        let heads = heads.chain(&mlp.opacity).chain(&mlp.local_rotation).chain(&mlp.color);
        Self {
            joined: vec![0.0; mlp.inputs * PANEL + widest],
            a: vec![0.0; widest],
            b: vec![0.0; widest],
            out: vec![0.0; heads.map(Packed::panel_len).max().unwrap_or(0)],
        }
    }
}

/// Rows of one panel in every output array.
struct Rows<'a> {
    warp: &'a mut [[f32; 6]],
    rotation: &'a mut [[f32; 4]],
    scaling: &'a mut [[f32; 3]],
    opacity: &'a mut [f32],
    color: &'a mut [[f32; 3]],
    local_rotation: &'a mut [[f32; 4]],
}

struct Evaluate<'a, 'b> {
    mlp: &'a DeformMlp,
    time: &'a [f32],
    points: &'a [[f32; 3]],
    rows: Rows<'b>,
    scratch: &'a mut Scratch,
}

impl WithSimd for Evaluate<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { mlp, time, points, rows, scratch } = self;
        let inputs = mlp.inputs * PANEL;
        for (i, point) in points.iter().enumerate() {
            // Columns beyond the last point hold values of an earlier
            // panel; their results are never read.
            encoding::encode(*point, (POSITION / 3 - 1) / 2, |k, value| {
                scratch.joined[k * PANEL + i] = value;
            });
        }
        for (k, value) in time.iter().enumerate() {
            scratch.joined[(POSITION + k) * PANEL..][..PANEL].fill(*value);
        }
        for (index, (layer, joined)) in mlp.layers.iter().enumerate() {
            if index == 0 {
                layer.apply(simd, &scratch.joined, &mut scratch.b, Activation::Relu);
            } else if *joined {
                let width = layer.num_inputs() * PANEL - inputs;
                scratch.joined[inputs..inputs + width].copy_from_slice(&scratch.a[..width]);
                layer.apply(simd, &scratch.joined, &mut scratch.b, Activation::Relu);
            } else {
                layer.apply(simd, &scratch.a, &mut scratch.b, Activation::Relu);
            }
            std::mem::swap(&mut scratch.a, &mut scratch.b);
        }
        let Scratch { a, b, out, .. } = scratch;
        for (part, layer) in mlp.warp.iter().enumerate() {
            layer.apply(simd, a, out, Activation::None);
            for (i, row) in rows.warp.iter_mut().enumerate() {
                for k in 0..3 {
                    row[3 * part + k] = out[k * PANEL + i];
                }
            }
        }
        mlp.rotation.apply(simd, a, out, Activation::None);
        take(out, rows.rotation);
        mlp.scaling.apply(simd, a, out, Activation::None);
        take(out, rows.scaling);
        if let Some(layer) = &mlp.opacity {
            layer.apply(simd, a, out, Activation::None);
            rows.opacity.copy_from_slice(&out[..points.len()]);
        }
        if let Some(layer) = &mlp.local_rotation {
            layer.apply(simd, a, out, Activation::None);
            take(out, rows.local_rotation);
        }
        if let Some((last, hidden)) = mlp.color.split_last() {
            for layer in hidden {
                layer.apply(simd, a, b, Activation::Relu);
                std::mem::swap(a, b);
            }
            last.apply(simd, a, out, Activation::None);
            take(out, rows.color);
        }
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

/// The next `count` rows of an array, or none of an empty one.
#[expect(clippy::mut_mut, reason = "the slice itself is shortened")]
fn next<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let count = count.min(rest.len());
    let (head, tail) = std::mem::take(rest).split_at_mut(count);
    *rest = tail;
    head
}

impl DeformMlp {
    /// Outputs of the network at `points` (world units) and time `t`.
    pub fn outputs(&self, points: &[[f32; 3]], t: f32) -> MlpOutputs {
        let count = |used: bool| if used { points.len() } else { 0 };
        let mut outputs = MlpOutputs {
            warp: vec![[0.0; 6]; points.len()],
            rotation: vec![[0.0; 4]; points.len()],
            scaling: vec![[0.0; 3]; points.len()],
            opacity: vec![0.0; count(self.opacity.is_some())],
            color: vec![[0.0; 3]; count(!self.color.is_empty())],
            local_rotation: vec![[0.0; 4]; count(self.local_rotation.is_some())],
        };
        let time = self.time(t);
        let (mut warp, mut rotation, mut scaling) =
            (&mut outputs.warp[..], &mut outputs.rotation[..], &mut outputs.scaling[..]);
        let (mut opacity, mut color, mut local_rotation) =
            (&mut outputs.opacity[..], &mut outputs.color[..], &mut outputs.local_rotation[..]);
        let mut work = Vec::with_capacity(points.len().div_ceil(PANEL));
        for points in points.chunks(PANEL) {
            let rows = Rows {
                warp: next(&mut warp, points.len()),
                rotation: next(&mut rotation, points.len()),
                scaling: next(&mut scaling, points.len()),
                opacity: next(&mut opacity, points.len()),
                color: next(&mut color, points.len()),
                local_rotation: next(&mut local_rotation, points.len()),
            };
            work.push((points, rows));
        }
        let arch = Arch::new();
        work.into_par_iter().for_each_init(
            || Scratch::new(self),
            |scratch, (points, rows)| {
                arch.dispatch(Evaluate { mlp: self, time: &time, points, rows, scratch });
            },
        );
        outputs
    }
}
