//! Splats that stay on the device: further views of them, passes appended to other commands, and
//! buffers of parameters and gradients.

use crate::backward::{self, Scope};
use crate::buffers::GrowBuffer;
use crate::commands::Commands;
use crate::forward;
use crate::plan::Channels;
use crate::prepared::{Forward, GpuPrepared};
use crate::primitives::download;
use crate::{GpuError, WgpuRasterizer};
use gs_core::{Camera, RasterError, RenderParams, Splats, sh};

/// A group of stored parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// `[N,3]`.
    Means,
    /// `[N,4]`.
    Quats,
    /// `[N,3]`.
    LogScales,
    /// `[N]`.
    OpacityLogits,
    /// `[N,K,3]`.
    Sh,
}

/// Rows of a group on the device, 32-bit floats. Groups larger than
/// a binding are split into several slices.
#[derive(Debug, Clone, Copy)]
pub struct ParameterSlice<'a> {
    /// `[rows, columns]`, from the start of the buffer.
    pub values: &'a wgpu::Buffer,
    /// Buffer in which the backward pass writes the gradient.
    pub grads: &'a wgpu::Buffer,
    /// First value of the gradient in its buffer.
    pub first_grad: usize,
    /// Splat of the first row.
    pub first_row: usize,
    /// Number of splats.
    pub rows: usize,
    /// Values per splat.
    pub columns: usize,
}

impl WgpuRasterizer {
    /// Uploads harmonics, opacities and features for the forward passes that `params` describes,
    /// without running one.
    ///
    /// # Errors
    /// If shapes disagree with the prepared state, or the device fails.
    pub fn upload_appearance(
        &self,
        prepared: &mut GpuPrepared,
        splats: &Splats,
        features: &[f32],
        params: &RenderParams,
    ) -> Result<(), RasterError> {
        forward::upload_appearance(self.context(), prepared, splats, features, params)
    }

    /// Makes forward passes composite only `num_features` channels per splat (neither colour nor
    /// depth; opacities are those of the preparation), written by other passes. Returns their
    /// buffer, `[N,F]`, with undefined initial values.
    ///
    /// # Errors
    /// If the device has too little memory.
    pub fn features_on_device(
        &self,
        prepared: &mut GpuPrepared,
        num_features: usize,
    ) -> Result<wgpu::Buffer, RasterError> {
        let context = self.context();
        prepared.check_owner(context)?;
        prepared.forward = None;
        prepared.resident = None;
        prepared.unshare_features();
        let rows = prepared.num_splats;
        let m = &mut prepared.memory;
        // Bound but not read.
        forward::at_least(&mut m.sh, 1, || GrowBuffer::storage("harmonics"));
        m.sh[0].ensure(context, 0)?;
        let buffer = m.features.ensure(context, 4 * (rows * num_features) as u64)?.clone();
        let channels = Channels { rgb: false, depth: false, num_features };
        prepared.resident = Some(Forward { channels, sh_degree: 0 });
        Ok(buffer)
    }

