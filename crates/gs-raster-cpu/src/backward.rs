//! The backward passes: gradients per tile, sums per splat in a fixed order,
//! then the chain rule of each splat (`splat_grads`).

use crate::bins::{BLOCK, MACRO_TILES, MacroTile};
use crate::forward::{check, gather, passes, shade, with_channels};
use crate::lanes::{self, Lane};
use crate::prepared::{Composited, Prepared};
use crate::shade::{ChannelLayout, HEAD};
use crate::splat_grads::{self, Scope};
use crate::tile::{Pass, TilePlane, clear};
use crate::tile_grad::{MOMENTS, Sums, TileUpstream, differentiate, differentiate_colors};
use crate::times::timed;
use crate::view::{TILE, TILE_PIXELS, View, dot};
use gs_core::{RasterError, RenderGrads, RenderParams, Splats, UpstreamGrads};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;
use std::time::Instant;

/// The tiles of one macro tile.
struct DifferentiateMacro<'a, F> {
    view: &'a View<F>,
    layout: ChannelLayout,
    stride: usize,
    first_channel: usize,
    channels: usize,
    macro_id: usize,
    owner: &'a MacroTile,
    target: &'a mut Composited<F>,
    upstream: &'a UpstreamGrads<F>,
    params: &'a RenderParams,
    scope: Scope,
}

impl<F: Lane> WithSimd for DifferentiateMacro<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        with_channels!(self.channels, differentiate_macro::<S, F>(s, self));
    }
}

#[inline(always)]
fn differentiate_macro<S: Simd, F: Lane, const C: usize>(s: S, job: DifferentiateMacro<'_, F>) {
    let DifferentiateMacro { view, layout, stride, first_channel, macro_id, target, .. } = job;
    let (upstream, params) = (job.upstream, job.params);
    let pass = Pass { records: &target.records, length: HEAD + stride, first_channel };
    // Reads all records once in order to bring them into the
    // cache; the tiles read them in list order.
    std::hint::black_box(target.records.iter().step_by(16).copied().sum::<F>());
    let mut sums = Sums { values: &mut target.sums, stride: MOMENTS + stride };
    let mut v_channels = [TilePlane::<F>::zero(); C];
    for tile in 0..MACRO_TILES {
        let Some(first) = Prepared::tile_origin(view, macro_id, tile) else { continue };
        let list = &job.owner.lists[tile];
        if list.items.is_empty() {
            continue;
        }
        let pixels = TilePixels { view, first };
        let mut loaded = 0;
        if first_channel == 0
            && layout.rgb
            && let Some(planes) = v_channels.first_chunk_mut()
        {
            pixels.load_rgb(upstream, planes);
            loaded = 3;
        }
        for (c, plane) in v_channels.iter_mut().enumerate().skip(loaded) {
            pixels.load_channel(upstream, layout, first_channel + c, plane);
        }
        let origin = first.map(|x| F::from_double(x as f64));
        match job.scope {
            Scope::Everything => {
                let stored = target.transmittance.as_chunks::<TILE_PIXELS>().0[tile];
                let mut transmittance = TilePlane(stored);
                for t in &mut transmittance.0 {
                    *t = t.abs();
                }
                let mut behind = TilePlane::zero();
                if first_channel == 0 {
                    pixels.load_behind(upstream, params, layout, &transmittance, &mut behind);
                }
                let tile_upstream = TileUpstream {
                    channels: &v_channels,
                    transmittance: &mut transmittance,
                    behind: &mut behind,
                    stops: &target.stops.as_chunks::<TILE_PIXELS>().0[tile],
                };
                let convention = params.gradients;
                differentiate::<S, F, C>(
                    s,
                    &pass,
                    list,
                    origin,
                    tile_upstream,
                    convention,
                    &mut sums,
                );
            }
            Scope::Colors => {
                let mut transmittance = TilePlane::zero();
                clear(&mut transmittance.0, first, [view.width, view.height]);
                differentiate_colors::<S, F, C>(
                    s,
                    &pass,
                    list,
                    origin,
                    &v_channels,
                    &mut transmittance,
                    &mut sums,
                );
            }
        }
    }
}

