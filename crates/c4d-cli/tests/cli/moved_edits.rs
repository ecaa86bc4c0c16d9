//! Edits that were moved, belong to a different time, or are incomplete:
//! messages, refusals, and the effect of the flags.

use crate::support::{c4d, failure, fixture, success};
use amg::Similarity;
use gs_core::Splats;
use gs_io::{Existing, ply};
use std::path::{Path, PathBuf};

const HALF_TURN_ABOUT_X: Similarity =
    Similarity { rotation: [0.0, 1.0, 0.0, 0.0], ..Similarity::IDENTITY };

struct Setup {
    folder: tempfile::TempDir,
}

impl Setup {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn save(&self, name: &str, splats: &Splats) -> PathBuf {
        let file = self.at(name);
        ply::write_file(&file, splats, &ply::WriteOptions::default(), Existing::Refuse).unwrap();
        file
    }

    /// `c4d propagate` of the synthetic source; the run is called `run`.
    fn propagate(&self, edited: &Path, run: &str, flags: &[&str]) -> assert_cmd::Command {
        propagate(&fixture("synth/source"), edited, &self.at(run), flags)
    }

    /// Three frames of a run.
    fn frames(&self, run: &str) -> Vec<Splats> {
        let out = self.at(&format!("{run}-frames"));
        let run = self.at(run);
        success(&mut c4d([
            "export",
            text(&run),
            "--to",
            "ply-seq",
            "--frames",
            "3",
            "-o",
            text(&out),
        ]));
        read_frames(&out)
    }
}

fn propagate(source: &Path, edited: &Path, run: &Path, flags: &[&str]) -> assert_cmd::Command {
    let fixed =
        ["propagate", text(source), "--edited", text(edited), "-o", text(run), "--no-refine"];
    c4d(fixed.iter().chain(flags).copied().collect::<Vec<_>>())
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn read_frames(folder: &Path) -> Vec<Splats> {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "ply"));
    files.sort();
    files.iter().map(|file| ply::read_file(file).unwrap().splats).collect()
}

fn originals() -> Vec<Splats> {
    read_frames(&fixture("synth/source"))
}

/// Splats within `radius` of the highest one that moves between the first two frames.
fn top(frames: &[Splats], radius: f32) -> Vec<usize> {
    let first = &frames[0].means;
    let apart =
        |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>().sqrt();
    let highest = (0..first.len())
        .filter(|&i| apart(first[i], frames[1].means[i]) > 0.01)
        .max_by(|&a, &b| first[a][1].total_cmp(&first[b][1]))
        .unwrap();
    (0..first.len()).filter(|&i| apart(first[i], first[highest]) <= radius).collect()
}

fn with_placed(splats: &Splats, rows: &[usize], similarity: &Similarity) -> Splats {
    let (placed, mut edited) = (similarity.transform(&splats.select(rows)), splats.clone());
    let coeffs = edited.sh_coeffs();
    for (i, &row) in rows.iter().enumerate() {
        edited.means[row] = placed.means[i];
        edited.quats[row] = placed.quats[i];
        edited.log_scales[row] = placed.log_scales[i];
        edited.sh[row * coeffs..][..coeffs].copy_from_slice(placed.sh_of(i));
    }
    edited
}

#[test]
fn a_rotated_scene_is_detected_and_align_undoes_it() {
    let (setup, frames) = (Setup::new(), originals());
    let edited = setup.save("turned.ply", &HALF_TURN_ABOUT_X.transform(&frames[0]));
    let stderr = failure(&mut setup.propagate(&edited, "refused", &[]), 3);
    assert!(stderr.contains("is the scene rotated 180° about x"), "{stderr}");
    assert!(stderr.contains("--align"), "the next step: {stderr}");
    assert!(!setup.at("refused").exists(), "no output is written");

    let (_, stderr) = success(&mut setup.propagate(&edited, "run", &["--align"]));
    assert!(stderr.contains("rotated 180° about x: this was undone"), "{stderr}");
    for (found, original) in setup.frames("run").iter().zip(&frames) {
        assert_eq!(found, original, "the source's own values, bit for bit");
    }
    // Without --align, the scene moves in the rotated frame.
    let (_, stderr) = success(&mut setup.propagate(&edited, "kept", &["--allow-far"]));
    assert!(stderr.contains("keeps this"), "{stderr}");
    let last = HALF_TURN_ABOUT_X.transform(frames.last().unwrap());
    let found = setup.frames("kept");
    let far = |a: &Splats, b: &Splats| {
        let pairs = a.means.iter().zip(&b.means);
        pairs
            .map(|(x, y)| (0..3).map(|k| (x[k] - y[k]).abs()).fold(0.0, f32::max))
            .fold(0.0, f32::max)
    };
    assert!(
        far(&found[2], &last) < 1e-4,
        "trajectories are also rotated: {}",
        far(&found[2], &last)
    );
    let path = far(&found[0], &found[1]).max(far(&found[0], &found[2]));
    assert!(path > 1e-2, "negative control: it moves by {path}");
}

