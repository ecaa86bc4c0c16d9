//! Animated exports and loops; a `.splatv` can be opened as a scene; options without effect are
//! refused.

use crate::support::{c4d, failure, fixture, success};
use std::fs;
use std::path::Path;

fn export<'a>(to: &'a str, output: &'a Path, more: &[&'a str]) -> Vec<String> {
    let source = fixture("synth/source");
    let front = ["export", source.to_str().unwrap(), "--to", to, "-o", output.to_str().unwrap()];
    front.iter().chain(more).map(|&word| word.to_owned()).collect()
}

#[test]
fn every_clip_format_is_written_and_reports_losses() {
    let folder = tempfile::tempdir().unwrap();
    for (to, start, expected) in [
        ("splat4d", &b"SP4D"[..], "within"),
        ("4dgs", b"\x894DGS", "linear in pieces"),
        ("usda", b"#usda 1.0", "sRGB"),
        ("splatv", &[0x4b, 0x67, 0, 0], "cubic"),
    ] {
        let path = folder.path().join(format!("clip.{to}"));
        let (out, stderr) = success(&mut c4d(export(to, &path, &[])));
        assert!(out.contains(&format!("clip.{to}")), "names the file: {out}");
        assert!(stderr.contains("not kept: ") && stderr.contains(expected), "{stderr}");
        assert!(fs::read(&path).unwrap().starts_with(start), "{to}");
        let stderr = failure(&mut c4d(export(to, &path, &[])), 2);
        assert!(stderr.contains("already exists"), "{stderr}");
        success(&mut c4d(export(to, &path, &["-w", "--frames", "1"])));
    }
    let path = folder.path().join("clip.splatv");
    success(&mut c4d(export("splatv", &path, &["-w"])));
    let clip = path.to_str().unwrap();
    let (out, _) = success(&mut c4d(["info", clip]));
    assert!(out.contains("animated splats") && out.contains("cubic"), "{out}");
    let path = folder.path().join("clip.splat4d");
    let up = ["-w", "--frames", "4", "--fps", "12", "--up", "z"];
    success(&mut c4d(export("splat4d", &path, &up)));
    let (out, _) = success(c4d(["info"]).arg(&path));
    for fact in
        ["compressed clip", "frames       4", "fps          12", "up           [0.0,0.0,1.0]"]
    {
        assert!(out.contains(fact), "{fact}: {out}");
    }
    let frozen = folder.path().join("frozen");
    success(c4d(["freeze"]).arg(&path).arg("-o").arg(&frozen));
    let run = folder.path().join("run");
    let edited = frozen.join("point_cloud.ply");
    let mut propagate = c4d(["propagate", "--no-refine", "--edited"]);
    let (_, stderr) = success(propagate.arg(&edited).arg(&path).arg("-o").arg(&run));
    assert!(stderr.contains("0 recoloured (exact motion), 0 edited"), "{stderr}");
    fs::write(&path, &fs::read(&path).unwrap()[..1000]).unwrap();
    let stderr = failure(c4d(["info"]).arg(&path), 3);
    assert!(stderr.contains("truncated") && stderr.contains("next: Copy or export"), "{stderr}");
    for (name, start) in [("loop.gif", &b"GIF89a"[..]), ("loop.webp", b"RIFF")] {
        let image = folder.path().join(name);
        let arguments =
            ["render", clip, "--size", "64x48", "--frames", "3", "-o", image.to_str().unwrap()];
        let (_, stderr) = success(&mut c4d(arguments));
        assert!(stderr.contains("not kept: "), "{stderr}");
        assert!(fs::read(&image).unwrap().starts_with(start), "{name}");
    }
}

#[test]
fn options_without_effect_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("clip");
    for (to, more, expected) in [
        ("splat4d", &["--frames", "0"][..], "--frames 0"),
        ("splat4d", &["--fps", "0"], "--fps"),
        ("usda", &["--fps", "NaN"], "--fps"),
        ("splat4d", &["--tolerance", "0"], "--tolerance"),
        ("4dgs", &["--tolerance", "2"], "--tolerance"),
        ("4dgs", &["--up", "z"], "--up"),
        ("splatv", &["--tolerance", "NaN"], "--tolerance"),
        ("usda", &["--tolerance", "0.1"], "--tolerance does not apply to usda"),
        ("splat4d", &["--force"], "--force"),
        ("splatv", &["--times", "0,7"], "--times 7"),
        ("spz", &["--frames", "3"], "--frames does not apply to spz"),
        ("html", &["--time", "0.5"], "--time does not apply to html"),
        ("splatv", &["--sh-degree", "1"], "--sh-degree above 0 does not apply to splatv"),
        ("zip", &["--title", "A walk"], "it applies to html"),
    ] {
        let stderr = failure(&mut c4d(export(to, &path, more)), 2);
        assert!(stderr.contains(expected), "{to} {more:?}: {stderr}");
    }
    let source = fixture("synth/source");
    let image = folder.path().join("loop.gif");
    let arguments = ["render", source.to_str().unwrap(), "--passes", "depth", "-o"];
    let stderr = failure(c4d(arguments).arg(&image), 2);
    assert!(stderr.contains("colour only"), "{stderr}");
    let broken = folder.path().join("broken.splatv");
    fs::write(&broken, [0x4b, 0x67, 0, 0, 255, 255, 255, 255]).unwrap();
    let stderr = failure(c4d(["info"]).arg(&broken), 3);
    assert!(stderr.contains("broken.splatv") && stderr.contains("header"), "{stderr}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing else remains");
}

