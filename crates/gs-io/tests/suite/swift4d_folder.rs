//! Swift4D model folders, complete and incomplete: flags with their origin,
//! and for missing, contradictory or hostile parts an error that names the
//! file and the next step, without large allocations.

use crate::common;
use gs_core::DynamicScene;
use gs_deform::IndexRule;
use gs_io::model_folder::Swift4dOverrides;
use gs_io::model_folder::{DynamicSplitCounts, Model, Origin, Overrides, Stage};
use gs_io::swift4d;
use gs_io::{SceneKind, detect, pth};
use std::fs;
use std::path::{Path, PathBuf};
use test_support::fixture;

type Named = (String, Vec<usize>, Vec<f32>);

const GAUSSIANS: usize = 6;
const CFG: &str = "Namespace(n_levels=2, n_features_per_level=2, hashmap_size=6, base_resolution=2, n_neurons=16, activation='None', dynamic_thro=7.0, white_background=True, configs='arguments/dynerf/x.py')";

/// A PLY as written by training: Gaussian `i` at `(i, 0, 0)/10` with score `i + 4.0`.
fn ply(score_column: &str, scores: [f32; GAUSSIANS]) -> Vec<u8> {
    let mut names: Vec<String> =
        ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"].map(str::to_owned).into();
    names.extend((0..45).map(|i| format!("f_rest_{i}")));
    names.extend(
        ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
            .map(str::to_owned),
    );
    names.push(score_column.to_owned());
    let properties: Vec<String> =
        names.iter().map(|name| format!("property float {name}\n")).collect();
    let properties = properties.concat();
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {GAUSSIANS}\n{properties}end_header\n"
    );
    let mut bytes = header.into_bytes();
    for (i, score) in scores.into_iter().enumerate() {
        for name in &names {
            let value = match name.as_str() {
                "x" => i as f32 / 10.0,
                "rot_0" => 1.0,
                name if name == score_column => score,
                _ => 0.0,
            };
            bytes.extend(value.to_le_bytes());
        }
    }
    bytes
}

const SCORES: [f32; GAUSSIANS] = [4.0, 5.0, 6.0, 7.0, 8.0, 9.0];

/// Width 16, two levels of 16 and 64 entries with two features.
fn tensors() -> Vec<Named> {
    let mut named = vec![
        ("xyz_bound_min".to_owned(), vec![3], vec![0.0, -1.0, -1.0]),
        ("xyz_bound_max".to_owned(), vec![3], vec![0.4, 1.0, 1.0]),
    ];
    let sizes = [
        ("enc_model", 2 * 16 * 16 + 80 * 2),
        ("xyz_deform", 768),
        ("scales_deform", 768),
        ("rotations_deform", 768),
        ("opacity_deform", 768),
        ("shs_deform", 2 * 256 + 48 * 16),
    ];
    for (name, size) in sizes {
        let values = (0..size).map(|i| (i as f32 * 0.7).sin() * 0.3).collect();
        named.push((format!("{name}.params"), vec![size], values));
    }
    named
}

struct Folder {
    _guard: tempfile::TempDir,
    path: PathBuf,
}

impl Folder {
    fn new() -> Self {
        let guard = tempfile::tempdir().unwrap();
        let path = guard.path().to_owned();
        let folder = Self { _guard: guard, path };
        fs::create_dir_all(folder.save()).unwrap();
        folder.cfg(CFG);
        fs::write(folder.save().join("point_cloud.ply"), ply("dynamic", SCORES)).unwrap();
        folder.edit(|_| {});
        folder
    }

    fn save(&self) -> PathBuf {
        self.path.join("point_cloud/iteration_13000")
    }

    fn field(&self) -> PathBuf {
        self.save().join("FDHash.pth")
    }

    fn cfg(&self, text: &str) {
        fs::write(self.path.join("cfg_args"), text).unwrap();
    }

    fn edit(&self, edit: impl FnOnce(&mut Vec<Named>)) {
        let mut named = tensors();
        edit(&mut named);
        fs::write(self.field(), common::state_dict(&named)).unwrap();
    }

