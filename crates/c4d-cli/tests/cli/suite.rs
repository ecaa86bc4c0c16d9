//! `c4d bench suite`.

use crate::support::{c4d, failure, fixture, success};
use std::path::Path;

fn suite(folder: &Path, extra: &str) -> String {
    let path = folder.join("suite.toml");
    let synth = fixture("synth");
    let text = format!(
        r#"
eval = ["--frames", "2", "--size", "48x36", "-g", "cpu"]
metrics = ["bg_psnr", "warp_error_ratio", "drift"]

[[scenes]]
name = "figure"
path = '{0}/source'

[[scenes.edits]]
name = "all"
edited = '{0}/edited.ply'
flags = ["--no-refine"]

[[methods]]
name = "default"

[[methods]]
name = "knn"
flags = ["--baseline", "knn"]
{extra}"#,
        synth.display()
    );
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn every_edit_is_measured_with_every_method_and_completed_runs_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let file = suite(folder.path(), "");
    let command = || c4d(["bench", "suite", &file, "-o", out.to_str().unwrap()]);
    // The parts of two processes, then the table of both parts.
    success(command().args(["--part", "1/2"]));
    assert!(!out.join("table.md").exists(), "a part makes no table");
    success(command().args(["--part", "2/2"]));
    let (table, stderr) = success(&mut command());
    assert!(stderr.contains("0 runs computed, 2 reused, 0 failed"), "{stderr}");
    for part in ["## figure: all", "| metric | default | knn |", "| `bg_psnr` ↑ |", "`drift`"] {
        assert!(table.contains(part), "{part} in {table}");
    }
    let csv = std::fs::read_to_string(out.join("table.csv")).unwrap();
    assert!(csv.contains("\nfigure,all,default,bg_psnr,"), "{csv}");
    assert_eq!(csv.lines().count(), 1 + 2 * 3, "a line for each number: {csv}");
    // As after a killed call: one of the runs is missing.
    std::fs::remove_dir_all(out.join("figure/all/knn")).unwrap();
    let before = std::fs::read(out.join("figure/all/default/run/scene.c4d")).unwrap();
    let (again, stderr) = success(&mut command());
    assert!(stderr.contains("1 runs computed, 1 reused"), "{stderr}");
    assert_eq!(again, table, "the same table");
    let after = std::fs::read(out.join("figure/all/default/run/scene.c4d")).unwrap();
    assert!(before == after, "the completed run is not touched");
}

#[test]
fn changed_inputs_and_failed_methods_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let failing = "\n[[methods]]\nname = \"network\"\nflags = [\"--baseline\", \"deformnet\"]\n";
    let file = suite(folder.path(), failing);
    let command = || c4d(["bench", "suite", &file, "-o", out.to_str().unwrap()]);
    // The sequence has no deformation network, so one method fails; the others are measured.
    let stderr = failure(&mut command(), 1);
    assert!(
        stderr.contains("figure/all/network") && stderr.contains("1 of 3 runs failed"),
        "{stderr}"
    );
    let table = std::fs::read_to_string(out.join("table.md")).unwrap();
    assert!(table.contains("network failed.") && table.contains("| metric | default |"), "{table}");

    let changed = suite(folder.path(), "");
    let text = std::fs::read_to_string(&changed).unwrap();
    std::fs::write(&changed, text.replace("\"2\"", "\"3\"")).unwrap();
    let stderr = failure(&mut command(), 2);
    assert!(
        stderr.contains("was computed from different inputs or flags") && stderr.contains("-w"),
        "{stderr}"
    );
    success(command().arg("-w"));

    for (from, to, expected) in [
        ("name = \"knn\"", "name = \"a/b\"", "the name `a/b` among the methods"),
        ("name = \"knn\"", "name = \"default\"", "two of the methods are named `default`"),
        ("\"knn\"]", "\"nearest\"]", "figure/all/knn: invalid value"),
        ("bg_psnr", "bg_psnrr", "no such metric or group"),
        ("[[methods]]", "[[method]]", "unknown field `method`"),
    ] {
        std::fs::write(&changed, text.replace(from, to)).unwrap();
        let other = folder.path().join("other");
        let command = c4d(["bench", "suite", &changed, "-o"]).arg(&other).output().unwrap();
        let stderr = String::from_utf8_lossy(&command.stderr);
        assert!(!command.status.success() && stderr.contains(expected), "{expected}: {stderr}");
        assert!(!other.exists(), "nothing is written: {stderr}");
    }
}