#[test]
fn the_name_implies_the_format() {
    let folder = tempfile::tempdir().unwrap();
    let source = fixture("synth/source");
    let source = source.to_str().unwrap();
    let path = folder.path().join("one.spz");
    success(&mut c4d(["export", source, "-o", path.to_str().unwrap()]));
    let (out, _) = success(&mut c4d(["info", path.to_str().unwrap()]));
    assert!(out.contains("SPZ frame"), "{out}");
    let stderr = failure(&mut c4d(["export", source, "-o", folder.path().to_str().unwrap()]), 2);
    assert!(stderr.contains("--to is missing") && stderr.contains("next: "), "{stderr}");
}

#[test]
fn info_names_formats_that_are_only_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("clip.usda");
    success(&mut c4d(export("usda", &path, &["--frames", "2"])));
    let (out, _) = success(&mut c4d(["info", path.to_str().unwrap()]));
    assert!(out.contains("OpenUSD") && out.contains("cannot be read back"), "{out}");
    let images = folder.path().join("images");
    let source = fixture("synth/source");
    let render = ["render", source.to_str().unwrap(), "--size", "16x12", "--frames", "2"];
    let mut render = c4d(render.into_iter().chain(["--passes", "rgb,depth", "--format", "exr"]));
    success(render.arg("-o").arg(&images));
    let (out, _) = success(c4d(["info"]).arg(&images));
    assert!(out.contains("depth: 2 files, each an OpenEXR image"), "{out}");
    assert!(out.contains("next") && out.contains("use the scene"), "{out}");
    let (out, _) = success(c4d(["info"]).arg(images.join("rgb")));
    assert!(out.contains("2 files, each an OpenEXR image"), "{out}");
    let field = fixture("swift4d/model/point_cloud/iteration_13000/FDHash.pth");
    let (out, _) = success(&mut c4d(["info", field.to_str().unwrap()]));
    assert!(out.contains("PyTorch") && out.contains("part of a Swift4D model folder"), "{out}");
}

#[test]
fn a_manifest_is_written_next_to_a_sequence() {
    let folder = tempfile::tempdir().unwrap();
    let times = ["--times", "0,0.25,1", "--fps", "12.5"];
    for (to, name) in [("ply-seq", "frames"), ("compressed-seq", "small"), ("zip", "frames.zip")] {
        let output = folder.path().join(name);
        let manifest = folder.path().join(format!("{name}.manifest.json"));
        let (_, stderr) = success(&mut c4d(export(to, &output, &times)));
        assert!(stderr.contains("the manifest next to it"), "{stderr}");
        let read = || -> serde_json::Value {
            serde_json::from_slice(&fs::read(&manifest).unwrap()).unwrap()
        };
        let found = read();
        assert_eq!(found["fps"], 12.5, "{found}");
        assert_eq!(found["num_frames"], 3, "{found}");
        assert_eq!(found["times"], serde_json::json!([0.0, 0.25, 1.0]), "{found}");
        assert!(found["num_splats"].as_u64().unwrap() > 0, "{found}");
        let (out, _) = success(&mut c4d(["info", manifest.to_str().unwrap()]));
        assert!(out.contains("manifest of an exported sequence"), "{out}");
        assert!(found["sh_degree"].as_u64().unwrap() <= 3, "{found}");

        // A manifest without its output is replaced, but other files are not.
        if output.is_dir() {
            fs::remove_dir_all(&output).unwrap();
        } else {
            fs::remove_file(&output).unwrap();
        }
        success(&mut c4d(export(to, &output, &["--frames", "2"])));
        assert_eq!(read()["num_frames"], 2, "replaced");
        let stderr = failure(&mut c4d(export(to, &output, &["--frames", "4"])), 2);
        assert!(stderr.contains(&format!("{name} already exists")), "{stderr}");
        assert_eq!(read()["num_frames"], 2, "unchanged");
        let other = folder.path().join(format!("other_{name}.manifest.json"));
        fs::write(&other, "{\"kind\": \"of my own\"}").unwrap();
        let unwritten = folder.path().join(format!("other_{name}"));
        let stderr = failure(&mut c4d(export(to, &unwritten, &["--frames", "2"])), 2);
        assert!(stderr.contains("manifest.json already exists") && !unwritten.exists(), "{stderr}");
        fs::remove_file(other).unwrap();
    }
    let names: Vec<_> = fs::read_dir(folder.path()).unwrap().flatten().collect();
    let records = [".frames.c4d-files", ".small.c4d-files"].map(|name| folder.path().join(name));
    assert!(records.iter().all(|record| record.is_file()), "the output is recorded: {names:?}");
    assert_eq!(names.len(), 6 + 2, "an output and a manifest each, nothing else: {names:?}");
    let mut frames = fs::read_dir(folder.path().join("frames")).unwrap().flatten();
    assert!(frames.all(|entry| entry.path().extension().unwrap() == "ply"), "frames alone");
}
