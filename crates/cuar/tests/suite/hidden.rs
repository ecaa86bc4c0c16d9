//! Splats that no picture of frame 1 shows: which ones evidence must repair, and which ones it must
//! keep.

use crate::common::{
    delivered::{Delivered, cases, delivered, rings, wrong_rows},
    limits,
};
use cuar::{
    CuarError, Evidence, EvidenceParams, FADED_LOGIT, RefineOptions, Repair, render_evidence,
    render_total_uncertainty,
};
use gs_core::DynamicScene;
use gs_raster_cpu::CpuRasterizer;
use gs_synth::UnseenColor;
use std::sync::OnceLock;

fn small() -> &'static Vec<Delivered> {
    static CASES: OnceLock<Vec<Delivered>> = OnceLock::new();
    CASES.get_or_init(|| {
        let of = |(name, edits): (&'static str, Vec<_>)| {
            delivered(name, &edits, 12_000, 1, |scene| rings(scene, (160, 160)))
        };
        let some =
            cases().into_iter().filter(|(name, _)| !["trousers", "deleted legs"].contains(name));
        some.map(of).collect()
    })
}

fn named(name: &str) -> &'static Delivered {
    small().iter().find(|case| case.name == name).expect("a case")
}

fn evidence(case: &Delivered) -> Evidence {
    let (raster, params) = (CpuRasterizer::default(), EvidenceParams::default());
    Evidence::of(&raster, case.scene(), &case.before(), 0.0, &case.pictures, &params).unwrap()
}

fn repair(case: &Delivered) -> Repair {
    Repair::of(&evidence(case), RefineOptions::default().min_uncertainty)
}

/// Times at which repairs are compared with ground truth.
const JUDGED: [f32; 2] = [0.3, 0.6];

#[test]
fn repair_improves_revealed_pixels_and_worsens_no_others() {
    let mut gains = Vec::new();
    for case in small() {
        let repair = repair(case);
        let (before, after, broken) = limits::judged(case, &repair.scene(case.scene()), &JUDGED);
        assert!(broken.is_empty(), "{}: {broken:?}", case.name);
        gains.push(after[0] - before[0]);
    }
    let mean = gains.iter().sum::<f64>() / gains.len() as f64;
    assert!(mean > limits::MEAN_GAIN, "gains {gains:?}, {mean} dB in the mean");
}

/// The limits detect a leaking repair, in which every hidden splat gets the mean change of the
/// edited ones.
#[test]
fn a_repair_of_every_hidden_splat_violates_the_limits() {
    let case = named("recolour");
    let evidence = evidence(case);
    let (now, then) = (&case.given.splats, case.source.frame1());
    let coeffs = now.sh_coeffs();
    let mut mean = vec![[0.0_f32; 3]; coeffs];
    let changed: Vec<usize> = (0..now.len()).filter(|&i| evidence.changed[i]).collect();
    for &i in &changed {
        let source = case.source_rows[i].unwrap() as usize;
        for ((mean, now), then) in mean.iter_mut().zip(now.sh_of(i)).zip(then.sh_of(source)) {
            (0..3).for_each(|c| mean[c] += (now[c] - then[c]) / changed.len() as f32);
        }
    }
    let mut leaking = Repair::default();
    for i in (0..now.len()).filter(|&i| evidence.supervision[i] < 0.5 && !evidence.changed[i]) {
        leaking.rows.push(u32::try_from(i).unwrap());
        leaking.d_sh.extend(&mean);
    }
    let (.., broken) = limits::judged(case, &leaking.scene(case.scene()), &JUDGED);
    assert!(!broken.is_empty(), "{} rows leak", leaking.rows.len());
    let perfect = case.perfect();
    let (before, after, _) = limits::judged(&perfect, &leaking.scene(perfect.scene()), &JUDGED);
    assert!(!limits::broken_perfect(before, after).is_empty(), "{before:?} → {after:?} dB");
}

/// Hidden splats with black or random colours instead of old ones.
#[test]
fn meaningless_colours_are_repaired() {
    let mut gains = Vec::new();
    for (name, unseen) in [
        ("recolour", UnseenColor::Black),
        ("recolour", UnseenColor::Random),
        ("textured", UnseenColor::Black),
        ("textured", UnseenColor::Random),
        ("deleted", UnseenColor::Random),
    ] {
        let case = named(name).with_unseen(unseen);
        let evidence = evidence(&case);
        assert!(
            evidence.meaningless.len() > 10,
            "{name}, {unseen:?}: {}",
            evidence.meaningless.len()
        );
        let repair = Repair::of(&evidence, RefineOptions::default().min_uncertainty);
        let (before, after, broken) = limits::judged(&case, &repair.scene(case.scene()), &JUDGED);
        assert!(broken.is_empty(), "{name}, {unseen:?}: {broken:?}");
        gains.push(after[0] - before[0]);
    }
    let mean = gains.iter().sum::<f64>() / gains.len() as f64;
    assert!(mean > limits::MEAN_GAIN, "gains {gains:?}, {mean} dB in the mean");
}

