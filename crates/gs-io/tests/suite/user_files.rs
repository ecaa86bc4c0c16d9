//! Files from users: columns of other trainers, meaningful infinities, folders with several series,
//! plain 3DGS models, and placeholders of files. The cases are from public bug reports; the
//! expected values are computed here from their definitions.

use gs_core::activation::sigmoid;
use gs_core::{DynamicScene, Splats};
use gs_io::checkpoint4dgs;
use gs_io::model_folder::Overrides;
use gs_io::ply_sequence::{PlySequence, SequenceOptions};
use gs_io::repair::{Damage, OPAQUE_LOGIT, TRANSPARENT_LOGIT};
use gs_io::{OpenOptions, SceneKind, cameras, detect, frame, open_scene};
use std::fs;
use std::path::Path;
use test_support::fixture;

const ROWS: usize = 60;

/// Columns of a vertex table, with the type of each.
#[derive(Clone)]
struct Table(Vec<(String, &'static str, Vec<f64>)>);

impl Table {
    /// A small scene: positions, DC, SH up to `degree`, opacity, scales, unit quaternions; seeded.
    fn scene(degree: usize, t: f64) -> Self {
        let mut state = 7_u64;
        let mut random = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1_u64 << 24) as f64 * 2.0 - 1.0
        };
        let mut table = Self(Vec::new());
        let mut put = |name: String, values: Vec<f64>| table.0.push((name, "float", values));
        let mut column = |shift: f64, width: f64| {
            (0..ROWS).map(|_| shift + width * random()).collect::<Vec<f64>>()
        };
        put("x".to_owned(), column(0.2 * t, 1.0));
        put("y".to_owned(), column(0.0, 1.0));
        put("z".to_owned(), column(0.0, 1.0));
        for k in 0..3 {
            put(format!("f_dc_{k}"), column(0.0, 1.0));
        }
        for k in 0..3 * ((degree + 1).pow(2) - 1) {
            put(format!("f_rest_{k}"), column(0.0, 0.1));
        }
        put("opacity".to_owned(), column(2.0, 1.0));
        for k in 0..3 {
            put(format!("scale_{k}"), column(-2.5, 0.5));
        }
        let raw = [0, 1, 2, 3].map(|_| column(0.0, 1.0));
        let length: Vec<f64> =
            (0..ROWS).map(|i| raw.iter().map(|q| q[i] * q[i]).sum::<f64>().sqrt()).collect();
        for (k, values) in raw.into_iter().enumerate() {
            let unit = values.iter().zip(&length).map(|(q, length)| q / length).collect();
            put(format!("rot_{k}"), unit);
        }
        table
    }

    fn get(&self, name: &str) -> &[f64] {
        &self.0.iter().find(|(column, ..)| column == name).unwrap().2
    }

    fn edit(&mut self, name: &str, edit: impl FnOnce(&mut [f64])) {
        edit(&mut self.0.iter_mut().find(|(column, ..)| column == name).unwrap().2);
    }

    fn without(mut self, names: &[&str]) -> Self {
        self.0.retain(|(column, ..)| !names.contains(&column.as_str()));
        self
    }

    fn with(mut self, name: &str, kind: &'static str, values: Vec<f64>) -> Self {
        self.0.push((name.to_owned(), kind, values));
        self
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "values fit their types"
    )]
    fn bytes(&self) -> Vec<u8> {
        let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {ROWS}\n");
        for (name, kind, _) in &self.0 {
            header.extend(["property ", kind, " ", name, "\n"]);
        }
        let mut bytes = (header + "end_header\n").into_bytes();
        for row in 0..ROWS {
            for (_, kind, values) in &self.0 {
                match *kind {
                    "uchar" => bytes.push(values[row] as u8),
                    "ushort" => bytes.extend((values[row] as u16).to_le_bytes()),
                    _ => bytes.extend((values[row] as f32).to_le_bytes()),
                }
            }
        }
        bytes
    }

    fn write(&self, path: &Path) {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, self.bytes()).unwrap();
    }

    /// Reads the table as an edited frame, as a frame of a sequence and as the canonical cloud of a
    /// model; all must agree. Also returns the notes of each.
    fn read_everywhere(&self) -> (Splats, [Vec<String>; 3]) {
        let dir = tempfile::tempdir().unwrap();
        let still = frame::read(&self.bytes()).unwrap();
        let (still, _) = still.sanitize(Damage::Fail).unwrap();
        for i in 0..2 {
            self.write(&dir.path().join(format!("sequence/f{i}.ply")));
        }
        let options = SequenceOptions { damage: Damage::Drop, ..SequenceOptions::default() };
        let sequence = PlySequence::open(&dir.path().join("sequence"), &options).unwrap();
        assert_eq!(sequence.at(1.0).unwrap(), still.splats, "a frame of a sequence");
        self.write(&dir.path().join("model/point_cloud/coarse_iteration_7/point_cloud.ply"));
        let model = checkpoint4dgs::open(&dir.path().join("model"), &Overrides::default()).unwrap();
        assert_eq!(model.scene.canonical(), &still.splats, "the canonical cloud of a model");
        (still.splats, [still.notes, sequence.notes().unwrap(), model.report.notes])
    }
}

