//! Model folders of all revisions, complete and incomplete: choice of iteration and flags with
//! their origins, and errors that name the file and the next step.

use crate::common;
use gs_core::{DynamicScene, Splats};
use gs_io::checkpoint4dgs;
use gs_io::model_folder::{Model, ModelScene, Origin, Overrides, Stage};
use gs_io::repair::Damage;
use gs_io::{Existing, IoError, ply, pth};
use std::fs;
use std::path::{Path, PathBuf};
use test_support::fixture;

type Named = (String, Vec<usize>, Vec<f32>);

fn copy(case: &str) -> (tempfile::TempDir, PathBuf) {
    fn tree(from: &Path, to: &Path) {
        fs::create_dir_all(to).unwrap();
        for entry in fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            let target = to.join(entry.file_name());
            if entry.path().is_dir() {
                tree(&entry.path(), &target);
            } else {
                fs::write(target, fs::read(entry.path()).unwrap()).unwrap();
            }
        }
    }
    let dir = tempfile::tempdir().unwrap();
    tree(&fixture("deform4dgs").join(case).join("model"), dir.path());
    let path = dir.path().to_owned();
    (dir, path)
}

fn open(dir: &Path) -> Result<Model, IoError> {
    checkpoint4dgs::open(dir, &Overrides::default())
}

fn message(dir: &Path, overrides: &Overrides) -> String {
    checkpoint4dgs::open(dir, overrides).unwrap_err().to_string()
}

fn iteration(dir: &Path) -> PathBuf {
    dir.join("point_cloud/iteration_1")
}

fn tensors(dir: &Path) -> Vec<Named> {
    let bytes = fs::read(iteration(dir).join("deformation.pth")).unwrap();
    let root = pth::read(&bytes).unwrap().into_state_dict().unwrap();
    root.into_iter().map(|(name, t)| (name, t.shape().to_vec(), t.to_f32s())).collect()
}

/// Replaces the network by an edited copy of itself.
fn edit(dir: &Path, edit: impl FnOnce(&mut Vec<Named>)) {
    let mut named = tensors(dir);
    edit(&mut named);
    fs::write(iteration(dir).join("deformation.pth"), common::state_dict(&named)).unwrap();
}

fn edit_cfg(dir: &Path, from: &str, to: &str) {
    let path = dir.join("cfg_args");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from} in {text}");
    fs::write(path, text.replace(from, to)).unwrap();
}

fn origin(model: &Model, name: &str) -> (String, Origin) {
    let flag = model.report.flags.iter().find(|flag| flag.name == name).unwrap();
    (flag.value.clone(), flag.origin)
}

#[test]
fn newest_iteration_and_its_report() {
    let model = open(&fixture("deform4dgs/dnerf_like/model")).unwrap();
    let report = &model.report;
    assert_eq!((report.iteration, report.stage), (20_000, Stage::Fine), "numeric order");
    assert_eq!(
        (report.width, report.channels, report.levels, report.depth),
        (64, 32, 2, 1),
        "shape"
    );
    assert_eq!(report.heads, ["pos_deform", "scales_deform", "rotations_deform"], "heads");
    assert_eq!(report.untrained_heads, ["opacity_deform", "shs_deform"], "never trained");
    assert_eq!(origin(&model, "no_do"), ("true".to_owned(), Origin::CfgArgs), "from cfg_args");
    assert_eq!(report.white_background, Some(true), "background");
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    let old = Overrides { iteration: Some(7000), ..Overrides::default() };
    let old = checkpoint4dgs::open(&fixture("deform4dgs/dnerf_like/model"), &old).unwrap();
    assert_eq!(old.scene.num_splats(), 240, "the requested iteration");
    let dynerf = open(&fixture("deform4dgs/dynerf_like/model")).unwrap();
    assert_eq!((dynerf.report.mask, dynerf.report.depth), ("static_mlp", 2), "mask");
    assert!(dynerf.report.untrained_heads.is_empty(), "all trained");
}