    fn open(&self) -> Model {
        swift4d::open(&self.path, &Overrides::default()).unwrap()
    }

    fn open_with(&self, swift4d: Swift4dOverrides) -> Model {
        swift4d::open(&self.path, &Overrides { swift4d, ..Overrides::default() }).unwrap()
    }

    fn message(&self, swift4d: Swift4dOverrides) -> String {
        let overrides = Overrides { swift4d, ..Overrides::default() };
        swift4d::open(&self.path, &overrides).unwrap_err().to_string()
    }

    fn refused(&self, parts: &[&str]) {
        let message = self.message(Swift4dOverrides::default());
        for part in parts {
            assert!(message.contains(part), "expected `{part}` in: {message}");
        }
    }
}

fn tensor<'a>(named: &'a mut [Named], name: &str) -> &'a mut Named {
    named.iter_mut().find(|(found, ..)| found.starts_with(name)).unwrap()
}

fn resize(named: &mut [Named], name: &str, size: usize) {
    let (_, shape, values) = tensor(named, name);
    *shape = vec![size];
    values.resize(size, 0.1);
}

fn flag(model: &Model, name: &str) -> (String, Origin) {
    let flag = model.report.flags.iter().find(|flag| flag.name == name).unwrap();
    (flag.value.clone(), flag.origin)
}

#[test]
fn complete_folder_and_its_report() {
    let folder = Folder::new();
    assert_eq!(detect(&folder.path).unwrap(), SceneKind::Swift4d, "detected");
    assert_eq!(detect(&folder.save()).unwrap(), SceneKind::Swift4d, "its iteration, too");
    let model = folder.open();
    let report = &model.report;
    assert_eq!((report.iteration, report.stage), (13_000, Stage::Fine), "iteration");
    assert_eq!((report.width, report.channels, report.levels), (16, 2, 2), "shape");
    let split = DynamicSplitCounts { num_dynamic: 2, num_moving: 1 };
    assert_eq!(report.split, Some(split), "7 is static; x = 0.5 lies outside the box");
    assert_eq!(flag(&model, "activation"), ("none".to_owned(), Origin::CfgArgs), "activation");
    assert_eq!(flag(&model, "index_rule").1, Origin::Inferred, "both agree");
    assert_eq!(flag(&model, "frames"), ("300".to_owned(), Origin::Default), "frames");
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    let (now, stored) = (model.scene.at(0.5).unwrap(), model.scene.canonical());
    let moved: Vec<usize> = (0..GAUSSIANS).filter(|&i| now.means[i] != stored.means[i]).collect();
    assert_eq!(moved, [4], "only the dynamic one inside moves");
    assert_eq!(model.scene.num_frames(), Some(300), "through the model");
    assert_eq!(model.scene.dynamic_mask().map(<[bool]>::len), Some(GAUSSIANS), "and its mask");
}

#[test]
fn overrides_take_precedence_over_cfg_args() {
    let folder = Folder::new();
    let model = folder.open_with(Swift4dOverrides {
        trunk_relu: Some(true),
        dynamic_thro: Some(6.5),
        frames: Some(21),
        time_divisor: Some(20),
        index_rule: Some(IndexRule::Older),
        ..Swift4dOverrides::default()
    });
    for name in ["activation", "dynamic_thro", "frames", "time_divisor", "index_rule"] {
        assert_eq!(flag(&model, name).1, Origin::Override, "{name}");
    }
    assert_eq!(model.report.split.unwrap().num_dynamic, 3, "7 exceeds 6.5");
    assert_eq!(model.scene.time_range().end, 1.0, "21 frames of 1/20");
    let beyond = Swift4dOverrides { frames: Some(302), ..Swift4dOverrides::default() };
    assert!(folder.message(beyond).contains("time_divisor"), "too many frames");
}

