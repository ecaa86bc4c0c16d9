//! Trained scenes of other methods with missing, truncated, misshaped or non-finite parts: each is
//! refused with the file's name and the next step, or read without the damaged rows.

use gs_io::pth::{self, NamedTensor};
use gs_io::repair::Damage;
use gs_io::{OpenOptions, SceneKind, detect, frame, open_scene_as};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use test_support::fixture;

fn options() -> OpenOptions {
    OpenOptions::default().with_time_duration(0.0, 10.0)
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &target);
        } else {
            fs::copy(&path, &target).unwrap();
        }
    }
}

/// A copy of a fixture's model, and the path of a file in it.
fn model(name: &str, file: &str) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    copy(&fixture("bases").join(name), dir.path());
    let path = dir.path().join(file);
    assert!(path.is_file(), "{}", path.display());
    (dir, path)
}

/// Fixture, kind, and a file on which the scene depends.
const PARTS: [(&str, SceneKind, &str); 15] = [
    (
        "deformable3dgs/real_w40/model",
        SceneKind::Deformable3dgs,
        "deform/iteration_40000/deform.pth",
    ),
    (
        "deformable3dgs/real_w40/model",
        SceneKind::Deformable3dgs,
        "point_cloud/iteration_30000/point_cloud.ply",
    ),
    ("deformable3dgs/real_w40/model", SceneKind::Deformable3dgs, "cfg_args"),
    ("scgs/real_local_frame_mask_w64/model", SceneKind::Scgs, "deform/iteration_70000/deform.pth"),
    (
        "scgs/real_local_frame_mask_w64/model",
        SceneKind::Scgs,
        "point_cloud/iteration_80000/point_cloud.ply",
    ),
    ("spacetime_lite/model", SceneKind::Spacetime, "point_cloud/iteration_30000/point_cloud.ply"),
    ("freetimegs/vanilla/ckpts", SceneKind::FreeTime, "ckpt_29999.pt"),
    ("freetimegs/vanilla/ckpts", SceneKind::FreeTime, "ckpt_29999.ftgs.ply"),
    ("fudan4dgs/no_shfs4d/model", SceneKind::Gaussian4d, "chkpnt7000.pth"),
    ("grid4d/real_depth1_w48/model", SceneKind::Grid4d, "deform/iteration_30000/deform.pth"),
    ("dash/n3v_w64/model", SceneKind::Dash, "deform/iteration_50000/deform.pth"),
    ("dash/n3v_w64/model", SceneKind::Dash, "cfg_args"),
    ("ed3dgs/hyper_d0/model", SceneKind::Ed3dgs, "point_cloud/iteration_14000/deformation.pth"),
    ("ed3dgs/hyper_d0/model", SceneKind::Ed3dgs, "point_cloud/iteration_14000/point_cloud.ply"),
    ("dynamic3dgs/model/output/exp1/blob", SceneKind::Dynamic3dgs, "params.npz"),
];

/// The path to open: the model folder, or the file if that is the scene.
fn scene_of<'a>(dir: &'a Path, kind: &SceneKind, file: &'a Path) -> &'a Path {
    if *kind == SceneKind::FreeTime { file } else { dir }
}

#[test]
fn truncated_files_are_named() {
    for (name, kind, file) in PARTS {
        let (dir, path) = model(name, file);
        let whole = fs::read(&path).unwrap();
        for keep in [0, 1, 30, whole.len() / 3, whole.len() / 2, whole.len() - 1] {
            fs::write(&path, &whole[..keep]).unwrap();
            let _ = detect(dir.path());
            let error = open_scene_as(scene_of(dir.path(), &kind, &path), &kind, &options());
            let error = error.expect_err(&format!("{file}: {keep} of {} bytes", whole.len()));
            let named = error.to_string().contains(path.file_name().unwrap().to_str().unwrap());
            assert!(named, "{file}, {keep} bytes: {error}");
        }
    }
}

/// Rewrites the tensors of a file after applying `change`;
/// names of nested parts are joined with dots.
fn rewrite(path: &Path, change: impl Fn(&str, &mut Vec<usize>, &mut Vec<f32>)) {
    let bytes = fs::read(path).unwrap();
    let tensors = pth::read(&bytes).unwrap().into_state_dict().unwrap();
    let changed: Vec<(String, Vec<usize>, Vec<f32>)> = tensors
        .into_iter()
        .map(|(name, tensor)| {
            let (mut shape, mut values) = (tensor.shape().to_vec(), tensor.to_f32s());
            change(&name, &mut shape, &mut values);
            (name, shape, values)
        })
        .collect();
    let named: Vec<NamedTensor<'_>> =
        changed.iter().map(|(name, shape, values)| NamedTensor { name, shape, values }).collect();
    let mut out = Vec::new();
    pth::write(&named, &mut out).unwrap();
    fs::write(path, out).unwrap();
}

/// Indices of the parts whose file contains tensors.
const NETWORKS: [usize; 7] = [0, 3, 6, 8, 9, 10, 12];

