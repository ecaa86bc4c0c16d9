//! Cameras of data sets in render, refine, freeze and info.

use crate::support::{c4d, failure, fixture, listing, success};
use gs_io::{Existing, ply};
use std::fs;
use std::path::Path;

fn text(path: &Path) -> String {
    path.to_str().unwrap().to_owned()
}

fn images(folder: &Path) -> Vec<String> {
    listing(folder).into_iter().filter(|name| Path::new(name).extension().is_some()).collect()
}

/// Renders a 4DGS fixture through the cameras of a fixture; the folder's images and the messages.
fn render(model: &str, data: &str, more: &[&str], output: &Path) -> (Vec<String>, String) {
    let scene = text(&fixture("deform4dgs").join(model).join("model"));
    let cameras = text(&fixture("cameras").join(data));
    let mut command = c4d(["render", &scene, "--cameras", &cameras, "-w", "-g", "cpu", "-o"]);
    let (_, stderr) = success(command.arg(output).args(more));
    (images(output), stderr)
}

#[test]
fn views_are_rendered_at_their_own_times() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let small = ["--size", "24x24"];
    let (found, stderr) = render("dnerf_like", "dnerf", &small, &out);
    assert_eq!(found, ["rgb/00000.png", "rgb/00001.png"], "the two held-out views");
    assert!(stderr.contains("2 held-out views of 6") && stderr.contains("800×800"), "{stderr}");

    let all = [small.as_slice(), &["--split", "all"]].concat();
    let (found, stderr) = render("dnerf_like", "dnerf", &all, &out);
    assert_eq!(found.len(), 5, "train, test and val but for the one beyond the last time");
    assert!(stderr.contains("1 of 6 views are outside"), "the message: {stderr}");

    let cam = [small.as_slice(), &["--views", "cam01"]].concat();
    let (found, _) = render("dynerf_like", "dynerf", &cam, &out);
    assert_eq!(found.len(), 4, "one camera, its four frames");

    let requested = [small.as_slice(), &["--split", "train", "--times", "0,1"]].concat();
    let (found, _) = render("dynerf_like", "dynerf", &requested, &out);
    let expected: Vec<String> = ["000_cam01", "001_cam02"]
        .iter()
        .flat_map(|camera| [0, 1].map(|frame| format!("{camera}/rgb/{frame:05}.png")))
        .collect();
    assert_eq!(found, expected, "other times: each camera once, at all of them");

    let clip = folder.path().join("clip.mp4");
    let scene = text(&fixture("deform4dgs/dnerf_like/model"));
    let cameras = text(&fixture("cameras/dnerf"));
    let flags = ["--split", "path", "--size", "16x16", "-g", "cpu", "-o", &text(&clip)];
    success(c4d(["render", &scene, "--cameras", &cameras]).args(flags));
    assert!(fs::metadata(&clip).unwrap().len() > 1000, "160 frames of the turn");
}

#[test]
fn readings_differ_where_the_reference_has_sign_errors() {
    let folder = tempfile::tempdir().unwrap();
    let image = |reading: &str| {
        let out = folder.path().join(reading);
        let flags =
            ["--size", "32x32", "--split", "train", "--views", "1", "--cameras-as", reading];
        render("dnerf_like", "dnerf", &flags, &out);
        fs::read(out.join("rgb/00000.png")).unwrap()
    };
    assert_ne!(image("trained"), image("stored"), "frame 1 does not look at the origin");
}

#[test]
fn frozen_with_the_cameras_of_a_data_set() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("frozen");
    let (source, cameras) = (text(&fixture("synth/source")), text(&fixture("cameras/dynerf")));
    success(&mut c4d(["freeze", &source, "--cameras", &cameras, "-o", &text(&out)]));
    let (written, _) = gs_io::cameras_json::read_file(&out.join("cameras.json")).unwrap();
    let names: Vec<&str> = written.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["cam00", "cam01", "cam02"], "each camera once");
    assert_eq!(written[0].width, 2704, "a PLY sequence has no training reading: full size");
}

