//! Images, radii, tile rectangles and pair counts equal those of the golden cases, in every mode.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod common;

use common::{MODES, Mode, raster};
use gs_core::{Rasterizer, RenderOutput};
use test_support::raster::{CASES, Case, check_images, image_errors};

fn render(mode: Mode, case: &Case<f32>) -> RenderOutput {
    let raster = raster(mode);
    let mut prepared = raster.prepare(&case.splats, &case.camera).unwrap();
    raster.forward(&mut prepared, &case.splats, &case.features, &case.params).unwrap()
}

/// Worst seen on llvmpipe: rgb 2.5e-6, alpha 2.1e-6, depth 5.9e-6, features 4.6e-6.
#[test]
fn images_match() {
    for mode in MODES {
        for name in CASES {
            let case = Case::<f32>::open(name);
            check_images(&format!("{mode:?}"), &case, &render(mode, &case));
        }
    }
}

#[test]
fn radii_rectangles_and_pairs_match_exactly() {
    for name in CASES {
        let case = Case::<f32>::open(name);
        let raster = raster(Mode::Portable);
        let mut prepared = raster.prepare(&case.splats, &case.camera).unwrap();
        // Non-finite colours are detected only when they are used.
        raster.forward(&mut prepared, &case.splats, &case.features, &case.params).unwrap();
        let radii: Vec<i32> =
            raster.radii(&mut prepared).unwrap().iter().map(|&r| r.cast_signed()).collect();
        assert_eq!(radii, case.golden.i32s("out.radii"), "{name}: radii");
        let stages = raster.stages(&mut prepared).unwrap();
        let mut pairs = 0;
        for (id, rect) in case.golden.i32s("out.tile_rect").as_chunks::<4>().0.iter().enumerate() {
            if radii[id] > 0 {
                let ours = stages.rects[id].map(u32::cast_signed);
                assert_eq!(ours, *rect, "{name} splat {id}: tile rectangle");
            }
            let [x0, y0, x1, y1] = stages.rects[id];
            pairs += ((x1 - x0) * (y1 - y0)) as usize;
        }
        assert_eq!(stages.num_rect_isects, pairs, "{name}: pairs");
    }
}

/// The projection stage equals the golden means, conics and depths.
#[test]
fn projection_matches() {
    for name in CASES {
        let case = Case::<f32>::open(name);
        let raster = raster(Mode::Portable);
        let mut prepared = raster.prepare(&case.splats, &case.camera).unwrap();
        let stages = raster.stages(&mut prepared).unwrap();
        let radii = case.golden.i32s("out.radii");
        let means = case.golden.f64s("stage.means2d_px");
        let conics = case.golden.f64s("stage.conic");
        let depths = case.golden.f64s("stage.depth");
        for (id, row) in stages.projected.iter().enumerate().filter(|(id, _)| radii[*id] > 0) {
            let close = |what: &str, ours: f32, expected: f64, tolerance: f64| {
                let error = (f64::from(ours) - expected).abs();
                assert!(
                    error <= tolerance,
                    "{name} splat {id}: {what} is {ours}, expected {expected}"
                );
            };
            for axis in 0..2 {
                let expected = means[2 * id + axis];
                // Coordinates are sums of terms of the order of the image size.
                let size = expected.abs() + f64::from(case.camera.width);
                close("mean", row[axis], expected, 1e-6 * size);
            }
            let [a, b, c] = [conics[3 * id], conics[3 * id + 1], conics[3 * id + 2]];
            // Cancellation in the determinant of thin splats enlarges
            // the error of the conic by this factor.
            let condition = a * c / (a * c - b * b);
            for (ours, expected) in [(row[2], a), (row[3], b), (row[4], c)] {
                close("conic", ours, expected, 4e-6 * condition * (a + c));
            }
            close("depth", row[6], depths[id], 1e-6 + 1e-6 * depths[id]);
        }
    }
}

/// Negative control: the comparison detects an image with one splat's opacity changed.
#[test]
fn a_changed_opacity_is_detected() {
    let mut case = Case::<f32>::open("c1_random200");
    for logit in &mut case.splats.opacity_logits[..20] {
        *logit += 0.01;
    }
    let out = render(Mode::Portable, &case);
    let (clear, _) = image_errors(&case, "rgb", &out.rgb);
    assert!(clear > 7e-6, "a changed scene passes: {clear:e}");
}
