//! OpenUSD layers, parsed independently, give exactly the bits of the scene; only changing
//! attributes have time samples.

use crate::common::changing_scene;

use gs_core::{DynamicScene, Splats, TimeRange, quat};
use gs_deform::{StaticScene, TabulatedScene};
use gs_io::usda::{self, WriteOptions};
use gs_io::{Clip, Existing};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Attribute name to its samples by time code; a value without samples is at `None`.
type Layer = BTreeMap<String, BTreeMap<Option<usize>, Vec<f32>>>;

/// Parses the arrays of a layer. Checks that all other lines are
/// valid in USD text and that braces match.
fn parse(text: &str) -> Layer {
    let mut layer = Layer::new();
    let mut open: Option<String> = None;
    let mut depth = 0_i32;
    assert!(text.starts_with("#usda 1.0\n"), "magic");
    for line in text.lines().skip(1) {
        for c in line.chars() {
            depth += match c {
                '{' | '(' | '[' => 1,
                '}' | ')' | ']' => -1,
                _ => 0,
            };
            assert!(depth >= 0, "closed before opened: {line}");
        }
        let line = line.trim();
        if let Some(name) = &open {
            if line == "}" {
                open = None;
                continue;
            }
            let (time, values) = line.split_once(": ").unwrap();
            let old = layer
                .get_mut(name)
                .unwrap()
                .insert(Some(time.parse().unwrap()), numbers(values.strip_suffix(',').unwrap()));
            assert!(old.is_none(), "{name} has time {time} twice");
        } else if let Some((declared, value)) = line.split_once(" = ")
            && let Some((kind, name)) = declared.split_once("[] ")
            && !kind.starts_with("uniform")
        {
            assert!(["point3f", "quatf", "float3", "float"].contains(&kind), "type {kind}");
            let name = name.strip_suffix(".timeSamples").unwrap_or(name).to_owned();
            assert!(!layer.contains_key(&name), "{name} twice");
            let samples = layer.entry(name.clone()).or_default();
            if value == "{" {
                open = Some(name);
            } else {
                samples.insert(None, numbers(value));
            }
        }
    }
    assert_eq!(depth, 0, "everything is closed");
    layer
}

fn numbers(array: &str) -> Vec<f32> {
    let inner = array.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap();
    inner
        .split([',', '(', ')', ' '])
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().unwrap())
        .collect()
}

fn write(
    path: &Path,
    scene: &dyn DynamicScene,
    frames: usize,
    options: &WriteOptions,
) -> (Layer, usda::WriteReport) {
    let times = TimeRange::UNIT.frames(frames);
    let clip = Clip { scene, times: &times, fps: 25.0 };
    let mut last = (0, 0);
    let report = usda::write(path, &clip, options, Existing::Refuse, &mut |done, of| {
        assert!(done == last.0 + 1 && done <= of, "progress {done} of {of}");
        last = (done, of);
    })
    .unwrap();
    assert_eq!(last.0, last.1, "progress ends at its total");
    (parse(&fs::read_to_string(path).unwrap()), report)
}

fn flat<const C: usize>(rows: &[[f32; C]]) -> Vec<f32> {
    rows.iter().flatten().copied().collect()
}

