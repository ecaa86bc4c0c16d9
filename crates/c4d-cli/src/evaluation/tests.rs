//! Metrics of an unedited run are ideal, and each degradation worsens the expected metrics.

use super::{Item, Sight, Subject, Truth, pictures};
use crate::console::Console;
use crate::device::Device;
use amg::{Binding, EditedScene, MotionOptions, Propagation};
use gs_core::{Camera, DynamicScene, Image, Splats};
use gs_synth::{DemoParams, SynthScene, TruthCase};
use serde_json::Value;
use std::cell::RefCell;
use std::str::FromStr;
use std::sync::Arc;

const SIZE: (u32, u32) = (128, 96);
const FRAMES: usize = 7;

/// A walking figure in front of a static background.
fn demo() -> SynthScene {
    gs_synth::demo(&DemoParams { num_splats: 4000, ..DemoParams::default() }).unwrap()
}

/// Propagates an edited frame; with `all`, the motion of every splat is estimated.
fn propagated(source: &SynthScene, frame: Splats, all: bool) -> Propagation {
    let mut options = MotionOptions::default();
    options.identity.enabled = !all;
    let source: Arc<dyn DynamicScene> = Arc::new(source.clone());
    amg::propagate(source, Arc::new(frame), &options, &|_, _| {}).unwrap()
}

fn cameras(source: &SynthScene) -> Vec<Camera> {
    source.suggested_cameras(SIZE.0, SIZE.1).into_iter().take(2).collect()
}

type Degrade<'a> = &'a dyn Fn(usize, usize, Image) -> Image;

/// All metrics of `edited`, with `truth` as ground truth.
fn measured(
    source: &SynthScene,
    edited: &EditedScene,
    truth: &dyn DynamicScene,
    degrade: Option<Degrade<'_>>,
) -> Vec<Item> {
    let times = source.time_range().frames(FRAMES);
    let frame = edited.edited().as_ref().clone();
    let binding = edited.binding().as_ref().clone();
    let subject = Subject::new(edited, Some((source, &frame, &binding)), times[0]).unwrap();
    let cameras = cameras(source);
    let console = Console::new(true, false, false);
    let background = [0.3; 3];
    let mut sight = Sight {
        subject: &subject,
        cameras: &cameras,
        times: &times,
        background,
        truth: Some(Truth::scene(truth, &Device::Cpu, background)),
        retouch: degrade,
        console: &console,
    };
    let mut items = pictures(&mut sight, &Device::Cpu).unwrap();
    items.extend(super::motion(&subject, &times).unwrap());
    items.extend(super::matches(&subject, &Value::Null).unwrap());
    items
}

fn value(items: &[Item], id: &str) -> f64 {
    let item = items.iter().find(|item| item.definition.id == id).unwrap();
    item.value.unwrap_or_else(|| panic!("{id}: {:?}", item.reason))
}

/// Ids of metrics that improved by more than 1 %, and of those that became worse.
fn changes(before: &[Item], after: &[Item]) -> [Vec<String>; 2] {
    let mut lists = [Vec::new(), Vec::new()];
    for (a, b) in before.iter().zip(after) {
        assert_eq!(a.definition.id, b.definition.id, "the same metrics");
        let better = a.definition.better;
        let (Some(a_value), Some(b_value)) = (a.value, b.value) else { continue };
        let (Some(x), Some(y)) = (better.badness(a_value), better.badness(b_value)) else {
            continue;
        };
        let slack = 1e-2 * x.abs().max(1e-3);
        let line = format!("{} {a_value} → {b_value}", a.definition.id);
        if y < x - slack {
            lists[0].push(line);
        } else if y > x + slack {
            lists[1].push(line);
        }
    }
    lists
}

/// Asserts that a degradation worsens the metrics in `named` and improves none.
fn assert_worse(before: &[Item], after: &[Item], named: &[&str], what: &str) {
    let [better, worse] = changes(before, after);
    assert!(better.is_empty(), "{what} improves {better:?}");
    for id in named {
        let is = |line: &String| line.split(' ').next() == Some(id);
        assert!(worse.iter().any(is), "{what} does not worsen {id}, only {worse:?}");
    }
}