#[test]
fn vru_windows_have_twenty_frames() {
    let folder = Folder::new();
    folder.cfg(&CFG.replace("dynerf/x", "vrugz/basketball"));
    let model = folder.open();
    assert_eq!(flag(&model, "frames"), ("20".to_owned(), Origin::FamilyGuess), "frames");
    assert_eq!(model.scene.time_range().end, 0.95, "the last of them");
}

#[test]
fn without_cfg_args_the_error_requests_flags() {
    let folder = Folder::new();
    fs::remove_file(folder.path.join("cfg_args")).unwrap();
    folder.refused(&["FDHash.pth", "n_levels 16", "as in training"]);
    let grid = Swift4dOverrides {
        n_levels: Some(2),
        n_features_per_level: Some(2),
        base_resolution: Some(2),
        ..Swift4dOverrides::default()
    };
    let error = folder.message(grid);
    assert!(error.contains("set activation=none for coffee_martini"), "{error}");
    let model = folder.open_with(Swift4dOverrides { trunk_relu: Some(false), ..grid });
    assert_eq!(flag(&model, "hashmap_size"), ("6".to_owned(), Origin::Inferred), "from the length");
    assert_eq!(flag(&model, "dynamic_thro"), ("7".to_owned(), Origin::Default), "threshold");
    assert!(model.report.warnings[0].contains("cfg_args is missing"), "a warning");
}

#[test]
fn published_table_is_recognised_by_its_length() {
    let folder = Folder::new();
    fs::remove_file(folder.path.join("cfg_args")).unwrap();
    let entries = gs_deform::GridShape { levels: 16, features: 4, log2_table: 10, base: 16 };
    folder.edit(|named| {
        resize(named, "enc_model", 16 * 64 + 256 + entries.num_entries() * 4);
    });
    let relu = Swift4dOverrides { trunk_relu: Some(true), ..Swift4dOverrides::default() };
    let model = folder.open_with(relu);
    assert_eq!(flag(&model, "hashmap_size"), ("10".to_owned(), Origin::Inferred), "table");
}

#[test]
fn ambiguous_grids_require_an_index_rule() {
    let folder = Folder::new();
    let shape = gs_deform::GridShape { levels: 13, features: 1, log2_table: 16, base: 16 };
    folder.cfg(
        &CFG.replace("n_levels=2", "n_levels=13")
            .replace("per_level=2", "per_level=1")
            .replace("hashmap_size=6", "hashmap_size=16")
            .replace("base_resolution=2", "base_resolution=16"),
    );
    folder.edit(|named| resize(named, "enc_model", 512 + shape.num_entries()));
    folder.refused(&["FDHash.pth", "[12]", "index_rule=older", "index_rule=current"]);
    let rule = |rule| Swift4dOverrides { index_rule: Some(rule), ..Swift4dOverrides::default() };
    for index_rule in [IndexRule::Current, IndexRule::Older] {
        assert_eq!(flag(&folder.open_with(rule(index_rule)), "index_rule").1, Origin::Override);
    }
}

#[test]
fn missing_parts_are_named() {
    let folder = Folder::new();
    fs::remove_file(folder.field()).unwrap();
    assert_eq!(detect(&folder.path).unwrap(), SceneKind::Swift4d, "by its scores");
    folder.refused(&["FDHash.pth", "is missing", "copy it"]);

    let folder = Folder::new();
    fs::write(folder.save().join("point_cloud.ply"), ply("label", SCORES)).unwrap();
    assert_eq!(detect(&folder.path).unwrap(), SceneKind::Swift4d, "by its field");
    folder.refused(&["point_cloud.ply", "no column `dynamic`", "training wrote"]);
    fs::write(folder.save().join("deformation.pth"), b"").unwrap();
    assert_eq!(detect(&folder.path).unwrap(), SceneKind::Model4dgs, "without scores, with both");

    let folder = Folder::new();
    folder.edit(|named| named.retain(|(name, ..)| !name.starts_with("opacity")));
    folder.refused(&["FDHash.pth", "no tensor `opacity_deform.params`"]);
    folder.edit(|named| named.retain(|(name, ..)| name.starts_with("xyz_bound")));
    folder.refused(&["is not the field of a Swift4D model", "xyz_bound_max"]);
    folder.edit(|named| named.retain(|(name, ..)| name != "xyz_bound_min"));
    folder.refused(&["no tensor `xyz_bound_min`"]);
}

