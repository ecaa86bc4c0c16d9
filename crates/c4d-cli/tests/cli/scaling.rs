//! The scripts of `docs/SCALING.md`, with three processes on this machine.

use crate::support::{c4d, fixture, success};
use std::path::{Path, PathBuf};
use std::process::Command;

fn document(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scaling").join(name)
}

/// The search path, with the folder of `c4d` first.
fn path_with_c4d() -> std::ffi::OsString {
    let program = assert_cmd::cargo::cargo_bin!("c4d");
    let inherited = std::env::var_os("PATH").unwrap_or_default();
    let own = std::iter::once(program.parent().unwrap().to_owned());
    std::env::join_paths(own.chain(std::env::split_paths(&inherited))).unwrap()
}

const FLAGS: [&str; 8] = ["--cameras", "orbit", "--frames", "6", "--size", "48x36", "-g", "cpu"];

/// Checks that the joined parts equal the video of one call.
fn check(folder: &Path, parts: &[PathBuf]) {
    let [whole, joined] = ["whole.mp4", "joined.mp4"].map(|name| folder.join(name));
    success(c4d(["render"]).arg(fixture("synth/source")).args(FLAGS).arg("-o").arg(&whole));
    success(c4d(["gather"]).args(parts).arg("-o").arg(&joined));
    let [whole, joined] = [whole, joined].map(|path| std::fs::read(path).unwrap());
    assert!(whole == joined, "the same bytes");
}

#[cfg(unix)]
#[test]
fn a_slurm_array_makes_all_parts() {
    let folder = tempfile::tempdir().unwrap();
    let parts = folder.path().join("parts");
    // An array does not have to begin at 1.
    let tasks = [4, 5, 6].map(|task| {
        Command::new("bash")
            .arg(document("slurm.sh"))
            .arg(&parts)
            .arg("render")
            .arg(fixture("synth/source"))
            .args(FLAGS)
            .env("PATH", path_with_c4d())
            .env("SLURM_ARRAY_TASK_ID", task.to_string())
            .env("SLURM_ARRAY_TASK_MIN", "4")
            .env("SLURM_ARRAY_TASK_COUNT", "3")
            .spawn()
            .unwrap()
    });
    for mut task in tasks {
        assert!(task.wait().unwrap().success(), "every task succeeds");
    }
    check(folder.path(), &["1", "2", "3"].map(|part| parts.join(part)));
}

/// Runs `c4d ARGUMENTS` of a farm's job for parts 1 to 3 concurrently; `token` is the farm's
/// placeholder for the frame.
fn farm(arguments: &str, token: &str) {
    let folder = tempfile::tempdir().unwrap();
    let run = fixture("synth/source");
    let commands = [1, 2, 3].map(|part| {
        let words = arguments.replace(token, &part.to_string()).replace("/20", "/3");
        let words = words.replace("--cameras orbit", &FLAGS.join(" "));
        let words = words.split(' ').map(|word| match word {
            "RUN" => run.to_str().unwrap().to_owned(),
            word => word.to_owned(),
        });
        let words: Vec<String> = words.collect();
        assert!(words.contains(&format!("{part}/3")), "the part: {words:?}");
        Command::new(assert_cmd::cargo::cargo_bin!("c4d"))
            .args(words)
            .current_dir(folder.path())
            .spawn()
            .unwrap()
    });
    for mut command in commands {
        assert!(command.wait().unwrap().success(), "every frame of the job succeeds");
    }
    check(folder.path(), &["1", "2", "3"].map(|part| folder.path().join("PARTS").join(part)));
}

#[test]
fn deadline_makes_all_parts() {
    let plugin = std::fs::read_to_string(document("deadline_plugin_info.job")).unwrap();
    let value = |key: &str| plugin.lines().find_map(|line| line.strip_prefix(key)).unwrap();
    assert_eq!(value("Executable="), "c4d", "the program");
    farm(value("Arguments="), "<STARTFRAME>");
    let job = std::fs::read_to_string(document("deadline_job_info.job")).unwrap();
    assert!(job.contains("Frames=1-20\nChunkSize=1\n"), "a frame is a part: {job}");
}

#[test]
fn opencue_makes_all_parts() {
    let script = std::fs::read_to_string(document("opencue.py")).unwrap();
    let render = script.lines().find_map(|line| line.strip_prefix("RENDER = \"c4d ")).unwrap();
    farm(render.trim_end_matches('"'), "#IFRAME#");
    assert!(script.contains("PARTS = 20\n"), "as many frames as parts");
}
