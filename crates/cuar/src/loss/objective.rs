//! The refinement objective of one image (Eqs. 18–20).

use super::l1::sign;
use c4d_metrics::{SSIM_RADIUS, Ssim};
use gs_core::Real;

/// Weights of Eqs. 18 and 20.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LossWeights {
    /// η, share of D-SSIM in the foreground loss. Default 0.2 (supplement).
    pub eta: f64,
    /// ζ, share of the background loss. Default 0.3 (supplement).
    pub zeta: f64,
}

impl Default for LossWeights {
    fn default() -> Self {
        Self { eta: 0.2, zeta: 0.3 }
    }
}

/// The losses of one image, means over the whole image.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LossParts {
    /// `mean M·|render − warp|`, first term of Eq. 18 without its weight.
    pub fore_l1: f64,
    /// `1 − SSIM(M·render, M·warp)`, second term of Eq. 18 without its weight.
    pub fore_ssim: f64,
    /// Eq. 19.
    pub back_l1: f64,
    /// `fore_l1` and `back_l1` with the L1 of the given [`L1Shape`]: `√(r² + δ²) − δ` where that is
    /// smooth.
    pub shaped_l1: [f64; 2],
}

impl LossParts {
    /// Eq. 20.
    pub fn total(&self, weights: LossWeights) -> f64 {
        let fore = (1.0 - weights.eta) * self.fore_l1 + weights.eta * self.fore_ssim;
        (1.0 - weights.zeta) * fore + weights.zeta * self.back_l1
    }

    /// Eq. 20 with the L1 of the given shape: the function that the gradient differentiates.
    pub fn shaped_total(&self, weights: LossWeights) -> f64 {
        let [fore_l1, back_l1] = self.shaped_l1;
        Self { fore_l1, back_l1, ..*self }.total(weights)
    }
}

/// Targets of the render of one image. The image may be a crop; see [`Objective::new`].
#[derive(Debug, Clone, Copy)]
pub struct Targets<'a, F> {
    /// Render before refinement, `[H,W,3]`.
    pub original: &'a [F],
    /// First frame warped here, `[H,W,3]`; read only where `fore > 0`.
    pub warp: &'a [F],
    /// M: 1 where `warp` supervises, else 0, `[H,W]`.
    pub fore: &'a [F],
    /// 1 − M: 1 where `original` supervises, else 0, `[H,W]`. Pixels with neither are
    /// unconstrained.
    pub back: &'a [F],
}

/// Form of the L1 loss.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum L1Shape {
    /// `|r|`, derivative `sign r`.
    Exact,
    /// Derivative `r/√(r² + δ²)`, curvature `1/√(r² + δ²)` (iteratively reweighted least squares).
    Smooth(f64),
}

/// Eqs. 18–20 with gradient and, for second-order solvers, curvature. Owns its work memory.
#[derive(Debug, Clone)]
pub struct Objective<F> {
    width: usize,
    height: usize,
    weights: LossWeights,
    norm: F,
    ssim: Ssim<F>,
    masked: [Vec<F>; 2],
    v_masked: Vec<F>,
    bent_masked: Vec<F>,
    bent: Vec<F>,
}

impl<F: Real> Objective<F> {
    /// For crops of `width × height` of an image of `full_pixels` pixels (those of the crop if the
    /// image is not cropped): values are means over the full image, whose other pixels contribute 0.
    pub fn new(width: usize, height: usize, full_pixels: usize, weights: LossWeights) -> Self {
        Self {
            width,
            height,
            weights,
            norm: F::from_double(1.0 / (3.0 * full_pixels.max(1) as f64)),
            ssim: Ssim::new(0, 0, 3),
            masked: Default::default(),
            v_masked: Vec::new(),
            bent_masked: Vec::new(),
            bent: Vec::new(),
        }
    }

