//! Properties of any scene and any edit.
use crate::common::{Table, golden_edit, golden_source, score};
use amg::{Aggregation, MotionOptions, MotionPreset, Propagation, RotationRule, propagate};
use gs_core::{DynamicScene, Splats, quat};
use proptest::prelude::*;
use std::sync::Arc;

fn run(source: &Table, edited: &Splats, options: &MotionOptions) -> Propagation {
    propagate(Arc::new(source.clone()), Arc::new(edited.clone()), options, &|_, _| {}).unwrap()
}

fn moved(splats: &Splats, q: [f32; 4], shift: [f32; 3]) -> Splats {
    let mut out = splats.clone();
    for mean in &mut out.means {
        let turned = quat::rotate(q, *mean);
        *mean = [turned[0] + shift[0], turned[1] + shift[1], turned[2] + shift[2]];
    }
    for rotation in &mut out.quats {
        *rotation = quat::mul(q, *rotation);
    }
    out
}

fn largest_gap(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    a.iter().flatten().zip(b.iter().flatten()).fold(0.0, |m, (x, y)| m.max((x - y).abs()))
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 8,
        rng_seed: proptest::test_runner::RngSeed::Fixed(7),
        ..ProptestConfig::default()
    })]

    /// If all sources share one rigid motion, so does every edited splat, for any matches.
    #[test]
    fn a_common_rigid_motion_is_exact(
        axis in prop::array::uniform3(-1.0_f32..1.0),
        angle in 0.05_f32..3.1,
        shift in prop::array::uniform3(-1.0_f32..1.0),
        flip in any::<bool>(),
    ) {
        let rest = golden_source().0.frames.swap_remove(0);
        let [x, y, z] = axis.map(|c| c * (0.5 * angle).sin());
        let length = axis.iter().map(|c| c * c).sum::<f32>().sqrt();
        prop_assume!(length > 0.1);
        let q = [(0.5 * angle).cos(), x / length, y / length, z / length];
        let mut there = moved(&rest, q, shift);
        if flip {
            there.quats.iter_mut().step_by(2).for_each(|q| *q = q.map(|c| -c));
        }
        let source = Table::new(vec![rest, there]);
        let edit = golden_edit("graft").splats;
        let found = run(&source, &edit, &MotionOptions::default());
        let expected = moved(&edit, q, shift);
        let at = found.scene.at(1.0).unwrap();
        prop_assert!(largest_gap(&at.means, &expected.means) < 1e-5);
        for (ours, theirs) in at.quats.iter().zip(&expected.quats) {
            prop_assert!(quat::dot(quat::normalize(*ours), quat::normalize(*theirs)).abs() > 1.0 - 1e-5);
        }
    }
}

#[test]
fn rotation_by_180_degrees_is_exact() {
    let rest = golden_source().0.frames.swap_remove(0);
    let q = [0.0, 0.0, 1.0, 0.0];
    let source = Table::new(vec![rest.clone(), moved(&rest, q, [0.0; 3])]);
    let edit = golden_edit("drift").splats;
    let found = run(&source, &edit, &MotionOptions::default());
    let expected = moved(&edit, q, [0.0; 3]);
    let gap = largest_gap(&found.scene.at(1.0).unwrap().means, &expected.means);
    assert!(gap < 1e-5, "off by {gap}");
}

#[test]
fn a_common_translation_is_exact_for_every_preset() {
    let rest = golden_source().0.frames.swap_remove(0);
    let source = Table::new(vec![rest.clone(), moved(&rest, quat::IDENTITY, [0.3, -0.2, 0.1])]);
    let edit = golden_edit("all").splats;
    let expected = moved(&edit, quat::IDENTITY, [0.3, -0.2, 0.1]);
    for preset in [MotionPreset::Regions, MotionPreset::Paper, MotionPreset::Knn] {
        let found = run(&source, &edit, &MotionOptions::preset(preset));
        let gap = largest_gap(&found.scene.at(1.0).unwrap().means, &expected.means);
        assert!(gap < 1e-5, "{preset:?} is off by {gap}");
    }
}

/// A checkpoint that does not model rotation: its constant quaternions must not reduce the
/// estimated rotation.
#[test]
fn constant_quaternions_do_not_reduce_rotation() {
    let (mut source, size) = golden_source();
    let rest = source.frames[0].quats.clone();
    for frame in &mut source.frames {
        frame.quats.clone_from(&rest);
    }
    let edit = golden_edit("graft");
    let found = run(&source, &edit.splats, &MotionOptions::default());
    assert!(found.report.rotation_prior < 0.05, "{}", found.report.rotation_prior);
    let error = score(&found.scene, &edit, size);
    assert!(error.epe < 0.2 && error.rot < 4.0, "{error}");
}

