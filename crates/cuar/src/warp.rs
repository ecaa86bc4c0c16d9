//! Warping the first frame to frame `t` (Eq. 13).

use crate::Rejection;

/// Form of the warp of the first frame to frame `t`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum WarpForm {
    /// Backward warp: every pixel of frame `t` samples frame 1 at the position of its surface
    /// there, given by the flow composited at frame `t` and divided by coverage. The pixel is
    /// supervised only if that surface is visible in frame 1. There are no holes.
    #[default]
    Backward,
    /// Eq. 13 as written: pixels of frame 1 are moved along the composited (not normalised) flow
    /// `F_{1→t}` of frame 1, without an occlusion test. The equation does not define the result
    /// where several pixels arrive, or none: here the nearest hides the others, and pixels where
    /// none arrives are not supervised.
    Paper,
}

/// Tolerances of the occlusion test of [`WarpForm::Backward`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WarpParams {
    /// Minimum coverage of a pixel with a defined surface, at `t` and in frame 1. Default 0.5.
    pub min_coverage: f32,
    /// Maximum difference between the depth of the surface and that rendered in frame 1, relative to
    /// the latter.
    /// Default 0.01.
    pub depth_tolerance: f32,
    /// Maximum standard deviation of the positions in frame 1 composited at one pixel, relative to
    /// their depth; beyond it, several surfaces mix. Default 0.015.
    pub spread_tolerance: f32,
    /// Minimum determinant of the motion from frame `t` to frame 1 at a pixel: the area in frame 1
    /// of one pixel of frame `t`. It is negative if the surface faces away from the camera in frame
    /// 1 (which depth alone does not detect on a thin limb), and small at grazing angles. Default
    /// 0.4.
    pub min_facing: f32,
    /// Pixels whose colour lies within the range of the 3×3 pixels of frame 1 around their source,
    /// widened by this much, agree with frame 1 and are supervised by their current colour, because
    /// resampling would blur textures. `None` supervises every masked pixel, as the paper does.
    /// Default 0.05.
    pub slack: Option<f32>,
    /// Where no surface can be sampled: share of a pixel's coverage that must belong to splats
    /// visible in frame 1. The pixel is then supervised by their colours in frame 1. Values above 1
    /// disable this. Default 0.9.
    pub min_known_color: f32,
    /// Share of its unoccluded weight from which a splat counts as fully visible in frame 1; below
    /// it, visibility is proportional to the share. Default 0.1.
    pub min_visible_share: f32,
}

impl Default for WarpParams {
    fn default() -> Self {
        Self {
            min_coverage: 0.5,
            depth_tolerance: 0.01,
            spread_tolerance: 0.015,
            min_facing: 0.4,
            slack: Some(0.05),
            min_known_color: 0.9,
            min_visible_share: 0.1,
        }
    }
}

/// Frame 1 of one view.
#[derive(Debug, Clone, Default)]
pub(crate) struct FirstFrame {
    pub width: usize,
    pub height: usize,
    /// `[H,W,3]`.
    pub rgb: Vec<f32>,
    /// Depth divided by coverage, `[H,W]`; NaN where coverage is too small.
    pub depth: Vec<f32>,
    /// `Σ_p α T` per splat of the scene; empty if not requested.
    pub splat_weights: Vec<f32>,
    /// Colour of each splat from this camera, `[N]`; `None` if it is not finite.
    pub colors: Vec<Option<[f32; 3]>>,
}

/// Channels of what [`trace`] reads at frame `t`: affine motion to frame 1 (shift 2, linear part
/// 4), position there in the camera frame (3) and its square.
pub(crate) const WARP_CHANNELS: usize = 10;

/// Surface composited at one pixel of frame `t`, divided by coverage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Trace {
    /// Position of the surface in frame 1, pixels (centres at half-integers).
    pub at: [f32; 2],
    /// Camera depth of the surface in frame 1, world units.
    pub depth: f32,
}

