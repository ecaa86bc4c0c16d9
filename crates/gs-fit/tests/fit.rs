//! The fit on a small scene with a known edit.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use gs_core::{Camera, DynamicScene, Image, Rasterizer, RenderParams, Splats, sh};
use gs_fit::{
    EditedPicture, FitError, FitObserver, FitOptions, FitState, Fitted, NoFitObserver, fit,
};
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{DemoParams, Edit, Paint, Part, Region, SynthScene, apply_edits, demo};

const SIDE: u32 = 96;

fn scene() -> SynthScene {
    demo(&DemoParams { num_splats: 3_000, seed: 3, sh_degree: 1, ..DemoParams::default() }).unwrap()
}

/// Red trousers, a large graft, and one removed prop.
fn edits() -> Vec<Edit> {
    vec![
        Edit::Recolour {
            region: Region::parts(&[Part::Pelvis, Part::ThighL, Part::ThighR]),
            paint: Paint::Solid([0.8, 0.1, 0.1]),
        },
        Edit::Clothing {
            region: Region::parts(&[Part::Chest]),
            offset: [0.010, 0.016],
            copies: 1.2,
            jitter: 0.001,
            paint: Some(Paint::Solid([0.1, 0.6, 0.2])),
        },
    ]
}

fn render(camera: &Camera, splats: &Splats) -> Image {
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(splats, camera).unwrap();
    let params = RenderParams::default();
    let mut image = raster.forward(&mut prepared, splats, &[], &params).unwrap().rgb_image();
    for value in &mut image.data {
        *value = (value.clamp(0.0, 1.0) * 255.0).round() / 255.0;
    }
    image
}

fn pictures(cameras: &[Camera], splats: &Splats) -> Vec<EditedPicture> {
    cameras
        .iter()
        .map(|camera| EditedPicture {
            camera: camera.clone(),
            image: render(camera, splats),
            mask: None,
        })
        .collect()
}

fn run(start: &Splats, pictures: &[EditedPicture], options: &FitOptions) -> Fitted {
    fit(&CpuRasterizer::default(), start, pictures, options, None, &mut NoFitObserver).unwrap()
}

/// Mean squared error of held-out views over the whole picture.
fn error(cameras: &[Camera], splats: &Splats, truth: &Splats) -> f64 {
    let sum: f64 = cameras
        .iter()
        .map(|camera| {
            let (a, b) = (render(camera, splats), render(camera, truth));
            let squares = a.data.iter().zip(&b.data).map(|(a, b)| f64::from(a - b).powi(2));
            squares.sum::<f64>() / a.data.len() as f64
        })
        .sum();
    sum / cameras.len() as f64
}

fn gain_db(before: f64, after: f64) -> f64 {
    10.0 * (before / after).log10()
}

/// Asserts that rows outside the selection are bit-identical, and that new rows come last.
fn assert_rest_is_kept(start: &Splats, fitted: &Fitted) {
    let old: Vec<u32> = fitted.source_rows.iter().map_while(|row| *row).collect();
    assert!(old.is_sorted_by(|a, b| a < b), "in the order of the start");
    assert!(fitted.source_rows[old.len()..].iter().all(Option::is_none), "new ones last");
    let kept: Vec<usize> = (0..start.len()).filter(|&i| !fitted.selected[i]).collect();
    let now: Vec<usize> = (0..old.len()).filter(|&i| !fitted.selected[old[i] as usize]).collect();
    assert!(start.select(&kept) == fitted.splats.select(&now), "not selected, not changed");
    assert_eq!(fitted.source_rows.len(), fitted.splats.len(), "one row each");
}

#[test]
fn unedited_pictures_return_the_input() {
    let scene = scene();
    let start = scene.frame1();
    let fitted =
        run(start, &pictures(&scene.orbit_cameras(3, SIDE, SIDE), start), &FitOptions::default());
    assert!(&fitted.splats == start, "the same bits");
    assert_eq!(fitted.report.edited_views, 0, "no edit");
}

