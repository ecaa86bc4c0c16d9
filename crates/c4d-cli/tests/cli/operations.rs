//! `c4d edit --select`: selections and actions from the command line, records and their replay,
//! invalid inputs.

use crate::support::{c4d, failure, fixture, listing, success};
use gs_core::Splats;
use gs_io::{Existing, ply};
use std::path::{Path, PathBuf};

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn splats(path: &Path) -> Splats {
    ply::read_file(path).unwrap().splats
}

fn source() -> PathBuf {
    fixture("synth/source")
}

/// `c4d edit` of the synthetic source with these arguments, in this folder.
fn edit(folder: &Path, arguments: &[&str]) -> assert_cmd::Command {
    let scene = std::fs::canonicalize(source()).unwrap();
    let mut command = c4d(["edit", text(&scene)].iter().chain(arguments));
    command.current_dir(folder);
    command
}

#[test]
fn an_edit_keeps_its_motion() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let arguments = [
        "--select",
        "moving & red>.3",
        "--hue",
        "120",
        "--saturation",
        "1.2",
        "-o",
        "edited.ply",
        "--preview",
        "look.png",
    ];
    let (stdout, _) = success(&mut edit(folder.path(), &arguments));
    assert!(stdout.contains("edited.ply"), "{stdout}");
    assert_eq!(listing(folder.path()), ["edited.edit.json", "edited.ply", "look.png"], "outputs");
    let (original, edited) = (splats(&source().join("frame_00000.ply")), splats(&at("edited.ply")));
    let changed = (0..original.len()).filter(|&i| original.sh_of(i) != edited.sh_of(i)).count();
    assert!(changed > 20 && changed < original.len(), "some are recoloured: {changed}");
    assert_eq!((&edited.means, &edited.quats), (&original.means, &original.quats), "colours only");

    let (run, frames) = (at("run"), at("frames"));
    success(&mut c4d([
        "propagate",
        text(&source()),
        "--edited",
        text(&at("edited.ply")),
        "-o",
        text(&run),
        "--no-refine",
    ]));
    success(&mut c4d([
        "export",
        text(&run),
        "--to",
        "ply-seq",
        "--frames",
        "3",
        "-o",
        text(&frames),
    ]));
    let last = splats(&source().join("frame_00002.ply"));
    let mut names = listing(&frames);
    names.retain(|name| Path::new(name).extension().is_some_and(|ending| ending == "ply"));
    let found = splats(&frames.join(names.last().unwrap()));
    assert_eq!(found.means, last.means, "recoloured splats move as before, bit for bit");
    for i in 0..last.len() {
        assert_eq!(found.sh_of(i), edited.sh_of(i), "and have their new colours");
    }
}

#[test]
fn styles_change_colours_of_the_selection() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let style = image::RgbImage::from_fn(90, 60, |x, y| {
        image::Rgb(if (x + y) / 6 % 2 == 0 { [30, 40, 120] } else { [240, 220, 90] })
    });
    style.save(at("style.png")).unwrap();
    let scene = gs_synth::demo(&gs_synth::DemoParams { num_splats: 20_000, ..Default::default() });
    let original = scene.unwrap().frame1().clone();
    ply::write_file(&at("in.ply"), &original, &ply::WriteOptions::default(), Existing::Refuse)
        .unwrap();
    let run = |arguments: &[&str]| {
        let mut command = c4d(["edit", "in.ply"].iter().chain(arguments));
        success(command.current_dir(folder.path()));
    };
    run(&["--select", "y>.5", "--style", "style.png:.8", "-o", "a.ply"]);
    let styled = splats(&at("a.ply"));
    assert_eq!((&original.means, &original.quats), (&styled.means, &styled.quats), "colours only");
    for row in 0..original.len() {
        let changed = original.sh_of(row) != styled.sh_of(row);
        assert_eq!(changed, original.means[row][1] > 0.5, "splat {row}: the selection changes");
    }
    // The synthetic source has too few splats to show patterns.
    let message = failure(&mut edit(folder.path(), &["--style", "style.png", "-o", "c.ply"]), 3);
    assert!(message.contains("splats small enough to show patterns"), "{message}");
    assert!(message.contains("--match-colors IMAGE --sliced"), "{message}");
}