fn close(found: f32, expected: f64, what: &str) {
    let off = (f64::from(found) - expected).abs();
    assert!(off <= 2e-6 * expected.abs().max(1.0), "{what}: {found}, expected {expected}");
}

fn all_contain(notes: &[Vec<String>; 3], part: &str) {
    for (place, notes) in ["frame", "sequence", "model"].iter().zip(notes) {
        assert!(notes.iter().any(|note| note.contains(part)), "{place}: {notes:?}");
    }
}

#[test]
fn opaque_and_transparent_rows_are_kept() {
    let mut table = Table::scene(3, 0.0);
    table.edit("opacity", |opacity| {
        opacity[..40].fill(f64::INFINITY);
        opacity[40..45].fill(f64::NEG_INFINITY);
    });
    table.edit("scale_1", |scale| scale[50] = f64::NEG_INFINITY);
    let (splats, _) = table.read_everywhere();
    assert_eq!(splats.len(), ROWS, "all rows");
    assert!((0..ROWS).all(|row| splats.is_finite(row)), "finite");
    assert!(
        splats.opacity_logits[..40].iter().all(|logit| logit.to_bits() == OPAQUE_LOGIT.to_bits()),
        "opaque"
    );
    assert!((40..45).all(|row| splats.opacity(row) < 1.0 / 255.0), "invisible");
    for row in 45..ROWS {
        close(splats.opacity_logits[row], table.get("opacity")[row], "others stay");
    }
    assert!(splats.scale(50)[1] < 1e-8 && splats.scale(50)[0] > 0.01, "flat along one axis");
    let dir = tempfile::tempdir().unwrap();
    table.write(&dir.path().join("a.ply"));
    let opened = open_scene(&dir.path().join("a.ply"), &OpenOptions::default()).unwrap();
    assert_eq!(opened.scene.num_splats(), ROWS, "as a scene");
    let notes = [opened.warnings, opened.notes].concat().join("; ");
    assert!(notes.contains("40 opacities of exactly 1") && !notes.contains("damaged"), "{notes}");
}

#[test]
fn damage_in_one_frame_affects_only_that_frame() {
    let dir = tempfile::tempdir().unwrap();
    for i in 0..3_u8 {
        let mut table = Table::scene(0, f64::from(i));
        if i == 1 {
            table.edit("opacity", |opacity| {
                opacity[..30].fill(f64::INFINITY);
                opacity[30] = f64::NEG_INFINITY;
            });
            table.edit("x", |x| x[31] = f64::NAN);
            table.edit("scale_0", |scale| scale[32] = f64::INFINITY);
            for k in 0..4 {
                table.edit(&format!("rot_{k}"), |rot| rot[33] = 0.0);
            }
        }
        // Damaged in all frames: this row is dropped.
        table.edit("f_dc_1", |dc| dc[34] = f64::NEG_INFINITY);
        table.write(&dir.path().join(format!("frame_{i}.ply")));
    }
    let options = SequenceOptions { damage: Damage::Drop, ..SequenceOptions::default() };
    let sequence = PlySequence::open(dir.path(), &options).unwrap();
    assert_eq!(sequence.num_splats(), ROWS - 1, "only rows damaged in all frames are dropped");
    let repair = sequence.repair();
    assert_eq!((repair.damaged(), repair.hidden), (4, 3), "{repair:?}");
    assert_eq!((repair.infinities.opaque, repair.infinities.transparent), (30, 1), "counted");
    let [before, at, after] = [0.0, 0.5, 1.0].map(|t| sequence.at(t).unwrap());
    assert!((0..30).all(|row| at.opacity(row) > 0.99), "opaque in its frame");
    for row in 30..34 {
        assert_eq!(at.opacity_logits[row], TRANSPARENT_LOGIT, "row {row} is invisible here");
        for other in [&before, &after] {
            assert!(other.opacity(row) > 0.5, "row {row} is visible in the other frames");
        }
    }
    // Rows that fade in have their last valid position, not the origin.
    for row in 31..34 {
        assert_eq!(at.means[row], before.means[row], "row {row} keeps its position");
        assert_eq!(at.quats[row], before.quats[row], "row {row} keeps its rotation");
    }
    for t in [0.2, 0.4, 0.6, 0.9] {
        let splats = sequence.at(t).unwrap();
        assert!((0..splats.len()).all(|row| splats.is_finite(row)), "finite at {t}");
    }
    let strict = PlySequence::open(dir.path(), &SequenceOptions::default()).unwrap();
    assert!(strict.at(0.5).is_err(), "NaN is refused with this option");
}