#[test]
fn rewritten_networks_read_back() {
    // The tests below are valid only if the test's own writer is equivalent to torch.save.
    let (_guard, dir) = copy("variants/apply_rotation");
    let before = open(&dir).unwrap().scene.at(0.37).unwrap();
    edit(&dir, |_| {});
    assert_eq!(open(&dir).unwrap().scene.at(0.37).unwrap(), before, "same tensors");
}

#[test]
fn missing_network() {
    let (_guard, dir) = copy("variants/default_flags");
    fs::remove_file(iteration(&dir).join("deformation.pth")).unwrap();
    let error = message(&dir, &Overrides::default());
    assert!(error.contains("deformation.pth") && error.contains("copy it"), "{error}");
}

#[test]
fn optional_files_may_be_missing() {
    let (_guard, dir) = copy("variants/default_flags");
    let before = open(&dir).unwrap().scene.at(0.5).unwrap();
    fs::remove_file(iteration(&dir).join("deformation_table.pth")).unwrap();
    fs::remove_file(iteration(&dir).join("deformation_accum.pth")).unwrap();
    assert_eq!(open(&dir).unwrap().scene.at(0.5).unwrap(), before, "table and accumulator unused");
}

#[test]
fn without_cfg_args_flags_are_guessed_with_a_warning() {
    let (_guard, dir) = copy("dynerf_like");
    let before = open(&dir).unwrap().scene.at(0.5).unwrap();
    fs::remove_file(dir.join("cfg_args")).unwrap();
    let model = open(&dir).unwrap();
    assert_eq!(
        origin(&model, "no_do"),
        ("false".to_owned(), Origin::FamilyGuess),
        "W 128, C 16, L 2"
    );
    assert_eq!(origin(&model, "no_dx"), ("false".to_owned(), Origin::Default), "default");
    assert!(model.report.warnings.iter().any(|w| w.contains("cfg_args is missing")), "warned");
    assert!(model.report.warnings.iter().any(|w| w.contains("dynerf")), "names the family");
    assert_eq!(model.scene.at(0.5).unwrap(), before, "the guess is right");
    let (_guard, dir) = copy("dnerf_like");
    fs::remove_file(dir.join("cfg_args")).unwrap();
    let model = open(&dir).unwrap();
    assert_eq!(origin(&model, "no_dshs"), ("true".to_owned(), Origin::FamilyGuess), "C 32");
}

#[test]
fn overrides_take_precedence_over_cfg_args() {
    let (_guard, dir) = copy("variants/default_flags");
    let overrides =
        Overrides { no_dx: Some(true), apply_rotation: Some(true), ..Overrides::default() };
    let model = checkpoint4dgs::open(&dir, &overrides).unwrap();
    assert_eq!(origin(&model, "no_dx"), ("true".to_owned(), Origin::Override), "no_dx");
    assert_eq!(origin(&model, "apply_rotation").1, Origin::Override, "apply_rotation");
    assert_eq!(model.scene.at(0.5).unwrap().means, model.scene.canonical().means, "nothing moves");
}

#[test]
fn malformed_cfg_args_is_an_error_not_a_guess() {
    let (_guard, dir) = copy("variants/default_flags");
    fs::write(dir.join("cfg_args"), "Namespace(no_dx=").unwrap();
    let error = message(&dir, &Overrides::default());
    assert!(error.contains("cfg_args") && error.contains("remove the file"), "{error}");
}

#[test]
fn contradictions_cause_warnings() {
    let (_guard, dir) = copy("variants/default_flags");
    edit_cfg(&dir, "net_width=16", "net_width=64");
    let model = open(&dir).unwrap();
    assert!(
        model.report.warnings.iter().any(|w| w.contains("net_width 64")),
        "{:?}",
        model.report.warnings
    );
}

