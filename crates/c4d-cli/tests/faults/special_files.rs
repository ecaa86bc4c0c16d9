//! FIFOs and devices as inputs and outputs, and non-finite numbers.

use crate::setup::Setup;
use crate::support::{c4d, failure, success};
use std::fs;
use std::process::Command;
use std::time::Duration;

fn make_fifo(path: &std::path::Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success(), "mkfifo");
}

/// Reading a FIFO would block forever; the timeout is one minute.
fn refused(arguments: &[&str], code: i32, expected: &str) {
    let stderr = failure(c4d(arguments).timeout(Duration::from_mins(1)), code);
    assert!(stderr.contains(expected) && stderr.contains("  next: "), "{arguments:?}: {stderr}");
}

#[test]
fn fifos_and_devices_are_refused_as_inputs() {
    let setup = Setup::new();
    let (fifo, run) = (setup.text("fifo"), setup.text("run"));
    make_fifo(&setup.at("fifo"));
    for (special, what) in [(fifo.as_str(), "a FIFO"), ("/dev/zero", "a device")] {
        let out = setup.text("out");
        refused(&["info", special], 3, what);
        refused(&["freeze", special, "-o", &out], 3, what);
        refused(&["propagate", &run, "--edited", special, "-o", &out], 3, what);
        refused(&["render", &run, "--cameras", special, "-o", &out], 3, what);
        let config = setup.at("run/c4d.toml");
        let text = fs::read_to_string(&config).unwrap();
        let pointed: String = text
            .lines()
            .map(|line| match line.split_once(" = ") {
                Some((key @ ("source" | "source_from_run"), _)) => {
                    format!("{key} = \"{special}\"\n")
                }
                _ => format!("{line}\n"),
            })
            .collect();
        fs::write(&config, pointed).unwrap();
        refused(&["info", &run], 3, what);
        fs::remove_file(&config).unwrap();
        if special == fifo {
            make_fifo(&config);
        } else {
            std::os::unix::fs::symlink(special, &config).unwrap();
        }
        refused(&["info", &run], 3, what);
        fs::remove_file(&config).unwrap();
        fs::write(&config, text).unwrap();
        success(&mut c4d(["info", &run]));
    }
}

#[test]
fn fifos_and_devices_are_refused_as_outputs() {
    let setup = Setup::new();
    for job in setup.jobs() {
        make_fifo(&setup.at(job.output));
        let command = setup.command(&job, &["-w"]);
        let stderr = failure(&mut assert_cmd::Command::from_std(command), 2);
        assert!(
            stderr.contains("is a FIFO") && stderr.contains("  next: "),
            "{}: {stderr}",
            job.name
        );
        fs::remove_file(setup.at(job.output)).unwrap();
    }
    let run = setup.text("run");
    refused(&["export", &run, "--to", "spz", "-w", "-o", "/dev/null"], 2, "a device");
}

#[test]
fn non_finite_numbers_are_refused() {
    let setup = Setup::new();
    let run = setup.text("run");
    let config = setup.at("run/c4d.toml");
    let text = fs::read_to_string(&config).unwrap();
    for key in ["edit_time", "rotation_prior"] {
        for number in ["nan", "inf", "-inf"] {
            let broken: String = text
                .lines()
                .map(|line| match line.split_once(" = ") {
                    Some((found, _)) if found == key => format!("{key} = {number}\n"),
                    _ => format!("{line}\n"),
                })
                .collect();
            fs::write(&config, broken).unwrap();
            refused(&["info", &run], 3, key);
        }
    }
    fs::write(&config, text).unwrap();
    let scene = setup.at("run/scene.c4d");
    let mut bytes = fs::read(&scene).unwrap();
    // safetensors: the length of a JSON header, the header, and tensors at its offsets.
    let length = usize::try_from(u64::from_le_bytes(bytes[..8].try_into().unwrap())).unwrap();
    let header: serde_json::Value = serde_json::from_slice(&bytes[8..8 + length]).unwrap();
    let offset = header["edited.means"]["data_offsets"][0].as_u64().unwrap();
    let at = 8 + length + usize::try_from(offset).unwrap();
    bytes[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    fs::write(&scene, bytes).unwrap();
    refused(&["info", &run], 3, "expected a finite number");
}
