//! The main workflow end to end, on a small synthetic scene with
//! ground truth and on a small 4DGS model.

use crate::support::{c4d, failure, fixture, listing, success};
use gs_core::{DynamicScene, Splats};
use gs_io::{Existing, ply};
use std::path::Path;

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn frames(folder: &Path) -> Vec<Splats> {
    let mut names = listing(folder);
    names.retain(|name| Path::new(name).extension().is_some_and(|extension| extension == "ply"));
    names.iter().map(|name| ply::read_file(&folder.join(name)).unwrap().splats).collect()
}

/// Mean distance of the centres, relative to the size of the cloud.
fn mean_error(found: &Splats, expected: &Splats) -> f64 {
    let (min, max) = expected.bounds().unwrap();
    let size = (0..3).map(|k| f64::from(max[k] - min[k])).fold(0.0, f64::max);
    let total: f64 = found
        .means
        .iter()
        .zip(&expected.means)
        .map(|(a, b)| (0..3).map(|k| f64::from(a[k] - b[k]).powi(2)).sum::<f64>().sqrt())
        .sum();
    total / found.len() as f64 / size
}

#[test]
fn edit_is_propagated_and_exported() {
    let folder = tempfile::tempdir().unwrap();
    let (run, out) = (folder.path().join("run"), folder.path().join("out"));
    let source = fixture("synth/source");
    let edited = fixture("synth/edited.ply");
    let (_, stderr) = success(&mut c4d([
        "propagate",
        path(&source),
        "--no-refine",
        "--edited",
        path(&edited),
        "-o",
        path(&run),
    ]));
    assert!(stderr.contains("unchanged (exact)"), "reports the identity map: {stderr}");
    assert_eq!(listing(&run), ["c4d.toml", "report.html", "run.json", "scene.c4d"], "run folder");
    success(&mut c4d(["export", path(&run), "--to", "ply-seq", "--frames", "3", "-o", path(&out)]));
    let exported = frames(&out);
    let truth = frames(&fixture("synth/truth"));
    assert_eq!(exported.len(), 3, "frames");
    let frame_1 = ply::read_file(&edited).unwrap().splats;
    assert_eq!(exported[0], frame_1, "the edited frame is returned unchanged");
    for (frame, (found, expected)) in exported.iter().zip(&truth).enumerate() {
        let error = mean_error(found, expected);
        assert!(error < 0.0005, "frame {frame}: mean error {error} of the scene's size");
    }
    // Exported files, read back from disk, equal the scene.
    let frozen = folder.path().join("frozen");
    success(&mut c4d(["freeze", path(&run), "--time", "0.5", "-o", path(&frozen)]));
    assert_eq!(
        ply::read_file(&frozen.join("point_cloud.ply")).unwrap().splats,
        exported[1],
        "frame at 0.5"
    );
    // Negative control: without motion the same measure fails.
    let still = mean_error(&frame_1, &truth[1]);
    assert!(still > 0.003, "the scene moves: {still}");
}

#[test]
fn shuffled_unedited_splats_move_exactly_like_the_source() {
    let folder = tempfile::tempdir().unwrap();
    let (run, out) = (folder.path().join("run"), folder.path().join("out"));
    let source = fixture("synth/source");
    let originals = frames(&source);
    let order: Vec<usize> =
        (0..originals[0].len()).map(|i| (i * 7919 + 13) % originals[0].len()).collect();
    let shuffled = folder.path().join("shuffled.ply");
    let first = originals[0].select(&order);
    ply::write_file(&shuffled, &first, &ply::WriteOptions::default(), Existing::Refuse).unwrap();
    success(&mut c4d([
        "propagate",
        path(&source),
        "--no-refine",
        "--edited",
        path(&shuffled),
        "-o",
        path(&run),
    ]));
    success(&mut c4d(["export", path(&run), "--to", "ply-seq", "--frames", "3", "-o", path(&out)]));
    for (found, original) in frames(&out).iter().zip(&originals) {
        assert_eq!(*found, original.select(&order), "bit for bit");
    }
}

