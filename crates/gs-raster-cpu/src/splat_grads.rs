//! Chain rule from the sums of the pixel stage to the gradients of every splat's stored parameters.
//!
//! Splats that no pixel has drawn (a third of a large scene) get zeros directly; the others are
//! staged in groups, one splat per lane. Each gradient is written once, in the order of the splats.

use crate::harmonics::{Harmonics, touch};
use crate::lanes::{self, Lane};
use crate::prepared::Prepared;
use crate::project::{Geometry, Projection};
use crate::project_grad::project_gradient;
use crate::shade::DEAD;
use crate::tile_grad::MOMENTS;
use crate::vector::{GROUP, Quad, Vector, all_finite, registers};
use crate::view::{View, each};
use gs_core::{GradientConvention, RenderGrads, Splats};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// Parameters that a backward pass differentiates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    Everything,
    Colors,
}

/// Splats differentiated per task.
const CHUNK: usize = 256;

/// Chain rule of every splat.
pub(crate) fn write<F: Lane>(
    prepared: &Prepared<F>,
    splats: &Splats<F>,
    convention: GradientConvention,
    scope: Scope,
    stride: usize,
    grads: &mut RenderGrads<F>,
) {
    let layout = prepared.shade.layout;
    let num_splats = prepared.num_splats;
    let coeffs = splats.sh_coeffs();
    let (zero, geometry) = (F::zero(), if scope == Scope::Everything { num_splats } else { 0 });
    grads.v_means.resize(geometry, [zero; 3]);
    grads.v_quats.resize(geometry, [zero; 4]);
    grads.v_log_scales.resize(geometry, [zero; 3]);
    grads.v_opacity_logits.resize(geometry, zero);
    grads.v_means2d.resize(geometry, [zero; 2]);
    grads.v_sh.resize(num_splats * coeffs, [zero; 3]);
    grads.v_features.resize(num_splats * layout.features, zero);

    if layout.features > 0 {
        let first = MOMENTS + layout.features_at();
        let targets = grads.v_features.par_chunks_exact_mut(layout.features).enumerate();
        targets.with_min_len(CHUNK).for_each(|(id, target)| {
            if prepared.shade.flags[id] & DEAD == 0 {
                let start = prepared.rank_of[id] as usize * stride + first;
                target.copy_from_slice(&prepared.sums[start..start + layout.features]);
            } else {
                target.fill(F::zero());
            }
        });
    }

    let arch = lanes::arch();
    let differentiate = |chunk: usize, geometry, sh| {
        let first = chunk * CHUNK;
        arch.dispatch(GradChunk { prepared, splats, convention, stride, first, geometry, sh });
    };
    let RenderGrads { v_means, v_quats, v_log_scales, v_opacity_logits, v_means2d, v_sh, .. } =
        grads;
    let v_sh = v_sh.par_chunks_mut(CHUNK * coeffs);
    if scope == Scope::Colors {
        v_sh.enumerate().for_each(|(chunk, sh)| differentiate(chunk, None, sh));
        return;
    }
    v_means
        .par_chunks_mut(CHUNK)
        .zip(v_quats.par_chunks_mut(CHUNK))
        .zip(v_log_scales.par_chunks_mut(CHUNK))
        .zip(v_opacity_logits.par_chunks_mut(CHUNK))
        .zip(v_means2d.par_chunks_mut(CHUNK))
        .zip(v_sh)
        .enumerate()
        .for_each(|(chunk, (((((means, quats), log_scales), opacity_logits), means2d), sh))| {
            let geometry = Targets { means, quats, log_scales, opacity_logits, means2d };
            differentiate(chunk, Some(geometry), sh);
        });
}

/// Output arrays for the gradients of geometry and opacity of a chunk.
struct Targets<'a, F> {
    means: &'a mut [[F; 3]],
    quats: &'a mut [[F; 4]],
    log_scales: &'a mut [[F; 3]],
    opacity_logits: &'a mut [F],
    means2d: &'a mut [[F; 2]],
}

