//! Readers handle arbitrary bytes: randomly truncated and overwritten files, and random bytes, give
//! a value or an error, never a panic.

use gs_core::DynamicScene;
use gs_io::checkpoint4dgs;
use gs_io::model_folder::Overrides;
use gs_io::ply_sequence::{PlySequence, SequenceOptions};
use gs_io::{cameras_json, cfg_args, detect, frame, ply, pth, splat4d};
use proptest::prelude::*;
use std::fs;
use std::sync::LazyLock;
use test_support::fixture;

const ITERATION: &str = "deform4dgs/variants/apply_rotation/model/point_cloud/iteration_1";

static PLY: LazyLock<Vec<u8>> = LazyLock::new(|| read(&format!("{ITERATION}/point_cloud.ply")));
static PTH: LazyLock<Vec<u8>> = LazyLock::new(|| read(&format!("{ITERATION}/deformation.pth")));
static TABLE: LazyLock<Vec<u8>> =
    LazyLock::new(|| read(&format!("{ITERATION}/deformation_table.pth")));
static CFG: LazyLock<Vec<u8>> =
    LazyLock::new(|| read("deform4dgs/variants/apply_rotation/model/cfg_args"));
const CAMERAS: &[u8] =
    br#"[{"id": 0, "img_name": "r_0", "width": 800, "height": 600, "position": [1, 2, 3],
 "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "fy": 1100.0, "fx": 1111.0, "time": 0.5}]"#;

fn read(path: &str) -> Vec<u8> {
    fs::read(fixture(path)).unwrap()
}

/// Truncation at some point, and overwritten bytes, mostly near the
/// start and the end, where the structure is.
#[derive(Debug, Clone)]
struct Damage {
    keep: f64,
    bytes: Vec<(bool, u16, u8)>,
}

fn damage() -> impl Strategy<Value = Damage> {
    let keep = prop_oneof![3 => Just(1.0), 1 => 0.0..1.0_f64];
    let byte = (any::<bool>(), 0..4000_u16, any::<u8>());
    (keep, prop::collection::vec(byte, 0..6)).prop_map(|(keep, bytes)| Damage { keep, bytes })
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a fraction of a length"
)]
fn apply(original: &[u8], damage: &Damage) -> Vec<u8> {
    let mut bytes = original[..(original.len() as f64 * damage.keep) as usize].to_vec();
    for &(from_end, offset, value) in &damage.bytes {
        let offset = usize::from(offset);
        let at = if from_end { bytes.len().checked_sub(offset + 1) } else { Some(offset) };
        if let Some(byte) = at.and_then(|at| bytes.get_mut(at)) {
            *byte = value;
        }
    }
    bytes
}

fn read_all(bytes: &[u8]) {
    if let Ok(read) = splat4d::read(bytes.to_vec(), gs_io::repair::Damage::Drop) {
        for t in [0.0, 0.9, 0.2] {
            let splats = read.scene.at(t).unwrap();
            assert!(splats.check_shapes().is_ok(), "an opened scene can be evaluated");
        }
    }
    if let Ok(read) = ply::read(bytes) {
        assert!(read.splats.check_shapes().is_ok(), "splats that are read are consistent");
    }
    let _ = ply::read_column(bytes, "x");
    if let Ok(read) = frame::read(bytes) {
        assert!(read.splats.check_shapes().is_ok(), "splats that are read are consistent");
        let most = 64 * bytes.len().max(1 << 18);
        assert!(read.splats.len() < most, "{} splats of {} bytes", read.splats.len(), bytes.len());
        if let Some(precision) = &read.precision {
            assert!(precision.of(read.splats.len() - 1).opacity > 0.0, "one entry per row");
        }
        let _ = read.sanitize(gs_io::repair::Damage::Drop);
    }
    let _ = frame::shape(bytes, bytes.len() as u64);
    match pth::read(bytes) {
        Ok(pth::Root::StateDict(tensors)) => {
            let total: usize = tensors.iter().map(|(_, tensor)| tensor.to_f32s().len()).sum();
            assert!(total <= bytes.len() * 200, "{total} values from {} bytes", bytes.len());
        }
        Ok(pth::Root::Tensor(tensor)) => {
            assert!(tensor.to_f32s().len() <= bytes.len(), "no more values than bytes");
        }
        Err(_) => {}
    }
    let _ = cameras_json::parse(bytes);
    let _ = cfg_args::parse(&String::from_utf8_lossy(bytes));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files(which in 0..5_usize, damage in damage()) {
        let original: [&[u8]; 5] = [&PLY, &PTH, &TABLE, &CFG, CAMERAS];
        read_all(&apply(original[which], &damage));
    }

    #[test]
    fn random_bytes(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        read_all(&bytes);
        read_all(&[b"ply\nformat ascii 1.0\n", &bytes[..]].concat());
        read_all(&[b"PK\x03\x04", &bytes[..]].concat());
    }
}

