//! `--gpu`: missing adapters, missing drivers, and the same refinement on an adapter as on the CPU.
//! Needs a Vulkan driver, which may be a software one; without one these tests fail.

use crate::support::{c4d, failure, fixture, success};
use crate::workflow::recoloured;
use std::path::Path;

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// No Vulkan driver.
const NO_DRIVER: [(&str, &str); 2] =
    [("VK_DRIVER_FILES", "/nonexistent.json"), ("VK_ICD_FILENAMES", "/nonexistent.json")];

#[test]
fn devices_that_do_not_exist_are_refused_with_the_next_step() {
    for command in ["doctor", "demo"] {
        let folder = tempfile::tempdir().unwrap();
        let stderr = failure(c4d([command, "-g", "999"]).current_dir(folder.path()), 4);
        assert!(stderr.contains("adapter 999 does not exist, expected 0"), "{stderr}");
        assert!(stderr.contains("next: c4d doctor lists the adapters"), "{stderr}");
        assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none(), "no output is written");
    }
    let stderr = failure(&mut c4d(["doctor", "--gpu", "cuda"]), 2);
    assert!(stderr.contains("unknown device `cuda`: expected auto, cpu or the number"), "{stderr}");
}

#[test]
#[cfg(target_os = "linux")]
fn without_a_driver_the_cpu_renders_unless_an_adapter_was_requested() {
    let (stdout, _) = success(c4d(["doctor"]).envs(NO_DRIVER));
    assert!(
        stdout.contains("CPU, ") && stdout.contains("no graphics adapter found; none is needed"),
        "{stdout}"
    );
    let stderr = failure(c4d(["doctor", "-g", "0"]).envs(NO_DRIVER), 4);
    assert!(
        stderr.contains("no usable graphics adapter found; adapters present: none"),
        "{stderr}"
    );
    assert!(stderr.contains("--gpu cpu works without one"), "{stderr}");
}

/// Drivers' errors about a missing desktop session are suppressed.
#[test]
#[cfg(target_os = "linux")]
fn without_a_desktop_no_driver_errors_are_printed() {
    let mut command = c4d(["doctor", "-g", "0"]);
    let (stdout, stderr) =
        success(command.env_remove("NODEVICE_SELECT").env_remove("XDG_RUNTIME_DIR"));
    assert_eq!(stderr, "");
    assert!(
        stdout.contains("selected with `--gpu`") && stdout.contains("times as fast"),
        "{stdout}"
    );
}

#[test]
fn refinement_on_an_adapter_equals_that_on_the_cpu() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let model = fixture("deform4dgs/dynerf_like/model");
    let edited = at("edited.ply");
    recoloured(&model, folder.path(), &edited);
    let losses = |device: &str| -> Vec<f64> {
        let run = at(device);
        let arguments = ["propagate", path(&model), "--edited", path(&edited), "-o", path(&run)];
        let refine = ["--refine-size", "48x36", "--refine-frames", "3", "--samples", "8"];
        success(c4d(arguments).args(refine).args(["--gpu", device]));
        report(&run)
    };
    let (cpu, gpu) = (losses("cpu"), losses("0"));
    assert!(cpu[1] < cpu[0], "the loss falls: {cpu:?}");
    for (a, b) in gpu.iter().zip(&cpu) {
        assert!((a - b).abs() < 0.03 * b, "losses before and after: {gpu:?} {cpu:?}");
    }
}

/// Losses before and after.
fn report(run: &Path) -> Vec<f64> {
    let text = std::fs::read_to_string(run.join("refine.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    ["before", "after"].map(|when| report["loss"][when].as_f64().unwrap()).to_vec()
}