#[test]
fn mip_splatting_filters_are_applied() {
    let table = Table::scene(3, 0.0).with("filter_3D", "float", vec![0.2; ROWS]);
    let (splats, notes) = table.read_everywhere();
    for row in 0..ROWS {
        let mut ratio = 1.0;
        for axis in 0..3 {
            let s = table.get(&format!("scale_{axis}"))[row].exp();
            let smoothed = s.hypot(f64::from(0.2_f32));
            close(splats.log_scales[row][axis], smoothed.ln(), "size");
            ratio *= s / smoothed;
        }
        let opacity = sigmoid(table.get("opacity")[row]) * ratio;
        close(splats.opacity(row), opacity, "opacity");
    }
    all_contain(&notes, "filter_3D");
    all_contain(&notes, "antialiasing");
}

#[test]
fn colour_columns_replace_missing_sh() {
    let levels = |shift: usize| (0..ROWS).map(|i| ((37 * i + shift) % 256) as f64).collect();
    let rgb: [Vec<f64>; 3] = [levels(0), levels(90), levels(200)];
    for (kind, unit) in [("uchar", 1.0), ("ushort", 257.0), ("float", 1.0 / 255.0), ("float", 1.0)]
    {
        let mut table = Table::scene(0, 0.0).without(&["f_dc_0", "f_dc_1", "f_dc_2"]);
        for (name, values) in ["red", "green", "blue"].iter().zip(&rgb) {
            table = table.with(name, kind, values.iter().map(|value| value * unit).collect());
        }
        let (splats, notes) = table.read_everywhere();
        for row in 0..ROWS {
            for (channel, values) in rgb.iter().enumerate() {
                let expected = (values[row] / 255.0 - 0.5) / 0.282_094_791_773_878_14;
                close(splats.sh_of(row)[0][channel], expected, kind);
            }
        }
        all_contain(&notes, "red, green and blue");
    }
    let mut both = Table::scene(3, 0.0);
    for (name, values) in ["red", "green", "blue"].iter().zip(rgb) {
        both = both.with(name, "uchar", values);
    }
    let (splats, notes) = both.read_everywhere();
    close(splats.sh_of(9)[0][1], both.get("f_dc_1")[9], "SH take precedence over colours");
    assert!(notes[0].iter().any(|note| note.contains("not used: red")), "{notes:?}");
}

#[test]
fn surfels_are_thin_discs() {
    let table = Table::scene(3, 0.0).without(&["scale_2"]);
    let (splats, notes) = table.read_everywhere();
    for row in 0..ROWS {
        close(splats.log_scales[row][1], table.get("scale_1")[row], "the other axes are unchanged");
        close(splats.log_scales[row][2], 1e-6_f64.ln(), "thickness");
    }
    all_contain(&notes, "scale_2");
}

#[test]
fn sh_of_degree_4_is_truncated_per_channel() {
    let table = Table::scene(4, 0.0);
    let (splats, notes) = table.read_everywhere();
    assert_eq!(splats.sh_degree, 3, "degree");
    for row in [0, 17, ROWS - 1] {
        for channel in 0..3 {
            for k in 0..15 {
                let name = format!("f_rest_{}", 24 * channel + k);
                close(splats.sh_of(row)[1 + k][channel], table.get(&name)[row], &name);
            }
        }
    }
    all_contain(&notes, "SH degree 4 was cut to 3");
}

#[test]
fn headers_with_any_line_ends() {
    let table = Table::scene(1, 0.0);
    let bytes = table.bytes();
    let data = bytes.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8(bytes[..data].to_vec()).unwrap();
    let expected = frame::read(&bytes).unwrap().splats;
    for end in ["\r\n", "\r"] {
        let other = [header.replace('\n', end).as_bytes(), &bytes[data..]].concat();
        assert_eq!(frame::read(&other).unwrap().splats, expected, "{end:?}");
    }
}