#[test]
fn repaired_splats_are_those_that_the_edit_missed() {
    for name in ["recolour", "textured"] {
        let case = named(name);
        let (wrong, repair) = (wrong_rows(case).unwrap(), repair(case));
        let missed = wrong.iter().filter(|wrong| **wrong).count();
        let right = repair.rows.iter().filter(|&&row| wrong[row as usize]).count();
        assert!(missed > 50, "{name}: {missed} missed");
        assert!(10 * right > 8 * missed, "{name}: {right} of {missed} found");
        assert!(
            10 * right > 8 * repair.rows.len(),
            "{name}: {right} of {} right",
            repair.rows.len()
        );
    }
    let case = named("deleted");
    let remnants = case.given.splats.len() - case.truth.splats.len();
    let faded = repair(case).faded.len();
    assert!(
        remnants > 10 && 10 * faded > 6 * remnants && faded <= remnants,
        "{faded} of {remnants} fade"
    );
}

#[test]
fn repaired_scenes_flicker_no_more_than_the_truth() {
    for case in small() {
        let repair = repair(case);
        let broken = limits::broken_flicker(case, &repair.scene(case.scene()));
        assert!(broken.is_empty(), "{}: {broken:?}", case.name);
    }
}

#[test]
fn a_perfect_edit_is_unchanged() {
    for case in small() {
        let found = repair(&case.perfect());
        assert!(
            found.is_empty(),
            "{}: {} rows, {} fade",
            case.name,
            found.rows.len(),
            found.faded.len()
        );
    }
}

#[test]
fn unedited_scenes_have_no_evidence() {
    let case = named("recolour");
    let rows: Vec<Option<u32>> =
        (0..case.source.num_splats()).map(|i| u32::try_from(i).ok()).collect();
    let before = cuar::BeforeEdit { scene: &case.source, source_rows: &rows };
    let (raster, params) = (CpuRasterizer::default(), EvidenceParams::default());
    let of = |rows: &cuar::BeforeEdit<'_>| {
        Evidence::of(&raster, &case.source, rows, 0.0, &case.pictures, &params)
    };
    let found = of(&before).unwrap();
    assert!(found.xi.iter().all(|xi| *xi == 0.0) && found.remnants.is_empty(), "nothing");
    let short = cuar::BeforeEdit { source_rows: &rows[1..], ..before };
    assert!(matches!(of(&short), Err(CuarError::Shape { .. })), "of another scene");
    let mut far = rows.clone();
    far[0] = Some(u32::MAX);
    let far = cuar::BeforeEdit { source_rows: &far, ..before };
    assert!(matches!(of(&far), Err(CuarError::Input { .. })), "no such splat");
}

#[test]
fn the_stage_keeps_geometry_and_supervised_colours_bit_for_bit() {
    let case = named("demo");
    let options = RefineOptions { samples: 6, ..RefineOptions::default() };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| case.refined(case.scene(), 6, &options))
    };
    let (one, three) = (on(1), on(3));
    assert_eq!((&one.d_sh, &one.sh, &one.faded), (&three.d_sh, &three.sh, &three.faded), "threads");
    let (evidence, counts) = (evidence(case), one.report.repair);
    assert!(counts.recoloured > 50 && !counts.reaches_hidden, "{counts:?}");
    let original = case.scene().at(0.5).unwrap();
    let now = one.scene(case.scene()).at(0.5).unwrap();
    assert_eq!((&now.means, &now.quats), (&original.means, &original.quats), "geometry");
    let source = case.source.frame1();
    let mut changed = 0;
    for i in 0..now.len() {
        let is_source =
            case.source_rows[i].is_some_and(|id| source.sh_of(id as usize) == original.sh_of(i));
        if now.sh_of(i) == original.sh_of(i) {
            continue;
        }
        changed += 1;
        assert!(!is_source || evidence.xi[i] > 0.0, "unedited row {i} changed");
        assert!(!is_source || evidence.supervision[i] < 1.0, "supervised row {i} changed");
    }
    assert!(changed >= counts.recoloured, "{changed} rows changed, {counts:?}");
    let without = RefineOptions { evidence: None, ..options };
    let counts = case.refined(case.scene(), 6, &without).report.repair;
    assert_eq!(counts.recoloured + counts.faded, 0, "not requested");
}

#[test]
fn remnants_of_deleted_objects_fade_and_are_uncertain() {
    let case = named("deleted");
    let (evidence, repair) = (evidence(case), repair(case));
    assert!(!repair.faded.is_empty(), "remnants");
    let splats = repair.scene(case.scene()).at(0.7).unwrap();
    for &row in &repair.faded {
        assert_eq!(splats.opacity_logits[row as usize], FADED_LOGIT, "row {row}");
        assert_eq!(evidence.xi[row as usize], 1.0, "row {row}");
    }
    let (raster, camera) = (CpuRasterizer::default(), &case.held_out[0]);
    let [at_t, at_1] = [0.6, 0.0].map(|t| case.scene().at(t).unwrap());
    let own = render_evidence(&raster, &at_t, &evidence.xi, camera).unwrap();
    let total = render_total_uncertainty(&raster, &at_t, &at_1, &evidence.xi, camera).unwrap();
    assert!(own.data.iter().zip(&total.data).all(|(own, total)| *own <= total + 1e-5), "a part");
    assert!(own.data.iter().any(|own| *own > 0.1), "motion reveals the remnants");
    let none = render_evidence(&raster, &at_t, &[], camera).unwrap();
    assert!(none.data.iter().all(|own| *own == 0.0), "no evidence");
}
