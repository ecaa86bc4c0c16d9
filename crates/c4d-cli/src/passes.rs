//! Images of changes relative to the edited frame: flow, colour
//! uncertainty, artifact mask (Eqs. 11–17); images of overlays.

use crate::args::Pass;
use crate::device::Device;
use crate::failure::{Failure, Outcome, chain};
use crate::overlays::Layer;
use cuar::{BeforeEdit, Evidence, EvidenceParams, Flow, RefineOptions};
use gs_core::{
    Camera, DynamicScene, Image, RasterError, Rasterizer, RenderOutput, RenderParams, Splats,
};
use gs_raster_cpu::CpuRasterizer;

/// Coverage below which a pixel has no flow.
const MIN_COVERAGE: f32 = 0.5;

/// Parameters of the artifact mask (Eq. 17).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mask {
    /// ε.
    pub(crate) epsilon: f32,
    /// Uncertainty below which no pixel is an artifact.
    pub(crate) min_uncertainty: f32,
    /// Parameters for finding splats that frame 1 does not supervise, if they are used.
    pub(crate) evidence: Option<EvidenceParams>,
}

impl Default for Mask {
    /// The refinement's default.
    fn default() -> Self {
        let usual = RefineOptions::default();
        Self {
            epsilon: usual.epsilon,
            min_uncertainty: usual.min_uncertainty,
            evidence: usual.evidence,
        }
    }
}

/// The image of one pass.
#[derive(Debug)]
pub(crate) enum PassImage {
    /// Motion from the edited frame to this one, at the pixels of this one.
    Flow(Flow),
    /// One channel in [0, 1].
    Grey(Image),
    /// An overlay: its colours, and its numbers if it has any.
    Overlay(Image, Option<Image>),
}

/// ξ′ of every splat of an edited scene, on `device`, from `cameras` that look at the edited frame.
pub(crate) fn evidence(
    device: &Device,
    scene: &dyn DynamicScene,
    before: &BeforeEdit<'_>,
    edit_time: f32,
    cameras: &[Camera],
    params: &EvidenceParams,
) -> Outcome<Vec<f32>> {
    match device {
        Device::Cpu => {
            Evidence::of(&CpuRasterizer::default(), scene, before, edit_time, cameras, params)
        }
        Device::Gpu(raster) => Evidence::of(raster, scene, before, edit_time, cameras, params),
    }
    .map(|evidence| evidence.xi)
    .map_err(|error| Failure::failed(chain(&error)))
}

/// An overlay: its colours over `background`, and its numbers, not divided by coverage.
pub(crate) fn overlay(
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
        Device::Gpu(raster) => features_of(raster, splats, &features, camera),
    }
    .map_err(|error| crate::device::failure(&error))?;
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

/// Renders `pass` for splats `now`, which were `then` in the edited frame; `evidence` is their ξ′,
/// or empty.
pub(crate) fn render(
    pass: Pass,
    mask: Mask,
    device: &Device,
    now: &Splats,
    (then, evidence): (&Splats, &[f32]),
    camera: &Camera,
) -> Outcome<PassImage> {
    match device {
        Device::Cpu => {
            render_with(pass, mask, &CpuRasterizer::default(), now, (then, evidence), camera)
        }
        Device::Gpu(raster) => render_with(pass, mask, raster, now, (then, evidence), camera),
    }
    .map_err(|error| Failure::failed(chain(&error)))
}

fn render_with<R: Rasterizer>(
    pass: Pass,
    mask: Mask,
    raster: &R,
    now: &Splats,
    (then, evidence): (&Splats, &[f32]),
    camera: &Camera,
) -> Result<PassImage, cuar::CuarError> {
    if pass == Pass::Flow {
        return Ok(PassImage::Flow(cuar::render_flow(raster, now, then, now, camera)?));
    }
    let uncertainty = match pass {
        Pass::Evidence => cuar::render_evidence(raster, now, evidence, camera)?,
        _ if evidence.is_empty() => cuar::render_uncertainty(raster, now, then, camera)?,
        _ => cuar::render_total_uncertainty(raster, now, then, evidence, camera)?,
    };
    Ok(PassImage::Grey(match pass {
        Pass::Mask => cuar::artifact_mask(&uncertainty, mask.epsilon, mask.min_uncertainty),
        _ => uncertainty,
    }))
}

/// Flow in pixels, coverage-normalised; NaN where nothing covers the pixel.
pub(crate) fn flow_image(flow: &Flow) -> Image {
    flow.normalized(MIN_COVERAGE)
}

/// Flow with its coverage: channels u, v, A.
pub(crate) fn flow_with_coverage(flow: &Flow) -> Image {
    let normalized = flow_image(flow);
    let mut image = Image::zeros(normalized.width, normalized.height, 3);
    for (i, pixel) in image.data.chunks_exact_mut(3).enumerate() {
        pixel[0] = normalized.data[2 * i];
        pixel[1] = normalized.data[2 * i + 1];
        pixel[2] = flow.coverage.data[i];
    }
    image
}
