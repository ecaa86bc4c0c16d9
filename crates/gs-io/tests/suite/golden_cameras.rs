//! Cameras and times of data sets of every layout match the reference's readers, within the
//! tolerance of `fixtures/cameras/README.md`.

use gs_core::Camera;
use gs_io::cameras::{self, CameraSet, Format, Reading, Split};
use serde_json::Value;
use std::fs;
use test_support::fixture;

const TOLERANCE: f64 = 2e-6;

fn expected(kind: &str) -> Value {
    let path = fixture("cameras").join(kind).join("expected_cameras.json");
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

fn open(kind: &str) -> CameraSet {
    cameras::open(&fixture("cameras").join(kind), Reading::Trained).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

/// Largest difference between a camera and the reference's camera.
fn difference(camera: &Camera, expected: &Value) -> f64 {
    let v = &camera.viewmat;
    let [tan_x, tan_y] = camera.tan_half_fov();
    let k = &camera.intrinsics;
    let columns = |row: usize| (0..4).map(move |column| (row, column));
    let pairs = [
        // The world-to-camera rotation is the transpose of R.
        ("R", (0..3).flat_map(|i| (0..3).map(move |j| v[j][i])).collect()),
        ("T", vec![v[0][3], v[1][3], v[2][3]]),
        ("fov_x", vec![2.0 * tan_x.atan()]),
        ("fov_y", vec![2.0 * tan_y.atan()]),
        ("width", vec![f64::from(camera.width)]),
        ("height", vec![f64::from(camera.height)]),
        ("time", vec![f64::from(camera.time.unwrap())]),
        (
            "world_view_transform_row_vector",
            (0..4).flat_map(columns).map(|(i, j)| v[j][i]).collect::<Vec<f64>>(),
        ),
        ("camera_center", camera.position().to_vec()),
    ];
    let centred = (k.cx - f64::from(camera.width) / 2.0).abs()
        + (k.cy - f64::from(camera.height) / 2.0).abs();
    pairs.iter().fold(centred, |worst, (key, ours)| {
        let theirs = numbers(&expected[key]);
        assert_eq!(ours.len(), theirs.len(), "{key}");
        let off = ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        worst.max(off)
    })
}

fn check(kind: &str, part: &str, ours: &[&Camera]) {
    let expected = &expected(kind)[part];
    assert_eq!(ours.len() as u64, expected["count"].as_u64().unwrap(), "{kind} {part}: count");
    let listed = expected["cameras"].as_array().unwrap();
    assert!(!listed.is_empty(), "{kind} {part}: something to compare");
    for camera in listed {
        let index = usize::try_from(camera["index"].as_u64().unwrap()).unwrap();
        let off = difference(ours[index], camera);
        assert!(off < TOLERANCE, "{kind} {part} {index} (`{}`): off by {off}", ours[index].name);
    }
}

fn check_splits(kind: &str, format: Format) -> CameraSet {
    let set = open(kind);
    assert_eq!(set.format, format, "{kind}");
    check(kind, "train", &set.split(Split::Train).collect::<Vec<_>>());
    check(kind, "test", &set.split(Split::Test).collect::<Vec<_>>());
    set
}

/// The reference's spirals are mirrored left to right.
fn mirrored(camera: &Camera) -> Camera {
    let mut camera = camera.clone();
    camera.viewmat[0] = camera.viewmat[0].map(|v| -v);
    camera
}

#[test]
fn dnerf() {
    let set = check_splits("dnerf", Format::Transforms);
    check("dnerf", "video", &set.video.iter().collect::<Vec<_>>());
    assert_eq!(set.split(Split::Val).count(), 1, "the third file is read too");
    assert!(set.notes.iter().any(|note| note.contains("sign of x")), "noted: {:?}", set.notes);
}

#[test]
fn dynerf() {
    let set = check_splits("dynerf", Format::PosesBounds);
    let video: Vec<Camera> = set.video.iter().map(mirrored).collect();
    check("dynerf", "video", &video.iter().collect::<Vec<_>>());
    let names: Vec<String> = set.distinct_cameras().into_iter().map(|camera| camera.name).collect();
    assert_eq!(names, ["cam00", "cam01", "cam02"], "three cameras of four frames each");
    assert_eq!(set.times().len(), 4, "times");
}

#[test]
fn hypernerf() {
    for kind in ["hypernerf_split", "hypernerf_nosplit"] {
        let set = check_splits(kind, Format::Nerfies);
        // The reference's video path is the first views of the list, as many as are held out.
        let count = set.split(Split::Test).count();
        let first: Vec<&Camera> = set.views[..count].iter().map(|view| &view.camera).collect();
        check(kind, "video", &first);
        assert!(set.notes.iter().any(|note| note.contains("distortion")), "noted: {:?}", set.notes);
    }
}

#[test]
fn colmap() {
    let set = check_splits("colmap", Format::Colmap);
    check("colmap", "video", &set.split(Split::Train).collect::<Vec<_>>());
}

#[test]
fn multiple_view() {
    let set = check_splits("multipleview", Format::MultiView);
    let video: Vec<Camera> = set.video.iter().map(mirrored).collect();
    check("multipleview", "video", &video.iter().collect::<Vec<_>>());
}

#[test]
fn the_comparison_detects_differences() {
    let set = open("dnerf");
    let listed = &expected("dnerf")["train"]["cameras"][1];
    let camera = set.split(Split::Train).nth(1).unwrap();
    assert!(difference(camera, listed) < TOLERANCE, "unchanged");
    let mut off = camera.clone();
    off.time = Some(camera.time.unwrap() + 1e-4);
    assert!(difference(&off, listed) > TOLERANCE, "a different time");
    let mut off = camera.clone();
    off.intrinsics.fx *= 1.001;
    assert!(difference(&off, listed) > TOLERANCE, "a different lens");
    let stored = cameras::open(&fixture("cameras/dnerf"), Reading::Stored).unwrap();
    let stored = stored.split(Split::Train).nth(1).unwrap().resized(800, 800);
    assert!(difference(&stored, listed) > 0.1, "the sign error is detected");
}