#[test]
fn edits_without_overlap_are_static_and_counted() {
    let (source, _) = golden_source();
    let far = moved(&golden_edit("drift").splats, quat::IDENTITY, [50.0, 0.0, 0.0]);
    for preset in [MotionPreset::Regions, MotionPreset::Knn] {
        let found = run(&source, &far, &MotionOptions::preset(preset));
        assert_eq!(found.scene.at(1.0).unwrap(), far, "{preset:?}: nothing to follow");
        assert_eq!(found.report.out_of_reach, far.len(), "{preset:?}: counted");
        let is_warned = found.report.warnings.iter().any(|w| w.contains("do not overlap"));
        assert!(is_warned, "{preset:?}: {:?}", found.report.warnings);
    }
    // The paper's method has no distance limit, so all splats follow their transport matches.
    let found = run(&source, &far, &MotionOptions::preset(MotionPreset::Paper));
    assert_eq!((found.report.out_of_reach, found.report.blended), (0, far.len()), "all follow");
    let moved = found.scene.at(1.0).unwrap();
    assert!(moved.means.iter().flatten().all(|v| v.is_finite()), "numbers");
    assert_ne!(moved.means, far.means, "they move");
}

/// Five source splats and 1500 edited ones; also with every edited splat twice.
#[test]
fn few_sources_and_duplicates_give_finite_results() {
    let (source, _) = golden_source();
    let edit = golden_edit("drift").splats;
    let few =
        Table::new(source.frames.iter().map(|f| f.select(&[0, 300, 600, 900, 1200])).collect());
    let found = run(&few, &edit, &MotionOptions::default());
    assert!(found.scene.at(1.0).unwrap().means.iter().flatten().all(|v| v.is_finite()), "numbers");
    let twice: Vec<usize> = (0..300).flat_map(|i| [i, i]).collect();
    let at = run(&source, &edit.select(&twice), &MotionOptions::default()).scene.at(1.0).unwrap();
    assert!(at.means.iter().flatten().all(|v| v.is_finite()), "results of duplicates are finite");
}

#[test]
fn results_are_bit_identical_for_any_number_of_threads() {
    let (source, _) = golden_source();
    let edit = golden_edit("all").splats;
    for preset in [MotionPreset::Regions, MotionPreset::Paper] {
        let options = MotionOptions::preset(preset);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let found = run(&source, &edit, &options);
                (found.scene.binding().as_ref().clone(), found.scene.at(0.6).unwrap())
            })
        };
        let alone = on(1);
        for threads in [2, 7] {
            assert!(on(threads) == alone, "{preset:?}, {threads} threads: binding and frame, bits");
        }
    }
}

/// An unconnected halo above the head follows the head; far away it stays in place.
#[test]
fn new_objects_follow_the_nearest_part_within_reach() {
    let (source, size) = golden_source();
    let rest = &source.frames[0];
    let top = (0..1500)
        .filter(|&i| rest.means[i][2] < 1.84)
        .max_by(|&a, &b| rest.means[a][2].total_cmp(&rest.means[b][2]))
        .unwrap();
    let halo = |height: f32| {
        let mut edited = rest.clone();
        for i in 0..40_u8 {
            let angle = f32::from(i) * 0.157;
            edited.push_from(rest, top);
            let mean = edited.means.last_mut().unwrap();
            mean[0] += 0.1 * angle.cos();
            mean[1] += 0.1 * angle.sin();
            mean[2] += height;
        }
        edited
    };
    let found = run(&source, &halo(0.1 * size as f32), &MotionOptions::default());
    assert_eq!(found.report.blended, 40, "all of the halo moves: {:?}", found.report);
    let at = found.scene.at(1.0).unwrap();
    let head = source.frames[5].means[top];
    for i in 1500..1540 {
        let d: f32 = (0..3).map(|a| (at.means[i][a] - head[a]).powi(2)).sum::<f32>().sqrt();
        assert!(d < 0.25 * size as f32, "splat {i} is {d} from the head");
    }
    let found = run(&source, &halo(3.0), &MotionOptions::default());
    assert_eq!(found.report.out_of_reach, 40, "{:?}", found.report.warnings);
    assert!(found.report.warnings.iter().any(|w| w.contains("beyond reach")), "is_warned so");
}