#[test]
fn an_unedited_run_has_ideal_metrics() {
    let source = demo();
    let propagation = propagated(&source, source.at(0.0).unwrap(), false);
    let items = measured(&source, &propagation.scene, &source, None);
    for (id, expected) in [
        ("psnr", 100.0),
        ("ssim", 1.0),
        ("ssim_valid", 1.0),
        ("flip", 0.0),
        ("bg_psnr", 100.0),
        ("bg_changed_frac", 0.0),
        ("first_frame_psnr", 100.0),
        ("warp_error_ratio", 1.0),
        ("warp_error_long_ratio", 1.0),
        ("warp_error_own_ratio", 1.0),
        ("flicker_excess", 0.0),
        ("static_flicker_excess", 0.0),
        ("motion_fidelity", 0.0),
        ("drift_max", 0.0),
        ("jitter_ratio", 1.0),
        ("isometry_excess", 0.0),
        ("ndd_excess", 0.0),
        ("nan_count", 0.0),
    ] {
        let found = value(&items, id);
        assert!((found - expected).abs() < 1e-6, "{id}: {found}, expected {expected}");
    }
    let same = ["temporal_flickering", "static_flicker", "warp_error", "jitter", "ndd_edit"];
    let of_source = [
        "temporal_flickering_src",
        "static_flicker_src",
        "warp_error_src",
        "jitter_src",
        "ndd_src",
    ];
    for (id, source) in same.into_iter().zip(of_source) {
        assert_eq!(value(&items, id), value(&items, source), "{id} on both sides");
    }
}

#[test]
fn the_default_keeps_what_was_not_edited() {
    let scene = gs_synth::build(TruthCase::from_str("clothing").unwrap(), 3, 1200).unwrap();
    let propagation = propagated(&scene.source, scene.edited.splats.clone(), false);
    let items = measured(&scene.source, &propagation.scene, &scene.edited.truth, None);
    assert_eq!(value(&items, "drift_max"), 0.0, "unedited splats have their own motion");
    assert_eq!(value(&items, "bg_changed_frac"), 0.0, "the background is the same");
    assert_eq!(value(&items, "first_frame_psnr"), 100.0, "the edited frame is the edit");
    let fade = value(&items, "edit_fade");
    assert!((0.8..1.25).contains(&fade), "the edit stays: {fade}");
    assert!(value(&items, "psnr") > 40.0, "near the truth: {}", value(&items, "psnr"));
}

/// Without an edit, every ratio is 1 and every excess is 0, so any difference is due to the
/// degradation.
#[test]
fn degraded_pictures_worsen_the_expected_metrics_and_improve_none() {
    let source = demo();
    let propagation = propagated(&source, source.at(0.0).unwrap(), false);
    check_degradations(&source, &propagation.scene, &source);
}