#[test]
fn several_series_in_one_folder() {
    let dir = tempfile::tempdir().unwrap();
    for (name, t) in [("a-0", 0.0), ("a-1", 1.0), ("b-0", 2.0)] {
        Table::scene(0, t).write(&dir.path().join(format!("{name}.ply")));
    }
    let opened = open_scene(dir.path(), &OpenOptions::default()).unwrap();
    assert_eq!(opened.scene.num_frames(), Some(2), "the longer one");
    let notes = [opened.warnings, opened.notes].concat().join("; ");
    assert!(notes.contains("using a-*.ply (2 frames), ignoring b-*.ply (1)"), "{notes}");
}

#[test]
fn plain_3dgs_models_are_one_frame() {
    let dir = tempfile::tempdir().unwrap();
    let save = |name: &str, t: f64| {
        Table::scene(3, t)
            .write(&dir.path().join("point_cloud").join(name).join("point_cloud.ply"));
    };
    save("iteration_7000", 0.0);
    save("iteration_30000", 5.0);
    save("iteration_best", 9.0);
    fs::write(
        dir.path().join("cfg_args"),
        "Namespace(sh_degree=3, source_path='x', model_path='y', images='images', resolution=-1, white_background=False, data_device='cuda', eval=False)",
    )
    .unwrap();
    let kind = detect(dir.path()).unwrap();
    assert_eq!(kind, SceneKind::Model3dgs, "plain");
    assert!(kind.to_string().contains("static, no deformation") && kind.is_frame(), "{kind}");
    let read = frame::read_file(dir.path()).unwrap();
    close(read.splats.means[0][0], Table::scene(3, 5.0).get("x")[0], "the newest save");
    assert!(frame::file_of(dir.path()).ends_with("iteration_30000/point_cloud.ply"), "named");
    let opened = open_scene(dir.path(), &OpenOptions::default()).unwrap();
    assert_eq!(opened.scene.at(0.0).unwrap(), opened.scene.at(1.0).unwrap(), "it is static");
    for older in ["iteration_7000", "iteration_30000"] {
        fs::remove_dir_all(dir.path().join("point_cloud").join(older)).unwrap();
    }
    assert_eq!(detect(dir.path()).unwrap(), SceneKind::Model3dgs, "iteration_best alone");
    let read = frame::read_file(dir.path()).unwrap();
    close(read.splats.means[0][0], Table::scene(3, 9.0).get("x")[0], "iteration_best");
    // A dynamic model whose network is missing is not a plain model.
    fs::write(dir.path().join("cfg_args"), "Namespace(sh_degree=3, net_width=64)").unwrap();
    assert_eq!(detect(dir.path()).unwrap(), SceneKind::Model4dgs, "detected by its settings");
    let error = frame::read_file(dir.path()).unwrap_err().to_string();
    assert!(error.contains("canonical") && error.contains("c4d freeze"), "{error}");
}

#[test]
fn unsupported_formats_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let counts = [1_u32, 1, 40, 40].iter().flat_map(|count| count.to_le_bytes());
    let ksplat: Vec<u8> = [0_u8, 1, 0, 0].into_iter().chain(counts).chain([0; 4076]).collect();
    fs::write(dir.path().join("x.ksplat"), &ksplat).unwrap();
    assert!(detect(&dir.path().join("x.ksplat")).unwrap().to_string().contains(".ksplat"), "named");
    let error = frame::read(&ksplat).unwrap_err().to_string();
    assert!(error.contains(".ksplat"), "{error}");
    // SOG of version 1: no version, no codebooks; as a folder without its planes.
    let meta = r#"{"means": {"shape": [40, 3], "dtype": "float32", "mins": [-1, -1, -1], "maxs": [1, 1, 1], "files": ["means_l.webp", "means_u.webp"]},
        "scales": {"shape": [40, 3], "dtype": "float32", "mins": [-3, -3, -3], "maxs": [-2, -2, -2], "files": ["scales.webp"]},
        "quats": {"shape": [40, 4], "dtype": "uint8", "encoding": "quaternion_packed", "files": ["quats.webp"]},
        "sh0": {"shape": [40, 1, 4], "dtype": "float32", "mins": [-2, -2, -2, -2], "maxs": [2, 2, 2, 2], "files": ["sh0.webp"]}}"#;
    fs::create_dir(dir.path().join("sog1")).unwrap();
    fs::write(dir.path().join("sog1/meta.json"), meta).unwrap();
    assert!(detect(&dir.path().join("sog1")).unwrap().is_frame(), "a SOG");
    let error = frame::read_file(&dir.path().join("sog1")).unwrap_err().to_string();
    assert!(error.contains("SOG version 1") && error.contains("expected 2"), "{error}");
}

