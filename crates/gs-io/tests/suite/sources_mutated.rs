//! Every trained scene of the fixtures with each of its files missing, mutated, or with NaN in any
//! column: it is refused with the path and a next step, or read with the damage counted.

use crate::common::tsog;

use gs_core::SplitMix64;
use gs_io::{IoError, OpenOptions, OpenedScene, SceneKind, detect, open_scene_as, ply};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use test_support::fixture;

/// Scenes: their path in `fixtures/bases`, and the part of it that is opened.
const SCENES: [(&str, &str); 19] = [
    ("deformable3dgs/real_w40/model", ""),
    ("deformable3dgs/blender_6dof_w40/model", ""),
    ("scgs/real_local_frame_mask_w64/model", ""),
    ("scgs/blender_w64/model", ""),
    ("grid4d/real_depth1_w48/model", ""),
    ("grid4d/dnerf_w64/model", ""),
    ("dash/n3v_w64/model", ""),
    ("ed3dgs/hyper_d0/model", ""),
    ("ed3dgs/early_anneal/model", ""),
    ("spacetime_lite/model", ""),
    ("spacetime_lite/model", "point_cloud/iteration_30000/point_cloud.ply"),
    ("freetimegs/vanilla/ckpts", "ckpt_29999.pt"),
    ("freetimegs/vanilla/ckpts", "ckpt_29999.ftgs.ply"),
    ("freetimegs/older_fork_pt/ckpts", "ckpt_6999.pt"),
    ("fudan4dgs/no_shfs4d/model", ""),
    ("fudan4dgs/shfs4d/model", ""),
    ("dynamic3dgs/model/output/exp1/blob", ""),
    ("dynamic3dgs/model/output/exp1/blob", "params.npz"),
    ("4dgs/birth", "scene.4dgs"),
];

/// First words of next steps.
const STEPS: [&str; 13] = [
    "choose", "convert", "copy", "export", "make", "pass", "put", "save", "set", "train", "use",
    "write", "load",
];

fn options() -> OpenOptions {
    OpenOptions::default().with_time_duration(0.0, 10.0).with_bound(1.6)
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

/// A copy of a scene, what to open of it, and its kind.
struct Copied {
    folder: TempDir,
    scene: PathBuf,
    kind: SceneKind,
}

impl Copied {
    fn of(model: &str, part: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        copy(&fixture("bases").join(model), folder.path());
        let scene =
            if part.is_empty() { folder.path().to_owned() } else { folder.path().join(part) };
        let kind = detect(&scene).unwrap();
        assert!(kind.is_dynamic(), "{model}/{part}: {kind}");
        Self { folder, scene, kind }
    }

    fn open(&self) -> Result<OpenedScene, IoError> {
        open_scene_as(&self.scene, &self.kind, &options())
    }

    /// The files on which the scene may depend.
    fn files(&self) -> Vec<PathBuf> {
        if self.scene.is_file() {
            return vec![self.scene.clone()];
        }
        let (mut files, mut folders) = (Vec::new(), vec![self.folder.path().to_owned()]);
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() { &mut folders } else { &mut files }.push(path);
            }
        }
        files.sort();
        files
    }
}

/// Opens a damaged scene: consistent splats, or an error with its location and a next step.
fn check(copied: &Copied, what: &str) {
    let _ = detect(&copied.scene);
    match copied.open() {
        Ok(opened) => {
            for t in [0.0, 0.37, 1.0] {
                let splats = opened.scene.at(t).unwrap_or_else(|error| panic!("{what}: {error}"));
                assert!(splats.check_shapes().is_ok(), "{what}: consistent at {t}");
                assert_eq!(splats.len(), opened.scene.num_splats(), "{what}: rows at {t}");
            }
        }
        Err(error) => {
            let text =
                std::iter::successors(Some(&error as &dyn std::error::Error), |e| e.source())
                    .map(ToString::to_string)
                    .collect::<Vec<_>>()
                    .join(": ");
            let folder = copied.folder.path().to_string_lossy();
            assert!(text.contains(&*folder), "{what}: names the path: {text}");
            assert!(text.len() < 2000, "{what}: {} characters", text.len());
        }
    }
}

#[test]
fn a_missing_file_is_named_with_the_next_step_or_not_needed() {
    let mut refused = 0;
    for (model, part) in SCENES {
        let whole = Copied::of(model, part);
        for file in whole.files() {
            let copied = Copied::of(model, part);
            let name = file.strip_prefix(whole.folder.path()).unwrap();
            fs::remove_file(copied.folder.path().join(name)).unwrap();
            let what = format!("{model} without {}", name.display());
            check(&copied, &what);
            let Err(error) = copied.open() else { continue };
            refused += 1;
            if copied.scene.is_file() || !copied.scene.exists() {
                continue;
            }
            let text = error.to_string();
            let has_step = |step: &&str| text.contains(&format!("; {step} "));
            assert!(STEPS.iter().any(has_step), "{what}: {text}");
        }
    }
    assert!(refused >= 20, "{refused} files matter");
}

/// Random mutations of files.
struct Mutations(SplitMix64);

impl Mutations {
    fn next(&mut self, below: usize) -> usize {
        self.0.below(below)
    }

    /// A place near the start or the end of a file, where its structure is, or anywhere.
    fn place(&mut self, length: usize) -> usize {
        match self.next(3) {
            0 => self.next(length.min(2000)),
            1 => length.saturating_sub(1 + self.next(length.min(2000))),
            _ => self.next(length),
        }
    }