#[test]
fn refined_from_a_data_set() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let model = text(&fixture("deform4dgs/dynerf_like/model"));
    success(&mut c4d(["freeze", &model, "-o", &text(&at("frozen"))]));
    let mut splats = ply::read_file(&at("frozen/point_cloud.ply")).unwrap().splats;
    for i in (0..splats.len()).filter(|i| i % 2 == 0) {
        splats.sh[i * 16] = [1.0, -0.5, 0.2];
    }
    let edited = at("edited.ply");
    ply::write_file(&edited, &splats, &ply::WriteOptions::default(), Existing::Refuse).unwrap();
    let (run, cameras) = (text(&at("run")), text(&fixture("cameras/dynerf")));
    let arguments =
        ["propagate", &model, "--edited", &text(&edited), "-o", &run, "--refine-cameras", &cameras];
    let flags = ["--refine-size", "24x24", "--refine-frames", "3", "--samples", "6"];
    success(c4d(arguments).args(flags).args(["-g", "cpu"]));
    let config = fs::read_to_string(at("run/c4d.toml")).unwrap();
    assert!(config.contains("cameras/dynerf"), "the cameras are recorded: {config}");
    let report = fs::read_to_string(at("run/refine.json")).unwrap();
    let used = report.contains("cam01") && report.contains("cam02");
    assert!(used && !report.contains("cam00"), "held-out cameras are not used: {report}");
}

#[test]
fn info_names_data_sets() {
    let info = |path: &Path| success(&mut c4d(["info".to_owned(), text(path)])).0;
    for (kind, expected) in [
        ("dnerf", "D-NeRF"),
        ("dynerf", "DyNeRF"),
        ("hypernerf_split", "HyperNeRF"),
        ("colmap", "COLMAP"),
        ("multipleview", "multiple-view"),
        ("colmap/sparse/0", "COLMAP"),
        ("dnerf/transforms_val.json", "D-NeRF"),
    ] {
        let stderr = info(&fixture("cameras").join(kind));
        for part in [expected, "views", "times", "sizes", "next"] {
            assert!(stderr.contains(part), "{kind}: expected `{part}` in {stderr}");
        }
    }
    let model = info(&fixture("deform4dgs/dnerf_like/model"));
    assert!(model.contains("cameras      none, a rig is used instead"), "{model}");
    let several = info(&fixture("synth"));
    assert!(several.contains("source: PLY sequence"), "a folder with several inputs: {several}");
    let json = success(&mut c4d([
        "info".to_owned(),
        text(&fixture("cameras/hypernerf_split")),
        "--json".to_owned(),
    ]));
    let json: serde_json::Value = serde_json::from_str(&json.0).unwrap();
    assert_eq!(json["views"], 10, "a number");
    assert_eq!(json["note"].as_array().map(Vec::len), Some(3), "notes are a list");
}

#[test]
fn invalid_cameras_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let source = text(&fixture("synth/source"));
    let out = text(&folder.path().join("out"));
    let render = |more: &[&str], code: i32, expected: &[&str]| {
        let stderr = failure(c4d(["render", &source, "-o", &out]).args(more), code);
        for part in expected.iter().chain(&["next: "]) {
            assert!(stderr.contains(part), "expected `{part}` in: {stderr}");
        }
        assert!(!Path::new(&out).exists(), "no output");
    };
    let dnerf = text(&fixture("cameras/dnerf"));
    render(&["--cameras", "absent"], 3, &["absent"]);
    render(&["--split", "test"], 2, &["--cameras PATH"]);
    render(&["--cameras", &dnerf, "--views", "r_9"], 2, &["r_9", "train/r_000"]);
    let colmap = text(&fixture("cameras/colmap"));
    render(&["--cameras", &colmap, "--split", "val"], 2, &["train 7, test 2, val 0"]);
    render(&["--cameras", &source], 3, &["contains no cameras"]);

    let fisheye = folder.path().join("fisheye");
    fs::create_dir(&fisheye).unwrap();
    fs::write(fisheye.join("cameras.txt"), "1 OPENCV_FISHEYE 64 48 50 50 32 24 0 0 0 0\n").unwrap();
    fs::write(fisheye.join("images.txt"), "1 1 0 0 0 0 0 0 1 a.png\n\n").unwrap();
    render(&["--cameras", &text(&fisheye)], 3, &["OPENCV_FISHEYE", "image_undistorter"]);

    let broken = folder.path().join("broken.json");
    fs::write(&broken, "{\"frames\": [").unwrap();
    render(&["--cameras", &text(&broken)], 3, &["broken.json", "line 1"]);
    failure(&mut c4d(["info".to_owned(), text(&broken)]), 3);

    let stderr = failure(&mut c4d(["render", &dnerf, "-o", &out]), 3);
    assert!(
        stderr.contains("no splats") && stderr.contains("--cameras"),
        "data sets do not render: {stderr}"
    );
}
