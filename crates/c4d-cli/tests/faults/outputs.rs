//! `-w` on output that this program did not write.

use crate::support::{c4d, failure, success};
use crate::workshop::{Workshop, content, names};
use std::fs;
use std::os::unix::fs::symlink;

/// A user's file at any depth, a changed output file, or a link prevents the replacement.
#[test]
fn folders_with_anything_else_are_kept() {
    let workshop = Workshop::new();
    for job in workshop.jobs() {
        let output = workshop.at(job.output);
        success(&mut assert_cmd::Command::from_std(workshop.command(&job, &[])));
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
                refused(&workshop, &job, "notes.txt");
                fs::remove_file(&own).unwrap();
                symlink("/etc/hostname", folder.join("notes.txt")).unwrap();
                refused(&workshop, &job, "is a link");
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
        refused(&workshop, &job, if output.is_dir() { "was changed since" } else { "expected" });
        assert!(fs::read(&file).unwrap() == changed, "{}: kept", job.name);
        fs::write(&file, bytes).unwrap();
        success(&mut assert_cmd::Command::from_std(workshop.command(&job, &["-w"])));
    }
}

fn refused(workshop: &Workshop, job: &crate::workshop::Job, expected: &str) {
    let before = content(&workshop.at(job.output));
    let said = failure(&mut assert_cmd::Command::from_std(workshop.command(job, &["-w"])), 2);
    assert!(said.contains(expected) && said.contains("  next: "), "{}: {said}", job.name);
    assert!(content(&workshop.at(job.output)) == before, "{}: everything is kept", job.name);
}

/// Links are neither replaced nor followed for writing; but files can be read from and written
/// into a linked folder.
#[test]
fn links_are_not_replaced() {
    let workshop = Workshop::new();
    fs::create_dir(workshop.at("mine")).unwrap();
    fs::write(workshop.at("mine/thesis.tex"), "years of work").unwrap();
    for job in workshop.jobs() {
        for target in ["mine", "mine/thesis.tex", "mine/absent"] {
            let link = workshop.at(job.output);
            symlink(workshop.at(target), &link).unwrap();
            let said =
                failure(&mut assert_cmd::Command::from_std(workshop.command(&job, &["-w"])), 2);
            assert!(
                said.contains("is a link to") && said.contains("  next: "),
                "{}: {said}",
                job.name
            );
            assert!(fs::symlink_metadata(&link).unwrap().is_symlink(), "{}: kept", job.name);
            assert_eq!(names(&workshop.at("mine")), ["thesis.tex"], "{}: kept", job.name);
            fs::remove_file(link).unwrap();
        }
    }
    symlink(workshop.at("run"), workshop.at("link-run")).unwrap();
    symlink(workshop.at("mine"), workshop.at("link")).unwrap();
    let (run, out) = (workshop.text("link-run"), workshop.text("link/frozen/"));
    success(&mut c4d(["freeze", &run, "-o", &out]));
    success(&mut c4d(["freeze", &run, "-w", "-o", &out]));
    success(&mut c4d(["refine", &run]));
    assert_eq!(names(&workshop.at("mine")), ["frozen", "thesis.tex"], "through the link");
}

/// Unusual but valid names.
#[test]
fn unusual_names() {
    let workshop = Workshop::new();
    let run = workshop.text("run");
    let long = "x".repeat(251);
    for name in ["two\nlines", "späte Größe", "-dash", ".hidden", "trailing.", long.as_str()] {
        let out = format!("--output={}", workshop.text(name));
        success(&mut c4d(["freeze", &run, &out]));
        success(&mut c4d(["freeze", &run, "-w", &out]));
        success(&mut c4d(["info", &workshop.text(name)]));
    }
    let clip = format!("{}.spz", &long[4..]);
    let out = format!("--output={}", workshop.text(&clip));
    success(&mut c4d(["export", &run, "--to", "spz", &out]));
    success(&mut c4d(["export", &run, "--to", "spz", "-w", &out]));
}
