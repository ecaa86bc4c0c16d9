//! Evaluation of a field for all Gaussians: panels over threads, layers fused within a panel.

use crate::FieldError;
use crate::linear::{Activation, PANEL, Packed};
use crate::network::{Component, HexPlaneField, PackedHead, PackedMask};
use crate::sampling::{TimeLines, multiply_time, spatial_products};
use gs_core::{Splats, quat};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Which outputs a caller needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wanted {
    Geometry,
    All,
}

/// Working memory of one thread, reused from panel to panel.
#[derive(Debug)]
pub(crate) struct Scratch {
    coords: Vec<[f32; 3]>,
    /// Gaussian-major features `[PANEL, L·C]`.
    tile: Vec<f32>,
    /// Feature-major panels.
    a: Vec<f32>,
    b: Vec<f32>,
    hidden: Vec<f32>,
    out: Vec<f32>,
    mask: Vec<f32>,
}

impl Scratch {
    pub(crate) fn new(field: &HexPlaneField) -> Self {
        let heads = || {
            let mask = match &field.mask {
                PackedMask::StaticMlp(head) => Some(head),
                PackedMask::One | PackedMask::EmptyVoxel(_) => None,
            };
            field.heads.iter().flatten().chain(mask)
        };
        let features = field.planes.num_features() * if field.grid_pe > 0.0 { 3 } else { 1 };
        let longest = |layers: &mut dyn Iterator<Item = &Packed>| {
            layers.map(Packed::panel_len).max().unwrap_or(0)
        };
        let activations = longest(&mut field.trunk.iter().chain(heads().map(|head| &head.hidden)))
            .max(features * PANEL);
        Self {
            coords: vec![[0.0; 3]; PANEL],
            tile: vec![0.0; PANEL * field.planes.num_features()],
            a: vec![0.0; activations],
            b: vec![0.0; activations],
            hidden: vec![0.0; activations],
            out: vec![0.0; longest(&mut heads().map(|head| &head.out))],
            mask: vec![1.0; PANEL],
        }
    }
}

impl Scratch {
    /// Features after [`features`], until the trunk runs.
    pub(crate) fn features(&self) -> &[f32] {
        &self.a
    }

    /// Trunk output after [`trunk`].
    pub(crate) fn hidden(&self) -> &[f32] {
        &self.hidden
    }

    /// Trunk output with [`Activation::Relu`] applied.
    pub(crate) fn relu_hidden(&mut self) {
        for value in &mut self.hidden {
            *value = value.max(0.0);
        }
    }

    /// Mask after [`mask`].
    pub(crate) fn mask(&self) -> &[f32] {
        &self.mask
    }

    /// Output of the last head run.
    pub(crate) fn out(&self) -> &[f32] {
        &self.out
    }
}

/// Rows `first..first + len` of every array that a panel reads or writes.
struct Panel<'a> {
    means: &'a [[f32; 3]],
    log_scales: &'a [[f32; 3]],
    quats: &'a [[f32; 4]],
    opacity_logits: &'a [f32],
    sh: &'a [[f32; 3]],
    spatial: Option<&'a [f32]>,
    out_means: &'a mut [[f32; 3]],
    out_log_scales: &'a mut [[f32; 3]],
    out_quats: &'a mut [[f32; 4]],
    out_opacity_logits: &'a mut [f32],
    out_sh: &'a mut [[f32; 3]],
}

struct Evaluate<'a, 'b> {
    field: &'a HexPlaneField,
    lines: &'a TimeLines,
    wanted: Wanted,
    panel: Panel<'b>,
    scratch: &'a mut Scratch,
}

impl WithSimd for Evaluate<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { field, lines, wanted, mut panel, scratch } = self;
        features(field, lines, panel.means, panel.spatial, scratch);
        trunk(simd, field, scratch, Activation::Relu);
        mask(simd, field, panel.means, scratch);
        for component in Component::ALL {
            let geometry =
                matches!(component, Component::Means | Component::LogScales | Component::Quats);
            if wanted == Wanted::Geometry && !geometry {
                continue;
            }
            match &field.heads[component as usize] {
                Some(head) => {
                    run_head(simd, head, scratch);
                    apply(field, component, &mut panel, scratch);
                }
                None => copy(component, &mut panel),
            }
        }
    }
}