#[test]
fn edits_are_fitted_and_other_splats_do_not_change() {
    let scene = scene();
    let start = scene.frame1();
    let truth = apply_edits(&scene, &edits(), 1).unwrap().splats;
    let cameras = scene.orbit_cameras(10, SIDE, SIDE);
    let held_out: Vec<Camera> =
        scene.orbit_cameras(20, SIDE, SIDE).into_iter().skip(1).step_by(4).collect();
    let options = FitOptions { steps: 150, ..FitOptions::default() };
    let fitted = run(start, &pictures(&cameras, &truth), &options);
    assert_rest_is_kept(start, &fitted);
    let (before, after) =
        (error(&held_out, start, &truth), error(&held_out, &fitted.splats, &truth));
    assert!(gain_db(before, after) > 10.0, "held-out views: {before:.2e}, then {after:.2e}");
    assert!(fitted.report.poorly_seen.is_none(), "every side is visible in pictures");

    let colors = FitOptions { geometry: false, ..options };
    let painted = run(start, &pictures(&cameras, &truth), &colors);
    assert_rest_is_kept(start, &painted);
    for (i, row) in painted.source_rows.iter().enumerate() {
        let row = row.expect("none is new") as usize;
        assert_eq!(painted.splats.means[i], start.means[row], "geometry is kept");
        assert_eq!(painted.splats.quats[i], start.quats[row], "geometry is kept");
    }
}

/// A recoloured region keeps its geometry bit for bit, so that its motion stays exact; added
/// clothing does not.
#[test]
fn recoloured_regions_keep_their_geometry() {
    let scene = scene();
    let start = scene.frame1();
    let cameras = scene.orbit_cameras(10, SIDE, SIDE);
    let options = FitOptions { steps: 100, ..FitOptions::default() };
    let held = |edits: &[Edit]| -> f64 {
        let truth = apply_edits(&scene, edits, 1).unwrap().splats;
        let fitted = run(start, &pictures(&cameras, &truth), &options);
        let is_selected =
            |i: &usize| fitted.source_rows[*i].is_none_or(|row| fitted.selected[row as usize]);
        let rows: Vec<usize> = (0..fitted.splats.len()).filter(is_selected).collect();
        let is_held = |i: &&usize| {
            fitted.source_rows[**i].is_some_and(|row| {
                let row = row as usize;
                fitted.splats.means[**i] == start.means[row]
                    && fitted.splats.quats[**i] == start.quats[row]
                    && fitted.splats.log_scales[**i] == start.log_scales[row]
            })
        };
        rows.iter().filter(is_held).count() as f64 / rows.len() as f64
    };
    let (recoloured, dressed) = (held(&edits()[..1]), held(&edits()[1..]));
    assert!(
        recoloured > 0.6,
        "recoloured: {recoloured:.2} of the fitted splats keep their geometry"
    );
    assert!(dressed < 0.3, "dressed: {dressed:.2} of the fitted splats keep their geometry");
}

/// The closed form finds the colours of a recoloured region before the first step.
#[test]
fn colours_are_solved_before_the_first_step() {
    let scene = scene();
    let start = scene.frame1();
    let truth = apply_edits(&scene, &edits()[..1], 1).unwrap().splats;
    let cameras = scene.orbit_cameras(10, SIDE, SIDE);
    let options = FitOptions { steps: 1, geometry: false, ..FitOptions::default() };
    let fitted = run(start, &pictures(&cameras, &truth), &options);
    let gain = gain_db(error(&cameras, start, &truth), error(&cameras, &fitted.splats, &truth));
    assert!(gain > 12.0, "{gain:.1} dB");
}

/// Stops after some steps; stores checkpoints.
struct Interrupter {
    after: usize,
    steps: usize,
    saved: Option<FitState>,
}

impl FitObserver for Interrupter {
    fn checkpoint(&mut self, state: &FitState) {
        self.saved = Some(state.clone());
    }

    fn cancelled(&mut self) -> bool {
        self.steps += 1;
        self.steps == self.after
    }
}

