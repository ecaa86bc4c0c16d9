//! kill −9 at random moments.

use crate::setup::{Setup, content, recoloured};
use crate::support::{c4d, failure, fixture, success};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Number of kills per job for a quick test; set `C4D_KILLS` for more.
fn kills() -> u32 {
    std::env::var("C4D_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(4)
}

/// A pseudo-random number in 0 to 1 from a counter; multiples of the golden
/// ratio are evenly spread for any number of draws.
fn share(index: u32) -> f64 {
    (f64::from(index) * 0.618_033_988_749_895).fract()
}

/// Runs a command for some time, then kills it. Returns whether it had already ended.
fn killed_after(command: &mut Command, time: Duration) -> bool {
    let mut child = command.stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(time);
    let done = child.try_wait().unwrap().is_some_and(|status| status.success());
    // Killing a child that has ended fails, which is expected.
    let _ = child.kill();
    child.wait().unwrap();
    done
}

/// A killed run leaves either no output or a complete one, and
/// its remaining files do not affect the next run.
#[test]
fn killed_runs_are_absent_or_complete() {
    let setup = Setup::new();
    let mut index = 0;
    for job in setup.jobs() {
        let before = setup.names();
        let output = setup.at(job.output);
        let begun = Instant::now();
        success(&mut assert_cmd::Command::from_std(setup.command(&job, &[])));
        let (took, files) = (begun.elapsed(), content(&output).len());
        let complete = setup.names();
        for kill in 0..kills() {
            // The first run has no existing output, the others replace
            // the remaining files of the previous ones.
            if kill == 0 {
                success(&mut assert_cmd::Command::from_std(setup.command(&job, &["-w"])));
            }
            let old = content(&output);
            index += 1;
            let wait = took.mul_f64(share(index));
            killed_after(&mut setup.command(&job, &["-w"]), wait);
            let left = content(&output);
            assert_eq!(left.len(), files, "{} killed after {wait:?}: partial output", job.name);
            assert!(
                left == old || left.keys().eq(old.keys()),
                "{} killed after {wait:?}: neither the old one nor a new one",
                job.name
            );
        }
        success(&mut assert_cmd::Command::from_std(setup.command(&job, &["-w"])));
        assert_eq!(setup.names(), complete, "{}: nothing else remains", job.name);
        for name in complete.iter().filter(|name| !before.contains(name)) {
            let path = setup.at(name);
            let removed = if path.is_dir() {
                std::fs::remove_dir_all(path)
            } else {
                std::fs::remove_file(path)
            };
            removed.unwrap();
        }
        // Also without existing output, without -w.
        index += 1;
        let done = killed_after(&mut setup.command(&job, &[]), took.mul_f64(share(index)));
        let again = if done || output.exists() { vec!["-w"] } else { vec![] };
        success(&mut assert_cmd::Command::from_std(setup.command(&job, &again)));
        assert_eq!(setup.names(), complete, "{}: nothing else remains", job.name);
    }
}

/// A refinement killed at any time leaves a run that can be opened,
/// resumed to the same result, and replaced.
#[test]
fn killed_refinements_resume_and_are_replaced() {
    let setup = Setup::new();
    let model = fixture("deform4dgs/dynerf_like/model");
    let edited = recoloured(&model, setup.at("").as_path());
    let [model, edited] = [&model, &edited].map(|path| path.to_str().unwrap());
    let propagate = |run: &str, extra: &[&str]| {
        let mut command = c4d(["propagate", model, "--edited", edited, "--no-refine", "-o", run]);
        command.args(extra);
        command
    };
    let refine = |run: &str, extra: &[&str]| {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("c4d"));
        command.args(["refine", run, "-g", "cpu", "--checkpoint-every", "0"]).args(extra);
        command
    };
    let flags = ["--refine-size", "160x120", "--samples", "24", "--refine-frames", "6"];
    let (whole, run) = (setup.text("whole"), setup.text("refined"));
    success(&mut propagate(&whole, &[]));
    let begun = Instant::now();
    success(&mut assert_cmd::Command::from_std(refine(&whole, &flags)));
    let took = begun.elapsed();
    let scene = |run: &str| std::fs::read(Path::new(run).join("scene.c4d")).unwrap();
    for kill in 0..kills() {
        success(&mut propagate(&run, if kill == 0 { &[] } else { &["-w"] }));
        killed_after(&mut refine(&run, &flags), took.mul_f64(share(2 * kill)));
        success(&mut c4d(["info", &run]));
        let state = Path::new(&run).join("refine.state");
        if state.exists() {
            let part = took.mul_f64(share(2 * kill + 1) / 2.0);
            killed_after(&mut refine(&run, &["--resume"]), part);
        }
        if state.exists() {
            let other = refine(&run, &["--resume", "--samples", "25"]);
            let stderr = failure(&mut assert_cmd::Command::from_std(other), 2);
            assert!(stderr.contains("--samples"), "{stderr}");
            success(&mut assert_cmd::Command::from_std(refine(&run, &["--resume"])));
        } else {
            // Killed before it had started, or after it had ended.
            success(&mut assert_cmd::Command::from_std(refine(&run, &flags)));
        }
        assert!(scene(&run) == scene(&whole), "kill {kill}: the same, bit for bit");
        assert!(!state.exists(), "kill {kill}: the checkpoint is removed");
    }
    let run = Path::new(&run);
    let stderr =
        success(c4d(["refine", run.to_str().unwrap(), "-g", "cpu", "--resume"]).args(flags)).1;
    assert!(stderr.contains("no checkpoint") && stderr.contains("starts again"), "{stderr}");
}
