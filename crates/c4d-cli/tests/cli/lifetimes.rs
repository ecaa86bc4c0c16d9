//! Scenes with short-lived splats: effect, messages and record of `--follow`.

use crate::support::{c4d, failure, fixture, success};
use gs_core::{Splats, TimeRange};
use gs_io::{Existing, ply, ply_sequence};
use gs_synth::{ShortLivedCase, ShortLivedParams, ShortLivedTruthScene, build_short_lived};
use std::path::{Path, PathBuf};

const FRAMES: usize = 21;

struct Setup {
    folder: tempfile::TempDir,
    scene: ShortLivedTruthScene,
}

impl Setup {
    /// A scene as frames, and an edit of the splats that the first frame shows.
    fn new(case: ShortLivedCase) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let params = ShortLivedParams {
            num_splats: 2_000,
            lifetimes: [0.2, 0.4],
            ..ShortLivedParams::default()
        };
        let scene = build_short_lived(case, &params).unwrap();
        let setup = Self { folder, scene };
        let (times, options) = (TimeRange::UNIT.frames(FRAMES), ply::WriteOptions::default());
        let source = &setup.scene.source;
        ply_sequence::write_folder(
            &setup.at("source"),
            source,
            &times,
            &options,
            Existing::Refuse,
            &mut |_| {},
        )
        .unwrap();
        let edited = &setup.scene.edited;
        ply::write_file(&setup.at("edited.ply"), edited, &options, Existing::Refuse).unwrap();
        setup
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn propagate(&self, run: &str, flags: &[&str]) -> String {
        let (source, edited, run) = (self.at("source"), self.at("edited.ply"), self.at(run));
        let fixed = ["propagate", text(&source), "--edited", text(&edited), "-o", text(&run)];
        success(&mut c4d(fixed.iter().chain(flags).copied().collect::<Vec<_>>())).1
    }

    /// Five frames of a scene or run.
    fn frames(&self, name: &str) -> Vec<Splats> {
        let (scene, out) = (self.at(name), self.at(&format!("{name}-frames")));
        success(&mut c4d([
            "export",
            text(&scene),
            "--to",
            "ply-seq",
            "--frames",
            "5",
            "-o",
            text(&out),
        ]));
        let mut files: Vec<PathBuf> =
            std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.retain(|file| file.extension().is_some_and(|extension| extension == "ply"));
        files.sort();
        files.iter().map(|file| ply::read_file(file).unwrap().splats).collect()
    }

