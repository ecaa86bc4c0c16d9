//! Images of unusual scenes equal a direct implementation of the image
//! formation, in which every pixel visits every splat.

use crate::scenes::{Scene, random};
use gs_core::{Camera, Rasterizer, RenderParams, Splats, covariance, sh};
use gs_raster_cpu::{CpuRasterizer, Prepared};
use test_support::compare::{assert_close, max_abs_diff};

const BACKGROUND: [f64; 3] = [0.2, 0.5, 0.9];

struct Flat {
    mean: [f64; 2],
    conic: [f64; 3],
    rect: [f64; 4],
    values: Vec<f64>,
    opacity: f64,
    depth: f64,
}

/// Steps 1 to 10 of the image formation, for unclamped directions and finite splats.
fn flatten(scene: &Scene<f64>, id: usize) -> Option<Flat> {
    let (splats, camera) = (&scene.splats, &scene.camera);
    let k = camera.intrinsics;
    let (w, h) = (f64::from(camera.width), f64::from(camera.height));
    let [x, y, z] = camera.to_camera(splats.means[id]);
    if z <= f64::from(0.2_f32) {
        return None;
    }
    let sigma = covariance(splats.rotation(id), splats.scale(id));
    let full = [
        [sigma[0], sigma[1], sigma[2]],
        [sigma[1], sigma[3], sigma[4]],
        [sigma[2], sigma[4], sigma[5]],
    ];
    let band = f64::from(1.3_f32);
    let clamp = |v: f64, tan: f64| (v / z).clamp(-band * tan, band * tan) * z;
    let (cx, cy) = (clamp(x, w / (2.0 * k.fx)), clamp(y, h / (2.0 * k.fy)));
    let jacobian = [[k.fx / z, 0.0, -k.fx * cx / (z * z)], [0.0, k.fy / z, -k.fy * cy / (z * z)]];
    let t = jacobian
        .map(|row| [0, 1, 2].map(|j| (0..3).map(|i| row[i] * camera.viewmat[i][j]).sum::<f64>()));
    let entry = |a: [f64; 3], b: [f64; 3]| {
        (0..3).map(|i| (0..3).map(|j| a[i] * full[i][j] * b[j]).sum::<f64>()).sum::<f64>()
    };
    let low_pass = f64::from(0.3_f32);
    let (a, b, c) = (entry(t[0], t[0]) + low_pass, entry(t[0], t[1]), entry(t[1], t[1]) + low_pass);
    let det = a * c - b * b;
    let mid = f64::midpoint(a, c);
    let radius = (3.0 * (mid + f64::from(0.1_f32).max(mid * mid - det).sqrt()).sqrt()).ceil();
    let r = 1.0 / (z + f64::from(1e-7_f32));
    let mean = [
        (k.fx * x + (k.cx - w / 2.0) * z) * r + (w - 1.0) / 2.0,
        (k.fy * y + (k.cy - h / 2.0) * z) * r + (h - 1.0) / 2.0,
    ];
    let low = |m: f64, n: f64| ((m - radius) / 16.0).trunc().clamp(0.0, (n / 16.0).ceil()) * 16.0;
    let high =
        |m: f64, n: f64| ((m + radius + 15.0) / 16.0).trunc().clamp(0.0, (n / 16.0).ceil()) * 16.0;
    let eye = camera.position();
    let d = [0, 1, 2].map(|i| splats.means[id][i] - eye[i]);
    let length = d.iter().map(|v| v * v).sum::<f64>().sqrt();
    let rgb = sh::color(splats.sh_degree, splats.sh_of(id), d.map(|v| v / length));
    let num_features = scene.features.len() / splats.len();
    let mut values = rgb.map(|v| v.max(0.0)).to_vec();
    values.push(z);
    values.extend(&scene.features[id * num_features..(id + 1) * num_features]);
    Some(Flat {
        mean,
        conic: [c / det, -b / det, a / det],
        rect: [low(mean[0], w), low(mean[1], h), high(mean[0], w), high(mean[1], h)],
        values,
        opacity: splats.opacity(id),
        depth: z,
    })
}

/// All channels, then alpha, per pixel.
fn brute_force(scene: &Scene<f64>) -> Vec<Vec<f64>> {
    let mut flats: Vec<Flat> =
        (0..scene.splats.len()).filter_map(|id| flatten(scene, id)).collect();
    #[expect(clippy::cast_possible_truncation, reason = "the depth key is single precision")]
    flats.sort_by_key(|flat| (flat.depth as f32).to_bits());
    let num_features = scene.features.len().checked_div(scene.splats.len()).unwrap_or(0);
    let mut out = Vec::new();
    for j in 0..scene.camera.height {
        for i in 0..scene.camera.width {
            let (x, y) = (f64::from(i), f64::from(j));
            let mut sums = vec![0.0; 4 + num_features];
            let mut t = 1.0;
            for flat in &flats {
                let [x0, y0, x1, y1] = flat.rect;
                let (dx, dy) = (flat.mean[0] - x, flat.mean[1] - y);
                let [a, b, c] = flat.conic;
                let power = -0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy;
                let alpha = f64::from(0.99_f32).min(flat.opacity * power.exp());
                let clipped = x < x0 || x >= x1 || y < y0 || y >= y1;
                if clipped || power > 0.0 || alpha < f64::from(1.0_f32 / 255.0) {
                    continue;
                }
                if t * (1.0 - alpha) < f64::from(1e-4_f32) {
                    break;
                }
                for (sum, value) in sums.iter_mut().zip(&flat.values) {
                    *sum += value * alpha * t;
                }
                t *= 1.0 - alpha;
            }
            for (sum, background) in sums.iter_mut().zip(BACKGROUND) {
                *sum += t * background;
            }
            sums.push(1.0 - t);
            out.push(sums);
        }
    }
    out
}

