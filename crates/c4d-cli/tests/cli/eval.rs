//! `c4d eval`.

use crate::support::{c4d, failure, fixture, success};
use crate::synth_run::synth_run;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn value(document: &Value, id: &str) -> Value {
    let items = document["items"].as_array().unwrap();
    items.iter().find(|item| item["id"] == id).unwrap_or_else(|| panic!("no {id}"))["value"].clone()
}

#[test]
fn metrics_are_the_same_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let run = synth_run(folder.path());
    let mut files = Vec::new();
    for threads in ["1", "2", "7"] {
        let file = folder.path().join(format!("{threads}.json"));
        let (stdout, _) = success(
            c4d(["eval"])
                .arg(&run)
                .args(["--frames", "4", "--size", "96x72", "--threads", threads, "-o"])
                .arg(&file),
        );
        assert!(stdout.contains("warp_error_ratio") && stdout.contains("→1"), "a table: {stdout}");
        assert!(stdout.contains("not measured (no ground truth given (--truth))"), "{stdout}");
        files.push(std::fs::read_to_string(file).unwrap());
    }
    assert!(files[0] == files[1] && files[1] == files[2], "the same file");
    let document: Value = serde_json::from_str(&files[0]).unwrap();
    assert_eq!(document["source"], "render", "no video");
    assert_eq!(document["frames"], 4, "frames");
    assert_eq!(value(&document, "bg_changed_frac"), 0.0, "the background is kept");
    assert_eq!(value(&document, "drift_max"), 0.0, "unedited splats keep their motion");
    assert!(value(&document, "psnr").is_null(), "without a truth");
    assert!(value(&document, "time_total").is_number(), "recorded by the run");
}

#[test]
fn a_run_is_its_own_truth() {
    let folder = tempfile::tempdir().unwrap();
    let run = synth_run(folder.path());
    let file = folder.path().join("metrics.json");
    let (stdout, _) = success(
        c4d(["eval"])
            .arg(&run)
            .args(["--frames", "3", "--size", "96x72", "--metrics", "truth,drift", "--truth"])
            .arg(&run)
            .arg("-o")
            .arg(&file),
    );
    assert!(!stdout.contains("warp_error"), "only the requested metrics: {stdout}");
    let document: Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    assert_eq!(value(&document, "psnr"), 100.0, "equal");
    assert_eq!(value(&document, "flip"), 0.0, "equal");
    assert_eq!(document["items"].as_array().unwrap().len(), 6, "five and one");
}

#[test]
fn pictures_of_a_data_set_are_found_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let source = fixture("synth/source");
    let cameras = folder.path().join("cameras");
    success(
        c4d(["freeze"]).arg(&source).args(["--views", "2", "--size", "96x72", "-o"]).arg(&cameras),
    );
    let (stdout, _) = success(
        c4d(["eval"])
            .arg(&source)
            .args(["--times", "0", "--cameras"])
            .arg(cameras.join("cameras.json"))
            .arg("--truth")
            .arg(cameras.join("views")),
    );
    assert!(
        stdout.contains("psnr") && stdout.contains(" 100 "),
        "renders equal their pictures: {stdout}"
    );
}

/// A data set in the layout of D-NeRF: four views on a circle, each at its own time.
fn data_set(folder: &Path) -> PathBuf {
    let set = folder.join("set");
    std::fs::create_dir_all(set.join("test")).unwrap();
    let frame = |i: i32| {
        let (sin, cos) = (0.4 * f64::from(i)).sin_cos();
        serde_json::json!({
            "file_path": format!("./test/r_{i:03}"),
            "time": f64::from(i) / 3.0,
            // Camera to world, OpenGL axes: four units from the figure, at the height of its hips.
            "transform_matrix": [
                [cos, 0.0, sin, 4.0 * sin],
                [0.0, 1.0, 0.0, 0.9],
                [-sin, 0.0, cos, 4.0 * cos],
                [0.0, 0.0, 0.0, 1.0],
            ],
        })
    };
    for split in ["train", "val", "test"] {
        let frames: Vec<Value> = (0..4).map(frame).collect();
        let text = serde_json::json!({ "camera_angle_x": 0.7, "frames": frames });
        std::fs::write(set.join(format!("transforms_{split}.json")), text.to_string()).unwrap();
    }
    set
}

