//! `--config`: every option from a file, and repetition of a run from its record.

use crate::support::{c4d, failure, fixture, success};
use std::path::Path;

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn propagate(run: &Path, more: &[&str]) -> assert_cmd::Command {
    let (source, edited) = (fixture("synth/source"), fixture("synth/edited.ply"));
    let mut arguments =
        vec!["propagate", path(&source), "--edited", path(&edited), "-o", path(run)];
    arguments.extend(more);
    c4d(arguments)
}

fn bytes(run: &Path, name: &str) -> Vec<u8> {
    std::fs::read(run.join(name)).unwrap()
}

const EVERYTHING: &str = r#"
preset = "paper"
seed = 5
[anchors]
sampling = "lines"
k = 3
grouping = "overlapping"
max_edge_ratio = 5.0
radius_rule = "local"
radius_factor = 0.9
num_lines = 20000
[transport]
gamma = 0.08
lambda_ent = 0.05
lambda_a = 11
lambda_b = inf
cutoff = 5.0
tol = 1e-8
max_sweeps = 5000
"#;

#[test]
fn a_run_is_repeated_from_its_own_record() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("options.toml");
    std::fs::write(&file, EVERYTHING).unwrap();
    let runs = ["one", "two", "plain"].map(|name| folder.path().join(name));
    let (_, stderr) = success(&mut propagate(&runs[0], &["--no-refine", "--config", path(&file)]));
    assert!(stderr.contains("every edited splat is estimated"), "as the paper does: {stderr}");
    let record = String::from_utf8(bytes(&runs[0], "c4d.toml")).unwrap();
    for line in [
        "num_lines = 20000",
        "gamma = 0.08",
        "lambda_a = 11.0",
        "lambda_b = inf",
        "k = 3",
        "seed = 5",
    ] {
        assert!(record.contains(line), "`{line}` is recorded: {record}");
    }
    // no flag except the record: also without --no-refine, because the run was not refined
    let config = runs[0].join("c4d.toml");
    success(&mut propagate(&runs[1], &["--config", path(&config)]));
    for name in ["c4d.toml", "scene.c4d"] {
        assert_eq!(bytes(&runs[0], name), bytes(&runs[1], name), "{name} of the repeated run");
    }
    // negative control: the preset alone gives a different run
    success(&mut propagate(&runs[2], &["--no-refine", "--preset", "paper", "--seed", "5"]));
    assert_ne!(bytes(&runs[0], "scene.c4d"), bytes(&runs[2], "scene.c4d"), "options matter");
}

#[test]
fn the_default_and_baselines_are_repeated() {
    let folder = tempfile::tempdir().unwrap();
    for (name, flags) in [
        ("default", &["--time", "0", "--seed", "3"][..]),
        ("knn", &["--baseline", "knn"]),
        ("all", &["--motion", "all"]),
        ("known", &["--preset", "paper", "--motion", "edited"]),
    ] {
        let (one, two) = (folder.path().join(name), folder.path().join(format!("{name}-again")));
        let flags: Vec<&str> = flags.iter().copied().chain(["--no-refine"]).collect();
        success(&mut propagate(&one, &flags));
        let config = one.join("c4d.toml");
        success(&mut propagate(&two, &["--config", path(&config)]));
        for file in ["c4d.toml", "scene.c4d"] {
            assert_eq!(bytes(&one, file), bytes(&two, file), "{file} of {name}");
        }
    }
}

#[test]
fn farthest_points_are_an_option() {
    let folder = tempfile::tempdir().unwrap();
    let (file, run) = (folder.path().join("fps.toml"), folder.path().join("run"));
    std::fs::write(&file, "[anchors]\nsampling = \"farthest-points\"\n").unwrap();
    success(&mut propagate(&run, &["--no-refine", "--preset", "paper", "--config", path(&file)]));
    let report: serde_json::Value = serde_json::from_slice(&bytes(&run, "run.json")).unwrap();
    let splats = report["source"]["moving"].as_u64().unwrap();
    assert_eq!(report["anchors"]["source"].as_u64(), Some(splats.div_ceil(3)), "{report}");
}

