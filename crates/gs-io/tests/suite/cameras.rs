//! Conventions of every layout: a known camera, written in each format, projects known points to
//! the same pixels; and detection of folders without goldens.

use glam::{DMat3, DQuat, DVec3};
use gs_core::Camera;
use gs_io::cameras::{self, CameraSet, Format, Reading, Split};
use proptest::prelude::*;
use serde_json::json;
use std::fs;
use std::path::Path;

/// Rows of the world-to-camera rotation: right, down, forward.
fn axes(camera: &Camera) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|i| [0, 1, 2].map(|k| camera.viewmat[i][k]))
}

fn translation(camera: &Camera) -> [f64; 3] {
    [0, 1, 2].map(|i| camera.viewmat[i][3])
}

fn write(path: &Path, bytes: impl AsRef<[u8]>) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

/// Camera to world, OpenGL's axes: right, up, backward.
fn opengl(camera: &Camera) -> Vec<Vec<f64>> {
    let [right, down, forward] = axes(camera);
    let centre = camera.position();
    let row = |k: usize| vec![right[k], -down[k], -forward[k], centre[k]];
    vec![row(0), row(1), row(2), vec![0.0, 0.0, 0.0, 1.0]]
}

fn transforms(root: &Path, camera: &Camera) {
    let k = camera.intrinsics;
    let file = json!({
        "frames": [{ "file_path": "./train/r_0", "time": 0.5, "transform_matrix": opengl(camera),
            "fl_x": k.fx, "fl_y": k.fy, "cx": k.cx, "cy": k.cy, "w": camera.width, "h": camera.height }],
    });
    write(&root.join("transforms_train.json"), file.to_string());
}

fn nerfies(root: &Path, camera: &Camera) {
    let k = camera.intrinsics;
    write(&root.join("dataset.json"), r#"{"ids": ["a"], "train_ids": ["a"], "val_ids": []}"#);
    write(&root.join("metadata.json"), r#"{"a": {"warp_id": 3, "camera_id": 0}}"#);
    let file = json!({
        "orientation": axes(camera), "position": camera.position(), "focal_length": k.fx, "skew": 0.0,
        "pixel_aspect_ratio": k.fy / k.fx, "principal_point": [k.cx, k.cy],
        "radial_distortion": [0.0, 0.0, 0.0], "tangential_distortion": [0.0, 0.0],
        "image_size": [camera.width, camera.height],
    });
    write(&root.join("camera/a.json"), file.to_string());
}

fn npy(rows: &[[f64; 17]]) -> Vec<u8> {
    let header =
        format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 17), }}\n", rows.len());
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(rows.iter().flatten().flat_map(|value| value.to_le_bytes()));
    bytes
}

fn llff(camera: &Camera) -> [f64; 17] {
    let [right, down, forward] = axes(camera);
    let centre = camera.position();
    let size = [f64::from(camera.height), f64::from(camera.width), camera.intrinsics.fx];
    let mut row = [0.0; 17];
    for k in 0..3 {
        // Columns: down, right, backward, centre, size and focal length.
        row[5 * k..5 * k + 5].copy_from_slice(&[
            down[k],
            right[k],
            -forward[k],
            centre[k],
            size[k],
        ]);
    }
    (row[15], row[16]) = (1.0, 9.0);
    row
}

/// wxyz and translation, world to camera.
fn colmap_pose(camera: &Camera) -> [f64; 7] {
    let [right, down, forward] = axes(camera).map(DVec3::from);
    let q = DQuat::from_mat3(&DMat3::from_cols(right, down, forward).transpose());
    let [x, y, z] = translation(camera);
    [q.w, q.x, q.y, q.z, x, y, z]
}

fn colmap_text(root: &Path, camera: &Camera, name: &str) {
    let k = camera.intrinsics;
    let lens = format!(
        "# a comment\n7 PINHOLE {} {} {} {} {} {}\n",
        camera.width, camera.height, k.fx, k.fy, k.cx, k.cy
    );
    let pose = colmap_pose(camera).map(|value| value.to_string()).join(" ");
    write(&root.join("cameras.txt"), lens);
    write(&root.join("images.txt"), format!("# a comment\n1 {pose} 7 {name}\n\n"));
}