#[test]
fn photographs_of_a_data_set_are_compared_at_their_times() {
    let folder = tempfile::tempdir().unwrap();
    let (source, set) = (fixture("synth/source"), data_set(folder.path()));
    let renders = folder.path().join("renders");
    success(
        c4d(["render"])
            .arg(&source)
            .arg("--cameras")
            .arg(&set)
            .args(["--split", "test", "--size", "64x64", "-o"])
            .arg(&renders),
    );
    let photo = |i: usize| set.join(format!("test/r_{i:03}.png"));
    for i in 0..4 {
        std::fs::copy(renders.join(format!("rgb/{i:05}.png")), photo(i)).unwrap();
    }
    let psnr = |name: &str| {
        let file = folder.path().join(name);
        let (stdout, stderr) = success(
            c4d(["eval"])
                .arg(&source)
                .arg("--cameras")
                .arg(&set)
                .args(["--split", "test", "--metrics", "truth", "--truth"])
                .arg(&set)
                .arg("-o")
                .arg(&file),
        );
        let document: Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
        value(&document, "psnr").as_f64().unwrap_or_else(|| panic!("{stdout}{stderr}"))
    };
    assert_eq!(psnr("same.json"), 100.0, "the photographs are the renders");
    // Two photographs are swapped.
    std::fs::copy(renders.join("rgb/00003.png"), photo(0)).unwrap();
    std::fs::copy(renders.join("rgb/00000.png"), photo(3)).unwrap();
    let exchanged = psnr("exchanged.json");
    assert!(exchanged < 70.0, "photographs of other times: {exchanged}");
}

#[test]
fn requests_that_cannot_be_measured_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let run = synth_run(folder.path());
    let eval = |args: &[&str], code: i32| failure(c4d(["eval"]).arg(&run).args(args), code);
    let stderr = eval(&["--metrics", "lpips"], 2);
    assert!(
        stderr.contains("no such metric or group") && stderr.contains("Groups: core"),
        "{stderr}"
    );
    let video = folder.path().join("truth.mp4");
    std::fs::write(&video, b"no video").unwrap();
    let stderr = eval(&["--truth", video.to_str().unwrap()], 2);
    assert!(stderr.contains("compressed video"), "{stderr}");
    let stderr = eval(&["--truth", "nowhere"], 3);
    assert!(stderr.contains("no such file"), "{stderr}");
    let stderr = eval(&["--views", "0"], 2);
    assert!(stderr.contains("Add --cameras"), "{stderr}");
    let inside = run.join("metrics.json");
    let stderr = eval(&["--frames", "2", "-o", inside.to_str().unwrap()], 2);
    assert!(stderr.contains("overlap"), "{stderr}");
    assert!(!inside.exists(), "nothing is left");
}

#[test]
fn pairs_for_judges_are_written_and_scores_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let run = synth_run(folder.path());
    let at = |name: &str| folder.path().join(name);
    for (judge, jobs) in [("editscore", 6), ("vebench", 2)] {
        let out = at(judge);
        let (stdout, _) = success(
            c4d(["eval"])
                .arg(&run)
                .args(["--frames", "3", "--size", "48x36", "--prompt", "a hat", "--emit", judge])
                .arg(&out),
        );
        assert!(stdout.contains(&format!("({jobs} jobs)")), "{stdout}");
        let text = std::fs::read_to_string(out.join("jobs.jsonl")).unwrap();
        assert_eq!(text.lines().count(), jobs, "{judge}");
        for line in text.lines() {
            let job: Value = serde_json::from_str(line).unwrap();
            for side in ["src", "dst"] {
                assert!(out.join(job[side].as_str().unwrap()).exists(), "{line}");
            }
            assert_eq!(job["prompt"], "a hat", "{line}");
        }
    }
    let scores = at("scores.jsonl");
    std::fs::write(&scores, "{\"id\":\"view_00/00000\",\"scores\":{\"overall\":7}}\n").unwrap();
    let file = at("metrics.json");
    let (stdout, _) = success(
        c4d(["eval"])
            .arg(&run)
            .args(["--frames", "2", "--size", "48x36", "--metrics", "drift", "--ingest"])
            .arg(&scores)
            .arg("-o")
            .arg(&file),
    );
    assert!(stdout.contains("judged: overall 7"), "{stdout}");
    let document: Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    assert_eq!(document["judged"][0]["value"], 7.0, "merged");
    let stderr = failure(c4d(["eval"]).arg(&run).args(["--prompt", "x", "--emit", "clip", "x"]), 2);
    assert!(stderr.contains("expected editscore or vebench"), "{stderr}");
}
