//! Intermediate values of an evaluation, for diagnosis and for tests against a reference.

use crate::evaluate::{Scratch, features, mask, run_head, trunk};
use crate::linear::{Activation, PANEL};
use crate::network::{Component, HexPlaneField, PackedMask};
use crate::sampling::TimeLines;
use pulp::{Arch, Simd, WithSimd};

/// Outputs of the field's stages for some points at one time,
/// computed by the kernels of the full evaluation.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trace {
    /// Box coordinates and time, `[P,4]`.
    pub coords: Vec<[f32; 4]>,
    /// Products over the planes (HexPlane) or table features (hash grid), levels concatenated:
    /// `[P, L·C]`.
    pub features: Vec<f32>,
    /// Trunk output, `[P, W]`: for HexPlane before the ReLU of the
    /// heads, for hash grids the input of the heads.
    pub hidden: Vec<f32>,
    /// Mask per point, if the field has one: `[P]`.
    pub mask: Option<Vec<f32>>,
    /// Raw head outputs in the order of [`Component::ALL`], `[P, outputs]` each, for heads in use.
    pub heads: [Option<Vec<f32>>; 5],
}

impl HexPlaneField {
    /// Intermediate values at `means` (world units) and time `t`.
    pub fn trace(&self, means: &[[f32; 3]], t: f32) -> Trace {
        let lines = TimeLines::new(&self.planes, t);
        let mut trace = Trace::default();
        if !matches!(self.mask, PackedMask::One) {
            trace.mask = Some(Vec::new());
        }
        for (slot, head) in trace.heads.iter_mut().zip(&self.heads) {
            *slot = head.as_ref().map(|_| Vec::new());
        }
        let mut scratch = Scratch::new(self);
        for means in means.chunks(PANEL) {
            let job = TracePanel { field: self, lines: &lines, means, t, scratch: &mut scratch };
            Arch::new().dispatch(Job { panel: job, trace: &mut trace });
        }
        trace
    }
}

struct TracePanel<'a> {
    field: &'a HexPlaneField,
    lines: &'a TimeLines,
    means: &'a [[f32; 3]],
    t: f32,
    scratch: &'a mut Scratch,
}

struct Job<'a> {
    panel: TracePanel<'a>,
    trace: &'a mut Trace,
}

impl WithSimd for Job<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let TracePanel { field, lines, means, t, scratch } = self.panel;
        let trace = self.trace;
        features(field, lines, means, None, scratch);
        let coords = means.iter().map(|mean| field.planes.normalize(*mean));
        trace.coords.extend(coords.map(|[x, y, z]| [x, y, z, t]));
        append(&mut trace.features, scratch.features(), means.len(), field.planes.num_features());
        trunk(simd, field, scratch, Activation::None);
        append(&mut trace.hidden, scratch.hidden(), means.len(), field.width);
        scratch.relu_hidden();
        mask(simd, field, means, scratch);
        if let Some(values) = &mut trace.mask {
            values.extend_from_slice(&scratch.mask()[..means.len()]);
        }
        for (component, (slot, head)) in
            Component::ALL.into_iter().zip(trace.heads.iter_mut().zip(&field.heads))
        {
            if let (Some(values), Some(head)) = (slot, head) {
                run_head(simd, head, scratch);
                append(values, scratch.out(), means.len(), component.num_outputs());
            }
        }
    }
}

/// Appends the first `columns` columns of a feature-major panel as rows.
fn append(rows: &mut Vec<f32>, panel: &[f32], columns: usize, features: usize) {
    for column in 0..columns {
        rows.extend((0..features).map(|feature| panel[feature * PANEL + column]));
    }
}
