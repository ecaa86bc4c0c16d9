//! Invalid inputs: each ends in an error that names the file and the next
//! step, with its exit code, and without output.

use crate::support::{c4d, failure, fixture, listing, success};
use gs_core::Splats;
use gs_io::{Existing, ply};
use std::fs;
use std::path::{Path, PathBuf};

struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Propagates `edited` over the fixture scene; expects failure and no output.
    fn refuse(&self, edited: &Path, code: i32, expected: &[&str]) {
        let (source, run) = (fixture("synth/source"), self.at("run"));
        let mut command = c4d([
            "propagate",
            "--no-refine",
            source.to_str().unwrap(),
            "--edited",
            edited.to_str().unwrap(),
            "-o",
            run.to_str().unwrap(),
        ]);
        let stderr = failure(&mut command, code);
        for part in expected {
            assert!(stderr.contains(part), "expected `{part}` in: {stderr}");
        }
        assert!(!run.exists(), "no output");
        let left: Vec<String> = listing(self.folder.path())
            .into_iter()
            .filter(|name| name.contains("run/") || name.starts_with(".run"))
            .collect();
        assert!(left.is_empty(), "nothing partial left: {left:?}");
    }

    fn edited(&self, change: impl FnOnce(&mut Splats)) -> PathBuf {
        let mut splats = ply::read_file(&fixture("synth/edited.ply")).unwrap().splats;
        change(&mut splats);
        let path = self.at("edited.ply");
        ply::write_file(&path, &splats, &ply::WriteOptions::default(), Existing::Replace).unwrap();
        path
    }
}

#[test]
fn edited_file_problems() {
    let bench = Bench::new();
    bench.refuse(&bench.at("absent.ply"), 3, &["absent.ply"]);

    let bytes = fs::read(fixture("synth/edited.ply")).unwrap();
    let truncated = bench.at("truncated.ply");
    fs::write(&truncated, &bytes[..bytes.len() - 100]).unwrap();
    bench.refuse(&truncated, 3, &["truncated.ply", "needs", "found"]);

    let cloud = bench.at("cloud.ply");
    fs::write(
        &cloud,
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nend_header\n0 0 0 9\n",
    )
    .unwrap();
    bench.refuse(&cloud, 3, &["cloud.ply", "opacity", "point cloud"]);

    let garbage = bench.at("garbage.ply");
    fs::write(&garbage, [0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59]).unwrap();
    bench.refuse(&garbage, 3, &["garbage.ply"]);

    let none = bench.edited(|splats| *splats = splats.select(&[]));
    bench.refuse(&none, 3, &["edited.ply"]);

    let all_nan = bench.edited(|splats| splats.means.fill([f32::NAN; 3]));
    bench.refuse(&all_nan, 3, &["edited.ply", "damaged", "c4d info"]);

    let far = bench.edited(|splats| {
        for mean in &mut splats.means {
            mean[0] += 1e4;
        }
    });
    bench.refuse(&far, 3, &["edited.ply", "is the scene moved by", "--align", "--allow-far"]);

    let elsewhere = bench.edited(|splats| {
        for (i, mean) in splats.means.iter_mut().enumerate() {
            let angle = i as f32 * 0.37;
            *mean = [1e4 + angle.sin(), angle.cos(), i as f32 * 1e-3];
            splats.log_scales[i] = [-4.0 - angle.cos(), -5.0, -6.0 + angle.sin()];
            splats.opacity_logits[i] = 3.0 * angle.sin();
        }
    });
    bench.refuse(&elsewhere, 3, &["edited.ply", "--allow-far"]);
}

#[test]
fn damaged_rows_are_counted_or_refused() {
    let bench = Bench::new();
    let edited = bench.edited(|splats| {
        splats.means[5][1] = f32::NAN;
        splats.log_scales[9][0] = f32::INFINITY;
        splats.quats[11] = [0.0; 4];
    });
    let (source, run) = (fixture("synth/source"), bench.at("run"));
    let arguments = [
        "propagate",
        "--no-refine",
        source.to_str().unwrap(),
        "--edited",
        edited.to_str().unwrap(),
        "-o",
        run.to_str().unwrap(),
    ];
    let stderr = failure(c4d(arguments).arg("--strict"), 3);
    assert!(stderr.contains("edited.ply") && !run.exists(), "{stderr}");
    let (_, stderr) = success(&mut c4d(arguments));
    assert!(stderr.contains("dropped 3 of"), "counted: {stderr}");
}