#[test]
fn networks_the_reference_cannot_evaluate_are_refused() {
    let (_guard, dir) = copy("variants/grid_pe");
    edit_cfg(&dir, "grid_pe=3", "grid_pe=1");
    let error = message(&dir, &Overrides::default());
    assert!(error.contains("grid_pe = 1") && error.contains("deformation.pth"), "{error}");
    fs::remove_file(dir.join("cfg_args")).unwrap();
    let error = message(&dir, &Overrides::default());
    assert!(error.contains("set grid_pe"), "not inferable: {error}");
    let given = Overrides { grid_pe: Some(3), ..Overrides::default() };
    let model = checkpoint4dgs::open(&dir, &given).unwrap();
    assert_eq!(origin(&model, "grid_pe"), ("3".to_owned(), Origin::Override), "given");

    let (_guard, dir) = copy("variants/default_flags");
    edit_cfg(&dir, "no_grid=False", "no_grid=True");
    assert!(message(&dir, &Overrides::default()).contains("no_grid"), "by cfg_args");
    edit_cfg(&dir, "no_grid=True", "no_grid=False");
    edit(&dir, |named| {
        let first =
            named.iter_mut().find(|(name, ..)| name.ends_with("feature_out.0.weight")).unwrap();
        first.1 = vec![16, 4];
        first.2.truncate(64);
    });
    assert!(message(&dir, &Overrides::default()).contains("no_grid"), "by shape");
}

#[test]
fn revisions_of_2023_keep_opacity_and_sh() {
    let (_guard, dir) = copy("variants/no_dr_with_do_dshs");
    edit(&dir, |named| named.retain(|(name, ..)| !name.contains("shs_deform")));
    let model = open(&dir).unwrap();
    assert_eq!(
        origin(&model, "no_do"),
        ("true".to_owned(), Origin::Inferred),
        "regardless of cfg_args"
    );
    let splats = model.scene.at(0.5).unwrap();
    assert_eq!(splats.opacity_logits, model.scene.canonical().opacity_logits, "stored opacity");
    assert_eq!(splats.sh, model.scene.canonical().sh, "stored SH");
    assert_ne!(splats.means, model.scene.canonical().means, "still moves");
    assert!(
        model.report.warnings.iter().any(|w| w.contains("2023")),
        "{:?}",
        model.report.warnings
    );
    let forced = Overrides { no_dshs: Some(false), ..Overrides::default() };
    assert!(message(&dir, &forced).contains("no SH head"), "cannot be forced");
}

#[test]
fn revisions_of_2023_use_their_table() {
    let (_guard, dir) = copy("variants/no_dr_with_do_dshs");
    let path = iteration(&dir).join("deformation_table.pth");
    let mut table = fs::read(&path).unwrap();
    let storage = table.windows(48).position(|window| window == [1; 48]).unwrap();
    table[storage + 7] = 0;
    fs::write(&path, table).unwrap();
    let unmoved = |model: &Model| {
        let (now, stored) = (model.scene.at(0.5).unwrap(), model.scene.canonical());
        (0..48).filter(|&row| now.means[row] == stored.means[row]).collect::<Vec<_>>()
    };
    assert!(unmoved(&open(&dir).unwrap()).is_empty(), "later revisions ignore the table");
    edit(&dir, |named| named.retain(|(name, ..)| !name.contains("shs_deform")));
    let model = open(&dir).unwrap();
    assert_eq!(unmoved(&model), [7], "row 7 stays");
    assert!(model.report.warnings.iter().any(|w| w.contains("1 Gaussians as static")), "a warning");
    fs::write(&path, fs::read(iteration(&dir).join("deformation.pth")).unwrap()).unwrap();
    let error = message(&dir, &Overrides::default());
    assert!(error.contains("deformation_table.pth") && error.contains("single tensor"), "{error}");
}

#[test]
fn networks_of_other_methods_are_refused() {
    let (_guard, dir) = copy("variants/default_flags");
    edit(&dir, |named| named.retain(|(name, ..)| !name.contains("grid")));
    let error = message(&dir, &Overrides::default());
    assert!(error.contains("is not the deformation network of 4DGaussians"), "{error}");
    let (_guard, dir) = copy("variants/default_flags");
    edit(&dir, |named| named.retain(|(name, ..)| !name.contains("grids.1.3")));
    assert!(message(&dir, &Overrides::default()).contains("grids.1.3"), "names the tensor");
    let (_guard, dir) = copy("variants/default_flags");
    edit(&dir, |named| {
        let bias = named.iter_mut().find(|(name, ..)| name.ends_with("pos_deform.3.bias")).unwrap();
        bias.2[1] = f32::NAN;
    });
    let error = message(&dir, &Overrides::default());
    assert!(error.contains("pos_deform.3") && error.contains("NaN"), "{error}");
    fs::write(iteration(&dir).join("deformation.pth"), b"PK").unwrap();
    assert!(message(&dir, &Overrides::default()).contains("zip"), "truncated");
}

