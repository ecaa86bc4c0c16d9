//! Forward pass: shade, composite, read back.

use crate::buffers::GrowBuffer;
use crate::channel_passes::{Channels, render_frame, row_chunks, to_u32};
use crate::commands::{Commands, read_with};
use crate::kernels::Kernel;
use crate::layout::{Frame, GROUP_SIZE};
use crate::prepared::{Forward, GpuPrepared};
use crate::{GpuContext, GpuError};
use gs_core::{RasterError, RenderOutput, RenderParams, Splats};

/// Verifies arguments against the prepared state.
pub(crate) fn check(
    context: &GpuContext,
    prepared: &GpuPrepared,
    splats: &Splats,
    features: &[f32],
) -> Result<(), RasterError> {
    prepared.check_owner(context)?;
    splats.check_shapes()?;
    let shape = |what, found, expected| Err(RasterError::Shape { what, found, expected });
    let num_splats = prepared.num_splats;
    if splats.len() != num_splats {
        return shape("splats", splats.len(), num_splats);
    }
    let rows = num_splats.max(1);
    if !features.len().is_multiple_of(rows) || (num_splats == 0 && !features.is_empty()) {
        return shape("features", features.len(), features.len().div_ceil(rows) * num_splats);
    }
    Ok(())
}

/// Split of the harmonics into bindings: first splat and number of
/// splats of each. Not read without colour.
pub(crate) fn sh_chunks(
    context: &GpuContext,
    num_splats: usize,
    rgb: bool,
    sh_degree: usize,
) -> Vec<(usize, usize)> {
    if !rgb {
        return vec![(0, num_splats)];
    }
    let row_bytes = 12 * gs_core::sh::num_coeffs(sh_degree);
    row_chunks(num_splats, row_bytes, context.max_binding_bytes())
}

/// Extends `buffers` to at least `count` buffers.
pub(crate) fn at_least(buffers: &mut Vec<GrowBuffer>, count: usize, make: impl Fn() -> GrowBuffer) {
    while buffers.len() < count {
        buffers.push(make());
    }
}

/// Uploads the values that may have changed since the preparation: opacities, harmonics, features.
pub(crate) fn upload_appearance(
    context: &GpuContext,
    prepared: &mut GpuPrepared,
    splats: &Splats,
    features: &[f32],
    params: &RenderParams,
) -> Result<(), RasterError> {
    check(context, prepared, splats, features)?;
    prepared.forward = None;
    prepared.resident = None;
    let channels = Channels::new(params, prepared.num_splats, features.len());
    upload(context, prepared, splats, features, channels)?;
    prepared.resident = Some(Forward { channels, sh_degree: splats.sh_degree });
    Ok(())
}

/// Verifies that the appearance on the device matches `params`, and allocates the planes.
pub(crate) fn begin(
    context: &GpuContext,
    prepared: &mut GpuPrepared,
    params: &RenderParams,
) -> Result<Forward, RasterError> {
    prepared.check_owner(context)?;
    prepared.forward = None;
    let forward = prepared.resident.ok_or(RasterError::NoForward)?;
    if (forward.channels.rgb, forward.channels.depth) != (params.rgb, params.depth) {
        return Err(RasterError::NoForward);
    }
    let bytes = image_bytes(prepared, forward.channels);
    let passes = forward.channels.passes();
    let pixels = prepared.num_pixels() as u64;
    let m = &mut prepared.memory;
    m.image.ensure(context, bytes)?;
    m.pixel_states.ensure(context, 8 * pixels)?;
    at_least(&mut m.colors, passes.len(), || GrowBuffer::storage("channels"));
    for (buffer, (_, width)) in m.colors.iter_mut().zip(passes) {
        buffer.ensure(context, (4 * width * prepared.num_splats) as u64)?;
    }
    Ok(forward)
}

/// Bytes of all planes.
pub(crate) fn image_bytes(prepared: &GpuPrepared, channels: Channels) -> u64 {
    4 * channels.planes(prepared.num_pixels()).iter().sum::<usize>() as u64
}