/// Box coordinates, then plane features, into the feature-major panel `scratch.a`.
#[inline(always)]
pub(crate) fn features(
    field: &HexPlaneField,
    lines: &TimeLines,
    means: &[[f32; 3]],
    spatial: Option<&[f32]>,
    scratch: &mut Scratch,
) {
    let width = field.planes.num_features();
    for (coords, mean) in scratch.coords.iter_mut().zip(means) {
        *coords = field.planes.normalize(*mean);
    }
    let coords = &scratch.coords[..means.len()];
    let tile = &mut scratch.tile[..means.len() * width];
    match spatial {
        Some(cached) => tile.copy_from_slice(cached),
        None => spatial_products(&field.planes, coords, tile),
    }
    multiply_time(&field.planes, lines, coords, tile);
    // Columns beyond the last Gaussian hold values of an earlier
    // panel; their results are never read.
    for (f, feature) in scratch.a.chunks_exact_mut(PANEL).take(width).enumerate() {
        for (value, row) in feature.iter_mut().zip(tile.chunks_exact(width)) {
            *value = row[f];
        }
    }
    if field.grid_pe > 0.0 {
        let (g, rest) = scratch.a.split_at_mut(width * PANEL);
        let (sines, cosines) = rest.split_at_mut(width * PANEL);
        for ((g, sine), cosine) in g.iter().zip(sines).zip(cosines) {
            (*sine, *cosine) = (field.grid_pe * g).sin_cos();
        }
    }
}

/// Trunk from `scratch.a` to `scratch.hidden`.
#[inline(always)]
pub(crate) fn trunk<S: Simd>(
    simd: S,
    field: &HexPlaneField,
    scratch: &mut Scratch,
    last: Activation,
) {
    let (final_layer, inner) = field.trunk.split_last().expect("a field has a trunk layer");
    for layer in inner {
        layer.apply(simd, &scratch.a, &mut scratch.b, Activation::Relu);
        std::mem::swap(&mut scratch.a, &mut scratch.b);
    }
    final_layer.apply(simd, &scratch.a, &mut scratch.hidden, last);
}

/// One head from `scratch.hidden` (after its ReLU) to `scratch.out`.
#[inline(always)]
pub(crate) fn run_head<S: Simd>(simd: S, head: &PackedHead, scratch: &mut Scratch) {
    head.hidden.apply(simd, &scratch.hidden, &mut scratch.a, Activation::Relu);
    head.out.apply(simd, &scratch.a, &mut scratch.out, Activation::None);
}

/// `scratch.mask`, one factor per Gaussian.
#[inline(always)]
pub(crate) fn mask<S: Simd>(
    simd: S,
    field: &HexPlaneField,
    means: &[[f32; 3]],
    scratch: &mut Scratch,
) {
    match &field.mask {
        PackedMask::One => {}
        PackedMask::StaticMlp(head) => {
            run_head(simd, head, scratch);
            scratch.mask.copy_from_slice(&scratch.out[..PANEL]);
        }
        PackedMask::EmptyVoxel(voxel) => {
            for (factor, mean) in scratch.mask.iter_mut().zip(means) {
                *factor = voxel.at(*mean);
            }
        }
    }
}

