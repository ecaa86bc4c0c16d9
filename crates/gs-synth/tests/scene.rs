//! The demo scene: sizes, determinism, exactness at frame 1, rigid parts, motion, flaws, cameras.

use glam::Vec3;
use gs_core::{DynamicScene, SceneError, Splats};
use gs_synth::{DemoParams, Kind, Part, SynthError, SynthScene, demo};

const TIMES: [f32; 6] = [0.0, 0.13, 0.37, 0.5, 0.81, 1.0];

fn small() -> SynthScene {
    demo(&DemoParams { num_splats: 4_000, ..DemoParams::default() }).expect("valid")
}

fn distance(splats: &Splats, a: usize, b: usize) -> f32 {
    Vec3::from(splats.means[a]).distance(Vec3::from(splats.means[b]))
}

#[test]
fn sizes_are_exact() {
    for num_splats in [1_000, 1_001, 7_777, 30_000] {
        for sh_degree in 0..=3 {
            let params =
                DemoParams { num_splats, sh_degree, floaters: 0.03, ..DemoParams::default() };
            let scene = demo(&params).unwrap();
            assert_eq!(scene.num_splats(), num_splats, "N");
            assert_eq!(scene.sh_degree(), sh_degree, "degree");
            assert_eq!(scene.rows().len(), num_splats, "rows");
            scene.frame1().check_shapes().unwrap();
        }
    }
}

#[test]
fn equal_seeds_give_equal_scenes() {
    let params = DemoParams {
        num_splats: 3_000,
        seed: 5,
        trajectory_noise: 0.001,
        floaters: 0.02,
        jitter: 0.001,
        ..DemoParams::default()
    };
    let (a, b) = (demo(&params).unwrap(), demo(&params).unwrap());
    for t in TIMES {
        assert_eq!(a.at(t).unwrap(), b.at(t).unwrap(), "t = {t}");
    }
    let other = demo(&DemoParams { seed: 6, ..params }).unwrap();
    assert_ne!(a.frame1(), other.frame1(), "a different seed");
}

#[test]
fn frame_1_is_bit_identical_and_the_clip_loops() {
    let params = DemoParams { num_splats: 3_000, trajectory_noise: 0.001, ..DemoParams::default() };
    let scene = demo(&params).unwrap();
    assert_eq!(scene.at(0.0).unwrap(), *scene.frame1(), "t = 0");
    let end = scene.at(1.0).unwrap();
    for i in 0..scene.num_splats() {
        let gap = Vec3::from(end.means[i]).distance(Vec3::from(scene.frame1().means[i]));
        assert!(gap < 1e-4, "row {i}: {gap}");
    }
}

#[test]
fn everything_is_finite_and_rotations_are_unit() {
    let params = DemoParams {
        num_splats: 4_000,
        trajectory_noise: 0.002,
        floaters: 0.05,
        jitter: 0.002,
        sh_degree: 2,
        ..DemoParams::default()
    };
    let scene = demo(&params).unwrap();
    for t in TIMES {
        let splats = scene.at(t).unwrap();
        for i in 0..splats.len() {
            assert!(splats.is_finite(i), "row {i} at {t}");
            let norm: f32 = splats.quats[i].iter().map(|c| c * c).sum();
            assert!((norm - 1.0).abs() < 1e-4, "row {i} at {t}: |q|² = {norm}");
        }
    }
}

#[test]
fn rigid_parts_keep_their_distances() {
    let scene = small();
    // the chest breathes, so it is excluded
    let parts = [Part::Head, Part::ForearmL, Part::ForearmR, Part::ShinL, Part::FootR];
    for part in parts {
        let rigid: Vec<usize> = (0..scene.num_splats())
            .filter(|&i| scene.rows()[i].rigid_bone() == Some(part.bone()))
            .take(40)
            .collect();
        assert!(rigid.len() > 10, "{part:?} has rigid splats: {}", rigid.len());
        for t in TIMES {
            let splats = scene.at(t).unwrap();
            for (&a, &b) in rigid.iter().zip(&rigid[1..]) {
                let change = (distance(&splats, a, b) - distance(scene.frame1(), a, b)).abs();
                assert!(change < 2e-6, "{part:?} at {t}: {change}");
            }
        }
    }
}

