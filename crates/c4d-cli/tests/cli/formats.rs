//! Edited frames in lossy formats: splats that differ only by the
//! format's rounding keep their exact motion.

use crate::support::{c4d, failure, fixture, listing, success};
use gs_core::Splats;
use gs_io::{Axes, frame, gltf, ply, spz};
use std::fs::{self, File};
use std::path::Path;

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn propagate(source: &Path, edited: &Path, run: &Path) -> String {
    let arguments = ["propagate", path(source), "--edited", path(edited), "-o", path(run)];
    success(c4d(arguments).args(["--no-refine", "-w"])).1
}

fn exported(scene: &Path, out: &Path) -> Vec<Splats> {
    let export = ["export", path(scene), "--to", "ply-seq", "--frames", "3", "-w", "-o", path(out)];
    success(&mut c4d(export));
    let frames = listing(out);
    frames.iter().map(|name| ply::read_file(&out.join(name)).unwrap().splats).collect()
}

fn sorted(splats: &Splats) -> Splats {
    let mut order: Vec<usize> = (0..splats.len()).collect();
    let key =
        |&i: &usize| (splats.means[i].map(f32::to_bits), splats.log_scales[i].map(f32::to_bits));
    order.sort_by_key(key);
    splats.select(&order)
}

#[test]
fn untouched_frames_of_lossy_formats_move_like_the_source() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let source = fixture("synth/source");
    let original = exported(&source, &at("original"));
    for (format, file) in [
        ("compressed-ply", "a.compressed.ply"),
        ("spz", "a.spz"),
        ("glb", "a.glb"),
        ("gltf", "a.gltf"),
        ("splat", "a.splat"),
    ] {
        let edited = at(file);
        let (_, stderr) =
            success(&mut c4d(["export", path(&source), "--to", format, "-o", path(&edited)]));
        assert!(stderr.contains("not kept: "), "{format} lists its losses: {stderr}");
        let stderr = propagate(&source, &edited, &at("run"));
        let expected = format!("{} unchanged (exact), 0 recoloured", original[0].len());
        assert!(stderr.contains(&expected), "{format}: {stderr}");
        for (t, (found, truth)) in
            exported(&at("run"), &at("out")).iter().zip(&original).enumerate()
        {
            // Rows of compressed PLY have another order; every value
            // equals the source's, also at the edit time.
            assert_eq!(sorted(found), sorted(truth), "{format}, frame {t}: bit for bit");
        }
    }
    // A run and a zip of frames can be sources.
    let run = at("run");
    let again = at("again");
    success(&mut c4d([
        "export",
        path(&run),
        "--to",
        "zip",
        "--frames",
        "3",
        "-o",
        path(&at("clip.zip")),
    ]));
    for scene in [&run, &at("clip.zip")] {
        let stderr = propagate(scene, &at("a.splat"), &again);
        assert!(
            stderr.contains("0 recoloured (exact motion), 0 edited"),
            "{}: {stderr}",
            scene.display()
        );
    }
}

#[test]
fn edits_in_lossy_formats_are_detected() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let source = fixture("synth/source");
    let mut edited = exported(&source, &at("original")).swap_remove(0);
    let rows = edited.len();
    for splat in 0..10 {
        let first = splat * edited.sh_coeffs();
        edited.sh[first] = edited.sh[first].map(|dc| if dc > 0.5 { dc - 0.6 } else { dc + 0.6 });
    }
    for splat in 10..30 {
        edited.means[splat][1] += 0.05;
    }
    let file = at("edited.spz");
    spz::write(&edited, &spz::WriteOptions::default(), &mut File::create(&file).unwrap()).unwrap();
    let stderr = propagate(&source, &file, &at("run"));
    let expected =
        format!("{} unchanged (exact), 10 recoloured (exact motion), 0 edited or new", rows - 30);
    assert!(stderr.contains(&expected), "{stderr}");
    assert!(stderr.contains("20 splats moved as a group: moved by (0, 0.05, 0)"), "{stderr}");
}

#[test]
fn one_frame_as_ply_is_exact() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let source = fixture("synth/source");
    let frames = exported(&source, &at("frames"));
    let file = at("last.ply");
    success(&mut c4d(["export", path(&source), "--time", "1", "-o", path(&file)]));
    let read = ply::read_file(&file).unwrap();
    assert_eq!(read.splats, frames[2], "every bit of the last frame");
    assert!(read.has_normals, "as required by older readers");
    let again = ["export", path(&source), "--time", "1", "--no-normals", "-w", "-o", path(&file)];
    success(&mut c4d(again));
    assert!(!ply::read_file(&file).unwrap().has_normals, "unless requested");
}

