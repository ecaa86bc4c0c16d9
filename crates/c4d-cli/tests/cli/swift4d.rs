//! A Swift4D model folder from `info` to an edited scene, and errors for missing parts.

use crate::support::{c4d, failure, fixture, listing, success};
use gs_core::{DynamicScene, Splats};
use gs_io::model_folder::Overrides;
use gs_io::{Existing, ply, swift4d};
use std::fs;
use std::path::{Path, PathBuf};

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn write(path: &Path, splats: &Splats) {
    ply::write_file(path, splats, &ply::WriteOptions::default(), Existing::Refuse).unwrap();
}

/// A copy of the fixture, to be damaged.
fn copy(to: &Path) -> (PathBuf, PathBuf) {
    let (model, save) = (to.join("model"), to.join("model/point_cloud/iteration_13000"));
    fs::create_dir_all(&save).unwrap();
    for name in [
        "cfg_args",
        "point_cloud/iteration_13000/FDHash.pth",
        "point_cloud/iteration_13000/point_cloud.ply",
    ] {
        fs::write(model.join(name), fs::read(fixture("swift4d/model").join(name)).unwrap())
            .unwrap();
    }
    (model, save)
}

#[test]
fn unedited_splats_move_bit_for_bit_like_the_source() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let model = fixture("swift4d/model");
    let (shown, _) = success(&mut c4d(["info", path(&model)]));
    for part in [
        "Swift4D model folder",
        "13000",
        "1210 of 3000",
        "1196",
        "activation = relu",
        "frames       300",
    ] {
        assert!(shown.contains(part), "expected `{part}` in: {shown}");
    }
    let (frozen, run, out) = (at("frozen"), at("run"), at("out"));
    success(&mut c4d(["freeze", path(&model), "-o", path(&frozen)]));
    let first = ply::read_file(&frozen.join("point_cloud.ply")).unwrap().splats;
    let order: Vec<usize> = (0..first.len()).map(|i| (i * 7919 + 13) % first.len()).collect();
    let shuffled = at("shuffled.ply");
    write(&shuffled, &first.select(&order));
    let mut propagate = c4d([
        "propagate",
        path(&model),
        "--edited",
        path(&shuffled),
        "--no-refine",
        "-o",
        path(&run),
    ]);
    let (_, stderr) = success(&mut propagate);
    assert!(stderr.contains("3000 unchanged (exact)"), "all are found: {stderr}");
    assert!(stderr.contains("from 1210 moving"), "the model's own split: {stderr}");
    success(&mut c4d(["export", path(&run), "--to", "ply-seq", "--frames", "4", "-o", path(&out)]));
    let source = swift4d::open(&model, &Overrides::default()).unwrap().scene;
    let times = source.time_range().frames(4);
    let mut names = listing(&out);
    names.retain(|name| Path::new(name).extension().is_some_and(|extension| extension == "ply"));
    assert_eq!(names.len(), 4, "frames");
    for (name, t) in names.iter().zip(times) {
        let found = ply::read_file(&out.join(name)).unwrap().splats;
        assert_eq!(found, source.at(t).unwrap().select(&order), "time {t}, bit for bit");
        assert!(t == 0.0 || found.means != first.select(&order).means, "it moves");
    }
}

#[test]
fn edits_are_propagated_rendered_and_exported() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let model = fixture("swift4d/model");
    let scene = swift4d::open(&model, &Overrides::default()).unwrap().scene;
    let (first, dynamic) = (scene.at(0.0).unwrap(), scene.dynamic_mask().unwrap());
    let edited = at("edited.ply");
    let mut splats = first.clone();
    for (mean, _) in
        splats.means.iter_mut().zip(dynamic).filter(|(_, dynamic)| **dynamic).step_by(3)
    {
        mean[1] -= 0.01;
    }
    write(&edited, &splats);
    for (name, extra) in [
        ("run", vec![]),
        ("knn", vec!["--baseline", "knn"]),
        ("net", vec!["--baseline", "deformnet"]),
    ] {
        let output = at(name);
        let mut arguments = vec![
            "propagate",
            path(&model),
            "--edited",
            path(&edited),
            "--no-refine",
            "-o",
            path(&output),
        ];
        arguments.extend(extra);
        success(&mut c4d(arguments));
        let frozen = at(&format!("{name}-frozen"));
        success(&mut c4d(["freeze", path(&output), "--time", "0.5", "-o", path(&frozen)]));
        let now = ply::read_file(&frozen.join("point_cloud.ply")).unwrap().splats;
        let source = scene.at(0.5).unwrap();
        let off = (0..now.len()).filter(|&row| dynamic[row]).map(|row| {
            (0..3)
                .map(|k| f64::from(now.means[row][k] - source.means[row][k]).powi(2))
                .sum::<f64>()
                .sqrt()
        });
        let mean = off.sum::<f64>() / dynamic.iter().filter(|dynamic| **dynamic).count() as f64;
        assert!(mean < 0.02, "{name}: edited splats follow the figure, off by {mean}");
    }
    let sheet = at("sheet.png");
    success(&mut c4d([
        "render",
        path(&model),
        "-g",
        "cpu",
        "--size",
        "64x48",
        "--frames",
        "3",
        "-o",
        path(&sheet),
        "--format",
        "sheet",
    ]));
    assert!(sheet.is_file(), "rendered");
}

#[test]
fn missing_parts_are_reported_with_the_next_step() {
    let folder = tempfile::tempdir().unwrap();
    let (model, save) = copy(folder.path());
    let refused = |extra: &[&str], parts: &[&str]| {
        let mut arguments = vec!["info", path(&model)];
        arguments.extend(extra);
        let stderr = failure(&mut c4d(arguments), 3);
        for part in parts {
            assert!(stderr.contains(part), "expected `{part}` in: {stderr}");
        }
    };
    fs::rename(model.join("cfg_args"), folder.path().join("cfg_args")).unwrap();
    refused(&[], &["n_levels 16", "as in training", "--set FLAG=VALUE"]);
    let grid = ["--set", "n_levels=8", "--set", "base_resolution=8"];
    refused(&grid, &["activation=none", "--set FLAG=VALUE"]);
    let mut arguments = vec!["info", path(&model), "--set", "activation=relu"];
    arguments.extend(grid);
    let (shown, stderr) = success(&mut c4d(arguments));
    assert!(
        stderr.contains("cfg_args is missing") && shown.contains("hashmap_size = 13"),
        "{shown}{stderr}"
    );
    let usage = failure(&mut c4d(["info", path(&model), "--set", "no_dx=true"]), 2);
    assert!(usage.contains("Flags of Swift4D models"), "{usage}");
    fs::rename(folder.path().join("cfg_args"), model.join("cfg_args")).unwrap();
    fs::rename(save.join("FDHash.pth"), folder.path().join("FDHash.pth")).unwrap();
    refused(&[], &["FDHash.pth", "is missing", "Copy it"]);
    let late =
        failure(&mut c4d(["freeze", path(&fixture("swift4d/model")), "--time", "1", "-o", "x"]), 2);
    assert!(late.contains("0.9966"), "names the last frame: {late}");
}

#[test]
fn an_edit_of_the_canonical_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (model, save) = copy(folder.path());
    let (canonical, run) = (save.join("point_cloud.ply"), folder.path().join("run"));
    let mut propagate = c4d([
        "propagate",
        path(&model),
        "--edited",
        path(&canonical),
        "--no-refine",
        "-o",
        path(&run),
    ]);
    let stderr = failure(&mut propagate, 3);
    assert!(stderr.contains("canonical") && stderr.contains("c4d freeze"), "{stderr}");
}
