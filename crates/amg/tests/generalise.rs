//! Other scenes than the goldens: another figure, other motions, other seeds, truth known.
#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "helpers of tests may fail loudly; sizes and lengths are small"
)]

use amg::{MotionOptions, Preset, propagate};
use gs_core::DynamicScene;
use gs_synth::{MotionError, TruthCase, build, motion_error};
use std::sync::Arc;

const TIMES: [f32; 4] = [0.25, 0.5, 0.75, 1.0];

fn errors(case: &str, seed: u64, size: usize) -> [MotionError; 2] {
    let case: TruthCase = case.parse().unwrap();
    let scene = build(case, seed, size).unwrap();
    let source: Arc<dyn DynamicScene> = Arc::new(scene.source);
    let edited = Arc::new(scene.edited.splats);
    [Preset::Knn, Preset::Best].map(|preset| {
        let (source, edited) = (Arc::clone(&source), Arc::clone(&edited));
        let options = MotionOptions::preset(preset);
        let found = propagate(source, edited, &options, &|_, _| {}).unwrap();
        motion_error(&found.scene, &scene.edited.truth, &TIMES).unwrap()
    })
}

#[test]
fn the_default_is_far_ahead_of_the_nearest_neighbours() {
    for (case, share) in [
        ("drift", 0.6),
        ("clothing", 0.45),
        ("prune-split", 0.7),
        ("graft-hat", 0.6),
        ("graft-horns", 0.9),
        ("graft-wings", 0.2),
        ("blocky", 0.8),
        ("grazing-limb", 0.6),
        ("touch-and-part", 0.3),
        ("fast-rotation", 0.2),
        ("stretching-cloth", 0.5),
        ("floaters-outliers", 0.5),
        ("noisy-reconstruction", 0.6),
        ("everything", 0.5),
    ] {
        let [knn, best] = errors(case, 3, 3000);
        assert!(
            best.epe <= share * knn.epe,
            "{case}: {:.3} against {:.3} of KNN-Guide, limit {share}",
            best.epe,
            knn.epe
        );
        assert!(best.rot_deg <= 4.0, "{case}: {} degrees", best.rot_deg);
    }
}

#[test]
fn untouched_geometry_keeps_its_motion_whatever_the_guide() {
    for case in ["recolour", "shuffled-rows"] {
        let [knn, best] = errors(case, 2, 1500);
        assert!((best.epe - knn.epe).abs() < 1e-9, "{case}: {} and {}", best.epe, knn.epe);
    }
}
