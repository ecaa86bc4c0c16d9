//! Animated exports and loops as users write them; a `.splatv` is a scene again; options that make no sense are refused.

use crate::support::{c4d, failure, fixture, success};
use std::fs;
use std::path::Path;

fn export<'a>(to: &'a str, output: &'a Path, more: &[&'a str]) -> Vec<String> {
    let source = fixture("synth/source");
    let front = ["export", source.to_str().unwrap(), "--to", to, "-o", output.to_str().unwrap()];
    front.iter().chain(more).map(|&word| word.to_owned()).collect()
}

#[test]
fn every_clip_format_is_written_and_says_what_it_loses() {
    let folder = tempfile::tempdir().unwrap();
    for (to, start, expected) in [
        ("splat4d", &b"SP4D"[..], "within"),
        ("usda", b"#usda 1.0", "sRGB"),
        ("splatv", &[0x4b, 0x67, 0, 0], "cubic"),
    ] {
        let path = folder.path().join(format!("clip.{to}"));
        let (out, said) = success(&mut c4d(export(to, &path, &[])));
        assert!(out.contains(&format!("clip.{to}")), "names the file: {out}");
        assert!(said.contains("not kept: ") && said.contains(expected), "{said}");
        assert!(fs::read(&path).unwrap().starts_with(start), "{to}");
        let said = failure(&mut c4d(export(to, &path, &[])), 2);
        assert!(said.contains("already exists"), "{said}");
        success(&mut c4d(export(to, &path, &["-w", "--frames", "1"])));
    }
    let path = folder.path().join("clip.splatv");
    success(&mut c4d(export("splatv", &path, &["-w"])));
    let clip = path.to_str().unwrap();
    let (out, _) = success(&mut c4d(["info", clip]));
    assert!(out.contains("animated splats") && out.contains("one cubic a splat"), "{out}");
    for (name, start) in [("loop.gif", &b"GIF89a"[..]), ("loop.webp", b"RIFF")] {
        let image = folder.path().join(name);
        let arguments =
            ["render", clip, "--size", "64x48", "--frames", "3", "-o", image.to_str().unwrap()];
        let (_, said) = success(&mut c4d(arguments));
        assert!(said.contains("not kept: "), "{said}");
        assert!(fs::read(&image).unwrap().starts_with(start), "{name}");
    }
}

#[test]
fn options_that_make_no_sense() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("clip");
    for (to, more, expected) in [
        ("splat4d", &["--frames", "0"][..], "--frames 0"),
        ("splat4d", &["--fps", "0"], "--fps"),
        ("usda", &["--fps", "NaN"], "--fps"),
        ("splat4d", &["--tolerance", "0"], "--tolerance"),
        ("splatv", &["--tolerance", "NaN"], "--tolerance"),
        ("usda", &["--tolerance", "0.1"], "exact"),
        ("splat4d", &["--force"], "--force"),
        ("splatv", &["--times", "0,7"], "--times 7"),
    ] {
        let said = failure(&mut c4d(export(to, &path, more)), 2);
        assert!(said.contains(expected), "{to} {more:?}: {said}");
    }
    let source = fixture("synth/source");
    let image = folder.path().join("loop.gif");
    let arguments = ["render", source.to_str().unwrap(), "--passes", "depth", "-o"];
    let said = failure(c4d(arguments).arg(&image), 2);
    assert!(said.contains("colour only"), "{said}");
    let broken = folder.path().join("broken.splatv");
    fs::write(&broken, [0x4b, 0x67, 0, 0, 255, 255, 255, 255]).unwrap();
    let said = failure(c4d(["info"]).arg(&broken), 3);
    assert!(said.contains("broken.splatv") && said.contains("header"), "{said}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing else is left");
}