#[test]
fn model_4dgs_freezes_propagates_renders_exports() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let model = fixture("deform4dgs/dnerf_like/model");
    let (shown, _) = success(&mut c4d(["info", path(&model)]));
    assert!(shown.contains("20000"), "newest iteration, numerically: {shown}");
    success(&mut c4d(["freeze", path(&model), "-o", path(&at("frozen"))]));
    assert_eq!(listing(&at("frozen")), ["cameras.json", "point_cloud.ply"], "frozen");
    let frozen = at("frozen/point_cloud.ply");
    let mut edited = ply::read_file(&frozen).unwrap().splats;
    for mean in edited.means.iter_mut().step_by(3) {
        mean[2] += 0.01;
    }
    ply::write_file(&at("edited.ply"), &edited, &ply::WriteOptions::default(), Existing::Refuse)
        .unwrap();
    for (name, extra) in [
        ("run", vec![]),
        ("paper", vec!["--preset", "paper"]),
        ("all", vec!["--motion", "all"]),
        ("knn", vec!["--baseline", "knn"]),
        ("net", vec!["--baseline", "deformnet"]),
    ] {
        let (edited, output) = (at("edited.ply"), at(name));
        let mut arguments = vec![
            "propagate",
            path(&model),
            "--edited",
            path(&edited),
            "--no-refine",
            "-o",
            path(&output),
        ];
        arguments.extend(extra);
        success(&mut c4d(arguments));
    }
    let run = at("run");
    let cameras = at("frozen/cameras.json");
    let size = ["--size", "64x48", "--times", "0,0.5"];
    let render = |extra: &[&str], output: &Path| {
        let mut arguments = vec!["render", path(&run), "-o", path(output)];
        arguments.extend(size);
        arguments.extend(extra);
        success(&mut c4d(arguments));
    };
    render(&["--side-by-side"], &at("clip.mp4"));
    render(&["--cameras", "orbit"], &at("sheet.png"));
    render(&["--passes", "rgb,alpha,depth"], &at("png"));
    render(&["--passes", "flow,uncertainty,mask"], &at("relative"));
    render(&["--passes", "flow", "--format", "flo"], &at("flo"));
    render(&["--passes", "flow", "--format", "exr"], &at("flow_exr"));
    render(&["--format", "exr", "--passes", "rgb,depth", "--cameras", "spiral"], &at("exr"));
    render(&["--format", "npy", "--cameras", path(&cameras), "--views", "front,3"], &at("npy"));
    assert_eq!(listing(&at("png")).len(), 6, "two times, three passes");
    assert_eq!(listing(&at("relative")).len(), 6, "two times, three passes");
    assert_eq!(listing(&at("flo")), ["flow/00000.flo", "flow/00001.flo"], "Middlebury files");
    assert_eq!(listing(&at("exr")).len(), 4, "two times, two passes");
    assert_eq!(listing(&at("npy")).len(), 4, "two times, two views");
    let clip = std::fs::read(at("clip.mp4")).unwrap();
    assert_eq!(&clip[4..8], b"ftyp", "an MP4 file");
    success(&mut c4d([
        "export",
        path(&run),
        "--to",
        "zip",
        "--frames",
        "2",
        "-o",
        path(&at("frames.zip")),
    ]));
    success(&mut c4d(["info", path(&run), "--json"]));
    // An edit of an edit.
    let again = at("again");
    success(&mut c4d(["freeze", path(&run), "-o", path(&at("frozen2"))]));
    let frozen2 = at("frozen2/point_cloud.ply");
    success(&mut c4d([
        "propagate",
        path(&run),
        "--no-refine",
        "--edited",
        path(&frozen2),
        "-o",
        path(&again),
    ]));
    success(&mut c4d([
        "export",
        path(&run),
        "--to",
        "ply-seq",
        "--frames",
        "3",
        "-o",
        path(&at("one")),
    ]));
    success(&mut c4d([
        "export",
        path(&again),
        "--to",
        "ply-seq",
        "--frames",
        "3",
        "-o",
        path(&at("two")),
    ]));
    assert_eq!(frames(&at("one")), frames(&at("two")), "an unedited run propagates to itself");
}

