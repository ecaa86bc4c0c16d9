//! [`FlowField`]: displacements of pixels, with masks of where they are known and reliable.

use gs_core::Image;

/// Occlusion: squared difference of forward and backward flow above this share of their squared
/// lengths, plus [`OCCLUDED_BY`] pixels² (Ruder et al. 2016).
const OCCLUDED_SHARE: f32 = 0.01;
const OCCLUDED_BY: f32 = 0.5;
/// Motion boundary: squared gradient above this share of the squared length, plus [`BOUNDARY_BY`].
const BOUNDARY_SHARE: f32 = 0.01;
const BOUNDARY_BY: f32 = 0.002;

/// Displacement of each pixel, pixels, x right and y down.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FlowField {
    width: usize,
    height: usize,
    /// `[H,W]`; NaN where unknown.
    vectors: Vec<[f32; 2]>,
}

impl FlowField {
    /// From a flow `[H,W,2]`, pixels, NaN where unknown; empty for any other number of channels.
    pub fn of(flow: &Image) -> Self {
        if flow.channels != 2 {
            return Self::default();
        }
        let vectors = flow.data.chunks_exact(2).map(|v| [v[0], v[1]]).collect();
        Self { width: flow.width, height: flow.height, vectors }
    }

    /// Composited displacements `Σ f α T`, channels `first` and `first + 1` of `channels`, divided
    /// by the coverage `Σ α T`; unknown where the coverage is at most one half.
    pub fn normalized(
        (width, height): (usize, usize),
        features: &[f32],
        (channels, first): (usize, usize),
        coverage: &[f32],
    ) -> Self {
        let vectors =
            features.chunks_exact(channels.max(1)).zip(coverage).map(|(pixel, &alpha)| {
                if alpha > 0.5 {
                    [pixel[first] / alpha, pixel[first + 1] / alpha]
                } else {
                    [f32::NAN; 2]
                }
            });
        Self { width, height, vectors: vectors.collect() }
    }

    /// Size `[W, H]`, pixels.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Displacements, pixels, `[H,W]`; NaN where unknown.
    pub fn vectors(&self) -> &[[f32; 2]] {
        &self.vectors
    }

    fn at(&self, x: usize, y: usize) -> Option<[f32; 2]> {
        let v = self.vectors[y * self.width + x];
        (v[0].is_finite() && v[1].is_finite()).then_some(v)
    }

    /// Displacement at a position between pixel centres, by bilinear interpolation; `None` outside
    /// the image or next to an unknown pixel.
    fn between(&self, x: f32, y: f32) -> Option<[f32; 2]> {
        let corners = Corners::of(x, y, self.width, self.height)?;
        let mut sum = [0.0; 2];
        for (index, weight) in corners.0 {
            if weight > 0.0 {
                let v = self.vectors[index];
                if !(v[0].is_finite() && v[1].is_finite()) {
                    return None;
                }
                sum[0] += weight * v[0];
                sum[1] += weight * v[1];
            }
        }
        Some(sum)
    }

    /// Pixels of this frame that are also visible in the other frame, `[H,W]`: the flow is known at
    /// both ends, the target is inside the image, not occluded
    /// (`|w + ŵ|² ≤ 0.01 (|w|² + |ŵ|²) + 0.5`, where `ŵ` is the displacement of `back` at the
    /// target) and not at a motion boundary (`|∇u|² + |∇v|² ≤ 0.01 |w|² + 0.002`).
    pub fn visible(&self, back: &Self) -> Vec<bool> {
        let mut visible = vec![false; self.vectors.len()];
        if back.size() != self.size() {
            return visible;
        }
        for y in 0..self.height {
            for x in 0..self.width {
                let Some(w) = self.at(x, y) else { continue };
                let Some(other) = back.between(x as f32 + w[0], y as f32 + w[1]) else { continue };
                let length = |v: [f32; 2]| v[0] * v[0] + v[1] * v[1];
                let gap = length([w[0] + other[0], w[1] + other[1]]);
                let occluded = gap > OCCLUDED_SHARE * (length(w) + length(other)) + OCCLUDED_BY;
                let boundary =
                    self.squared_gradient(x, y) > BOUNDARY_SHARE * length(w) + BOUNDARY_BY;
                visible[y * self.width + x] = !occluded && !boundary;
            }
        }
        visible
    }

    /// `|∇u|² + |∇v|²` from differences of known neighbours.
    fn squared_gradient(&self, x: usize, y: usize) -> f32 {
        let pair = |a: Option<[f32; 2]>, b: Option<[f32; 2]>, here: Option<[f32; 2]>| {
            let (a, b, steps) = match (a, b) {
                (Some(a), Some(b)) => (a, b, 2.0),
                (Some(a), None) => (a, here.unwrap_or(a), 1.0),
                (None, Some(b)) => (here.unwrap_or(b), b, 1.0),
                (None, None) => return 0.0,
            };
            ((b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2)) / (steps * steps)
        };
        let here = self.at(x, y);
        let left = x.checked_sub(1).and_then(|x| self.at(x, y));
        let right = (x + 1 < self.width).then(|| self.at(x + 1, y)).flatten();
        let up = y.checked_sub(1).and_then(|y| self.at(x, y));
        let down = (y + 1 < self.height).then(|| self.at(x, y + 1)).flatten();
        pair(left, right, here) + pair(up, down, here)
    }
}

/// The four pixels around a point and their weights.
pub(crate) struct Corners(pub [(usize, f32); 4]);

impl Corners {
    /// `None` if the point is beyond the outermost pixel centres.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "inside the image: checked first"
    )]
    pub(crate) fn of(x: f32, y: f32, width: usize, height: usize) -> Option<Self> {
        let inside = |value: f32, side: usize| (0.0..=side as f32 - 1.0).contains(&value);
        if !inside(x, width) || !inside(y, height) {
            return None;
        }
        let (x0, y0) = (x.floor() as usize, y.floor() as usize);
        let (x1, y1) = ((x0 + 1).min(width - 1), (y0 + 1).min(height - 1));
        let (fx, fy) = (x - x.floor(), y - y.floor());
        Some(Self([
            (y0 * width + x0, (1.0 - fx) * (1.0 - fy)),
            (y0 * width + x1, fx * (1.0 - fy)),
            (y1 * width + x0, (1.0 - fx) * fy),
            (y1 * width + x1, fx * fy),
        ]))
    }
}
