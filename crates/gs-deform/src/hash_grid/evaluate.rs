//! Evaluation of a hash-grid field: segments over threads, layers fused within a panel.

use super::encode::{Points, encode};
use super::field::HashGridField;
use super::segments::Segment;
use crate::evaluate::Wanted;
use crate::linear::{Activation, PANEL, Packed};
use crate::network::Component;
use crate::{FieldError, Trace};
use gs_core::Splats;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// The rows that a field moves. Neither they nor their positions in the box change over time.
#[derive(Debug, Clone, Default)]
pub(super) struct Moving {
    /// Ascending.
    pub(super) rows: Vec<u32>,
    /// Position in the box, one per row.
    pub(super) coords: Vec<[f32; 3]>,
    pub(super) segments: Vec<Segment>,
}

/// Working memory of one thread, feature-major panels.
struct Scratch {
    a: Vec<f32>,
    b: Vec<f32>,
    hidden: Vec<f32>,
    out: Vec<f32>,
}

impl Scratch {
    fn new(field: &HashGridField) -> Self {
        let inner = field.trunk.iter().chain(field.heads.iter().flat_map(|head| &head[..2]));
        let widest = inner.map(Packed::panel_len).max().unwrap_or(0);
        let outputs = field.heads.iter().map(|head| head[2].panel_len()).max().unwrap_or(0);
        Self {
            a: vec![0.0; widest.max(field.grid.shape().num_features() * PANEL)],
            b: vec![0.0; widest],
            hidden: vec![0.0; widest],
            out: vec![0.0; outputs],
        }
    }
}

/// Encoding in `scratch.a`, then the trunk's output in `scratch.hidden`.
#[inline(always)]
fn trunk<S: Simd>(simd: S, field: &HashGridField, scratch: &mut Scratch) {
    field.trunk[0].apply(simd, &scratch.a, &mut scratch.b, Activation::Relu);
    field.trunk[1].apply(simd, &scratch.b, &mut scratch.hidden, field.trunk_end);
}

/// One head from `scratch.hidden` to `scratch.out`.
#[inline(always)]
fn run_head<S: Simd>(simd: S, head: &[Packed; 3], scratch: &mut Scratch) {
    head[0].apply(simd, &scratch.hidden, &mut scratch.a, Activation::Relu);
    head[1].apply(simd, &scratch.a, &mut scratch.b, Activation::Relu);
    head[2].apply(simd, &scratch.b, &mut scratch.out, Activation::None);
}

/// The rows of a segment in every output array.
struct Rows<'a> {
    means: &'a mut [[f32; 3]],
    log_scales: &'a mut [[f32; 3]],
    quats: &'a mut [[f32; 4]],
    opacity_logits: &'a mut [f32],
    sh: &'a mut [[f32; 3]],
}

struct Evaluate<'a, 'b> {
    field: &'a HashGridField,
    t: f32,
    wanted: Wanted,
    /// Moving rows, relative to the start of the segment.
    moving: &'a [u32],
    first: usize,
    coords: &'a [[f32; 3]],
    rows: Rows<'b>,
    scratch: &'a mut Scratch,
}

impl WithSimd for Evaluate<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { field, t, wanted, moving, first, coords, mut rows, scratch } = self;
        encode(&field.grid, &Points::new(coords), t, &mut scratch.a);
        trunk(simd, field, scratch);
        for (component, head) in Component::ALL.into_iter().zip(&field.heads) {
            let geometry =
                matches!(component, Component::Means | Component::LogScales | Component::Quats);
            if wanted == Wanted::Geometry && !geometry {
                continue;
            }
            run_head(simd, head, scratch);
            add(component, moving, first, &scratch.out, &mut rows);
        }
    }
}

/// Stored parameter plus head output, row by row.
#[inline(always)]
fn add(component: Component, moving: &[u32], first: usize, out: &[f32], rows: &mut Rows<'_>) {
    for (i, &row) in moving.iter().enumerate() {
        let row = row as usize - first;
        let delta = |k: usize| out[k * PANEL + i];
        match component {
            Component::Means => add_to(&mut rows.means[row], delta),
            Component::LogScales => add_to(&mut rows.log_scales[row], delta),
            Component::Quats => add_to(&mut rows.quats[row], delta),
            Component::OpacityLogits => rows.opacity_logits[row] += delta(0),
            Component::Sh => {
                let coeffs = Component::Sh.num_outputs() / 3;
                let sh = &mut rows.sh[row * coeffs..(row + 1) * coeffs];
                for (k, value) in sh.as_flattened_mut().iter_mut().enumerate() {
                    *value += delta(k);
                }
            }
        }
    }
}

