//! The field of a Swift4D model, with valid splats and flags, evaluated where it can be read.
#![no_main]

use gs_core::DynamicScene;
use gs_io::model_folder::Overrides;
use gs_io::swift4d;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Relative to the repository root.
const MODEL: &str = "fixtures/swift4d/model";
const ITERATION: &str = "point_cloud/iteration_13000";

/// A copy of the fixture's model; each input replaces its field.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("gs-io-fuzz-swift4d-{}", std::process::id()));
    fs::create_dir_all(folder.join(ITERATION)).expect("a temporary folder");
    // The manifest directory is one level below the root for a fuzzer, two for a test.
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let model = here.ancestors().map(|root| root.join(MODEL)).find(|model| model.is_dir());
    let model = model.expect("the fixture exists");
    for file in ["cfg_args", "point_cloud/iteration_13000/point_cloud.ply"] {
        fs::copy(model.join(file), folder.join(file)).expect("the fixture exists");
    }
    folder
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fs::write(FOLDER.join(ITERATION).join("FDHash.pth"), bytes).expect("the file is written");
    let Ok(model) = swift4d::open(&FOLDER, &Overrides::default()) else { return };
    if let Ok(splats) = model.scene.at(0.5) {
        assert!(splats.check_shapes().is_ok(), "evaluated splats are consistent");
    }
});
