//! SSIM and its gradient: 11×11 Gaussian window, separable.

use gs_core::Real;
use rayon::prelude::*;

/// Pixels from the centre of a window to its edge: windows are 11×11.
pub const SSIM_RADIUS: usize = 5;
const RADIUS: usize = SSIM_RADIUS;
const TAPS: usize = 2 * RADIUS + 1;
const SIGMA: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Windows over which SSIM is averaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SsimBorder {
    /// The window of every pixel, zero-padded beyond the image, as in 3DGS training.
    #[default]
    Zero,
    /// Only windows entirely inside the image (scikit-image's
    /// `structural_similarity` with `gaussian_weights`).
    Valid,
}

/// Content of the SSIM map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Term {
    Whole,
    ContrastStructure,
}

/// Structural similarity of two images `[H,W,C]` with data range 1: Gaussian window of σ = 1.5 cut
/// to 11×11 and normalised to sum 1, population variances, `C1 = 0.01²`, `C2 = 0.03²`, per channel.
/// Owns the working memory for one image size.
#[derive(Debug, Clone)]
pub struct Ssim<F> {
    width: usize,
    height: usize,
    channels: usize,
    taps: [F; TAPS],
    /// SSIM of the window around each pixel, `[H,W,C]`.
    map: Vec<F>,
    /// Derivatives of the map's entry with respect to the window's mean of x, of x² and of xy; then
    /// the curvature bound.
    planes: [Vec<F>; 4],
}

impl<F: Real> Ssim<F> {
    /// Memory for images of this size.
    pub fn new(width: usize, height: usize, channels: usize) -> Self {
        let raw: [f64; TAPS] = std::array::from_fn(|k| {
            let d = k as f64 - RADIUS as f64;
            (-d * d / (2.0 * SIGMA * SIGMA)).exp()
        });
        let sum: f64 = raw.iter().sum();
        Self {
            width,
            height,
            channels,
            taps: raw.map(|tap| F::from_double(tap / sum)),
            map: Vec::new(),
            planes: Default::default(),
        }
    }

