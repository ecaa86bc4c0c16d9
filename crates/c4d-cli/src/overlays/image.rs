//! [`overlay_image`]: an overlay as seen from a camera.

use super::layer::Layer;
use crate::device::{self, Device};
use crate::failure::Outcome;
use crate::passes::PassImage;
use gs_core::{Camera, Image, RasterError, Rasterizer, RenderOutput, RenderParams, Splats};
use gs_raster_cpu::CpuRasterizer;

/// An overlay: its colours over `background`, and its values Σ v α T, not divided by coverage.
pub(crate) fn overlay_image(
    device: &Device,
    layer: &Layer,
    splats: &Splats,
    camera: &Camera,
    background: [f32; 3],
) -> Outcome<PassImage> {
    let colors = layer.colors();
    let numbers = layer.values.as_deref().unwrap_or_default();
    let channels = if numbers.is_empty() { 3 } else { 4 };
    let mut features = Vec::with_capacity(channels * splats.len());
    for (row, color) in colors.chunks_exact(3).enumerate() {
        features.extend_from_slice(color);
        features
            .extend(numbers.get(row).map(|number| if number.is_finite() { *number } else { 0.0 }));
    }
    let output = match device {
        Device::Cpu => features_of(&CpuRasterizer::default(), splats, &features, camera),
        #[cfg(feature = "gpu")]
        Device::Gpu(raster) => features_of(raster, splats, &features, camera),
    }
    .map_err(|error| device::failure(&error))?;
    let (width, height) = (output.width, output.height);
    let mut shown = Image::zeros(width, height, 3);
    let pixels = shown.data.chunks_exact_mut(3).zip(output.features.chunks_exact(channels));
    for ((pixel, found), alpha) in pixels.zip(&output.alpha) {
        for c in 0..3 {
            pixel[c] = found[c] + (1.0 - alpha) * background[c];
        }
    }
    let numbers = (channels == 4).then(|| {
        let data = output.features.iter().skip(3).step_by(4).copied().collect();
        Image { width, height, channels: 1, data }
    });
    Ok(PassImage::Overlay(shown, numbers))
}

fn features_of<R: Rasterizer>(
    raster: &R,
    splats: &Splats,
    features: &[f32],
    camera: &Camera,
) -> Result<RenderOutput, RasterError> {
    let params = RenderParams { depth: false, rgb: false, ..RenderParams::default() };
    let mut prepared = raster.prepare(splats, camera)?;
    raster.forward(&mut prepared, splats, features, &params)
}
