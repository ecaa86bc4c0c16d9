//! Selections that an editor moved, rotated or scaled are recognised and move with the object to
//! which they belong.
use amg::{
    Identity, IdentityMap, IdentityParams, MotionOptions, MotionPreset, RowKind, Similarity,
    propagate,
};
use gs_core::{DynamicScene, Precision, RowPrecision, Splats, quat};
use gs_synth::{Part, SynthScene, TruthCase, build};
use std::sync::Arc;

const TIMES: [f32; 4] = [0.2, 0.5, 0.75, 1.0];

fn scene() -> SynthScene {
    build(TruthCase::Recolour, 5, 6000).unwrap().source
}

fn of_parts(scene: &SynthScene, parts: &[Part]) -> Vec<usize> {
    (0..scene.rows().len()).filter(|&i| parts.contains(&scene.rows()[i].part)).collect()
}

fn centre(splats: &Splats, rows: &[usize]) -> [f64; 3] {
    let n = rows.len() as f64;
    let sum = |k: usize| rows.iter().map(|&i| f64::from(splats.means[i][k])).sum::<f64>();
    [0, 1, 2].map(|k| sum(k) / n)
}

/// `scale` and `rotation` about `about`, then `shift`.
fn about(about: [f64; 3], scale: f64, rotation: [f64; 4], shift: [f64; 3]) -> Similarity {
    let rotation = quat::normalize(rotation);
    let plain = Similarity { scale, rotation, mirrored: false, translation: [0.0; 3] };
    let turned = plain.apply_vector(about);
    Similarity { translation: [0, 1, 2].map(|k| about[k] - turned[k] + shift[k]), ..plain }
}

/// The splats with `rows` transformed.
fn placed(splats: &Splats, rows: &[usize], similarity: &Similarity) -> Splats {
    let moved = similarity.transform(&splats.select(rows));
    let (mut edited, coeffs) = (splats.clone(), splats.sh_coeffs());
    for (i, &row) in rows.iter().enumerate() {
        edited.means[row] = moved.means[i];
        edited.quats[row] = moved.quats[i];
        edited.log_scales[row] = moved.log_scales[i];
        edited.sh[row * coeffs..][..coeffs].copy_from_slice(moved.sh_of(i));
    }
    edited
}

fn map(source: &Splats, edited: &Splats) -> IdentityMap {
    IdentityMap::of(source, edited, &IdentityParams::default()).unwrap()
}