#[test]
fn every_value_round_trips() {
    let dir = tempfile::tempdir().unwrap();
    let scene = changing_scene::scene(40, 6, 2);
    let options = WriteOptions { up: [0.0, -1.0, 0.0], ..WriteOptions::default() };
    let path = dir.path().join("scene.usda");
    let (layer, report) = write(&path, &scene, 6, &options);
    assert_eq!(report.sampled.len(), 5, "everything changes: {:?}", report.sampled);
    for (f, splats) in scene.frames().iter().enumerate() {
        let at = |name: &str| &layer[name][&Some(f)];
        assert_eq!(*at("positions"), flat(&splats.means), "positions of {f}");
        assert_eq!(*at("radiance:sphericalHarmonicsCoefficients"), flat(&splats.sh), "SH of {f}");
        let scales: Vec<[f32; 3]> = (0..splats.len()).map(|i| splats.scale(i)).collect();
        assert_eq!(*at("scales"), flat(&scales), "scales of {f}");
        let opacities: Vec<f32> = (0..splats.len()).map(|i| splats.opacity(i)).collect();
        assert_eq!(*at("opacities"), opacities, "opacities of {f}");
        let extent = at("extent");
        for (i, q) in at("orientations").chunks_exact(4).enumerate() {
            let q = [q[0], q[1], q[2], q[3]];
            let expected = quat::align(quat::normalize(splats.quats[i]), q);
            assert_eq!(q, expected, "rotation of splat {i}, frame {f}");
            if f > 0 {
                let before = &layer["orientations"][&Some(f - 1)][4 * i..4 * i + 4];
                let dot: f32 = (0..4).map(|k| before[k] * q[k]).sum();
                assert!(
                    dot > 0.0,
                    "signs are continuous, so that interpolation takes the shorter \
                                   rotation"
                );
            }
            for k in 0..3 {
                let centre = splats.means[i][k];
                assert!(extent[k] <= centre && centre <= extent[k + 3], "inside the extent");
            }
        }
    }
    let text = fs::read_to_string(&path).unwrap();
    for expected in [
        "upAxis = \"Y\"",
        "endTimeCode = 5",
        "timeCodesPerSecond = 25",
        "def ParticleField3DGaussianSplat \"Splats\"",
        "uniform int radiance:sphericalHarmonicsDegree = 2",
        "( (1, 0, 0, 0), (0, -1, 0, 0), (0, 0, -1, 0), (0, 0, 0, 1) )",
    ] {
        assert!(text.contains(expected), "`{expected}` in the layer");
    }
}

#[test]
fn only_changing_attributes_have_samples() {
    let dir = tempfile::tempdir().unwrap();
    let mut frames = vec![changing_scene::scene(30, 2, 1).at(0.0).unwrap(); 4];
    frames[3].means[5][1] += 0.5;
    let scene = TabulatedScene::new(frames.clone()).unwrap();
    let options = WriteOptions { sh_degree: Some(0), ..WriteOptions::default() };
    let (layer, report) = write(&dir.path().join("one.usda"), &scene, 4, &options);
    assert_eq!(report.sampled, ["positions"], "one attribute moves");
    assert_eq!(layer["positions"].len(), 4, "four samples");
    for name in ["orientations", "scales", "opacities", "radiance:sphericalHarmonicsCoefficients"] {
        assert_eq!(layer[name].keys().collect::<Vec<_>>(), [&None], "{name} once");
    }
    assert_eq!(layer["radiance:sphericalHarmonicsCoefficients"][&None].len(), 90, "degree 0");
    assert!(report.losses.to_string().contains("SH degree 1 becomes 0"), "{}", report.losses);

    let still = StaticScene::new(frames.remove(0)).unwrap();
    let (layer, report) =
        write(&dir.path().join("still.usda"), &still, 1, &WriteOptions::default());
    assert!(report.sampled.is_empty() && layer["extent"].contains_key(&None), "one frame");
}

#[test]
fn invalid_clips_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.usda");
    let scene = changing_scene::scene(20, 3, 0);
    let clip = Clip { scene: &scene, times: &[0.0, 1.0], fps: 30.0 };
    let refuse = |clip: &Clip<'_>, options: &WriteOptions, expected: &str| {
        let error = usda::write(&path, clip, options, Existing::Refuse, &mut |_, _| ())
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected) && error.contains("x.usda"), "{error}");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0, "no output remains: {error}");
    };
    refuse(&Clip { times: &[], ..clip }, &WriteOptions::default(), "no frames");
    refuse(&Clip { fps: f64::NAN, ..clip }, &WriteOptions::default(), "frames per second");
    refuse(&clip, &WriteOptions { up: [0.0; 3], ..WriteOptions::default() }, "upward");
    refuse(&clip, &WriteOptions { size_limit: 1000, ..WriteOptions::default() }, "GB");
    let empty = StaticScene::new(Splats::default()).unwrap();
    refuse(&Clip { scene: &empty, ..clip }, &WriteOptions::default(), "no splats");

    let mut damaged = scene.frames().to_vec();
    damaged[1].means[4][0] = f32::NAN;
    damaged[1].log_scales[5] = [500.0; 3];
    let damaged = TabulatedScene::new(damaged).unwrap();
    let (layer, report) = write(&path, &damaged, 3, &WriteOptions::default());
    assert_eq!(report.num_splats, 19, "one row less");
    assert!(report.losses.to_string().contains("1 of 20"), "{}", report.losses);
    let all = layer.values().flat_map(BTreeMap::values).flatten();
    assert!(all.copied().all(f32::is_finite), "no numbers that USD cannot parse");
}
