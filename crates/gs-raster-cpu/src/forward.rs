//! The forward pass: shade, composite every tile, assemble the images.

use crate::bins::{MACRO, MACRO_TILES, MacroTile, macro_grid};
use crate::lanes::{self, Lane, wide};
use crate::prepared::{Composited, Prepared};
use crate::shade::{ChannelLayout, HEAD, Shade};
use crate::tile::{self, Pass, TileState};
use crate::times::timed;
use crate::view::{TILE, TILE_PIXELS, View};
use gs_core::{RasterError, RenderOutput, RenderParams, Splats};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use std::time::Instant;

/// Largest number of channels per pass; more take several passes.
const MAX_CHANNELS: usize = 8;

/// Channels and kernel width of each pass over `channels` channels: kernels exist for 1, 3, 4, 6
/// and 8 channels, the rest is padding.
pub(crate) fn passes(channels: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..channels.max(1)).step_by(MAX_CHANNELS).map(move |first| {
        let left = channels.saturating_sub(first);
        (first, [1, 3, 4, 6].into_iter().find(|&size| left <= size).unwrap_or(MAX_CHANNELS))
    })
}

/// Channels with padding.
pub(crate) fn padded(channels: usize) -> usize {
    passes(channels).map(|(_, size)| size).sum()
}

/// Calls `$function::<S, F, C>` with the constant `C` equal to `$channels`.
macro_rules! with_channels {
    ($channels:expr, $function:ident::<$simd:ty, $float:ty>($($argument:expr),* $(,)?)) => {
        match $channels {
            1 => $function::<$simd, $float, 1>($($argument),*),
            3 => $function::<$simd, $float, 3>($($argument),*),
            4 => $function::<$simd, $float, 4>($($argument),*),
            6 => $function::<$simd, $float, 6>($($argument),*),
            _ => $function::<$simd, $float, 8>($($argument),*),
        }
    };
}
pub(crate) use with_channels;

/// Composites all tiles of one macro tile.
struct CompositeMacro<'a, F> {
    view: &'a View<F>,
    stride: usize,
    first_channel: usize,
    channels: usize,
    macro_id: usize,
    owner: &'a MacroTile,
    target: &'a mut Composited<F>,
}

impl<F: Lane> WithSimd for CompositeMacro<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        with_channels!(self.channels, composite_macro::<S, F>(s, self));
    }
}

#[inline(always)]
fn composite_macro<S: Simd, F: Lane, const C: usize>(s: S, job: CompositeMacro<'_, F>) {
    let CompositeMacro { view, stride, first_channel, macro_id, owner, target, .. } = job;
    let pass = Pass { records: &target.records, length: HEAD + stride, first_channel };
    for tile in 0..MACRO_TILES {
        let Some(first) = Prepared::tile_origin(view, macro_id, tile) else { continue };
        let first_plane = tile * stride + first_channel;
        let planes = target.planes.as_chunks_mut::<TILE_PIXELS>().0;
        let Some(planes) = planes[first_plane..].first_chunk_mut::<C>() else { continue };
        let state = TileState {
            planes,
            transmittance: &mut target.transmittance.as_chunks_mut::<TILE_PIXELS>().0[tile],
            stops: &mut target.stops.as_chunks_mut::<TILE_PIXELS>().0[tile],
        };
        let origin = first.map(|x| F::from_double(x as f64));
        let list = &owner.lists[tile];
        let size = [view.width, view.height];
        let evaluated = tile::composite::<S, F, C>(s, &pass, list, (first, size), origin, state);
        if first_channel == 0 {
            target.evaluated += evaluated;
        }
    }
}

/// Verifies that `splats` and `features` fit the prepared state.
pub(crate) fn check<F: Lane>(
    prepared: &Prepared<F>,
    splats: &Splats<F>,
    features: &[F],
) -> Result<(), RasterError> {
    splats.check_shapes()?;
    let shape = |what, found, expected| Err(RasterError::Shape { what, found, expected });
    if splats.len() != prepared.num_splats {
        return shape("splats", splats.len(), prepared.num_splats);
    }
    let rows = prepared.num_splats.max(1);
    if !features.len().is_multiple_of(rows) || (prepared.num_splats == 0 && !features.is_empty()) {
        let expected = features.len().div_ceil(rows) * prepared.num_splats;
        return shape("features", features.len(), expected);
    }
    Ok(())
}

