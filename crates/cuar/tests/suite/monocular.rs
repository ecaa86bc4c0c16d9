//! A video of one moving camera: a single view per time must not increase any error.

use crate::common;
use crate::common::delivered::{Delivered, Judge, cases, delivered, rings};
use cuar::{NoRefineObserver, RefineOptions, Views};
use gs_core::{Camera, DynamicScene, TimeRange};

/// A camera that moves along a third of a circle around the figure, one view per time.
fn walk(count: usize, width: u32, height: u32) -> Vec<Camera> {
    let at = |k: usize| {
        let share = k as f64 / (count - 1) as f64;
        let (sin, cos) = (-60.0 + 120.0 * share).to_radians().sin_cos();
        let eye = [4.4 * sin, 1.5 + 0.3 * (9.0 * share).sin(), 4.4 * cos];
        let camera = Camera::look_at(eye, [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], 0.52, width, height);
        #[expect(clippy::cast_possible_truncation, reason = "a time of 0 to 1")]
        let time = Some(share as f32);
        Camera { time, name: format!("{k:03}"), ..camera }
    };
    (0..count).map(at).collect()
}

/// Images in which `now` is more than `loss` dB farther from the truth than `then`.
fn worse(judge: &Judge, then: &dyn DynamicScene, now: &dyn DynamicScene, loss: f64) -> Vec<String> {
    let all = |scene: &dyn DynamicScene| -> Vec<f64> {
        let scores = judge.scores(scene).into_iter();
        let error = |score: common::delivered::Score| {
            let (a, b) = (score.revealed, score.elsewhere);
            (-10.0 * ((a.0 + b.0) / (a.1 + b.1)).log10()).min(100.0)
        };
        scores.map(error).collect()
    };
    let pairs = all(then).into_iter().zip(all(now)).enumerate();
    pairs
        .filter(|(_, (then, now))| *now < then - loss)
        .map(|(image, (then, now))| format!("image {image}: {then:.2} → {now:.2} dB"))
        .collect()
}

/// Asserts that refinement from `cameras` worsens no view around the figure.
fn assert_not_worse(case: &Delivered, scene: &dyn DynamicScene, cameras: &[Camera], what: &str) {
    let times = TimeRange::UNIT.frames(12);
    let held_out: Vec<usize> = (2..cameras.len()).step_by(5).collect();
    let views = Views { cameras, times: &times, held_out: &held_out };
    let options = RefineOptions { samples: 40, ..RefineOptions::default() };
    let refined = case.refined_from(scene, &views, &options, None, &mut NoRefineObserver).unwrap();
    let judge = Judge::of(case, scene, &[0.25, 0.5, 0.75]);
    let refined_scene = refined.scene(scene);
    let [then, now] = [scene, &refined_scene].map(|scene| judge.score(scene).db());
    let shown = format!("{what}: {then:.2?} → {now:.2?} dB, {:?}", refined.report.repair);
    for part in 0..4 {
        assert!(now[part] > then[part] - 0.02, "{shown}");
    }
    let worse = worse(&judge, scene, &refined_scene, 0.1);
    assert!(worse.is_empty(), "{what}: {worse:?}");
}

#[test]
fn a_moving_camera_increases_no_error() {
    let walk = walk(24, 128, 128);
    // the cameras of a data set are used at every time, because images are renders of the scene
    let standing: Vec<Camera> =
        walk.iter().step_by(2).map(|camera| Camera { time: None, ..camera.clone() }).collect();
    let (name, edits) = cases().swap_remove(0);
    let around = delivered(name, &edits, 8_000, 2, |scene| rings(scene, (128, 128)));
    let own =
        delivered(name, &edits, 8_000, 3, |scene| (standing.clone(), rings(scene, (128, 128)).1));
    for (case, editor) in [(&around, "pictures all around"), (&own, "pictures of the walk")] {
        for (cameras, which) in [(&walk, "one view a time"), (&standing, "every time")] {
            assert_not_worse(case, case.scene(), cameras, &format!("{editor}, {which}"));
        }
    }
    let perfect = around.perfect();
    assert_not_worse(&perfect, perfect.scene(), &walk, "perfect");
}