#[test]
fn sh_deformation_needs_degree_three() {
    let (_guard, dir) = copy("variants/no_dr_with_do_dshs");
    let path = iteration(&dir).join("point_cloud.ply");
    let splats = ply::read_file(&path).unwrap().splats.with_sh_degree(1);
    ply::write_file(&path, &splats, &ply::WriteOptions::default(), Existing::Replace).unwrap();
    let error = message(&dir, &Overrides::default());
    assert!(error.contains("point_cloud.ply") && error.contains("no_dshs"), "{error}");
    let off = Overrides { no_dshs: Some(true), ..Overrides::default() };
    let model = checkpoint4dgs::open(&dir, &off).unwrap();
    assert_eq!(model.scene.at(1.0).unwrap().sh_degree, 1, "works without");
}

#[test]
fn coarse_saves_are_static() {
    let (_guard, dir) = copy("variants/default_flags");
    fs::rename(iteration(&dir), dir.join("point_cloud/coarse_iteration_1")).unwrap();
    fs::remove_file(dir.join("point_cloud/coarse_iteration_1/deformation.pth")).unwrap();
    let model = open(&dir).unwrap();
    assert!(matches!(model.scene, ModelScene::Static(_)), "no network needed");
    assert_eq!(model.report.stage, Stage::Coarse, "reported");
    assert_eq!(&model.scene.at(0.7).unwrap(), model.scene.canonical(), "never moves");
}

#[test]
fn damaged_rows_are_dropped_and_counted() {
    let (_guard, dir) = copy("variants/default_flags");
    let path = iteration(&dir).join("point_cloud.ply");
    let mut splats: Splats = ply::read_file(&path).unwrap().splats;
    splats.means[3][0] = f32::NAN;
    splats.quats[5] = [0.0; 4];
    ply::write_file(&path, &splats, &ply::WriteOptions::default(), Existing::Replace).unwrap();
    let model = open(&dir).unwrap();
    assert_eq!(model.scene.num_splats(), 46, "two of 48");
    assert_eq!(
        (model.report.repair.not_finite, model.report.repair.zero_quaternion),
        (1, 1),
        "kinds"
    );
    assert_eq!(model.report.kept_rows.as_ref().map(Vec::len), Some(46), "which");
    assert!(model.report.warnings.iter().any(|w| w.contains("dropped")), "warned");
    let strict = Overrides { damage: Damage::Fail, ..Overrides::default() };
    assert!(message(&dir, &strict).contains("first at row 3"), "strict");
}

/// `numpy.float64(0.5)` as protocol 2 writes it.
const NUMPY_SCALAR: &[u8] = b"cnumpy.core.multiarray\nscalar\n(cnumpy\ndtype\n(X\x02\0\0\0f8K\0K\x01tR(K\x03X\x01\0\0\0<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tbc_codecs\nencode\n(X\x02\0\0\0ab\x8a\x09123456789tRtR";

