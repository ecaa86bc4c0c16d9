//! Edits and their truth: unedited splats are bit-identical, edited ones move with the right parts.

use glam::Vec3;
use gs_core::{DynamicScene, Splats};
use gs_synth::{
    DemoParams, Edit, EditedFrame, Graft, Kind, Paint, Part, Region, SynthError, SynthScene, Tag,
    TruthCase, apply_edits, build, demo, demo_edits,
};

const TIMES: [f32; 4] = [0.0, 0.3, 0.55, 1.0];

fn scene() -> SynthScene {
    let params = DemoParams {
        num_splats: 5_000,
        trajectory_noise: 0.001,
        floaters: 0.02,
        ..DemoParams::default()
    };
    demo(&params).expect("valid")
}

fn edit(scene: &SynthScene, edits: &[Edit]) -> EditedFrame {
    apply_edits(scene, edits, 3).expect("valid edits")
}

fn rows_with(edited: &EditedFrame, tag: Tag) -> Vec<usize> {
    (0..edited.splats.len()).filter(|&i| edited.truth.tags[i] == tag).collect()
}

fn check_whole(edited: &EditedFrame) {
    let truth = &edited.truth;
    let count = edited.splats.len();
    edited.splats.check_shapes().expect("shapes");
    for found in [
        truth.parts.len(),
        truth.tags.len(),
        truth.source_rows.len(),
        truth.eval_mask.len(),
        truth.contact_mask.len(),
        truth.num_splats(),
    ] {
        assert_eq!(found, count, "one entry per splat");
    }
    assert_eq!(truth.at(0.0).expect("t = 0"), edited.splats, "frame 1, bit for bit");
    for t in TIMES {
        let splats = truth.at(t).expect("in range");
        assert!((0..count).all(|i| splats.is_finite(i)), "finite at {t}");
        assert_eq!(splats.sh, edited.splats.sh, "colours do not change");
    }
}

fn same_geometry(a: &Splats, i: usize, b: &Splats, j: usize) -> bool {
    a.means[i] == b.means[j] && a.quats[i] == b.quats[j] && a.log_scales[i] == b.log_scales[j]
}

#[test]
fn demo_edit_is_complete_and_uses_every_tool() {
    let scene = scene();
    let edited = edit(&scene, &demo_edits());
    check_whole(&edited);
    for tag in [Tag::Unchanged, Tag::Recoloured, Tag::Clothing, Tag::Hat] {
        assert!(!rows_with(&edited, tag).is_empty(), "{tag:?}");
    }
    let balls = |splats: &[Part]| splats.iter().filter(|&&part| part == Part::Ball).count();
    let before: Vec<Part> = scene.rows().iter().map(|row| row.part).collect();
    assert!(balls(&edited.truth.parts) < balls(&before), "a ball is removed");
    assert!(edited.truth.contact_mask.iter().any(|&mark| mark), "contact exists");
    let again = edit(&scene, &demo_edits());
    assert_eq!(again.splats, edited.splats, "deterministic");
    assert_eq!(again.truth.contact_mask, edited.truth.contact_mask, "deterministic flags");
}

#[test]
fn unedited_splats_move_like_the_noise_free_source() {
    let scene = scene();
    let edited = edit(&scene, &demo_edits());
    let clean = scene.noise_free();
    for t in TIMES {
        let (ours, theirs) = (edited.truth.at(t).unwrap(), clean.at(t).unwrap());
        for tag in [Tag::Unchanged, Tag::Recoloured] {
            for i in rows_with(&edited, tag) {
                let parent = edited.truth.source_rows[i].unwrap() as usize;
                assert!(same_geometry(&ours, i, &theirs, parent), "{tag:?} row {i} at {t}");
            }
        }
    }
    for i in rows_with(&edited, Tag::Unchanged) {
        let parent = edited.truth.source_rows[i].unwrap() as usize;
        assert_eq!(edited.splats.sh_of(i), scene.frame1().sh_of(parent), "colour of row {i}");
    }
}