#[test]
fn scene_problems() {
    let bench = Bench::new();
    let out = bench.at("out");
    let freeze = |scene: &Path, code: i32| {
        let stderr = failure(
            &mut c4d(["freeze", scene.to_str().unwrap(), "-o", out.to_str().unwrap()]),
            code,
        );
        assert!(!out.exists(), "no output; stderr: {stderr}");
        stderr
    };
    assert!(freeze(&bench.at("nowhere"), 3).contains("nowhere"), "names the missing part");
    let stderr = freeze(&fixture("synth/edited.ply"), 3);
    assert!(stderr.contains("is a single frame"), "{stderr}");
    let empty = bench.at("empty");
    fs::create_dir(&empty).unwrap();
    assert!(freeze(&empty, 3).contains("empty"), "names the folder");

    let model = bench.at("model");
    copy_folder(&fixture("deform4dgs/dnerf_like/model"), &model);
    let newest = model.join("point_cloud/iteration_20000/deformation.pth");
    let good = fs::read(&newest).unwrap();
    fs::remove_file(&newest).unwrap();
    let stderr = freeze(&model, 3);
    assert!(stderr.contains("deformation.pth"), "{stderr}");
    fs::write(&newest, &good[..good.len() / 2]).unwrap();
    let stderr = freeze(&model, 3);
    assert!(stderr.contains("deformation.pth"), "{stderr}");
    fs::write(&newest, b"cos\nsystem\n(S'true'\ntR.").unwrap();
    let stderr = freeze(&model, 3);
    assert!(stderr.contains("deformation.pth"), "{stderr}");
}

#[test]
fn usage_problems() {
    let bench = Bench::new();
    let model = fixture("deform4dgs/dnerf_like/model");
    let model = model.to_str().unwrap();
    let out = bench.at("out");
    let output = out.to_str().unwrap();
    let stderr = failure(&mut c4d(["freeze", model, "--time", "1.5", "-o", output]), 2);
    assert!(stderr.contains("0 to 1"), "{stderr}");
    let stderr = failure(&mut c4d(["render", model, "--times", "-0.1", "-o", output]), 2);
    assert!(stderr.contains("--times"), "{stderr}");
    for (flag, value) in [("--seeds", "0"), ("--size", "3"), ("--cases", "nope")] {
        let stderr = failure(&mut c4d(["bench", "motion", flag, value, "-o", output]), 2);
        assert!(stderr.contains(flag) && stderr.contains(value), "{stderr}");
        assert!(!out.exists(), "{flag}: a report of nothing");
    }
    let stderr = failure(&mut c4d(["freeze", model, "--set", "no_dx=maybe", "-o", output]), 2);
    assert!(stderr.contains("no_dx"), "{stderr}");
    let stderr = failure(&mut c4d(["freeze", model, "--iteration", "5", "-o", output]), 3);
    assert!(stderr.contains('5'), "{stderr}");
    let source = fixture("synth/source");
    let edited = fixture("synth/edited.ply");
    let mut deformnet = c4d(["propagate", source.to_str().unwrap(), "--baseline", "deformnet"]);
    let stderr = failure(deformnet.args(["--edited", edited.to_str().unwrap(), "-o", output]), 2);
    assert!(stderr.contains("no deformation network"), "{stderr}");
    let stderr = failure(&mut c4d(["render", model, "--side-by-side", "-o", output]), 2);
    assert!(stderr.contains("not a run"), "{stderr}");
    assert!(!out.exists(), "no output");
}

#[test]
fn existing_and_unrelated_output_is_kept() {
    let bench = Bench::new();
    let model = fixture("deform4dgs/dnerf_like/model");
    let model = model.to_str().unwrap();
    let out = bench.at("out");
    let output = out.to_str().unwrap();
    success(&mut c4d(["freeze", model, "-o", output]));
    let stderr = failure(&mut c4d(["freeze", model, "-o", output]), 2);
    assert!(stderr.contains("exists"), "{stderr}");
    success(&mut c4d(["freeze", model, "-w", "-o", output]));
    fs::write(out.join("thesis.tex"), "years of work").unwrap();
    let stderr = failure(&mut c4d(["freeze", model, "-w", "-o", output]), 2);
    assert!(stderr.contains("thesis.tex"), "{stderr}");
    assert_eq!(listing(&out), ["cameras.json", "point_cloud.ply", "thesis.tex"], "all kept");
    let file = bench.at("clip.mp4");
    fs::write(&file, "somebody's film").unwrap();
    let arguments =
        ["render", model, "--size", "32x32", "--frames", "2", "-o", file.to_str().unwrap()];
    failure(&mut c4d(arguments), 2);
    assert_eq!(fs::read(&file).unwrap(), b"somebody's film", "kept");
    let unwritable = c4d(["freeze", model, "-o", "/proc/c4d/out"]).output().unwrap();
    assert_eq!(unwritable.status.code(), Some(1), "an unwritable folder");
}

