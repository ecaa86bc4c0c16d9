//! Edited splats that are source splats are found by value, for any order, signs and rounding.
use crate::common::golden_source;
use amg::{Identity, IdentityMap, IdentityParams};
use gs_core::{Precision, RowPrecision, Splats, quat};
use std::sync::Arc;

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
    assert!(found.removed.is_empty(), "{what}: nothing removed");
}

#[test]
fn side_effects_of_editors_are_tolerated() {
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
fn small_edits_are_distinguished_from_rounding() {
    let source = source();
    let mut edited = source.clone();
    edited.sh[0][1] += 0.01;
    edited.opacity_logits[1] -= 0.5;
    edited.means[2][0] += 0.001;
    edited.log_scales[3][1] += 0.01;
    edited.quats[4] = gs_core::quat::mul([0.999, 0.04, 0.0, 0.0], edited.quats[4]);
    let found = map(&source, &edited);
    assert_eq!(found.rows[..2], [Identity::Recolored(0), Identity::Recolored(1)], "appearance");
    assert!(found.rows[2..5].iter().all(|r| *r == Identity::Edited), "{:?}", &found.rows[..5]);
    assert_eq!((found.unchanged, found.recolored, found.edited), (195, 2, 3), "counts");
    assert_eq!(found.removed, [2, 3, 4], "their sources are not found");
}

#[test]
fn coincident_splats_are_paired_one_to_one_and_by_colour() {
    let mut source = source().select(&[0, 0, 0, 1]);
    for (i, sh) in (0_u8..).zip(&mut source.sh) {
        *sh = [f32::from(i); 3];
    }
    let edited = source.select(&[2, 0, 1, 3]);
    let found = map(&source, &edited);
    let expected = [2, 0, 1, 3].map(Identity::Unchanged);
    assert_eq!(found.rows, expected, "each matches its own source");

    let twins = source.select(&[0, 0, 0]);
    let found = map(&twins, &twins);
    assert_eq!(found.rows, [0, 1, 2].map(Identity::Unchanged), "true duplicates pair in order");
    let found = map(&twins, &twins.select(&[0, 0, 0, 0, 0]));
    assert_eq!(found.unchanged, 5, "surplus copies are still that splat");
    assert!(found.removed.is_empty(), "{found:?}");
}

#[test]
fn ten_thousand_coincident_splats_take_linear_time() {
    let one = source().select(&vec![0; 10_000]);
    assert_eq!(map(&one, &one).unchanged, 10_000, "all paired");
}

#[test]
fn disabled_identity_and_invalid_input() {
    let source = source();
    let off = IdentityParams { enabled: false, ..IdentityParams::default() };
    let found = IdentityMap::of(&source, &source, &off).unwrap();
    assert_eq!((found.edited, found.removed.len()), (200, 200), "everything counts as edited");

    let mut edited = source.clone();
    edited.means[0][0] = f32::NAN;
    edited.log_scales[1] = [f32::NEG_INFINITY; 3];
    edited.quats[2] = [0.0; 4];
    assert_eq!(map(&source, &edited).edited, 3, "no match, no panic");
    edited.sh.pop();
    let error = IdentityMap::of(&source, &edited, &off).unwrap_err().to_string();
    assert!(error.contains("edited splats are malformed"), "{error}");
}

/// Rounding of a format with 8-bit colours and positions on a grid.
fn coarse(source: &Splats) -> (Splats, RowPrecision) {
    let grid = |v: f32, step: f32| (v / step).round() * step;
    let mut stored = source.with_sh_degree(0);
    for i in 0..stored.len() {
        stored.means[i] = stored.means[i].map(|v| grid(v, 2e-3));
        stored.log_scales[i] = stored.log_scales[i].map(|v| grid(v, 0.0625).max(-5.0));
        stored.quats[i] = quat::normalize(stored.quats[i]).map(|v| grid(v, 1.0 / 128.0));
        stored.opacity_logits[i] =
            gs_core::activation::logit(grid(source.opacity(i), 1.0 / 255.0).clamp(0.001, 0.999));
        stored.sh[i] = stored.sh[i].map(|v| grid(v, 0.02).clamp(-1.0, 1.0));
    }
    let precision = RowPrecision {
        means: [1e-3; 3],
        rotation_rad: 0.0156,
        log_scales: [0.032; 3],
        log_scale_range: [-5.0, f32::INFINITY],
        opacity: 2e-3,
        sh_dc: [0.01; 3],
        sh_dc_range: [-1.0, 1.0],
        sh_rest: [f32::INFINITY; 3],
        ..RowPrecision::EXACT
    };
    (stored, precision)
}

#[test]
fn rounding_of_the_file_format_is_not_an_edit() {
    let source = source().with_sh_degree(1);
    let (stored, precision) = coarse(&source);
    let order: Vec<usize> = (0..200).map(|i| (i * 77 + 13) % 200).collect();
    let mut edited = stored.select(&order);
    let params = IdentityParams {
        precision: Some(Arc::new(Precision::uniform(precision))),
        ..IdentityParams::default()
    };
    let found = IdentityMap::of(&source, &edited, &params).unwrap();
    for (row, &id) in order.iter().enumerate() {
        assert_eq!(found.rows[row], Identity::Unchanged(id as u32), "row {row}");
    }
    // Negative control: without the precision, no splat is recognised as unchanged.
    let strict = IdentityMap::of(&source, &edited, &IdentityParams::default()).unwrap();
    assert!(strict.unchanged < 20, "{} are unchanged by value", strict.unchanged);

    // Real edits are detected: a colour, a shift larger than the grid, a rotation.
    edited.sh[0][0] = source.sh_of(order[0])[0][0].clamp(-1.0, 0.9) + 0.05;
    edited.means[1][2] += 5e-3;
    edited.quats[2] = quat::mul(edited.quats[2], [0.995, 0.0998, 0.0, 0.0]);
    let found = IdentityMap::of(&source, &edited, &params).unwrap();
    assert_eq!(found.rows[0], Identity::Recolored(order[0] as u32), "colour");
    assert_eq!((found.rows[1], found.rows[2]), (Identity::Edited, Identity::Edited), "geometry");

    let restored = found.restore(&source, &edited.with_sh_degree(1));
    assert_eq!(restored.means[0], source.means[order[0]], "recoloured: geometry is the source's");
    assert_eq!(restored.sh_of(0)[0], edited.sh[0], "recoloured: colour is the edit's");
    assert_eq!(restored.means[1], edited.means[1], "edited: as given");
    assert_eq!(restored.select(&[9]), source.select(&[order[9]]), "unchanged: all bits");
}
