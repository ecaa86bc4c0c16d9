//! `EditedScene`: values that rows take from their sources, and equality with the edit at the edit
//! frame.
use crate::common::{Table, golden_edit, golden_source};
use RowKind::{Blended, Static, Unchanged};
use amg::{
    Aggregation, Binding, EditedScene, FieldAt, MotionOptions, MotionPreset, RowKind, propagate,
};
use gs_core::{DynamicScene, SceneError, Splats};
use std::sync::Arc;

/// The golden figure, with opacities and colours that change over time.
fn blinking() -> Table {
    let mut table = golden_source().0;
    for (t, frame) in (0_u8..).zip(&mut table.frames) {
        for (i, logit) in frame.opacity_logits.iter_mut().enumerate() {
            *logit += f32::from(t) * if i % 2 == 0 { 0.3 } else { -0.7 };
        }
        for (i, sh) in frame.sh.iter_mut().enumerate() {
            *sh = [i as f32 * 1e-3, f32::from(t) * 0.1, 0.5];
        }
    }
    table
}

#[test]
fn the_edit_frame_is_the_edit_bit_for_bit() {
    let (source, _) = golden_source();
    let edit = golden_edit("all");
    for preset in [MotionPreset::Regions, MotionPreset::Paper, MotionPreset::Knn] {
        let options = MotionOptions::preset(preset);
        let edited = Arc::new(edit.splats.clone());
        let found = propagate(Arc::new(source.clone()), edited, &options, &|_, _| {}).unwrap();
        assert_eq!(found.scene.at(0.0).unwrap(), edit.splats, "{preset:?}");
    }
}

#[test]
fn shuffled_untouched_rows_follow_their_source_bit_for_bit() {
    let source = blinking();
    let order: Vec<usize> = (0..1500).map(|i| (i * 7 + 3) % 1500).collect();
    let edited = source.frames[0].select(&order);
    let found = propagate(
        Arc::new(source.clone()),
        Arc::new(edited),
        &MotionOptions::default(),
        &|_, _| {},
    )
    .unwrap();
    for t in [0.0, 0.4, 1.0] {
        let expected = source.at(t).unwrap().select(&order);
        assert_eq!(found.scene.at(t).unwrap(), expected, "opacity and colour included, at {t}");
    }
}

#[test]
fn recoloured_rows_keep_motion_and_add_the_sources_change() {
    let source = blinking();
    let mut edited = source.frames[0].clone();
    for sh in &mut edited.sh {
        sh[0] += 0.5;
    }
    let found = propagate(
        Arc::new(source.clone()),
        Arc::new(edited),
        &MotionOptions::default(),
        &|_, _| {},
    )
    .unwrap();
    assert_eq!(found.report.recolored, 1500, "all of them");
    let (ours, theirs) = (found.scene.at(0.6).unwrap(), source.at(0.6).unwrap());
    assert_eq!(ours.means, theirs.means, "means, bit for bit");
    assert_eq!(ours.quats, theirs.quats, "rotations, bit for bit");
    for i in 0..1500 {
        assert!((ours.opacity_logits[i] - theirs.opacity_logits[i]).abs() < 1e-5, "logit {i}");
        assert!((ours.sh[i][0] - theirs.sh[i][0] - 0.5).abs() < 1e-5, "colour {i}");
        assert!((ours.sh[i][1] - theirs.sh[i][1]).abs() < 1e-5, "its change {i}");
    }
}

#[test]
fn appearance_of_blended_rows_is_optional() {
    let source = blinking();
    let edit = golden_edit("drift").splats;
    let run = |appearance: bool| {
        let aggregation = Aggregation { appearance, ..Aggregation::default() };
        let options = MotionOptions::default().with_aggregation(aggregation);
        let edited = Arc::new(edit.clone());
        propagate(Arc::new(source.clone()), edited, &options, &|_, _| {}).unwrap().scene
    };
    let (with, without) = (run(true).at(1.0).unwrap(), run(false).at(1.0).unwrap());
    assert_eq!(without.opacity_logits, edit.opacity_logits, "constant");
    assert_eq!(with.means, without.means, "geometry is the same");
    let change = with.sh[0][1] - edit.sh[0][1];
    assert!((change - 0.5).abs() < 1e-4, "every source gained 0.5 green: {change}");
}

#[test]
fn a_stored_binding_gives_the_same_scene() {
    let (source, _) = golden_source();
    let edited = Arc::new(golden_edit("graft").splats);
    let source: Arc<dyn DynamicScene> = Arc::new(source);
    let options = MotionOptions::default();
    let scene =
        propagate(Arc::clone(&source), Arc::clone(&edited), &options, &|_, _| {}).unwrap().scene;
    let b = scene.binding();
    let codes: Vec<u8> = b.kinds().iter().map(|kind| kind.code()).collect();
    let kinds = codes.into_iter().map(|code| RowKind::from_code(code).unwrap()).collect();
    let again = Binding::from_parts(
        b.offsets().to_vec(),
        b.source_ids().to_vec(),
        b.weights().to_vec(),
        kinds,
        b.num_sources(),
    )
    .unwrap();
    assert_eq!(&again, &**b, "round trip");
    let again =
        EditedScene::new(source, edited, 0.0, Arc::new(again), *scene.aggregation()).unwrap();
    assert_eq!(again.at(0.8).unwrap(), scene.at(0.8).unwrap(), "same motion");
    let mut geometry = Splats::default();
    again.geometry_into(0.8, &mut geometry).unwrap();
    assert_eq!(geometry.means, scene.at(0.8).unwrap().means, "geometry alone");
}