fn distance(a: [f32; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (f64::from(a[k]) - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// True positions at `t` of `rows`, transformed by `to` at the edit time: the rigid motion of their
/// part without noise, as the affine map of four splats of the part.
fn truth(
    clean: &SynthScene,
    rows: &[usize],
    to: &dyn Fn(usize, [f64; 3]) -> [f64; 3],
    t: f32,
) -> Vec<[f64; 3]> {
    let (first, now) = (clean.at(0.0).unwrap(), clean.at(t).unwrap());
    let point = |splats: &Splats, i: usize| splats.means[i].map(f64::from);
    let minus = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| a[k] - b[k]);
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    // The four splats span a large volume.
    let base = rows[0];
    let mut best = (0.0, [0; 3]);
    for i in rows.iter().step_by(rows.len().div_ceil(12)) {
        for j in rows.iter().step_by(rows.len().div_ceil(12)) {
            for k in rows.iter().step_by(rows.len().div_ceil(12)) {
                let d = [*i, *j, *k].map(|row| minus(point(&first, row), point(&first, base)));
                let volume = dot(d[0], cross(d[1], d[2])).abs();
                if volume > best.0 {
                    best = (volume, [*i, *j, *k]);
                }
            }
        }
    }
    let d = best.1.map(|row| minus(point(&first, row), point(&first, base)));
    let e = best.1.map(|row| minus(point(&now, row), point(&now, base)));
    let volume = dot(d[0], cross(d[1], d[2]));
    let dual = [cross(d[1], d[2]), cross(d[2], d[0]), cross(d[0], d[1])];
    rows.iter()
        .map(|&row| {
            let x = minus(to(row, point(&first, row)), point(&first, base));
            let share = dual.map(|c| dot(c, x) / volume);
            let origin = point(&now, base);
            [0, 1, 2].map(|k| origin[k] + (0..3).map(|m| share[m] * e[m][k]).sum::<f64>())
        })
        .collect()
}

/// Mean error of `rows` over the times, world units, for the default and for KNN-Guide.
fn errors(
    scene: &SynthScene,
    rows: &[usize],
    to: &dyn Fn(usize, [f64; 3]) -> [f64; 3],
    edited: Splats,
) -> [f64; 2] {
    let source: Arc<dyn DynamicScene> = Arc::new(scene.clone());
    let (clean, edited) = (scene.noise_free(), Arc::new(edited));
    [MotionPreset::Regions, MotionPreset::Knn].map(|preset| {
        let options = MotionOptions::preset(preset);
        let found = propagate(Arc::clone(&source), Arc::clone(&edited), &options, &|_, _| {});
        let found = found.unwrap().scene;
        let mut sum = 0.0;
        for t in TIMES {
            let expected = truth(&clean, rows, to, t);
            let means = found.at(t).unwrap().means;
            sum += rows.iter().zip(expected).map(|(&row, x)| distance(means[row], x)).sum::<f64>();
        }
        sum / (rows.len() * TIMES.len()) as f64
    })
}

/// Mean distance of the source's own splats from their true positions.
fn noise(scene: &SynthScene, rows: &[usize]) -> f64 {
    let clean = scene.noise_free();
    let sum: f64 = TIMES
        .iter()
        .map(|&t| {
            let (now, truth) = (scene.at(t).unwrap().means, clean.at(t).unwrap().means);
            rows.iter().map(|&i| distance(now[i], truth[i].map(f64::from))).sum::<f64>()
        })
        .sum();
    sum / (rows.len() * TIMES.len()) as f64
}

#[test]
fn moved_parts_follow_their_body_part() {
    let scene = scene();
    let first = scene.frame1().clone();
    for (name, part, scale, turn, shift) in [
        ("a scaled forearm", Part::ForearmR, 1.3, [1.0, 0.0, 0.0, 0.0], [0.0; 3]),
        ("a turned head", Part::Head, 1.0, [0.95, 0.0, 0.3, 0.0], [0.0; 3]),
        ("a shoe moved and shrunk", Part::FootL, 0.7, [0.9, 0.1, 0.2, 0.0], [0.3, 0.0, 0.2]),
    ] {
        let rows: Vec<usize> = of_parts(&scene, &[part])
            .into_iter()
            .filter(|&i| scene.rows()[i].rigid_bone() == Some(part.bone()))
            .collect();
        let similarity = about(centre(&first, &rows), scale, turn, shift);
        let edited = placed(&first, &rows, &similarity);
        let found = map(&first, &edited);
        let moved = rows.iter().filter(|&&row| matches!(found.rows[row], Identity::Moved { source, .. } if source as usize == row));
        assert_eq!(moved.count(), rows.len(), "{name}: all of its splats, and each is itself");
        assert_eq!(found.moved, rows.len(), "{name}: and no others");
        assert_eq!(found.similarities.len(), 1, "{name}: {:?}", found.similarities);
        let [ours, knn] = errors(&scene, &rows, &|_, x| similarity.apply(x), edited);
        // The result cannot be better than the source, whose splats have noise.
        let floor = scale.max(1.0) * noise(&scene, &rows);
        assert!(
            ours <= (0.10 * knn).max(1.1 * floor),
            "{name}: {ours} against {knn} of KNN-Guide; the source's own noise is {floor}"
        );
    }
}

#[test]
fn several_groups_and_copies_are_recognised() {
    let scene = scene();
    let first = scene.frame1().clone();
    let (head, arm) = (of_parts(&scene, &[Part::Head]), of_parts(&scene, &[Part::UpperArmL]));
    let larger = about(centre(&first, &head), 1.2, [1.0, 0.0, 0.0, 0.0], [0.0; 3]);
    let aside = about(centre(&first, &arm), 1.0, [0.9, 0.0, 0.0, 0.3], [0.4, 0.0, 0.0]);
    let mut edited = placed(&placed(&first, &head, &larger), &arm, &aside);
    // Two copies of the head next to it, one above the other.
    let copies = [
        about(centre(&first, &head), 0.9, [0.8, 0.0, 0.4, 0.0], [0.0, 0.4, 0.0]),
        about(centre(&first, &head), 1.1, [0.8, 0.3, 0.0, 0.0], [0.0, 0.4, 0.0]),
    ];
    for copy in &copies {
        let copied = copy.transform(&first.select(&head));
        (0..head.len()).for_each(|i| edited.push_from(&copied, i));
    }
    let found = map(&first, &edited);
    assert_eq!(found.similarities.len(), 4, "groups");
    assert_eq!(found.moved, 3 * head.len() + arm.len(), "moved rows");
    for (i, &row) in head.iter().enumerate() {
        let copies = [row, first.len() + i, first.len() + head.len() + i];
        for row in copies {
            assert!(
                matches!(found.rows[row], Identity::Moved { source, .. } if source as usize == head[i]),
                "row {row}: {:?}",
                found.rows[row]
            );
        }
    }
    assert!(found.removed.is_empty(), "nothing is removed: {}", found.removed.len());
}

#[test]
fn groups_with_untransformed_rotations_sizes_or_colours_are_recognised() {
    let scene = scene();
    let first = scene.frame1().clone();
    let rows = of_parts(&scene, &[Part::Head]);
    let similarity = about(centre(&first, &rows), 1.3, [0.9, 0.0, 0.4, 0.0], [0.1, 0.0, 0.0]);
    let proper = placed(&first, &rows, &similarity);
    let mut no_turn = proper.clone();
    no_turn.quats.clone_from(&first.quats);
    let mut no_size = proper.clone();
    no_size.log_scales.clone_from(&first.log_scales);
    let mut other_colour = proper.clone();
    let coeffs = first.sh_coeffs();
    for &row in &rows {
        other_colour.sh[row * coeffs] = [0.3, -0.2, 0.9];
    }
    let mut mirrored = proper.clone();
    for &row in &rows {
        mirrored.means[row][0] = -proper.means[row][0];
    }
    for (what, edited) in [
        ("rotations left alone", no_turn),
        ("sizes left alone", no_size),
        ("recoloured", other_colour),
        ("mirrored", mirrored),
    ] {
        let found = map(&first, &edited);
        assert_eq!(found.moved, rows.len(), "{what}: {:?}", found.similarities);
        assert_eq!(found.similarities.len(), 1, "{what}");
        let group = found.similarities[0];
        assert!((group.scale - 1.3).abs() < 1e-4, "{what}: {group:?}");
        assert_eq!(group.mirrored, what == "mirrored", "{what}: {group:?}");
    }
}

#[test]
fn rounded_groups_are_recognised_and_restored() {
    let scene = scene();
    let first = scene.frame1().clone();
    let rows = of_parts(&scene, &[Part::Head, Part::ForearmL]);
    let similarity = about(centre(&first, &rows), 1.4, [0.9, 0.2, 0.3, 0.0], [0.5, 0.1, 0.0]);
    let exact = placed(&first, &rows, &similarity);
    let mut edited = exact.clone();
    let step = |value: f32, steps: f32| (value * steps).round() / steps;
    for i in 0..edited.len() {
        edited.means[i] = edited.means[i].map(|v| step(v, 4096.0));
        edited.log_scales[i] = edited.log_scales[i].map(|v| step(v, 16.0));
        let dc = i * edited.sh_coeffs();
        edited.sh[dc] = edited.sh_of(i)[0].map(|v| step(v, 40.0));
        let opacity = step(edited.opacity(i), 255.0).clamp(1e-3, 1.0 - 1e-3);
        edited.opacity_logits[i] = (opacity / (1.0 - opacity)).ln();
    }
    let precision = RowPrecision {
        means: [0.5 / 4096.0; 3],
        log_scales: [1.0 / 32.0; 3],
        opacity: 0.5 / 255.0 + 1e-3,
        sh_dc: [0.5 / 40.0; 3],
        ..RowPrecision::EXACT
    };
    let params = IdentityParams {
        precision: Some(Arc::new(Precision::uniform(precision))),
        ..IdentityParams::default()
    };
    let found = IdentityMap::of(&first, &edited, &params).unwrap();
    let right = |&&row: &&usize| matches!(found.rows[row], Identity::Moved { source, .. } if source as usize == row);
    let share = rows.iter().filter(right).count() as f64 / rows.len() as f64;
    assert!(share > 0.99, "{share} of {} are recognised", rows.len());
    let restored = found.restore(&first, &edited);
    let size = f64::from(scene.figure_size());
    for &row in rows.iter().filter(right) {
        let miss = distance(restored.means[row], exact.means[row].map(f64::from));
        assert!(miss < 2e-5 * size, "row {row} has an error of {miss}");
    }
    let before: f64 =
        rows.iter().map(|&r| distance(edited.means[r], exact.means[r].map(f64::from))).sum();
    let after: f64 =
        rows.iter().map(|&r| distance(restored.means[r], exact.means[r].map(f64::from))).sum();
    assert!(after < 0.3 * before, "rounding is undone: {before} became {after}");
}

#[test]
fn whole_scenes_keep_their_trajectories_under_the_similarity() {
    let scene = scene();
    let first = scene.frame1().clone();
    let all: Vec<usize> = (0..first.len()).collect();
    for similarity in [
        about([0.0; 3], 1.0, [0.0, 1.0, 0.0, 0.0], [0.0; 3]),
        about([0.0; 3], 0.01, [0.7, 0.7, 0.0, 0.0], [5.0, 0.0, 1.0]),
        Similarity { mirrored: true, ..about([0.0; 3], 2.0, [0.0, 0.0, 1.0, 0.0], [0.0; 3]) },
    ] {
        let edited = placed(&first, &all, &similarity);
        let found = map(&first, &edited);
        assert!(found.moved * 100 >= 99 * first.len(), "{} of {}", found.moved, first.len());
        let group = found.whole_scene().expect("the whole scene");
        let measured = found.similarities[group as usize];
        assert!((measured.scale / similarity.scale - 1.0).abs() < 1e-5, "{measured:?}");
        assert_eq!(measured.mirrored, similarity.mirrored, "{measured:?}");
        let source: Arc<dyn DynamicScene> = Arc::new(scene.clone());
        let options = MotionOptions::preset(MotionPreset::Regions);
        let propagated =
            propagate(Arc::clone(&source), Arc::new(edited), &options, &|_, _| {}).unwrap();
        let (now, then) =
            (propagated.scene.at(0.5).unwrap(), similarity.transform(&source.at(0.5).unwrap()));
        let size = similarity.scale * f64::from(scene.figure_size());
        for (row, identity) in found.rows.iter().enumerate() {
            if matches!(identity, Identity::Moved { .. }) {
                let miss = distance(now.means[row], then.means[row].map(f64::from));
                assert!(miss < 1e-4 * size, "row {row} has an error of {miss}");
                let turn = quat::dot(now.rotation(row), then.rotation(row)).abs();
                assert!(turn > 0.9999, "row {row} has a different rotation: {turn}");
            }
        }
    }
}

#[test]
fn edits_without_moved_groups_have_none() {
    let scene = scene();
    let first = scene.frame1().clone();
    let far = |case: TruthCase| {
        let built = build(case, 9, 4000).unwrap();
        map(built.source.frame1(), &built.edited.splats)
    };
    for case in [
        TruthCase::Drift,
        TruthCase::Clothing,
        TruthCase::PruneSplit,
        TruthCase::Everything,
        TruthCase::NoisyReconstruction,
    ] {
        let found = far(case);
        assert!(found.moved * 200 <= found.rows.len(), "{case}: {} moved", found.moved);
    }
    // A different scene, with a very coarse precision.
    let other = build(TruthCase::Recolour, 77, 6000).unwrap().source.frame1().clone();
    let coarse = RowPrecision {
        means: [1e-3; 3],
        log_scales: [1.0 / 32.0; 3],
        opacity: 1.0 / 255.0,
        sh_dc: [0.0125; 3],
        rotation_rad: 0.01,
        ..RowPrecision::EXACT
    };
    for precision in [None, Some(Arc::new(Precision::uniform(coarse)))] {
        let params = IdentityParams { precision, ..IdentityParams::default() };
        let all: Vec<usize> = (0..other.len()).collect();
        let turned = placed(&other, &all, &about([0.0; 3], 1.7, [0.5, 0.5, 0.1, 0.0], [9.0; 3]));
        let found = IdentityMap::of(&first, &turned, &params).unwrap();
        assert!(found.moved * 100 <= turned.len(), "{} of a different scene", found.moved);
    }
    let off = IdentityParams { moved: false, ..IdentityParams::default() };
    let rows = of_parts(&scene, &[Part::Head]);
    let edited = placed(&first, &rows, &about([0.0; 3], 1.5, [1.0, 0.0, 0.0, 0.0], [0.0; 3]));
    assert_eq!(IdentityMap::of(&first, &edited, &off).unwrap().moved, 0, "switched off");
}

#[test]
fn moved_rows_fade_with_their_sources_for_any_order_and_threads() {
    let scene = scene();
    let first = scene.frame1().clone();
    let rows = of_parts(&scene, &[Part::Head]);
    let similarity = about(centre(&first, &rows), 1.3, [1.0, 0.1, 0.0, 0.0], [0.0; 3]);
    let edited = placed(&first, &rows, &similarity);
    let order: Vec<usize> = (0..edited.len()).map(|i| (i * 3571 + 11) % edited.len()).collect();
    let source: Arc<dyn DynamicScene> = Arc::new(scene.clone());
    let options = MotionOptions::preset(MotionPreset::Regions);
    let run = |edited: Splats, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let found = propagate(Arc::clone(&source), Arc::new(edited), &options, &|_, _| {});
            found.unwrap().scene
        })
    };
    let (one, two) = (run(edited.clone(), 1), run(edited.clone(), 2));
    assert_eq!(one.binding(), two.binding(), "threads");
    assert_eq!(one.binding().count(RowKind::Moved), rows.len(), "rows");
    let shuffled = run(edited.select(&order), 2);
    let (a, b) = (one.at(0.6).unwrap(), shuffled.at(0.6).unwrap());
    for (i, &row) in order.iter().enumerate() {
        let miss = distance(b.means[i], a.means[row].map(f64::from));
        assert!(miss < 1e-5, "row {row} moves differently by {miss} when shuffled");
    }
    assert_eq!(one.at(0.0).unwrap(), edited, "the edit time is the edit");
}