/// Divides out the compositing: `sums` are the [`WARP_CHANNELS`] of one pixel, `alpha` its
/// coverage, `(x, y)` its column and row.
pub(crate) fn trace(
    sums: &[f32],
    alpha: f32,
    (x, y): (usize, usize),
    params: &WarpParams,
) -> Result<Trace, Rejection> {
    if alpha.is_nan() || alpha < params.min_coverage || alpha <= 0.0 {
        return Err(Rejection::Uncovered);
    }
    let (px, py) = (x as f32 + 0.5, y as f32 + 0.5);
    let at = [sums[0] + sums[2] * px + sums[3] * py, sums[1] + sums[4] * px + sums[5] * py];
    let [cx, cy, depth, square] = [6, 7, 8, 9].map(|k| sums[k] / alpha);
    let variance = square - (cx * cx + cy * cy + depth * depth);
    let limit = params.spread_tolerance * depth;
    if variance.is_nan() || variance > limit * limit {
        return Err(Rejection::Mixed);
    }
    let facing = (sums[2] * sums[5] - sums[3] * sums[4]) / (alpha * alpha);
    if facing.is_nan() || facing < params.min_facing {
        return Err(Rejection::TurnedAway);
    }
    Ok(Trace { at: at.map(|value| value / alpha), depth })
}

/// Colour of frame 1 at `trace`, if the surface is visible there; or `shown`, the colour at frame
/// `t`, if that agrees with it.
pub(crate) fn fetch(
    frame: &FirstFrame,
    trace: Trace,
    shown: &[f32],
    params: &WarpParams,
) -> Result<[f32; 3], Rejection> {
    let [sx, sy] = trace.at.map(|s| s - 0.5);
    let (w, h) = (frame.width, frame.height);
    let (max_x, max_y) = (w as f32 - 1.0, h as f32 - 1.0);
    if !(sx >= 0.0 && sy >= 0.0 && sx <= max_x && sy <= max_y) {
        return Err(Rejection::OutOfView);
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "inside the image, checked above"
    )]
    let (x0, y0) = (sx as usize, sy as usize);
    let (fx, fy) = (sx - x0 as f32, sy - y0 as f32);
    let tolerance = params.depth_tolerance * trace.depth.abs();
    let same = |x: usize, y: usize| {
        let depth = frame.depth[y * w + x];
        // NaN (no surface there) counts as a different surface
        (depth - trace.depth).abs() <= tolerance
    };
    let rgb = |x: usize, y: usize, channel: usize| frame.rgb[(y * w + x) * 3 + channel];
    let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
    let corners = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)];
    let weights = [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy];
    if corners.iter().zip(weights).any(|(&(x, y), weight)| weight > 0.0 && !same(x, y)) {
        return Err(Rejection::Hidden);
    }
    if let Some(slack) = params.slack {
        let (cx, cy) = (if fx < 0.5 { x0 } else { x1 }, if fy < 0.5 { y0 } else { y1 });
        let agrees = (0..3).all(|channel| {
            let (mut low, mut high) = (f32::MAX, f32::MIN);
            for y in cy.saturating_sub(1)..=(cy + 1).min(h - 1) {
                for x in cx.saturating_sub(1)..=(cx + 1).min(w - 1) {
                    if same(x, y) {
                        low = low.min(rgb(x, y, channel));
                        high = high.max(rgb(x, y, channel));
                    }
                }
            }
            (low - slack..=high + slack).contains(&shown[channel])
        });
        if agrees {
            return Ok([shown[0], shown[1], shown[2]]);
        }
    }
    let wide = x0 >= 1
        && y0 >= 1
        && x0 + 2 < w
        && y0 + 2 < h
        && (y0 - 1..=y0 + 2).all(|y| (x0 - 1..=x0 + 2).all(|x| same(x, y)));
    Ok([0, 1, 2].map(|channel| {
        let near = corners.map(|(x, y)| rgb(x, y, channel));
        if wide {
            // bilinear interpolation alone would blur every texture
            let row = |y: usize| catmull_rom(fx, [0, 1, 2, 3].map(|k| rgb(x0 + k - 1, y, channel)));
            let sharp = catmull_rom(fy, [0, 1, 2, 3].map(|k| row(y0 + k - 1)));
            let (low, high) = near.iter().fold((f32::MAX, f32::MIN), |(low, high), &value| {
                (low.min(value), high.max(value))
            });
            sharp.clamp(low, high)
        } else {
            near.iter().zip(weights).map(|(value, weight)| value * weight).sum()
        }
    }))
}