#[test]
fn a_record_repeats_the_edit_from_anywhere() {
    let (folder, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    std::fs::write(folder.path().join("rows.txt"), "# picked\n3..40, 77\n").unwrap();
    let arguments = [
        "--time",
        "0.5",
        "--select",
        "ids rows.txt | part 1",
        "--duplicate",
        "--translate",
        "0,-.5,0",
        "--rotate",
        "0,45,0",
        "--select",
        "opacity<.9",
        "--opacity",
        "1.5",
        "-o",
        "a.ply",
    ];
    success(&mut edit(folder.path(), &arguments));
    let record = folder.path().join("a.edit.json");
    success(&mut edit(elsewhere.path(), &["--replay", text(&record), "-o", "b.ply"]));
    let bytes = |path: PathBuf| std::fs::read(path).unwrap();
    assert_eq!(
        bytes(folder.path().join("a.ply")),
        bytes(elsewhere.path().join("b.ply")),
        "the same bytes"
    );
    // The record of a replay is also a record; further steps follow it.
    let again = elsewhere.path().join("b.edit.json");
    success(&mut edit(
        elsewhere.path(),
        &["--replay", text(&again), "--select", "all", "--hue", "10", "-o", "c.ply"],
    ));
    assert!(
        std::fs::read_to_string(elsewhere.path().join("c.edit.json")).unwrap().contains("hue"),
        "added"
    );
    let stderr = failure(&mut edit(folder.path(), &arguments), 2);
    assert!(stderr.contains("already exists") && stderr.contains("-w"), "{stderr}");
}

#[test]
fn a_frozen_frame_is_edited_through_masks() {
    let folder = tempfile::tempdir().unwrap();
    let frozen = folder.path().join("frozen");
    success(&mut c4d(["freeze", text(&source()), "--time", "1", "-o", text(&frozen)]));
    let masks = frozen.join("masks");
    std::fs::create_dir(&masks).unwrap();
    let half =
        image::GrayImage::from_fn(64, 48, |x, _| image::Luma([if x < 32 { 255 } else { 0 }]));
    half.save(masks.join("front.png")).unwrap();
    let scene = text(&frozen).to_owned();
    let run = |arguments: &[&str]| {
        let mut command = c4d(["edit", &scene].iter().chain(arguments));
        command.current_dir(folder.path());
        command
    };
    let (stdout, _) = success(&mut run(&[
        "--select",
        "mask frozen/masks",
        "--color",
        "#c33:.8",
        "--stats",
        "-o",
        "red.ply",
    ]));
    let count: usize = stdout
        .split("mask frozen/masks: ")
        .nth(1)
        .unwrap()
        .split(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    let all = splats(&frozen.join("point_cloud.ply")).len();
    assert!(
        count > all / 20 && count < all * 3 / 4,
        "about half of the visible splats: {count} of {all}"
    );
    let header = ply::read_header_file(&folder.path().join("red.ply")).unwrap();
    assert!(
        header.comments.iter().any(|c| c == "c4d_time 1"),
        "the frame's time: {:?}",
        header.comments
    );

    let stderr = failure(&mut run(&["--select", "mask none", "--delete", "-o", "a.ply"]), 3);
    assert!(stderr.contains("none does not exist"), "{stderr}");
    let stderr = failure(&mut run(&["--select", "moving", "--delete", "-o", "a.ply"]), 2);
    assert!(stderr.contains("need a dynamic scene"), "{stderr}");
    image::GrayImage::new(64, 64).save(masks.join("orbit_00.png")).unwrap();
    let stderr =
        failure(&mut run(&["--select", "mask frozen/masks", "--delete", "-o", "a.ply"]), 3);
    assert!(stderr.contains("expected the proportions of its camera"), "{stderr}");
    assert!(!folder.path().join("a.ply").exists(), "no output is written");
}

#[test]
fn invalid_edits_are_refused_without_output() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("style.png"), b"\x89PNG\r\n\x1a\n and no more").unwrap();
    image::RgbImage::new(3, 200).save(folder.path().join("dot.png")).unwrap();
    std::fs::write(folder.path().join("far.txt"), "1 2 99999999").unwrap();
    std::fs::write(folder.path().join("words.txt"), "one two").unwrap();
    std::fs::write(folder.path().join("other.json"), "{}").unwrap();
    let before = listing(folder.path());
    let deep = "(".repeat(5000) + "all";
    for (arguments, code, expected) in [
        (vec!["--select", "sphere 0,0,0", "--delete"], 2, "    sphere 0,0,0\n                ^"),
        (vec!["--select", "color red", "--delete"], 2, "         ^"),
        (vec!["--select", &deep, "--delete"], 2, "nested more than"),
        (vec!["--select", "x>1e300", "--delete"], 2, "selects none of"),
        (vec!["--select", "size>nan", "--delete"], 2, "expected a number"),
        (vec!["--select", "all", "--delete"], 2, "would leave no splat"),
        (vec!["--select", "x>0", "--delete", "--hue", "9"], 2, "others with `--select` first"),
        (vec!["--translate", "1e300,0,0"], 2, "too large for single precision"),
        (vec!["--scale", "0"], 2, "a factor from 0.000001 to 1000000"),
        (vec!["--rotate", "0,90"], 2, "column 5"),
        (vec!["--select", "ids far.txt", "--delete"], 3, "splat 99999999 does not exist"),
        (vec!["--select", "ids words.txt", "--delete"], 3, "expected row numbers"),
        (vec!["--select", "ids missing.txt", "--delete"], 3, "missing.txt does not exist"),
        (vec!["--select", "part 99", "--delete"], 2, "the scene has part"),
        (vec!["--match-colors", "style.png"], 3, "not a picture that can be read"),
        (vec!["--match-colors", "far.txt"], 3, "not a picture that can be read"),
        (vec!["--style", "style.png"], 3, "not a picture that can be read"),
        (vec!["--style", "dot.png"], 3, "too few patches of 7×7 opaque pixels"),
        (vec!["--style", "dot.png:2"], 2, "column 9"),
        (vec!["--sliced"], 2, "must directly follow"),
        (vec!["--graft", "words.txt"], 3, "expected one frame of splats"),
        (vec!["--replay", "other.json"], 3, "not a record of c4d edit"),
        (vec!["--time", "7", "--hue", "9"], 2, "--time 7"),
        (vec!["--select", "all"], 2, "there is no action"),
    ] {
        let arguments: Vec<&str> = arguments.into_iter().chain(["-o", "out.ply"]).collect();
        let stderr = failure(&mut edit(folder.path(), &arguments), code);
        assert!(stderr.contains(expected), "{arguments:?}: {stderr}");
        assert!(stderr.contains("next: "), "{arguments:?}: {stderr}");
        assert_eq!(listing(folder.path()), before, "{arguments:?}: no output is written");
    }
    for (arguments, expected) in [
        (vec!["--hue", "9"], "no -o"),
        (vec![], "nothing to do"),
        (vec!["--hue", "9", "-o", "a.spz"], "3DGS PLY"),
        (vec!["--hue", "9", "--views", "x", "-o", "a.ply"], "exclude each other"),
        (vec!["--hue", "9", "-o", "a.ply", "--preview", "a.ply"], "the same file"),
    ] {
        let stderr = failure(&mut edit(folder.path(), &arguments), 2);
        assert!(stderr.contains(expected), "{arguments:?}: {stderr}");
    }
    // A picture that is an input is not replaced, even with -w.
    image::RgbImage::from_pixel(4, 4, image::Rgb([200, 30, 30]))
        .save(folder.path().join("in.png"))
        .unwrap();
    let arguments = ["--match-colors", "in.png", "--preview", "in.png", "-o", "a.ply", "-w"];
    let stderr = failure(&mut edit(folder.path(), &arguments), 2);
    assert!(stderr.contains("overlap"), "{stderr}");
}
