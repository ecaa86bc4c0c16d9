//! ꟻLIP and MS-SSIM against values of other implementations (`fixtures/metrics`).

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use c4d_metrics::{FLIP_PIXELS_PER_DEGREE, flip, flip_map, ms_ssim, psnr};
use gs_core::Image;
use test_support::noise::Lcg;

/// Stripes with sharp edges and noise, and a perturbed copy.
fn pair(width: usize, height: usize, seed: u32, noise: f64) -> [Image; 2] {
    let mut lcg = Lcg(seed);
    let mut first = Vec::new();
    for y in 0..height {
        for x in 0..width {
            for c in 0..3 {
                let stripes = ((x * (3 + c) + y * (5 - c)) % 64) as f64 / 63.0;
                first.push(0.6 * stripes + 0.4 * lcg.sample());
            }
        }
    }
    let second = lcg.disturb(&first, noise);
    #[expect(clippy::cast_possible_truncation, reason = "images are single precision")]
    let image = |values: &[f64]| {
        let data = values.iter().map(|&v| v as f32).collect();
        Image::from_data(width, height, 3, data).unwrap()
    };
    [image(&first), image(&second)]
}

/// Numbers in the lines of a fixture.
fn lines(name: &str) -> Vec<Vec<f64>> {
    let path = format!("{}/../../fixtures/metrics/{name}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split_whitespace().map(|field| field.parse().unwrap()).collect())
        .collect()
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small counts")]
fn pair_of(line: &[f64]) -> [Image; 2] {
    pair(line[0] as usize, line[1] as usize, line[2] as u32, line[3])
}

#[test]
fn flip_equals_the_reference() {
    let lines = lines("flip.txt");
    assert_eq!(lines.len(), 5, "cases");
    for line in lines {
        let [reference, test] = pair_of(&line);
        let mean = flip(&test, &reference).unwrap();
        // worst seen 3.5e-7
        assert!((mean - line[4]).abs() < 1e-6, "{line:?}: mean {mean}");
        let map = flip_map(&test, &reference, FLIP_PIXELS_PER_DEGREE).unwrap();
        let step = (map.data.len() / 5).max(1);
        for (k, expected) in line[5..].iter().enumerate() {
            let ours = f64::from(map.data[k * step]);
            // worst seen 7.3e-7
            assert!((ours - expected).abs() < 2e-6, "{line:?}: value {k} is {ours}");
        }
        let off = flip_map(&test, &reference, 0.9 * FLIP_PIXELS_PER_DEGREE).unwrap();
        let mean_off = off.data.iter().map(|&v| f64::from(v)).sum::<f64>() / off.data.len() as f64;
        assert!((mean_off - line[4]).abs() > 1e-4, "a different distance to the screen differs");
    }
}

#[test]
fn ms_ssim_equals_the_reference() {
    let lines = lines("ms_ssim.txt");
    assert_eq!(lines.len(), 3, "cases");
    for line in lines {
        let [x, y] = pair_of(&line);
        let value = ms_ssim(&x, &y).unwrap();
        // worst seen 1.5e-6
        assert!((value - line[4]).abs() < 4e-6, "{line:?}: {value}");
    }
}

#[test]
fn equal_images_score_perfectly_and_invalid_ones_are_refused() {
    let [x, y] = pair(180, 176, 9, 0.3);
    assert_eq!(flip(&x, &x), Some(0.0), "flip");
    assert_eq!(psnr(&x, &x), Some(100.0), "psnr");
    assert!((ms_ssim(&x, &x).unwrap() - 1.0).abs() < 1e-6, "ms_ssim");
    assert!(flip(&x, &y).unwrap() > 0.05, "they differ");
    let small = pair(100, 176, 9, 0.3);
    assert_eq!(ms_ssim(&small[0], &small[1]), None, "too small for five scales");
    assert_eq!(flip(&x, &small[0]), None, "a different size");
    let grey = Image::zeros(180, 176, 1);
    assert_eq!(flip(&grey, &grey), None, "no colours");
}
