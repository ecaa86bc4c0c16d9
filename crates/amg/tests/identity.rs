//! Which edited splats are source splats: by value, whatever editors do to order, signs and rounding.
#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "helpers of tests may fail loudly; sizes and lengths are small"
)]

mod common;

use amg::{Identity, IdentityMap, IdentityParams};
use common::golden_source;
use gs_core::Splats;

fn source() -> Splats {
    let mut splats = golden_source().0.frames.swap_remove(0).select(&(0..200).collect::<Vec<_>>());
    splats.sh = (0..200_u16).map(|i| [f32::from(i) * 0.01, 0.2, -0.3]).collect();
    splats
}

fn map(source: &Splats, edited: &Splats) -> IdentityMap {
    IdentityMap::of(source, edited, &IdentityParams::default()).unwrap()
}

fn all_unchanged(source: &Splats, edited: &Splats, what: &str) {
    let found = map(source, edited);
    for (row, id) in (0_u32..).enumerate().take(edited.len()) {
        assert_eq!(found.rows[row], Identity::Unchanged(id), "{what}: row {row}");
    }
    assert!(found.vanished.is_empty(), "{what}: nothing vanished");
}

#[test]
fn what_editors_do_without_meaning_to() {
    let source = source();
    all_unchanged(&source, &source, "untouched");

    let mut edited = source.clone();
    for q in &mut edited.quats {
        *q = q.map(|c| -2.5 * c);
    }
    all_unchanged(&source, &edited, "quaternion sign and norm");

    let mut edited = source.clone();
    let text = |v: f32| format!("{v:.6e}").parse::<f32>().unwrap();
    edited.means.iter_mut().for_each(|m| *m = m.map(text));
    edited.quats.iter_mut().for_each(|q| *q = q.map(text));
    edited.log_scales.iter_mut().for_each(|s| *s = s.map(text));
    all_unchanged(&source, &edited, "text with seven digits");

    let mut opaque = source.clone();
    opaque.opacity_logits[7] = 20.0;
    let mut edited = opaque.clone();
    edited.opacity_logits[7] = 9.0;
    all_unchanged(&opaque, &edited, "clamped logit");

    let mut zero = source.clone();
    zero.means[3] = [0.0, -0.0, 0.5];
    let mut edited = zero.clone();
    edited.means[3] = [-0.0, 0.0, 0.5];
    all_unchanged(&zero, &edited, "sign of zero");

    all_unchanged(&source, &source.with_sh_degree(2), "zero-padded harmonics");

    let mut edited = source.clone();
    for (q, s) in edited.quats.iter_mut().zip(&mut edited.log_scales) {
        // A quarter turn about the local x axis, and y and z exchanged: the same ellipsoid.
        let half = std::f32::consts::FRAC_1_SQRT_2;
        *q = gs_core::quat::mul(*q, [half, half, 0.0, 0.0]);
        s.swap(1, 2);
    }
    all_unchanged(&source, &edited, "axes reordered");
}

#[test]
fn shuffled_rows_are_found_by_value() {
    let source = source();
    let order: Vec<usize> = (0..200).map(|i| (i * 77 + 13) % 200).collect();
    let found = map(&source, &source.select(&order));
    for (row, id) in order.into_iter().enumerate() {
        assert_eq!(found.rows[row], Identity::Unchanged(u32::try_from(id).unwrap()), "row {row}");
    }
}

#[test]
fn real_edits_are_not_taken_for_rounding() {
    let source = source();
    let mut edited = source.clone();
    edited.sh[0][1] += 0.01;
    edited.opacity_logits[1] -= 0.5;
    edited.means[2][0] += 0.001;
    edited.log_scales[3][1] += 0.01;
    edited.quats[4] = gs_core::quat::mul([0.999, 0.04, 0.0, 0.0], edited.quats[4]);
    let found = map(&source, &edited);
    assert_eq!(found.rows[..2], [Identity::Recoloured(0), Identity::Recoloured(1)], "appearance");
    assert!(found.rows[2..5].iter().all(|r| *r == Identity::Edited), "{:?}", &found.rows[..5]);
    assert_eq!((found.unchanged, found.recoloured, found.edited), (195, 2, 3), "counts");
    assert_eq!(found.vanished, [2, 3, 4], "their sources vanished");
}

#[test]
fn coincident_splats_are_paired_one_to_one_by_colour_first() {
    let mut source = source().select(&[0, 0, 0, 1]);
    for (i, sh) in (0_u8..).zip(&mut source.sh) {
        *sh = [f32::from(i); 3];
    }
    let edited = source.select(&[2, 0, 1, 3]);
    let found = map(&source, &edited);
    let expected = [2, 0, 1, 3].map(Identity::Unchanged);
    assert_eq!(found.rows, expected, "each finds its own");

    let twins = source.select(&[0, 0, 0]);
    let found = map(&twins, &twins);
    assert_eq!(found.rows, [0, 1, 2].map(Identity::Unchanged), "true duplicates pair in order");
    let found = map(&twins, &twins.select(&[0, 0, 0, 0, 0]));
    assert_eq!(found.unchanged, 5, "surplus copies are still that splat");
    assert!(found.vanished.is_empty(), "{found:?}");
}

#[test]
fn ten_thousand_coincident_splats_take_linear_time() {
    let one = source().select(&vec![0; 10_000]);
    assert_eq!(map(&one, &one).unchanged, 10_000, "all paired");
}

#[test]
fn switched_off_and_hostile_input() {
    let source = source();
    let off = IdentityParams { enabled: false, ..IdentityParams::default() };
    let found = IdentityMap::of(&source, &source, &off).unwrap();
    assert_eq!((found.edited, found.vanished.len()), (200, 200), "everything counts as edited");

    let mut edited = source.clone();
    edited.means[0][0] = f32::NAN;
    edited.log_scales[1] = [f32::NEG_INFINITY; 3];
    edited.quats[2] = [0.0; 4];
    assert_eq!(map(&source, &edited).edited, 3, "no match, no panic");
    edited.sh.pop();
    let error = IdentityMap::of(&source, &edited, &off).unwrap_err().to_string();
    assert!(error.contains("edited splats are malformed"), "{error}");
}
