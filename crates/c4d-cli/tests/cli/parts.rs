//! `--part` of `c4d render`, `eval` and `refine`, and `c4d gather`: the same bytes as one call.

use crate::support::{c4d, failure, fixture, listing, success};
use crate::synth_run::synth_run;
use gs_io::{Existing, ply};
use std::path::{Path, PathBuf};

/// Makes all parts of `command` (without `-o`), and returns them in reverse order.
fn parts(folder: &Path, of: usize, command: &[&str]) -> Vec<PathBuf> {
    let make = |part: usize| {
        let output = folder.join(format!("part{part}"));
        success(c4d(command).args(["--part", &format!("{part}/{of}"), "-o"]).arg(&output));
        output
    };
    (1..=of).rev().map(make).collect()
}

fn gather(parts: &[PathBuf], output: &Path) {
    success(c4d(["gather"]).args(parts).arg("-o").arg(output));
}

fn same_folder(a: &Path, b: &Path) {
    let files = listing(a);
    assert_eq!(files, listing(b), "the same files");
    for name in files {
        let [one, other] = [a, b].map(|folder| std::fs::read(folder.join(&name)).unwrap());
        assert!(one == other, "{name} differs");
    }
}

fn same_file(a: &Path, b: &Path) {
    let [one, other] = [a, b].map(|path| std::fs::read(path).unwrap());
    assert!(one == other, "{} and {} differ", a.display(), b.display());
}

#[test]
fn gathered_images_equal_those_of_a_single_call() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (source, cameras) = (fixture("synth/source"), fixture("cameras/dynerf"));
    let (source, cameras) = (source.to_str().unwrap(), cameras.to_str().unwrap());
    // Three views at three times: parts of the nine images begin in the middle of a time.
    let command = [
        "render",
        source,
        "--cameras",
        cameras,
        "--split",
        "all",
        "--frames",
        "3",
        "--size",
        "48x36",
        "--passes",
        "rgb,depth",
        "-g",
        "cpu",
    ];
    success(c4d(command).arg("-o").arg(at("whole")));
    let made = parts(folder.path(), 4, &command);
    gather(&made, &at("gathered"));
    same_folder(&at("whole"), &at("gathered"));
    // More parts than images.
    let few = ["render", source, "--frames", "2", "--size", "48x36", "-g", "cpu"];
    std::fs::create_dir(at("few")).unwrap();
    success(c4d(few).arg("-o").arg(at("two")));
    gather(&parts(&at("few"), 3, &few), &at("gathered_two"));
    same_folder(&at("two"), &at("gathered_two"));
}

#[test]
fn gathered_videos_equal_those_of_a_single_call() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let run = synth_run(folder.path());
    let run = run.to_str().unwrap();
    let command = [
        "render",
        run,
        "--cameras",
        "orbit",
        "--frames",
        "14",
        "--size",
        "96x64",
        "--fps",
        "12",
        "--side-by-side",
        "-g",
        "cpu",
    ];
    let made = parts(folder.path(), 3, &command);
    for name in ["clip.mp4", "clip.gif", "clip.webp", "sheet.png"] {
        let sheet = name == "sheet.png";
        let flags: Vec<&str> = command
            .iter()
            .filter(|flag| !sheet || !["--fps", "12"].contains(flag))
            .copied()
            .collect();
        success(c4d(flags).arg("-o").arg(at(&format!("whole_{name}"))));
        gather(&made, &at(name));
        same_file(&at(&format!("whole_{name}")), &at(name));
    }
}

#[test]
fn gathered_metrics_equal_those_of_a_single_call() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let run = synth_run(folder.path());
    let (run, cameras) = (run.to_str().unwrap(), fixture("cameras/dynerf"));
    let command = [
        "eval",
        run,
        "--cameras",
        cameras.to_str().unwrap(),
        "--split",
        "all",
        "--frames",
        "3",
        "--size",
        "48x36",
        "--truth",
        run,
        "-g",
        "cpu",
    ];
    let (table, _) = success(c4d(command).arg("-o").arg(at("whole.json")));
    for of in [2, 5] {
        let parts = parts(folder.path(), of, &command);
        let gathered = at(&format!("gathered{of}.json"));
        let (stdout, _) = success(c4d(["gather"]).args(&parts).arg("-o").arg(&gathered));
        same_file(&at("whole.json"), &gathered);
        assert_eq!(table, stdout, "the same table");
        for part in &parts {
            std::fs::remove_file(part).unwrap();
        }
    }
}

