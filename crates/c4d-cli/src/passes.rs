//! Images of changes relative to the edited frame: flow, colour
//! uncertainty, artifact mask (Eqs. 11–17).

use crate::args::Pass;
use crate::device::Device;
use crate::failure::{Failure, Outcome, chain};
use cuar::{BeforeEdit, Evidence, EvidenceParams, Flow, RefineOptions};
use gs_core::{Camera, DynamicScene, Image, Rasterizer, Splats};
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
    /// An overlay: its colours, and its values if it has any.
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
        #[cfg(feature = "gpu")]
        Device::Gpu(raster) => Evidence::of(raster, scene, before, edit_time, cameras, params),
    }
    .map(|evidence| evidence.xi)
    .map_err(|error| Failure::failed(chain(&error)))
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
        #[cfg(feature = "gpu")]
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