    /// Losses of `render` (`[H,W,3]`). Overwrites `v_render` (`[H,W,3]`) with the derivative of
    /// [`LossParts::shaped_total`], and `curvature` (`[H,W]`), if given, with a bound of its second
    /// derivative per pixel, mean over channels.
    ///
    /// # Panics
    /// If a length does not fit the size given to [`Objective::new`].
    pub fn evaluate(
        &mut self,
        render: &[F],
        targets: &Targets<F>,
        shape: L1Shape,
        v_render: &mut Vec<F>,
        curvature: Option<&mut Vec<F>>,
    ) -> LossParts {
        let (width, height) = (self.width, self.height);
        let pixels = width * height;
        for (what, len, per_pixel) in [
            ("render", render.len(), 3),
            ("original", targets.original.len(), 3),
            ("warp", targets.warp.len(), 3),
            ("fore", targets.fore.len(), 1),
            ("back", targets.back.len(), 1),
        ] {
            assert!(len == pixels * per_pixel, "{what}: {len} values, {width}×{height} pixels");
        }
        v_render.clear();
        v_render.resize(pixels * 3, F::zero());
        let LossWeights { eta, zeta } = self.weights;
        let share = |x: f64| F::from_double(x);
        let (fore_share, back_share) = (share((1.0 - zeta) * (1.0 - eta)), share(zeta));
        let ssim_share = share((1.0 - zeta) * eta);

        let bends = curvature.is_some();
        self.bent.clear();
        self.bent.resize(pixels * 3, F::zero());
        let mut parts = LossParts::default();
        // beyond the windows that touch the mask both images are zero, their similarity 1
        if let Some([x0, y0, x1, y1]) = around(targets.fore, width) {
            let (x1, y1) = (x1.min(width), y1.min(height));
            let [x, y] = &mut self.masked;
            for (image, out) in [(render, x), (targets.warp, y)] {
                out.clear();
                for row in y0..y1 {
                    let (from, to) = (row * width + x0, row * width + x1);
                    mask_into(&image[from * 3..to * 3], &targets.fore[from..to], out);
                }
            }
            let [x, y] = &self.masked;
            for plane in [&mut self.v_masked, &mut self.bent_masked] {
                plane.clear();
                plane.resize(x.len(), F::zero());
            }
            self.ssim.resize(x1 - x0, y1 - y0);
            let bent = bends.then_some(self.bent_masked.as_mut_slice());
            let loss = self.ssim.loss(x, y, self.norm, ssim_share, &mut self.v_masked, bent);
            parts.fore_ssim = loss.as_f64();
            let inside = (y0..y1).flat_map(|row| row * width + x0..row * width + x1);
            for (q, p) in inside.enumerate() {
                let m = targets.fore[p];
                for channel in 0..3 {
                    v_render[p * 3 + channel] = m * self.v_masked[q * 3 + channel];
                    self.bent[p * 3 + channel] = m * m * self.bent_masked[q * 3 + channel];
                }
            }
        }
        let mut norms = [[F::zero(); 2]; 2];
        let terms = [
            (targets.fore, targets.warp, fore_share),
            (targets.back, targets.original, back_share),
        ];
        for (sum, (weights, target, share)) in norms.iter_mut().zip(terms) {
            let factor = self.norm * share;
            let delta = match shape {
                L1Shape::Exact => F::zero(),
                L1Shape::Smooth(delta) => F::from_double(delta),
            };
            let delta2 = delta * delta;
            for p in 0..pixels {
                let m = weights[p];
                if m <= F::zero() {
                    continue;
                }
                for k in p * 3..p * 3 + 3 {
                    let r = render[k] - target[k];
                    sum[0] += m * r.abs();
                    if shape == L1Shape::Exact {
                        v_render[k] += factor * m * sign(r);
                    } else {
                        let root = (r * r + delta2).sqrt();
                        sum[1] += m * (root - delta);
                        let weight = factor * m / root;
                        v_render[k] += weight * r;
                        self.bent[k] += weight;
                    }
                }
            }
        }
        let [[fore, fore_shaped], [back, back_shaped]] =
            norms.map(|sums| sums.map(|sum| (sum * self.norm).as_f64()));
        (parts.fore_l1, parts.back_l1) = (fore, back);
        parts.shaped_l1 =
            if shape == L1Shape::Exact { [fore, back] } else { [fore_shaped, back_shaped] };
        if let Some(curvature) = curvature {
            let third = F::from_double(1.0 / 3.0);
            curvature.clear();
            curvature.extend(self.bent.chunks_exact(3).map(|b| (b[0] + b[1] + b[2]) * third));
        }
        parts
    }
}

/// Appends `image · mask`.
fn mask_into<F: Real>(image: &[F], mask: &[F], out: &mut Vec<F>) {
    for (rgb, &m) in image.chunks_exact(3).zip(mask) {
        // not a product: values outside the mask may be NaN
        out.extend(rgb.iter().map(|&value| if m > F::zero() { m * value } else { F::zero() }));
    }
}

/// Rectangle `x0, y0, x1, y1` (upper bounds exclusive, not cut to the image) of all windows that
/// touch `mask`; `None` if it is empty.
fn around<F: Real>(mask: &[F], width: usize) -> Option<[usize; 4]> {
    let mut bounds: Option<[usize; 4]> = None;
    for (y, row) in mask.chunks(width.max(1)).enumerate() {
        let on = |m: &F| *m > F::zero();
        let (Some(left), Some(right)) = (row.iter().position(on), row.iter().rposition(on)) else {
            continue;
        };
        let [x0, y0, x1, _] = bounds.unwrap_or([left, y, 0, 0]);
        bounds = Some([x0.min(left), y0, x1.max(right + 1), y + 1]);
    }
    let [x0, y0, x1, y1] = bounds?;
    Some([
        x0.saturating_sub(SSIM_RADIUS),
        y0.saturating_sub(SSIM_RADIUS),
        x1 + SSIM_RADIUS,
        y1 + SSIM_RADIUS,
    ])
}
