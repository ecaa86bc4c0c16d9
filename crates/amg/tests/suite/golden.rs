//! The goldens of `fixtures/amg`: error of the motion of edited splats, for every guide.
use crate::common::{Edit, Score, golden_edit, golden_source, score};
use amg::{
    Aggregation, AnchorSampling, MotionGuide, MotionOptions, MotionPreset, PositionRule,
    RotationRule, ScaleRule, propagate,
};
use gs_core::DynamicScene;
use std::sync::Arc;

const EDITS: [&str; 4] = ["drift", "inflate", "graft", "all"];

fn run(options: &MotionOptions, edit: &Edit) -> Score {
    let (source, size) = golden_source();
    let source: Arc<dyn DynamicScene> = Arc::new(source);
    let found = propagate(source, Arc::new(edit.splats.clone()), options, &|_, _| {}).unwrap();
    score(&found.scene, edit, size)
}

fn without_identity(preset: MotionPreset) -> MotionOptions {
    let mut options = MotionOptions::preset(preset);
    options.identity.enabled = false;
    options
}

#[test]
fn knn_guide_reproduces_the_table() {
    let table =
        [(0.175, 0.37, 9.7), (0.905, 4.84, 13.3), (1.033, 3.139, 17.9), (1.802, 5.30, 25.6)];
    for (name, (epe, contact, rot)) in EDITS.into_iter().zip(table) {
        let found = run(&without_identity(MotionPreset::Knn), &golden_edit(name));
        assert!((found.epe - epe).abs() <= 0.002, "{name}: {found}, expected EPE {epe}");
        assert!((found.contact - contact).abs() <= 0.006, "{name}: {found}");
        assert!((found.rot - rot).abs() <= 0.06, "{name}: {found}");
    }
}

#[test]
fn relative_rotations_reproduce_the_table() {
    let mut options = without_identity(MotionPreset::Knn);
    options.aggregation = Aggregation { rotation: RotationRule::Relative, ..Aggregation::PAPER };
    for (name, rot) in EDITS.into_iter().zip([0.8, 2.6, 1.6, 3.6]) {
        let found = run(&options, &golden_edit(name));
        assert!((found.rot - rot).abs() <= 0.1, "{name}: {found}, expected {rot} degrees");
    }
}

/// Measured on this implementation, with the lines of seed 0, to 0.5 %. The first independent
/// implementation samples other lines and has 0.492, 1.317, 1.657, 2.535: between 11 % lower and
/// 4 % higher, which is not asserted. The second has the lines of seed 0, and agrees on two edits
/// to its printed digits.
#[test]
fn the_paper_preset_agrees_with_independent_implementations() {
    let found =
        EDITS.map(|name| run(&MotionOptions::preset(MotionPreset::Paper), &golden_edit(name)));
    for ((name, found), epe) in EDITS.iter().zip(&found).zip([0.555, 1.380, 1.600, 2.503]) {
        assert!((found.epe / epe - 1.0).abs() <= 0.005, "{name}: {found}, measured EPE {epe}");
    }
    let [_, inflate, _, all] = found;
    assert!((inflate.epe - 1.3801).abs() <= 0.0005, "inflate: {inflate}, expected EPE 1.3801");
    assert!((all.epe - 2.50).abs() <= 0.005, "all: {all}, expected EPE 2.50");
}

/// The paper estimates every splat, keeps the edit's opacity and colours, and neither limits scales
/// nor rejects matches.
#[test]
fn the_paper_preset_estimates_every_splat() {
    let (mut source, _) = golden_source();
    let edited = source.frames[0].clone();
    for (k, frame) in source.frames.iter_mut().enumerate() {
        for logit in &mut frame.opacity_logits {
            *logit += 0.1 * k as f32;
        }
        // Ten times the size, far above the limit of the default.
        for scale in frame.log_scales.iter_mut().flatten() {
            *scale += if k == 0 { 0.0 } else { 10.0_f32.ln() };
        }
    }
    let options = MotionOptions::preset(MotionPreset::Paper);
    let found = propagate(Arc::new(source.clone()), Arc::new(edited.clone()), &options, &|_, _| {})
        .unwrap();
    let report = &found.report;
    assert_eq!((report.unchanged, report.recolored, report.out_of_reach), (0, 0, 0), "none");
    assert_eq!(report.blended, edited.len(), "every splat is estimated");
    let transport = report.transport.as_ref().unwrap();
    assert!(transport.converged && transport.residual < 1e-9, "{transport:?}");
    let last = found.scene.at(source.time_range().end).unwrap();
    assert_eq!(last.opacity_logits, edited.opacity_logits, "shared over all frames");
    assert_eq!(last.sh, edited.sh, "shared over all frames");
    let mut grown = last.log_scales.iter().zip(&edited.log_scales).map(|(a, b)| a[0] - b[0]);
    assert!(grown.all(|ln| ln > 8.0_f32.ln()), "changes of scale are not limited");
    // known copies, as with --motion amg, also share them
    let mut known = MotionOptions::preset(MotionPreset::Paper);
    known.identity.enabled = true;
    let mut recolored = edited.clone();
    for rgb in &mut recolored.sh {
        rgb[0] += 0.3;
    }
    let found =
        propagate(Arc::new(source.clone()), Arc::new(recolored.clone()), &known, &|_, _| {})
            .unwrap();
    assert_eq!(found.report.recolored, edited.len(), "every splat is known");
    let last = found.scene.at(source.time_range().end).unwrap();
    assert_eq!(last.opacity_logits, recolored.opacity_logits, "shared over all frames");
}

