//! Properties of the truth cases; the metric reproduces known errors.

use glam::Vec3;
use gs_core::{DynamicScene, SceneError, Splats, TimeRange, quat};
use gs_synth::{
    Kind, Part, SynthError, Tag, TruthCase, TruthScene, build, motion_error, motion_error_of,
};

const TIMES: [f32; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];

fn make(case: TruthCase) -> TruthScene {
    build(case, 1, 2_000).expect("valid")
}

fn rows_of(scene: &TruthScene, part: Part) -> Vec<usize> {
    let rows = scene.source.rows();
    let solid = |i: &usize| rows[*i].part == part && rows[*i].kind == Kind::Surface;
    (0..rows.len()).filter(solid).collect()
}

fn nearest(splats: &Splats, a: &[usize], b: &[usize]) -> f32 {
    let mut smallest = f32::INFINITY;
    for &i in a {
        for &j in b {
            smallest = smallest.min(Vec3::from(splats.means[i]).distance(splats.means[j].into()));
        }
    }
    smallest
}

#[test]
fn every_case_is_complete() {
    for case in TruthCase::ALL {
        let scene = make(case);
        assert_eq!(scene.source.num_splats(), 2_000, "{case}: size");
        let edited = &scene.edited;
        assert_eq!(edited.truth.at(0.0).unwrap(), edited.splats, "{case}: frame 1");
        assert!(scene.figure_size > 0.5, "{case}: figure size");
        for t in TIMES {
            for splats in [scene.source.at(t).unwrap(), edited.truth.at(t).unwrap()] {
                assert!((0..splats.len()).all(|i| splats.is_finite(i)), "{case} at {t}");
            }
        }
        let self_score = motion_error(&edited.truth, &edited.truth, &TIMES).unwrap();
        assert_eq!(self_score.epe, 0.0, "{case}: the truth has no error");
        assert!(self_score.num_scored > 1_000, "{case}: scored");
        assert_eq!(case.name().parse::<TruthCase>().unwrap(), case, "name");
    }
    assert!(matches!("x".parse::<TruthCase>(), Err(SynthError::UnknownCase(_))), "unknown");
    assert!(build(TruthCase::Drift, 0, 3).is_err(), "too small");
}

#[test]
fn cases_are_functions_of_their_seed() {
    for case in [TruthCase::Everything, TruthCase::GrazingLimb] {
        let (a, b) = (make(case), make(case));
        assert_eq!(a.source, b.source, "{case}: source");
        assert_eq!(a.edited.splats, b.edited.splats, "{case}: edit");
    }
}

#[test]
fn unedited_source_scores_only_its_noise() {
    let scene = make(TruthCase::Recolour);
    let score = motion_error(&scene.source, &scene.edited.truth, &TIMES).unwrap();
    assert!((0.03..0.12).contains(&score.epe), "typical of a trained field: {score:?}");
    assert!(score.rot_deg < 1.5 && score.bad5 == 0.0, "{score:?}");
    let noisy = make(TruthCase::NoisyReconstruction);
    assert_ne!(noisy.source.frame1(), scene.source.frame1(), "jittered");
}

#[test]
fn grazing_limb_passes_within_two_spacings() {
    let scene = make(TruthCase::GrazingLimb);
    let arm = rows_of(&scene, Part::ForearmL);
    let body: Vec<usize> = [Part::Chest, Part::Pelvis, Part::ThighL]
        .iter()
        .flat_map(|&part| rows_of(&scene, part))
        .collect();
    let spacing = scene.source.rows()[body[0]].spacing;
    let clean = scene.source.noise_free();
    let gap = (0_u8..8)
        .map(|k| nearest(&clean.at(f32::from(k) / 8.0).unwrap(), &arm, &body))
        .fold(f32::INFINITY, f32::min);
    assert!(gap < 2.0 * spacing, "gap {gap}, spacing {spacing}");
    assert!(gap > 0.2 * spacing, "they do not merge: gap {gap}, spacing {spacing}");
    assert!(scene.edited.truth.contact_mask.iter().any(|&mark| mark), "contact");
}

#[test]
fn objects_touch_and_separate() {
    let scene = make(TruthCase::TouchAndPart);
    let (a, b) = (rows_of(&scene, Part::ObjectA), rows_of(&scene, Part::ObjectB));
    let spacing = scene.source.rows()[a[0]].spacing;
    assert!(nearest(scene.source.frame1(), &a, &b) < 2.0 * spacing, "touch");
    assert!(nearest(&scene.source.at(1.0).unwrap(), &a, &b) > 0.3, "part");
    assert!(scene.edited.truth.contact_mask.iter().any(|&mark| mark), "contact");
}

#[test]
fn fast_rotation_turns_by_180_degrees() {
    let scene = make(TruthCase::FastRotation);
    let end = scene.source.noise_free().at(1.0).unwrap();
    let foot = rows_of(&scene, Part::FootL)[0];
    let turn = quat::mul(end.quats[foot], quat::conjugate(scene.source.frame1().quats[foot]));
    let angle = 2.0 * turn[0].abs().min(1.0).acos().to_degrees();
    assert!((angle - 180.0).abs() < 1.0, "{angle}");
}

#[test]
fn cloth_is_not_rigid() {
    let scene = make(TruthCase::StretchingCloth);
    let rows = rows_of(&scene, Part::Cloth);
    let end = scene.source.noise_free().at(1.0).unwrap();
    let (a, b) = (rows[3], rows[rows.len() / 3]);
    let gap = |splats: &Splats| Vec3::from(splats.means[a]).distance(splats.means[b].into());
    let stretch = gap(&end) / gap(scene.source.frame1());
    assert!((1.1..1.5).contains(&stretch), "{stretch}");
    assert_ne!(end.log_scales[a], scene.source.frame1().log_scales[a], "splats stretch too");
}