/// Renders in double and in single precision and compares both with brute force.
fn check(what: &str, scene: &Scene<f64>) {
    let params = RenderParams { background: BACKGROUND, ..RenderParams::default() };
    let truth = brute_force(scene);
    let num_features = scene.features.len().checked_div(scene.splats.len()).unwrap_or(0);
    let raster = CpuRasterizer::default();

    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    let out = raster.forward(&mut prepared, &scene.splats, &scene.features, &params).unwrap();
    let channel = |c: usize| truth.iter().map(|pixel| pixel[c]).collect::<Vec<f64>>();
    for c in 0..3 {
        let ours: Vec<f64> = out.rgb.iter().skip(c).step_by(3).copied().collect();
        assert_close(&format!("{what}: rgb {c}"), &ours, &channel(c), 2e-6, 0.0);
    }
    assert_close(&format!("{what}: depth"), &out.depth, &channel(3), 1e-11, 1e-11);
    assert_close(&format!("{what}: alpha"), &out.alpha, &channel(4 + num_features), 1e-12, 0.0);
    for f in 0..num_features {
        let ours: Vec<f64> = out.features.iter().skip(f).step_by(num_features).copied().collect();
        assert_close(&format!("{what}: feature {f}"), &ours, &channel(4 + f), 1e-11, 0.0);
    }

    // Borderline samples may differ in single precision: the bound per value is loose, that of the
    // mean is tight.
    let splats: Splats<f32> = scene.splats.cast();
    let features: Vec<f32> = scene.features.iter().map(|&f| gs_core::Real::as_f32(f)).collect();
    let mut prepared: Prepared<f32> = raster.prepare(&splats, &scene.camera).unwrap();
    let single = raster.forward(&mut prepared, &splats, &features, &params).unwrap();
    let wide = test_support::compare::widen(&single.rgb);
    assert!(max_abs_diff(&wide, &out.rgb) < 0.02, "{what}: single precision is off");
    let mean =
        wide.iter().zip(&out.rgb).map(|(a, b)| (a - b).abs()).sum::<f64>() / wide.len() as f64;
    assert!(mean < 1e-5, "{what}: single precision is off by {mean:e} on average");
}

#[test]
fn counts_around_the_batch_and_chunk_sizes() {
    for count in [1, 31, 32, 33, 255, 256, 257] {
        check(&format!("{count} splats"), &random(count, 2, [50, 37], 7));
    }
}

#[test]
fn image_sizes_that_are_not_multiples_of_the_tile() {
    for size in [[1, 1], [1, 40], [17, 1], [16, 16], [15, 33], [65, 64], [129, 70]] {
        check(&format!("{size:?}"), &random(40, 1, size, 11));
    }
}

#[test]
fn more_channels_than_one_pass_holds() {
    for num_features in [3, 4, 5, 12, 21] {
        check(&format!("{num_features} features"), &random(30, num_features, [40, 30], 5));
    }
}

#[test]
fn one_splat_that_covers_the_image() {
    let mut scene = random(20, 1, [90, 50], 3);
    scene.splats.log_scales[4] = [2.0, 1.5, 1.8];
    scene.splats.opacity_logits[4] = -1.0;
    check("covering", &scene);
}

#[test]
fn capped_and_stopped_pixels() {
    let mut scene = random(120, 1, [48, 40], 9);
    for logit in &mut scene.splats.opacity_logits {
        *logit += 6.0;
    }
    check("opaque", &scene);
}

#[test]
fn ten_thousand_in_one_tile() {
    let mut scene = random(10_000, 0, [32, 32], 13);
    for (i, mean) in scene.splats.means.iter_mut().enumerate() {
        *mean = mean.map(|x| 0.02 * x);
        scene.splats.opacity_logits[i] -= 4.0;
        scene.splats.log_scales[i] = scene.splats.log_scales[i].map(|x| x - 1.5);
    }
    check("crowded", &scene);
}

#[test]
fn empty_and_off_screen_scenes() {
    let mut scene = random::<f64>(50, 1, [30, 20], 17);
    check(
        "no splats",
        &Scene { splats: scene.splats.select(&[]), features: vec![], camera: scene.camera.clone() },
    );
    let visible = scene.splats.means.clone();
    for mean in &mut scene.splats.means {
        mean[2] -= 40.0;
    }
    check("all behind", &scene);
    scene.splats.means.clone_from(&visible);
    for mean in &mut scene.splats.means {
        mean[0] += 60.0;
    }
    check("all off-screen", &scene);
}

/// Negative control: the comparison detects one missing splat.
#[test]
#[should_panic(expected = "control")]
fn a_missing_splat_is_detected() {
    let scene = random::<f64>(40, 0, [50, 37], 7);
    let truth = brute_force(&scene);
    let fewer: Vec<usize> = (1..40).collect();
    let splats = scene.splats.select(&fewer);
    let raster = CpuRasterizer::default();
    let camera: &Camera = &scene.camera;
    let mut prepared = raster.prepare(&splats, camera).unwrap();
    let out = raster.forward(&mut prepared, &splats, &[], &RenderParams::default()).unwrap();
    let alpha: Vec<f64> = truth.iter().map(|pixel| pixel[4]).collect();
    assert_close("control", &out.alpha, &alpha, 1e-12, 0.0);
}
