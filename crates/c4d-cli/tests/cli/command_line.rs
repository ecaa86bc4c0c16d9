//! Previews and help: stills of edited frames, dry runs,
//! durations of videos, flags listed by the help.

use crate::support::{c4d, failure, fixture, listing, success};
use gs_io::{Existing, ply};
use std::path::Path;

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn pixels(png: &Path) -> (u32, u32, Vec<[u8; 3]>) {
    let image = image::open(png).unwrap().to_rgb8();
    let (width, height) = image.dimensions();
    (width, height, image.pixels().map(|pixel| pixel.0).collect())
}

#[test]
fn a_frame_of_any_format_is_rendered_as_a_still() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let edited = fixture("synth/edited.ply");
    let small = ["--size", "96x72", "-g", "cpu"];
    success(c4d(["render", path(&edited), "-o", path(&at("a.png"))]).args(small));
    let (width, height, still) = pixels(&at("a.png"));
    assert_eq!((width, height), (96, 72), "one image, not a sheet of sixty");
    assert!(still.iter().filter(|pixel| pixel[0] > 60).count() > 500, "the scene is visible");
    success(c4d(["render", path(&edited), "-o", path(&at("stills"))]).args(small));
    assert_eq!(listing(&at("stills")), ["rgb/00000.png"], "one frame in a folder");

    // The same in other formats, and from a frame of a run.
    let run = at("run");
    let source = fixture("synth/source");
    let propagate = ["propagate", "--no-refine", path(&source), "--edited"];
    success(c4d(propagate).args([path(&edited), "-o", path(&run)]));
    for name in ["frame.spz", "frame.splat", "frame.compressed.ply"] {
        let frame = at(name);
        success(&mut c4d(["export", path(&run), "--time", "0", "-o", path(&frame)]));
        let png = at(&format!("{name}.png"));
        success(c4d(["render", path(&frame), "--up", "y", "-o", path(&png)]).args(small));
        let (_, _, found) = pixels(&png);
        assert!(found.iter().filter(|pixel| pixel[0] > 60).count() > 500, "{name} is visible");
    }
    // With an orbit, a still has several frames.
    let orbit = ["render", path(&edited), "--cameras", "orbit", "--frames", "3"];
    success(c4d(orbit).args(["-o", path(&at("orbit"))]).args(small));
    assert_eq!(listing(&at("orbit")).len(), 3, "three frames of a turn");
}

#[test]
fn stills_of_other_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.png");
    let text = folder.path().join("a.ply");
    std::fs::write(&text, "ply\nformat ascii 1.0\nelement vertex 0\nend_header\n").unwrap();
    failure(&mut c4d(["render", path(&text), "-o", path(&out)]), 3);
    failure(&mut c4d(["render", "missing.ply", "-o", path(&out)]), 3);
    let edited = fixture("synth/edited.ply");
    failure(&mut c4d(["render", path(&edited), "--side-by-side", "-o", path(&out)]), 2);
    assert!(!out.exists(), "no output is written");
}

/// The edit: some splats recoloured, some removed, some added.
fn dry_run(folder: &Path, more: &[&str]) -> assert_cmd::Command {
    let edit = folder.join("edit.ply");
    if !edit.exists() {
        let mut splats = ply::read_file(&fixture("synth/source/frame_00000.ply")).unwrap().splats;
        let coeffs = splats.sh_coeffs();
        for row in 0..300 {
            splats.sh[row * coeffs] = [2.0, -1.0, -1.0];
        }
        let kept: Vec<usize> = (0..splats.len() - 120).collect();
        let mut splats = splats.select(&kept);
        for row in 0..50 {
            let copy = splats.clone();
            splats.push_from(&copy, 900 + row);
            let mean = splats.means.last_mut().unwrap();
            *mean = [mean[0] + 0.01 * row as f32, mean[1] + 0.3, mean[2] + 0.2];
            splats.log_scales.last_mut().unwrap()[0] += 0.01 * row as f32;
        }
        let options = ply::WriteOptions::default();
        ply::write_file(&edit, &splats, &options, Existing::Refuse).unwrap();
    }
    let mut command = c4d(["propagate", path(&fixture("synth/source")), "--dry-run", "-g", "cpu"]);
    command.args(["--edited", path(&edit)]).args(more);
    command
}

