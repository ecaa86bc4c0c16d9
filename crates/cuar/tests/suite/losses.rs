//! Losses and their gradients: finite differences in double precision, curvature bounds.

use c4d_metrics::{Ssim, SsimBorder};
use cuar::loss::{L1Shape, LossWeights, Objective, Targets, masked_l1};
use test_support::noise::noise_pair;

/// Central difference of `f` along entry `k`.
fn difference(x: &[f64], k: usize, step: f64, f: &mut dyn FnMut(&[f64]) -> f64) -> f64 {
    let mut moved = x.to_vec();
    moved[k] = x[k] + step;
    let up = f(&moved);
    moved[k] = x[k] - step;
    (up - f(&moved)) / (2.0 * step)
}

#[test]
fn masked_l1_gradient_is_the_difference_quotient() {
    let [x, y] = noise_pair([6, 5, 3], 3, 0.5);
    let mask: Vec<f64> = (0..30).map(|p| [0.0, 1.0, 0.5][p % 3]).collect();
    let mut v_x = vec![0.0; x.len()];
    masked_l1(&x, &y, &mask, 0.25, &mut v_x);
    for k in 0..x.len() {
        let numeric = difference(&x, k, 1e-7, &mut |x| {
            masked_l1(x, &y, &mask, 0.25, &mut vec![0.0; x.len()])
        });
        assert!((v_x[k] - numeric).abs() < 1e-7, "{k}: {} {numeric}", v_x[k]);
    }
}

struct Case {
    width: usize,
    height: usize,
    render: Vec<f64>,
    original: Vec<f64>,
    warp: Vec<f64>,
    fore: Vec<f64>,
    back: Vec<f64>,
}

impl Case {
    /// Left half artifact (some of it unsupervised), right half background.
    fn new() -> Self {
        let (width, height) = (18, 13);
        let [render, original] = noise_pair([width, height, 3], 21, 0.3);
        let [_, warp] = noise_pair([width, height, 3], 22, 0.6);
        let left = |p: usize| p % width < 9;
        let flag = |on: bool| f64::from(u8::from(on));
        let pixels = 0..width * height;
        let fore = pixels.clone().map(|p| flag(left(p) && p % 5 != 0)).collect();
        let back = pixels.map(|p| flag(!left(p))).collect();
        Self { width, height, render, original, warp, fore, back }
    }

    fn targets(&self) -> Targets<'_, f64> {
        Targets { original: &self.original, warp: &self.warp, fore: &self.fore, back: &self.back }
    }

    fn objective(&self) -> Objective<f64> {
        Objective::new(self.width, self.height, self.width * self.height, LossWeights::default())
    }

    fn total(&self, render: &[f64]) -> f64 {
        self.objective()
            .evaluate(render, &self.targets(), L1Shape::Exact, &mut Vec::new(), None)
            .total(LossWeights::default())
    }
}

#[test]
fn objective_equals_equations_18_to_20() {
    let case = Case::new();
    let parts = case.objective().evaluate(
        &case.render,
        &case.targets(),
        L1Shape::Exact,
        &mut Vec::new(),
        None,
    );
    let count = case.render.len() as f64;
    let mean = |mask: &[f64], other: &[f64]| {
        let terms = (0..case.render.len()).map(|k| mask[k / 3] * (case.render[k] - other[k]).abs());
        terms.sum::<f64>() / count
    };
    let masked = |image: &[f64]| -> Vec<f64> {
        image.iter().enumerate().map(|(k, v)| v * case.fore[k / 3]).collect()
    };
    let similarity = Ssim::new(case.width, case.height, 3).value(
        &masked(&case.render),
        &masked(&case.warp),
        SsimBorder::Zero,
    );
    let fore = 0.8 * mean(&case.fore, &case.warp) + 0.2 * (1.0 - similarity);
    let expected = 0.7 * fore + 0.3 * mean(&case.back, &case.original);
    let ours = parts.total(LossWeights::default());
    assert!((ours - expected).abs() < 1e-12, "{ours} {expected}");
}

#[test]
fn objective_gradient_is_the_difference_quotient() {
    let case = Case::new();
    let mut gradient = Vec::new();
    case.objective().evaluate(&case.render, &case.targets(), L1Shape::Exact, &mut gradient, None);
    let largest = gradient.iter().fold(0.0_f64, |a, g| a.max(g.abs()));
    let mut free = 0;
    for k in 0..case.render.len() {
        let numeric = difference(&case.render, k, 1e-6, &mut |x| case.total(x));
        assert!((gradient[k] - numeric).abs() < 1e-6 * largest, "{k}: {} {numeric}", gradient[k]);
        free += usize::from(gradient[k] == 0.0);
    }
    assert!(free > 0 && free < case.render.len() / 4, "unsupervised pixels are free: {free}");
}

