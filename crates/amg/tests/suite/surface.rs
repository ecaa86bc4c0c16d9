//! Edits that apply to surfaces: inheritance by splats that the edit frame does not show.
use amg::{EditedScene, Follow, MotionOptions, Propagation, RowKind, propagate};
use gs_core::{DynamicScene, Splats, TimeRange};
use gs_synth::{
    DemoParams, ShortLivedCase, ShortLivedParams, ShortLivedScene, ShortLivedTruthScene,
    build_short_lived,
};
use std::sync::Arc;

fn scene(case: ShortLivedCase) -> ShortLivedTruthScene {
    build_short_lived(
        case,
        &ShortLivedParams { num_splats: 4_000, seed: 3, ..ShortLivedParams::default() },
    )
    .unwrap()
}

fn propagated_case(scene: &ShortLivedTruthScene, follow: Follow) -> Propagation {
    let options = MotionOptions::default().with_follow(follow);
    let (source, edited) = (Arc::new(scene.source.clone()), Arc::new(scene.edited.clone()));
    propagate(source, edited, &options, &|_, _| {}).unwrap()
}

/// Source splats that are clearly visible at some time.
fn ever_visible(scene: &ShortLivedTruthScene) -> Vec<bool> {
    let mut visible = vec![false; scene.source.num_splats()];
    for t in TimeRange::UNIT.frames(31) {
        let now = scene.source.at(t).unwrap();
        visible.iter_mut().enumerate().for_each(|(row, seen)| *seen |= now.opacity(row) > 0.1);
    }
    visible
}

/// For each source splat, the edited row that equals it.
fn row_of(scene: &EditedScene) -> Vec<Option<usize>> {
    let mut rows = vec![None; scene.binding().num_sources()];
    for row in 0..scene.binding().len() {
        if let [id] = scene.binding().row(row).0 {
            rows[*id as usize] = Some(row);
        }
    }
    rows
}

/// Share of the edited surface that `is_edited` misses, and share of wrongly edited splats.
fn missed_and_wrong(scene: &ShortLivedTruthScene, is_edited: impl Fn(usize) -> bool) -> (f64, f64) {
    let visible = ever_visible(scene);
    let count = |of: &dyn Fn(usize) -> bool| {
        (0..visible.len()).filter(|&id| visible[id] && of(id)).count() as f64
    };
    let all = count(&|id| scene.touched[id]);
    let missed = count(&|id| scene.touched[id] && !is_edited(id));
    (missed / all, count(&|id| !scene.touched[id] && is_edited(id)) / all)
}

#[test]
fn only_descendants_inherit_deletions() {
    let scene = scene(ShortLivedCase::Delete);
    let gone = |follow| {
        let found = propagated_case(&scene, follow).scene;
        let rows = row_of(&found);
        let late: Vec<Splats> =
            TimeRange::UNIT.frames(31)[1..].iter().map(|&t| found.at(t).unwrap()).collect();
        let hidden = |id: usize| {
            rows[id].is_none_or(|row| late.iter().all(|splats| splats.opacity(row) < 1e-3))
        };
        missed_and_wrong(&scene, hidden)
    };
    let (missed, wrong) = gone(Follow::Surface);
    assert!(missed < 0.03 && wrong < 0.06, "missed {missed:.3}, wrong {wrong:.3}");
    // Negative control: with `Follow::Splats`, the forearm reappears.
    let (missed, _) = gone(Follow::Splats);
    assert!(missed > 0.4, "missed {missed:.3}");
}

#[test]
fn descendants_inherit_the_change_of_colour() {
    let scene = scene(ShortLivedCase::Recolour);
    let found = propagated_case(&scene, Follow::Surface).scene;
    let rows = row_of(&found);
    let visible = ever_visible(&scene);
    let (before, truth) = (scene.source.at(0.6).unwrap(), scene.truth.at(0.6).unwrap());
    let now = found.at(0.6).unwrap();
    let rgb = |splats: &Splats, row: usize| splats.sh_of(row)[0].map(|c| 0.5 + 0.282_094_8 * c);
    let apart =
        |a: [f32; 3], b: [f32; 3]| (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0_f32, f32::max);
    let (mut off, mut unedited, mut flat, mut count) = (0.0, 0.0, 0.0, 0.0);
    let touched: Vec<usize> =
        (0..visible.len()).filter(|&id| visible[id] && scene.touched[id]).collect();
    let mean =
        |k: usize| touched.iter().map(|&id| rgb(&truth, id)[k]).sum::<f32>() / touched.len() as f32;
    let coat = [mean(0), mean(1), mean(2)];
    for &id in &touched {
        let expected = rgb(&truth, id);
        off += apart(rgb(&now, rows[id].unwrap()), expected);
        unedited += apart(rgb(&before, id), expected);
        flat += apart(coat, expected);
        count += 1.0;
    }
    let [off, unedited, flat] = [off, unedited, flat].map(|sum: f32| sum / count);
    assert!(off < 0.02, "off by {off:.4}");
    // Negative controls: the old colours, and a uniform colour.
    assert!(unedited > 0.2 && flat > 2.0 * off, "unedited {unedited:.4}, flat {flat:.4}");
}