#[test]
fn a_dry_run_counts_and_shows_changes_and_writes_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let (stdout, _) = success(&mut dry_run(folder.path(), &["-o", path(&run)]));
    let total = ply::read_file(&fixture("synth/source/frame_00000.ply")).unwrap().splats.len();
    let count = |name: &str| -> usize {
        let line = stdout.lines().find(|line| line.trim_start().starts_with(name)).unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    };
    assert_eq!(count("unchanged"), total - 420, "{stdout}");
    assert_eq!((count("recoloured"), count("new"), count("removed")), (300, 50, 120), "{stdout}");
    let picture = folder.path().join("run.preview.png");
    assert!(
        stdout.trim_end().ends_with(path(&picture)),
        "the last line names the picture: {stdout}"
    );
    assert!(!run.exists(), "no run");
    assert_eq!(listing(folder.path()), ["edit.ply", "run.preview.png"], "nothing else");

    let (width, height, shown) = pixels(&picture);
    assert!(width > 1900 && height > 480, "three panels: {width}×{height}");
    let third = (width / 3) as usize;
    let in_panel = |panel: usize, test: fn(&[u8; 3]) -> bool| {
        let rows = shown.chunks(width as usize).take(height as usize - 40);
        rows.flat_map(|row| &row[panel * third..(panel + 1) * third]).filter(|p| test(p)).count()
    };
    let green: fn(&[u8; 3]) -> bool = |p| p[1] > 100 && p[1] > p[0] + 60 && p[1] > p[2] + 50;
    let red: fn(&[u8; 3]) -> bool = |p| p[0] > 100 && p[0] > p[1] + 70 && p[0] > p[2] + 60;
    assert!(in_panel(2, green) > 20, "new splats are green: {}", in_panel(2, green));
    assert!(in_panel(2, red) > 5, "removed ones are red: {}", in_panel(2, red));

    // A second run replaces the image only with -w; a name may be given.
    failure(&mut dry_run(folder.path(), &["-o", path(&run)]), 2);
    success(&mut dry_run(folder.path(), &["-o", path(&run), "-w"]));
    let named = folder.path().join("look.png");
    success(&mut dry_run(folder.path(), &["-o", path(&named)]));
    assert!(named.is_file(), "named");
}

/// Duration of an MP4 in seconds, from its `mvhd` box.
fn duration(mp4: &Path) -> f64 {
    let bytes = std::fs::read(mp4).unwrap();
    let at = bytes.windows(4).position(|four| four == b"mvhd").unwrap() + 4;
    let number = |at: usize| f64::from(u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()));
    assert_eq!(bytes[at], 0, "32-bit times");
    number(at + 16) / number(at + 12)
}

#[test]
fn fewer_frames_do_not_shorten_the_clip() {
    let folder = tempfile::tempdir().unwrap();
    let source = fixture("synth/source");
    let render = |name: &str, more: &[&str]| {
        let mp4 = folder.path().join(name);
        let small = ["--size", "32x32", "-g", "cpu"];
        let stderr =
            success(c4d(["render", path(&source), "-o", path(&mp4)]).args(small).args(more)).1;
        (duration(&mp4), stderr)
    };
    // Three stored frames at 30 per second; any other number of frames has the same duration.
    let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 0.02;
    for frames in ["3", "6", "12"] {
        let (secs, _) = render(&format!("{frames}.mp4"), &["--frames", frames]);
        assert!(near(secs, 0.1), "{frames} frames last {secs} s");
    }
    let (secs, stderr) = render("long.mp4", &["--frames", "6", "--duration", "3"]);
    assert!(
        near(secs, 3.0) && stderr.contains("6 frames at 2 per second, 3.0 s"),
        "{secs} s: {stderr}"
    );
    let (secs, _) = render("rate.mp4", &["--duration", "2", "--fps", "5"]);
    assert!(near(secs, 2.0), "{secs} s");
    let (secs, _) = render("both.mp4", &["--frames", "8", "--fps", "4"]);
    assert!(near(secs, 2.0), "{secs} s");

    // An exported sequence stores its rate, and its clip has that duration.
    let slow = folder.path().join("slow");
    let export = ["export", path(&source), "--to", "ply-seq", "--frames", "4", "--duration", "2"];
    success(c4d(export).args(["-o", path(&slow)]));
    let manifest = std::fs::read_to_string(folder.path().join("slow.manifest.json")).unwrap();
    assert!(manifest.contains("\"fps\": 2.0"), "{manifest}");
    let mp4 = folder.path().join("slow.mp4");
    let again = ["render", path(&slow), "--frames", "9", "--size", "32x32", "-g", "cpu", "-o"];
    success(c4d(again).arg(&mp4));
    assert!(near(duration(&mp4), 2.0), "{} s", duration(&mp4));
}