/// Fills the records of all splats, and the lists again if opacities have grown.
pub(crate) fn shade<F: Lane>(
    prepared: &mut Prepared<F>,
    splats: &Splats<F>,
    features: &[F],
    params: &RenderParams,
) -> Result<(), RasterError> {
    check(prepared, splats, features)?;
    let layout = ChannelLayout::new(params, prepared.num_splats, features.len());
    let stride = padded(layout.channels());
    let covered = {
        let Prepared { shade, visible, rank_of, view, times, .. } = prepared;
        timed(&mut times.shade, || {
            shade.fill((visible, rank_of), view, splats, features, layout, stride)
        })
    };
    if !covered {
        for p in &mut prepared.visible {
            p.opacity = prepared.shade.opacity(p.id);
            p.log_opacity = p.opacity.ln();
        }
        prepared.bin();
    }
    prepared.composited.resize_with(prepared.macros.len(), Composited::default);
    Ok(())
}

/// Copies the records of a macro tile's items side by side.
pub(crate) fn gather<F: Lane>(shade: &Shade<F>, owner: &MacroTile, records: &mut Vec<F>) {
    // Copies of a length that is known at compile time, for the usual numbers of channels.
    match HEAD + shade.stride {
        7 => gather_chunks::<F, 7>(&shade.records, owner, records),
        9 => gather_chunks::<F, 9>(&shade.records, owner, records),
        10 => gather_chunks::<F, 10>(&shade.records, owner, records),
        12 => gather_chunks::<F, 12>(&shade.records, owner, records),
        14 => gather_chunks::<F, 14>(&shade.records, owner, records),
        length => {
            records.clear();
            for &rank in &owner.items {
                let start = rank as usize * length;
                records.extend_from_slice(&shade.records[start..start + length]);
            }
        }
    }
}

fn gather_chunks<F: Lane, const N: usize>(source: &[F], owner: &MacroTile, records: &mut Vec<F>) {
    records.resize(owner.items.len() * N, F::zero());
    let source = source.as_chunks::<N>().0;
    for (target, &rank) in records.as_chunks_mut::<N>().0.iter_mut().zip(&owner.items) {
        *target = source[rank as usize];
    }
}

pub(crate) fn forward<F: Lane>(
    prepared: &mut Prepared<F>,
    splats: &Splats<F>,
    features: &[F],
    params: &RenderParams,
    output: &mut RenderOutput<F>,
) -> Result<(), RasterError> {
    shade(prepared, splats, features, params)?;
    let Prepared { view, shade, macros, composited, times, .. } = &mut *prepared;
    let (layout, stride) = (shade.layout, shade.stride);
    let start = Instant::now();
    let arch = lanes::arch();
    composited.par_iter_mut().zip(&*macros).enumerate().for_each(|(macro_id, (target, owner))| {
        target.resize(stride);
        target.evaluated = 0;
        gather(shade, owner, &mut target.records);
        for (first_channel, channels) in passes(layout.channels()) {
            let target = &mut *target;
            arch.dispatch(CompositeMacro {
                view,
                stride,
                first_channel,
                channels,
                macro_id,
                owner,
                target,
            });
        }
    });
    times.composite = start.elapsed().as_secs_f64();
    timed(&mut times.assemble, || assemble(view, shade, composited, params, output));
    prepared.has_forward = true;
    Ok(())
}