#[test]
fn results_do_not_depend_on_threads_or_interruptions() {
    let scene = scene();
    let start = scene.frame1();
    let truth = apply_edits(&scene, &edits(), 1).unwrap().splats;
    let pictures = pictures(&scene.orbit_cameras(5, 64, 64), &truth);
    let options = FitOptions { steps: 60, ..FitOptions::default() };
    let with_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(start, &pictures, &options))
    };
    let whole = with_threads(1);
    for threads in [2, 3, 7] {
        assert!(whole == with_threads(threads), "{threads} threads");
    }
    for after in [17, 45] {
        let mut stops = Interrupter { after, steps: 0, saved: None };
        let raster = CpuRasterizer::default();
        let stopped = fit(&raster, start, &pictures, &options, None, &mut stops);
        assert!(matches!(stopped, Err(FitError::Cancelled)), "stopped");
        let state = stops.saved.unwrap();
        let resumed =
            fit(&raster, start, &pictures, &options, Some(&state), &mut NoFitObserver).unwrap();
        assert!(resumed.splats == whole.splats, "resumed after {after} steps");
        assert_eq!(resumed.source_rows, whole.source_rows, "rows after {after} steps");

        let other = FitOptions { seed: 1, ..options.clone() };
        let refused = fit(&raster, start, &pictures, &other, Some(&state), &mut NoFitObserver);
        assert!(matches!(refused, Err(FitError::State { .. })), "the state of a different fit");
        let mut cut = state;
        cut.arrays.iter_mut().for_each(|(_, values)| values.truncate(7));
        let refused = fit(&raster, start, &pictures, &options, Some(&cut), &mut NoFitObserver);
        assert!(refused.is_err(), "a damaged state");
    }
}

/// With fewer splats, those of the floor would be so large that they cover much of the balls.
#[test]
fn deleted_objects_are_removed() {
    let params = DemoParams { num_splats: 15_000, seed: 3, sh_degree: 0, ..DemoParams::default() };
    let scene = demo(&params).unwrap();
    let start = scene.frame1();
    let gone = Edit::Remove { region: Region::parts(&[Part::Ball]).within([0.8, 0.15, 0.5], 0.3) };
    let truth = apply_edits(&scene, &[gone], 1).unwrap();
    let mut is_ball = vec![true; start.len()];
    for row in truth.truth.source_rows.iter().flatten() {
        is_ball[*row as usize] = false;
    }
    let side = 192;
    let pictures = pictures(&scene.orbit_cameras(12, side, side), &truth.splats);
    let fitted = run(start, &pictures, &FitOptions { steps: 60, ..FitOptions::default() });
    assert_rest_is_kept(start, &fitted);
    let held_out: Vec<Camera> =
        scene.orbit_cameras(24, side, side).into_iter().skip(1).step_by(4).collect();
    let coverage = |splats: &Splats, counted: &dyn Fn(usize) -> bool| -> f64 {
        let raster = CpuRasterizer::default();
        let features: Vec<f32> =
            (0..splats.len()).map(|i| f32::from(u8::from(counted(i)))).collect();
        let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
        let shown = held_out.iter().map(|camera| {
            let mut prepared = raster.prepare(splats, camera).unwrap();
            let shown = raster.forward(&mut prepared, splats, &features, &params).unwrap().features;
            shown.iter().map(|&x| f64::from(x)).sum::<f64>()
        });
        shown.sum()
    };
    let before = coverage(start, &|i| is_ball[i]);
    let after = coverage(&fitted.splats, &|i| {
        fitted.source_rows[i].is_some_and(|row| is_ball[row as usize])
    });
    assert!(before > 100.0, "visible before the fit: {before}");
    assert!(after < 0.01 * before, "{:.2} % of it remain", 100.0 * after / before);
}

/// Only one of several pictures is edited. The others show the original scene and must not undo the
/// edit.
#[test]
fn one_edited_picture_is_enough() {
    let scene = scene();
    let start = scene.frame1();
    let truth = apply_edits(&scene, &edits()[..1], 1).unwrap().splats;
    let cameras = scene.orbit_cameras(6, SIDE, SIDE);
    let mut all = pictures(&cameras, start);
    all[0].image = render(&cameras[0], &truth);
    let options = FitOptions { steps: 120, ..FitOptions::default() };
    let fitted = run(start, &all, &options);
    assert_rest_is_kept(start, &fitted);
    let seen = &cameras[..1];
    let gain = gain_db(error(seen, start, &truth), error(seen, &fitted.splats, &truth));
    assert!(gain > 8.0, "in the picture: {gain:.1} dB");
    let behind = &cameras[3..4];
    let harm = error(behind, &fitted.splats, start);
    assert!(harm < 5e-4, "from behind, where nothing is known: {harm:.2e}");
    let report = &fitted.report;
    let counts = [report.edited_views, report.masked_pixels, report.selected];
    assert!(report.poorly_seen.is_some(), "said: {counts:?}");
}