fn is_recoloured(mean: [f32; 3]) -> bool {
    mean[2] > 0.0
}

/// Freezes `model`, recolours and stretches one half of it, and writes it to `edited`.
pub(crate) fn recoloured(model: &Path, folder: &Path, edited: &Path) {
    let frozen = folder.join("frozen");
    success(&mut c4d(["freeze", path(model), "-o", path(&frozen)]));
    let frozen = ply::read_file(&frozen.join("point_cloud.ply")).unwrap().splats;
    let mut splats = frozen.clone();
    for i in (0..splats.len()).filter(|&i| is_recoloured(frozen.means[i])) {
        splats.means[i][0] *= 1.02;
        splats.sh[i * 16] = [1.0, -0.5, 0.2];
        splats.sh[i * 16 + 1..(i + 1) * 16].fill([0.0; 3]);
    }
    ply::write_file(edited, &splats, &ply::WriteOptions::default(), Existing::Refuse).unwrap();
}

/// Only colours of edited rows may change; and `c4d refine` equals the refinement stage of
/// `c4d propagate`.
#[test]
fn refinement_changes_only_edited_colours() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let model = fixture("deform4dgs/dynerf_like/model");
    let edited = at("edited.ply");
    recoloured(&model, folder.path(), &edited);
    // results depend on the rasteriser, but not on the number of threads
    let refine =
        ["--refine-size", "96x72", "--refine-frames", "3", "--samples", "12", "--gpu", "cpu"];
    let (plain, refined) = (at("plain"), at("refined"));
    let propagate = |run: &Path, extra: &[&str]| {
        let mut arguments =
            vec!["propagate", path(&model), "--edited", path(&edited), "-o", path(run)];
        arguments.extend(extra);
        success(&mut c4d(arguments));
    };
    propagate(&plain, &["--no-refine"]);
    propagate(&refined, &refine);
    assert_eq!(
        listing(&refined),
        ["c4d.toml", "refine.json", "report.html", "run.json", "scene.c4d"],
        "run folder"
    );
    for (run, out) in [(&plain, at("a")), (&refined, at("b"))] {
        success(&mut c4d([
            "export",
            path(run),
            "--to",
            "ply-seq",
            "--frames",
            "3",
            "-o",
            path(&out),
        ]));
    }
    let first = ply::read_file(&edited).unwrap().splats;
    let mut changed = 0;
    for (before, after) in frames(&at("a")).iter().zip(&frames(&at("b"))) {
        assert_eq!(before.means, after.means, "motion stays");
        assert_eq!(before.opacity_logits, after.opacity_logits, "opacity stays");
        for i in 0..before.len() {
            let same = before.sh_of(i) == after.sh_of(i);
            assert!(same || is_recoloured(first.means[i]), "row {i} was not edited");
            changed += usize::from(!same);
        }
    }
    assert!(changed > 100, "refinement changes colours: {changed} rows");
    let mut arguments = vec!["refine", path(&plain)];
    arguments.extend(refine);
    success(&mut c4d(arguments));
    let scene = |run: &Path| std::fs::read(run.join("scene.c4d")).unwrap();
    assert!(scene(&plain) == scene(&refined), "the same, bit for bit");
}