#[test]
fn networks_are_found_in_any_wrapper() {
    let (_guard, dir) = copy("variants/default_flags");
    let expected = open(&dir).unwrap().scene.at(0.4).unwrap();
    let plain = tensors(&dir);
    let key = |name: &str| {
        let mut key = Vec::new();
        common::text(&mut key, name);
        key
    };
    let put = |bytes: Vec<u8>| fs::write(iteration(&dir).join("deformation.pth"), bytes).unwrap();
    let same = |how: &str| {
        let model = open(&dir).unwrap_or_else(|error| panic!("{how}: {error}"));
        assert_eq!(model.scene.at(0.4).unwrap(), expected, "{how}");
    };
    for prefix in ["module.", "_orig_mod.", "module._orig_mod.", "net."] {
        let rename = |(name, shape, values): &Named| {
            (format!("{prefix}{name}"), shape.clone(), values.clone())
        };
        put(common::state_dict(&plain.iter().map(rename).collect::<Vec<_>>()));
        same(prefix);
    }
    let inner = |(name, shape, values): &Named| {
        (
            name.replace("deformation_net.", "deformation_net._orig_mod."),
            shape.clone(),
            values.clone(),
        )
    };
    put(common::state_dict(&plain.iter().map(inner).collect::<Vec<_>>()));
    same("a compiled part");
    for wrapper in ["state_dict", "model_state_dict", "model", "params", "deform"] {
        // {wrapper: {…}, 'loss': numpy.float64, 'epoch': 7, 'best': None}
        let before = [b"}(".to_vec(), key(wrapper)].concat();
        let behind = [
            key("loss"),
            NUMPY_SCALAR.to_vec(),
            key("epoch"),
            b"K\x07".to_vec(),
            key("best"),
            b"Nu".to_vec(),
        ]
        .concat();
        put(common::wrapped_state_dict(&before, &plain, &behind));
        same(wrapper);
    }
    // {'loss': numpy.float64, 'model': {'state_dict': {…}}}
    let before = [
        b"}(".to_vec(),
        key("loss"),
        NUMPY_SCALAR.to_vec(),
        key("model"),
        b"}".to_vec(),
        key("state_dict"),
    ]
    .concat();
    put(common::wrapped_state_dict(&before, &plain, b"su"));
    same("nested");
    // ({…}, 30000), the layout of training checkpoints.
    put(common::wrapped_state_dict(b"(", &plain, b"Mu0t"));
    same("a tuple");
    // A saved module: an object of an unknown class, with the weights in its state.
    let before = [
        b"c__main__\nNet\n)\x81}(".to_vec(),
        key("training"),
        b"\x88".to_vec(),
        key("_parameters"),
    ]
    .concat();
    put(common::wrapped_state_dict(&before, &plain, b"ub"));
    same("a module");
}

#[test]
fn cfg_args_of_forks_and_windows_are_parsed() {
    let (_guard, dir) = copy("variants/default_flags");
    let path = dir.join("cfg_args");
    let text = fs::read_to_string(&path).unwrap();
    let expected = open(&dir).unwrap();
    let same = |bytes: &[u8], how: &str| {
        fs::remove_file(&path).unwrap();
        fs::write(&path, bytes).unwrap();
        let model = open(&dir).unwrap_or_else(|error| panic!("{how}: {error}"));
        assert_eq!(model.report.flags, expected.report.flags, "{how}");
        assert_eq!(model.scene.at(0.7).unwrap(), expected.scene.at(0.7).unwrap(), "{how}");
        model.report
    };
    let units: Vec<u16> = text.encode_utf16().collect();
    let little: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
    same(&[b"\xef\xbb\xbf", text.as_bytes()].concat(), "BOM");
    same(&[&b"\xff\xfe"[..], &little].concat(), "UTF-16");
    same(format!("\r\n{text}\r\n").as_bytes(), "white space");
    for field in ["dtype=torch.float32", "tags={'a', 'b'}", "raw=b'ab'", "mode=<Mode.FAST: 2>"] {
        let more = format!("{}, {field})", text.trim_end().strip_suffix(')').unwrap());
        let report = same(more.as_bytes(), field);
        let name = field.split('=').next().unwrap();
        let named =
            report.notes.iter().any(|note| note.contains("not needed") && note.contains(name));
        assert!(named, "{field}: {:?}", report.notes);
    }
    // An unreadable field that affects the motion causes a warning.
    fs::write(&path, text.replacen("no_dx=False", "no_dx=<Flag.OFF: 0>", 1)).unwrap();
    let report = open(&dir).unwrap().report;
    assert!(report.warnings.iter().any(|w| w.contains("no_dx")), "{:?}", report.warnings);
}