#[test]
fn axes_scale_and_handedness_of_other_tools() {
    let (setup, frames) = (Setup::new(), originals());
    let half = std::f64::consts::FRAC_1_SQRT_2;
    for (name, similarity, words) in [
        (
            "z_up",
            Similarity { rotation: [half, half, 0.0, 0.0], ..Similarity::IDENTITY },
            "rotated 90° about x: y and z exchanged as the upward axis",
        ),
        ("centimetres", Similarity { scale: 100.0, ..Similarity::IDENTITY }, "scaled by 100"),
        (
            "mirrored",
            Similarity { rotation: [0.0, 0.0, 0.0, 1.0], mirrored: true, ..Similarity::IDENTITY },
            "mirrored along z",
        ),
        (
            "elsewhere",
            Similarity { translation: [40.0, 0.0, -7.0], ..Similarity::IDENTITY },
            "moved by (40, 0, -7)",
        ),
    ] {
        let edited = setup.save(&format!("{name}.ply"), &similarity.transform(&frames[0]));
        let stderr = failure(&mut setup.propagate(&edited, &format!("{name}-no"), &[]), 3);
        assert!(stderr.contains(words), "{name}: {stderr}");
        success(&mut setup.propagate(&edited, name, &["--align"]));
        assert_eq!(setup.frames(name)[1], frames[1], "{name}: bit for bit");
    }
    // For an unchanged edit there is nothing to undo.
    let same = setup.save("same.ply", &frames[0]);
    let (_, stderr) = success(&mut setup.propagate(&same, "same", &["--align"]));
    assert!(stderr.contains("nothing to undo"), "{stderr}");
}

