//! [`Targets`]: what the render of one image is compared with, on the device.

use gs_core::RasterError;
use gs_raster_wgpu::device::GrowBuffer;
use gs_raster_wgpu::{GpuContext, GpuError};

/// What one render is compared with, `[H,W,3]` and `[H,W]`. Memory is reused by the next upload.
#[derive(Debug)]
pub struct Targets {
    pub(crate) warp: GrowBuffer,
    pub(crate) original: GrowBuffer,
    pub(crate) fore: GrowBuffer,
    pub(crate) back: GrowBuffer,
    pub(crate) size: [u32; 2],
}

impl Default for Targets {
    fn default() -> Self {
        let [warp, original, fore, back] =
            ["targets", "originals", "foreground", "background"].map(GrowBuffer::storage);
        Self { warp, original, fore, back, size: [0; 2] }
    }
}

impl Targets {
    /// Uploads the targets of an image of `[W, H]` pixels: `warp` supervises where `fore > 0` (L1
    /// and SSIM), `original` where `back > 0` (L1). An empty `fore` or `back` is 0 everywhere, and
    /// its image may then be empty, too.
    ///
    /// # Errors
    /// If a length does not fit the size, or the device has too little memory.
    pub fn upload(
        &mut self,
        context: &GpuContext,
        size: [u32; 2],
        [warp, original, fore, back]: [&[f32]; 4],
    ) -> Result<(), RasterError> {
        self.size = [0; 2];
        let pixels = size[0] as usize * size[1] as usize;
        for (what, values, mask, expected) in [
            ("warp", warp, fore, 3 * pixels),
            ("original", original, back, 3 * pixels),
            ("fore", fore, fore, pixels),
            ("back", back, back, pixels),
        ] {
            if values.len() != expected && !(values.is_empty() && mask.is_empty()) {
                return Err(RasterError::Shape { what, found: values.len(), expected });
            }
        }
        let upload = |buffer: &mut GrowBuffer, values: &[f32], count: usize| {
            if values.is_empty() {
                buffer.upload(context, &vec![0.0_f32; count])
            } else {
                buffer.upload(context, values)
            }
        };
        let result: Result<(), GpuError> = upload(&mut self.warp, warp, 3 * pixels)
            .and_then(|()| upload(&mut self.original, original, 3 * pixels))
            .and_then(|()| upload(&mut self.fore, fore, pixels))
            .and_then(|()| upload(&mut self.back, back, pixels));
        result?;
        self.size = size;
        Ok(())
    }
}