/// Pictures of different brightness: the result has the brightness of the reference.
#[test]
fn the_result_has_the_brightness_of_the_reference() {
    let scene = scene();
    let start = scene.frame1();
    let truth = apply_edits(&scene, &edits()[..1], 1).unwrap().splats;
    let cameras = scene.orbit_cameras(8, SIDE, SIDE);
    let mut all = pictures(&cameras, &truth);
    for (v, picture) in all.iter_mut().enumerate() {
        let original = render(&picture.camera, start);
        let gain = if v == 3 { 1.2 } else { 0.8 };
        for (new, old) in picture.image.data.iter_mut().zip(&original.data) {
            if (*new - old).abs() > 0.05 {
                *new = (*new * gain).min(1.0);
            }
        }
    }
    let error = |splats: &Splats| -> f64 {
        let found = render(&cameras[3], splats);
        let squares = found.data.iter().zip(&all[3].image.data);
        squares.map(|(a, b)| f64::from(a - b).powi(2)).sum()
    };
    let options = FitOptions { steps: 240, ..FitOptions::default() };
    let mean = error(&run(start, &all, &options).splats);
    let held = error(&run(start, &all, &FitOptions { reference: Some(3), ..options }).splats);
    assert!(held < 0.5 * mean, "with it {held:.3}, without {mean:.3}");
}

/// A wall of large splats behind a cloud of tiny ones, all recoloured. Large splats that grow
/// during the fit must not be treated as degenerate; otherwise the wall would have holes.
#[test]
fn large_splats_among_small_ones_are_fitted() {
    let mut start = Splats { sh_degree: 0, ..Splats::default() };
    let mut add = |mean: [f32; 3], log_scale: f32, rgb: [f32; 3]| {
        start.means.push(mean);
        start.quats.push([1.0, 0.0, 0.0, 0.0]);
        start.log_scales.push([log_scale, log_scale, log_scale - 2.0]);
        start.opacity_logits.push(1.5);
        start.sh.push(sh::dc_from_rgb(rgb));
    };
    let at = |k: usize, side: usize| 2.0 * (k as f32 + 0.5) / side as f32 - 1.0;
    for k in 0..64 {
        add([at(k % 8, 8), at(k / 8, 8), 0.0], -1.9, [0.1, 0.08, 0.06]);
    }
    for k in 0..400 {
        add([at(k % 20, 20), at(k / 20, 20), -0.3], -6.0, [0.2, 0.2, 0.2]);
    }
    let mut truth = start.clone();
    for (k, dc) in truth.sh.iter_mut().enumerate() {
        let light = 0.3 + 0.3 * ((k % 8) as f32 / 8.0);
        *dc = sh::dc_from_rgb([0.1, light, 0.9]);
    }
    let cameras: Vec<Camera> = [-0.6, -0.3, 0.0, 0.3, 0.6]
        .iter()
        .map(|&x| Camera::look_at([x, 0.2, -2.6], [0.0; 3], [0.0, 1.0, 0.0], 0.7, SIDE, SIDE))
        .collect();
    let pictures = pictures(&cameras, &truth);
    let fitted = run(&start, &pictures, &FitOptions { steps: 300, ..FitOptions::default() });
    let gain = gain_db(error(&cameras, &start, &truth), error(&cameras, &fitted.splats, &truth));
    assert!(gain > 20.0, "{gain:.1} dB, {} splats left", fitted.splats.len());
}

/// Masks and restrictions take effect.
#[test]
fn masks_and_restrictions_take_effect() {
    let scene = scene();
    let start = scene.frame1();
    let truth = apply_edits(&scene, &edits(), 1).unwrap().splats;
    let cameras = scene.orbit_cameras(6, SIDE, SIDE);
    let options = FitOptions { steps: 60, ..FitOptions::default() };
    let all = pictures(&cameras, &truth);
    let whole = run(start, &all, &options);
    assert!(whole.report.added > 0, "splats are added");
    let same = run(start, &all, &FitOptions { densify: false, ..options.clone() });
    assert_eq!((same.report.added, same.report.carved), (0, 0), "no splats are added or carved");
    assert!(same.splats != *start, "the splats are fitted");

    // Only the upper half of the pictures is in the mask.
    let mut upper = all;
    let side = SIDE as usize;
    for picture in &mut upper {
        picture.mask = Some((0..side * side).map(|p| p < side * side / 2).collect());
    }
    let fitted = run(start, &upper, &options);
    assert_rest_is_kept(start, &fitted);
    assert!(fitted.report.masked_pixels == 6 * side * side / 2, "the given masks are used");
    let selected: Vec<usize> = (0..start.len()).filter(|&i| fitted.selected[i]).collect();
    assert!(selected.len() > 50, "{} are selected", selected.len());
    for &i in &selected {
        let heights = cameras.iter().filter_map(|c| c.project(start.means[i].map(f64::from)));
        let highest = heights.map(|[_, y]| y).fold(f64::INFINITY, f64::min);
        assert!(highest < 0.6 * f64::from(SIDE), "splat {i} lies below every mask: {highest}");
    }
}

