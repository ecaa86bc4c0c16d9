//! Trained scenes of other methods: info, freeze, propagate and export of each.

use crate::support::{c4d, failure, fixture, success};
use gs_core::Splats;
use gs_io::{Existing, OpenOptions, SceneKind, ply};
use std::path::{Path, PathBuf};

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn write(path: &Path, splats: &Splats) {
    ply::write_file(path, splats, &ply::WriteOptions::default(), Existing::Refuse).unwrap();
}

/// Name in `info`, kind, path and required flags of each scene.
fn scenes() -> Vec<(&'static str, SceneKind, PathBuf, Vec<&'static str>)> {
    let base = |name: &str| fixture("bases").join(name);
    vec![
        (
            "Deformable-3D-Gaussians model folder",
            SceneKind::Deformable3dgs,
            base("deformable3dgs/blender_6dof_w40/model"),
            vec![],
        ),
        ("SC-GS model folder", SceneKind::Scgs, base("scgs/blender_w64/model"), vec![]),
        ("Grid4D model folder", SceneKind::Grid4d, base("grid4d/dnerf_w64/model"), vec![]),
        ("DASH model folder", SceneKind::Dash, base("dash/n3v_w64/model"), vec![]),
        ("E-D3DGS model folder", SceneKind::Ed3dgs, base("ed3dgs/early_anneal/model"), vec![]),
        (
            "Dynamic 3D Gaussians",
            SceneKind::Dynamic3dgs,
            base("dynamic3dgs/model/output/exp1/blob/params.npz"),
            vec![],
        ),
        ("Spacetime Gaussians", SceneKind::Spacetime, base("spacetime_lite/model"), vec![]),
        (
            "FreeTimeGS scene",
            SceneKind::FreeTime,
            base("freetimegs/vanilla/ckpts/ckpt_29999.pt"),
            vec![],
        ),
        (
            "native 4D Gaussians checkpoint",
            SceneKind::Gaussian4d,
            base("fudan4dgs/shfs4d/model"),
            vec!["--set", "time_duration=0,10"],
        ),
    ]
}

#[test]
fn unedited_splats_move_bit_for_bit_like_the_source() {
    for (name, kind, scene, flags) in scenes() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let with_flags = |arguments: &[&str]| {
            let mut command = c4d(arguments);
            command.args(&flags);
            command
        };
        let (shown, _) = success(&mut with_flags(&["info", path(&scene)]));
        assert!(shown.contains(name), "expected `{name}` in: {shown}");
        let (frozen, run, out) = (at("frozen"), at("run"), at("out"));
        success(&mut with_flags(&["freeze", path(&scene), "--time", "0.5", "-o", path(&frozen)]));
        let first = ply::read_file(&frozen.join("point_cloud.ply")).unwrap().splats;
        let order: Vec<usize> = (0..first.len()).map(|i| (i * 7919 + 13) % first.len()).collect();
        let shuffled = at("shuffled.ply");
        write(&shuffled, &first.select(&order));
        success(&mut with_flags(&[
            "propagate",
            path(&scene),
            "--edited",
            path(&shuffled),
            "--time",
            "0.5",
            "--no-refine",
            "-o",
            path(&run),
        ]));
        // The run records the flags of its source.
        success(&mut c4d([
            "export",
            path(&run),
            "--to",
            "ply-seq",
            "--frames",
            "3",
            "-o",
            path(&out),
        ]));
        let options = OpenOptions::default().with_time_duration(0.0, 10.0);
        let source = gs_io::open_scene_as(&scene, &kind, &options).unwrap().scene;
        for (index, t) in source.time_range().frames(3).into_iter().enumerate() {
            let frames: Vec<PathBuf> = {
                let entries = std::fs::read_dir(&out).unwrap();
                let mut files: Vec<PathBuf> = entries
                    .map(|entry| entry.unwrap().path())
                    .filter(|path| path.extension().is_some_and(|end| end == "ply"))
                    .collect();
                files.sort();
                files
            };
            let found = ply::read_file(&frames[index]).unwrap().splats;
            assert_eq!(found, source.at(t).unwrap().select(&order), "{name} at {t}, bit for bit");
        }
    }
}

#[test]
fn flags_are_checked() {
    let model = fixture("bases/fudan4dgs/shfs4d/model");
    let stderr = failure(&mut c4d(["info", path(&model)]), 3);
    assert!(stderr.contains("Pass --set time_duration=START,END"), "{stderr}");
    for wrong in ["time_duration=10", "time_duration=10,0", "time_duration=a,b", "grid_pe=2"] {
        let stderr = failure(&mut c4d(["info", path(&model), "--set", wrong]), 2);
        assert!(stderr.contains("time_duration=START,END"), "{wrong}: {stderr}");
    }
    let scgs = fixture("bases/scgs/blender_w64/model");
    failure(&mut c4d(["info", path(&scgs), "--set", "time_duration=0,1"]), 2);
}
