//! Styles on a small scene: patterns arrive in held-out views, everything else keeps its bits.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use gs_core::{Camera, Image, Splats};
use gs_fit::{FitError, StyleFit, StyleOptions, fit_style};
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{DemoParams, SynthScene, demo};

const SIDE: u32 = 96;

fn scene() -> SynthScene {
    demo(&DemoParams { num_splats: 6_000, seed: 3, ..DemoParams::default() }).unwrap()
}

/// Diagonal stripes of two colours, 8 pixels wide, with coverage.
fn stripes(width: usize, height: usize) -> Image {
    let pixel = |p: usize| {
        let dark = ((p % width + p / width) / 8).is_multiple_of(2);
        if dark { [0.1, 0.1, 0.4, 1.0] } else { [0.9, 0.8, 0.3, 1.0] }
    };
    let data = (0..width * height).flat_map(pixel).collect();
    Image::from_data(width, height, 4, data).unwrap()
}

fn options(steps: usize) -> StyleOptions {
    let mut options = StyleOptions::default();
    options.steps = steps;
    options
}

fn styled(
    splats: &Splats,
    selected: &[bool],
    cameras: &[Camera],
    style: &Image,
    steps: usize,
) -> Result<StyleFit, FitError> {
    let raster = CpuRasterizer::default();
    fit_style(&raster, splats, selected, cameras, style, &options(steps), &mut |_| true)
}

#[test]
fn patterns_appear_in_held_out_views() {
    let scene = scene();
    let (splats, style) = (scene.frame1(), stripes(96, 96));
    let cameras = scene.orbit_cameras(16, SIDE, SIDE);
    let (fitted, held_out): (Vec<_>, Vec<_>) =
        cameras.into_iter().enumerate().partition(|(i, _)| i % 2 == 0);
    let [fitted, held_out] = [fitted, held_out]
        .map(|cameras| cameras.into_iter().map(|(_, camera)| camera).collect::<Vec<_>>());
    let selected: Vec<bool> = (0..splats.len()).map(|row| row % 10 != 0).collect();

    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| styled(splats, &selected, &fitted, &style, 150).unwrap())
    };
    let result = run(1);
    assert_eq!(result, run(3), "any number of threads");

    let [before, after] = result.distance;
    assert!(after < 0.7 * before, "fitted views: {before} {after}");
    let distance =
        |splats: &Splats| styled(splats, &selected, &held_out, &style, 0).unwrap().distance[0];
    let [before, after] = [splats, &result.splats].map(distance);
    assert!(after < 0.75 * before, "held-out views: {before} {after}");

    let coeffs = splats.sh_coeffs();
    let unstyled = Splats { sh: result.splats.sh.clone(), ..splats.clone() };
    assert_eq!(unstyled, result.splats, "only harmonics change");
    for row in 0..splats.len() {
        let (old, new) = (splats.sh_of(row), result.splats.sh_of(row));
        assert_eq!(old[1..coeffs], new[1..coeffs], "only base colours change");
        assert!(selected[row] || old == new, "splat {row} is not selected");
    }
}

#[test]
fn unusable_inputs_are_errors() {
    let scene = scene();
    let (splats, style) = (scene.frame1(), stripes(96, 96));
    let cameras = scene.orbit_cameras(2, SIDE, SIDE);
    let all = vec![true; splats.len()];
    let error = |selected: &[bool], cameras: &[Camera], style: &Image| {
        styled(splats, selected, cameras, style, 2).unwrap_err().to_string()
    };
    assert!(error(&all, &[], &style).contains("no pictures"), "no cameras");
    assert!(error(&all, &cameras, &stripes(8, 8)).contains("picture has too few"), "tiny");
    let mut transparent = style.clone();
    transparent.data.chunks_exact_mut(4).for_each(|pixel| pixel[3] = 0.0);
    assert!(error(&all, &cameras, &transparent).contains("the picture has too few"), "no pixel");
    let none = vec![false; splats.len()];
    assert!(error(&none, &cameras, &style).contains("the selection has too few"), "no splat");
    let raster = CpuRasterizer::default();
    let cancelled =
        fit_style(&raster, splats, &all, &cameras, &style, &options(9), &mut |step| step < 3);
    assert!(matches!(cancelled, Err(FitError::Cancelled)), "cancelled");
}