#[test]
fn a_copy_and_splats_added_to_it_move_like_the_original() {
    const NUDGE: f32 = 0.01;
    let scene = scene();
    let source = scene.at(0.0).unwrap();
    let count = source.len();
    let all: Vec<usize> = (0..count).collect();
    let similarity = about(centre(&source, &all), 0.6, [0.96, 0.0, 0.28, 0.0], [4.0, 0.3, -1.0]);
    let copy = similarity.transform(&source);
    let mut edited = source.clone();
    for row in 0..count {
        edited.push_from(&copy, row);
    }
    // A part of the copy was edited further, so these splats are not source splats any more.
    let (changed, coeffs) = (|row: usize| row.is_multiple_of(9), edited.sh_coeffs());
    for row in all.iter().copied().filter(|&row| changed(row)) {
        edited.means[count + row][1] += NUDGE;
        edited.log_scales[count + row][row % 3] += 0.7;
        edited.sh[(count + row) * coeffs] = [1.0, -0.5, 0.2];
    }
    let source_scene: Arc<dyn DynamicScene> = Arc::new(scene.clone());
    let options = MotionOptions::preset(MotionPreset::Regions);
    let found = propagate(source_scene, Arc::new(edited), &options, &|_, _| {}).unwrap();
    assert_eq!(found.report.moved_groups.len(), 1, "one copy: {:?}", found.report.moved_groups);
    let binding = found.scene.binding();
    assert_eq!(binding.groups().len(), 1, "its parts stay together");
    assert_eq!(found.report.near_copies, count.div_ceil(9), "added splats move with it");
    for t in TIMES {
        let (now, moved) = (scene.at(t).unwrap(), found.scene.at(t).unwrap());
        assert_eq!(moved.means[..count], now.means[..], "the original is untouched at {t}");
        let mut added = Vec::new();
        for row in 0..count {
            let expected = similarity.apply(now.means[row].map(f64::from));
            let off = distance(moved.means[count + row], expected);
            if changed(row) {
                added.push(off);
            } else {
                assert!(off < 1e-4, "row {row} at {t}: {off}");
            }
        }
        // The copy was placed next to the original, and keeps that distance.
        let mean = added.iter().sum::<f64>() / added.len() as f64;
        assert!(mean < 1.2 * f64::from(NUDGE), "mean error of added splats at {t}: {mean}");
    }
}