#[test]
fn wrong_sizes_are_refused() {
    let folder = Folder::new();
    for (name, size, part) in [
        ("xyz_deform", 769, "matches no width"),
        ("xyz_deform", 0, "matches no width"),
        ("xyz_deform", 2560, "`scales_deform.params` has 768 values, expected 2560"),
        ("shs_deform", 768, "`shs_deform.params` has 768 values, expected 1280"),
        ("enc_model", 671, "has 671 values"),
        ("enc_model", 0, "has 0 values"),
        ("xyz_bound_max", 4, "`xyz_bound_max` has 4 values"),
    ] {
        folder.edit(|named| resize(named, name, size));
        folder.refused(&["FDHash.pth", part]);
    }
}

#[test]
fn absurd_flags_are_refused_without_allocating() {
    let folder = Folder::new();
    for (from, to, part) in [
        ("n_levels=2", "n_levels=4000000000", "n_levels"),
        ("n_levels=2", "n_levels=99999999999999999999", "n_levels"),
        ("n_levels=2", "n_levels=-1", "n_levels"),
        ("n_levels=2", "n_levels=27", "n_levels 27"),
        ("n_levels=2", "n_levels=0", "n_levels"),
        ("per_level=2", "per_level=3", "n_features_per_level"),
        ("hashmap_size=6", "hashmap_size=30", "hashmap_size 30"),
        ("hashmap_size=6", "hashmap_size=64", "hashmap_size"),
        ("base_resolution=2", "base_resolution=0", "base_resolution"),
        ("base_resolution=2", "base_resolution=4294967295", "base_resolution"),
        ("activation='None'", "activation='Sine'", "expected ReLU or None"),
        ("dynamic_thro=7.0", "dynamic_thro='x'", "dynamic_thro"),
        ("dynamic_thro=7.0", "dynamic_thro=nan", "dynamic_thro"),
    ] {
        folder.cfg(&CFG.replace(from, to));
        folder.refused(&["FDHash.pth", part]);
    }
    folder.cfg("Namespace(n_levels=");
    folder.refused(&["cfg_args", "remove the file"]);
    folder.cfg(&CFG.replace("n_neurons=16", "n_neurons=128"));
    assert!(
        folder.open().report.warnings[0].contains("n_neurons 128"),
        "cfg_args of a different run"
    );
}

#[test]
fn values_that_are_not_finite_are_refused() {
    let folder = Folder::new();
    for (name, value, part) in [
        ("enc_model", f32::NAN, "trunk"),
        ("shs_deform", f32::INFINITY, "Sh head"),
        ("rotations_deform", 7e4, "Quats head"),
        ("xyz_bound_min", f32::NAN, "box"),
        ("xyz_bound_min", 0.4, "box"),
        ("xyz_bound_min", f32::NEG_INFINITY, "box"),
    ] {
        folder.edit(|named| tensor(named, name).2[0] = value);
        folder.refused(&["FDHash.pth", part]);
    }
    folder.edit(|named| *tensor(named, "enc_model").2.last_mut().unwrap() = f32::NAN);
    folder.refused(&["hash table"]);
    folder.edit(|_| {});
    let scores = [4.0, 5.0, 6.0, f32::NAN, 8.0, f32::INFINITY];
    fs::write(folder.save().join("point_cloud.ply"), ply("dynamic", scores)).unwrap();
    let model = folder.open();
    assert_eq!(model.report.split.unwrap().num_dynamic, 2, "NaN scores are static");
    assert!(model.report.warnings[0].contains("1 of 6 dynamic scores are NaN"), "and counted");
}