/// The pixels of a tile that lie inside the image.
struct TilePixels<'a, F> {
    view: &'a View<F>,
    first: [usize; 2],
}

impl<F: Lane> TilePixels<'_, F> {
    /// Calls `action(first pixel of the image, pixels of the tile)` for every row.
    #[inline(always)]
    fn visit(&self, mut action: impl FnMut(usize, Range<usize>)) {
        let [x0, y0] = self.first;
        let width = TILE.min(self.view.width - x0);
        for row in 0..TILE.min(self.view.height - y0) {
            action((y0 + row) * self.view.width + x0, row * TILE..row * TILE + width);
        }
    }

    /// Upstream gradients of the colour; zero outside the image.
    #[inline(always)]
    fn load_rgb(&self, upstream: &UpstreamGrads<F>, planes: &mut [TilePlane<F>; 3]) {
        for plane in &mut *planes {
            plane.0.fill(F::zero());
        }
        if upstream.v_rgb.is_empty() {
            return;
        }
        let [r, g, b] = planes;
        self.visit(|pixel, row| {
            let values = upstream.v_rgb[3 * pixel..].as_chunks::<3>().0;
            let targets = r.0[row.clone()].iter_mut().zip(&mut g.0[row.clone()]).zip(&mut b.0[row]);
            for (((r, g), b), value) in targets.zip(values) {
                (*r, *g, *b) = (value[0], value[1], value[2]);
            }
        });
    }

    /// Upstream gradient of a channel; zero outside the image and for padding.
    #[inline(always)]
    fn load_channel(
        &self,
        upstream: &UpstreamGrads<F>,
        layout: ChannelLayout,
        channel: usize,
        plane: &mut TilePlane<F>,
    ) {
        plane.0.fill(F::zero());
        let (source, step, offset) = if channel < layout.depth_at() {
            (&upstream.v_rgb, 3, channel)
        } else if channel < layout.features_at() {
            (&upstream.v_depth, 1, 0)
        } else if channel < layout.channels() {
            (&upstream.v_features, layout.features, channel - layout.features_at())
        } else {
            return;
        };
        if !source.is_empty() {
            self.visit(|pixel, row| {
                let values = source[pixel * step + offset..].iter().step_by(step);
                for (target, &value) in plane.0[row].iter_mut().zip(values) {
                    *target = value;
                }
            });
        }
    }

    /// `T_final · (background·g_rgb − g_alpha)`.
    #[inline(always)]
    fn load_behind(
        &self,
        upstream: &UpstreamGrads<F>,
        params: &RenderParams,
        layout: ChannelLayout,
        transmittance: &TilePlane<F>,
        behind: &mut TilePlane<F>,
    ) {
        if !upstream.v_alpha.is_empty() {
            self.visit(|pixel, row| {
                for (target, &value) in behind.0[row].iter_mut().zip(&upstream.v_alpha[pixel..]) {
                    *target = -value;
                }
            });
        }
        if layout.rgb && !upstream.v_rgb.is_empty() {
            let background = params.background.map(F::from_double);
            self.visit(|pixel, row| {
                let values = upstream.v_rgb[3 * pixel..].as_chunks::<3>().0;
                for (target, &value) in behind.0[row].iter_mut().zip(values) {
                    *target += dot(background, value);
                }
            });
        }
        for (behind, &t) in behind.0.iter_mut().zip(&transmittance.0) {
            *behind *= t;
        }
    }
}

/// Verifies the upstream planes against the last forward pass.
fn check_upstream<F: Lane>(
    prepared: &Prepared<F>,
    layout: ChannelLayout,
    upstream: &UpstreamGrads<F>,
) -> Result<(), RasterError> {
    if !prepared.has_forward || prepared.shade.layout != layout {
        return Err(RasterError::NoForward);
    }
    let pixels = prepared.view.width * prepared.view.height;
    for (what, plane, expected) in [
        ("v_rgb", &upstream.v_rgb, if layout.rgb { 3 * pixels } else { 0 }),
        ("v_alpha", &upstream.v_alpha, pixels),
        ("v_depth", &upstream.v_depth, if layout.depth { pixels } else { 0 }),
        ("v_features", &upstream.v_features, layout.features * pixels),
    ] {
        if !plane.is_empty() && plane.len() != expected {
            return Err(RasterError::Shape { what, found: plane.len(), expected });
        }
    }
    Ok(())
}

