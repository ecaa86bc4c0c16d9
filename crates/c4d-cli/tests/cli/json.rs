//! `--json`: one object on standard output, from every command that reports results.

use crate::support::{c4d, fixture};
use serde_json::Value;
use std::path::Path;

/// The object that a command prints, and its exit code.
fn object(arguments: &[&str], folder: &Path) -> (Value, Option<i32>) {
    let output = c4d(arguments).arg("--json").current_dir(folder).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let object = serde_json::from_str(&text)
        .unwrap_or_else(|error| panic!("{arguments:?}: {error}; printed {text}; stderr {stderr}"));
    (object, output.status.code())
}

#[test]
fn every_reporting_command_prints_one_object() {
    let folder = tempfile::tempdir().unwrap();
    let source = fixture("synth/source").display().to_string();
    let edited = fixture("synth/edited.ply").display().to_string();
    let run = |arguments: &[&str]| {
        let (object, code) = object(arguments, folder.path());
        assert_eq!(code, Some(0), "{arguments:?}: {object}");
        assert!(object["messages"].is_array(), "{arguments:?}: {object}");
        assert!(object.get("error").is_none(), "{arguments:?}: {object}");
        object
    };
    let wrote = |arguments: &[&str], path: &str| {
        let object = run(arguments);
        assert_eq!(object["outputs"][0]["path"], path, "{arguments:?}: {object}");
        object
    };
    assert!(run(&["info", &source])["splats"].is_u64(), "info reports the splats");
    assert!(run(&["doctor"])["frames_per_second"].is_f64(), "doctor reports the speed");

    let dry = ["propagate", &source, "--edited", &edited, "--dry-run", "-o", "dry.png"];
    assert!(wrote(&dry, "dry.png")["splats"]["unchanged"].is_u64(), "the counts of a dry run");
    let propagate = ["propagate", &source, "--edited", &edited, "--no-refine", "-o", "run"];
    let made = wrote(&propagate, "run");
    assert!(made["run"]["edited"]["splats"].is_u64(), "{made}");
    let refined = wrote(&["refine", "run", "--refine-size", "64x48", "--samples", "2"], "run");
    assert!(refined["refine"].is_object(), "{refined}");

    let frozen = wrote(&["freeze", &source, "-o", "frozen"], "frozen/point_cloud.ply");
    assert!(frozen["outputs"][0]["splats"].is_u64(), "{frozen}");
    let edit = ["edit", "frozen", "--select", "all", "--opacity", ".5", "--stats", "-o", "e.ply"];
    let edit = wrote(&edit, "e.ply");
    assert!(edit["statistics"][0]["selected"].is_u64(), "{edit}");
    assert_eq!(edit["steps"][0]["option"], "select", "{edit}");

    let stills = ["render", "run", "--frames", "2", "--size", "32x24", "--format", "png"];
    let stills = wrote(&[&stills[..], &["-o", "stills"]].concat(), "stills");
    assert!(stills["outputs"][0]["images"].is_u64(), "{stills}");
    wrote(&["export", "run", "--to", "ply-seq", "--frames", "2", "-o", "frames"], "frames");
    let small = ["--frames", "2", "--size", "32x24"];
    let eval = wrote(&[&["eval", "run"], &small[..], &["-o", "m.json"]].concat(), "m.json");
    assert!(eval["items"].as_array().is_some_and(|items| !items.is_empty()), "{eval}");
    wrote(&[&["compare", "run"], &small[..], &["-o", "page.html"]].concat(), "page.html");
    let bench = ["bench", "motion", "--cases", "recolour", "--seeds", "1", "--size", "500"];
    let bench = wrote(&[&bench[..], &["--no-network", "-o", "bench"]].concat(), "bench");
    assert!(bench["scores"].as_array().is_some_and(|scores| !scores.is_empty()), "{bench}");
}

#[test]
fn a_failure_is_part_of_the_object() {
    let folder = tempfile::tempdir().unwrap();
    let (report, code) = object(&["info", "missing"], folder.path());
    assert_eq!(code, Some(3), "{report}");
    assert_eq!(report["error"]["exit_code"], 3, "{report}");
    assert_eq!(report["error"]["what"], "missing does not exist", "{report}");
    assert!(report["error"]["next"].is_string(), "{report}");
    assert_eq!(report["outputs"].as_array().map(Vec::len), Some(0), "{report}");
    let (report, code) = object(&["completions", "bash"], folder.path());
    assert_eq!((code, &report["error"]["exit_code"]), (Some(2), &Value::from(2)), "no results");
}