/// A refinement that is killed twice gives the same result as an uninterrupted one.
#[test]
fn killed_refinement_resumes_to_the_same_result() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let model = fixture("deform4dgs/dynerf_like/model");
    let edited = at("edited.ply");
    recoloured(&model, folder.path(), &edited);
    let refine = |run: &Path| -> Vec<String> {
        let flags = ["--refine-size", "320x240", "--samples", "60", "--checkpoint-every", "0"];
        ["refine", path(run), "--gpu", "cpu"].into_iter().chain(flags).map(str::to_owned).collect()
    };
    for run in ["whole", "killed"] {
        let run = at(run);
        let arguments = ["propagate", path(&model), "--no-refine", "--edited", path(&edited)];
        success(&mut c4d(arguments.into_iter().chain(["-o", path(&run)])));
    }
    success(&mut c4d(refine(&at("whole"))));
    let run = at("killed");
    let state = run.join("refine.state");
    let plain = std::fs::read(run.join("scene.c4d")).unwrap();
    let mut saved = Vec::new();
    for resume in [None, Some("--resume".to_owned())] {
        let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin!("c4d"))
            .args(refine(&run).into_iter().chain(resume))
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        // until it has progressed
        while std::fs::read(&state).unwrap_or_default() == saved {
            assert!(child.try_wait().unwrap().is_none(), "it ended before it could be killed");
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        saved = std::fs::read(&state).unwrap();
        assert!(std::fs::read(run.join("scene.c4d")).unwrap() == plain, "no partial files");
    }
    success(&mut c4d(refine(&run).into_iter().chain(["--resume".to_owned()])));
    let scene = |run: &Path| std::fs::read(run.join("scene.c4d")).unwrap();
    assert!(scene(&at("whole")) == scene(&run), "the same, bit for bit");
    assert!(scene(&run) != plain, "refinement changed colours");
}

#[test]
fn unedited_export_keeps_rows_and_values() {
    let folder = tempfile::tempdir().unwrap();
    let model = fixture("deform4dgs/dynerf_like/model");
    let out = folder.path().join("out");
    success(&mut c4d([
        "export",
        path(&model),
        "--to",
        "ply-seq",
        "--frames",
        "3",
        "-o",
        path(&out),
    ]));
    let opened =
        gs_io::checkpoint4dgs::open(&model, &gs_io::model_folder::Overrides::default()).unwrap();
    for (frame, t) in frames(&out).iter().zip([0.0, 0.5, 1.0]) {
        assert_eq!(
            *frame,
            opened.scene.at(t).unwrap(),
            "equal to the scene at {t}, opacity and SH too"
        );
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let mut scenes = Vec::new();
    for threads in ["1", "2"] {
        let run = folder.path().join(threads);
        let (source, edited) = (fixture("synth/source"), fixture("synth/edited.ply"));
        let arguments = [
            "propagate",
            path(&source),
            "--edited",
            path(&edited),
            "--threads",
            threads,
            "-o",
            path(&run),
        ];
        success(&mut c4d(arguments));
        scenes.push(std::fs::read(run.join("scene.c4d")).unwrap());
    }
    assert!(scenes[0] == scenes[1], "bit for bit");
}

#[test]
fn a_run_moved_together_with_its_source_gives_the_same_frames() {
    let folder = tempfile::tempdir().unwrap();
    let (before, after) = (folder.path().join("before"), folder.path().join("after"));
    let (fixed, source) = (fixture("synth/source"), before.join("source"));
    std::fs::create_dir_all(&source).unwrap();
    for name in listing(&fixed) {
        std::fs::copy(fixed.join(&name), source.join(&name)).unwrap();
    }
    let mut propagate = c4d(["propagate", "--no-refine"]);
    propagate.arg(&source).arg("--edited").arg(fixture("synth/edited.ply"));
    success(propagate.arg("-o").arg(before.join("run")));
    let export = |run: &Path, out: &str| {
        let out = folder.path().join(out);
        success(&mut c4d([
            "export",
            path(run),
            "--frames",
            "3",
            "--to",
            "ply-seq",
            "-o",
            path(&out),
        ]));
        frames(&out)
    };
    let expected = export(&before.join("run"), "frames-before");
    std::fs::rename(&before, &after).unwrap();
    assert!(export(&after.join("run"), "frames-after") == expected, "bit for bit");
    // Negative control: without its source, the run does not open.
    let alone = folder.path().join("alone");
    std::fs::rename(after.join("run"), &alone).unwrap();
    let stderr = failure(&mut c4d(["info", path(&alone)]), 3);
    assert!(stderr.contains("the source scene of") && stderr.contains("is missing"), "{stderr}");
}