#[test]
fn recolouring_changes_colours_only() {
    let scene = scene();
    for paint in [Paint::Solid([1.0, 0.0, 0.0]), Paint::Tint([0.2, 0.8, 0.3]), Paint::Hue(2.0)] {
        let edited =
            edit(&scene, &[Edit::Recolour { region: Region::parts(&[Part::Chest]), paint }]);
        assert_eq!(edited.splats.means, scene.frame1().means, "places");
        let changed = (0..scene.num_splats())
            .filter(|&i| edited.splats.sh_of(i) != scene.frame1().sh_of(i))
            .all(|i| edited.truth.parts[i] == Part::Chest);
        assert!(changed, "{paint:?} is limited to its region");
        assert_ne!(edited.splats.sh, scene.frame1().sh, "{paint:?} changes colours");
    }
}

#[test]
fn clothing_has_the_requested_offset_and_number_of_copies() {
    let scene = scene();
    let region = Region::parts(&[Part::ThighL]);
    let [low, high] = [0.02, 0.05];
    let edited = edit(
        &scene,
        &[Edit::Clothing { region, offset: [low, high], copies: 1.5, jitter: 0.0, paint: None }],
    );
    check_whole(&edited);
    let worn = rows_with(&edited, Tag::Clothing);
    let is_original =
        |row: &gs_synth::SplatTruth| row.part == Part::ThighL && row.kind == Kind::Surface;
    let originals = scene.rows().iter().filter(|row| is_original(row)).count();
    let ratio = worn.len() as f32 / originals as f32;
    assert!((1.3..1.7).contains(&ratio), "copies: {ratio}");
    let size = scene.figure_size();
    for &i in worn.iter().filter(|&&i| i < scene.num_splats()) {
        let normal = Vec3::from(scene.rows()[i].normal);
        let out = (Vec3::from(edited.splats.means[i]) - Vec3::from(scene.frame1().means[i]))
            .dot(normal)
            / size;
        assert!((low - 1e-4..=high + 1e-4).contains(&out), "row {i}: {out}");
    }
}

#[test]
fn pruning_and_splitting_give_the_requested_shares() {
    let scene = scene();
    let region = Region::moving();
    let before = scene.rows().iter().filter(|row| region.parts.contains(&row.part)).count() as f32;
    let edited = edit(&scene, &[Edit::PruneSplit { region, prune: 0.3, split: 0.5 }]);
    check_whole(&edited);
    let after = edited.truth.parts.iter().filter(|part| Region::moving().parts.contains(part));
    let ratio = after.count() as f32 / before;
    assert!((ratio - 0.7 * 1.5).abs() < 0.06, "left and split: {ratio}");
    for i in rows_with(&edited, Tag::SplitChild) {
        let parent = edited.truth.source_rows[i].unwrap() as usize;
        let gap = Vec3::from(edited.splats.means[i]).distance(scene.frame1().means[parent].into());
        let reach = scene.frame1().scale(parent).into_iter().fold(0.0, f32::max);
        assert!(gap <= reach, "child {i} is near its parent");
    }
}

#[test]
fn grafts_move_with_their_bones() {
    let scene = scene();
    let grafts = [
        (Graft::Hat, Tag::Hat, Part::Head),
        (Graft::Horns, Tag::Horns, Part::Head),
        (Graft::Wings, Tag::Wings, Part::Chest),
        (Graft::Block, Tag::Block, Part::Chest),
        (Graft::Stick, Tag::Stick, Part::ForearmR),
        (Graft::Halo, Tag::Halo, Part::Head),
    ];
    for (graft, tag, carrier) in grafts {
        let edited = edit(&scene, &[Edit::Graft(graft)]);
        check_whole(&edited);
        let added = rows_with(&edited, tag);
        assert_eq!(edited.splats.len(), scene.num_splats() + added.len(), "only additions");
        assert!(added.iter().all(|&i| edited.truth.source_rows[i].is_none()), "no lineage");
        let anchor = (0..scene.num_splats())
            .rfind(|&i| scene.rows()[i].rigid_bone() == Some(carrier.bone()))
            .unwrap();
        for t in TIMES {
            let splats = edited.truth.at(t).unwrap();
            let gap = |splats: &Splats, i: usize| {
                Vec3::from(splats.means[i]).distance(Vec3::from(splats.means[anchor]))
            };
            for &i in &added {
                let ratio = gap(&splats, i) / gap(&edited.splats, i);
                // the chest breathes by 1.8 %
                assert!((ratio - 1.0).abs() < 0.02, "{graft:?} row {i} at {t}: {ratio}");
                if carrier == Part::Head {
                    assert!((ratio - 1.0).abs() < 1e-4, "{graft:?} row {i} at {t}: {ratio}");
                }
            }
        }
    }
}

