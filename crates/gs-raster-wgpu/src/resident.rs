//! Features that stay on the device, and passes appended to other commands.

use crate::WgpuRasterizer;
use crate::backward::{self, Scope};
use crate::buffers::GrowBuffer;
use crate::channel_passes::Channels;
use crate::commands::Commands;
use crate::forward;
use crate::prepared::{Forward, GpuPrepared};
use gs_core::{RasterError, RenderParams};

impl WgpuRasterizer {
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
    /// [`WgpuRasterizer::upstream_buffer`], for harmonics and features only.
    ///
    /// # Errors
    /// If there was no forward pass, or the device fails.
    pub fn encode_backward_colors(
        &self,
        prepared: &mut GpuPrepared,
        commands: &mut Commands<'_>,
        params: &RenderParams,
    ) -> Result<(), RasterError> {
        prepared.check_owner(self.context())?;
        let forward = prepared.forward.ok_or(RasterError::NoForward)?;
        Ok(backward::encode(self.context(), prepared, commands, params, forward, Scope::Colors)?)
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
}