#[inline(always)]
fn add_to<const D: usize>(value: &mut [f32; D], delta: impl Fn(usize) -> f32) {
    for (k, value) in value.iter_mut().enumerate() {
        *value += delta(k);
    }
}

/// Invariant that makes splitting the arrays into segments valid.
const FITS: &str = "segments cover each row of the canonical splats once";

impl HashGridField {
    /// Splats at network time `t`: `canonical`, with the moving rows deformed.
    pub(super) fn evaluate(
        &self,
        canonical: &Splats,
        moving: &Moving,
        t: f32,
        wanted: Wanted,
        out: &mut Splats,
    ) -> Result<(), FieldError> {
        if !t.is_finite() {
            return Err(FieldError::Time(t));
        }
        let (n, coeffs) = (canonical.len(), canonical.sh_coeffs());
        out.means.resize(n, [0.0; 3]);
        out.log_scales.resize(n, [0.0; 3]);
        out.quats.resize(n, [0.0; 4]);
        let appearance = wanted == Wanted::All;
        if appearance {
            out.opacity_logits.resize(n, 0.0);
            out.sh.resize(n * coeffs, [0.0; 3]);
            out.sh_degree = canonical.sh_degree;
        }
        let (mut means, mut log_scales, mut quats) =
            (&mut out.means[..], &mut out.log_scales[..], &mut out.quats[..]);
        let (mut logits, mut sh) = (&mut out.opacity_logits[..], &mut out.sh[..]);
        let mut work: Vec<(&Segment, Rows<'_>)> = Vec::with_capacity(moving.segments.len());
        for segment in &moving.segments {
            let count = segment.rows.len();
            // Geometry only: no segment reads or writes the appearance arrays of `out`.
            let shown = if appearance { count } else { 0 };
            let rows = Rows {
                means: means.split_off_mut(..count).expect(FITS),
                log_scales: log_scales.split_off_mut(..count).expect(FITS),
                quats: quats.split_off_mut(..count).expect(FITS),
                opacity_logits: logits.split_off_mut(..shown).expect(FITS),
                sh: sh.split_off_mut(..shown * coeffs).expect(FITS),
            };
            work.push((segment, rows));
        }
        let arch = Arch::new();
        work.into_par_iter().with_min_len(4).for_each_init(
            || Scratch::new(self),
            |scratch, (segment, rows)| {
                let range = segment.rows.clone();
                rows.means.copy_from_slice(&canonical.means[range.clone()]);
                rows.log_scales.copy_from_slice(&canonical.log_scales[range.clone()]);
                rows.quats.copy_from_slice(&canonical.quats[range.clone()]);
                if appearance {
                    rows.opacity_logits.copy_from_slice(&canonical.opacity_logits[range.clone()]);
                    let sh = &canonical.sh[range.start * coeffs..range.end * coeffs];
                    rows.sh.copy_from_slice(sh);
                }
                if segment.moving.is_empty() {
                    return;
                }
                arch.dispatch(Evaluate {
                    field: self,
                    t,
                    wanted,
                    moving: &moving.rows[segment.moving.clone()],
                    first: range.start,
                    coords: &moving.coords[segment.moving.clone()],
                    rows,
                    scratch,
                });
            },
        );
        Ok(())
    }

    /// Intermediate values at `inputs`: position in the box and time, `[P, 4]`. Computed by the
    /// kernels of the full evaluation.
    pub fn trace(&self, inputs: &[[f32; 4]]) -> Trace {
        let mut scratch = Scratch::new(self);
        let mut trace = Trace { heads: [const { Some(Vec::new()) }; 5], ..Trace::default() };
        for input in inputs {
            Arch::new().dispatch(TracePoint {
                field: self,
                input: *input,
                scratch: &mut scratch,
                trace: &mut trace,
            });
        }
        trace
    }
}

struct TracePoint<'a> {
    field: &'a HashGridField,
    input: [f32; 4],
    scratch: &'a mut Scratch,
    trace: &'a mut Trace,
}

impl WithSimd for TracePoint<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { field, input: [x, y, z, t], scratch, trace } = self;
        let column = |panel: &[f32], rows: usize| -> Vec<f32> {
            panel.iter().step_by(PANEL).take(rows).copied().collect()
        };
        trace.coords.push([x, y, z, t]);
        encode(&field.grid, &Points::new(&[[x, y, z]]), t, &mut scratch.a);
        trace.features.extend(column(&scratch.a, field.grid.shape().num_features()));
        trunk(simd, field, scratch);
        trace.hidden.extend(column(&scratch.hidden, field.width()));
        for (component, (slot, head)) in
            Component::ALL.into_iter().zip(trace.heads.iter_mut().zip(&field.heads))
        {
            run_head(simd, head, scratch);
            slot.get_or_insert_default().extend(column(&scratch.out, component.num_outputs()));
        }
    }
}
