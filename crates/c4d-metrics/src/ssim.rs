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
                let (x, y) = (&x[row * row_len..][..row_len], &y[row * row_len..][..row_len]);
                let mut work = vec![F::zero(); row_len + 2 * RADIUS * c];
                let mut blurred = vec![F::zero(); row_len];
                dispatch(
                    #[inline(always)]
                    || {
                        // The planes hold the gradient of the similarity; the loss has the opposite
                        // sign.
                        let rows = rows_under(taps, row, height);
                        blur_row(taps, &planes[0], &rows, c, &mut work, &mut blurred);
                        for (v, &mean) in v_x.iter_mut().zip(&blurred) {
                            *v -= factor * mean;
                        }
                        blur_row(taps, &planes[1], &rows, c, &mut work, &mut blurred);
                        for ((v, &square), &x) in v_x.iter_mut().zip(&blurred).zip(x) {
                            *v -= factor * two * x * square;
                        }
                        blur_row(taps, &planes[2], &rows, c, &mut work, &mut blurred);
                        for ((v, &cross), &y) in v_x.iter_mut().zip(&blurred).zip(y) {
                            *v -= factor * y * cross;
                        }
                        if bends {
                            blur_row(taps, &planes[3], &rows, c, &mut work, &mut blurred);
                            for (bent, &bend) in bent.iter_mut().zip(&blurred) {
                                *bent += factor * two * bend;
                            }
                        }
                    },
                );
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
        let [mean, square, cross, bend] = &mut self.planes;
        let body = |row: usize, map: &mut [F], out: Option<[&mut [F]; 4]>| {
            let mut work = [(); 5].map(|()| vec![F::zero(); row_len + 2 * RADIUS * c]);
            let mut means = [(); 5].map(|()| vec![F::zero(); row_len]);
            dispatch(
                #[inline(always)]
                || {
                    let rows = rows_under(taps, row, height);
                    window_row(taps, x, y, &rows, c, &mut work, &mut means);
                    let means = means.each_ref().map(Vec::as_slice);
                    match (term, out) {
                        (Term::ContrastStructure, _) => {
                            fill_row(means, map, |[_, a2, _, b2]| a2 / b2);
                        }
                        (Term::Whole, None) => {
                            fill_row(means, map, |[a1, a2, b1, b2]| a1 * a2 / (b1 * b2));
                        }
                        (Term::Whole, Some(out)) => derive_row(means, map, out),
                    }
                },
            );
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
) -> impl Iterator<Item = (usize, F)> + Clone {
    let first = row.saturating_sub(RADIUS);
    let last = (row + RADIUS).min(height - 1);
    (first..=last).map(move |other| (other, taps[other + RADIUS - row]))
}

/// Numerators and denominators of `SSIM = a1·a2 / (b1·b2)` from the window means of x, y, x², y²,
/// xy.
#[inline(always)]
#[expect(clippy::inline_always, reason = "must be compiled for the dispatched vector unit")]
fn terms<F: Real>([ux, uy, xx, yy, xy]: [F; 5]) -> [F; 4] {
    let (two, c1, c2) = (F::of(2.0), F::from_double(C1), F::from_double(C2));
    let a1 = two * ux * uy + c1;
    let a2 = two * (xy - ux * uy) + c2;
    let b1 = ux * ux + uy * uy + c1;
    let b2 = (xx - ux * ux) + (yy - uy * uy) + c2;
    [a1, a2, b1, b2]
}

/// [`terms`] of value `k` of a row.
#[inline(always)]
#[expect(clippy::inline_always, reason = "must be compiled for the dispatched vector unit")]
fn terms_at<F: Real>(means: [&[F]; 5], k: usize) -> [F; 4] {
    terms(means.map(|plane| plane[k]))
}

/// A row of the map, each entry from its [`terms`].
#[inline(always)]
#[expect(clippy::inline_always, reason = "must be compiled for the dispatched vector unit")]
fn fill_row<F: Real>(means: [&[F]; 5], map: &mut [F], entry: impl Fn([F; 4]) -> F) {
    // Slices of the same length, so that the loop vectorises.
    let means = means.map(|plane| &plane[..map.len()]);
    for (k, map) in map.iter_mut().enumerate() {
        *map = entry(terms_at(means, k));
    }
}

/// A row of the map, and of the planes of derivatives (in the order of [`Ssim::planes`]).
#[inline(always)]
#[expect(clippy::inline_always, reason = "must be compiled for the dispatched vector unit")]
fn derive_row<F: Real>(means: [&[F]; 5], map: &mut [F], out: [&mut [F]; 4]) {
    let (len, two) = (map.len(), F::of(2.0));
    // Slices of the same length, so that the loop vectorises.
    let means = means.map(|plane| &plane[..len]);
    let [mean, square, cross, bend] = out.map(|plane| &mut plane[..len]);
    let (ux, uy) = (means[0], means[1]);
    for k in 0..len {
        let [a1, a2, b1, b2] = terms_at(means, k);
        let both = F::one() / (b1 * b2);
        let (inverse1, inverse2) = (b2 * both, b1 * both);
        let s = a1 * a2 * both;
        map[k] = s;
        mean[k] = two * (uy[k] * (a2 - a1) * both + s * ux[k] * (inverse2 - inverse1));
        square[k] = -s * inverse2;
        cross[k] = two * a1 * both;
        bend[k] = if inverse1 > inverse2 { inverse1 } else { inverse2 };
    }
}

/// Runs `body` compiled for the best instruction set of this machine. It must be an `FnOnce` that
/// is inlined; inferred as `Fn`, it would be compiled for the baseline.
#[inline(always)]
#[expect(clippy::inline_always, reason = "must be compiled for the dispatched vector unit")]
fn dispatch<R>(body: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(body)
}