#[test]
fn errors_of_invalid_bindings_name_the_row() {
    let build = |offsets: &[u32], ids: &[u32], weights: &[f32], kinds: &[RowKind]| {
        Binding::from_parts(offsets.into(), ids.into(), weights.into(), kinds.into(), 3)
            .map_err(|error| error.to_string())
    };
    assert!(build(&[0, 2, 2], &[0, 2], &[0.5, 0.5], &[Blended, Static]).is_ok(), "well-formed");
    for (result, expected) in [
        (build(&[0, 1], &[3], &[1.0], &[Blended]), "source 3"),
        (build(&[0, 1], &[0], &[0.5], &[Blended]), "sum to 0.5"),
        (build(&[0, 1], &[0], &[f32::NAN], &[Blended]), "sum to NaN"),
        (build(&[0, 2], &[0, 1], &[0.5, 0.5], &[Unchanged]), "row 0 is Unchanged"),
        (build(&[0, 2, 1], &[0, 1], &[0.5, 0.5], &[Blended, Blended]), "last offset"),
        (build(&[0], &[], &[], &[Static]), "expected 2"),
    ] {
        let error = result.unwrap_err();
        assert!(error.contains(expected), "{error}, expected {expected}");
    }
}

#[test]
fn blending_bindings_are_built_from_rows() {
    let made = Binding::blending(&[vec![(0, 1.0), (2, 3.0)], vec![]], 3).unwrap();
    assert_eq!(made.row(0), (&[0, 2][..], &[0.25, 0.75][..]), "normalised");
    assert_eq!(made.kinds(), [Blended, Static]);
    for (row, expected) in [
        (vec![(3, 1.0)], "source 3"),
        (vec![(0, 0.0)], "sum to NaN"),
        (vec![(0, -1.0), (1, 3.0)], "none negative"),
        (vec![(0, f32::INFINITY)], "sum to NaN"),
    ] {
        let error = Binding::blending(&[row], 3).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}, expected {expected}");
    }
}

/// A source that loses a splat halfway.
#[derive(Debug)]
struct Shrinking(Table);

impl DynamicScene for Shrinking {
    fn num_splats(&self) -> usize {
        self.0.num_splats()
    }
    fn sh_degree(&self) -> usize {
        0
    }
    fn time_range(&self) -> gs_core::TimeRange {
        gs_core::TimeRange::UNIT
    }
    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.0.at_into(t, out)?;
        if t > 0.5 {
            out.means.pop();
        }
        Ok(())
    }
}

#[test]
fn a_source_that_loses_rows_is_rejected() {
    let (table, _) = golden_source();
    let edited = Arc::new(table.frames[0].clone());
    let options = MotionOptions::default();
    let result = propagate(Arc::new(Shrinking(table)), edited, &options, &|_, _| {});
    let error = std::error::Error::source(&result.unwrap_err()).unwrap().to_string();
    assert!(error.contains("`means` has 1499 rows, expected 1500"), "{error}");
}

/// All splats move up by `t`; canonical splats lie 5 units below their rendered positions.
#[derive(Debug)]
struct Rising;

impl FieldAt for Rising {
    fn displace_into(&self, rest: &Splats, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        out.clone_from(rest);
        for mean in &mut out.means {
            mean[1] += 5.0 + t;
        }
        Ok(())
    }
}

#[test]
fn the_field_baseline_applies_differences_of_the_field() {
    let (source, _) = golden_source();
    let edited = golden_edit("drift").splats;
    let options = MotionOptions::field(Arc::new(Rising));
    let found =
        propagate(Arc::new(source), Arc::new(edited.clone()), &options, &|_, _| {}).unwrap();
    assert_eq!(found.report.field_rows, edited.len(), "all rows use the field");
    assert_eq!(found.scene.at(0.0).unwrap(), edited, "the edit frame stays");
    let moved = found.scene.at(0.4).unwrap().means[9][1] - edited.means[9][1];
    assert!((moved - 0.4).abs() < 1e-5, "rose by {moved}");
}

#[test]
fn the_dynamic_mask_of_the_scene_is_respected() {
    let (source, _) = golden_source();
    let edited = Arc::new(golden_edit("drift").splats);
    for preset in [MotionPreset::Regions, MotionPreset::Paper, MotionPreset::Knn] {
        let options = MotionOptions::preset(preset);
        let masked = |mask| Arc::new(Table { mask: Some(mask), ..source.clone() });
        let still = masked(vec![false; 1500]);
        let found = propagate(still, Arc::clone(&edited), &options, &|_, _| {}).unwrap();
        assert_eq!(found.report.static_rows, 1500, "{preset:?}");
        assert_eq!(found.scene.at(1.0).unwrap(), *edited, "{preset:?} stays");
        let short = masked(vec![true; 7]);
        let error = propagate(short, Arc::clone(&edited), &options, &|_, _| {}).unwrap_err();
        assert!(error.to_string().contains("7 entries"), "{error}");
    }
}
