//! Images, radii, tile rectangles and entry counts equal those of
//! the golden cases, in both float types.

use gs_core::{Rasterizer, Real, RenderOutput};
use gs_raster_cpu::{CpuRasterizer, Prepared};
use test_support::raster::{CASES, Case, check_images, image_errors};

fn check<F: Real>(double: bool)
where
    CpuRasterizer: Rasterizer<F, Prepared = Prepared<F>>,
{
    for name in CASES {
        let case = Case::<F>::open(name);
        let raster = CpuRasterizer::default();
        let mut prepared = raster.prepare(&case.splats, &case.camera).unwrap();
        let out =
            raster.forward(&mut prepared, &case.splats, &case.features, &case.params).unwrap();
        check_lists(&case, &prepared);
        if double {
            check_double(&case, &out);
        } else {
            check_images("f32", &case, &out);
        }
    }
}

fn check_lists<F: Real>(case: &Case<F>, prepared: &Prepared<F>)
where
    CpuRasterizer: Rasterizer<F>,
{
    let radii = case.golden.i32s("out.radii");
    let rects = case.golden.i32s("out.tile_rect");
    let mut pairs = 0;
    for (id, (&radius, rect)) in radii.iter().zip(rects.as_chunks::<4>().0).enumerate() {
        assert_eq!(i64::from(prepared.radius(id)), i64::from(radius), "{} splat {id}", case.name);
        let ours = prepared.tile_rect(id).unwrap_or_default().map(i32::from);
        assert_eq!(ours, *rect, "{} splat {id}: tile rectangle", case.name);
        pairs += (rect[2] - rect[0]) * (rect[3] - rect[1]);
    }
    assert_eq!(prepared.num_rect_isects(), usize::try_from(pairs).unwrap(), "{}: pairs", case.name);
    assert!(prepared.num_isects() <= prepared.num_rect_isects(), "{}: culling adds", case.name);
}

/// The stress case is stored in single precision.
fn check_double<F: Real>(case: &Case<F>, out: &RenderOutput<F>) {
    let is_stress = case.name == "d_stress2000";
    for (plane, values, stored) in [
        ("rgb", &out.rgb, 1e-7),
        ("alpha", &out.alpha, 1e-7),
        ("depth", &out.depth, 3e-7),
        ("features", &out.features, 3e-7),
    ] {
        let (clear, borderline) = image_errors(case, plane, values);
        let limit = if is_stress { stored } else { 4e-14 };
        assert!(clear <= limit, "{} {plane}: {clear:e} exceeds {limit:e}", case.name);
        let limit = if is_stress { 3e-7 } else { limit };
        assert!(borderline <= limit, "{} {plane}, borderline: {borderline:e}", case.name);
    }
}

#[test]
fn images_match_in_single_precision() {
    check::<f32>(false);
}

#[test]
fn images_match_in_double_precision() {
    check::<f64>(true);
}

/// The culled lists are as short as with the exact ellipse–tile test (594 of 822 and 10 000 of 16
/// 000 entries), up to the safety margin and ellipses that lie between two rows of pixel centres.
#[test]
fn culling_is_tight() {
    for (name, exact, rectangle) in [("c1_random200", 594, 822), ("d_stress2000", 10_000, 16_000)] {
        let case = Case::<f32>::open(name);
        let prepared: Prepared<f32> =
            CpuRasterizer::default().prepare(&case.splats, &case.camera).unwrap();
        assert_eq!(prepared.num_rect_isects(), rectangle, "{name}: rectangles");
        let ours = prepared.num_isects();
        assert!(ours.abs_diff(exact) <= exact / 50, "{name}: {ours} entries");
    }
}
