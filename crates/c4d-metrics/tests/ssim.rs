//! SSIM equals scikit-image's values; its gradient equals finite differences in double precision.

use c4d_metrics::{Ssim, SsimBorder};
use std::fs;
use test_support::noise::noise_pair;

#[test]
fn ssim_equals_scikit_image() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/metrics/ssim.txt");
    let table = fs::read_to_string(path).unwrap();
    let mut cases = 0;
    for line in table.lines().filter(|line| !line.starts_with('#') && !line.is_empty()) {
        let fields: Vec<f64> =
            line.split_whitespace().map(|field| field.parse().unwrap()).collect();
        let [width, height, channels, seed, noise, expected] = fields[..] else {
            panic!("malformed line {line}")
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small counts")]
        let size = [width, height, channels, seed].map(|value| value as u32);
        let [w, h, c] = [size[0], size[1], size[2]].map(|side| side as usize);
        let [x, y] = noise_pair([w, h, c], size[3], noise);
        let ours = Ssim::new(w, h, c).value(&x, &y, SsimBorder::Valid);
        // worst seen 3.6e-16
        assert!((ours - expected).abs() < 2e-15, "{line}: {ours}");
        let zero = Ssim::new(w, h, c).value(&x, &y, SsimBorder::Zero);
        assert!((zero - expected).abs() > 1e-6 || noise == 0.0, "{line}: the border matters");
        #[expect(clippy::cast_possible_truncation, reason = "the test compares single precision")]
        let single = |values: &[f64]| values.iter().map(|&v| v as f32).collect::<Vec<f32>>();
        let ours = Ssim::<f32>::new(w, h, c).value(&single(&x), &single(&y), SsimBorder::Valid);
        assert!((f64::from(ours) - expected).abs() < 2e-5, "{line}: {ours} in single precision");
        cases += 1;
    }
    assert!(cases >= 4, "{cases} cases");
}

#[test]
fn ssim_of_equal_images_is_one_even_at_the_border() {
    let [x, _] = noise_pair([17, 9, 3], 5, 0.0);
    let mut ssim = Ssim::new(17, 9, 3);
    assert!((ssim.value(&x, &x, SsimBorder::Zero) - 1.0).abs() < 1e-14, "mean");
    let mut v_x = vec![0.0; x.len()];
    let loss = ssim.loss(&x, &x, 1.0, 1.0, &mut v_x, None);
    assert!(loss.abs() < 1e-10 && v_x.iter().all(|g| g.abs() < 1e-9), "a minimum: {loss}");
    // smaller than the window
    let [x, y] = noise_pair([3, 2, 1], 5, 0.5);
    assert!(Ssim::new(3, 2, 1).value(&x, &y, SsimBorder::Zero) < 1.0, "tiny images work");
    assert_eq!(Ssim::<f64>::new(3, 2, 1).value(&x, &y, SsimBorder::Valid), 0.0, "no window inside");
    assert_eq!(Ssim::<f64>::new(0, 0, 3).value(&[], &[], SsimBorder::Zero), 0.0, "no pixels");
}

/// Central difference of `f` along entry `k`.
fn difference(x: &[f64], k: usize, step: f64, f: &mut dyn FnMut(&[f64]) -> f64) -> f64 {
    let mut moved = x.to_vec();
    moved[k] = x[k] + step;
    let up = f(&moved);
    moved[k] = x[k] - step;
    (up - f(&moved)) / (2.0 * step)
}

#[test]
fn ssim_gradient_is_the_difference_quotient() {
    let (w, h, c) = (14, 12, 3);
    let [x, y] = noise_pair([w, h, c], 11, 0.4);
    let norm = 1.0 / (w * h * c) as f64;
    let mut ssim = Ssim::new(w, h, c);
    let mut v_x = vec![0.0; x.len()];
    ssim.loss(&x, &y, norm, 1.0, &mut v_x, None);
    let largest = v_x.iter().fold(0.0_f64, |a, g| a.max(g.abs()));
    for k in (0..x.len()).step_by(7) {
        let numeric = difference(&x, k, 1e-5, &mut |x| {
            1.0 - Ssim::new(w, h, c).value(x, &y, SsimBorder::Zero)
        });
        // worst seen 1.4e-9 of the largest entry
        assert!((v_x[k] - numeric).abs() < 3e-9 * largest, "{k}: {} {numeric}", v_x[k]);
    }
}