/// Values of a row that are summed at once: their five sums fit into the registers of AVX2 (ten of
/// sixteen) and AVX-512 (five of 32).
const BLOCK: usize = 16;

/// `Σ_t taps[t] · padded[k + t·c]` for `N` consecutive `k`.
#[inline(always)]
#[expect(clippy::inline_always, reason = "must be compiled for the dispatched vector unit")]
fn sum_across<F: Real, const N: usize>(
    taps: &[F; TAPS],
    padded: &[F],
    k: usize,
    c: usize,
) -> [F; N] {
    let mut sum = [F::zero(); N];
    for (t, &tap) in taps.iter().enumerate() {
        if let Some(values) = padded[k + t * c..].first_chunk::<N>() {
            for i in 0..N {
                sum[i] += tap * values[i];
            }
        }
    }
    sum
}

/// Overwrites `out` with `Σ_t taps[t] · padded[k + t·c]`.
#[inline(always)]
#[expect(clippy::inline_always, reason = "must be compiled for the dispatched vector unit")]
fn blur_across<F: Real>(taps: &[F; TAPS], padded: &[F], c: usize, out: &mut [F]) {
    let (blocks, rest) = out.as_chunks_mut::<BLOCK>();
    let whole = blocks.len() * BLOCK;
    for (b, out) in blocks.iter_mut().enumerate() {
        *out = sum_across::<F, BLOCK>(taps, padded, b * BLOCK, c);
    }
    for (i, out) in rest.iter_mut().enumerate() {
        [*out] = sum_across::<F, 1>(taps, padded, whole + i, c);
    }
}

/// Overwrites `out` with one row of the blurred plane; `rows` are those in its window, `padded` is
/// work memory with zeros around a row.
#[inline(always)]
#[expect(clippy::inline_always, reason = "must be compiled for the dispatched vector unit")]
fn blur_row<F: Real>(
    taps: &[F; TAPS],
    plane: &[F],
    rows: &(impl Iterator<Item = (usize, F)> + Clone),
    c: usize,
    padded: &mut [F],
    out: &mut [F],
) {
    let row_len = out.len();
    let inner = &mut padded[RADIUS * c..RADIUS * c + row_len];
    let (blocks, rest) = inner.as_chunks_mut::<BLOCK>();
    let whole = blocks.len() * BLOCK;
    for (b, inner) in blocks.iter_mut().enumerate() {
        *inner = sum_down::<F, BLOCK>(plane, rows.clone(), row_len, b * BLOCK);
    }
    for (i, inner) in rest.iter_mut().enumerate() {
        [*inner] = sum_down::<F, 1>(plane, rows.clone(), row_len, whole + i);
    }
    blur_across(taps, padded, c, out);
}

/// Sums over `rows` for `N` consecutive values.
#[inline(always)]
#[expect(clippy::inline_always, reason = "must be compiled for the dispatched vector unit")]
fn sum_down<F: Real, const N: usize>(
    plane: &[F],
    rows: impl Iterator<Item = (usize, F)>,
    row_len: usize,
    k: usize,
) -> [F; N] {
    let mut sum = [F::zero(); N];
    for (other, tap) in rows {
        if let Some(values) = plane[other * row_len + k..].first_chunk::<N>() {
            for i in 0..N {
                sum[i] += tap * values[i];
            }
        }
    }
    sum
}

/// As [`sum_down`], of x, y, x², y², xy.
#[inline(always)]
#[expect(clippy::inline_always, reason = "must be compiled for the dispatched vector unit")]
fn moments_down<F: Real, const N: usize>(
    (x, y): (&[F], &[F]),
    rows: impl Iterator<Item = (usize, F)>,
    row_len: usize,
    k: usize,
) -> [[F; N]; 5] {
    let [mut mx, mut my, mut xx, mut yy, mut xy] = [[F::zero(); N]; 5];
    for (other, tap) in rows {
        let at = other * row_len + k;
        if let (Some(x), Some(y)) = (x[at..].first_chunk::<N>(), y[at..].first_chunk::<N>()) {
            for i in 0..N {
                let (tx, ty) = (tap * x[i], tap * y[i]);
                mx[i] += tx;
                my[i] += ty;
                xx[i] += tx * x[i];
                yy[i] += ty * y[i];
                xy[i] += tx * y[i];
            }
        }
    }
    [mx, my, xx, yy, xy]
}

/// Overwrites `means` with one row of the window means of x, y, x², y², xy; `rows` and `padded` as
/// in [`blur_row`].
#[inline(always)]
#[expect(clippy::inline_always, reason = "must be compiled for the dispatched vector unit")]
fn window_row<F: Real>(
    taps: &[F; TAPS],
    x: &[F],
    y: &[F],
    rows: &(impl Iterator<Item = (usize, F)> + Clone),
    c: usize,
    padded: &mut [Vec<F>; 5],
    means: &mut [Vec<F>; 5],
) {
    let row_len = means[0].len();
    let first = RADIUS * c;
    let whole = row_len - row_len % BLOCK;
    for k in (0..whole).step_by(BLOCK) {
        let moments = moments_down::<F, BLOCK>((x, y), rows.clone(), row_len, k);
        for (padded, moment) in padded.iter_mut().zip(moments) {
            padded[first + k..first + k + BLOCK].copy_from_slice(&moment);
        }
    }
    for k in whole..row_len {
        let moments = moments_down::<F, 1>((x, y), rows.clone(), row_len, k);
        for (padded, [moment]) in padded.iter_mut().zip(moments) {
            padded[first + k] = moment;
        }
    }
    for (padded, mean) in padded.iter().zip(means) {
        blur_across(taps, padded, c, mean);
    }
}