#[test]
fn rows_without_edited_ancestors_are_bit_exact() {
    for case in [ShortLivedCase::Recolour, ShortLivedCase::Delete, ShortLivedCase::Scale] {
        let scene = scene(case);
        let found = propagated_case(&scene, Follow::Surface);
        let counts = found.report.inheritance.unwrap();
        assert!(counts.shown < counts.visible && counts.with_ancestors > 0, "{counts:?}");
        let scene_4d = &found.scene;
        let at_edit = scene_4d.at(0.0).unwrap();
        assert_eq!(at_edit, scene.edited, "{case}: the edited frame");
        let mut exact = 0;
        for t in [0.2, 0.55, 1.0] {
            let (now, source) = (scene_4d.at(t).unwrap(), scene.source.at(t).unwrap());
            for (row, kind) in scene_4d.binding().kinds().iter().enumerate() {
                if *kind != RowKind::Unchanged {
                    continue;
                }
                let id = scene_4d.binding().row(row).0[0] as usize;
                assert_eq!(now.select(&[row]), source.select(&[id]), "{case}: row {row} at {t}");
                exact += 1;
            }
        }
        assert!(exact > 3 * 2_500, "{case}: {exact} rows");
    }
}

#[test]
fn grafts_on_a_static_surface_neither_move_nor_fade() {
    let scene = scene(ShortLivedCase::Hat);
    let new: Vec<usize> =
        (0..scene.truth.num_splats()).filter(|&row| scene.truth.new_rows()[row]).collect();
    let worst = |follow| {
        let found = propagated_case(&scene, follow).scene;
        let (mut off, mut opacity) = (0.0_f32, 1.0_f32);
        for t in TimeRange::UNIT.frames(41) {
            let (now, truth) = (found.at(t).unwrap(), scene.truth.at(t).unwrap());
            for &row in &new {
                let apart: f32 =
                    (0..3).map(|k| (now.means[row][k] - truth.means[row][k]).powi(2)).sum();
                off = off.max(apart.sqrt() / scene.source.figure_size());
                opacity = opacity.min(now.opacity(row) / truth.opacity(row));
            }
        }
        (off, opacity)
    };
    let (off, opacity) = worst(Follow::Surface);
    assert!(off < 3e-3 && opacity > 0.98, "every splat, at all times: {off:.5}, {opacity:.3}");
    // Negative control: with the splats of frame 1 it drifts and fades.
    let (off, opacity) = worst(Follow::Splats);
    assert!(off > 0.01 && opacity < 0.5, "{off:.5}, {opacity:.3}");
}

#[test]
fn motion_is_continuous_between_generations() {
    let scene = scene(ShortLivedCase::Hat);
    let found = propagated_case(&scene, Follow::Surface).scene;
    let times = TimeRange::UNIT.frames(401);
    let row = scene.truth.new_rows().iter().position(|new| *new).unwrap();
    let at = |t: f32| found.at(t).unwrap().means[row];
    let track: Vec<[f32; 3]> = times.iter().map(|&t| at(t)).collect();
    let truth: Vec<[f32; 3]> =
        times.iter().map(|&t| scene.truth.at(t).unwrap().means[row]).collect();
    let largest_step = |track: &[[f32; 3]]| {
        track
            .windows(2)
            .map(|pair| (0..3).map(|k| (pair[1][k] - pair[0][k]).powi(2)).sum::<f32>().sqrt())
            .fold(0.0_f32, f32::max)
    };
    let (ours, theirs) = (largest_step(&track), largest_step(&truth));
    assert!(ours < 1.5 * theirs, "{ours} {theirs}");
}

