//! `-w` on output that this program did not write.

use crate::setup::{Setup, content, names};
use crate::support::{c4d, failure, success};
use std::fs;
use std::os::unix::fs::symlink;

/// A user's file at any depth, a changed output file, or a link prevents the replacement.
#[test]
fn folders_with_other_files_are_kept() {
    let setup = Setup::new();
    for job in setup.jobs() {
        let output = setup.at(job.output);
        success(&mut assert_cmd::Command::from_std(setup.command(&job, &[])));
        if output.is_dir() {
            let mut folders = vec![output.clone()];
            let mut at = 0;
            while let Some(folder) = folders.get(at).cloned() {
                let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
                folders.extend(entries.filter(|path| path.is_dir()));
                at += 1;
            }
            for folder in folders {
                let own = folder.join("notes.txt");
                fs::write(&own, "mine").unwrap();
                refused(&setup, &job, "notes.txt");
                fs::remove_file(&own).unwrap();
                symlink("/etc/hostname", folder.join("notes.txt")).unwrap();
                refused(&setup, &job, "is a link");
                fs::remove_file(&own).unwrap();
            }
        }
        let files = content(&output);
        let (name, bytes) =
            files.iter().find(|(name, _)| !name.to_string_lossy().ends_with(".c4d-files")).unwrap();
        let file = if output.is_dir() { output.join(name) } else { output.clone() };
        let changed = if output.is_dir() {
            // One bit, the smallest change by an editor that saves in place.
            let mut changed = bytes.clone();
            *changed.last_mut().unwrap() ^= 1;
            changed
        } else {
            b"dear diary".to_vec()
        };
        fs::write(&file, &changed).unwrap();
        refused(&setup, &job, if output.is_dir() { "was changed since" } else { "expected" });
        assert!(fs::read(&file).unwrap() == changed, "{}: kept", job.name);
        fs::write(&file, bytes).unwrap();
        success(&mut assert_cmd::Command::from_std(setup.command(&job, &["-w"])));
    }
}

fn refused(setup: &Setup, job: &crate::setup::Job, expected: &str) {
    let before = content(&setup.at(job.output));
    let stderr = failure(&mut assert_cmd::Command::from_std(setup.command(job, &["-w"])), 2);
    assert!(stderr.contains(expected) && stderr.contains("  next: "), "{}: {stderr}", job.name);
    assert!(content(&setup.at(job.output)) == before, "{}: everything is kept", job.name);
}

/// Links are neither replaced nor followed for writing; but files can be read from and written
/// into a linked folder.
#[test]
fn links_are_not_replaced() {
    let setup = Setup::new();
    fs::create_dir(setup.at("mine")).unwrap();
    fs::write(setup.at("mine/thesis.tex"), "years of work").unwrap();
    for job in setup.jobs() {
        for target in ["mine", "mine/thesis.tex", "mine/absent"] {
            let link = setup.at(job.output);
            symlink(setup.at(target), &link).unwrap();
            let stderr =
                failure(&mut assert_cmd::Command::from_std(setup.command(&job, &["-w"])), 2);
            assert!(
                stderr.contains("is a link to") && stderr.contains("  next: "),
                "{}: {stderr}",
                job.name
            );
            assert!(fs::symlink_metadata(&link).unwrap().is_symlink(), "{}: kept", job.name);
            assert_eq!(names(&setup.at("mine")), ["thesis.tex"], "{}: kept", job.name);
            fs::remove_file(link).unwrap();
        }
    }
    symlink(setup.at("run"), setup.at("link-run")).unwrap();
    symlink(setup.at("mine"), setup.at("link")).unwrap();
    let (run, out) = (setup.text("link-run"), setup.text("link/frozen/"));
    success(&mut c4d(["freeze", &run, "-o", &out]));
    success(&mut c4d(["freeze", &run, "-w", "-o", &out]));
    success(&mut c4d(["refine", &run]));
    assert_eq!(names(&setup.at("mine")), ["frozen", "thesis.tex"], "through the link");
}

/// Unusual but valid names.
#[test]
fn unusual_names() {
    let setup = Setup::new();
    let run = setup.text("run");
    let long = "x".repeat(251);
    for name in ["two\nlines", "späte Größe", "-dash", ".hidden", "trailing.", long.as_str()] {
        let out = format!("--output={}", setup.text(name));
        success(&mut c4d(["freeze", &run, &out]));
        success(&mut c4d(["freeze", &run, "-w", &out]));
        success(&mut c4d(["info", &setup.text(name)]));
    }
    let clip = format!("{}.spz", &long[4..]);
    let out = format!("--output={}", setup.text(&clip));
    success(&mut c4d(["export", &run, "--to", "spz", &out]));
    success(&mut c4d(["export", &run, "--to", "spz", "-w", &out]));
}
