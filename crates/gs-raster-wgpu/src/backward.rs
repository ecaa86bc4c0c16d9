//! Backward pass: upload of upstream gradients, tiles, projection, download of gradients.

use crate::buffers::{GrowBuffer, write};
use crate::channel_passes::{Channels, render_frame, to_u32};
use crate::commands::{Commands, read_with};
use crate::forward::{at_least, check, sh_chunks};
use crate::kernels::Kernel;
use crate::layout::{Frame, GROUP_SIZE};
use crate::prepared::{Forward, GpuPrepared};
use crate::{GpuContext, GpuError};
use gs_core::{RasterError, RenderGrads, RenderParams, Splats, UpstreamGrads};

/// Means, quaternions, log-scales, opacities, projected centres.
pub(crate) const PARAMS: usize = 3 + 4 + 3 + 1 + 2;
/// Memory limit for gradients of pairs, bytes; with more pairs
/// the tiles are processed several times.
const MAX_SLOT_BYTES: u64 = 1 << 30;

/// Whether geometry and opacity are also differentiated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    Everything,
    Colors,
}

/// Arguments of a backward pass.
pub(crate) struct BackwardRequest<'a> {
    pub splats: &'a Splats,
    pub features: &'a [f32],
    pub params: &'a RenderParams,
    pub upstream: &'a UpstreamGrads,
    pub scope: Scope,
}

/// Computes gradients and copies them to `grads`.
pub(crate) fn run(
    context: &GpuContext,
    prepared: &mut GpuPrepared,
    request: &BackwardRequest<'_>,
    grads: &mut RenderGrads,
) -> Result<(), RasterError> {
    check(context, prepared, request.splats, request.features)?;
    let num_splats = prepared.num_splats;
    let channels = Channels::new(request.params, num_splats, request.features.len());
    let forward = Forward { channels, sh_degree: request.splats.sh_degree };
    if prepared.forward != Some(forward) {
        return Err(RasterError::NoForward);
    }
    upload(context, prepared, request.upstream, channels)?;
    let mut commands = Commands::new(context);
    encode(context, prepared, &mut commands, request.params, forward, request.scope)?;
    let geometry = request.scope == Scope::Everything;
    encode_readback(context, prepared, &mut commands, forward, geometry)?;
    let stamps = commands.submit(&mut prepared.memory.commands, "backward pass")?;
    download(context, prepared, forward, geometry, grads)?;
    if !channels.rgb {
        grads.v_sh.resize(request.splats.sh.len(), [0.0; 3]);
    }
    prepared.timings = stamps.read(context)?;
    Ok(())
}

/// Appends the whole backward pass; gradients stay on the device.
pub(crate) fn encode(
    context: &GpuContext,
    prepared: &mut GpuPrepared,
    commands: &mut Commands<'_>,
    params: &RenderParams,
    forward: Forward,
    scope: Scope,
) -> Result<(), GpuError> {
    ensure(context, prepared, forward)?;
    let frame = render_frame(prepared.frame, forward.channels, params, forward.sh_degree);
    let geometry = scope == Scope::Everything;
    encode_tiles(context, prepared, commands, frame, forward.channels, geometry)?;
    encode_splats(context, prepared, commands, frame, forward, geometry)
}

/// Verifies and uploads the upstream planes; an empty one is zero.
fn upload(
    context: &GpuContext,
    prepared: &mut GpuPrepared,
    upstream: &UpstreamGrads,
    channels: Channels,
) -> Result<(), RasterError> {
    let lengths = channels.planes(prepared.num_pixels());
    let planes = [
        ("v_rgb", &upstream.v_rgb),
        ("v_alpha", &upstream.v_alpha),
        ("v_depth", &upstream.v_depth),
        ("v_features", &upstream.v_features),
    ];
    for ((what, plane), expected) in planes.iter().zip(lengths) {
        if !plane.is_empty() && plane.len() != expected {
            return Err(RasterError::Shape { what, found: plane.len(), expected });
        }
    }
    let bytes = 4 * lengths.iter().sum::<usize>() as u64;
    let buffer = prepared.memory.v_image.ensure(context, bytes)?;
    let mut offset = 0;
    for ((_, plane), length) in planes.iter().zip(lengths) {
        if plane.is_empty() {
            write(context, buffer, offset, &vec![0; 4 * length]);
        } else {
            write(context, buffer, offset, bytemuck::cast_slice(plane));
        }
        offset += 4 * length as u64;
    }
    Ok(())
}