#[test]
fn invalid_inputs_are_refused() {
    let scene = scene();
    let start = scene.frame1();
    let cameras = scene.orbit_cameras(2, 64, 48);
    let good = pictures(&cameras, start);
    let refused = |pictures: &[EditedPicture], options: &FitOptions| -> String {
        let raster = CpuRasterizer::default();
        fit(&raster, start, pictures, options, None, &mut NoFitObserver).unwrap_err().to_string()
    };
    let options = FitOptions::default();
    assert!(refused(&[], &options).contains("no pictures"), "none");
    let mut small = good.clone();
    small[1].image = Image::zeros(32, 48, 3);
    assert!(refused(&small, &options).contains("expected 64×48"), "a different size");
    let mut mask = good.clone();
    mask[0].mask = Some(vec![true; 5]);
    assert!(
        refused(&mask, &options).contains("the mask is 5 pixels"),
        "a mask of a different size"
    );
    // Only the sky, in which no splat is mainly visible.
    let mut sky = good.clone();
    let mut corner = vec![false; 64 * 48];
    corner[..3].fill(true);
    sky[0].mask = Some(corner);
    assert!(refused(&sky, &options).contains("no splat is mainly visible"), "nothing selected");
    let bad = FitOptions { steps: 0, ..FitOptions::default() };
    assert!(refused(&good, &bad).contains("steps is 0"), "no steps");
    let bad = FitOptions { reference: Some(7), ..FitOptions::default() };
    assert!(refused(&good, &bad).contains("reference"), "no such view");
    assert_eq!(scene.num_splats(), start.len(), "one row a splat");
}

/// Two opaque walls, the second a little behind the first.
#[test]
fn splats_that_no_picture_shows_keep_their_bits() {
    let mut walls = Splats::with_capacity(2 * 400, 0);
    for (z, rgb) in [(0.0, [0.6, 0.3, 0.3]), (-0.08, [0.3, 0.3, 0.6])] {
        for i in 0_u8..20 {
            for j in 0_u8..20 {
                let at = |k: u8| 0.05 * (f32::from(k) - 9.5);
                walls.means.push([at(i), at(j), z]);
                walls.quats.push([1.0, 0.0, 0.0, 0.0]);
                walls.log_scales.push([-3.2, -3.2, -6.0]);
                walls.opacity_logits.push(3.0);
                walls.sh.push(sh::dc_from_rgb(rgb));
            }
        }
    }
    let cameras: Vec<Camera> = (-2_i8..=2)
        .map(|i| {
            let eye = [0.2 * f64::from(i), 0.1 * f64::from(i % 2), 2.0];
            Camera::look_at(eye, [0.0; 3], [0.0, 1.0, 0.0], 0.5, SIDE, SIDE)
        })
        .collect();
    let mut edited = walls.clone();
    edited.sh[..400].fill(sh::dc_from_rgb([0.2, 0.7, 0.2]));
    let options = FitOptions { steps: 60, ..FitOptions::default() };
    let fitted = run(&walls, &pictures(&cameras, &edited), &options);
    let (mut hidden, mut recoloured) = (0, 0);
    for (i, source) in fitted.source_rows.iter().enumerate() {
        let Some(row) = source.map(|row| row as usize) else { continue };
        let is_same = fitted.splats.select(&[i]) == walls.select(&[row]);
        // The edges of the second wall are visible from the side.
        let inner = walls.means[row][..2].iter().all(|x| x.abs() < 0.3);
        if row >= 400 && inner {
            assert!(is_same, "splat {row} behind the first wall");
            hidden += usize::from(fitted.selected[row]);
        }
        recoloured += usize::from(row < 400 && inner && !is_same);
    }
    assert!(recoloured > 100 && hidden > 50, "{recoloured} recoloured, {hidden} hidden");
}