#[test]
fn inputs_are_never_written_to() {
    let bench = Bench::new();
    let sequence = bench.at("sequence");
    copy_folder(&fixture("synth/source"), &sequence);
    let edited = fixture("synth/edited.ply");
    let path = |path: &Path| path.to_str().unwrap().to_owned();
    let run = bench.at("run");
    let propagate = |source: &Path, run: &Path| {
        c4d([
            "propagate",
            "--no-refine",
            "-w",
            &path(source),
            "--edited",
            &path(&edited),
            "-o",
            &path(run),
        ])
    };
    success(&mut propagate(&sequence, &run));
    let before = listing(bench.folder.path());
    for (source, output) in [
        (&run, &run),
        (&sequence, &sequence),
        (&run, &sequence),
        (&sequence, &sequence.join("run")),
    ] {
        let stderr = failure(&mut propagate(source, output), 2);
        assert!(stderr.contains("overlap"), "{stderr}");
    }
    let export = ["export", "--to", "ply-seq", "--frames", "2", "-w"];
    failure(c4d(export).args([&path(&sequence), "-o", &path(&sequence)]), 2);
    failure(
        c4d(["render", &path(&run), "-w", "--frames", "2", "-o", &path(&sequence)]).arg("-q"),
        2,
    );
    assert_eq!(listing(bench.folder.path()), before, "nothing changed");
    // A run whose configuration has the run itself as its source.
    let config = run.join("c4d.toml");
    let text = fs::read_to_string(&config).unwrap();
    let named = text
        .lines()
        .map(
            |line| {
                if line.starts_with("source_from_run") { "source_from_run = \".\"" } else { line }
            },
        )
        .collect::<Vec<_>>()
        .join("\n");
    fs::write(&config, named).unwrap();
    let stderr = failure(&mut c4d(["info", &path(&run)]), 3);
    assert!(stderr.contains("its own source"), "{stderr}");
}

#[test]
fn a_frame_of_a_different_time_is_refused() {
    let bench = Bench::new();
    let model = fixture("deform4dgs/dnerf_like/model");
    let (frozen, run) = (bench.at("frozen"), bench.at("run"));
    let arguments =
        ["freeze", model.to_str().unwrap(), "--time", "0.5", "-o", frozen.to_str().unwrap()];
    success(&mut c4d(arguments));
    let edited = frozen.join("point_cloud.ply");
    let propagate = [
        "propagate",
        "--no-refine",
        model.to_str().unwrap(),
        "--edited",
        edited.to_str().unwrap(),
        "-o",
        run.to_str().unwrap(),
    ];
    let stderr = failure(&mut c4d(propagate), 2);
    assert!(stderr.contains("--time 0.5") && !run.exists(), "{stderr}");
    success(c4d(propagate).args(["--time", "0.5"]));
}

#[test]
fn an_edit_of_the_canonical_file_is_refused() {
    let bench = Bench::new();
    let model = fixture("deform4dgs/dnerf_like/model");
    let canonical = model.join("point_cloud/iteration_20000/point_cloud.ply");
    let run = bench.at("run");
    let mut command =
        c4d(["propagate", model.to_str().unwrap(), "--edited", canonical.to_str().unwrap()]);
    let stderr = failure(command.args(["-o", run.to_str().unwrap()]), 3);
    assert!(stderr.contains("canonical") && stderr.contains("c4d freeze"), "{stderr}");
}

fn copy_folder(from: &Path, to: &Path) {
    for name in listing(from) {
        let target = to.join(&name);
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        fs::copy(from.join(&name), target).unwrap();
    }
}

/// Runs a command on a path and expects it to be refused as input; returns the messages.
fn refused(command: &str, path: &Path, more: &[&str]) -> String {
    let path = path.to_str().unwrap();
    failure(c4d([command, path]).args(more), 3)
}

