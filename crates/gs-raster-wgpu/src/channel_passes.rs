//! Partition of a frame: channels into passes, harmonics into bindings, planes of one image buffer.

use crate::layout::Frame;
use gs_core::image_formation::{EPS_DIVIDE, GUARD_BAND, TILE_SIZE};
use gs_core::{Camera, GradientConvention, RenderParams};

/// Channels of a render: colour, depth, features, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Channels {
    pub rgb: bool,
    pub depth: bool,
    pub num_features: usize,
}

impl Channels {
    pub(crate) fn new(params: &RenderParams, num_splats: usize, num_values: usize) -> Self {
        let num_features = num_values.checked_div(num_splats).unwrap_or(0);
        Self { rgb: params.rgb, depth: params.depth, num_features }
    }

    fn total(self) -> usize {
        3 * usize::from(self.rgb) + usize::from(self.depth) + self.num_features
    }

    /// First channel and width (4 or 8) of every pass. There is at
    /// least one pass, because alpha needs it.
    pub(crate) fn passes(self) -> Vec<(usize, usize)> {
        let mut passes = Vec::new();
        let mut first = 0;
        loop {
            let width = if self.total() - first.min(self.total()) > 4 { 8 } else { 4 };
            passes.push((first, width));
            first += width;
            if first >= self.total() {
                return passes;
            }
        }
    }

    /// Values per row of the gradients of projected quantities: u, v, A, B, C, opacity, two unused,
    /// channels with padding.
    pub(crate) fn grad_stride(self) -> usize {
        8 + self.passes().iter().map(|(_, width)| width).sum::<usize>()
    }

    /// Lengths of the planes colour, alpha, depth, features for an image of `pixels`.
    pub(crate) fn planes(self, pixels: usize) -> [usize; 4] {
        [
            3 * pixels * usize::from(self.rgb),
            pixels,
            pixels * usize::from(self.depth),
            pixels * self.num_features,
        ]
    }
}

/// Saturating conversion: sizes that do not fit are rejected when their memory is allocated.
pub(crate) fn to_u32(value: usize) -> u32 {
    u32::try_from(value).unwrap_or(u32::MAX)
}

#[expect(clippy::cast_possible_truncation, reason = "the device computes in single precision")]
fn single<const N: usize>(values: [f64; N]) -> [f32; N] {
    values.map(|value| value as f32)
}

/// Uniforms that depend on the camera alone.
pub(crate) fn camera_frame(camera: &Camera, num_splats: u32) -> Frame {
    let k = camera.intrinsics;
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let band = single(camera.tan_half_fov()).map(|tangent| GUARD_BAND * tangent);
    let camera_pos = single(camera.position());
    let rest = camera.to_camera(camera_pos.map(f64::from));
    let row = |i: usize| {
        let [x, y, z, _] = camera.viewmat[i];
        single([x, y, z, rest[i]])
    };
    let [near, divide] = single([camera.near, EPS_DIVIDE * camera.near]);
    Frame {
        view0: row(0),
        view1: row(1),
        view2: row(2),
        camera_pos,
        near,
        divide,
        focal: single([k.fx, k.fy]),
        center_offset: single([k.cx - width / 2.0, k.cy - height / 2.0]),
        guard: band,
        img_size: [camera.width, camera.height],
        tile_bounds: [camera.width.div_ceil(TILE_SIZE), camera.height.div_ceil(TILE_SIZE)],
        num_splats,
        ..Frame::default()
    }
}

/// Adds the parameters of a render.
pub(crate) fn render_frame(
    camera: Frame,
    channels: Channels,
    params: &RenderParams,
    sh_degree: usize,
) -> Frame {
    let pixels = camera.img_size[0] as usize * camera.img_size[1] as usize;
    let [rgb, alpha, depth, _] = channels.planes(pixels);
    Frame {
        sh_degree: to_u32(sh_degree),
        background: single(params.background),
        exact_gradients: u32::from(params.gradients == GradientConvention::Exact),
        rgb: u32::from(channels.rgb),
        depth: u32::from(channels.depth),
        num_features: to_u32(channels.num_features),
        grad_stride: to_u32(channels.grad_stride()),
        alpha_base: to_u32(rgb),
        depth_base: to_u32(rgb + alpha),
        features_base: to_u32(rgb + alpha + depth),
        ..camera
    }
}

/// Splits `rows` of `row_bytes` into runs that fit a binding: first row and length.
pub fn row_chunks(rows: usize, row_bytes: usize, max_binding_bytes: u64) -> Vec<(usize, usize)> {
    let fitting = usize::try_from(max_binding_bytes).unwrap_or(usize::MAX) / row_bytes.max(1);
    let run = fitting.max(1);
    (0..rows.div_ceil(run)).map(|i| (i * run, run.min(rows - i * run))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_split_into_passes() {
        let passes = |rgb, depth, num_features| Channels { rgb, depth, num_features }.passes();
        assert_eq!(passes(false, false, 0), [(0, 4)], "alpha alone");
        assert_eq!(passes(true, true, 0), [(0, 4)], "colour and depth");
        assert_eq!(passes(true, true, 1), [(0, 8)], "one more");
        assert_eq!(passes(true, true, 8), [(0, 8), (8, 4)], "twelve");
        assert_eq!(passes(true, true, 13), [(0, 8), (8, 8), (16, 4)], "seventeen");
    }

    #[test]
    fn rows_are_split_to_fit_bindings() {
        assert_eq!(row_chunks(5, 12, 30), [(0, 2), (2, 2), (4, 1)], "two rows fit");
        assert_eq!(row_chunks(0, 12, 30), [], "nothing");
        assert_eq!(
            row_chunks(2, 12, 1),
            [(0, 1), (1, 1)],
            "a row that does not fit is refused later"
        );
    }
}
