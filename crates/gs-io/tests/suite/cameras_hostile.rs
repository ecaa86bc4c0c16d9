//! Camera readers handle arbitrary bytes: malformed files are errors with a
//! location, without panics or large allocations.

use gs_io::IoError;
use gs_io::cameras::{self, CameraSet, Reading, colmap, nerfies, poses_bounds, transforms};
use proptest::prelude::*;
use std::fs;
use std::sync::LazyLock;
use test_support::fixture;

/// Real files of every layout.
static FILES: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    [
        "dnerf/transforms_train.json",
        "hypernerf_split/dataset.json",
        "hypernerf_split/metadata.json",
        "hypernerf_split/camera/000001.json",
        "dynerf/poses_bounds.npy",
        "colmap/sparse/0/cameras.bin",
        "colmap/sparse/0/images.bin",
    ]
    .iter()
    .map(|name| fs::read(fixture("cameras").join(name)).unwrap())
    .chain([
        b"1 PINHOLE 60 40 66 66 30 20\n".to_vec(),
        b"1 1 0 0 0 0.1 0.2 0.3 1 a.png\n1.5 2.5 -1\n2 1 0 0 0 0.1 0.2 0.3 1 b.png\n\n".to_vec(),
    ])
    .collect()
});

fn read_all(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let _ = colmap::parse_cameras_bin(bytes);
    let _ = colmap::parse_images_bin(bytes);
    let _ = colmap::parse_cameras_txt(&text);
    let _ = colmap::parse_images_txt(&text);
    let _ = nerfies::parse_dataset(bytes);
    let _ = nerfies::parse_metadata(bytes);
    let _ = nerfies::parse_camera(bytes);
    let _ = poses_bounds::parse(bytes);
    let _ = transforms::parse(bytes);
    for reading in [Reading::Trained, Reading::Stored] {
        if let Ok(cameras) = cameras::from_slice(bytes, reading) {
            assert!(
                cameras.iter().all(|camera| camera.check().is_ok()),
                "cameras that are read \
                are valid"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files(
        which in 0..9_usize, keep in prop_oneof![2 => Just(1.0), 1 => 0.0..1.0_f64],
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
    ) {
        let file = &FILES[which];
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a fraction \
            of a length")]
        let mut bytes = file[..(file.len() as f64 * keep) as usize].to_vec();
        for (at, value) in &changes {
            if !bytes.is_empty() {
                let at = at.index(bytes.len());
                bytes[at] = *value;
            }
        }
        read_all(&bytes);
    }

    #[test]
    fn random_bytes(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        read_all(&bytes);
        read_all(&[b"\x93NUMPY\x01\x00", bytes.as_slice()].concat());
    }
}

#[test]
fn every_truncation_is_an_error() {
    let (cameras, images) = (&FILES[5], &FILES[6]);
    assert!(colmap::parse_cameras_bin(cameras).is_ok(), "whole");
    assert!(colmap::parse_images_bin(images).is_ok(), "whole");
    for cut in 0..cameras.len() {
        assert!(colmap::parse_cameras_bin(&cameras[..cut]).is_err(), "cameras cut at {cut}");
    }
    for cut in 0..images.len() {
        assert!(colmap::parse_images_bin(&images[..cut]).is_err(), "images cut at {cut}");
    }
    let poses = &FILES[4];
    for cut in 0..poses.len() {
        assert!(poses_bounds::parse(&poses[..cut]).is_err(), "poses cut at {cut}");
    }
}

#[test]
fn absurd_counts_are_refused_without_allocating() {
    let huge = u64::MAX.to_le_bytes();
    let refused = colmap::parse_images_bin(&huge).unwrap_err().to_string();
    assert!(refused.contains("18446744073709551615 images"), "{refused}");
    assert!(colmap::parse_cameras_bin(&[huge.as_slice(), &[0; 64]].concat()).is_err(), "cameras");
    // One image that declares more points than the file has.
    let mut images = FILES[6].clone();
    let name = images.windows(4).position(|window| window == b".png").unwrap() + 5;
    images[name..name + 8].copy_from_slice(&huge);
    let refused = colmap::parse_images_bin(&images).unwrap_err().to_string();
    assert!(refused.contains("image 1 of 9"), "{refused}");
}

/// A folder with one changed file, opened.
fn changed(
    kind: &str,
    file: &str,
    change: impl Fn(String) -> String,
) -> Result<CameraSet, IoError> {
    let folder = tempfile::tempdir().unwrap();
    copy(&fixture("cameras").join(kind), folder.path());
    let path = folder.path().join(file);
    let text = fs::read_to_string(&path).unwrap();
    let changed = change(text.clone());
    assert_ne!(text, changed, "the change changes something");
    fs::write(&path, changed).unwrap();
    let opened = cameras::open(folder.path(), Reading::Stored);
    if let Err(error) = &opened {
        let message = error.to_string();
        assert!(message.contains(folder.path().to_str().unwrap()), "names the file: {message}");
    }
    opened
}

/// The error message for a folder that cannot be used.
fn refusal(kind: &str, file: &str, change: impl Fn(String) -> String) -> String {
    changed(kind, file, change).unwrap_err().to_string()
}

/// The notes for a folder with single unusable views.
fn noted(kind: &str, file: &str, change: impl Fn(String) -> String) -> String {
    let whole = cameras::open(&fixture("cameras").join(kind), Reading::Stored).unwrap();
    let left = changed(kind, file, change).unwrap();
    assert!(!left.views.is_empty() && left.views.len() < whole.views.len(), "some remain");
    left.notes.join("; ")
}

fn copy(from: &std::path::Path, to: &std::path::Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().flatten() {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

#[test]
fn malformed_values_are_named() {
    let file = "transforms_train.json";
    let message = refusal("dnerf", file, |text| text[..text.len() / 2].to_owned());
    assert!(message.contains("EOF") && message.contains("line"), "cut: {message}");
    let message = noted("dnerf", file, |text| text.replacen("4.0", "NaN", 1));
    assert!(message.contains("the pose contains NaN or infinity"), "NaN: {message}");
    let message = noted("dnerf", file, |text| text.replacen("camera_angle_x", "angle", 1));
    assert!(message.contains("camera_angle_x or fl_x"), "no lens: {message}");
    let message = noted("dnerf", file, |text| text.replacen("0.6911112070083618", "-1.5", 1));
    assert!(message.contains("focal lengths"), "negative lens: {message}");
    let message = noted("dnerf", file, |text| text.replacen("1.0,", "1e200,", 1));
    assert!(message.contains("entry 0"), "no rotation: {message}");

    let camera = "camera/000003.json";
    let message = noted("hypernerf_split", camera, |text| text.replacen("[48, 64]", "[0, 64]", 1));
    assert!(message.contains("image size 0×64"), "zero size: {message}");
    let message = noted("hypernerf_split", camera, |text| text.replacen("focal_length", "f", 1));
    assert!(message.contains("`000003`: focal lengths NaN"), "no focal: {message}");
    let message =
        noted("hypernerf_split", "metadata.json", |text| text.replacen("000003", "000099", 1));
    assert!(message.contains("000003") && message.contains("warp_id"), "no time: {message}");
    let message =
        refusal("hypernerf_split", "dataset.json", |text| text.replacen("000002", "../x", 1));
    assert!(message.contains("names without folders"), "leaves the folder: {message}");
}

#[test]
fn missing_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    copy(&fixture("cameras/hypernerf_split"), folder.path());
    fs::remove_file(folder.path().join("camera/000004.json")).unwrap();
    let notes = cameras::open(folder.path(), Reading::Trained).unwrap().notes.join("; ");
    assert!(notes.contains("1 of 10 views") && notes.contains("000004.json"), "{notes}");

    let folder = tempfile::tempdir().unwrap();
    copy(&fixture("cameras/colmap"), folder.path());
    fs::remove_dir_all(folder.path().join("images")).unwrap();
    let set = cameras::open(folder.path(), Reading::Trained).unwrap();
    assert!(set.notes.iter().any(|note| note.contains("9 of 9 images")), "{:?}", set.notes);
    fs::remove_file(folder.path().join("sparse/0/images.bin")).unwrap();
    let message = cameras::open(folder.path(), Reading::Trained).unwrap_err().to_string();
    assert!(message.contains("images.bin"), "{message}");

    let empty = tempfile::tempdir().unwrap();
    let message = cameras::open(empty.path(), Reading::Trained).unwrap_err().to_string();
    assert!(message.contains("contains no cameras; expected"), "{message}");
}