#[test]
fn a_static_background_remains_static() {
    let (mut source, size) = golden_source();
    let wall = golden_edit("drift").splats;
    for (t, frame) in source.frames.iter_mut().enumerate() {
        for i in 0..600 {
            frame.push_from(&wall, i);
            let mean = frame.means.last_mut().unwrap();
            mean[1] += 1.5;
            // Deformation networks make static splats tremble.
            let tremble = 1e-3 * size * ((i * 13 + t * 7) as f64).sin() * t.min(1) as f64;
            mean[0] += tremble as f32;
        }
    }
    let mut edited = source.frames[0].clone();
    // Sizes change as well: splats that were only moved keep the source's own motion, including the
    // tremble.
    for (i, (mean, log_scale)) in edited.means.iter_mut().zip(&mut edited.log_scales).enumerate() {
        mean[2] += 0.001;
        log_scale[i % 3] += 0.3 + 0.2 * (i as f32 * 0.7).sin();
    }
    let found = run(&source, &edited, &MotionOptions::default());
    assert!(found.split.dynamic[..1500].iter().all(|&d| d), "the figure moves");
    assert!(found.split.dynamic[1500..].iter().all(|&d| !d), "the wall does not");
    assert_eq!(found.report.static_rows, 600, "{:?}", found.report);
    assert_eq!(found.scene.at(1.0).unwrap().means[1500..], edited.means[1500..], "not a bit");
}

#[test]
fn degenerate_clouds_give_finite_results() {
    let (source, _) = golden_source();
    let one = |ids: &[usize]| Table::new(source.frames.iter().map(|f| f.select(ids)).collect());
    let line = {
        let mut table = one(&(0..40).collect::<Vec<_>>());
        for (t, frame) in table.frames.iter_mut().enumerate() {
            for (i, mean) in frame.means.iter_mut().enumerate() {
                *mean = [i as f32 * 0.1, t as f32 * 0.2, 0.0];
            }
        }
        table
    };
    let hostile = {
        let mut table = source.clone();
        for frame in &mut table.frames {
            frame.opacity_logits[..50].fill(f32::NEG_INFINITY);
            frame.log_scales[50..100].fill([f32::NEG_INFINITY; 3]);
            frame.quats[100..150].fill([0.0; 4]);
        }
        table.frames[3].means[200] = [f32::NAN; 3];
        table
    };
    let still = Table::new(vec![source.frames[0].clone(); 3]);
    let mut weird = golden_edit("drift").splats.select(&(0..60).collect::<Vec<_>>());
    weird.opacity_logits[0] = f32::NEG_INFINITY;
    weird.log_scales[1] = [f32::NEG_INFINITY; 3];
    weird.quats[2] = [0.0; 4];
    let relative = Aggregation { rotation: RotationRule::Relative, ..Aggregation::PAPER };
    for (what, table) in [
        ("one splat", one(&[3])),
        ("two splats", one(&[3, 900])),
        ("all coincident", one(&[3; 30])),
        ("collinear", line),
        ("hostile values", hostile),
        ("static", still),
        ("single frame", Table::new(vec![source.frames[0].clone()])),
        ("empty", one(&[])),
    ] {
        for preset in [MotionPreset::Regions, MotionPreset::Paper, MotionPreset::Knn] {
            let mut options = MotionOptions::preset(preset);
            options.reach = 10.0;
            for aggregation in [options.aggregation, relative] {
                options.aggregation = aggregation;
                let found = run(&table, &weird, &options);
                let at = found.scene.at(1.0).unwrap();
                let finite = at.means.iter().flatten().chain(at.quats.iter().flatten());
                assert!(finite.into_iter().all(|v| v.is_finite()), "{what}, {preset:?}");
                let unscaled = at.log_scales.iter().flatten().all(|v| !v.is_nan());
                assert!(unscaled, "{what}, {preset:?}: scales");
            }
        }
    }
    let none = run(&source, &source.frames[0].select(&[]), &MotionOptions::default());
    assert!(none.scene.at(1.0).unwrap().is_empty(), "an edit that removed everything");
}

#[test]
fn rows_with_non_finite_values_are_unchanged_and_counted() {
    let (source, _) = golden_source();
    let mut edited = golden_edit("drift").splats;
    edited.means[4][1] = f32::INFINITY;
    let found = run(&source, &edited, &MotionOptions::default());
    assert_eq!(found.report.broken_rows, 1, "one");
    assert_eq!(found.scene.at(1.0).unwrap().means[4], edited.means[4], "as it was");
}

#[test]
fn options_out_of_range_are_rejected() {
    let (source, _) = golden_source();
    let edited = Arc::new(source.frames[0].clone());
    let source: Arc<dyn DynamicScene> = Arc::new(source);
    let mut options = MotionOptions::default();
    options.num_key_times = 0;
    let error = propagate(source, edited, &options, &|_, _| {}).unwrap_err().to_string();
    assert!(error.contains("num_key_times") && error.contains("1 to 64"), "{error}");
}
