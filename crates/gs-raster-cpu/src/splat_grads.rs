//! From the pixel stage's sums to the gradients of every splat's stored parameters.

use crate::backward::Scope;
use crate::lanes::{Lane, wide};
use crate::prepared::Prepared;
use crate::project_grad::{SplatGrads, project_gradient};
use crate::shade::DEAD;
use crate::tile_grad::MOMENTS;
use crate::view::{View, dot, each};
use gs_core::{GradientConvention, RenderGrads, Splats, sh};
use rayon::prelude::*;

/// Splats differentiated at once.
const CHUNK: usize = 64;

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
    if scope == Scope::Colors {
        grads.v_sh.par_chunks_mut(CHUNK * coeffs).enumerate().for_each(|(chunk, rows)| {
            wide(
                #[inline(always)]
                || {
                    let fetched = fetch(prepared, chunk, stride);
                    for (i, row) in rows.chunks_exact_mut(coeffs).enumerate() {
                        write_sh(prepared, splats, chunk * CHUNK + i, fetched[i].as_ref(), row);
                    }
                },
            );
        });
        return;
    }

    let RenderGrads { v_means, v_quats, v_log_scales, v_opacity_logits, v_means2d, v_sh, .. } =
        grads;
    v_means
        .par_chunks_mut(CHUNK)
        .zip(v_quats.par_chunks_mut(CHUNK))
        .zip(v_log_scales.par_chunks_mut(CHUNK))
        .zip(v_opacity_logits.par_chunks_mut(CHUNK))
        .zip(v_means2d.par_chunks_mut(CHUNK))
        .zip(v_sh.par_chunks_mut(CHUNK * coeffs))
        .enumerate()
        .for_each(|(chunk, (((((means, quats), log_scales), opacity_logits), means2d), rows))| {
            wide(
                #[inline(always)]
                || {
                    let fetched = fetch(prepared, chunk, stride);
                    for (i, row) in rows.chunks_exact_mut(coeffs).enumerate() {
                        let id = chunk * CHUNK + i;
                        let own = match &fetched[i] {
                            Some(sums) => splat_gradient(prepared, splats, id, sums, convention),
                            None => SplatGrads::zero(),
                        };
                        means[i] = own.mean;
                        quats[i] = own.quat;
                        log_scales[i] = own.log_scale;
                        opacity_logits[i] = own.opacity_logit;
                        means2d[i] = own.mean2d;
                        write_sh(prepared, splats, id, fetched[i].as_ref(), row);
                    }
                },
            );
        });
}

/// Gradient of the harmonics of splat `id`.
#[inline(always)]
fn write_sh<F: Lane>(
    prepared: &Prepared<F>,
    splats: &Splats<F>,
    id: usize,
    sums: Option<&SplatSums<F>>,
    row: &mut [[F; 3]],
) {
    let Some(SplatSums { rgb, .. }) = sums.filter(|_| prepared.shade.layout.rgb) else {
        row.fill([F::zero(); 3]);
        return;
    };
    let (direction, _) = prepared.view.direction(splats.means[id]);
    for (target, y) in row.iter_mut().zip(sh::basis(splats.sh_degree, direction)) {
        *target = [y * rgb[0], y * rgb[1], y * rgb[2]];
    }
}

/// What the pixel stage says about one splat.
#[derive(Clone, Copy)]
struct SplatSums<F> {
    moments: [F; MOMENTS],
    /// Zero where the colour was clamped.
    rgb: [F; 3],
    depth: F,
}

/// The sums of a chunk of splats, `None` for those that draw nothing. They lie in depth order; fetched in one go, their cache misses
/// overlap.
#[inline(always)]
fn fetch<F: Lane>(
    prepared: &Prepared<F>,
    chunk: usize,
    stride: usize,
) -> [Option<SplatSums<F>>; CHUNK] {
    let layout = prepared.shade.layout;
    let ids = chunk * CHUNK..prepared.num_splats.min((chunk + 1) * CHUNK);
    let ranks = prepared.rank_of[ids.clone()].iter().zip(&prepared.shade.flags[ids]);
    let mut out = [None; CHUNK];
    for (out, (&rank, &flags)) in out.iter_mut().zip(ranks) {
        if flags & DEAD != 0 {
            continue;
        }
        let sums = &prepared.sums[rank as usize * stride..(rank as usize + 1) * stride];
        let Some((moments, channels)) = sums.split_first_chunk::<MOMENTS>() else { continue };
        let open = |c: usize| layout.rgb && flags >> c & 1 == 0;
        *out = Some(SplatSums {
            moments: *moments,
            rgb: each(|c| if open(c) { channels[c] } else { F::zero() }),
            depth: if layout.depth { channels[layout.depth_at()] } else { F::zero() },
        });
    }
    out
}

/// All geometric gradients of one splat.
#[inline(always)]
fn splat_gradient<F: Lane>(
    prepared: &Prepared<F>,
    splats: &Splats<F>,
    id: usize,
    sums: &SplatSums<F>,
    convention: GradientConvention,
) -> SplatGrads<F> {
    let view = &prepared.view;
    let mut v = project_gradient(view, splats, id, &sums.moments, convention);
    let mut through = [F::zero(); 3];
    if prepared.shade.layout.rgb {
        through = direction_gradient(view, splats, id, sums.rgb);
    }
    v.mean = each(|k| v.mean[k] + sums.depth * view.rows[2][k] + through[k]);
    // Covariances near the end of the number range overflow here; such a splat has no usable gradient.
    if v.is_finite() { v } else { SplatGrads::zero() }
}

/// Gradient of the mean through the direction that the colour is seen from.
#[inline(always)]
fn direction_gradient<F: Lane>(
    view: &View<F>,
    splats: &Splats<F>,
    id: usize,
    v_rgb: [F; 3],
) -> [F; 3] {
    let (d, length) = view.direction(splats.means[id]);
    let gradient = sh::basis_gradient(splats.sh_degree, d);
    let mut v_d = [F::zero(); 3];
    for (row, gradient) in
        splats.sh_of(id).iter().zip(&gradient[..sh::num_coeffs(splats.sh_degree)])
    {
        let v_y = row[0] * v_rgb[0] + row[1] * v_rgb[1] + row[2] * v_rgb[2];
        for k in 0..3 {
            v_d[k] += gradient[k] * v_y;
        }
    }
    let along = dot(d, v_d);
    each(|k| (v_d[k] - d[k] * along) / length)
}