#[test]
fn boxes_replace_their_parts() {
    let scene = scene();
    let edited = edit(&scene, &[Edit::Blocky { parts: vec![Part::ForearmR, Part::Head] }]);
    check_whole(&edited);
    let boxes = rows_with(&edited, Tag::Box);
    let forearm = edited.truth.parts.iter().zip(&edited.truth.tags);
    let old = forearm.filter(|&(&part, &tag)| part == Part::ForearmR && tag != Tag::Box).count();
    assert_eq!(old, 0, "no splat of the forearm remains");
    assert!(boxes.len() > 100, "boxes have splats: {}", boxes.len());
}

#[test]
fn removal_is_limited_to_the_ball_and_shuffling_keeps_the_lineage() {
    let scene = scene();
    let center = [0.80, 0.15, 0.50];
    let region = Region::parts(&[Part::Ball]).within(center, 0.3);
    let edited = edit(&scene, &[Edit::Remove { region }, Edit::Shuffle]);
    check_whole(&edited);
    assert!(edited.truth.parts.contains(&Part::Ball), "other balls remain");
    let ordered = edited.truth.source_rows.windows(2).all(|pair| pair[0] < pair[1]);
    assert!(!ordered, "rows are permuted");
    for (i, parent) in edited.truth.source_rows.iter().enumerate() {
        let parent = parent.unwrap() as usize;
        assert!(same_geometry(&edited.splats, i, scene.frame1(), parent), "row {i}");
    }
}

#[test]
fn drift_moves_splats_slightly() {
    let scene = scene();
    let position = 0.002;
    let region = Region::parts(&[Part::Head]);
    let edited = edit(&scene, &[Edit::Drift { region, position, angle_rad: 0.1, log_scale: 0.05 }]);
    check_whole(&edited);
    let drifted = rows_with(&edited, Tag::Drifted);
    let mean = drifted
        .iter()
        .map(|&i| Vec3::from(edited.splats.means[i]).distance(scene.frame1().means[i].into()))
        .sum::<f32>()
        / drifted.len() as f32;
    let unit = position * scene.figure_size();
    assert!((1.2..2.0).contains(&(mean / unit)), "mean of a 3D normal is 1.6 σ: {}", mean / unit);
}

#[test]
fn floaters_are_not_scored_and_contact_is_near_moving_parts() {
    let scene = scene();
    let edited = edit(&scene, &demo_edits());
    for (i, row) in edited.truth.rows().iter().enumerate() {
        let is_floater = row.kind == Kind::Floater;
        assert_eq!(edited.truth.eval_mask[i], !is_floater, "row {i}");
        if edited.truth.contact_mask[i] {
            assert!(edited.truth.eval_mask[i], "contact is scored");
            assert_ne!(row.part, Part::Backdrop, "the backdrop touches nothing");
        }
    }
    let count = edited.truth.contact_mask.iter().filter(|&&mark| mark).count();
    assert!(count * 3 < edited.splats.len(), "contact is limited to a zone: {count}");
}

#[test]
fn invalid_edits_are_refused() {
    let cloth = build(TruthCase::StretchingCloth, 0, 500).unwrap().source;
    let hat = apply_edits(&cloth, &[Edit::Graft(Graft::Hat)], 0);
    assert!(matches!(hat, Err(SynthError::NoFigure { .. })), "no head");
    let blocky = apply_edits(&cloth, &[Edit::Blocky { parts: vec![Part::Head] }], 0);
    assert!(matches!(blocky, Err(SynthError::NoFigure { .. })), "no limbs");
    let prune = Edit::PruneSplit { region: Region::moving(), prune: 1.5, split: 0.0 };
    assert!(matches!(apply_edits(&cloth, &[prune], 0), Err(SynthError::Param { .. })), "150 %");
}
