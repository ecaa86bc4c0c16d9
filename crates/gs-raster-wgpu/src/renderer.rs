//! [`WgpuRasterizer`]: the implementation of the trait, and methods specific to devices.

use crate::backward::{self, BackwardRequest, Scope};
use crate::commands::{Commands, PassTiming};
use crate::prepared::GpuPrepared;
use crate::primitives::download;
use crate::{GpuContext, forward};
use gs_core::{
    Camera, RasterError, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats, UpstreamGrads,
};

/// The rasteriser. Cheap to clone; clones share device and pipelines.
#[derive(Debug, Clone)]
pub struct WgpuRasterizer {
    context: GpuContext,
}

/// Intermediate results of the preparation, for tests and debugging.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Stages {
    /// Per splat: u, v (pixels, pixel i sampled at i), conic A, B, C, opacity, camera depth, radius
    /// (pixels, 0 = culled), `[N,8]`. After a forward pass, the opacity is −1 for splats excluded
    /// because their colour, opacity or a feature is not finite.
    pub projected: Vec<[f32; 8]>,
    /// Per splat: tile rectangle x0, y0, x1, y1, upper bounds exclusive, `[N,4]`.
    pub rects: Vec<[u32; 4]>,
    /// Visible splats by depth, ties by index.
    pub depth_order: Vec<u32>,
    /// Number of (splat, tile) pairs of all rectangles.
    pub num_rect_isects: usize,
    /// Splats of each tile, front to back; without pairs that cannot draw. Tiles row by row.
    pub tile_lists: Vec<Vec<u32>>,
}

impl WgpuRasterizer {
    /// A rasteriser on `context`.
    pub fn new(context: GpuContext) -> Self {
        Self { context }
    }

    /// The device.
    pub fn context(&self) -> &GpuContext {
        &self.context
    }

    /// [`Rasterizer::forward`] that reads back only two counts: the planes stay on the device for a
    /// backward pass or [`WgpuRasterizer::image_buffer`].
    ///
    /// # Errors
    /// As [`Rasterizer::forward`].
    pub fn forward_on_device(
        &self,
        prepared: &mut GpuPrepared,
        splats: &Splats,
        features: &[f32],
        params: &RenderParams,
    ) -> Result<(), RasterError> {
        forward::upload_appearance(&self.context, prepared, splats, features, params)?;
        forward::composite(&self.context, prepared, params, false)
    }

    /// Changes the camera for the splats of the last preparation, without uploading them again.
    ///
    /// # Errors
    /// If the camera is malformed or the device has too little memory.
    pub fn set_camera(
        &self,
        prepared: &mut GpuPrepared,
        camera: &Camera,
    ) -> Result<(), RasterError> {
        camera.check()?;
        prepared.check_owner(&self.context)?;
        Ok(prepared.set_camera(&self.context, camera)?)
    }

    /// [`Rasterizer::forward_into`] with the harmonics, opacities and features that remain on the
    /// device from the last forward pass: after [`WgpuRasterizer::set_camera`], or after
    /// [`Rasterizer::prepare_into`] of splats that only moved (opacities are those of that call).
    /// Uploads nothing. `params` must select the same channels.
    ///
    /// # Errors
    /// [`RasterError::NoForward`] if nothing suitable is on the device; otherwise as
    /// [`Rasterizer::forward_into`].
    pub fn forward_resident_into(
        &self,
        prepared: &mut GpuPrepared,
        params: &RenderParams,
        output: &mut RenderOutput,
    ) -> Result<(), RasterError> {
        forward::composite(&self.context, prepared, params, true)?;
        forward::download(&self.context, prepared, output)
    }

