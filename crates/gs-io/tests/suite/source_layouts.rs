//! The scene of a `.splatv` is the same in the layouts of Spacetime
//! Gaussians and FreeTimeGS, and each layout is detected.

use crate::common::changing_scene;
use crate::common::layouts;

use gs_core::{Camera, DynamicScene, Splats, covariance};
use gs_deform::{Polynomial, PolynomialScene};
use gs_io::repair::Damage;
use gs_io::{Clip, Existing, OpenOptions, SceneKind, detect, open_scene_as, splatv};
use std::fs;
use std::path::Path;

/// Splats that appear and disappear, and move along cubic polynomials or lines.
fn scene(n: usize, lines: bool) -> PolynomialScene {
    let rest = changing_scene::scene(n, 2, 0).at(0.0).unwrap();
    let motions = (0..n)
        .map(|i| {
            let x = (i as f32 * 0.7).sin();
            let bend = if lines { 0.0 } else { 1.0 };
            Polynomial {
                velocity: [[x, 1.0, -x], [bend * x, -bend, 0.5 * bend], [-bend * x, 0.0, bend]],
                omega: [0.0, 0.2 * bend * x, 0.0, -0.1 * bend],
                centre: 0.5 + 0.4 * x,
                width: if i % 3 == 0 { 1e4 } else { 0.25 + 0.1 * x },
            }
        })
        .collect();
    PolynomialScene::new(rest, motions).unwrap()
}

/// The scene written as `.splatv` and read back, which has the file's rounded values.
fn as_splatv(scene: &PolynomialScene, path: &Path) -> PolynomialScene {
    let times = scene.time_range().frames(30);
    let clip = Clip { scene, times: &times, fps: 30.0 };
    let camera = Camera::look_at([0.0, 0.0, -8.0], [0.0; 3], [0.0, -1.0, 0.0], 0.9, 640, 480);
    let options = splatv::WriteOptions {
        tolerance: splatv::DEFAULT_TOLERANCE,
        force: true,
        camera,
        up: [0.0, -1.0, 0.0],
    };
    splatv::write(path, &clip, &options, Existing::Refuse, &mut |_| ()).unwrap();
    splatv::open(path, Damage::Fail).unwrap().scene
}

/// Largest differences of two evaluations: centres, covariances over their traces, opacities,
/// colours.
fn differences(a: &Splats, b: &Splats, floor: f32) -> [f64; 4] {
    let mut worst = [0.0_f64; 4];
    for row in 0..a.len() {
        let covariance = |splats: &Splats| {
            covariance(splats.rotation(row).map(f64::from), splats.scale(row).map(f64::from))
        };
        let (ca, cb) = (covariance(a), covariance(b));
        let trace = ca[0] + ca[3] + ca[5];
        let pairs = |a: &[f32], b: &[f32]| -> f64 {
            a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
        };
        let shapes = ca.iter().zip(cb).map(|(a, b)| (a - b).abs() / trace).fold(0.0, f64::max);
        let opacity = (a.opacity(row).max(floor) - b.opacity(row)).abs();
        let found = [
            pairs(&a.means[row], &b.means[row]),
            shapes,
            opacity.into(),
            pairs(&a.sh[row], &b.sh[row]),
        ];
        for (worst, found) in worst.iter_mut().zip(found) {
            *worst = worst.max(found);
        }
    }
    worst
}

#[test]
fn a_splatv_is_the_same_scene_in_other_layouts() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let cubics = as_splatv(&scene(200, false), &at("cubics.splatv"));
    let lines = as_splatv(&scene(200, true), &at("lines.splatv"));
    // Linear motion without rotation, so that errors of the fit do
    // not affect the comparison of layouts.
    let straight = PolynomialScene::new(
        lines.rest().clone(),
        lines
            .motions()
            .iter()
            .map(|motion| Polynomial {
                velocity: [motion.velocity[0], [0.0; 3], [0.0; 3]],
                omega: [0.0; 4],
                ..*motion
            })
            .collect(),
    )
    .unwrap();
    let cases: [(&PolynomialScene, Vec<u8>, SceneKind, f32); 3] = [
        (&cubics, layouts::spacetime(&cubics), SceneKind::Spacetime, 0.0),
        (&straight, layouts::freetime_ply(&straight), SceneKind::FreeTime, 0.0),
        (&straight, layouts::freetime_checkpoint(&straight), SceneKind::FreeTime, 1e-4),
    ];
    for (index, (truth, bytes, kind, floor)) in cases.into_iter().enumerate() {
        let path = at(&format!("{index}"));
        fs::write(&path, bytes).unwrap();
        assert_eq!(detect(&path).unwrap(), kind, "by content, for any name");
        let read = open_scene_as(&path, &kind, &OpenOptions::default()).unwrap().scene;
        for t in [0.0, 0.31, 0.77, 1.0] {
            let (expected, found) = (truth.at(t).unwrap(), read.at(t).unwrap());
            let [means, shapes, opacities, colours] = differences(&expected, &found, floor);
            assert!(means < 1e-6 && shapes < 1e-6, "layout {index} at {t}: {means} {shapes}");
            assert!(opacities < 2e-6 && colours < 1e-6, "at {t}: {opacities} {colours}");
        }
        // Negative control: the comparison fails at a different time.
        let (early, late) = (truth.at(0.0).unwrap(), read.at(1.0).unwrap());
        assert!(differences(&early, &late, floor)[0] > 0.1, "it moves");
    }
}
