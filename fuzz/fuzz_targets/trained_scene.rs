//! Single-file scenes (native 4D Gaussians, FreeTimeGS, Spacetime Gaussians, Dynamic 3D Gaussians,
//! `.4dgs`, `.tsog`), evaluated where they can be read.
#![no_main]

use gs_io::{OpenOptions, detect, open_scene_as};
use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

static FILE: LazyLock<PathBuf> = LazyLock::new(|| {
    std::env::temp_dir().join(format!("gs-io-fuzz-trained-{}", std::process::id()))
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fs::write(&*FILE, bytes).expect("the file is written");
    let Ok(kind) = detect(&FILE) else { return };
    if !kind.is_dynamic() {
        return;
    }
    let options = OpenOptions::default().with_time_duration(0.0, 10.0);
    let Ok(source) = open_scene_as(&FILE, &kind, &options) else { return };
    assert!(source.scene.num_splats() <= bytes.len(), "a splat is more than a byte");
    for t in [0.0, 0.37, 1.0] {
        let splats = source.scene.at(t).expect("times from 0 to 1 can be evaluated");
        assert!(splats.check_shapes().is_ok(), "evaluated splats are consistent");
    }
});
