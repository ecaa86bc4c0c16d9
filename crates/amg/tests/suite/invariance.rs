//! The default does not depend on the position, orientation and size of the scene, or on the order
//! of splats in files.
use crate::common::{Table, golden_edit, golden_source};
use amg::{MotionOptions, MotionPreset, propagate};
use gs_core::{DynamicScene, Splats, quat};
use gs_synth::TruthCase;
use proptest::array::{uniform3, uniform4};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};
use std::sync::Arc;

#[derive(Debug, Clone, Copy)]
struct TestPose {
    turn: [f32; 4],
    scale: f32,
    /// In multiples of the scaled figure's size.
    shift: [f32; 3],
}

impl TestPose {
    fn of(&self, splats: &Splats, size: f64) -> Splats {
        let mut out = splats.clone();
        let shift = self.shift.map(|s| f64::from(s) * size * f64::from(self.scale));
        let turn = quat::normalize(self.turn.map(f64::from));
        for mean in &mut out.means {
            let turned = quat::rotate(turn, mean.map(f64::from));
            *mean = [0, 1, 2].map(|a| (f64::from(self.scale) * turned[a] + shift[a]) as f32);
        }
        for rotation in &mut out.quats {
            *rotation = quat::mul(turn, rotation.map(f64::from)).map(|c| c as f32);
        }
        for log_scale in &mut out.log_scales {
            *log_scale = log_scale.map(|s| s + self.scale.ln());
        }
        out
    }
}

/// A scene, an edit of its first frame, and the size of the moving splats.
struct Case {
    name: String,
    source: Table,
    edited: Splats,
    size: f64,
}

fn golden(name: &str) -> Case {
    let (source, size) = golden_source();
    Case { name: name.to_owned(), source, edited: golden_edit(name).splats, size }
}

fn synthetic(case: TruthCase, num_splats: usize) -> Case {
    let scene = gs_synth::build(case, 0, num_splats).unwrap();
    let times = scene.source.time_range().frames(7);
    Case {
        name: case.name().to_owned(),
        source: Table::new(times.iter().map(|&t| scene.source.at(t).unwrap()).collect()),
        edited: scene.edited.splats,
        size: f64::from(scene.figure_size),
    }
}

/// The edit at every frame.
fn propagated(source: &Table, edited: &Splats) -> Vec<Splats> {
    propagated_with(MotionPreset::Regions, source, edited)
}

fn propagated_with(preset: MotionPreset, source: &Table, edited: &Splats) -> Vec<Splats> {
    let options = MotionOptions::preset(preset);
    let found = propagate(Arc::new(source.clone()), Arc::new(edited.clone()), &options, &|_, _| {})
        .unwrap();
    let times = source.time_range().frames(source.frames.len());
    times.iter().map(|&t| found.scene.at(t).unwrap()).collect()
}

/// Number of splats that differ by more than `limit` at any time.
fn strays(a: &[Splats], b: &[Splats], limit: f64) -> usize {
    let apart = |a: [f32; 3], b: [f32; 3]| {
        let d = [0, 1, 2].map(|k| f64::from(a[k]) - f64::from(b[k]));
        d.iter().map(|d| d * d).sum::<f64>().sqrt() > limit
    };
    (0..a[0].len()).filter(|&i| a.iter().zip(b).any(|(a, b)| apart(a.means[i], b.means[i]))).count()
}

/// Number of splats that differ by more than 1e-4 of the figure between the result for a placed
/// source and edit, and the placed result for the original scene.
fn misplaced(case: &Case, here: &[Splats], placed: TestPose, edit: TestPose) -> usize {
    misplaced_by(MotionPreset::Regions, case, here, placed, edit)
}

fn misplaced_by(
    preset: MotionPreset,
    case: &Case,
    here: &[Splats],
    placed: TestPose,
    edit: TestPose,
) -> usize {
    let Case { source, edited, size, .. } = case;
    let all = |frames: &[Splats]| frames.iter().map(|f| placed.of(f, *size)).collect::<Vec<_>>();
    let there = propagated_with(preset, &Table::new(all(&source.frames)), &edit.of(edited, *size));
    strays(&there, &all(here), 1e-4 * size * f64::from(placed.scale))
}