fn ensure(
    context: &GpuContext,
    prepared: &mut GpuPrepared,
    forward: Forward,
) -> Result<(), GpuError> {
    let (rows, channels) = (prepared.num_splats, forward.channels);
    let m = &mut prepared.memory;
    m.splat_grads.ensure(context, (4 * rows * channels.grad_stride()) as u64)?;
    m.v_params.ensure(context, (4 * rows * PARAMS) as u64)?;
    m.v_features.ensure(context, (4 * rows * channels.num_features) as u64)?;
    let chunks = sh_chunks(context, rows, channels.rgb, forward.sh_degree);
    at_least(&mut m.v_sh, chunks.len(), || GrowBuffer::storage("gradients of harmonics"));
    for (buffer, (_, rows)) in m.v_sh.iter_mut().zip(chunks) {
        buffer.ensure(context, sh_bytes(forward, rows))?;
    }
    Ok(())
}

/// Bytes of the harmonics of `rows` splats, 0 without colour.
fn sh_bytes(forward: Forward, rows: usize) -> u64 {
    let coeffs = gs_core::sh::num_coeffs(forward.sh_degree);
    if forward.channels.rgb { (12 * coeffs * rows) as u64 } else { 0 }
}

/// Gradients of the projected quantities.
fn encode_tiles(
    context: &GpuContext,
    prepared: &mut GpuPrepared,
    commands: &mut Commands<'_>,
    frame: Frame,
    channels: Channels,
    geometry: bool,
) -> Result<(), GpuError> {
    let needs = context.features();
    let num_isects = u64::from(prepared.num_isects);
    let budget = context.max_binding_bytes().min(MAX_SLOT_BYTES);
    let quads = |width: usize| (width / 4 + if geometry { 2 } else { 0 }) as u64;
    let slots_per_run = |width: usize| (budget / (16 * quads(width))).max(1);
    if !needs.float_atomics {
        let bytes = channels
            .passes()
            .iter()
            .map(|&(_, width)| 16 * quads(width) * num_isects.min(slots_per_run(width)))
            .max();
        prepared.memory.slots.ensure(context, bytes.unwrap_or(0))?;
    }
    let m = &prepared.memory;
    let splat_grads = m.splat_grads.get(context)?;
    let rows = u64::from(frame.num_splats);
    commands.clear(splat_grads, 4 * rows * u64::from(frame.grad_stride));
    for (colors, (first_channel, width)) in m.colors.iter().zip(channels.passes()) {
        let frame = Frame { first_channel: to_u32(first_channel), ..frame };
        let kernel = Kernel::rasterize_bwd(to_u32(width), geometry, needs);
        let mut buffers =
            vec![m.tile_ranges.get(context)?, m.entries.get(context)?, m.projected.get(context)?];
        if geometry {
            buffers.push(colors.get(context)?);
        }
        buffers.extend([m.pixel_states.get(context)?, m.v_image.get(context)?]);
        if needs.float_atomics {
            buffers.push(splat_grads);
            commands.dispatch_groups(kernel, &frame, &buffers, frame.tile_bounds);
            continue;
        }
        let slots = m.slots.get(context)?;
        buffers.push(slots);
        let (mut first, run) = (0, slots_per_run(width));
        while first < num_isects {
            let num_slots = run.min(num_isects - first);
            let frame = Frame {
                first_slot: u32::try_from(first).unwrap_or(u32::MAX),
                num_slots: u32::try_from(num_slots).unwrap_or(u32::MAX),
                ..frame
            };
            commands.clear(slots, 16 * quads(width) * num_slots);
            commands.dispatch_groups(kernel, &frame, &buffers, frame.tile_bounds);
            let splat_ids = m.depth_sort.values[m.depth_result].get(context)?;
            let sums = [m.isect_offsets.get(context)?, splat_ids, slots, splat_grads];
            let kernel = Kernel::sum_slots(to_u32(width), geometry);
            commands.dispatch(kernel, &frame, &sums, rows * quads(width), GROUP_SIZE)?;
            first += num_slots;
        }
    }
    Ok(())
}