    /// Buffer in which the backward pass writes the gradient of the features, `[N,F]`.
    ///
    /// # Errors
    /// If there was no backward pass.
    pub fn feature_grads<'a>(
        &self,
        prepared: &'a GpuPrepared,
    ) -> Result<&'a wgpu::Buffer, RasterError> {
        Ok(prepared.memory.v_features.get(self.context())?)
    }

    /// The splats of `of` prepared for another camera. Uploads nothing:
    /// parameters are **shared**, so an optimiser's changes affect all views. (A
    /// later upload to one view does not change the others.)
    ///
    /// # Errors
    /// If the camera is malformed or the device has too little memory.
    pub fn prepare_view(
        &self,
        of: &mut GpuPrepared,
        camera: &Camera,
    ) -> Result<GpuPrepared, RasterError> {
        camera.check()?;
        of.check_owner(self.context())?;
        Ok(of.share(self.context(), camera)?)
    }

    /// Must be called after other passes change geometry on the device: the next forward pass then
    /// projects again and rebuilds the lists.
    pub fn geometry_changed(&self, prepared: &mut GpuPrepared) {
        prepared.stale = true;
        prepared.forward = None;
    }

    /// Appends a forward pass with the parameters on the device. Lists that
    /// are out of date are rebuilt first, in a separate submission that waits
    /// for two counts; otherwise nothing is read back.
    ///
    /// # Errors
    /// [`RasterError::NoForward`] if no appearance with the channels of `params` is on the device;
    /// otherwise if the device fails.
    pub fn encode_forward(
        &self,
        prepared: &mut GpuPrepared,
        commands: &mut Commands<'_>,
        params: &RenderParams,
    ) -> Result<(), RasterError> {
        self.finish_preparation(prepared)?;
        let forward = forward::begin(self.context(), prepared, params)?;
        forward::encode(self.context(), prepared, commands, params, forward)?;
        let bytes = forward::image_bytes(prepared, forward.channels);
        prepared.memory.v_image.ensure(self.context(), bytes)?;
        prepared.forward = Some(forward);
        Ok(())
    }

    /// Appends the backward pass of the preceding forward pass, from the planes in
    /// [`WgpuRasterizer::upstream_buffer`]. If `geometry` is true, for all groups; otherwise for
    /// harmonics and features only.
    ///
    /// # Errors
    /// If there was no forward pass, or the device fails.
    pub fn encode_backward(
        &self,
        prepared: &mut GpuPrepared,
        commands: &mut Commands<'_>,
        params: &RenderParams,
        geometry: bool,
    ) -> Result<(), RasterError> {
        prepared.check_owner(self.context())?;
        let forward = prepared.forward.ok_or(RasterError::NoForward)?;
        let scope = if geometry { Scope::Everything } else { Scope::Colors };
        Ok(backward::encode(self.context(), prepared, commands, params, forward, scope)?)
    }

    /// Planes of the upstream gradient, laid out as in [`WgpuRasterizer::image_buffer`]; not
    /// cleared.
    ///
    /// # Errors
    /// If there was no forward pass.
    pub fn upstream_buffer<'a>(
        &self,
        prepared: &'a GpuPrepared,
    ) -> Result<&'a wgpu::Buffer, RasterError> {
        if prepared.forward.is_none() {
            return Err(RasterError::NoForward);
        }
        Ok(prepared.memory.v_image.get(self.context())?)
    }

    /// Bytes of [`WgpuRasterizer::image_buffer`] and [`WgpuRasterizer::upstream_buffer`].
    ///
    /// # Errors
    /// If there was no forward pass.
    pub fn image_bytes(&self, prepared: &GpuPrepared) -> Result<u64, RasterError> {
        let forward = prepared.forward.ok_or(RasterError::NoForward)?;
        Ok(forward::image_bytes(prepared, forward.channels))
    }

    /// Buffers of a group's parameters and their gradients, after a backward pass was appended.
    ///
    /// # Errors
    /// If there was no forward or backward pass.
    pub fn parameters<'a>(
        &self,
        prepared: &'a GpuPrepared,
        group: Group,
    ) -> Result<Vec<ParameterSlice<'a>>, RasterError> {
        let (context, m, rows) = (self.context(), &prepared.memory, prepared.num_splats);
        let forward = prepared.forward.ok_or(RasterError::NoForward)?;
        let (values, columns, before) = match group {
            Group::Means => (&m.means, 3, 0),
            Group::Quats => (&m.quats, 4, 3),
            Group::LogScales => (&m.log_scales, 3, 7),
            Group::OpacityLogits => (&m.opacity_logits, 1, 10),
            Group::Sh => {
                if !forward.channels.rgb {
                    return Ok(Vec::new());
                }
                let columns = 3 * sh::num_coeffs(forward.sh_degree);
                let slice = |((values, grads), (first_row, rows))| {
                    let (values, grads) = (buffer(self, values)?, buffer(self, grads)?);
                    Ok(ParameterSlice { values, grads, first_grad: 0, first_row, rows, columns })
                };
                let chunks = forward::sh_chunks(context, rows, true, forward.sh_degree);
                return m.sh.iter().zip(&m.v_sh).zip(chunks).map(slice).collect();
            }
        };
        let (values, grads) = (buffer(self, values)?, buffer(self, &m.v_params)?);
        let first_grad = before * rows;
        Ok(vec![ParameterSlice { values, grads, first_grad, first_row: 0, rows, columns }])
    }

    /// Copies the parameters on the device to `splats`, which must have the same shape. Harmonics
    /// are copied only if a forward pass with colour ran.
    ///
    /// # Errors
    /// If shapes disagree, or the device fails.
    pub fn read_parameters(
        &self,
        prepared: &GpuPrepared,
        splats: &mut Splats,
    ) -> Result<(), RasterError> {
        splats.check_shapes()?;
        let (context, m, rows) = (self.context(), &prepared.memory, prepared.num_splats);
        if splats.len() != rows {
            return Err(RasterError::Shape { what: "splats", found: splats.len(), expected: rows });
        }
        splats.means = download(context, Commands::new(context), m.means.get(context)?, rows)?;
        splats.quats = download(context, Commands::new(context), m.quats.get(context)?, rows)?;
        splats.log_scales =
            download(context, Commands::new(context), m.log_scales.get(context)?, rows)?;
        splats.opacity_logits =
            download(context, Commands::new(context), m.opacity_logits.get(context)?, rows)?;
        let resident = prepared.resident.map(|r| (r.channels, r.sh_degree));
        let Some((Channels { rgb: true, .. }, sh_degree)) = resident else { return Ok(()) };
        let coeffs = sh::num_coeffs(sh_degree);
        if splats.sh_coeffs() != coeffs {
            let (what, found, expected) = ("sh", splats.sh.len(), rows * coeffs);
            return Err(RasterError::Shape { what, found, expected });
        }
        for (buffer, (first, rows)) in
            m.sh.iter().zip(forward::sh_chunks(context, rows, true, sh_degree))
        {
            let values: Vec<[f32; 3]> =
                download(context, Commands::new(context), buffer.get(context)?, rows * coeffs)?;
            splats.sh[first * coeffs..(first + rows) * coeffs].copy_from_slice(&values);
        }
        Ok(())
    }
}

fn buffer<'a>(raster: &WgpuRasterizer, from: &'a GrowBuffer) -> Result<&'a wgpu::Buffer, GpuError> {
    from.get(raster.context())
}