#[test]
fn contradictory_and_ineffective_times_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let source = fixture("synth/source");
    let refused = |more: &[&str], name: &str, expected: &str| {
        let out = folder.path().join(name);
        let mut command = c4d(["render", path(&source), "--size", "32x32", "-o", path(&out)]);
        let stderr = failure(command.args(more), 2);
        assert!(stderr.contains(expected), "{more:?}: {stderr}");
        assert!(!out.exists(), "no output is written");
    };
    let three = ["--frames", "3", "--fps", "5", "--duration", "2"];
    refused(&three, "a.mp4", "any two determine the third");
    refused(&["--duration", "0"], "a.mp4", "--duration 0: expected seconds");
    refused(&["--duration", "-1"], "a.mp4", "expected seconds");
    refused(&["--duration", "nan"], "a.mp4", "expected seconds");
    refused(&["--fps", "0"], "a.mp4", "--fps 0: expected above 0");
    refused(&["--frames", "5000"], "a.mp4", "per second, players accept at most 1000");
    refused(&["--fps", "12"], "stills", "are for videos");
}

#[test]
fn flags_without_effect_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (source, cameras) = (fixture("synth/source"), fixture("cameras/dnerf"));
    let out = folder.path().join("out");
    let refused = |command: &[&str], expected: &str| {
        let stderr = failure(c4d(command).args([path(&source), "-o", path(&out)]), 2);
        assert!(stderr.contains(expected), "{command:?}: {stderr}");
        assert!(!out.exists(), "no output is written");
    };
    let given = ["--cameras", path(&cameras), "--up", "y"];
    refused(&[&["render"], &given[..]].concat(), "--up applies to front, orbit and spiral only");
    refused(&[&["freeze"], &given[..]].concat(), "--up applies to the built-in cameras only");
    refused(&["render", "--iteration", "7"], "--iteration and --set apply to model folders");
    refused(
        &["export", "--to", "ply-seq", "--set", "no_dx=true"],
        "this kind of scene has no such flag",
    );
    refused(&["export", "--to", "ply-seq", "--set", "axes=up"], "expected ply, rub or luf");
}

#[test]
fn the_help_lists_exactly_the_flags_of_a_command() {
    let help = |command: &[&str]| success(c4d(command).arg("--help")).0;
    let flags = ["--overwrite", "--gpu", "--iteration", "--set", "--no-progress", "--strict"];
    let expected: [(&[&str], [bool; 6]); 11] = [
        (&["info"], [false, false, true, true, false, true]),
        (&["doctor"], [false, true, false, false, false, true]),
        (&["freeze"], [true, true, true, true, true, true]),
        (&["propagate"], [true, true, true, true, true, true]),
        (&["refine"], [true, true, false, false, true, true]),
        (&["render"], [true, true, true, true, true, true]),
        (&["export"], [true, true, true, true, true, true]),
        (&["demo"], [true, true, false, false, true, true]),
        (&["gather"], [true, true, false, false, true, true]),
        (&["bench", "motion"], [true, false, false, false, true, true]),
        (&["bench", "suite"], [true, false, false, false, true, true]),
    ];
    for (command, uses) in expected {
        let text = help(command);
        for (flag, used) in flags.into_iter().zip(uses) {
            let listed = text.lines().any(|line| line.split_whitespace().any(|word| word == flag));
            assert_eq!(listed, used, "{command:?} {flag}");
        }
    }
    // Flags that are not listed are not accepted.
    let stderr = failure_of_usage(&["doctor", "-w"]);
    assert!(stderr.contains("unexpected argument"), "{stderr}");
}

/// Usage errors of the command-line parser.
fn failure_of_usage(arguments: &[&str]) -> String {
    let output = c4d(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn errors_name_the_flag_and_a_next_step_of_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let source = fixture("synth/source");
    let source = path(&source);
    let (absent, empty) = (folder.path().join("absent.toml"), folder.path().join("empty"));
    std::fs::create_dir(&empty).unwrap();
    let edited = fixture("synth/edited.ply");
    for (command, exit, expected) in [
        (&["demo", "--splats", "9"][..], 2, ["--splats 9: expected 1000", "c4d demo --help"]),
        (&["view", source, "--sh-degree", "4"], 2, ["--sh-degree 4: expected 0 to 3", "c4d view"]),
        (
            &["view", source, "--no-open", "--overlay", "changed"],
            2,
            ["no SCENE is a run", "choose parts or motion"],
        ),
        (&["refine", source], 3, ["is not a run folder", "that c4d propagate wrote"]),
        (&["freeze", path(&empty)], 3, ["not a scene: found an empty folder", "SCENE is"]),
        (
            &["propagate", source, "--edited", path(&edited), "--config", path(&absent)],
            3,
            ["cannot read", "Check that the name is right"],
        ),
    ] {
        let output = folder.path().join("out");
        let mut program = c4d(command);
        if !matches!(command[0], "view" | "refine") {
            program.args(["-o", path(&output)]);
        }
        let stderr = failure(&mut program, exit);
        assert!(expected.iter().all(|text| stderr.contains(text)), "{command:?}: {stderr}");
    }
}