/// The demo's edit against ground-truth motion.
/// Noise, blur, a time shift and a colour drift each worsen the named metrics and improve none.
fn check_degradations(source: &SynthScene, edited: &EditedScene, truth: &dyn DynamicScene) {
    let clean = measured(source, edited, truth, None);

    let noise = |view: usize, frame: usize, mut image: Image| {
        let mut state = u32::try_from(100 * view + frame).unwrap();
        for value in &mut image.data {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let levels = if state >> 31 == 0 { 2.0 } else { -2.0 };
            *value = (*value + levels / 255.0).clamp(0.0, 1.0);
        }
        image
    };
    let noisy = measured(source, edited, truth, Some(&noise));
    let named = [
        "psnr",
        "ssim",
        "flip",
        "bg_psnr",
        "static_flicker_excess",
        "flicker_excess",
        "warp_error_ratio",
        "warp_error_long_ratio",
    ];
    assert_worse(&clean, &noisy, &named, "noise");
    let raw = |id: &str| value(&noisy, id) > value(&clean, id);
    assert!(raw("static_flicker") && raw("warp_error"), "and by their levels");
    assert!(!raw("temporal_flickering"), "a still video has 1");

    let blur = |_: usize, _: usize, image: Image| {
        let mut out = image.clone();
        for y in 0..image.height {
            for x in 0..image.width {
                for c in 0..3 {
                    let (mut sum, mut count) = (0.0, 0.0);
                    for v in y.saturating_sub(1)..(y + 2).min(image.height) {
                        for u in x.saturating_sub(1)..(x + 2).min(image.width) {
                            sum += image.pixel(u, v)[c];
                            count += 1.0;
                        }
                    }
                    out.pixel_mut(x, y)[c] = sum / count;
                }
            }
        }
        out
    };
    let blurred = measured(source, edited, truth, Some(&blur));
    let named = ["psnr", "ssim", "flip", "bg_ssim", "bg_changed_frac"];
    assert_worse(&clean, &blurred, &named, "blur");

    let last: RefCell<Vec<Option<Image>>> = RefCell::new(vec![None; 2]);
    let late = |view: usize, _: usize, image: Image| {
        last.borrow_mut()[view].replace(image.clone()).unwrap_or(image)
    };
    let shifted = measured(source, edited, truth, Some(&late));
    let named = ["psnr", "flip", "bg_psnr", "bg_changed_frac", "warp_error_ratio"];
    assert_worse(&clean, &shifted, &named, "a time shift");

    let drift = |_: usize, frame: usize, mut image: Image| {
        for pixel in image.data.chunks_exact_mut(3) {
            pixel[0] = (pixel[0] + 0.02 * frame as f32).min(1.0);
        }
        image
    };
    let drifting = measured(source, edited, truth, Some(&drift));
    let named = ["psnr", "flip", "bg_psnr", "warp_error_long_ratio", "static_flicker_excess"];
    assert_worse(&clean, &drifting, &named, "a drift of colour");
}

#[test]
fn swapped_matches_worsen_the_expected_metrics_and_improve_none() {
    let source = demo();
    let propagation = propagated(&source, source.at(0.0).unwrap(), true);
    let edited = &propagation.scene;
    let binding = edited.binding();
    let mut rows: Vec<Vec<(u32, f32)>> = (0..binding.len())
        .map(|row| {
            let (ids, weights) = binding.row(row);
            ids.iter().copied().zip(weights.iter().copied()).collect()
        })
        .collect();
    // One moving row in twenty gets the binding of a distant row.
    let moving: Vec<usize> = (0..rows.len()).filter(|&row| !rows[row].is_empty()).collect();
    for k in (0..moving.len()).step_by(40) {
        rows.swap(moving[k], moving[(k + moving.len() / 2) % moving.len()]);
    }
    let mixed = Binding::blending(&rows, binding.num_sources()).unwrap();
    let scene: Arc<dyn DynamicScene> = Arc::new(source.clone());
    let frame = Arc::clone(edited.edited());
    let swapped =
        EditedScene::new(scene, frame, 0.0, Arc::new(mixed), *edited.aggregation()).unwrap();
    let clean = measured(&source, edited, &source, None);
    let swapped = measured(&source, &swapped, &source, None);
    // The edited splats coincide with source splats, so cross_region_rate is undefined here; it is
    // tested in c4d-metrics.
    let named = ["psnr", "motion_fidelity", "drift", "isometry_excess", "ndd_excess"];
    assert_worse(&clean, &swapped, &named, "swapped matches");
}

#[test]
fn any_number_of_threads_gives_the_same_numbers() {
    let source = demo();
    let edit = gs_synth::apply_edits(&source, &gs_synth::demo_edits(), 7).unwrap();
    let propagation = propagated(&source, edit.splats.clone(), false);
    let mut seen: Option<String> = None;
    for threads in [1, 2, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let items = pool.install(|| measured(&source, &propagation.scene, &edit.truth, None));
        let views: Vec<String> = cameras(&source).into_iter().map(|camera| camera.name).collect();
        let text: String = items.iter().map(|item| item.json(&views).to_string()).collect();
        let first = seen.get_or_insert_with(|| text.clone());
        assert_eq!(*first, text, "{threads} threads");
    }
}