/// Consecutive splats from `first`, as many as `sh` has rows for.
struct GradChunk<'a, F> {
    prepared: &'a Prepared<F>,
    splats: &'a Splats<F>,
    convention: GradientConvention,
    stride: usize,
    first: usize,
    /// `None`: colours only.
    geometry: Option<Targets<'a, F>>,
    sh: &'a mut [[F; 3]],
}

/// Sums of the pixel stage for one splat: moments, colour, depth, padding.
type SplatSums<F> = [[F; 4]; 3];

/// A group of splats, side by side.
struct Group<F> {
    geometry: Geometry<F>,
    harmonics: Harmonics<F>,
    /// [`SplatSums`].
    sums: [Quad<F>; 3],
    v_harmonics: Harmonics<F>,
    /// Gradients of means and opacity logits.
    v_means: Quad<F>,
    v_quats: Quad<F>,
    /// And padding.
    v_log_scales: Quad<F>,
    /// And padding.
    v_means2d: Quad<F>,
}

impl<F: Lane> Group<F> {
    fn zero(sh_degree: usize) -> Self {
        let zero = Quad::zero();
        Self {
            geometry: Geometry::zero(),
            harmonics: Harmonics::zero(sh_degree),
            sums: [zero; 3],
            v_harmonics: Harmonics::zero(sh_degree),
            v_means: zero,
            v_quats: zero,
            v_log_scales: zero,
            v_means2d: zero,
        }
    }
}

impl<F: Lane> WithSimd for GradChunk<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, s: S) {
        let view = self.prepared.view.splat(s);
        let sums = self.fetch();
        let mut group = Group::zero(self.splats.sh_degree);
        let (mut drawn, mut count) = ([0; CHUNK], 0);
        for (i, sums) in sums[..self.sh.len() / self.splats.sh_coeffs()].iter().enumerate() {
            if sums.as_flattened().iter().any(|&sum| sum != F::zero()) {
                drawn[count] = i;
                count += 1;
            } else {
                self.write_zeros(i);
            }
        }
        if self.geometry.is_some() && self.prepared.shade.layout.rgb {
            touch(self.splats, self.first, &drawn[..count]);
        }
        for drawn in drawn[..count].chunks(GROUP) {
            for (place, &i) in drawn.iter().enumerate() {
                let id = self.first + i;
                for (quad, sums) in group.sums.iter_mut().zip(sums[i]) {
                    quad.0[place] = sums;
                }
                group.geometry.put(place, self.splats, id);
                if self.geometry.is_some() && self.prepared.shade.layout.rgb {
                    group.harmonics.put(place, self.splats.sh_of(id));
                }
            }
            for k in 0..registers::<S, F>() {
                self.differentiate(s, &view, &mut group, k);
            }
            for (place, &i) in drawn.iter().enumerate() {
                self.write(&group, place, i);
            }
        }
    }
}

