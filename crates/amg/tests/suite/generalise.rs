//! Scenes other than the goldens: a different figure, motions and seeds, with known true motion.
use amg::{Aggregation, Binding, EditedScene, MotionOptions, MotionPreset, propagate};
use gs_core::{DynamicScene, SplitMix64, standard_normal};
use gs_synth::{
    MotionError, Tag, Truth, TruthCase, build, motion_error, motion_error_of, rigid_neighbors,
};
use std::sync::Arc;

const TIMES: [f32; 4] = [0.25, 0.5, 0.75, 1.0];

/// Scores of all scored splats, and of those that are not source splats.
struct Scores {
    all: MotionError,
    edited: MotionError,
}

fn scored(scene: &EditedScene, truth: &Truth, is_edited: &[bool]) -> Scores {
    let open: Vec<bool> = truth.eval_mask.iter().zip(is_edited).map(|(a, b)| *a && *b).collect();
    Scores {
        all: motion_error(scene, truth, &TIMES).unwrap(),
        edited: motion_error_of(scene, truth, &TIMES, &open).unwrap(),
    }
}

/// KNN-Guide, the control without correspondences, and the default.
fn errors(case: &str, seed: u64, size: usize) -> [Scores; 3] {
    let scene = build(case.parse::<TruthCase>().unwrap(), seed, size).unwrap();
    let source: Arc<dyn DynamicScene> = Arc::new(scene.source.clone());
    let edited = Arc::new(scene.edited.splats.clone());
    let [knn, best] = [MotionPreset::Knn, MotionPreset::Regions].map(|preset| {
        let options = MotionOptions::preset(preset);
        propagate(Arc::clone(&source), Arc::clone(&edited), &options, &|_, _| {}).unwrap().scene
    });
    let kinds = best.binding().kinds();
    let is_edited: Vec<bool> = kinds.iter().map(|kind| !kind.is_exact()).collect();
    let rows = rigid_neighbors(&scene.source, &scene.edited).unwrap();
    let control = EditedScene::new(
        Arc::clone(&source),
        edited,
        0.0,
        Arc::new(Binding::blending(&rows, source.num_splats()).unwrap()),
        Aggregation::default(),
    );
    let control = control.unwrap();
    [knn, control, best].map(|found| scored(&found, &scene.edited.truth, &is_edited))
}

/// Limits of the error as a share of KNN-Guide's, and of the rotation error in degrees: about a
/// tenth above the measured values. On edited splats, the error is at most that of the control,
/// within 3 % (measured: 0.03 to 1.02 times).
#[test]
fn the_default_has_smaller_errors_than_nearest_neighbors() {
    for (case, share, rotation) in [
        ("drift", 0.26, 0.47),
        ("clothing", 0.1, 0.66),
        ("prune-split", 0.33, 0.46),
        ("graft-hat", 0.31, 0.32),
        ("graft-horns", 0.5, 0.36),
        ("graft-wings", 0.105, 0.33),
        ("graft-block", 0.37, 0.35),
        ("graft-stick", 0.195, 0.37),
        ("graft-halo", 0.39, 0.37),
        ("blocky", 0.43, 1.83),
        ("grazing-limb", 0.27, 0.42),
        ("touch-and-part", 0.115, 0.155),
        ("fast-rotation", 0.027, 0.41),
        ("stretching-cloth", 0.28, 0.36),
        ("floaters-outliers", 0.087, 0.49),
        ("noisy-reconstruction", 0.35, 1.77),
        ("everything", 0.134, 0.89),
    ] {
        let [knn, control, best] = errors(case, 3, 3000);
        assert!(
            best.all.epe <= share * knn.all.epe,
            "{case}: {:.3} against {:.3} of KNN-Guide, limit {share}",
            best.all.epe,
            knn.all.epe
        );
        assert!(
            best.edited.epe <= 1.03 * control.edited.epe,
            "{case}, edited splats: {:.4} against {:.4} of the control",
            best.edited.epe,
            control.edited.epe
        );
        assert!(best.all.rot_deg <= rotation, "{case}: {} degrees", best.all.rot_deg);
    }
}

#[test]
fn unchanged_geometry_keeps_its_motion_with_any_guide() {
    for case in ["recolour", "shuffled-rows"] {
        let [knn, _, best] = errors(case, 2, 1500);
        let (knn, best) = (knn.all.epe, best.all.epe);
        assert!((best - knn).abs() < 1e-9, "{case}: {best} and {knn}");
    }
}

/// Rotations with noise of 0.2 per component of the unit quaternion, about 23°, as in an edit that
/// was fitted to images, make thin axes unreliable.
#[test]
fn noisy_rotations_of_an_edit_change_its_motion_little() {
    let [mut clean, mut noisy] = [0.0, 0.0];
    for seed in 0..3 {
        let scene = build(TruthCase::Clothing, seed, 20_000).unwrap();
        let source: Arc<dyn DynamicScene> = Arc::new(scene.source.clone());
        let edited = &scene.edited.splats;
        let is_open: Vec<bool> =
            scene.edited.truth.tags.iter().map(|t| *t == Tag::Clothing).collect();
        let mut generator = SplitMix64::new(seed);
        let mut uniform = || generator.next_u64() as f64 / 2.0_f64.powi(64);
        let mut noisy_edit = edited.clone();
        for (row, quat) in noisy_edit.quats.iter_mut().enumerate().filter(|(row, _)| is_open[*row])
        {
            *quat = gs_core::quat::normalize(*quat)
                .map(|c| c + 0.2 * standard_normal(uniform(), uniform()) as f32);
            // different bits, so that the shape does not identify the source splat
            noisy_edit.log_scales[row][0] += 1e-3;
        }
        for (splats, sum) in [(edited.clone(), &mut clean), (noisy_edit, &mut noisy)] {
            let options = MotionOptions::default();
            let found =
                propagate(Arc::clone(&source), Arc::new(splats), &options, &|_, _| {}).unwrap();
            *sum +=
                motion_error_of(&found.scene, &scene.edited.truth, &TIMES, &is_open).unwrap().epe;
        }
    }
    // Sums over the seeds, % of the figure: clean 0.43; noisy 1.23, without the averaging 1.50.
    assert!(noisy < 1.35 && noisy < 3.1 * clean, "{clean} {noisy}");
}