    fn toml(&self, run: &str) -> String {
        std::fs::read_to_string(self.at(run).join("c4d.toml")).unwrap()
    }
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Share of the clearly visible splats of the edited surface that have their old colours.
fn still_old(scene: &ShortLivedTruthScene, frame: &Splats, t: f32) -> f64 {
    use gs_core::DynamicScene;
    let before = scene.source.at(t).unwrap();
    let seen = |row: &usize| scene.touched[*row] && before.opacity(*row) > 0.3;
    let (mut all, mut old) = (0, 0);
    for row in (0..before.len()).filter(seen) {
        all += 1;
        let apart = (0..3).map(|k| (frame.sh_of(row)[0][k] - before.sh_of(row)[0][k]).abs());
        old += usize::from(apart.fold(0.0, f32::max) < 0.1);
    }
    f64::from(u32::try_from(old).unwrap()) / f64::from(u32::try_from(all).unwrap())
}

#[test]
fn lifetimes_determine_the_default_and_runs_record_it() {
    let setup = Setup::new(ShortLivedCase::Recolour);
    let stderr = setup.propagate("run", &["--no-refine"]);
    assert!(stderr.contains("inherit the edit (--follow surface)"), "{stderr}");
    assert!(stderr.contains("inherited: ") && stderr.contains("; confidence "), "{stderr}");
    assert!(setup.toml("run").contains("follow = \"surface\""), "{}", setup.toml("run"));
    let report = std::fs::read_to_string(setup.at("run").join("run.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert!(report["inheritance"]["recoloured"].as_u64().unwrap() > 50, "{report}");
    let (shown, _) = success(&mut c4d(["info", text(&setup.at("run"))]));
    assert!(shown.contains("follow surface") && shown.contains(" inherited"), "{shown}");
    let late = &setup.frames("run")[3];
    let share = still_old(&setup.scene, late, 0.75);
    assert!(share < 0.1, "{share}");

    // With `--follow splats`, the old colours return.
    let stderr = setup.propagate("splats", &["--no-refine", "--follow", "splats"]);
    assert!(stderr.contains("disappears where other splats replace them"), "{stderr}");
    assert!(setup.toml("splats").contains("follow = \"splats\""), "{}", setup.toml("splats"));
    let share = still_old(&setup.scene, &setup.frames("splats")[3], 0.75);
    assert!(share > 0.3, "{share}");

    // A record is a configuration and gives the same bytes.
    let config = setup.at("run").join("c4d.toml");
    setup.propagate("again", &["--config", text(&config)]);
    let bytes = |run: &str| std::fs::read(setup.at(run).join("scene.c4d")).unwrap();
    assert!(bytes("run") == bytes("again"), "bit for bit");
    for threads in ["1", "7"] {
        let run = format!("with-{threads}");
        setup.propagate(&run, &["--no-refine", "--threads", threads]);
        assert!(bytes("run") == bytes(&run), "{threads} threads: bit for bit");
    }
}

#[test]
fn runs_that_follow_surfaces_are_refined_and_displayed() {
    let setup = Setup::new(ShortLivedCase::Hat);
    let refine = ["--samples", "6", "--refine-frames", "3", "--refine-size", "96x72"];
    let stderr = setup.propagate("run", &refine);
    assert!(stderr.contains("refin"), "{stderr}");
    let run = setup.at("run");
    let (page, pictures) = (setup.at("page.html"), setup.at("pictures"));
    success(&mut c4d([
        "render",
        text(&run),
        "--frames",
        "3",
        "--size",
        "64x48",
        "-o",
        text(&pictures),
    ]));
    success(&mut c4d(["export", text(&run), "--to", "html", "--frames", "4", "-o", text(&page)]));
    assert!(page.metadata().unwrap().len() > 10_000, "a page");
    let frames = setup.frames("run");
    let new = setup.scene.truth.new_rows().iter().filter(|new| **new).count();
    for frame in &frames {
        let first = frame.len() - new;
        for row in first..frame.len() {
            assert!(frame.opacity(row) > 0.85, "row {row}: {}", frame.opacity(row));
        }
    }
    // A second edit: a run can be a source.
    let again = setup.at("again");
    let edited = setup.at("second.ply");
    ply::write_file(&edited, &frames[0], &ply::WriteOptions::default(), Existing::Refuse).unwrap();
    success(&mut c4d([
        "propagate",
        text(&run),
        "--edited",
        text(&edited),
        "-o",
        text(&again),
        "--no-refine",
    ]));
}

#[test]
fn damaged_records_of_surfaces_are_refused() {
    let setup = Setup::new(ShortLivedCase::Delete);
    setup.propagate("run", &["--no-refine"]);
    let file = setup.at("run").join("scene.c4d");
    let bytes = std::fs::read(&file).unwrap();
    let config = setup.toml("run");
    // A row beyond the frame: the last of the inherited rows is the first value after its name.
    let header = u64::from_le_bytes(bytes[..8].try_into().unwrap());
    let names: serde_json::Value =
        serde_json::from_slice(&bytes[8..8 + usize::try_from(header).unwrap()]).unwrap();
    let begin = names["inherited.rows"]["data_offsets"][0].as_u64().unwrap();
    let at = usize::try_from(8 + header + begin).unwrap();
    let mut broken = bytes.clone();
    broken[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    std::fs::write(&file, broken).unwrap();
    let stderr = failure(&mut c4d(["info", text(&setup.at("run"))]), 3);
    assert!(stderr.contains("scene.c4d") && stderr.contains("rows of kind Descendant"), "{stderr}");
    std::fs::write(&file, bytes).unwrap();
    let config = config.replace("follow = \"surface\"", "follow = \"water\"");
    let path = setup.at("other.toml");
    std::fs::write(&path, config).unwrap();
    let stderr = failure(
        &mut c4d([
            "propagate",
            text(&setup.at("source")),
            "--edited",
            text(&setup.at("edited.ply")),
            "--config",
            text(&path),
            "-o",
            text(&setup.at("third")),
        ]),
        3,
    );
    assert!(stderr.contains("`follow` is \"water\", expected splats or surface"), "{stderr}");
}

#[test]
fn scenes_of_permanent_splats_follow_splats() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, flags: &[&str]| {
        let (source, edited) = (fixture("synth/source"), fixture("synth/edited.ply"));
        let out = folder.path().join(name);
        let fixed = [
            "propagate",
            text(&source),
            "--edited",
            text(&edited),
            "--no-refine",
            "-o",
            text(&out),
        ];
        let stderr = success(&mut c4d(fixed.iter().chain(flags).copied().collect::<Vec<_>>())).1;
        assert!(!stderr.contains("inherit"), "{stderr}");
        std::fs::read(out.join("scene.c4d")).unwrap()
    };
    assert!(run("default", &[]) == run("explicit", &["--follow", "splats"]), "bit for bit");
}