/// An additional baseline. Measured 0.439, 1.286, 1.497, 2.381 (lines: 0.555, 1.380, 1.600, 2.503):
/// on these scenes, lines do not improve the paper's method.
#[test]
fn farthest_point_anchors_reproduce_measured_errors() {
    let mut options = MotionOptions::preset(MotionPreset::Paper);
    if let MotionGuide::Paper(params) = &mut options.guide {
        params.sampling = AnchorSampling::FarthestPoints;
    }
    for (name, epe) in EDITS.into_iter().zip([0.439, 1.286, 1.497, 2.381]) {
        let found = run(&options, &golden_edit(name));
        assert!((found.epe / epe - 1.0).abs() <= 0.01, "{name}: {found}, measured {epe}");
    }
}

/// Measured EPE 0.0298, 0.0746, 0.0684, 0.2212, rotation 0.28°, 0.34°, 0.48°, 0.86°, scale error
/// 0.14 to 0.18; KNN-Guide has EPE 0.175, 0.905, 1.033, 1.802.
#[test]
fn errors_of_the_default_are_within_limits() {
    let limits = [(0.034, 0.36), (0.080, 0.36), (0.076, 0.6), (0.235, 0.9)];
    for (name, (limit, rotation)) in EDITS.into_iter().zip(limits) {
        let found = run(&MotionOptions::default(), &golden_edit(name));
        assert!(found.epe <= limit, "{name}: {found}, limit {limit}");
        assert!(found.rot <= rotation && found.lns <= 0.2, "{name}: {found}");
    }
}

/// Nine tenths of a real capture are static background without noise; it must not change the motion
/// of the figure. Measured EPE 0.221, as without background.
#[test]
fn a_static_background_changes_little() {
    let (mut source, size) = golden_source();
    let wall = source.frames[0].clone();
    for frame in &mut source.frames {
        for i in 0..9000 {
            frame.push_from(&wall, i % 1500);
            let mean = frame.means.last_mut().unwrap();
            mean[0] += 2.0 + (i / 1500) as f32 * 1.3;
            mean[2] *= 1.7;
        }
    }
    let edit = golden_edit("all");
    let options = MotionOptions::default();
    let splats = Arc::new(edit.splats.clone());
    let found = propagate(Arc::new(source), splats, &options, &|_, _| {}).unwrap();
    assert_eq!(found.report.num_dynamic, 1500, "the figure");
    let error = score(&found.scene, &edit, size);
    assert!(error.epe < 0.235, "{error}");
}

/// Splats that move unlike their neighbours must not determine the motion of others, even if one
/// splat in twenty is such a splat, lies inside the figure and was kept by the edit.
/// Measured 1.036 times the error without them.
#[test]
fn floaters_that_the_edit_keeps_have_little_influence() {
    let (mut source, size) = golden_source();
    let edit = golden_edit("all");
    let alone = run(&MotionOptions::default(), &edit);
    let first = source.frames[0].clone();
    let strays = (0..first.len()).step_by(20);
    for (k, frame) in source.frames.iter_mut().enumerate() {
        for i in strays.clone() {
            frame.push_from(&first, i);
            let away = ((i as f32 * 0.7 + k as f32 * 2.0).sin() - (i as f32 * 0.7).sin()) * 0.4;
            let mean = frame.means.last_mut().unwrap();
            *mean = [mean[0] + 0.01 + away, mean[1], mean[2] - away];
        }
    }
    let mut splats = edit.splats.clone();
    for i in first.len()..source.frames[0].len() {
        splats.push_from(&source.frames[0], i);
    }
    let options = MotionOptions::default();
    let found = propagate(Arc::new(source), Arc::new(splats), &options, &|_, _| {}).unwrap();
    assert!(found.report.num_floaters >= strays.len(), "{}", found.report.num_floaters);
    let error = score(&found.scene, &edit, size);
    assert!(error.epe < 1.04 * alone.epe, "{error}, without: {alone}");
}

/// Negative control of the metric and of the aggregation: the default's matches with the paper's
/// averages have a far larger error. Measured EPE 1.330, with rigid positions 0.229; rotation 25.5°.
#[test]
fn averaging_translations_increases_errors() {
    let options = MotionOptions::default().with_aggregation(Aggregation::PAPER);
    let found = run(&options, &golden_edit("all"));
    assert!(found.epe > 1.2 && found.rot > 23.0, "{found}");
    let rigid = Aggregation {
        position: PositionRule::Rigid,
        scale: ScaleRule::Isotropic,
        ..Aggregation::PAPER
    };
    let options = MotionOptions::default().with_aggregation(rigid);
    let found = run(&options, &golden_edit("all"));
    assert!(found.epe < 0.245 && found.rot > 23.0, "additive rotations alone: {found}");
}

#[test]
fn an_unchanged_frame_reproduces_the_source() {
    let (source, _) = golden_source();
    let edited = source.frames[0].clone();
    for preset in [MotionPreset::Regions, MotionPreset::Paper, MotionPreset::Knn] {
        let mut options = MotionOptions::preset(preset);
        options.identity.enabled = true;
        let found =
            propagate(Arc::new(source.clone()), Arc::new(edited.clone()), &options, &|_, _| {})
                .unwrap();
        for t in source.time_range().frames(6) {
            assert_eq!(found.scene.at(t).unwrap(), source.at(t).unwrap(), "{preset:?} at {t}");
        }
        assert_eq!(found.report.unchanged, edited.len(), "{preset:?}: every row is known");
    }
}