/// A head that swells smoothly, by at most `share`, together with its splats.
fn warped_head(scene: &SynthScene, share: f64) -> (Vec<usize>, Splats) {
    let first = scene.frame1();
    let rows: Vec<usize> = of_parts(scene, &[Part::Head])
        .into_iter()
        .filter(|&i| scene.rows()[i].rigid_bone() == Some(Part::Head.bone()))
        .collect();
    let middle = centre(first, &rows);
    let radius = rows.iter().map(|&i| distance(first.means[i], middle)).fold(0.0, f64::max);
    let mut edited = first.clone();
    for &row in &rows {
        let aside = [0, 1, 2].map(|k| f64::from(first.means[row][k]) - middle[k]);
        let grown = 1.0 + share * 0.5 * (1.0 + (3.0 * aside[1] / radius).sin());
        edited.means[row] = [0, 1, 2].map(|k| (middle[k] + grown * aside[k]) as f32);
        edited.log_scales[row] = first.log_scales[row].map(|s| s + grown.ln() as f32);
    }
    (rows, edited)
}

/// In small patches, a smooth warp is nearly a similarity, but it is not one.
#[test]
fn a_smooth_warp_is_not_split_into_moved_groups() {
    for size in [6000, 24_000] {
        let scene = build(TruthCase::Recolour, 5, size).unwrap().source;
        for share in [0.01, 0.02, 0.05] {
            let (rows, edited) = warped_head(&scene, share);
            let found = map(scene.frame1(), &edited);
            assert!(
                found.moved * 50 <= rows.len(),
                "{size} splats, {share}: {} of {} moved, in {} groups",
                found.moved,
                rows.len(),
                found.similarities.len()
            );
            if size == 6000 {
                let places = edited.means.clone();
                let to = |row: usize, _| places[row].map(f64::from);
                let [ours, knn] = errors(&scene, &rows, &to, edited);
                assert!(ours < knn, "{share}: {ours} against {knn} of KNN-Guide");
            }
        }
    }
    // A group moved next to it is still recognised.
    let scene = scene();
    let (_, mut edited) = warped_head(&scene, 0.02);
    let rows = of_parts(&scene, &[Part::FootL]);
    let similarity = about(centre(&edited, &rows), 1.2, [1.0, 0.1, 0.0, 0.0], [0.1, 0.0, 0.0]);
    edited = placed(&edited, &rows, &similarity);
    let found = map(scene.frame1(), &edited);
    let moved = rows.iter().filter(|&&i| matches!(found.rows[i], Identity::Moved { .. })).count();
    assert_eq!((moved, found.similarities.len()), (rows.len(), 1), "the shoe");
}