#[test]
fn the_arm_moves_far_and_passes_close_to_the_torso() {
    let scene = small();
    let rows_of = |part: Part| -> Vec<usize> {
        (0..scene.num_splats()).filter(|&i| scene.rows()[i].part == part).collect()
    };
    let (arm, chest) = (rows_of(Part::ForearmL), rows_of(Part::Chest));
    let (mut nearest, mut farthest) = (f32::INFINITY, 0.0_f32);
    for step in 0_u8..=20 {
        let splats = scene.at(f32::from(step) / 20.0).unwrap();
        for &a in &arm {
            let moved = Vec3::from(splats.means[a]).distance(scene.frame1().means[a].into());
            farthest = farthest.max(moved);
            if scene.rows()[a].rest[1] < 1.0 {
                for &b in &chest {
                    nearest = nearest.min(distance(&splats, a, b));
                }
            }
        }
    }
    assert!(farthest > 0.25 * scene.figure_size(), "travels {farthest}");
    assert!(nearest < 0.05 * scene.figure_size(), "nearest approach {nearest}");
}

#[test]
fn scenery_is_static_and_the_figure_moves() {
    let scene = small();
    let moving = scene.moving_mask();
    let later = scene.at(0.4).unwrap();
    for (i, row) in scene.rows().iter().enumerate() {
        let still = later.means[i] == scene.frame1().means[i];
        assert_eq!(still, Part::SCENERY.contains(&row.part), "row {i}: {:?}", row.part);
        assert_eq!(moving[i], !still, "mask of row {i}");
    }
}

#[test]
fn trajectory_noise_has_the_requested_amplitude() {
    let noise = 0.001;
    let params = DemoParams { num_splats: 4_000, trajectory_noise: noise, ..DemoParams::default() };
    let noisy = demo(&params).unwrap();
    let clean = noisy.noise_free();
    assert_eq!(clean.frame1(), noisy.frame1(), "noise starts at zero");
    let (mut sum, mut count) = (0.0_f64, 0.0);
    for t in [0.1, 0.3, 0.6, 0.8] {
        let (a, b) = (noisy.at(t).unwrap(), clean.at(t).unwrap());
        for i in (0..a.len()).filter(|&i| noisy.moving_mask()[i]) {
            sum += f64::from(Vec3::from(a.means[i]).distance_squared(b.means[i].into()));
            count += 3.0;
        }
    }
    let rms = (sum / count).sqrt() / f64::from(noisy.figure_size() * noise);
    assert!((0.6..1.5).contains(&rms), "root mean square per axis, as a multiple: {rms}");
}

#[test]
fn floaters_move() {
    let params = DemoParams { num_splats: 2_000, floaters: 0.05, ..DemoParams::default() };
    let scene = demo(&params).unwrap();
    let floaters: Vec<usize> =
        (0..2_000).filter(|&i| scene.rows()[i].kind == Kind::Floater).collect();
    assert_eq!(floaters.len(), 100, "5 %");
    let later = scene.at(0.9).unwrap();
    let moved = floaters.iter().filter(|&&i| later.means[i] != scene.frame1().means[i]).count();
    assert_eq!(moved, 100, "all of them move");
}

#[test]
fn surfaces_are_flat_and_opaque() {
    let scene = small();
    let splats = scene.frame1();
    for (i, row) in scene.rows().iter().enumerate() {
        if row.kind == Kind::Surface {
            let mut scale = splats.scale(i);
            scale.sort_by(f32::total_cmp);
            assert!(scale[0] < 0.35 * scale[1], "row {i} is a disc: {scale:?}");
            assert!(splats.opacity(i) > 0.9, "row {i} is opaque");
        }
    }
}

#[test]
fn invalid_parameters_are_refused() {
    let bad = [
        DemoParams { num_splats: 10, ..DemoParams::default() },
        DemoParams { sh_degree: 4, ..DemoParams::default() },
        DemoParams { floaters: f32::NAN, ..DemoParams::default() },
        DemoParams { trajectory_noise: -1.0, ..DemoParams::default() },
        DemoParams { jitter: 2.0, ..DemoParams::default() },
    ];
    for params in bad {
        assert!(matches!(demo(&params), Err(SynthError::Param { .. })), "{params:?}");
    }
    let scene = small();
    for t in [-0.1, 1.1, f32::NAN] {
        assert!(matches!(scene.at(t), Err(SceneError::Time { .. })), "t = {t}");
    }
}

#[test]
fn cameras_see_the_whole_figure_at_all_times() {
    let scene = small();
    let cameras = scene.suggested_cameras(320, 240);
    assert_eq!(cameras.len(), 13, "front and twelve");
    assert_eq!(cameras[0].name, "front", "first");
    for t in TIMES {
        let splats = scene.at(t).unwrap();
        for camera in &cameras {
            camera.check().unwrap();
            for i in (0..splats.len()).filter(|&i| scene.moving_mask()[i]) {
                let mean = splats.means[i].map(f64::from);
                let [x, y] = camera.project(mean).unwrap();
                let inside = (0.0..320.0).contains(&x) && (0.0..240.0).contains(&y);
                assert!(inside, "{} at {t}: row {i} at ({x}, {y})", camera.name);
            }
        }
    }
}