/// Interleaves the planes of all tiles into row-major images.
fn assemble<F: Lane>(
    view: &View<F>,
    shade: &Shade<F>,
    composited: &[Composited<F>],
    params: &RenderParams,
    output: &mut RenderOutput<F>,
) {
    let layout = shade.layout;
    let (width, height) = (view.width, view.height);
    let pixels = width * height;
    (output.width, output.height, output.num_features) = (width, height, layout.features);
    output.rgb.resize(if layout.rgb { 3 * pixels } else { 0 }, F::zero());
    output.alpha.resize(pixels, F::zero());
    output.depth.resize(if layout.depth { pixels } else { 0 }, F::zero());
    output.features.resize(layout.features * pixels, F::zero());

    let background = params.background.map(F::from_double);
    let macros_across = macro_grid(view.tiles)[0];
    // A plane that was not requested has empty rows.
    let row_lengths = [
        if layout.rgb { 3 * width } else { 0 },
        width,
        if layout.depth { width } else { 0 },
        layout.features * width,
    ];
    let mut planes =
        [output.rgb.as_mut_slice(), &mut output.alpha, &mut output.depth, &mut output.features]
            .map(Some);
    rows_of(&mut planes, row_lengths, height, &|y, [rgb, alpha, depth, features]| {
        wide(
            #[inline(always)]
            || {
                for tx in 0..view.tiles[0] {
                    let ty = y / TILE;
                    let source = &composited[ty / MACRO * macros_across + tx / MACRO];
                    let tile = ty % MACRO * MACRO + tx % MACRO;
                    let (x0, row) = (tx * TILE, y % TILE * TILE);
                    let count = TILE.min(width - x0);
                    let plane = |channel: usize| {
                        let start = (tile * shade.stride + channel) * TILE_PIXELS + row;
                        &source.planes[start..start + count]
                    };
                    let transmittance = &source.transmittance
                        [tile * TILE_PIXELS + row..tile * TILE_PIXELS + row + count];
                    for (alpha, t) in alpha[x0..x0 + count].iter_mut().zip(transmittance) {
                        *alpha = F::one() - t.abs();
                    }
                    if layout.rgb {
                        let target = rgb[3 * x0..3 * (x0 + count)].as_chunks_mut::<3>().0;
                        let (r, g, b) = (plane(0), plane(1), plane(2));
                        // Mixed plane by plane, which vectorises, then interleaved.
                        let mut mixed = [[F::zero(); TILE]; 3];
                        for ((mixed, plane), background) in
                            mixed.iter_mut().zip([r, g, b]).zip(background)
                        {
                            for ((mixed, &x), t) in mixed.iter_mut().zip(plane).zip(transmittance) {
                                *mixed = x + t.abs() * background;
                            }
                        }
                        for (i, pixel) in target.iter_mut().enumerate() {
                            *pixel = [mixed[0][i], mixed[1][i], mixed[2][i]];
                        }
                    }
                    if layout.depth {
                        depth[x0..x0 + count].copy_from_slice(plane(layout.depth_at()));
                    }
                    for feature in 0..layout.features {
                        let values = plane(layout.features_at() + feature);
                        let target = features[x0 * layout.features + feature..].iter_mut();
                        for (target, &value) in target.step_by(layout.features).zip(values) {
                            *target = value;
                        }
                    }
                }
            },
        );
    });
}

/// Calls `action(y, rows)` for every image row, in parallel, with the row of each plane.
fn rows_of<F: Lane>(
    planes: &mut [Option<&mut [F]>; 4],
    row_lengths: [usize; 4],
    height: usize,
    action: &(impl Fn(usize, [&mut [F]; 4]) + Sync),
) {
    split_rows(
        planes.each_mut().map(|plane| plane.take().unwrap_or_default()),
        row_lengths,
        0..height,
        action,
    );
}

fn split_rows<F: Lane>(
    planes: [&mut [F]; 4],
    row_lengths: [usize; 4],
    rows: std::ops::Range<usize>,
    action: &(impl Fn(usize, [&mut [F]; 4]) + Sync),
) {
    if rows.len() <= TILE {
        let mut rest = planes;
        for y in rows {
            let mut k = 0;
            let heads = rest.each_mut().map(|plane| {
                let (head, tail) = std::mem::take(plane).split_at_mut(row_lengths[k]);
                *plane = tail;
                k += 1;
                head
            });
            action(y, heads);
        }
        return;
    }
    let middle = rows.start + rows.len() / 2;
    let mut k = 0;
    let mut lower = [const { None }; 4];
    let upper = planes.map(|plane| {
        let (head, tail) = plane.split_at_mut((middle - rows.start) * row_lengths[k]);
        lower[k] = Some(tail);
        k += 1;
        head
    });
    let lower = lower.map(Option::unwrap_or_default);
    rayon::join(
        || split_rows(upper, row_lengths, rows.start..middle, action),
        || split_rows(lower, row_lengths, middle..rows.end, action),
    );
}