#[test]
fn a_scaled_selection_is_counted_and_stored() {
    let (setup, frames) = (Setup::new(), originals());
    let rows = top(&frames, 0.4);
    assert!(rows.len() > 20, "{} splats selected", rows.len());
    let n = rows.len() as f64;
    let sum = |k: usize| rows.iter().map(|&i| f64::from(frames[0].means[i][k])).sum::<f64>();
    let centre = [0, 1, 2].map(|k| sum(k) / n);
    let similarity =
        Similarity { scale: 1.3, translation: centre.map(|c| -0.3 * c), ..Similarity::IDENTITY };
    let edited = setup.save("scaled.ply", &with_placed(&frames[0], &rows, &similarity));
    let (_, stderr) = success(&mut setup.propagate(&edited, "run", &[]));
    let expected = format!("{} splats moved as a group: scaled by 1.3", rows.len());
    assert!(stderr.contains(&expected), "expected `{expected}`: {stderr}");
    let json = std::fs::read_to_string(setup.at("run/run.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["edited"]["moved"], rows.len(), "run.json");
    let (shown, _) = success(&mut c4d(["info", text(&setup.at("run"))]));
    assert!(shown.contains(&format!("{} moved", rows.len())), "info: {shown}");
    // The frames of the run are 1.3 times as wide as the source's at every time.
    let width = |splats: &Splats| {
        let at = |i: usize| splats.means[rows[i]];
        (1..rows.len())
            .map(|i| (0..3).map(|k| (at(i)[k] - at(0)[k]).powi(2)).sum::<f32>().sqrt())
            .fold(0.0, f32::max)
    };
    for (found, original) in setup.frames("run").iter().zip(&frames) {
        let ratio = width(found) / width(original);
        assert!((ratio - 1.3).abs() < 1e-3, "{ratio} times as wide");
    }
    // The paper's baseline ignores moved groups.
    let (_, stderr) = success(&mut setup.propagate(&edited, "knn", &["--baseline", "knn"]));
    assert!(!stderr.contains("moved as a group"), "{stderr}");
}

#[test]
fn a_saved_selection_causes_a_warning_and_the_rest_is_kept_on_request() {
    let (setup, frames) = (Setup::new(), originals());
    let rows = top(&frames, 0.4);
    let mut selection = frames[0].select(&rows);
    let coeffs = selection.sh_coeffs();
    selection.sh.iter_mut().step_by(coeffs).for_each(|dc| *dc = [0.9, -0.4, 0.1]);
    let edited = setup.save("selection.ply", &selection);
    let (_, stderr) = success(&mut setup.propagate(&edited, "only", &[]));
    assert!(
        stderr.contains("are removed at all times") && stderr.contains("--keep-rest"),
        "{stderr}"
    );
    assert_eq!(setup.frames("only")[1].len(), rows.len(), "only the selection");

    let (_, stderr) = success(&mut setup.propagate(&edited, "all", &["--keep-rest"]));
    let rest = frames[0].len() - rows.len();
    assert!(stderr.contains(&format!("--keep-rest: {rest} splats of the scene added")), "{stderr}");
    let found = &setup.frames("all")[1];
    assert_eq!(found.len(), frames[0].len(), "nothing is missing");
    let others: Vec<usize> = (0..frames[1].len()).filter(|i| !rows.contains(i)).collect();
    let tail: Vec<usize> = (rows.len()..found.len()).collect();
    assert_eq!(
        found.select(&tail),
        frames[1].select(&others),
        "the rest is the source, bit for bit"
    );

    // A selection that was scaled before it was saved does not change the size
    // of the whole scene, unless --align is given.
    let larger = Similarity { scale: 1.5, ..Similarity::IDENTITY };
    let edited = setup.save("larger.ply", &larger.transform(&frames[0].select(&rows)));
    let (_, stderr) = success(&mut setup.propagate(&edited, "larger", &[]));
    assert!(
        stderr.contains(&format!("{} splats moved as a group: scaled by 1.5", rows.len())),
        "{stderr}"
    );
    let (_, stderr) =
        success(&mut setup.propagate(&edited, "aligned", &["--align", "--keep-rest"]));
    assert!(stderr.contains("scaled by 1.5"), "{stderr}");
    let (found, order) = (&setup.frames("aligned")[1], [&rows[..], &others[..]].concat());
    assert_eq!(*found, frames[1].select(&order), "the original scene, bit for bit");

    // For an edit of a different scene there is nothing to add.
    let mut other = frames[0].clone();
    for (i, (scale, dc)) in (0_u16..).zip(other.log_scales.iter_mut().zip(&mut other.sh)) {
        let odd = f32::from(i * 37 % 101) / 101.0 + 0.01;
        scale[1] += odd;
        scale[2] -= 0.7 * odd;
        *dc = [odd, -odd, 1.0 - odd];
    }
    other.means.iter_mut().for_each(|mean| mean[1] += 0.05 + 0.02 * mean[0].sin());
    let edited = setup.save("other.ply", &other);
    let stderr = failure(&mut setup.propagate(&edited, "none", &["--keep-rest"]), 2);
    assert!(stderr.contains("nothing to add"), "{stderr}");
}

#[test]
fn matched_splats_take_precedence_over_bounds_and_unmatched_edits_are_refused() {
    let (setup, frames) = (Setup::new(), originals());
    let mut dome = frames[0].clone();
    for i in 0..frames[0].len() {
        dome.push_from(&frames[0], i);
    }
    for (i, mean) in (0_u16..).zip(dome.means.iter_mut().skip(frames[0].len())) {
        let angle = f32::from(i) * 2.399_963;
        let height = f32::from(i % 200) / 100.0 - 1.0;
        let ring = (1.0 - height * height).sqrt();
        *mean = [ring * angle.cos(), height, ring * angle.sin()].map(|v| 5000.0 * v);
    }
    for (i, scale) in (0_u16..).zip(dome.log_scales.iter_mut().skip(frames[0].len())) {
        *scale = [3.0, 3.0 + f32::from(i % 17) * 0.1, 4.0 + f32::from(i % 13) * 0.1];
    }
    let edited = setup.save("dome.ply", &dome);
    let (_, stderr) = success(&mut setup.propagate(&edited, "dome", &[]));
    assert!(stderr.contains(&format!("{} unchanged", frames[0].len())), "{stderr}");

    // Other splats next to the scene: within the
    // bounds, but none of them matches the scene.
    let mut beside = frames[0].clone();
    let (min, max) = frames[0].bounds().unwrap();
    let extent = (0..3).map(|k| max[k] - min[k]).fold(0.0, f32::max);
    for (i, (mean, scale)) in (0_u16..).zip(beside.means.iter_mut().zip(&mut beside.log_scales)) {
        mean[0] += 1.25 * extent + f32::from(i * 31 % 97) * 1e-3;
        *scale = scale.map(|s| s + f32::from(i % 89 * 53 % 89) * 0.01);
        scale[1] += f32::from(i * 29 % 83) * 0.01;
    }
    let edited = setup.save("beside.ply", &beside);
    let stderr = failure(&mut setup.propagate(&edited, "beside", &[]), 3);
    assert!(stderr.contains("0 of its") && stderr.contains("--allow-far"), "{stderr}");
    success(&mut setup.propagate(&edited, "beside", &["--allow-far"]));
}

#[test]
fn the_time_of_an_edit_of_a_different_frame_is_reported() {
    let (setup, frames) = (Setup::new(), originals());
    assert!(frames.len() >= 3, "a middle frame");
    let middle = 1;
    let time = middle as f32 / (frames.len() - 1) as f32;
    let edited = setup.save("middle.ply", &frames[middle]);
    let stderr = failure(&mut setup.propagate(&edited, "wrong", &[]), 2);
    assert!(stderr.contains(&format!("is an edit of the scene at time {time}")), "{stderr}");
    assert!(stderr.contains(&format!("Run again with --time {time}")), "{stderr}");
    success(&mut setup.propagate(&edited, "right", &["--time", &time.to_string()]));
}

/// A sequence of two frames in which every fifth splat appears only in the second.
fn fading(setup: &Setup) -> (PathBuf, Vec<Splats>, Vec<usize>) {
    let folder = setup.at("fading");
    std::fs::create_dir(&folder).unwrap();
    let mut frames: Vec<Splats> = originals().into_iter().take(2).collect();
    let hidden: Vec<usize> = (0..frames[0].len()).step_by(5).collect();
    for &i in &hidden {
        frames[0].opacity_logits[i] = -9.0;
        frames[1].opacity_logits[i] = 3.0;
    }
    for (i, frame) in frames.iter().enumerate() {
        setup.save(&format!("fading/{i:05}.ply"), frame);
    }
    (folder, frames, hidden)
}

#[test]
fn invisible_splats_are_counted_omitted_and_kept() {
    let setup = Setup::new();
    let (scene, frames, hidden) = fading(&setup);
    let freeze = |name: &str, flags: &[&str]| {
        let out = setup.at(name);
        let fixed = ["freeze", text(&scene), "-o", text(&out)];
        let (_, stderr) = success(&mut c4d(fixed.iter().chain(flags).copied().collect::<Vec<_>>()));
        (out.join("point_cloud.ply"), stderr)
    };
    let count = format!("{} of {} splats are invisible", hidden.len(), frames[0].len());
    let (_, stderr) = freeze("whole", &[]);
    assert!(stderr.contains(&count) && stderr.contains("--visible"), "{stderr}");
    let (file, stderr) = freeze("visible", &["--visible"]);
    assert!(stderr.contains(&count) && stderr.contains("omitted"), "{stderr}");
    let visible = ply::read_file(&file).unwrap().splats;
    assert_eq!(visible.len(), frames[0].len() - hidden.len(), "omitted");

    // An editor rewrites the file and deletes a tenth of the splats.
    let kept: Vec<usize> = (0..visible.len()).filter(|i| i % 10 != 0).collect();
    let edited = setup.save("edited.ply", &visible.select(&kept));
    let (run, out) = (setup.at("run"), setup.at("out"));
    let (_, stderr) = success(&mut propagate(&scene, &edited, &run, &[]));
    assert!(stderr.contains("are not in") && stderr.contains("and are kept"), "{stderr}");
    success(&mut c4d(["export", text(&run), "--to", "ply-seq", "--frames", "2", "-o", text(&out)]));
    let last = &read_frames(&out)[1];
    assert_eq!(last.len(), kept.len() + hidden.len(), "they are back");
    let back: Vec<usize> = (kept.len()..last.len()).collect();
    assert_eq!(last.select(&back), frames[1].select(&hidden), "with their own values");

    // In an edit with some of them, the missing ones count as deleted, which is reported.
    let some: Vec<usize> = (0..frames[0].len()).filter(|i| i % 10 != 0).collect();
    let mut edit = frames[0].select(&some);
    let coeffs = edit.sh_coeffs();
    let recoloured = some.iter().position(|i| i % 5 == 0).unwrap();
    edit.sh[recoloured * coeffs] = [0.9, 0.1, -0.3];
    let edited = setup.save("cropped.ply", &edit);
    let (_, stderr) = success(&mut propagate(&scene, &edited, &setup.at("cropped"), &[]));
    let removed = hidden.iter().filter(|i| **i % 10 == 0).count();
    assert!(stderr.contains(&format!("1 changed, {removed} removed")), "{stderr}");
}