impl<F: Lane> GradChunk<'_, F> {
    /// The sums of the splats, zero for those that draw nothing and for clamped colours. They are
    /// stored in depth order; a loop without other work lets the cache misses overlap.
    #[inline(always)]
    fn fetch(&self) -> [SplatSums<F>; CHUNK] {
        let prepared = self.prepared;
        let layout = prepared.shade.layout;
        let ids = self.first..prepared.num_splats.min(self.first + CHUNK);
        let (ranks, flags) = (&prepared.rank_of[ids.clone()], &prepared.shade.flags[ids]);
        let mut out = [[[F::zero(); 4]; 3]; CHUNK];
        let used = MOMENTS + if layout.rgb { 3 } else { 0 };
        for (out, &rank) in out.iter_mut().zip(ranks) {
            // A culled splat reads the last row, and the value is discarded.
            let start = (rank as usize).min(prepared.visible.len().max(1) - 1) * self.stride;
            let out = out.as_flattened_mut();
            let Some(sums) = prepared.sums.get(start..start + self.stride) else { break };
            if used == MOMENTS + 3 {
                out[..MOMENTS + 3].copy_from_slice(&sums[..MOMENTS + 3]);
            } else {
                out[..MOMENTS].copy_from_slice(&sums[..MOMENTS]);
            }
            if layout.depth {
                out[MOMENTS + 3] = sums[MOMENTS + layout.depth_at()];
            }
        }
        for (out, &flags) in out.iter_mut().zip(flags) {
            let out = out.as_flattened_mut();
            if flags & DEAD != 0 {
                out.fill(F::zero());
            }
            for (c, sum) in out[MOMENTS..MOMENTS + 3].iter_mut().enumerate() {
                let clamped = flags >> c & 1 != 0;
                *sum = if clamped { F::zero() } else { *sum };
            }
        }
        out
    }

    /// Gradients of registers `k` of a group.
    #[inline(always)]
    fn differentiate<S: Simd>(
        &self,
        s: S,
        view: &View<Vector<S, F>>,
        group: &mut Group<F>,
        k: usize,
    ) {
        let [s0, sx, sy, sxx] = group.sums[0].load(s, k);
        let [sxy, syy, red, green] = group.sums[1].load(s, k);
        let [blue, v_depth, zero, _] = group.sums[2].load(s, k);
        let v_rgb = [red, green, blue];
        let [x, y, z, _] = group.geometry.means.load(s, k);
        let (direction, distance) = view.direction([x, y, z]);
        group.v_harmonics.store_gradient(s, k, v_rgb, direction);
        if self.geometry.is_none() {
            return;
        }

        let moments = [s0, sx, sy, sxx, sxy, syy];
        let frame = Projection::new(s, view, &group.geometry, k);
        let mut v = project_gradient(view, &frame, &moments, self.convention);
        v.mean = each!(axis => v.mean[axis] + v_depth * view.rows[2][axis]);
        if self.prepared.shade.layout.rgb {
            let through = group.harmonics.mean_gradient(s, k, v_rgb, (direction, distance));
            v.mean = each!(axis => v.mean[axis] + through[axis]);
        }
        // Very large covariances overflow here; such a splat has no usable gradient.
        let usable = all_finite(v.mean)
            .and(all_finite(v.quat))
            .and(all_finite(v.log_scale))
            .and(all_finite(v.mean2d))
            .and(v.opacity_logit.is_finite());
        let ([x, y, z], [a, b, c]) = (v.mean, v.log_scale);
        group.v_means.store(s, k, usable.select_all([x, y, z, v.opacity_logit]));
        group.v_quats.store(s, k, usable.select_all(v.quat));
        group.v_log_scales.store(s, k, usable.select_all([a, b, c, zero]));
        group.v_means2d.store(s, k, usable.select_all([v.mean2d[0], v.mean2d[1], zero, zero]));
    }

    /// Writes the gradients at `place` of a group to the chunk's `i`th splat.
    #[inline(always)]
    fn write(&mut self, group: &Group<F>, place: usize, i: usize) {
        if let Some(targets) = &mut self.geometry {
            let [x, y, z, opacity_logit] = group.v_means.0[place];
            let [a, b, c, _] = group.v_log_scales.0[place];
            let [u, v, ..] = group.v_means2d.0[place];
            targets.means[i] = [x, y, z];
            targets.quats[i] = group.v_quats.0[place];
            targets.log_scales[i] = [a, b, c];
            targets.opacity_logits[i] = opacity_logit;
            targets.means2d[i] = [u, v];
        }
        let coeffs = self.splats.sh_coeffs();
        group.v_harmonics.take(place, &mut self.sh[i * coeffs..(i + 1) * coeffs]);
    }

    #[inline(always)]
    fn write_zeros(&mut self, i: usize) {
        let zero = F::zero();
        if let Some(targets) = &mut self.geometry {
            targets.means[i] = [zero; 3];
            targets.quats[i] = [zero; 4];
            targets.log_scales[i] = [zero; 3];
            targets.opacity_logits[i] = zero;
            targets.means2d[i] = [zero; 2];
        }
        let coeffs = self.splats.sh_coeffs();
        // Flattened, because a fill of triples is not vectorised.
        self.sh[i * coeffs..(i + 1) * coeffs].as_flattened_mut().fill(zero);
    }
}