fn catmull_rom(f: f32, [a, b, c, d]: [f32; 4]) -> f32 {
    b + 0.5 * f * (c - a + f * (2.0 * a - 5.0 * b + 4.0 * c - d + f * (3.0 * (b - c) + d - a)))
}

#[cfg(test)]
impl FirstFrame {
    /// 12×9 pixels whose colours are linear in the pixel, at depth 2, for tests.
    pub(crate) fn ramp() -> Self {
        let (width, height) = (12, 9);
        let rgb = (0..width * height * 3)
            .map(|k| {
                let (x, y) = (k / 3 % width, k / 3 / width);
                x as f32 * 0.05 + y as f32 * 0.01 + (k % 3) as f32 * 0.1
            })
            .collect();
        Self {
            width,
            height,
            rgb,
            depth: vec![2.0; width * height],
            splat_weights: Vec::new(),
            colors: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fetch_interpolates_linear_images_exactly() {
        let frame = FirstFrame::ramp();
        for at in [[5.3, 4.8], [0.6, 0.7], [11.5, 8.5]] {
            let rgb = fetch(&frame, Trace { at, depth: 2.01 }, &[9.0; 3], &WarpParams::default())
                .unwrap();
            let expected = (at[0] - 0.5) * 0.05 + (at[1] - 0.5) * 0.01;
            assert!((rgb[0] - expected).abs() < 1e-5, "{at:?}: {rgb:?} {expected}");
        }
    }

    #[test]
    fn occluded_colours_are_not_fetched() {
        let frame = FirstFrame::ramp();
        let params = WarpParams::default();
        let fetch = |at, depth| fetch(&frame, Trace { at, depth }, &[9.0; 3], &params);
        assert_eq!(fetch([5.0, 5.0], 2.2), Err(Rejection::Hidden), "behind what frame 1 shows");
        assert_eq!(
            fetch([5.0, 5.0], 1.8),
            Err(Rejection::Hidden),
            "in front of what frame 1 shows"
        );
        assert_eq!(fetch([-1.0, 5.0], 2.0), Err(Rejection::OutOfView), "off the image");
        assert_eq!(fetch([f32::NAN, 5.0], 2.0), Err(Rejection::OutOfView), "nowhere");
        assert_eq!(fetch([5.0, 5.0], f32::NAN), Err(Rejection::Hidden), "no depth");
    }

    #[test]
    fn traces_are_divided_by_coverage() {
        let params = WarpParams::default();
        let whole = [2.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 2.0, 5.0];
        let full = trace(&whole, 1.0, (3, 3), &params).unwrap();
        assert_eq!(full.at, [5.5, 4.5], "moved");
        let half = trace(&whole.map(|x| 0.5 * x), 0.5, (3, 3), &params).unwrap();
        assert_eq!(half.at, full.at, "divided by coverage");
        // half of it at (0, 1, 2), half at (0, 2, 2)
        let mixed = [2.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.5, 2.0, 6.5];
        assert_eq!(trace(&mixed, 1.0, (3, 3), &params), Err(Rejection::Mixed), "two surfaces");
        let mut mirrored = whole;
        mirrored[2] = -1.0;
        assert_eq!(trace(&mirrored, 1.0, (3, 3), &params), Err(Rejection::TurnedAway), "mirrored");
        let faint = trace(&[0.0; WARP_CHANNELS], 0.2, (3, 3), &params);
        assert_eq!(faint, Err(Rejection::Uncovered), "hardly covered");
    }
}
