//! Detection of the kind of a path, and consistency of opening with it.

use gs_core::Splats;
use gs_io::ply::{self, WriteOptions};
use gs_io::{Existing, OpenOptions, SceneKind, detect, open_scene};
use std::fs;
use test_support::fixture;

fn one() -> Splats {
    Splats {
        means: vec![[0.0; 3]],
        quats: vec![[1.0, 0.0, 0.0, 0.0]],
        log_scales: vec![[0.0; 3]],
        opacity_logits: vec![0.0],
        sh: vec![[0.0; 3]],
        sh_degree: 0,
    }
}

#[test]
fn kinds_are_distinguished() {
    let model = fixture("deform4dgs/dnerf_like/model");
    assert_eq!(detect(&model).unwrap(), SceneKind::Model4dgs, "model folder");
    let iteration = model.join("point_cloud/iteration_20000");
    assert_eq!(detect(&iteration).unwrap(), SceneKind::Model4dgs, "iteration folder");
    assert_eq!(detect(&iteration.join("point_cloud.ply")).unwrap(), SceneKind::Ply, "PLY");
    let export = fixture("deform4dgs/variants/static_mlp_all_heads/gaussian_pertimestamp");
    assert_eq!(detect(&export).unwrap(), SceneKind::PlySequence, "sequence");
    let opened = open_scene(&export, &OpenOptions::default()).unwrap();
    assert_eq!(opened.scene.num_frames(), Some(6), "opens");
    let opened = open_scene(&model, &OpenOptions::default()).unwrap();
    assert!(opened.report.is_some() && opened.scene.num_splats() == 1500, "opens");

    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    assert_eq!(detect(dir.path()).unwrap(), SceneKind::Unknown { found: vec![] }, "empty");
    fs::write(path("notes.txt"), b"hello").unwrap();
    assert!(detect(&path("notes.txt")).unwrap().to_string().contains("`hello`"), "text file");
    assert!(detect(dir.path()).unwrap().to_string().contains("notes.txt"), "lists the entries");
    let error = open_scene(dir.path(), &OpenOptions::default()).unwrap_err().to_string();
    assert!(error.contains("notes.txt") && error.contains("expected"), "{error}");
    fs::write(path("a.ply"), b"ply\nformat ascii 1.0\nelement chunk 0\nend_header\n").unwrap();
    assert_eq!(detect(&path("a.ply")).unwrap(), SceneKind::CompressedPly, "compressed");
    let error = open_scene(&path("a.ply"), &OpenOptions::default()).unwrap_err().to_string();
    assert!(error.contains("a.ply") && error.contains("it is text"), "{error}");
    fs::write(
        path("b.ply"),
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n",
    )
    .unwrap();
    assert!(matches!(detect(&path("b.ply")).unwrap(), SceneKind::OtherPly(_)), "point cloud");
    fs::create_dir_all(path("swift/point_cloud/iteration_13000")).unwrap();
    fs::write(path("swift/point_cloud/iteration_13000/FDHash.pth"), b"").unwrap();
    assert_eq!(detect(&path("swift")).unwrap(), SceneKind::Swift4d, "Swift4D");
    let error = open_scene(&path("swift"), &OpenOptions::default()).unwrap_err().to_string();
    assert!(error.contains("point_cloud.ply"), "says what is missing: {error}");
    let model = fixture("swift4d/model");
    assert_eq!(detect(&model).unwrap(), SceneKind::Swift4d, "Swift4D");
    let opened = open_scene(&model, &OpenOptions::default()).unwrap();
    assert_eq!((opened.scene.num_splats(), opened.scene.num_frames()), (3000, Some(300)), "opens");
    assert!(opened.scene.dynamic_mask().is_some(), "with its split");
    fs::create_dir(path("run")).unwrap();
    fs::write(path("run/c4d.toml"), b"").unwrap();
    assert_eq!(detect(&path("run")).unwrap(), SceneKind::RunFolder, "run folder");
    assert!(detect(&path("missing")).unwrap_err().to_string().contains("missing"), "no such path");
}

#[test]
fn a_single_ply_is_static() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.ply");
    let mut splats = one().select(&[0, 0]);
    splats.quats[1] = [0.0; 4];
    ply::write_file(&path, &splats, &WriteOptions::default(), Existing::Refuse).unwrap();
    let opened = open_scene(&path, &OpenOptions::default()).unwrap();
    assert_eq!(opened.scene.at(0.3).unwrap(), one(), "damaged row dropped");
    assert!(opened.warnings[0].contains("1 of 2"), "{:?}", opened.warnings);
    let mut geometry = Splats::default();
    opened.scene.geometry_into(1.0, &mut geometry).unwrap();
    assert_eq!((geometry.means.len(), geometry.sh.len()), (1, 0), "geometry alone");
    assert!(opened.scene.at(2.0).is_err(), "outside");
}