#[test]
fn dropping_damaged_rows_keeps_scores_aligned() {
    let folder = Folder::new();
    let mut bytes = ply("dynamic", SCORES);
    let start = bytes.len() - GAUSSIANS * 63 * 4;
    bytes[start..start + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    fs::write(folder.save().join("point_cloud.ply"), bytes).unwrap();
    let model = folder.open();
    let expected = [false, false, false, true, true];
    assert_eq!(model.scene.dynamic_mask().unwrap(), expected, "row 0 is dropped");
    assert!(model.report.warnings[0].contains("1 of 6 Gaussians are damaged"), "counted");
}

#[test]
fn models_without_dynamic_splats_cause_a_warning() {
    let folder = Folder::new();
    folder.cfg(&CFG.replace("dynamic_thro=7.0", "dynamic_thro=70"));
    let model = folder.open();
    assert!(
        model.report.warnings[0].contains("this model is static"),
        "{:?}",
        model.report.warnings
    );
    assert_eq!(&model.scene.at(0.5).unwrap(), model.scene.canonical(), "and nothing moves");
}

#[test]
fn coarse_saves_have_lowest_priority_and_are_static() {
    let folder = Folder::new();
    let coarse = folder.path.join("point_cloud/coarse_iteration_30000");
    fs::create_dir(&coarse).unwrap();
    for name in ["FDHash.pth", "point_cloud.ply"] {
        fs::copy(folder.save().join(name), coarse.join(name)).unwrap();
    }
    assert_eq!(folder.open().report.iteration, 13_000, "fine, though the number is smaller");
    fs::remove_dir_all(folder.save()).unwrap();
    assert_eq!(detect(&folder.path).unwrap(), SceneKind::Swift4d, "still a Swift4D folder");
    let model = folder.open();
    assert_eq!(model.report.stage, Stage::Coarse, "coarse");
    assert_eq!(&model.scene.at(0.7).unwrap(), model.scene.canonical(), "never moves");
}

#[test]
fn damage_to_the_field_is_an_error_or_harmless() {
    let folder = Folder::new();
    let bytes = fs::read(folder.field()).unwrap();
    for cut in (0..bytes.len()).step_by(197) {
        fs::write(folder.field(), &bytes[..cut]).unwrap();
        folder.refused(&["FDHash.pth"]);
    }
    let mut opened = 0;
    for at in (0..bytes.len()).step_by(53) {
        let mut flipped = bytes.clone();
        flipped[at] ^= 0xff;
        fs::write(folder.field(), &flipped).unwrap();
        if let Ok(model) = swift4d::open(&folder.path, &Overrides::default()) {
            model.scene.at(0.5).unwrap();
            opened += 1;
        }
    }
    assert!(opened > 0, "flipped weights still open");
}

/// The golden's file, rewritten by the test's writer, shows that
/// the writer is equivalent to torch.save.
#[test]
fn rewritten_fields_read_back() {
    fn copy(from: &Path, to: &Path) {
        fs::create_dir_all(to).unwrap();
        for entry in fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            if entry.path().is_dir() {
                copy(&entry.path(), &to.join(entry.file_name()));
            } else {
                fs::write(to.join(entry.file_name()), fs::read(entry.path()).unwrap()).unwrap();
            }
        }
    }
    let dir = tempfile::tempdir().unwrap();
    copy(&fixture("swift4d/model"), dir.path());
    let before = swift4d::open(dir.path(), &Overrides::default()).unwrap().scene.at(0.37).unwrap();
    let field = dir.path().join("point_cloud/iteration_13000/FDHash.pth");
    let bytes = fs::read(&field).unwrap();
    let root = pth::read(&bytes).unwrap().into_state_dict().unwrap();
    let named: Vec<Named> =
        root.into_iter().map(|(name, t)| (name, t.shape().to_vec(), t.to_f32s())).collect();
    fs::write(&field, common::state_dict(&named)).unwrap();
    let after = swift4d::open(dir.path(), &Overrides::default()).unwrap().scene.at(0.37).unwrap();
    assert_eq!(after, before, "same tensors");
}