fn colmap_binary(root: &Path, camera: &Camera, names: &[&str]) {
    let k = camera.intrinsics;
    let mut lens = 1_u64.to_le_bytes().to_vec();
    lens.extend(7_u32.to_le_bytes());
    lens.extend(1_u32.to_le_bytes());
    lens.extend(u64::from(camera.width).to_le_bytes());
    lens.extend(u64::from(camera.height).to_le_bytes());
    lens.extend([k.fx, k.fy, k.cx, k.cy].iter().flat_map(|value| value.to_le_bytes()));
    write(&root.join("cameras.bin"), lens);
    let mut images = (names.len() as u64).to_le_bytes().to_vec();
    for (id, name) in (1_u32..).zip(names) {
        images.extend(id.to_le_bytes());
        images.extend(colmap_pose(camera).iter().flat_map(|value| value.to_le_bytes()));
        images.extend(7_u32.to_le_bytes());
        images.extend(name.as_bytes());
        images.extend([0]);
        images.extend(1_u64.to_le_bytes());
        images.extend([0; 24]);
    }
    write(&root.join("images.bin"), images);
}

fn stored(root: &Path) -> CameraSet {
    cameras::open(root, Reading::Stored).unwrap()
}

fn point() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-3.0..3.0_f64)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn all_layouts_describe_the_same_camera(
        eye in point(), target in point(), seen in point(), focal in 20.0..90.0_f64, square in any::<bool>(),
    ) {
        let mut camera = Camera::look_at(eye, target, [0.1, 1.0, 0.2], 0.8, 64, 48);
        camera.intrinsics.fx = focal;
        camera.intrinsics.fy = if square { focal } else { 1.1 * focal };
        (camera.intrinsics.cx, camera.intrinsics.cy) = (30.0, 25.5);
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        transforms(&at("transforms"), &camera);
        nerfies(&at("nerfies"), &camera);
        colmap_text(&at("text/sparse/0"), &camera, "a b.png");
        colmap_binary(&at("binary/sparse/0"), &camera, &["a.png"]);
        // LLFF has one focal length and no principal point.
        let mut plain = camera.clone();
        plain.intrinsics.fy = focal;
        (plain.intrinsics.cx, plain.intrinsics.cy) = (32.0, 24.0);
        write(&at("llff/poses_bounds.npy"), npy(&[llff(&plain)]));
        for (name, truth) in [
            ("transforms", &camera), ("nerfies", &camera), ("text", &camera), ("binary", &camera), ("llff", &plain),
        ] {
            let set = stored(&at(name));
            let ours = &set.views[0].camera;
            prop_assert_eq!((ours.width, ours.height), (64, 48), "{}: size", name);
            let (a, b) = (ours.to_camera(seen), truth.to_camera(seen));
            for k in 0..3 {
                prop_assert!((a[k] - b[k]).abs() < 1e-9, "{}: {:?} instead of {:?}", name, a, b);
            }
            if let (Some(a), Some(b)) = (ours.project(seen), truth.project(seen)) {
                let off = (a[0] - b[0]).abs() + (a[1] - b[1]).abs();
                prop_assert!(off < 1e-6 * (1.0 + a[0].abs() + a[1].abs()), "{}: {:?} {:?}", name, a, b);
            }
        }
    }
}

fn some_camera() -> Camera {
    Camera::look_at([0.0, 1.0, -4.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], 0.8, 64, 48)
}

#[test]
fn frame_folders_of_meetroom() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    colmap_binary(&root.join("sparse/0"), &some_camera(), &["cam12.png", "cam00.png", "cam03.png"]);
    for frame in 0..5 {
        fs::create_dir_all(root.join(format!("frame{frame:06}/images"))).unwrap();
    }
    let set = cameras::open(root, Reading::Trained).unwrap();
    assert_eq!(set.format, Format::FrameFolders, "not plain COLMAP");
    let test: Vec<&str> = set.split(Split::Test).map(|camera| camera.name.as_str()).collect();
    assert_eq!(test.first(), Some(&"cam00/frame000000"), "sorted by camera, the first held out");
    assert_eq!((test.len(), set.views.len()), (5, 15), "three cameras, five frames");
    assert_eq!(set.times(), [0.0, 0.2, 0.4, 0.6, 0.8], "over the number of frames");
    assert_eq!(stored(root).times(), [0.0, 0.25, 0.5, 0.75, 1.0], "the last frame at 1");
}