/// Shades and composites with the appearance on the device, and waits until the
/// lists are known to be complete. The planes stay on the device; with
/// `readback` they are also copied to host-visible memory.
pub(crate) fn composite(
    context: &GpuContext,
    prepared: &mut GpuPrepared,
    params: &RenderParams,
    readback: bool,
) -> Result<(), RasterError> {
    let forward = begin(context, prepared, params)?;
    let image_bytes = image_bytes(prepared, forward.channels);
    if readback {
        prepared.memory.image_staging.ensure(context, image_bytes)?;
    }
    loop {
        let mut commands = Commands::new(context);
        if prepared.stale {
            prepared.encode_prepare(context, &mut commands)?;
        }
        encode(context, prepared, &mut commands, params, forward)?;
        prepared.encode_counts(context, &mut commands)?;
        if readback {
            let m = &prepared.memory;
            let staging = m.image_staging.get(context)?;
            commands.copy((m.image.get(context)?, 0), (staging, 0), image_bytes);
        }
        let stamps = commands.submit(&mut prepared.memory.commands, "forward pass")?;
        let complete = prepared.check_room(context)?;
        prepared.timings = stamps.read(context)?;
        if complete {
            break;
        }
    }
    prepared.forward = Some(forward);
    Ok(())
}

fn upload(
    context: &GpuContext,
    prepared: &mut GpuPrepared,
    splats: &Splats,
    features: &[f32],
    channels: Channels,
) -> Result<(), GpuError> {
    let num_splats = prepared.num_splats;
    let m = &mut prepared.memory;
    m.opacity_logits.upload(context, &splats.opacity_logits)?;
    m.features.upload(context, features)?;
    let chunks = sh_chunks(context, num_splats, channels.rgb, splats.sh_degree);
    at_least(&mut m.sh, chunks.len(), || GrowBuffer::storage("harmonics"));
    let coeffs = splats.sh_coeffs();
    for (buffer, &(first, rows)) in m.sh.iter_mut().zip(&chunks) {
        let values =
            if channels.rgb { &splats.sh[first * coeffs..(first + rows) * coeffs] } else { &[] };
        buffer.upload(context, values)?;
    }
    Ok(())
}

/// Appends shade → rasterise.
pub(crate) fn encode(
    context: &GpuContext,
    prepared: &GpuPrepared,
    commands: &mut Commands<'_>,
    params: &RenderParams,
    Forward { channels, sh_degree }: Forward,
) -> Result<(), GpuError> {
    let frame = render_frame(prepared.frame, channels, params, sh_degree);
    let m = &prepared.memory;
    let projected = m.projected.get(context)?;
    let chunks = sh_chunks(context, prepared.num_splats, channels.rgb, sh_degree);
    for (colors, (first_channel, width)) in m.colors.iter().zip(channels.passes()) {
        let colors = colors.get(context)?;
        let frame = Frame { first_channel: to_u32(first_channel), ..frame };
        for (sh, &(first, rows)) in m.sh.iter().zip(&chunks) {
            let frame =
                Frame { first_splat: to_u32(first), num_chunk_splats: to_u32(rows), ..frame };
            let buffers = [
                m.means.get(context)?,
                m.opacity_logits.get(context)?,
                sh.get(context)?,
                m.features.get(context)?,
                projected,
                colors,
            ];
            let kernel = Kernel::shade(to_u32(width));
            commands.dispatch(kernel, &frame, &buffers, rows as u64, GROUP_SIZE)?;
        }
        let buffers = [
            m.tile_ranges.get(context)?,
            m.entries.get(context)?,
            projected,
            colors,
            m.image.get(context)?,
            m.pixel_states.get(context)?,
        ];
        let kernel = Kernel::rasterize(to_u32(width));
        commands.dispatch_groups(kernel, &frame, &buffers, frame.tile_bounds);
    }
    Ok(())
}

/// Copies the planes of the last [`composite`] to the host.
pub(crate) fn download(
    context: &GpuContext,
    prepared: &GpuPrepared,
    output: &mut RenderOutput,
) -> Result<(), RasterError> {
    let Some(forward) = prepared.forward else { return Err(RasterError::NoForward) };
    let [width, height] = prepared.frame.img_size.map(|side| side as usize);
    output.width = width;
    output.height = height;
    output.num_features = forward.channels.num_features;
    let lengths = forward.channels.planes(width * height);
    let bytes = 4 * lengths.iter().sum::<usize>() as u64;
    let staging = prepared.memory.image_staging.get(context)?;
    read_with(context, staging, bytes, "reading the image", |view| {
        let mut rest: &[f32] = bytemuck::cast_slice(view);
        let targets = [&mut output.rgb, &mut output.alpha, &mut output.depth, &mut output.features];
        for (target, length) in targets.into_iter().zip(lengths) {
            let (plane, after) = rest.split_at(length);
            target.clear();
            target.extend_from_slice(plane);
            rest = after;
        }
    })?;
    Ok(())
}
