//! Whole model folders of 4DGS: an input is a few files, each
//! replacing or added to the files of a valid model.
#![no_main]

use gs_io::{OpenOptions, open_scene};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Relative to the repository root.
const MODEL: &str = "fixtures/deform4dgs/variants/apply_rotation/model";
/// Files that an input may replace or add, by number.
const FILES: [&str; 8] = [
    "cfg_args",
    "point_cloud/iteration_1/point_cloud.ply",
    "point_cloud/iteration_1/deformation.pth",
    "point_cloud/iteration_1/deformation_table.pth",
    "point_cloud/iteration_1/deformation_accum.pth",
    "cameras.json",
    "c4d.toml",
    "point_cloud/iteration_7/point_cloud.ply",
];

/// A copy of the fixture's model, and the contents of its files.
static FOLDER: LazyLock<(PathBuf, Vec<Option<Vec<u8>>>)> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("gs-io-fuzz-model-{}", std::process::id()));
    // The manifest directory is one level below the root for a fuzzer, two for a test.
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let model = here.ancestors().map(|root| root.join(MODEL)).find(|model| model.is_dir());
    let model = model.expect("the fixture exists");
    let sound: Vec<Option<Vec<u8>>> =
        FILES.iter().map(|file| fs::read(model.join(file)).ok()).collect();
    for (file, bytes) in FILES.iter().zip(&sound) {
        let path = folder.join(file);
        fs::create_dir_all(path.parent().expect("below the folder")).expect("the folder is \
            created");
        if let Some(bytes) = bytes {
            fs::write(path, bytes).expect("the file is written");
        }
    }
    (folder, sound)
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (folder, sound) = &*FOLDER;
    let mut rest = bytes;
    let mut given = Vec::new();
    // The file's number, length and contents.
    while let [number, low, high, tail @ ..] = rest {
        let length = usize::from(u16::from_le_bytes([*low, *high])).min(tail.len());
        let number = usize::from(*number) % FILES.len();
        fs::write(folder.join(FILES[number]), &tail[..length]).expect("the file is written");
        given.push(number);
        rest = &tail[length..];
    }
    let _ = gs_io::detect(folder);
    if let Ok(opened) = open_scene(folder, &OpenOptions::default())
        && let Ok(splats) = opened.scene.at(0.5)
    {
        assert!(splats.check_shapes().is_ok(), "evaluated splats are consistent");
    }
    for number in given {
        let path = folder.join(FILES[number]);
        match &sound[number] {
            Some(bytes) => fs::write(path, bytes).expect("the file is written"),
            None => {
                let _ = fs::remove_file(path);
            }
        }
    }
});