#[test]
fn floaters_and_outliers_exist_and_move_wrongly() {
    let scene = make(TruthCase::FloatersOutliers);
    let count = |kind| scene.source.rows().iter().filter(|row| row.kind == kind).count();
    assert_eq!(count(Kind::Floater), 100, "5 %");
    assert!((50..120).contains(&count(Kind::Outlier)), "about 5 % of the surface");
    let (wrong, right) =
        (scene.source.at(1.0).unwrap(), scene.source.noise_free().at(1.0).unwrap());
    for (i, row) in scene.source.rows().iter().enumerate() {
        let off = Vec3::from(wrong.means[i]).distance(right.means[i].into()) / scene.figure_size;
        if row.kind == Kind::Outlier {
            assert!(off > 0.02, "outlier {i}: {off}");
        }
    }
    for (i, row) in scene.edited.truth.rows().iter().enumerate() {
        let unmoved = scene.edited.truth.tags[i] == Tag::Unchanged;
        let skipped = row.kind == Kind::Floater || (row.kind == Kind::Outlier && unmoved);
        assert_eq!(scene.edited.truth.eval_mask[i], !skipped, "row {i}");
    }
}

#[test]
fn placed_regions_move_rigidly_with_their_bones() {
    for (case, part, scale) in
        [(TruthCase::ScaleObject, Part::Held, 1.5), (TruthCase::TurnHead, Part::Head, 1.0)]
    {
        let scene = make(case);
        let truth = &scene.edited.truth;
        let rows: Vec<usize> =
            (0..truth.tags.len()).filter(|&i| truth.tags[i] == Tag::Transformed).collect();
        assert!(rows.len() > 30, "{case}: {} splats", rows.len());
        let parent =
            |i: usize| truth.source_rows[i].expect("descends from a source splat") as usize;
        let source = scene.source.frame1();
        let gap = |splats: &Splats, a: usize, b: usize| {
            Vec3::from(splats.means[a]).distance(splats.means[b].into())
        };
        let hand = (0..truth.parts.len()).find(|&i| {
            let row = &truth.rows()[i];
            row.rigid_bone() == Some(part.bone()) && truth.tags[i] == Tag::Unchanged
        });
        for (i, &row) in rows.iter().enumerate() {
            assert_eq!(truth.parts[row], part, "{case}: other splats are unchanged");
            let other = rows[(i + 7) % rows.len()];
            let (was, is) =
                (gap(source, parent(row), parent(other)), gap(&scene.edited.splats, row, other));
            assert!((is - scale * was).abs() < 1e-5, "{case}: {was} became {is}");
        }
        let rigid: Vec<usize> =
            rows.into_iter().filter(|&i| truth.rows()[i].rigid_bone().is_some()).collect();
        let end = truth.at(1.0).expect("in range");
        for pair in rigid.windows(2) {
            let (was, is) =
                (gap(&scene.edited.splats, pair[0], pair[1]), gap(&end, pair[0], pair[1]));
            assert!((was - is).abs() < 1e-5, "{case}: rigid");
        }
        // The head moves rigidly, the hand does not.
        if let Some(hand) = hand {
            let was = gap(&scene.edited.splats, rigid[0], hand);
            assert!((gap(&end, rigid[0], hand) - was).abs() < 1e-5, "{case}: stays in the hand");
        } else {
            assert_eq!(case, TruthCase::TurnHead, "only the head is not in a hand");
        }
    }
}

/// The truth, translated, rotated and scaled by known amounts.
#[derive(Debug)]
struct Off<'a> {
    scene: &'a TruthScene,
    shift: f32,
    angle_rad: f32,
    grow: f32,
}

impl DynamicScene for Off<'_> {
    fn num_splats(&self) -> usize {
        self.scene.edited.truth.num_splats()
    }

    fn sh_degree(&self) -> usize {
        1
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.scene.edited.truth.at_into(t, out)?;
        let turn = quat::from_glam(glam::Quat::from_rotation_y(self.angle_rad));
        for i in 0..out.len() {
            out.means[i][1] += self.shift;
            out.quats[i] = quat::mul(turn, out.quats[i]).map(|c| -3.0 * c);
            out.log_scales[i] = out.log_scales[i].map(|value| value + self.grow);
        }
        Ok(())
    }
}

#[test]
fn metric_measures_known_errors() {
    let scene = make(TruthCase::Drift);
    let size = scene.figure_size;
    let off = Off { scene: &scene, shift: 0.06 * size, angle_rad: 0.1, grow: -0.02 };
    let score = motion_error(&off, &scene.edited.truth, &TIMES).unwrap();
    for (name, found, expected, tolerance) in [
        ("epe", score.epe, 6.0, 1e-3),
        ("p95", score.p95, 6.0, 1e-3),
        ("bad5", score.bad5, 100.0, 1e-9),
        ("contact", score.contact, 6.0, 1e-3),
        ("rot", score.rot_deg, 0.1_f64.to_degrees(), 1e-3),
        ("lns", score.lns, 2.0, 1e-3),
    ] {
        assert!((found - expected).abs() < tolerance, "{name}: {found}, expected {expected}");
    }
    assert!(score.num_contact > 0 && score.num_contact < score.num_scored, "{score:?}");
    let none = vec![false; scene.edited.splats.len()];
    let empty = motion_error_of(&off, &scene.edited.truth, &TIMES, &none).unwrap();
    assert_eq!(empty.epe, 0.0, "nothing scored");
    let wrong = make(TruthCase::GraftHat);
    let error = motion_error(&wrong.edited.truth, &scene.edited.truth, &TIMES);
    assert!(matches!(error, Err(SynthError::Count { .. })), "counts differ");
}