#[test]
fn llff_photographs_and_bare_poses() {
    let folder = tempfile::tempdir().unwrap();
    let rows: Vec<[f64; 17]> = (0..9).map(|_| llff(&some_camera())).collect();
    let file = folder.path().join("poses_bounds.npy");
    write(&file, npy(&rows));
    let bare = stored(&file);
    assert_eq!((bare.views.len(), bare.times().len()), (9, 0), "no frames, no times");
    for k in 0..9 {
        write(&folder.path().join(format!("images/p{k}.jpg")), "");
    }
    let set = stored(folder.path());
    assert_eq!(set.split(Split::Test).count(), 2, "every eighth");
    assert_eq!(set.views[8].camera.name, "p8.jpg", "named by its photograph");
}

#[test]
fn dynerf_with_a_missing_video_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("poses_bounds.npy"), npy(&[llff(&some_camera()); 3]));
    write(&folder.path().join("cam00.mp4"), "");
    write(&folder.path().join("cam01.mp4"), "");
    let refused = cameras::open(folder.path(), Reading::Trained).unwrap_err().to_string();
    assert!(refused.contains("2 cameras") && refused.contains("3 rows"), "{refused}");
}

#[test]
fn a_model_folder_refers_to_its_data_set() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("output/lego");
    write(&model.join("cfg_args"), "Namespace(sh_degree=3, source_path='data/lego')");
    let missing = cameras::open(&model, Reading::Trained).unwrap_err().to_string();
    assert!(missing.contains("data/lego") && missing.contains("does not exist"), "{missing}");
    transforms(&folder.path().join("data/lego"), &some_camera());
    let set = cameras::open(&model, Reading::Trained).unwrap();
    assert_eq!(set.format, Format::Transforms, "found above the model");
    assert!(set.notes[0].contains("cfg_args"), "says how: {:?}", set.notes);
    let own = serde_json::json!([{ "width": 8, "height": 8, "position": [0, 0, 0], "fx": 5, "fy": 5,
        "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }]);
    write(&model.join("cameras.json"), own.to_string());
    let set = cameras::open(&model, Reading::Trained).unwrap();
    assert_eq!(set.format, Format::CamerasJson, "its own cameras come first");
}

#[test]
fn single_files_are_detected_by_content() {
    let folder = tempfile::tempdir().unwrap();
    let camera = some_camera();
    transforms(&folder.path().join("d"), &camera);
    fs::rename(folder.path().join("d/transforms_train.json"), folder.path().join("mine.json"))
        .unwrap();
    assert_eq!(stored(&folder.path().join("mine.json")).format, Format::Transforms, "by its keys");
    colmap_text(&folder.path().join("c/sparse/0"), &camera, "x.png");
    for path in ["c", "c/sparse/0", "c/sparse/0/images.txt"] {
        assert_eq!(stored(&folder.path().join(path)).format, Format::Colmap, "{path}");
    }
    nerfies(&folder.path().join("n"), &camera);
    let set = stored(&folder.path().join("n/dataset.json"));
    assert_eq!((set.format, set.views.len()), (Format::Nerfies, 1), "its folder is read");
}

#[test]
fn lens_models_are_read_or_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    colmap_text(root, &some_camera(), "x.png");
    let open = |lens: &str| {
        write(&root.join("cameras.txt"), format!("7 {lens}\n"));
        cameras::open(root, Reading::Stored)
    };
    for pinhole in [
        "SIMPLE_PINHOLE 64 48 50 32 24",
        "PINHOLE 64 48 50 50 32 24",
        "SIMPLE_RADIAL 64 48 50 32 24 0.1",
        "RADIAL 64 48 50 32 24 0.1 0.01",
        "OPENCV 64 48 50 50 32 24 0.1 0.01 0 0",
        "FULL_OPENCV 64 48 50 50 32 24 0.1 0.01 0 0 0 0 0 0",
    ] {
        let set = open(pinhole).unwrap();
        let k = set.views[0].camera.intrinsics;
        assert_eq!([k.fx, k.fy, k.cx, k.cy], [50.0, 50.0, 32.0, 24.0], "{pinhole}");
        let bent = pinhole.contains("0.1");
        assert_eq!(bent, set.notes.iter().any(|note| note.contains("distortion")), "{pinhole}");
    }
    for (name, params) in [
        ("OPENCV_FISHEYE", 8),
        ("FOV", 5),
        ("SIMPLE_RADIAL_FISHEYE", 4),
        ("RADIAL_FISHEYE", 5),
        ("THIN_PRISM_FISHEYE", 12),
        ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
        ("SIMPLE_DIVISION", 4),
        ("DIVISION", 5),
        ("SIMPLE_FISHEYE", 3),
        ("FISHEYE", 4),
        ("EUCM", 6),
        ("EQUIRECTANGULAR", 2),
    ] {
        let refused =
            open(&format!("{name} 64 48{}", " 1".repeat(params))).unwrap_err().to_string();
        assert!(refused.contains(name) && refused.contains("undistort"), "{refused}");
    }
    let unknown = open("PERFECT 64 48 1 1 1").unwrap_err().to_string();
    assert!(unknown.contains("line 1") && unknown.contains("PERFECT"), "{unknown}");
}

/// A COLMAP text model: lines of cameras and images, and images of 64×48 pixels.
fn colmap_model(root: &Path, cameras: &str, images: &[&str], files: &[&str]) {
    write(&root.join("sparse/0/cameras.txt"), cameras);
    let lines = images.join("\n\n") + "\n\n";
    write(&root.join("sparse/0/images.txt"), lines);
    for file in files {
        let path = root.join("images").join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        image::RgbImage::new(64, 48).save(path).unwrap();
    }
}

#[test]
fn images_in_subfolders_are_found() {
    let dir = tempfile::tempdir().unwrap();
    colmap_model(
        dir.path(),
        "1 PINHOLE 128 96 100 110 70 40\n",
        &["1 1 0 0 0 0.1 0 4 1 camA/0001.png", "2 1 0 0 0 0.2 0 4 1 camB\\0001.png"],
        &["camA/0001.png", "camB/0001.png"],
    );
    let set = cameras::open(dir.path(), Reading::Stored).unwrap();
    assert_eq!(set.views.len(), 2, "both");
    for view in &set.views {
        let camera = &view.camera;
        assert_eq!((camera.width, camera.height), (64, 48), "{}", camera.name);
        let k = camera.intrinsics;
        assert_eq!([k.fx, k.fy, k.cx, k.cy], [50.0, 55.0, 35.0, 20.0], "{}", camera.name);
    }
    assert!(set.notes.iter().all(|note| !note.contains("missing")), "{:?}", set.notes);
}

#[test]
fn an_unusable_lens_omits_only_its_images() {
    let dir = tempfile::tempdir().unwrap();
    let image = |id: u8, camera: u8| format!("{id} 1 0 0 0 0.{id} 0 4 {camera} {id}.png");
    let images = [image(1, 1), image(2, 2), image(3, 9), image(4, 1)];
    let images: Vec<&str> = images.iter().map(String::as_str).collect();
    let lenses =
        "1 PINHOLE 128 96 100 110 70 40\n2 OPENCV_FISHEYE 128 96 100 110 70 40 .1 .01 .001 .002\n";
    colmap_model(dir.path(), lenses, &images, &[]);
    let set = cameras::open(dir.path(), Reading::Trained).unwrap();
    let names: Vec<&str> = set.views.iter().map(|view| view.camera.name.as_str()).collect();
    assert_eq!(names, ["1.png", "4.png"], "those with a lens");
    assert_eq!(set.times(), [0.0, 0.75], "times are positions in the whole file");
    let notes = set.notes.join("; ");
    assert!(
        notes.contains("2 of 4 images are omitted") && notes.contains("OPENCV_FISHEYE"),
        "{notes}"
    );
    colmap_model(dir.path(), lenses, &images[1..2], &[]);
    let error = cameras::open(dir.path(), Reading::Trained).unwrap_err().to_string();
    assert!(error.contains("OPENCV_FISHEYE"), "none is left: {error}");
}

#[test]
fn camera_files_saved_on_windows() {
    let dir = tempfile::tempdir().unwrap();
    let text = r#"[{"img_name": "a", "width": 8, "height": 6, "position": [1, 2, 3], "rotation": [[1,0,0],[0,1,0],[0,0,1]], "fy": 5.0, "fx": 5.0}]"#;
    let units: Vec<u16> = text.encode_utf16().collect();
    let utf16: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
    for bytes in [[b"\xef\xbb\xbf", text.as_bytes()].concat(), [&b"\xff\xfe"[..], &utf16].concat()]
    {
        write(&dir.path().join("cameras.json"), &bytes);
        let set = cameras::open(&dir.path().join("cameras.json"), Reading::Stored).unwrap();
        assert_eq!(set.views[0].camera.position(), [1.0, 2.0, 3.0], "read");
        assert!(cameras::from_slice(&bytes, Reading::Stored).is_ok(), "from bytes");
    }
}