#[test]
fn invalid_configurations_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (file, run) = (folder.path().join("options.toml"), folder.path().join("run"));
    for (text, expected) in [
        ("lambda = 3", "unknown field `lambda`"),
        ("[transport]\nlambda_0 = 0.1", "unknown field `lambda_0`"),
        ("[anchors]\nk = -1", "k = -1"),
        ("[anchors]\nk = 65", "`k` is 65"),
        ("[anchors]\nk = 1.5", "k = 1.5"),
        ("[anchors]\nsampling = \"random\"", "random"),
        ("[anchors]\nradius_rule = \"fixed\"", "radius"),
        ("[anchors]\nradius_rule = \"local\"\nradius = 0.1", "radius"),
        ("[anchors]\nradius = nan", "radius"),
        ("[anchors]\nradius_factor = 0", "radius_factor"),
        ("[transport]\ngamma = \"wide\"", "gamma"),
        ("[transport]\ngamma = nan", "gamma"),
        ("[transport]\nlambda_ent = inf", "lambda_ent"),
        ("[transport]\nlambda_ent = 1e-4", "lambda_ent"),
        ("[transport]\nlambda_a = nan", "lambda_a"),
        ("[transport]\nlambda_b = 0", "lambda_b"),
        ("[transport]\ntol = nan", "tol"),
        ("[transport]\ncutoff = -1", "cutoff"),
        ("[transport]\nmax_sweeps = 0", "max_sweeps"),
        ("edit_time = nan", "edit_time"),
        ("preset = \"Paper\"", "default or paper"),
        ("motion = 3", "motion"),
        ("position = \"mean\"", "average or rigid"),
        ("[knn]\nk = 3", "--baseline knn"),
        ("preset = \"best\"\n[transport]\ngamma = 0.1", "unknown"),
        ("[refine]\nepsilon = \"low\"", "epsilon"),
        ("[refine.adam]\nrate = 1", "unknown field `rate`"),
        ("[refine]\nsize = [0, 480]", "size"),
        ("[refine]\nup = \"w\"", "up"),
        ("k = ", "options.toml"),
        ("\u{0}", "options.toml"),
    ] {
        std::fs::write(&file, text).unwrap();
        let preset = if text.starts_with("preset") { vec![] } else { vec!["--preset", "paper"] };
        let flags: Vec<&str> =
            preset.into_iter().chain(["--no-refine", "--config", path(&file)]).collect();
        let stderr = failure(&mut propagate(&run, &flags), 3);
        let expected = if expected == "unknown" { "[transport] applies to" } else { expected };
        assert!(stderr.contains(expected), "{text:?} should mention {expected:?}: {stderr}");
        assert!(!run.exists(), "{text:?}: no output is written");
    }
    for (text, expected) in [
        ("[refine]\neta = 2", "eta"),
        ("[refine]\nzeta = nan", "zeta"),
        ("[refine.adam]\nrate_dc = -1", "rate_dc"),
        ("[refine.adam]\nsteps = 5\n[refine.regression]\npasses = 2", "both"),
    ] {
        std::fs::write(&file, text).unwrap();
        let stderr = failure(&mut propagate(&run, &["--config", path(&file), "--gpu", "cpu"]), 3);
        assert!(stderr.contains(expected), "{text:?} should mention {expected:?}: {stderr}");
        assert!(!run.exists(), "{text:?}: no output is written");
    }
    let stderr = failure(&mut propagate(&run, &["--config", "/nowhere/c4d.toml"]), 3);
    assert!(stderr.contains("/nowhere/c4d.toml"), "{stderr}");
    std::fs::write(&file, [0xff, 0xfe, 0x00]).unwrap();
    failure(&mut propagate(&run, &["--config", path(&file)]), 3);
}
