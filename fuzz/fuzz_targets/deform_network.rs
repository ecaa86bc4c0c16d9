//! Networks of Deformable-3D-Gaussians, SC-GS, Grid4D and DASH, with valid splats and flags,
//! evaluated where they can be read.
#![no_main]

use gs_io::{OpenOptions, detect, open_scene_as};
use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

/// Two splats with the additional columns of all these methods.
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 2
property float x\nproperty float y\nproperty float z
property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2
property float opacity
property float scale_0\nproperty float scale_1\nproperty float scale_2
property float rot_0\nproperty float rot_1\nproperty float rot_2\nproperty float rot_3
property float fea_0\nproperty float dynamic
end_header
0.1 0.2 0.3 1 1 1 0 -3 -3 -3 1 0 0 0 0.5 1
-0.4 0 0.6 0 1 0 2 -2 -3 -4 0.5 0.5 0 0.1 -0.5 0
";

/// A model folder; each input replaces its network.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("gs-io-fuzz-deform-{}", std::process::id()));
    for part in ["point_cloud/iteration_1", "deform/iteration_1"] {
        fs::create_dir_all(folder.join(part)).expect("a temporary folder");
    }
    fs::write(folder.join("point_cloud/iteration_1/point_cloud.ply"), PLY).expect("room");
    let cfg = "Namespace(grid_args={'bound': 1.0}, network_args={'directional': True}, K=1)";
    fs::write(folder.join("cfg_args"), cfg).expect("room");
    folder
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fs::write(FOLDER.join("deform/iteration_1/deform.pth"), bytes).expect("the file is written");
    let Ok(kind) = detect(&FOLDER) else { return };
    let Ok(source) = open_scene_as(&FOLDER, &kind, &OpenOptions::default()) else { return };
    for t in [0.0, 0.5] {
        let splats = source.scene.at(t).expect("times from 0 to 1 can be evaluated");
        assert!(splats.check_shapes().is_ok(), "evaluated splats are consistent");
    }
});
