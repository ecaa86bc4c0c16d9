//! Proves that images, radii, tile rectangles and entry counts are those of the golden cases, in
//! both float types.

use crate::cases::{CASES, Case, widen};
use gs_core::{Rasterizer, Real, RenderOutput};
use gs_raster_cpu::{CpuRasterizer, Prepared};

/// Largest error on pixels whose decisions are clear, and on the others.
fn errors<F: Real>(case: &Case<F>, plane: &str, actual: &[F]) -> (f64, f64) {
    let expected = case.golden.f64s(&format!("out.{plane}"));
    assert_eq!(actual.len(), expected.len(), "{} {plane}: length", case.name);
    let ambiguous = case.golden.u8s("out.ambiguous");
    let channels = expected.len() / ambiguous.len();
    let mut worst = (0.0_f64, 0.0_f64);
    for (i, (a, e)) in widen(actual).iter().zip(&expected).enumerate() {
        let error = (a - e).abs();
        let error = if error.is_nan() { f64::INFINITY } else { error };
        if ambiguous[i / channels] == 0 {
            worst.0 = worst.0.max(error);
        } else {
            worst.1 = worst.1.max(error);
        }
    }
    worst
}

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
        check_images(&case, &out, double);
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

fn check_images<F: Real>(case: &Case<F>, out: &RenderOutput<F>, double: bool) {
    let largest = case
        .features
        .iter()
        .filter(|f| f.is_finite())
        .fold(1.0, |m: f64, f| m.max(f.as_f64().abs()));
    let d = case.name == "d_stress2000";
    for (plane, values, single, stored) in [
        ("rgb", &out.rgb, 3e-5, 1e-7),
        ("alpha", &out.alpha, 3e-5, 1e-7),
        ("depth", &out.depth, 1e-4, 3e-7),
        ("features", &out.features, 1e-4, 3e-7),
    ] {
        let (clean, ambiguous) = errors(case, plane, values);
        let limit = match (double, d) {
            (true, true) => stored,
            (true, false) => 1e-12,
            _ => single,
        };
        assert!(clean <= limit, "{} {plane}: {clean:e} exceeds {limit:e}", case.name);
        let limit = if double { limit.max(if d { 3e-7 } else { 0.0 }) } else { 0.02 * largest };
        assert!(ambiguous <= limit, "{} {plane}, borderline pixels: {ambiguous:e}", case.name);
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

/// The culled lists are as short as the exact ellipse–tile test makes them (594 of 822 and 10 000
/// of 16 000 entries), give or take the safety margin and ellipses that slip between two rows of
/// pixels.
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