#[test]
fn wrong_shapes_and_missing_tensors_are_named() {
    for part in NETWORKS {
        let (name, kind, file) = PARTS[part].clone();
        let (_keep, whole) = model(name, file);
        let bytes = fs::read(&whole).unwrap();
        let names: Vec<String> = pth::read(&bytes)
            .unwrap()
            .into_state_dict()
            .unwrap()
            .into_iter()
            .map(|(name, _)| name)
            .filter(|name| !name.contains("optim") && !name.contains("gs_"))
            .collect();
        let mut refused = 0;
        for wanted in &names {
            let (dir, path) = model(name, file);
            rewrite(&path, |name, shape, values| {
                if name == wanted {
                    shape.push(2);
                    values.extend(values.clone());
                }
            });
            let scene = scene_of(dir.path(), &kind, &path);
            match open_scene_as(scene, &kind, &options()) {
                // Training statistics are not read.
                Ok(_) => {}
                Err(error) => {
                    assert!(error.to_string().contains("shape"), "{file}, {wanted}: {error}");
                    refused += 1;
                }
            }
        }
        assert!(refused >= 8, "{file}: {refused} of {} tensors matter", names.len());
    }
}

#[test]
fn weights_that_are_not_finite_are_refused() {
    for (name, kind, file, tensor) in [
        (PARTS[0].0, PARTS[0].1.clone(), PARTS[0].2, "linear.3.weight"),
        (PARTS[0].0, PARTS[0].1.clone(), PARTS[0].2, "gaussian_scaling.bias"),
        (PARTS[3].0, PARTS[3].1.clone(), PARTS[3].2, "_node_radius"),
        (PARTS[3].0, PARTS[3].1.clone(), PARTS[3].2, "network.local_rotation.weight"),
        (PARTS[9].0, PARTS[9].1.clone(), PARTS[9].2, "0.xyt_encoding.embeddings"),
        (PARTS[10].0, PARTS[10].1.clone(), PARTS[10].2, "1.gaussian_warp.weight"),
        (PARTS[12].0, PARTS[12].1.clone(), PARTS[12].2, "feature_out_f.0.weight"),
    ] {
        for value in [f32::NAN, f32::INFINITY] {
            let (dir, path) = model(name, file);
            rewrite(&path, |name, _, values| {
                if name == tensor {
                    values[0] = value;
                }
            });
            let error = open_scene_as(dir.path(), &kind, &options()).unwrap_err().to_string();
            // One part of a dotted name identifies the tensor.
            let known =
                tensor.split('.').find(|part| part.contains('_') || part.contains("linear"));
            let known = known.unwrap().trim_end_matches("_f");
            assert!(error.contains(known) && error.contains("NaN or infinite"), "{error}");
        }
    }
}

#[test]
fn damaged_rows_are_dropped_and_counted() {
    for (name, kind, file, tensor) in [
        (PARTS[6].0, PARTS[6].1.clone(), PARTS[6].2, "splats.velocities"),
        (PARTS[6].0, PARTS[6].1.clone(), PARTS[6].2, "splats.means"),
        (PARTS[8].0, PARTS[8].1.clone(), PARTS[8].2, "0.13"),
        (PARTS[8].0, PARTS[8].1.clone(), PARTS[8].2, "0.15"),
    ] {
        let (dir, path) = model(name, file);
        let scene = scene_of(dir.path(), &kind, &path);
        let whole = open_scene_as(scene, &kind, &options()).unwrap();
        let splats = whole.scene.at(0.4).unwrap();
        rewrite(&path, |name, _, values| {
            if name == tensor {
                values[0] = f32::NAN;
            }
        });
        let read = open_scene_as(scene, &kind, &options()).unwrap();
        assert_eq!(read.repair.damaged(), 1, "{tensor}: counted");
        let rows: Vec<usize> = (1..splats.len()).collect();
        assert_eq!(read.scene.at(0.4).unwrap(), splats.select(&rows), "{tensor}: the others");
        let strict = options().with_damage(Damage::Fail);
        assert!(open_scene_as(scene, &kind, &strict).is_err(), "{tensor}: refused");
    }
}

#[test]
fn a_missing_network_is_an_error_with_the_folder_to_copy() {
    for (name, kind) in [(PARTS[0].0, &PARTS[0].1), (PARTS[3].0, &PARTS[3].1)] {
        let (dir, _) = model(name, "cfg_args");
        fs::remove_dir_all(dir.path().join("deform")).unwrap();
        assert_eq!(detect(dir.path()).unwrap(), *kind, "detected by the training settings");
        let error = open_scene_as(dir.path(), kind, &options()).unwrap_err().to_string();
        assert!(error.contains("copy the folder `deform`"), "{error}");
        fs::create_dir_all(dir.path().join("deform/iteration_9")).unwrap();
        let error = open_scene_as(dir.path(), kind, &options()).unwrap_err().to_string();
        assert!(error.contains("copy the folder `deform`"), "an empty save: {error}");
    }
}