/// Scales from a thousandth to a thousand, any rotation, up to ten figure sizes from the origin.
/// Rounding changes the decision for about one splat in a thousand: none, one or two here.
#[test]
fn transforming_scene_and_edit_transforms_the_result() {
    let cases = [
        golden("drift"),
        golden("all"),
        golden("graft"),
        synthetic(TruthCase::Everything, 2500),
        synthetic(TruthCase::GraftBlock, 2500),
        synthetic(TruthCase::StretchingCloth, 1500),
    ];
    let mut runner = TestRunner::new(Config {
        cases: 4,
        rng_seed: RngSeed::Fixed(11),
        failure_persistence: None,
        ..Config::default()
    });
    let placements = (uniform4(-1.0_f32..1.0), -3.0_f32..3.0, uniform3(-10.0_f32..10.0))
        .prop_map(|(turn, decades, shift)| TestPose { turn, scale: 10.0_f32.powf(decades), shift });
    for case in &cases {
        let here = propagated(&case.source, &case.edited);
        runner
            .run(&placements, |placed| {
                let strays = misplaced(case, &here, placed, placed);
                let allowed = case.edited.len() / 1000;
                prop_assert!(strays <= allowed, "{}: {strays} splats, {placed:?}", case.name);
                Ok(())
            })
            .unwrap();
    }
}

/// The baseline of three nearest neighbours is also independent of the axes.
#[test]
fn transforming_the_scene_transforms_the_knn_result() {
    let case = golden("drift");
    let here = propagated_with(MotionPreset::Knn, &case.source, &case.edited);
    let placed = TestPose { turn: [0.8, -0.3, 0.5, 0.2], scale: 3.7, shift: [4.0, -2.0, 1.0] };
    let strays = misplaced_by(MotionPreset::Knn, &case, &here, placed, placed);
    assert!(strays <= case.edited.len() / 1000, "{strays} of {}", case.edited.len());
}

/// Negative control: an edit that is 0.5 % larger than its scene is a different edit.
#[test]
fn scaling_only_the_edit_changes_the_result() {
    let case = golden("all");
    let here = propagated(&case.source, &case.edited);
    let placed = TestPose { turn: [0.5, -0.3, 0.5, 0.2], scale: 3.0, shift: [1.0, 2.0, 3.0] };
    let other = TestPose { scale: 3.015, ..placed };
    let strays = misplaced(&case, &here, placed, other);
    assert!(strays > case.edited.len() / 2, "{strays} of {}", case.edited.len());
}

/// At a distance of a thousand figures from the origin, coordinates are rounded to 1e-4 of the
/// figure.
#[test]
fn far_from_the_origin_errors_are_those_of_rounded_coordinates() {
    let case = golden("all");
    let here = propagated(&case.source, &case.edited);
    let placed = TestPose { turn: [0.5, -0.3, 0.5, 0.2], scale: 1.0, shift: [700.0, 0.0, -700.0] };
    let there: Vec<Splats> = case.source.frames.iter().map(|f| placed.of(f, case.size)).collect();
    let there = propagated(&Table::new(there), &placed.of(&case.edited, case.size));
    let expected: Vec<Splats> = here.iter().map(|f| placed.of(f, case.size)).collect();
    let found = strays(&there, &expected, 1e-3 * case.size);
    assert!(found <= case.edited.len() / 500, "{found} of {}", case.edited.len());
}

/// Rows of both files in any order, including coincident splats.
#[test]
fn permuting_rows_permutes_the_result() {
    for mut case in [golden("inflate"), golden("graft"), synthetic(TruthCase::Everything, 2500)] {
        // Two pairs of coincident splats: one pair differs in opacity, the other in motion.
        for (t, frame) in case.source.frames.iter_mut().enumerate() {
            for i in 0..50 {
                frame.push_from(&frame.clone(), 20 * i);
                *frame.opacity_logits.last_mut().unwrap() -= 1.0;
                frame.push_from(&frame.clone(), 20 * i + 5);
                frame.means.last_mut().unwrap()[1] += 1e-3 * t as f32;
            }
        }
        let shuffle =
            |n: usize, by: usize| -> Vec<usize> { (0..n).map(|i| (i * by + 5) % n).collect() };
        let here = propagated(&case.source, &case.edited);
        let sources = shuffle(case.source.num_splats(), 997);
        let rows = shuffle(case.edited.len(), 1009);
        let shuffled = case.source.frames.iter().map(|f| f.select(&sources)).collect();
        let there = propagated(&Table::new(shuffled), &case.edited.select(&rows));
        let expected: Vec<Splats> = here.iter().map(|f| f.select(&rows)).collect();
        let found = strays(&there, &expected, 1e-6 * case.size);
        assert!(found == 0, "{}: {found} splats", case.name);
    }
}