pub(crate) fn backward<F: Lane>(
    prepared: &mut Prepared<F>,
    splats: &Splats<F>,
    features: &[F],
    params: &RenderParams,
    upstream: &UpstreamGrads<F>,
    scope: Scope,
    grads: &mut RenderGrads<F>,
) -> Result<(), RasterError> {
    check(prepared, splats, features)?;
    let layout = ChannelLayout::new(params, prepared.num_splats, features.len());
    check_upstream(prepared, layout, upstream)?;
    let stride = prepared.shade.stride;

    let start = Instant::now();
    // Channels after the last one with a gradient are zero and skipped: depth
    // costs nothing here if it is not differentiated.
    let used = layout.used(upstream);
    let Prepared { view, macros, composited, .. } = &mut *prepared;
    let arch = lanes::arch();
    composited.par_iter_mut().zip(&*macros).enumerate().for_each(|(macro_id, (target, owner))| {
        target.sums.clear();
        target.sums.resize(owner.items.len() * (MOMENTS + stride), F::zero());
        for (first_channel, channels) in passes(used) {
            let target = &mut *target;
            arch.dispatch(DifferentiateMacro {
                view,
                layout,
                stride,
                first_channel,
                channels,
                macro_id,
                owner,
                target,
                upstream,
                params,
                scope,
            });
        }
    });
    let mut times = prepared.times;
    times.differentiate = start.elapsed().as_secs_f64();
    timed(&mut times.collect, || collect(prepared, MOMENTS + stride));
    timed(&mut times.chain, || {
        splat_grads::write(prepared, splats, params.gradients, scope, MOMENTS + stride, grads);
    });
    prepared.times = times;
    Ok(())
}

/// Sums of the pixels of `planes` per splat, without a forward pass.
pub(crate) fn lift<F: Lane>(
    prepared: &mut Prepared<F>,
    splats: &Splats<F>,
    planes: &UpstreamGrads<F>,
    channels: usize,
    sums: &mut RenderGrads<F>,
) -> Result<(), RasterError> {
    let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
    let features = vec![F::zero(); splats.len() * channels];
    shade(prepared, splats, &features, &params)?;
    let Prepared { shade, macros, composited, .. } = &mut *prepared;
    composited
        .par_iter_mut()
        .zip(&*macros)
        .for_each(|(target, owner)| gather(shade, owner, &mut target.records));
    prepared.has_forward = true;
    let scope = Scope::Colors;
    let lifted = backward(prepared, splats, &features, &params, planes, scope, sums);
    prepared.has_forward = false;
    lifted
}

/// Adds up the contributions of the macro tiles to every splat, macro tile by macro tile, so that
/// the order does not depend on the number of threads.
fn collect<F: Lane>(prepared: &mut Prepared<F>, stride: usize) {
    let Prepared { sums, visible, blocks, macros, composited, .. } = prepared;
    sums.clear();
    sums.resize(visible.len() * stride, F::zero());
    sums.par_chunks_mut(BLOCK * stride).zip(&*blocks).enumerate().for_each(
        |(number, (run, block))| {
            for (macro_id, (owner, composited)) in macros.iter().zip(&*composited).enumerate() {
                let ranks = block.items_of(macro_id);
                let first = owner.block_starts[number] as usize;
                let shares = composited.sums[first * stride..].chunks_exact(stride);
                for (&rank, share) in ranks.iter().zip(shares) {
                    let start = (rank as usize - number * BLOCK) * stride;
                    for (sum, &x) in run[start..start + stride].iter_mut().zip(share) {
                        *sum += x;
                    }
                }
            }
        },
    );
}