/// Placeholders of files.
const STAND_INS: [(&str, &[u8]); 5] = [
    (
        "Git LFS pointer",
        b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393\nsize 12345\n",
    ),
    ("HTML page", b"\xef\xbb\xbf\n<!DOCTYPE html>\n<html><head><title>Sign in</title></head></html>\n"),
    ("error message from a web server", b"404: Not Found"),
    ("error message from a web server", b"<?xml \
     version=\"1.0\"?>\n<Error><Code>NoSuchKey</Code></Error>"),
    ("error message from a web server", b"{\"error\":\"Repository not found\"}"),
];

#[test]
fn stand_ins_are_named_by_every_reader() {
    for (name, bytes) in STAND_INS {
        let dir = tempfile::tempdir().unwrap();
        let put = |path: &str| {
            let path = dir.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, bytes).unwrap();
            path
        };
        let named = |what: &str, error: String| {
            assert!(error.contains(name), "{what}: {error}");
        };
        for file in ["a.ply", "a.splat", "a.spz", "a.sog", "a.splatv", "a.splat4d", "a.zip"] {
            let path = put(file);
            named(file, detect(&path).unwrap().to_string());
            named(file, open_scene(&path, &OpenOptions::default()).unwrap_err().to_string());
            named(file, frame::read_file(&path).unwrap_err().to_string());
        }
        named(
            "splatv",
            gs_io::splatv::open(&put("b.splatv"), Damage::Drop).unwrap_err().to_string(),
        );
        named(
            "splat4d",
            gs_io::splat4d::open(&put("b.splat4d"), Damage::Drop).unwrap_err().to_string(),
        );
        named("ply", gs_io::ply::read_file(&put("b.ply")).unwrap_err().to_string());
        named("header", gs_io::ply::read_header_file(&put("b.ply")).unwrap_err().to_string());
        let options = SequenceOptions::default();
        named("zip", PlySequence::open(&put("b.zip"), &options).unwrap_err().to_string());
        Table::scene(0, 0.0).write(&dir.path().join("sequence/f0.ply"));
        put("sequence/f1.ply");
        named(
            "sequence",
            PlySequence::open(&dir.path().join("sequence"), &options).unwrap_err().to_string(),
        );
        for file in ["cameras.json", "transforms_train.json", "poses_bounds.npy", "dataset.json"] {
            let path = put(&format!("cameras/{file}"));
            let error = cameras::open(&path, cameras::Reading::Trained).unwrap_err();
            named(file, error.to_string());
        }
        put("colmap/sparse/0/images.bin");
        put("colmap/sparse/0/cameras.bin");
        let error =
            cameras::open(&dir.path().join("colmap"), cameras::Reading::Stored).unwrap_err();
        named("COLMAP", error.to_string());
        // Models: the cloud, the network, the settings.
        for part in ["point_cloud.ply", "deformation.pth", "cfg_args"] {
            let model = dir.path().join(format!("model-{part}"));
            let save = "point_cloud/iteration_1";
            let good = fixture("deform4dgs/variants/default_flags/model");
            fs::create_dir_all(model.join(save)).unwrap();
            for file in [
                "cfg_args",
                "point_cloud/iteration_1/point_cloud.ply",
                "point_cloud/iteration_1/deformation.pth",
            ] {
                fs::copy(good.join(file), model.join(file)).unwrap();
            }
            let place =
                if part == "cfg_args" { model.join(part) } else { model.join(save).join(part) };
            fs::remove_file(&place).unwrap();
            fs::write(place, bytes).unwrap();
            let error = checkpoint4dgs::open(&model, &Overrides::default()).unwrap_err();
            named(part, error.to_string());
        }
        fs::create_dir_all(dir.path().join("sog")).unwrap();
        fs::write(
            dir.path().join("sog/meta.json"),
            r#"{"version": 2, "count": 1, "means": {"mins": [0, 0, 0], "maxs": [1, 1, 1], "files": ["l.webp", "u.webp"]},
                "scales": {"codebook": [], "files": ["s.webp"]}, "quats": {"files": ["q.webp"]}, "sh0": {"codebook": [], "files": ["c.webp"]}}"#,
        )
        .unwrap();
        put("sog/l.webp");
        named(
            "a plane of a SOG",
            frame::read_file(&dir.path().join("sog")).unwrap_err().to_string(),
        );
    }
}