#[test]
fn descendants_inherit_scaling() {
    let scene = scene(ShortLivedCase::Scale);
    let found = propagated_case(&scene, Follow::Surface).scene;
    let rows = row_of(&found);
    let size = scene.source.figure_size();
    let (mut off, mut before_off, mut count) = (0.0_f32, 0.0_f32, 0);
    for t in [0.3, 0.6, 0.9] {
        let (now, truth) = (found.at(t).unwrap(), scene.truth.at(t).unwrap());
        let before = scene.source.at(t).unwrap();
        for id in (0..rows.len()).filter(|&id| scene.touched[id]) {
            let Some(row) = rows[id].filter(|_| before.opacity(id) > 0.2) else { continue };
            let apart = |a: [f32; 3], b: [f32; 3]| {
                (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>().sqrt() / size
            };
            off += apart(now.means[row], truth.means[id]);
            before_off += apart(before.means[id], truth.means[id]);
            count += 1;
        }
    }
    let count = count as f32;
    assert!(off / count < 0.25 * before_off / count, "{off} {before_off} {count}");
}

#[test]
fn surface_results_are_bit_identical_for_any_number_of_threads() {
    let scene = scene(ShortLivedCase::Hat);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let found = propagated_case(&scene, Follow::Surface).scene;
            (found.binding().as_ref().clone(), found.at(0.7).unwrap())
        })
    };
    let one = with(1);
    for threads in [2, 7] {
        assert!(with(threads) == one, "{threads} threads: bit for bit");
    }
}

#[test]
fn following_surfaces_changes_nothing_if_all_splats_are_persistent() {
    let source =
        gs_synth::demo(&DemoParams { num_splats: 2_000, ..DemoParams::default() }).unwrap();
    let edit = gs_synth::apply_edits(&source, &gs_synth::demo_edits(), 0).unwrap();
    let run = |follow| {
        let options = MotionOptions::default().with_follow(follow);
        let (source, edited) = (Arc::new(source.clone()), Arc::new(edit.splats.clone()));
        propagate(source, edited, &options, &|_, _| {}).unwrap()
    };
    let plain = run(Follow::default());
    assert_eq!(plain.scene.binding().surface(), None, "the default has no surface");
    assert_eq!(plain.report.inheritance, None, "nor does the report");
    // If requested, it changes nothing that the edit frame shows.
    let asked = run(Follow::Surface);
    assert_eq!(asked.scene.binding().kinds(), plain.scene.binding().kinds(), "kinds of rows");
    let inherited = asked.scene.binding().surface().unwrap().inherited.len();
    assert_eq!(inherited, 0, "all splats are shown: nothing descends");
}

/// The edit frame with shifted copies of the splats `ids`, as an editor adds them.
fn with_copies(source: &ShortLivedScene, ids: &[usize], shift: [f32; 3]) -> Splats {
    let mut edited = source.at(0.0).unwrap();
    let mut copies = edited.select(ids);
    for mean in &mut copies.means {
        *mean = [0, 1, 2].map(|k| mean[k] + shift[k]);
    }
    (0..ids.len()).for_each(|i| edited.push_from(&copies, i));
    edited
}

fn propagated(source: &ShortLivedScene, edited: &Splats, follow: Follow) -> Propagation {
    let options = MotionOptions::default().with_follow(follow);
    let (source, edited) = (Arc::new(source.clone()), Arc::new(edited.clone()));
    propagate(source, edited, &options, &|_, _| {}).unwrap()
}

/// The dancer's splats that are visible at frame 1, and a shift that places a copy next to it.
fn dancer() -> (ShortLivedScene, Vec<usize>, [f32; 3]) {
    let params = ShortLivedParams { num_splats: 4_000, seed: 3, ..ShortLivedParams::default() };
    let source = ShortLivedScene::figure(&params).unwrap();
    let first = source.at(0.0).unwrap();
    let shown = (0..first.len()).filter(|&id| first.opacity(id) > 0.1).collect();
    let shift = [1.3 * source.figure_size(), 0.0, 0.0];
    (source, shown, shift)
}