/// Gradients of the stored parameters.
fn encode_splats(
    context: &GpuContext,
    prepared: &GpuPrepared,
    commands: &mut Commands<'_>,
    frame: Frame,
    forward: Forward,
    geometry: bool,
) -> Result<(), GpuError> {
    let (rows, channels) = (prepared.num_splats, forward.channels);
    let m = &prepared.memory;
    let (projected, splat_grads) = (m.projected.get(context)?, m.splat_grads.get(context)?);
    let (v_params, v_features) = (m.v_params.get(context)?, m.v_features.get(context)?);
    for (i, (first, rows)) in
        sh_chunks(context, rows, channels.rgb, forward.sh_degree).into_iter().enumerate()
    {
        let frame = Frame { first_splat: to_u32(first), num_chunk_splats: to_u32(rows), ..frame };
        let (sh, v_sh) = (m.sh[i].get(context)?, m.v_sh[i].get(context)?);
        let means = m.means.get(context)?;
        let buffers = [means, sh, projected, splat_grads, v_sh, v_features, v_params];
        commands.dispatch(Kernel::ShadeBwd, &frame, &buffers, rows as u64, GROUP_SIZE)?;
    }
    if geometry {
        let buffers = [
            m.means.get(context)?,
            m.quats.get(context)?,
            m.log_scales.get(context)?,
            m.opacity_logits.get(context)?,
            projected,
            splat_grads,
            v_params,
        ];
        commands.dispatch(Kernel::ProjectBwd, &frame, &buffers, rows as u64, GROUP_SIZE)?;
    }
    Ok(())
}

/// Appends the copies of the gradients to host-visible memory.
fn encode_readback(
    context: &GpuContext,
    prepared: &mut GpuPrepared,
    commands: &mut Commands<'_>,
    forward: Forward,
    geometry: bool,
) -> Result<(), GpuError> {
    let (rows, channels) = (prepared.num_splats, forward.channels);
    let chunks = sh_chunks(context, rows, channels.rgb, forward.sh_degree);
    let m = &mut prepared.memory;
    at_least(&mut m.v_sh_staging, chunks.len(), || {
        GrowBuffer::staging("gradients of harmonics, for reading")
    });
    for ((from, to), (_, rows)) in m.v_sh.iter().zip(&mut m.v_sh_staging).zip(chunks) {
        let bytes = sh_bytes(forward, rows);
        commands.copy((from.get(context)?, 0), (to.ensure(context, bytes)?, 0), bytes);
    }
    let bytes = (4 * rows * channels.num_features) as u64;
    let to = m.v_features_staging.ensure(context, bytes)?;
    commands.copy((m.v_features.get(context)?, 0), (to, 0), bytes);
    if geometry {
        let bytes = (4 * rows * PARAMS) as u64;
        let to = m.v_params_staging.ensure(context, bytes)?;
        commands.copy((m.v_params.get(context)?, 0), (to, 0), bytes);
    }
    Ok(())
}

/// Moves the first `rows` rows of `rest` to `target`.
fn take<T: bytemuck::Pod>(rest: &mut &[u8], rows: usize, target: &mut Vec<T>) {
    let (head, tail) = rest.split_at(rows * size_of::<T>());
    target.extend_from_slice(bytemuck::cast_slice(head));
    *rest = tail;
}

fn download(
    context: &GpuContext,
    prepared: &GpuPrepared,
    forward: Forward,
    geometry: bool,
    grads: &mut RenderGrads,
) -> Result<(), GpuError> {
    let (rows, m) = (prepared.num_splats, &prepared.memory);
    grads.v_means.clear();
    grads.v_quats.clear();
    grads.v_log_scales.clear();
    grads.v_opacity_logits.clear();
    grads.v_sh.clear();
    grads.v_features.clear();
    grads.v_means2d.clear();
    let during = "reading gradients";
    if geometry {
        let bytes = (4 * rows * PARAMS) as u64;
        read_with(context, m.v_params_staging.get(context)?, bytes, during, |mut rest| {
            take(&mut rest, rows, &mut grads.v_means);
            take(&mut rest, rows, &mut grads.v_quats);
            take(&mut rest, rows, &mut grads.v_log_scales);
            take(&mut rest, rows, &mut grads.v_opacity_logits);
            take(&mut rest, rows, &mut grads.v_means2d);
        })?;
    }
    let chunks = sh_chunks(context, rows, forward.channels.rgb, forward.sh_degree);
    for (staging, (_, rows)) in m.v_sh_staging.iter().zip(chunks) {
        let bytes = sh_bytes(forward, rows);
        read_with(context, staging.get(context)?, bytes, during, |view| {
            grads.v_sh.extend_from_slice(bytemuck::cast_slice(view));
        })?;
    }
    let bytes = (4 * rows * forward.channels.num_features) as u64;
    read_with(context, m.v_features_staging.get(context)?, bytes, during, |view| {
        grads.v_features.extend_from_slice(bytemuck::cast_slice(view));
    })
}