    /// Changes the image size and reuses the memory.
    pub fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
    }

    /// Size `[W, H, C]`.
    pub fn size(&self) -> [usize; 3] {
        [self.width, self.height, self.channels]
    }

    /// SSIM per window of the last call, `[H,W,C]`; images are zero beyond their borders.
    pub fn map(&self) -> &[F] {
        &self.map
    }

    /// Mean SSIM of `x` and `y`.
    ///
    /// # Panics
    /// If a length is not `H·W·C`.
    pub fn value(&mut self, x: &[F], y: &[F], border: SsimBorder) -> F {
        self.windows(x, y, Term::Whole, false);
        self.mean(border)
    }

    /// Mean of the contrast–structure term of `x` and `y`, `(2σ_xy + C2)/(σ_x² + σ_y² + C2)`.
    ///
    /// # Panics
    /// If a length is not `H·W·C`.
    pub fn contrast_structure(&mut self, x: &[F], y: &[F], border: SsimBorder) -> F {
        self.windows(x, y, Term::ContrastStructure, false);
        self.mean(border)
    }

    /// Mean of the last call's [`Ssim::map`] over the windows of `border`.
    pub fn mean(&self, border: SsimBorder) -> F {
        match border {
            SsimBorder::Zero => self.sum() / F::from_double(self.map.len().max(1) as f64),
            SsimBorder::Valid => {
                let (w, h, c) = (self.width, self.height, self.channels);
                let (mut sum, mut count) = (F::zero(), 0_usize);
                for y in RADIUS..h.saturating_sub(RADIUS) {
                    let row = &self.map[y * w * c..(y + 1) * w * c];
                    if w > 2 * RADIUS {
                        sum += row[RADIUS * c..(w - RADIUS) * c].iter().copied().sum();
                        count += (w - 2 * RADIUS) * c;
                    }
                }
                sum / F::from_double(count.max(1) as f64)
            }
        }
    }

    /// `norm · Σ (1 − SSIM)` over all windows and channels ([`SsimBorder::Zero`]); its derivative
    /// with respect to `x`, times `scale`, is **added** to `v_x`. With `curvature`, a bound of the
    /// second derivative of `norm · scale · Σ (1 − SSIM)` per value of `x` is added there: with the
    /// variances of the windows held constant, `1 − SSIM ≤ (Δμ)²/D₁ + var(Δ)/D₂`, whose Hessian is
    /// at most the diagonal `2·G∗max(1/D₁, 1/D₂)`.
    ///
    /// # Panics
    /// If a length is not `H·W·C`.
    pub fn loss(
        &mut self,
        x: &[F],
        y: &[F],
        norm: F,
        scale: F,
        v_x: &mut [F],
        curvature: Option<&mut [F]>,
    ) -> F {
        self.windows(x, y, Term::Whole, true);
        assert!(v_x.len() == x.len(), "ssim: {} gradients, {} values", v_x.len(), x.len());
        let (row_len, c, height) = (self.width * self.channels, self.channels, self.height);
        let (taps, planes, two) = (&self.taps, &self.planes, F::of(2.0));
        let factor = norm * scale;
        let bends = curvature.is_some();
        let mut unused = Vec::new();
        let bent: &mut [F] = if let Some(bent) = curvature {
            bent
        } else {
            unused.resize(row_len * height, F::zero());
            &mut unused
        };
        v_x.par_chunks_mut(row_len.max(1))
            .zip(bent.par_chunks_mut(row_len.max(1)))
            .enumerate()
            .for_each(|(row, (v_x, bent))| {
                let [mean, square, cross, bend] = [0, 1, 2, 3].map(|plane| {
                    if plane < 3 || bends {
                        blur_row(taps, &planes[plane], row, row_len, height, c)
                    } else {
                        Vec::new()
                    }
                });
                let (x, y) = (&x[row * row_len..][..row_len], &y[row * row_len..][..row_len]);
                for k in 0..row_len {
                    // the planes hold the gradient of the similarity;
                    // the loss has the opposite sign
                    v_x[k] -= factor * (mean[k] + two * x[k] * square[k] + y[k] * cross[k]);
                }
                if bends {
                    for k in 0..row_len {
                        bent[k] += factor * two * bend[k];
                    }
                }
            });
        norm * (F::from_double(self.map.len() as f64) - self.sum())
    }

    /// Sums each row first, so that the result does not depend on
    /// how rows are distributed over threads.
    fn sum(&self) -> F {
        let row_len = (self.width * self.channels).max(1);
        self.map.chunks(row_len).map(|row| row.iter().copied().sum::<F>()).sum()
    }

    /// Fills the map with `term` and, if `derive`, the planes.
    fn windows(&mut self, x: &[F], y: &[F], term: Term, derive: bool) {
        let (row_len, c, height) = (self.width * self.channels, self.channels, self.height);
        let len = row_len * height;
        assert!(
            x.len() == len && y.len() == len,
            "ssim: {} and {} values, expected {len}",
            x.len(),
            y.len()
        );
        self.map.resize(len, F::zero());
        for plane in &mut self.planes {
            plane.resize(if derive { len } else { 0 }, F::zero());
        }
        if len == 0 {
            return;
        }
        let taps = &self.taps;
        let (c1, c2) = (F::from_double(C1), F::from_double(C2));
        let [mean, square, cross, bend] = &mut self.planes;
        let two = F::of(2.0);
        let body = |row: usize, map: &mut [F], mut out: Option<[&mut [F]; 4]>| {
            let [mx, my, xx, yy, xy] = window_row(taps, x, y, row, row_len, height, c);
            for k in 0..row_len {
                let (ux, uy) = (mx[k], my[k]);
                let a1 = two * ux * uy + c1;
                let a2 = two * (xy[k] - ux * uy) + c2;
                let b1 = ux * ux + uy * uy + c1;
                let b2 = (xx[k] - ux * ux) + (yy[k] - uy * uy) + c2;
                let both = F::one() / (b1 * b2);
                let s = a1 * a2 * both;
                map[k] = match term {
                    Term::Whole => s,
                    Term::ContrastStructure => a2 / b2,
                };
                if let Some([mean, square, cross, bend]) = &mut out {
                    mean[k] = two * (uy * (a2 - a1) * both - s * ux / b1 + s * ux / b2);
                    square[k] = -s / b2;
                    cross[k] = two * a1 * both;
                    bend[k] = (F::one() / b1).max(F::one() / b2);
                }
            }
        };
        if derive {
            self.map
                .par_chunks_mut(row_len)
                .zip(mean.par_chunks_mut(row_len))
                .zip(square.par_chunks_mut(row_len))
                .zip(cross.par_chunks_mut(row_len))
                .zip(bend.par_chunks_mut(row_len))
                .enumerate()
                .for_each(|(row, ((((map, mean), square), cross), bend))| {
                    body(row, map, Some([mean, square, cross, bend]));
                });
        } else {
            self.map
                .par_chunks_mut(row_len)
                .enumerate()
                .for_each(|(row, map)| body(row, map, None));
        }
    }
}