const FRAMES: [&str; 5] =
    ["frame.ply", "frame.compressed.ply", "frame_v3.spz", "frame_v4.spz", "frame.sog"];

/// These files, and a small one as binary glTF.
static STILLS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let mut stills: Vec<Vec<u8>> =
        FRAMES.iter().map(|name| read(&format!("frames/{name}"))).collect();
    let splats = frame::read(&stills[0]).unwrap().splats.select(&[0, 1, 2]);
    let mut glb = Vec::new();
    gs_io::gltf::write(&splats, &gs_io::gltf::WriteOptions::default(), &mut glb).unwrap();
    stills.push(glb);
    stills
});

/// A clip of three frames of one of them.
static CLIP: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let splats = frame::read(&STILLS[0]).unwrap().splats;
    let moved = |by: f32| {
        let mut splats = splats.select(&[0, 1, 2, 3]);
        splats.means[1][0] += by;
        splats.quats[2] = [1.0, by, 0.0, 0.0];
        splats
    };
    let scene = gs_deform::TabulatedScene::new([0.0, 1.0, 3.0].map(moved).to_vec()).unwrap();
    let clip = gs_io::Clip { scene: &scene, times: &[0.0, 0.5, 1.0], fps: 30.0 };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("clip.splat4d");
    let options = splat4d::WriteOptions { gop: 2, ..splat4d::WriteOptions::default() };
    splat4d::write(&path, &clip, &options, gs_io::Existing::Refuse, &mut |_| ()).unwrap();
    fs::read(path).unwrap()
});

/// An archive of two short frames.
static ARCHIVE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for name in ["f0.splat", "f1.splat"] {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        let read = frame::read(&STILLS[0]).unwrap();
        gs_io::splat_file::write(&read.splats, &mut zip).unwrap();
    }
    zip.finish().unwrap().into_inner()
});

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_frames(which in 0..=FRAMES.len(), damage in damage()) {
        read_all(&apply(&STILLS[which], &damage));
    }

    #[test]
    fn damaged_clips(damage in damage()) {
        read_all(&apply(&CLIP, &damage));
    }

    #[test]
    fn random_bytes_after_every_magic(which in 0..6_usize, bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let marks: [&[u8]; 6] = [
            b"NGSP\x04\0\0\0\x05\0\0\0\0\x0c\0\x05\x20\0\0\0",
            b"\x1f\x8b\x08\0\0\0\0\0\0\0",
            b"NGSP",
            b"PK\x03\x04",
            b"ply\nformat binary_little_endian 1.0\nelement chunk 1\n",
            b"",
        ];
        read_all(&[marks[which], &bytes[..]].concat());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_archives(damage in damage()) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("clip.zip");
        fs::write(&path, apply(&ARCHIVE, &damage)).unwrap();
        let _ = detect(&path);
        if let Ok(sequence) = PlySequence::open(&path, &SequenceOptions::default()) {
            for frame in 0..sequence.num_frames().unwrap_or(0) {
                let _ = sequence.frame(frame);
            }
        }
    }

    #[test]
    fn damaged_model_folders(which in 0..3_usize, damage in damage()) {
        let dir = tempfile::tempdir().unwrap();
        let iteration = dir.path().join("point_cloud/iteration_1");
        fs::create_dir_all(&iteration).unwrap();
        let file = |index: usize, original: &[u8]| {
            if index == which { apply(original, &damage) } else { original.to_vec() }
        };
        fs::write(iteration.join("point_cloud.ply"), file(0, &PLY)).unwrap();
        fs::write(iteration.join("deformation.pth"), file(1, &PTH)).unwrap();
        fs::write(dir.path().join("cfg_args"), file(2, &CFG)).unwrap();
        match checkpoint4dgs::open(dir.path(), &Overrides::default()) {
            Ok(model) => {
                let splats = model.scene.at(0.4).unwrap();
                prop_assert!(splats.check_shapes().is_ok(), "evaluates");
            }
            Err(error) => {
                let shown = error.to_string();
                prop_assert!(shown.contains(&*dir.path().to_string_lossy()), "names the file: {}", shown);
            }
        }
    }
}
