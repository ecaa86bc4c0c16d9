//! Overlays of `c4d render --passes` and `c4d export --overlay`.

use crate::support::{c4d, failure, fixture, success};
use crate::synth_run::synth_run;
use std::path::Path;

/// Colours of an image, and the number of pixels of each.
fn colors(path: &Path) -> Vec<([u8; 3], usize)> {
    let image = image::open(path).unwrap().to_rgb8();
    let mut counts = std::collections::BTreeMap::new();
    for pixel in image.pixels() {
        *counts.entry(pixel.0).or_insert(0) += 1;
    }
    counts.into_iter().collect()
}

#[test]
fn passes_show_parts_motion_confidence_and_changes() {
    let folder = tempfile::tempdir().unwrap();
    let run = synth_run(folder.path());
    let out = folder.path().join("passes");
    let passes = "parts,motion,confidence,changed,uncertainty";
    let arguments =
        ["--times", "0.5", "--size", "96x72", "--passes", passes, "--background", "0,0,1"];
    let (_, stderr) = success(c4d(["render"]).arg(&run).args(arguments).arg("-o").arg(&out));
    for name in ["parts", "motion", "confidence", "changed", "uncertainty"] {
        assert!(out.join(name).join("00000.png").is_file(), "{name}");
    }
    assert!(stderr.contains("part 1, "), "the legend counts splats: {stderr}");
    assert!(
        stderr.contains("unchanged") && stderr.contains("units"),
        "and names classes: {stderr}"
    );
    let images = ["parts", "motion", "confidence", "changed"]
        .map(|name| colors(&out.join(name).join("00000.png")));
    for (i, image) in images.iter().enumerate() {
        assert!(image.len() > 20, "colours of several classes, mixed");
        assert!(images[..i].iter().all(|other| other != image), "each pass is a different image");
    }

    // Values in formats that store them.
    let out = folder.path().join("numbers");
    let arguments = ["--times", "0.5", "--size", "96x72", "--format", "npy"];
    let render = |passes: &str| {
        let mut command = c4d(["render"]);
        command.arg(&run).args(arguments).args(["--passes", passes, "-o"]).arg(&out).arg("-w");
        success(&mut command);
        let bytes = std::fs::read(out.join(passes).join("00000.npy")).unwrap();
        String::from_utf8_lossy(&bytes[..128]).into_owned()
    };
    assert!(render("motion").contains("(72, 96"), "one number a pixel");
    assert!(render("parts").contains("(72, 96, 3"), "colours");
}

#[test]
fn overlays_of_edits_need_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let source = fixture("synth/source");
    for pass in ["confidence", "changed"] {
        let stderr = failure(
            c4d(["render"]).arg(&source).args(["--frames", "1", "--passes", pass, "-o"]).arg(&out),
            2,
        );
        assert!(stderr.contains("is not a run") && stderr.contains("parts or motion"), "{stderr}");
        assert!(!out.exists(), "nothing is left");
    }
    let run = synth_run(folder.path());
    let stderr = failure(
        c4d(["render"]).arg(&run).args(["--side-by-side", "--passes", "parts", "-o"]).arg(&out),
        2,
    );
    assert!(stderr.contains("--side-by-side shows"), "{stderr}");
}

#[test]
fn pages_offer_overlays() {
    let folder = tempfile::tempdir().unwrap();
    let run = synth_run(folder.path());
    let page = folder.path().join("page.html");
    let names = "parts,motion,uncertainty,confidence,changed";
    success(c4d(["export"]).arg(&run).args(["--frames", "2", "--overlay", names, "-o"]).arg(&page));
    let text = std::fs::read_to_string(&page).unwrap();
    for name in names.split(',') {
        assert!(text.contains(&format!("{{\"name\":\"{name}\",\"title\":")), "{name}");
    }
    let glb = folder.path().join("frame.glb");
    let stderr = failure(c4d(["export"]).arg(&run).args(["--overlay", "parts", "-o"]).arg(&glb), 2);
    assert!(stderr.contains("--overlay does not apply to glb"), "{stderr}");
}
