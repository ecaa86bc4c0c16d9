//! Refinement compared with the true edited video: what it must repair, and what it must keep.

use crate::common::{Case, Flaws, case, flicker, psnr, render, slide::Slide};
use cuar::{NoRefineObserver, RefineOptions, Refined, Views, refine};
use gs_core::{DynamicScene, Image, TimeRange};
use gs_raster_cpu::CpuRasterizer;

const EVAL: [f32; 3] = [0.13, 0.37, 0.61];

fn run(case: &Case, options: &RefineOptions) -> Refined {
    let times = TimeRange::UNIT.frames(31);
    let views = Views { cameras: &case.cameras, times: &times, held_out: &case.held_out };
    let raster = CpuRasterizer::default();
    refine(&raster, &case.scene, &case.edited, &views, options, None, &mut NoRefineObserver)
        .unwrap()
}

fn options() -> RefineOptions {
    RefineOptions { samples: 60, ..RefineOptions::default() }
}

#[test]
fn wrong_colours_are_corrected_at_held_out_views_and_times() {
    let flaws = Flaws { interior: true, unseen_sh: 1.5, noise: 0.0 };
    let case = case(9_000, 3, 8, (240, 180), flaws);
    let refined = run(&case, &options());
    let scene = refined.scene(&case.scene);
    let before = psnr(&case.scene, &case, &case.held_out, &EVAL);
    let after = psnr(&scene, &case, &case.held_out, &EVAL);
    // seen 6.3 dB
    assert!(after[0] > before[0] + 6.0, "inside the mask: {before:?} → {after:?} dB");
    assert!(after[1] > before[1] - 0.05, "outside the mask: {before:?} → {after:?} dB");

    let clip: Vec<f32> = (1_u8..=9).map(|k| f32::from(k) * 0.1).collect();
    let [shaky, calm, ideal] = [&case.scene as &dyn DynamicScene, &scene, &case.truth]
        .map(|scene| flicker(scene, &case, &case.held_out, &clip));
    assert!(calm < 0.7 * shaky, "flicker {shaky} → {calm} levels, truth {ideal}");
    assert!(calm - ideal < 0.5 * (shaky - ideal), "excess: {shaky} → {calm}, truth {ideal}");
    let report = &refined.report;
    assert!(report.loss_after < 0.8 * report.loss_before, "{report:?}");
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
fn a_scene_without_flaws_is_unchanged() {
    // colours that frame 1 shows are correct by definition: their noise must not change
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

#[test]
fn uncovered_background_does_not_get_foreground_colours() {
    let scene = Slide::new();
    let [refined, untested] = [true, false].map(|tested| scene.refined(tested));
    let camera = &Slide::cameras(128, 96)[1];
    let (before, now) = (render(&scene, 1.0, camera), render(&refined.scene(&scene), 1.0, camera));
    let control = render(&untested.scene(&scene), 1.0, camera);
    // the board covered these pixels in frame 1 and has left them; the scene before refinement is
    // the ground truth, because the wall has no errors
    let (mut sum, mut painted) = (0.0_f32, 0.0_f32);
    for y in 28..68 {
        for x in 46..74 {
            let distance = |image: &Image, other: [f32; 3]| {
                let own = image.pixel(x, y);
                (0..3).map(|k| (own[k] - other[k]).powi(2)).sum::<f32>().sqrt()
            };
            let [red, green, blue] = [0, 1, 2].map(|k| before.pixel(x, y)[k]);
            let (to_wall, to_board) =
                (distance(&now, [red, green, blue]), distance(&now, Slide::BOARD));
            // worst seen 0.05 of the distance to the board
            assert!(to_wall < 0.07 * to_board, "({x}, {y}): wall {to_wall}, board {to_board}");
            sum += to_wall;
            painted += distance(&control, [red, green, blue]);
        }
    }
    let [mean, painted] = [sum, painted].map(|sum| sum / (40.0 * 28.0));
    // seen 0.0018
    assert!(mean < 0.004, "the uncovered wall changed by {mean}");
    // negative control: without the occlusion test, the wall gets the board's colour; seen 0.70
    assert!(painted > 0.3, "without occlusion test {painted}, with it {mean}");
}