#[test]
fn axes_are_those_in_which_the_frame_matches() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let source = fixture("synth/source");
    let original = exported(&source, &at("original")).swap_remove(0);
    let unchanged = format!("{} unchanged (exact), 0 recoloured", original.len());
    // A glTF whose data are in the axes of a PLY: with the axes of the
    // specification, it would be rotated by 180°.
    let mut bytes = Vec::new();
    gltf::write(&original, &gltf::WriteOptions::default(), &mut bytes).unwrap();
    let turned = frame::read(&bytes).unwrap().in_axes(Axes::PLY).splats;
    let file = at("theirs.glb");
    let mut out = File::create(&file).unwrap();
    gltf::write(&turned, &gltf::WriteOptions::default(), &mut out).unwrap();
    let stderr = propagate(&source, &file, &at("run"));
    assert!(stderr.contains("axes read as RDF (x right, y down, z front)"), "{stderr}");
    assert!(stderr.contains(&unchanged), "{stderr}");
    // Forced to the right and to the wrong axes.
    let forced = |axes: &str| {
        let run = at("run");
        let arguments = ["propagate", path(&source), "--edited", path(&file), "-o", path(&run)];
        c4d(arguments)
            .args(["--no-refine", "-w", "--allow-far", "--spz-axes", axes])
            .output()
            .unwrap()
    };
    let stderr = String::from_utf8(forced("ply").stderr).unwrap();
    assert!(stderr.contains(&unchanged), "{stderr}");
    let stderr = String::from_utf8(forced("luf").stderr).unwrap();
    assert!(!stderr.contains(&unchanged), "{stderr}");
    // Our SPZ states its axes, so no others are tried.
    let file = at("ours.spz");
    success(
        c4d(["export", path(&source), "--spz-axes", "ply", "-o", path(&file)])
            .args(["--spz-sh-bits", "8,3"]),
    );
    let stderr = propagate(&source, &file, &at("run"));
    assert!(stderr.contains(&unchanged) && !stderr.contains("axes read as"), "{stderr}");
    // A single file: the assumption is reported.
    let (text, _) = success(&mut c4d(["info", path(&fixture("frames/frame_v3.spz"))]));
    assert!(text.contains("read as RUB (x right, y up, z back)"), "{text}");
    let (text, _) = success(&mut c4d(["info", path(&file)]));
    assert!(text.contains("RDF (x right, y down, z front)"), "{text}");
    let out = at("no.spz");
    let stderr = failure(
        c4d(["export", path(&source), "--spz-sh-bits", "9", "-o", path(&out)]).args(["-q"]),
        2,
    );
    assert!(stderr.contains("expected 1 to 8") && !out.exists(), "{stderr}");
    let stderr = failure(
        c4d(["export", path(&source), "--spz-axes", "ply", "-o", path(&at("no.glb"))]).args(["-q"]),
        2,
    );
    assert!(stderr.contains("--spz-axes does not apply to glb"), "{stderr}");
}

#[test]
fn info_shows_frames_and_scenes_refuse_them() {
    let (text, _) = success(&mut c4d(["info", path(&fixture("frames/frame_v4.spz"))]));
    assert!(text.contains("SPZ version 4") && text.contains("rotations within"), "{text}");
    let (text, _) = success(&mut c4d(["info", path(&fixture("frames/frame.sog"))]));
    assert!(text.contains("SOG") && text.contains("sh_degree    3"), "{text}");
    let still = fixture("frames/frame.sog");
    let stderr = failure(&mut c4d(["export", path(&still), "--to", "html", "-o", "unwritten"]), 3);
    assert!(
        stderr.contains("is a single frame") && stderr.contains("propagate SCENE --edited"),
        "{stderr}"
    );
    let folder = tempfile::tempdir().unwrap();
    let clip = folder.path().join("clip");
    fs::write(&clip, b"glTF and so on").unwrap();
    let stderr = failure(&mut c4d(["info", path(&clip)]), 3);
    assert!(stderr.contains("glTF version") && stderr.contains("next"), "{stderr}");
    fs::write(&clip, b"something else").unwrap();
    let stderr = failure(&mut c4d(["info", path(&clip)]), 3);
    assert!(stderr.contains("starts with `something else`"), "{stderr}");
    let out = folder.path().join("a.spz");
    let stderr = failure(
        c4d(["export", path(&fixture("synth/source")), "--to", "spz", "-o", path(&out)])
            .args(["--spz-version", "2"]),
        2,
    );
    assert!(stderr.contains("expected 3 or 4") && !out.exists(), "{stderr}");
    assert!(frame::read_file(&fixture("frames/frame.ply")).is_ok(), "the fixture is a frame");
}
