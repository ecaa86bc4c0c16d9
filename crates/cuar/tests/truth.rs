//! Refinement against the true edited video: what it must mend, and what it must leave alone.

#![allow(clippy::unwrap_used, reason = "helpers of tests may")]

mod common;

use common::{Case, Flaws, case, flicker, psnr, render};
use cuar::{NoObserver, RefineOptions, Refined, Views, refine};
use gs_core::{Camera, DynamicScene, SceneError, Splats, TimeRange, sh};
use gs_raster_cpu::CpuRasterizer;

const EVAL: [f32; 3] = [0.13, 0.37, 0.61];

fn run(case: &Case, options: &RefineOptions) -> Refined {
    let times = TimeRange::UNIT.frames(31);
    let views = Views { cameras: &case.cameras, times: &times, held_out: &case.held_out };
    let raster = CpuRasterizer::default();
    refine(&raster, &case.scene, &case.edited, &views, options, None, &mut NoObserver).unwrap()
}

fn options() -> RefineOptions {
    RefineOptions { samples: 60, ..RefineOptions::default() }
}

#[test]
fn wrong_colours_are_mended_at_held_out_views_and_times() {
    let flaws = Flaws { interior: true, unseen_sh: 1.5, noise: 0.0 };
    let case = case(9_000, 3, 8, (240, 180), flaws);
    let refined = run(&case, &options());
    let scene = refined.scene(&case.scene);
    let before = psnr(&case.scene, &case, &case.held_out, &EVAL);
    let after = psnr(&scene, &case, &case.held_out, &EVAL);
    assert!(after[0] > before[0] + 3.0, "inside the mask: {before:?} → {after:?} dB");
    assert!(after[1] > before[1] - 0.05, "outside the mask: {before:?} → {after:?} dB");

    let clip: Vec<f32> = (1_u8..=9).map(|k| f32::from(k) * 0.1).collect();
    let [shaky, calm, ideal] = [&case.scene as &dyn DynamicScene, &scene, &case.truth]
        .map(|scene| flicker(scene, &case, &case.held_out, &clip));
    assert!(calm < 0.7 * shaky, "flicker {shaky} → {calm} levels, truth {ideal}");
    assert!(calm - ideal < 0.5 * (shaky - ideal), "excess: {shaky} → {calm}, truth {ideal}");
    let report = &refined.report;
    assert!(report.loss_after < 0.7 * report.loss_before, "{report:?}");
    assert!(report.held_out_after < 0.8 * report.held_out_before, "{report:?}");

    let mut first = case.scene.at(0.0).unwrap();
    let original = first.clone();
    refined.apply(&mut first);
    let coeffs = first.sh_coeffs();
    let mut changed = 0;
    for i in 0..first.len() {
        let same = first.sh_of(i).iter().flatten().zip(original.sh_of(i).iter().flatten());
        let same = same.clone().all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same || case.edited[i], "unedited row {i} changed");
        changed += usize::from(!same);
    }
    assert!(changed > 0, "something was refined");
    assert_eq!(first.opacity_logits, original.opacity_logits, "opacity is not refined by default");
    assert_eq!(first.means, original.means, "geometry");
    for (k, &row) in refined.rows.iter().enumerate() {
        assert_eq!(refined.sh[k * coeffs..][..coeffs], *first.sh_of(row as usize), "row {row}");
    }
}

#[test]
fn a_scene_without_flaws_comes_back_unchanged() {
    // what frame 1 shows is right by definition: noise there is not to be touched
    let flaws = Flaws { interior: false, unseen_sh: 0.0, noise: 0.1 };
    let case = case(9_000, 1, 8, (240, 180), flaws);
    let refined = run(&case, &options());
    let scene = refined.scene(&case.scene);
    let before = psnr(&case.scene, &case, &case.held_out, &EVAL);
    let after = psnr(&scene, &case, &case.held_out, &EVAL);
    for part in 0..2 {
        assert!((before[part] - after[part]).abs() < 0.1, "{before:?} → {after:?} dB");
    }
}

/// A red board slides away from a green wall that it hid in frame 1; everything is edited.
#[derive(Debug, Clone)]
struct Slide {
    splats: Splats,
    board: usize,
}

impl Slide {
    fn new() -> Self {
        let mut splats = Splats::with_capacity(0, 1);
        let mut add = |mean: [f32; 3], rgb: [f32; 3], tilt: f32| {
            splats.means.push(mean);
            splats.quats.push([1.0, 0.0, 0.0, 0.0]);
            splats.log_scales.push([-2.6, -2.6, -5.0]);
            splats.opacity_logits.push(4.0);
            splats.sh.extend([sh::dc_from_rgb(rgb), [0.0; 3], [0.0; 3], [tilt, tilt, 0.0]]);
        };
        for k in 0..225 {
            let at = |k: i32| (k - 7) as f32 * 0.08;
            // the tilt makes the board's colour uncertain once it moves
            add([0.6 * at(k % 15), 0.6 * at(k / 15), 3.0], [0.9, 0.1, 0.1], 0.6);
        }
        for k in 0..1225 {
            let at = |k: i32| (k - 17) as f32 * 0.1;
            add([at(k % 35), at(k / 35), 4.0], [0.1, 0.8, 0.1], 0.0);
        }
        Self { splats, board: 225 }
    }
}

impl DynamicScene for Slide {
    fn num_splats(&self) -> usize {
        self.splats.len()
    }
    fn sh_degree(&self) -> usize {
        1
    }
    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }
    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        out.clone_from(&self.splats);
        for mean in &mut out.means[..self.board] {
            mean[0] += 0.8 * t;
        }
        Ok(())
    }
}

#[test]
fn uncovered_background_is_not_painted_with_the_foreground() {
    let scene = Slide::new();
    let cameras: Vec<Camera> = [-0.3, 0.0, 0.3]
        .map(|x| Camera::look_at([x, 0.0, 0.0], [0.0, 0.0, 3.0], [0.0, -1.0, 0.0], 0.6, 128, 96))
        .to_vec();
    let times = TimeRange::UNIT.frames(9);
    let views = Views { cameras: &cameras, times: &times, held_out: &[] };
    let edited = vec![true; scene.num_splats()];
    // ε = 0 and no floor: even the wall, which is certain, is masked wherever the board reaches
    let options = RefineOptions { min_uncertainty: 0.0, epsilon: 0.0, ..RefineOptions::default() };
    let raster = CpuRasterizer::default();
    let refined =
        refine(&raster, &scene, &edited, &views, &options, None, &mut NoObserver).unwrap();
    let after = refined.scene(&scene);
    let (before, now) = (render(&scene, 1.0, &cameras[1]), render(&after, 1.0, &cameras[1]));
    let mut worst = 0.0_f32;
    for y in 40..56 {
        for x in 50..64 {
            assert!(before.pixel(x, y)[1] > 0.6, "the wall, uncovered");
            for channel in 0..3 {
                worst = worst.max((now.pixel(x, y)[channel] - before.pixel(x, y)[channel]).abs());
            }
        }
    }
    assert!(worst < 0.02, "the uncovered wall changed by {worst}");
}