/// Rows of the image in the window around `row`, with their taps.
fn rows_under<F: Real>(
    taps: &[F; TAPS],
    row: usize,
    height: usize,
) -> impl Iterator<Item = (usize, F)> {
    let first = row.saturating_sub(RADIUS);
    let last = (row + RADIUS).min(height - 1);
    (first..=last).map(move |other| (other, taps[other + RADIUS - row]))
}

/// `out[k] = Σ_t taps[t] · padded[k + t·c]`.
#[inline(always)]
#[expect(clippy::inline_always, reason = "must be compiled for the dispatched vector unit")]
fn blur_across<F: Real>(taps: &[F; TAPS], padded: &[F], c: usize, out: &mut [F]) {
    for (t, &tap) in taps.iter().enumerate() {
        for (out, &value) in out.iter_mut().zip(&padded[t * c..]) {
            *out += tap * value;
        }
    }
}

/// One row of the blurred plane.
fn blur_row<F: Real>(
    taps: &[F; TAPS],
    plane: &[F],
    row: usize,
    row_len: usize,
    height: usize,
    c: usize,
) -> Vec<F> {
    let mut padded = vec![F::zero(); row_len + 2 * RADIUS * c];
    let mut out = vec![F::zero(); row_len];
    pulp::Arch::new().dispatch(
        #[inline(always)]
        || {
            let inner = &mut padded[RADIUS * c..RADIUS * c + row_len];
            for (other, tap) in rows_under(taps, row, height) {
                let values = &plane[other * row_len..][..row_len];
                for (sum, &value) in inner.iter_mut().zip(values) {
                    *sum += tap * value;
                }
            }
            blur_across(taps, &padded, c, &mut out);
        },
    );
    out
}

/// One row of the window means of x, y, x², y², xy.
fn window_row<F: Real>(
    taps: &[F; TAPS],
    x: &[F],
    y: &[F],
    row: usize,
    row_len: usize,
    height: usize,
    c: usize,
) -> [Vec<F>; 5] {
    let mut padded = [(); 5].map(|()| vec![F::zero(); row_len + 2 * RADIUS * c]);
    let mut out = [(); 5].map(|()| vec![F::zero(); row_len]);
    pulp::Arch::new().dispatch(
        #[inline(always)]
        || {
            let [mx, my, xx, yy, xy] =
                padded.each_mut().map(|plane| &mut plane[RADIUS * c..RADIUS * c + row_len]);
            for (other, tap) in rows_under(taps, row, height) {
                let (x, y) = (&x[other * row_len..][..row_len], &y[other * row_len..][..row_len]);
                for k in 0..row_len {
                    let (tx, ty) = (tap * x[k], tap * y[k]);
                    mx[k] += tx;
                    my[k] += ty;
                    xx[k] += tx * x[k];
                    yy[k] += ty * y[k];
                    xy[k] += tx * y[k];
                }
            }
            for (padded, out) in padded.iter().zip(&mut out) {
                blur_across(taps, padded, c, out);
            }
        },
    );
    out
}