/// A crop that contains all supervised pixels gives the result of the full image.
#[test]
fn crops_are_exact() {
    let (w, h, x0, y0, cw, ch) = (40, 30, 9, 6, 24, 20);
    let [render, _] = noise_pair([w, h, 3], 1, 0.0);
    let [_, warp] = noise_pair([w, h, 3], 2, 0.6);
    // 5 pixels of free margin inside the crop: half a window
    let inside = |p: usize| {
        let (x, y) = (p % w, p / w);
        (x0 + 5..x0 + cw - 5).contains(&x) && (y0 + 5..y0 + ch - 5).contains(&y)
    };
    let fore: Vec<f64> = (0..w * h).map(|p| f64::from(u8::from(inside(p)))).collect();
    let back = vec![0.0; w * h];
    let cut = |image: &[f64], c: usize| -> Vec<f64> {
        (y0..y0 + ch).flat_map(|y| image[(y * w + x0) * c..][..cw * c].to_vec()).collect()
    };
    let weights = LossWeights::default();
    let mut full_gradient = Vec::new();
    let targets = Targets { original: &render, warp: &warp, fore: &fore, back: &back };
    let full = Objective::new(w, h, w * h, weights).evaluate(
        &render,
        &targets,
        L1Shape::Exact,
        &mut full_gradient,
        None,
    );
    let [crop_render, crop_warp] = [cut(&render, 3), cut(&warp, 3)];
    let [crop_fore, crop_back] = [cut(&fore, 1), cut(&back, 1)];
    let targets =
        Targets { original: &crop_render, warp: &crop_warp, fore: &crop_fore, back: &crop_back };
    let mut gradient = Vec::new();
    let crop = Objective::new(cw, ch, w * h, weights).evaluate(
        &crop_render,
        &targets,
        L1Shape::Exact,
        &mut gradient,
        None,
    );
    assert!((full.total(weights) - crop.total(weights)).abs() < 1e-13, "{full:?} {crop:?}");
    for (a, b) in cut(&full_gradient, 3).iter().zip(&gradient) {
        assert!((a - b).abs() < 1e-15, "{a} {b}");
    }
}

/// One step of size 1/curvature along any direction must not increase the smoothed objective, which
/// the regression solver assumes. The bound freezes the variances of the windows, so it is tested
/// on similar images, with a small tolerance.
#[test]
fn curvature_bounds_the_objective() {
    let case = Case::new();
    let (mut gradient, mut curvature) = (Vec::new(), Vec::new());
    let mut objective = case.objective();
    let delta = 0.02;
    objective.evaluate(
        &case.render,
        &case.targets(),
        L1Shape::Smooth(delta),
        &mut gradient,
        Some(&mut curvature),
    );
    let mut render = case.render.clone();
    let mut last = case.total(&render);
    for step in 0..6 {
        for k in 0..render.len() {
            if curvature[k / 3] > 0.0 {
                render[k] -= gradient[k] / curvature[k / 3];
            }
        }
        let parts = objective.evaluate(
            &render,
            &case.targets(),
            L1Shape::Smooth(delta),
            &mut gradient,
            Some(&mut curvature),
        );
        let loss = parts.total(LossWeights::default());
        assert!(loss <= last + 1e-3 * last, "step {step}: {last} → {loss}");
        last = loss;
    }
    assert!(last < 0.3 * case.total(&case.render), "converges: {last}");
}

#[test]
fn smooth_gradient_is_the_difference_quotient_of_the_smooth_value() {
    let case = Case::new();
    let shape = L1Shape::Smooth(0.05);
    let value = |render: &[f64]| {
        let parts =
            case.objective().evaluate(render, &case.targets(), shape, &mut Vec::new(), None);
        parts.shaped_total(LossWeights::default())
    };
    let mut gradient = Vec::new();
    case.objective().evaluate(&case.render, &case.targets(), shape, &mut gradient, None);
    let largest = gradient.iter().fold(0.0_f64, |a, g| a.max(g.abs()));
    for k in (0..case.render.len()).step_by(5) {
        let numeric = difference(&case.render, k, 1e-6, &mut |x| value(x));
        assert!((gradient[k] - numeric).abs() < 1e-6 * largest, "{k}: {} {numeric}", gradient[k]);
    }
}

/// The smooth gradient is that of `√(r² + δ²)`.
#[test]
fn smooth_gradient_tends_to_the_exact_one() {
    let case = Case::new();
    let gradient = |shape| {
        let mut gradient = Vec::new();
        case.objective().evaluate(&case.render, &case.targets(), shape, &mut gradient, None);
        gradient
    };
    let exact = gradient(L1Shape::Exact);
    let close = gradient(L1Shape::Smooth(1e-7));
    let far = gradient(L1Shape::Smooth(0.5));
    let distance = |a: &[f64]| -> f64 { a.iter().zip(&exact).map(|(a, b)| (a - b).abs()).sum() };
    assert!(distance(&close) < 1e-4 * distance(&far), "{} {}", distance(&close), distance(&far));
}