#[test]
fn copies_of_the_edit_frame_are_persistent() {
    let (source, shown, shift) = dancer();
    let edited = with_copies(&source, &shown, shift);
    let first = source.num_splats();
    let worst = |follow| {
        let found = propagated(&source, &edited, follow).scene;
        assert_eq!(found.at(0.0).unwrap(), edited, "the edited frame");
        let (mut means, mut opacity) = (Vec::new(), 1.0_f32);
        for t in TimeRange::UNIT.frames(21) {
            let (now, truth) = (found.at(t).unwrap(), source.lasting().at(t).unwrap());
            let off = |(i, &id): (usize, &usize)| {
                let apart = |k| now.means[first + i][k] - truth.means[id][k] - shift[k];
                (0..3).map(|k| apart(k).powi(2)).sum::<f32>().sqrt() / source.figure_size()
            };
            let sum: f32 = shown.iter().enumerate().map(off).sum();
            means.push(sum / shown.len() as f32);
            let kept = (0..shown.len()).map(|i| now.opacity(first + i) / edited.opacity(first + i));
            opacity = opacity.min(kept.fold(f32::INFINITY, f32::min));
        }
        // Linear motion deviates from the surface, which is not an error of the copy; this is the
        // deviation at the edit time.
        let worst = means.iter().copied().fold(0.0, f32::max);
        (means[0], worst, opacity)
    };
    let (at_edit, off, opacity) = worst(Follow::Surface);
    assert!(off < at_edit + 2e-3, "off by {off:.5}, in the edit frame by {at_edit:.5}");
    assert!(opacity > 0.5, "opacity {opacity:.3}");
    // Negative control: exact copies fade with their originals.
    let (at_edit, off, opacity) = worst(Follow::Splats);
    assert!(off > at_edit + 0.02 && opacity < 1e-3, "{at_edit} {off} {opacity}");
}

#[test]
fn complete_copies_of_all_generations_are_exact() {
    let (source, _, shift) = dancer();
    let all: Vec<usize> = (0..source.num_splats()).collect();
    let edited = with_copies(&source, &all, shift);
    let found = propagated(&source, &edited, Follow::Surface).scene;
    assert_eq!(found.binding().count(RowKind::Copied), 0, "all generations are present");
    for t in [0.3, 1.0] {
        let (now, truth) = (found.at(t).unwrap(), source.at(t).unwrap());
        for id in 0..all.len() {
            let off = (now.opacity(all.len() + id) - truth.opacity(id)).abs();
            assert!(off < 1e-5, "{id} at {t}: {off}");
        }
    }
}

#[test]
fn partial_copies_of_later_generations_are_hidden() {
    let (source, mut chosen, shift) = dancer();
    let shown = chosen.len();
    // A box around the dancer also contains a few splats of other times.
    let hidden: Vec<usize> = (0..source.num_splats()).filter(|id| !chosen.contains(id)).collect();
    chosen.extend(hidden.iter().step_by(5));
    let found = propagated(&source, &with_copies(&source, &chosen, shift), Follow::Surface).scene;
    let mut most = 0.0_f32;
    for t in [0.25, 0.5, 0.75, 1.0] {
        let now = found.at(t).unwrap();
        let later = source.num_splats() + shown..now.len();
        let visible = later.clone().filter(|&row| now.opacity(row) > 0.02).count();
        most = most.max(visible as f32 / later.len() as f32);
    }
    assert!(
        most < 0.05,
        "{most:.3} of the later splats are visible in addition to those that last"
    );
}

#[test]
fn coincident_clones_do_not_change_the_opacity_of_descendants() {
    let (source, shown, _) = dancer();
    let clones = with_copies(&source, &shown, [0.0; 3]);
    // Densification keeps a clone's values, or halves the opacities of both.
    let mut halved = clones.clone();
    let in_pairs = shown.iter().copied().chain(source.num_splats()..clones.len());
    for row in in_pairs {
        halved.opacity_logits[row] = gs_core::activation::logit(0.5 * clones.opacity(row));
    }
    for (name, edited, smallest) in [("as they were", clones, 0.9999), ("halved", halved, 0.7)] {
        let swapped: Vec<usize> = (0..edited.len()).rev().collect();
        for edited in [edited.select(&swapped), edited] {
            let found = propagated(&source, &edited, Follow::Surface).scene;
            assert_eq!(found.binding().count(RowKind::Copied), 0, "{name}: none lasts");
            let (now, before) = (found.at(0.6).unwrap(), source.at(0.6).unwrap());
            let rows = row_of(&found);
            let later = (0..before.len()).filter(|id| !shown.contains(id));
            let (mut ours, mut theirs) = (0.0, 0.0);
            for id in later {
                ours += now.opacity(rows[id].unwrap());
                theirs += before.opacity(id);
            }
            let share = ours / theirs;
            assert!((smallest..=1.0).contains(&share), "{name}: {share}");
        }
    }
}