#[test]
fn settings_only_in_cfg_args_are_requested_if_missing() {
    for part in [9, 10] {
        let (name, kind, _) = PARTS[part].clone();
        let (dir, cfg) = model(name, "cfg_args");
        let whole = open_scene_as(dir.path(), &kind, &options()).unwrap().scene.at(0.4).unwrap();
        fs::remove_file(&cfg).unwrap();
        assert_eq!(detect(dir.path()).unwrap(), kind, "detected by the network");
        let error = open_scene_as(dir.path(), &kind, &options()).unwrap_err().to_string();
        assert!(error.contains("--set bound="), "{error}");
        let bound = if kind == SceneKind::Dash { 1.0 } else { 2.0 };
        let given = options().with_bound(bound);
        let found = open_scene_as(dir.path(), &kind, &given).unwrap().scene.at(0.4).unwrap();
        assert_eq!(found, whole, "{name}: as with cfg_args");
    }
    let (dir, cfg) = model(PARTS[12].0, "cfg_args");
    fs::remove_file(&cfg).unwrap();
    let source = open_scene_as(dir.path(), &SceneKind::Ed3dgs, &options()).unwrap();
    assert!(source.warnings[0].contains("cfg_args is missing"), "{:?}", source.warnings);
}

#[test]
fn missing_columns_are_reported() {
    let (dir, path) = model(PARTS[4].0, PARTS[4].2);
    let splats = gs_io::ply::read_file(&path).unwrap().splats;
    let mut bytes = Vec::new();
    gs_io::ply::write(&splats, &gs_io::ply::WriteOptions::default(), &mut bytes).unwrap();
    fs::write(&path, bytes).unwrap();
    let error = open_scene_as(dir.path(), &SceneKind::Scgs, &options()).unwrap_err().to_string();
    assert!(error.contains("fea_0") && error.contains("editor dropped"), "{error}");
}

#[test]
fn unsupported_options_are_named() {
    let (dir, path) = model(PARTS[3].0, "cfg_args");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replace("use_hash=False", "use_hash=True")).unwrap();
    let error = open_scene_as(dir.path(), &SceneKind::Scgs, &options()).unwrap_err().to_string();
    assert!(error.contains("use_hash=True") && error.contains("not supported"), "{error}");

    let full = fixture("bases/spacetime_full_refuse/model");
    assert_eq!(detect(&full).unwrap(), SceneKind::Spacetime, "named");
    let error = open_scene_as(&full, &SceneKind::Spacetime, &options()).unwrap_err().to_string();
    assert!(error.contains("full model") && error.contains("ours_lite"), "{error}");

    let (_dir, path) = model(PARTS[7].0, PARTS[7].2);
    let bytes = fs::read(&path).unwrap();
    for (from, to) in [
        (&b"time_units normalized"[..], &b"time_units secondsXYZ"[..]),
        (b"ftgs_version 1", b"ftgs_version 2"),
        (b"opacity_floor 0.0001", b"opacity_floor -0.001"),
        (b"use_velocity 1", b"use_velocity 7"),
        (b"n_frames 60", b"n_frames -6"),
    ] {
        let at = bytes.windows(from.len()).position(|window| window == from).unwrap();
        let mut changed = bytes.clone();
        changed[at..at + to.len()].copy_from_slice(to);
        fs::write(&path, changed).unwrap();
        let error = open_scene_as(&path, &SceneKind::FreeTime, &options()).unwrap_err().to_string();
        let name = String::from_utf8_lossy(to).split(' ').next().unwrap().to_owned();
        assert!(error.contains(&name) && error.contains("expected"), "{error}");
    }
}

#[test]
fn dynamic_scenes_are_not_frames_and_frames_are_static() {
    for part in [5, 6, 7] {
        let (_dir, path) = model(PARTS[part].0, PARTS[part].2);
        let error = frame::read_file(&path).unwrap_err().to_string();
        assert!(
            error.contains("dynamic scene") && error.contains("use it as the scene"),
            "{error}"
        );
    }
    // The same checkpoint without times is one of gsplat's own trainer.
    let (_dir, path) = model(PARTS[6].0, PARTS[6].2);
    let splats = open_scene_as(&path, &SceneKind::FreeTime, &options()).unwrap().scene.at(0.5);
    let bytes = fs::read(&path).unwrap();
    let tensors = pth::read(&bytes).unwrap().into_state_dict().unwrap();
    let still: Vec<(String, Vec<usize>, Vec<f32>)> = tensors
        .into_iter()
        .filter_map(|(name, tensor)| {
            let name = name.strip_prefix("splats.")?;
            let moves = ["times", "durations", "velocities"].contains(&name);
            (!moves).then(|| (name.to_owned(), tensor.shape().to_vec(), tensor.to_f32s()))
        })
        .collect();
    let named: Vec<NamedTensor<'_>> =
        still.iter().map(|(name, shape, values)| NamedTensor { name, shape, values }).collect();
    let mut out = Vec::new();
    pth::write(&named, &mut out).unwrap();
    fs::write(&path, out).unwrap();
    assert_eq!(detect(&path).unwrap(), SceneKind::Gsplat, "one frame");
    let frame = frame::read_file(&path).unwrap();
    assert_eq!(frame.splats.sh, splats.unwrap().sh, "its colours");
}