    /// The planes of the last forward pass, one after the other: rgb `[H,W,3]`, alpha `[H,W]`,
    /// depth `[H,W]`, features `[H,W,F]`, without those that were not requested. 32-bit floats;
    /// valid until the next call with `prepared`.
    ///
    /// # Errors
    /// If there was no forward pass.
    pub fn image_buffer<'a>(
        &self,
        prepared: &'a GpuPrepared,
    ) -> Result<&'a wgpu::Buffer, RasterError> {
        if prepared.forward.is_none() {
            return Err(RasterError::NoForward);
        }
        Ok(prepared.memory.image.get(&self.context)?)
    }

    /// Times of the passes of the last call with `prepared`, if the context
    /// was created with [`timestamps`](crate::GpuOptions::timestamps) and
    /// the adapter supports them; otherwise empty.
    pub fn timings<'a>(&self, prepared: &'a GpuPrepared) -> &'a [PassTiming] {
        &prepared.timings
    }

    /// Builds the lists now instead of with the next forward pass.
    ///
    /// # Errors
    /// If the device fails.
    pub fn finish_preparation(&self, prepared: &mut GpuPrepared) -> Result<(), RasterError> {
        prepared.check_owner(&self.context)?;
        while prepared.stale {
            let mut commands = Commands::new(&self.context);
            prepared.encode_prepare(&self.context, &mut commands)?;
            prepared.encode_counts(&self.context, &mut commands)?;
            let stamps = commands.submit(&mut prepared.memory.commands, "preparation")?;
            prepared.check_room(&self.context)?;
            prepared.timings = stamps.read(&self.context)?;
        }
        Ok(())
    }

    /// Radius of each splat, pixels; 0 for a splat that is culled, by geometry or, after a forward
    /// pass, for values that are not finite.
    ///
    /// # Errors
    /// If the device fails.
    pub fn radii(&self, prepared: &mut GpuPrepared) -> Result<Vec<u32>, RasterError> {
        self.finish_preparation(prepared)?;
        let buffer = prepared.memory.projected.get(&self.context)?;
        let commands = Commands::new(&self.context);
        let rows: Vec<[f32; 8]> = download(&self.context, commands, buffer, prepared.num_splats)?;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "whole pixels, at most 2^30"
        )]
        let radius = |row: &[f32; 8]| if row[5] < 0.0 { 0 } else { row[7] as u32 };
        Ok(rows.iter().map(radius).collect())
    }

    /// Reads back every stage of the preparation. Slow.
    ///
    /// # Errors
    /// If the device fails.
    pub fn stages(&self, prepared: &mut GpuPrepared) -> Result<Stages, RasterError> {
        self.finish_preparation(prepared)?;
        let (context, m) = (&self.context, &prepared.memory);
        let num_splats = prepared.num_splats;
        let get = || Commands::new(context);
        let projected = download(context, get(), m.projected.get(context)?, num_splats)?;
        let packed: Vec<[u32; 2]> = download(context, get(), m.rects.get(context)?, num_splats)?;
        let visible: Vec<u32> = download(context, get(), m.visible.get(context)?, num_splats + 1)?;
        let ids = m.depth_sort.values[m.depth_result].get(context)?;
        let depth_order = download(context, get(), ids, visible[num_splats] as usize)?;
        let isects = prepared.num_isects as usize;
        let entries: Vec<[u32; 2]> = download(context, get(), m.entries.get(context)?, isects)?;
        let tiles = prepared.frame.tile_bounds.map(|side| side as usize).iter().product();
        let ranges: Vec<[u32; 2]> = download(context, get(), m.tile_ranges.get(context)?, tiles)?;
        Ok(Stages {
            projected,
            rects: packed
                .iter()
                .map(|[low, high]| [low & 0xffff, low >> 16, high & 0xffff, high >> 16])
                .collect(),
            depth_order,
            num_rect_isects: isects,
            tile_lists: ranges
                .iter()
                .map(|&[begin, end]| {
                    let run = entries.get(begin as usize..end as usize).unwrap_or_default();
                    run.iter().map(|entry| entry[0]).collect()
                })
                .collect(),
        })
    }
}

impl Rasterizer for WgpuRasterizer {
    type Prepared = GpuPrepared;

    fn prepare(&self, splats: &Splats, camera: &Camera) -> Result<GpuPrepared, RasterError> {
        let mut prepared = GpuPrepared::new(self.context.clone());
        prepared.update(&self.context, splats, camera)?;
        Ok(prepared)
    }

    fn prepare_into(
        &self,
        splats: &Splats,
        camera: &Camera,
        prepared: &mut GpuPrepared,
    ) -> Result<(), RasterError> {
        prepared.update(&self.context, splats, camera)
    }

    fn forward_into(
        &self,
        prepared: &mut GpuPrepared,
        splats: &Splats,
        features: &[f32],
        params: &RenderParams,
        output: &mut RenderOutput,
    ) -> Result<(), RasterError> {
        forward::upload_appearance(&self.context, prepared, splats, features, params)?;
        forward::composite(&self.context, prepared, params, true)?;
        forward::download(&self.context, prepared, output)
    }

    fn backward_into(
        &self,
        prepared: &mut GpuPrepared,
        splats: &Splats,
        features: &[f32],
        params: &RenderParams,
        upstream: &UpstreamGrads,
        grads: &mut RenderGrads,
    ) -> Result<(), RasterError> {
        let scope = Scope::Everything;
        let request = BackwardRequest { splats, features, params, upstream, scope };
        backward::run(&self.context, prepared, &request, grads)
    }

    fn backward_colors_into(
        &self,
        prepared: &mut GpuPrepared,
        splats: &Splats,
        features: &[f32],
        params: &RenderParams,
        upstream: &UpstreamGrads,
        grads: &mut RenderGrads,
    ) -> Result<(), RasterError> {
        let scope = Scope::Colors;
        let request = BackwardRequest { splats, features, params, upstream, scope };
        backward::run(&self.context, prepared, &request, grads)
    }
}