/// Stored parameter times mask plus head output; quaternions are never masked.
#[inline(always)]
fn apply(field: &HexPlaneField, component: Component, panel: &mut Panel<'_>, scratch: &Scratch) {
    let out = &scratch.out;
    let masks = &scratch.mask;
    match component {
        Component::Means => masked(panel.means, panel.out_means, masks, out),
        Component::LogScales => masked(panel.log_scales, panel.out_log_scales, masks, out),
        Component::Quats => {
            for (i, (to, from)) in panel.out_quats.iter_mut().zip(panel.quats).enumerate() {
                let delta: [f32; 4] = std::array::from_fn(|k| out[k * PANEL + i]);
                *to = if field.apply_rotation {
                    quat::normalize(quat::mul(*from, delta))
                } else {
                    std::array::from_fn(|k| from[k] + delta[k])
                };
            }
        }
        Component::OpacityLogits => {
            let rows = panel.out_opacity_logits.iter_mut().zip(panel.opacity_logits);
            for (i, (to, from)) in rows.enumerate() {
                *to = from * masks[i] + out[i];
            }
        }
        Component::Sh => {
            let coeffs = panel.sh.len() / panel.means.len();
            let rows = panel.out_sh.chunks_exact_mut(coeffs).zip(panel.sh.chunks_exact(coeffs));
            for (i, (to, from)) in rows.enumerate() {
                for (k, (to, from)) in to.iter_mut().zip(from).enumerate() {
                    for channel in 0..3 {
                        to[channel] = from[channel] * masks[i] + out[(3 * k + channel) * PANEL + i];
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn masked(from: &[[f32; 3]], to: &mut [[f32; 3]], masks: &[f32], out: &[f32]) {
    for (i, (to, from)) in to.iter_mut().zip(from).enumerate() {
        *to = std::array::from_fn(|k| from[k] * masks[i] + out[k * PANEL + i]);
    }
}

fn copy(component: Component, panel: &mut Panel<'_>) {
    match component {
        Component::Means => panel.out_means.copy_from_slice(panel.means),
        Component::LogScales => panel.out_log_scales.copy_from_slice(panel.log_scales),
        Component::Quats => panel.out_quats.copy_from_slice(panel.quats),
        Component::OpacityLogits => panel.out_opacity_logits.copy_from_slice(panel.opacity_logits),
        Component::Sh => panel.out_sh.copy_from_slice(panel.sh),
    }
}

impl HexPlaneField {
    /// Deforms all of `canonical` to network time `t` into `out`, reusing its memory. Times and
    /// positions outside the planes take the border value.
    ///
    /// # Errors
    /// If `t` is not finite, the arrays of `canonical` have inconsistent lengths, or SH are
    /// deformed and their degree is not 3.
    pub fn deform_into(
        &self,
        canonical: &Splats,
        t: f32,
        out: &mut Splats,
    ) -> Result<(), FieldError> {
        self.check_splats(canonical)?;
        self.evaluate(canonical, None, t, Wanted::All, out)
    }

    pub(crate) fn check_splats(&self, canonical: &Splats) -> Result<(), FieldError> {
        canonical.check_shapes()?;
        if self.deforms(Component::Sh) && canonical.sh_degree != 3 {
            return Err(FieldError::Unsupported(format!(
                "the SH head deforms degree 3, the splats have degree {}",
                canonical.sh_degree
            )));
        }
        Ok(())
    }

    /// Spatial products of all Gaussians, `[N, L·C]`.
    pub(crate) fn spatial_features(&self, means: &[[f32; 3]]) -> Vec<f32> {
        let width = self.planes.num_features();
        let mut out = vec![0.0; means.len() * width];
        let arch = Arch::new();
        out.par_chunks_mut(PANEL * width).zip(means.par_chunks(PANEL)).for_each(|(out, means)| {
            arch.dispatch(
                #[inline(always)]
                || {
                    let mut coords = [[0.0; 3]; PANEL];
                    for (coords, mean) in coords.iter_mut().zip(means) {
                        *coords = self.planes.normalize(*mean);
                    }
                    spatial_products(&self.planes, &coords[..means.len()], out);
                },
            );
        });
        out
    }

    pub(crate) fn evaluate(
        &self,
        canonical: &Splats,
        spatial: Option<&[f32]>,
        t: f32,
        wanted: Wanted,
        out: &mut Splats,
    ) -> Result<(), FieldError> {
        if !t.is_finite() {
            return Err(FieldError::Time(t));
        }
        let n = canonical.len();
        let coeffs = canonical.sh_coeffs();
        out.means.resize(n, [0.0; 3]);
        out.log_scales.resize(n, [0.0; 3]);
        out.quats.resize(n, [0.0; 4]);
        // Geometry only: no panel reads or writes the appearance arrays of `out`.
        let (mut no_logits, mut no_sh) = (Vec::new(), Vec::new());
        let (out_logits, out_sh) = if wanted == Wanted::All {
            out.opacity_logits.resize(n, 0.0);
            out.sh.resize(n * coeffs, [0.0; 3]);
            out.sh_degree = canonical.sh_degree;
            (&mut out.opacity_logits, &mut out.sh)
        } else {
            (&mut no_logits, &mut no_sh)
        };
        let lines = TimeLines::new(&self.planes, t);
        let width = self.planes.num_features();
        let arch = Arch::new();
        let panels = out
            .means
            .chunks_mut(PANEL)
            .zip(out.log_scales.chunks_mut(PANEL))
            .zip(out.quats.chunks_mut(PANEL))
            .zip(padded(out_logits.chunks_mut(PANEL)))
            .zip(padded(out_sh.chunks_mut(PANEL * coeffs)));
        let panels: Vec<_> = panels.collect();
        panels.into_par_iter().enumerate().with_min_len(8).for_each_init(
            || Scratch::new(self),
            |scratch, (index, ((((means, log_scales), quats), logits), sh))| {
                let first = index * PANEL;
                let rows = first..first + means.len();
                let panel = Panel {
                    means: &canonical.means[rows.clone()],
                    log_scales: &canonical.log_scales[rows.clone()],
                    quats: &canonical.quats[rows.clone()],
                    opacity_logits: &canonical.opacity_logits[rows.clone()],
                    sh: &canonical.sh[rows.start * coeffs..rows.end * coeffs],
                    spatial: spatial.map(|all| &all[rows.start * width..rows.end * width]),
                    out_means: means,
                    out_log_scales: log_scales,
                    out_quats: quats,
                    out_opacity_logits: logits,
                    out_sh: sh,
                };
                arch.dispatch(Evaluate { field: self, lines: &lines, wanted, panel, scratch });
            },
        );
        Ok(())
    }
}

/// The chunks, followed by endless empty ones.
fn padded<'a, T: 'a>(
    chunks: impl Iterator<Item = &'a mut [T]>,
) -> impl Iterator<Item = &'a mut [T]> {
    chunks.chain(std::iter::repeat_with(|| &mut [] as &mut [T]))
}