#[test]
fn next_steps_name_suitable_paths() {
    let bench = Bench::new();
    let out = bench.at("out");
    let output = ["-o", out.to_str().unwrap()];
    // A folder with one clip in it.
    let folder = bench.at("downloads");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("readme.txt"), "hello").unwrap();
    fs::write(folder.join("walk.splatv"), 0x674B_u32.to_le_bytes()).unwrap();
    let stderr = refused("freeze", &folder, &output);
    assert!(stderr.contains("walk.splatv") && stderr.contains("use that"), "{stderr}");
    // A plain 3DGS model.
    let model = bench.at("model");
    let save = model.join("point_cloud/iteration_30000");
    fs::create_dir_all(&save).unwrap();
    fs::copy(fixture("synth/edited.ply"), save.join("point_cloud.ply")).unwrap();
    fs::write(model.join("cfg_args"), "Namespace(sh_degree=3, eval=False)").unwrap();
    let stderr = refused("freeze", &model, &output);
    assert!(stderr.contains("static, no deformation") && stderr.contains("--edited"), "{stderr}");
    let (text, _) = success(&mut c4d(["info", model.to_str().unwrap()]));
    assert!(text.contains("3DGS model") && text.contains("iteration_30000"), "{text}");
    let source = fixture("synth/source");
    let mut propagate = c4d(["propagate", "--no-refine", source.to_str().unwrap()]);
    propagate.args(["--edited", model.to_str().unwrap()]).args(output);
    let (_, stderr) = success(&mut propagate);
    assert!(stderr.contains("iteration_30000"), "states the frame: {stderr}");
    fs::remove_dir_all(&out).unwrap();
    // A folder of an edited frame under another name, and one of a dynamic model.
    let edits = bench.at("edits");
    fs::create_dir(&edits).unwrap();
    fs::copy(fixture("synth/edited.ply"), edits.join("hat.ply")).unwrap();
    bench.refuse(&edits, 3, &["hat.ply", "use that"]);
    bench.refuse(&fixture("deform4dgs/dnerf_like/model"), 3, &["canonical", "c4d freeze"]);
    // Placeholders of files, and files of other formats.
    let pointer = bench.at("edited.ply");
    fs::write(&pointer, "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
        .unwrap();
    bench.refuse(&pointer, 3, &["Git LFS pointer", "git lfs pull"]);
    fs::write(&pointer, "# Blender v4.2 OBJ File\nv 0 0 0\n").unwrap();
    bench.refuse(&pointer, 3, &["# Blender", "3DGS PLY"]);
    // A run whose files are pointers.
    let run = bench.at("fetched");
    fs::create_dir(&run).unwrap();
    fs::write(run.join("c4d.toml"), "version https://git-lfs.github.com/spec/v1\n").unwrap();
    let stderr = refused("info", &run, &[]);
    assert!(stderr.contains("c4d.toml") && stderr.contains("Git LFS pointer"), "{stderr}");
}

#[test]
fn several_series_in_a_folder_are_reported() {
    let bench = Bench::new();
    let folder = bench.at("frames");
    copy_folder(&fixture("synth/source"), &folder);
    let first = listing(&folder).into_iter().find(|name| name.contains(".ply")).unwrap();
    fs::copy(folder.join(first), folder.join("other_0.ply")).unwrap();
    let (text, stderr) = success(&mut c4d(["info", folder.to_str().unwrap()]));
    assert!(stderr.contains("ignoring other_*.ply (1)"), "{stderr}");
    assert!(text.contains("series"), "{text}");
}

#[test]
fn errors_for_damaged_models_state_a_useful_next_step() {
    let bench = Bench::new();
    let weights = "deform/iteration_40000/deform.pth";
    let lite = "point_cloud/iteration_30000/point_cloud.ply";
    let cases: [(&str, &str, Option<usize>, &str); 6] = [
        ("deformable3dgs/blender_6dof_w40", weights, Some(2), "Copy the file again from"),
        ("deformable3dgs/blender_6dof_w40", weights, Some(0), "Copy the file again from"),
        ("spacetime_lite", lite, Some(0), "next: Copy the file again"),
        ("spacetime_lite", lite, None, "without iteration_N/point_cloud.ply: copy that file"),
        ("fudan4dgs/shfs4d", "chkpnt30000.pth", Some(0), "chkpnt30000.pth, which is empty: copy"),
        ("dash/n3v_w64", "deform/iteration_50000/deform.pth", None, "Copy the folder `deform`"),
    ];
    for (number, (name, file, share, expected)) in cases.into_iter().enumerate() {
        let model = bench.at(&number.to_string());
        copy_folder(&fixture("bases").join(name).join("model"), &model);
        let file = model.join(file);
        match share {
            None => fs::remove_file(&file).unwrap(),
            Some(share) => {
                let bytes = fs::read(&file).unwrap();
                let kept = bytes.len().checked_div(share).unwrap_or_default();
                fs::write(&file, &bytes[..kept]).unwrap();
            }
        }
        // Intact models of one kind need this flag; it is not the cause of the error here.
        let flags: &[&str] =
            if name.starts_with("fudan") { &["--set", "time_duration=0,10"] } else { &[] };
        let out = bench.at("out");
        let more: Vec<&str> = flags.iter().copied().chain(["-o", out.to_str().unwrap()]).collect();
        let stderr = refused("freeze", &model, &more);
        assert!(stderr.contains(expected), "{name}, {share:?}: {stderr}");
    }
}