    fn mutate(&mut self, bytes: &mut Vec<u8>) {
        for _ in 0..=self.next(3) {
            let at = self.place(bytes.len());
            let length = 1 + self.next(24).min(bytes.len().saturating_sub(at + 1));
            match self.next(6) {
                _ if at >= bytes.len() => {}
                0 => bytes[at] ^= 1 << self.next(8),
                1 => bytes[at] = b"0123456789-.eN("[self.next(15)],
                2 => bytes[at..at + length].fill(0xff),
                3 => bytes[at..at + length].fill(0),
                4 => drop(bytes.drain(at..at + length)),
                _ => bytes.truncate(at),
            }
        }
    }
}

/// Mutations of every file.
const MUTATIONS: u64 = 24;

#[test]
fn mutated_files_are_refused_or_read() {
    let (mut refused, mut read) = (0, 0);
    for (index, (model, part)) in SCENES.into_iter().enumerate() {
        let copied = Copied::of(model, part);
        for file in copied.files() {
            let whole = fs::read(&file).unwrap();
            for seed in 0..MUTATIONS {
                let mut bytes = whole.clone();
                Mutations(SplitMix64::new(seed + 1000 * index as u64)).mutate(&mut bytes);
                fs::write(&file, &bytes).unwrap();
                check(&copied, &format!("{}, mutation {seed}", file.display()));
                let ok = copied.open().is_ok();
                *if ok { &mut read } else { &mut refused } += 1;
            }
            fs::write(&file, &whole).unwrap();
        }
        assert!(copied.open().is_ok(), "{model}: as it was");
    }
    // Negative control: mutations are neither all fatal nor all without effect.
    assert!(refused > 100 && read > 100, "{refused} refused, {read} read");
}

/// Columns that are not read.
const UNUSED: [&str; 3] = ["nx", "ny", "nz"];

#[test]
fn nan_in_any_column_of_a_ply_is_damage() {
    let mut columns = 0;
    for (model, part) in SCENES {
        let copied = Copied::of(model, part);
        let is_ply = |path: &PathBuf| path.extension().is_some_and(|end| end == "ply");
        // Of several saves, the newest is read.
        let Some(file) = copied.files().into_iter().filter(is_ply).max_by_key(|path| {
            let save = path.parent().and_then(|save| save.file_name()).unwrap_or_default();
            save.to_string_lossy().rsplit('_').next().and_then(|digits| digits.parse::<u64>().ok())
        }) else {
            continue;
        };
        let whole = fs::read(&file).unwrap();
        let end = b"end_header\n";
        let start = whole.windows(end.len()).position(|bytes| bytes == end).unwrap() + end.len();
        let header = String::from_utf8(whole[..start].to_vec()).unwrap();
        let names: Vec<&str> =
            header.lines().filter_map(|line| line.strip_prefix("property float ")).collect();
        assert_eq!(header.matches("property").count(), names.len(), "all are floats: {header}");
        for (column, name) in names.iter().enumerate() {
            let mut bytes = whole.clone();
            let at = start + 4 * column;
            bytes[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
            fs::write(&file, &bytes).unwrap();
            let opened = copied.open().unwrap();
            let expected = usize::from(!UNUSED.contains(name));
            assert_eq!(opened.repair.damaged(), expected, "{model}: NaN in `{name}`");
            assert_eq!(opened.warnings.is_empty(), expected == 0, "{model}: says so");
            columns += expected;
        }
        assert!(ply::read(&whole).is_ok(), "{model}: as it was");
    }
    assert!(columns > 300, "{columns} columns");
}

#[test]
fn arrays_of_other_shapes_are_refused_by_name() {
    let copied = Copied::of("dynamic3dgs/model/output/exp1/blob", "params.npz");
    let whole = fs::read(&copied.scene).unwrap();
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(whole)).unwrap();
    let entries: Vec<(String, Vec<u8>)> = (0..archive.len())
        .map(|index| {
            let mut entry = archive.by_index(index).unwrap();
            let mut bytes = Vec::new();
            std::io::Read::read_to_end(&mut entry, &mut bytes).unwrap();
            (entry.name().unwrap().into_owned(), bytes)
        })
        .collect();
    let needed = ["means3D", "rgb_colors", "unnorm_rotations", "logit_opacities", "log_scales"];
    let mut refused = 0;
    for (changed, (name, bytes)) in entries.iter().enumerate() {
        // One more axis of length 1 leaves the number of values as it is.
        let at = bytes.windows(7).position(|window| window == b"'shape'").unwrap();
        let open = at + bytes[at..].iter().position(|&byte| byte == b'(').unwrap();
        let mut other = bytes.clone();
        other.splice(open + 1..=open, *b"1, ");
        // The header's padding takes the additional characters.
        let newline = other.iter().skip(open).position(|&byte| byte == b'\n').unwrap() + open;
        other.drain(newline - 3..newline);
        let parts: Vec<(&str, Vec<u8>)> = entries
            .iter()
            .enumerate()
            .map(|(i, (name, bytes))| {
                (name.as_str(), if i == changed { other.clone() } else { bytes.clone() })
            })
            .collect();
        fs::write(&copied.scene, tsog::zip(&parts)).unwrap();
        let array = name.trim_end_matches(".npy");
        if !needed.contains(&array) {
            assert!(copied.open().is_ok(), "{array} is not read");
            continue;
        }
        let error = copied.open().unwrap_err().to_string();
        assert!(error.contains(array) && error.contains("shape"), "{array}: {error}");
        refused += 1;
    }
    assert_eq!(refused, needed.len(), "all that are needed");
}