#[test]
fn a_gathered_refinement_equals_that_of_a_single_call() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    // View-dependent colours, so that images are needed.
    let model = fixture("deform4dgs/dynerf_like/model");
    success(c4d(["freeze"]).arg(&model).arg("-o").arg(at("frozen")));
    let mut splats = ply::read_file(&at("frozen/point_cloud.ply")).unwrap().splats;
    for i in (0..splats.len()).step_by(2) {
        splats.sh[i * 16] = [1.0, -0.5, 0.2];
    }
    let edited = at("edited.ply");
    ply::write_file(&edited, &splats, &ply::WriteOptions::default(), Existing::Refuse).unwrap();
    let [whole, run] = [at("whole"), at("run")];
    for run in [&whole, &run] {
        success(
            c4d(["propagate"])
                .arg(&model)
                .arg("--edited")
                .arg(&edited)
                .args(["--no-refine", "-o"])
                .arg(run),
        );
    }
    let text = run.to_str().unwrap();
    let flags = ["--refine-size", "48x36", "--refine-frames", "3", "--samples", "12", "-g", "cpu"];
    let before = std::fs::read(run.join("scene.c4d")).unwrap();
    let command: Vec<&str> = ["refine", text].into_iter().chain(flags).collect();
    let made = parts(folder.path(), 3, &command);
    assert_eq!(std::fs::read(run.join("scene.c4d")).unwrap(), before, "parts leave the run alone");
    success(c4d(["refine"]).arg(&whole).args(flags));
    let (_, stderr) = success(c4d(["gather", "-g", "cpu"]).args(&made).arg("-o").arg(&run));
    assert!(stderr.contains("images already exist"), "the images of the parts: {stderr}");
    same_file(&whole.join("scene.c4d"), &run.join("scene.c4d"));
    assert!(before != std::fs::read(run.join("scene.c4d")).unwrap(), "the run is refined");
    assert!(!run.join("refine.images").exists(), "and nothing is left over");
    // The run has changed after the parts were made.
    let stderr = failure(c4d(["gather", "-g", "cpu"]).args(&made).arg("-o").arg(&run), 2);
    assert!(stderr.contains("is not the run of which"), "{stderr}");
}

#[test]
fn parts_that_do_not_fit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let source = fixture("synth/source");
    let source = source.to_str().unwrap();
    let command = ["render", source, "--frames", "4", "--size", "48x36", "-g", "cpu"];
    let made = parts(folder.path(), 3, &command);
    let refusal = |parts: &[&Path], code: i32| {
        let stderr = failure(c4d(["gather"]).args(parts).arg("-o").arg(at("joined")), code);
        assert!(!at("joined").exists(), "nothing is written: {stderr}");
        stderr
    };
    let [third, second, first] = [&made[0], &made[1], &made[2]].map(PathBuf::as_path);
    let stderr = refusal(&[first, third], 2);
    assert!(stderr.contains("part 2 of 3 missing") && stderr.contains("--part 2/3"), "{stderr}");
    let stderr = refusal(&[first, second, second, third], 2);
    assert!(stderr.contains("both part 2 of 3"), "{stderr}");
    std::fs::create_dir(at("smaller")).unwrap();
    let smaller = ["render", source, "--frames", "4", "--size", "40x36", "-g", "cpu"];
    let other = parts(&at("smaller"), 3, &smaller);
    let stderr = refusal(&[first, &other[1], third], 2);
    assert!(stderr.contains("different work: cameras differs"), "{stderr}");
    let image = listing(second).into_iter().find(|name| name.starts_with("rgb")).unwrap();
    let bytes = std::fs::read(second.join(&image)).unwrap();
    std::fs::write(second.join(&image), &bytes[1..]).unwrap();
    let stderr = refusal(&[first, second, third], 3);
    assert!(
        stderr.contains(&image) && stderr.contains("was changed after it was written"),
        "{stderr}"
    );
    std::fs::remove_file(second.join(&image)).unwrap();
    let stderr = refusal(&[first, second, third], 3);
    assert!(stderr.contains("is missing"), "{stderr}");
    let stderr = refusal(&[first, Path::new(source), third], 3);
    assert!(stderr.contains("is not a part"), "{stderr}");
    let stderr = refusal(&[&fixture("synth/edited.ply")], 3);
    assert!(stderr.contains("is not a part"), "{stderr}");
    let stderr = refusal(&[&at("none")], 3);
    assert!(stderr.contains("no such part"), "{stderr}");
    std::fs::write(first.join("part.json"), "{\"part\": 1}").unwrap();
    let stderr = refusal(&[first], 3);
    assert!(stderr.contains("part.json"), "{stderr}");

    let video = ["render", source, "--part", "1/2", "-o", "clip.mp4"];
    let stderr = failure(&mut c4d(video), 2);
    assert!(stderr.contains("--part writes a folder") && stderr.contains("c4d gather"), "{stderr}");
    let stderr = failure(&mut c4d(["render", source, "--part", "3/2", "-o", "x"]), 2);
    assert!(stderr.contains("expected K/N"), "{stderr}");
}
