//! The promises of `docs/ARCHITECTURE.md` about splats that an edit leaves in place, for any order,
//! subset, quaternion sign and colour change.
use crate::common::{Table, golden_source};
use amg::{Identity, IdentityMap, IdentityParams, MotionOptions, propagate};
use gs_core::{DynamicScene, Splats};
use proptest::prelude::*;
use std::sync::Arc;

const NUM: usize = 300;

/// Part of the golden figure, with opacities and colours that change over time.
fn source() -> Table {
    let rows: Vec<usize> = (0..NUM).map(|i| i * 5).collect();
    let mut table = golden_source().0;
    for (t, frame) in (0_u8..).zip(&mut table.frames) {
        *frame = frame.select(&rows);
        for (i, (logit, sh)) in frame.opacity_logits.iter_mut().zip(&mut frame.sh).enumerate() {
            *logit += f32::from(t) * if i % 2 == 0 { 0.3 } else { -0.7 };
            *sh = [i as f32 * 1e-3, f32::from(t) * 0.1, 0.5];
        }
    }
    table
}

/// Bits of the centre, the log-scales and the rotation of a splat.
fn geometry(splats: &Splats, row: usize) -> Vec<u32> {
    let (mean, scale) = (splats.means[row], splats.log_scales[row]);
    [&mean[..], &scale, &splats.quats[row]].concat().into_iter().map(f32::to_bits).collect()
}

/// Bits of the opacity and of the colour of a splat.
fn appearance(splats: &Splats, row: usize) -> Vec<u32> {
    let logit = splats.opacity_logits[row];
    splats.sh[row].into_iter().chain([logit]).map(f32::to_bits).collect()
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 24,
        rng_seed: proptest::test_runner::RngSeed::Fixed(11),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn rows_left_in_place_are_recognised_and_keep_every_bit(
        mut order in Just((0..NUM).collect::<Vec<_>>()).prop_shuffle(),
        num_kept in 1..=NUM,
        flipped in prop::collection::vec(any::<bool>(), NUM),
        recolored in prop::collection::vec(prop::bool::weighted(0.3), NUM),
        change in prop::array::uniform3(0.05_f32..0.5),
    ) {
        order.truncate(num_kept);
        let source = source();
        let mut edited = source.frames[0].select(&order);
        for (row, &id) in order.iter().enumerate() {
            if flipped[id] {
                edited.quats[row] = edited.quats[row].map(|c| -c);
            }
            if recolored[id] {
                (0..3).for_each(|k| edited.sh[row][k] += change[k]);
            }
        }

        let found = IdentityMap::of(&source.frames[0], &edited, &IdentityParams::default()).unwrap();
        for (row, &id) in order.iter().enumerate() {
            let id32 = u32::try_from(id).unwrap();
            let expected =
                if recolored[id] { Identity::Recolored(id32) } else { Identity::Unchanged(id32) };
            prop_assert_eq!(found.rows[row], expected, "row {}", row);
        }

        let options = MotionOptions::default();
        let scene: Arc<dyn DynamicScene> = Arc::new(source.clone());
        let found = propagate(scene, Arc::new(edited.clone()), &options, &|_, _| {}).unwrap().scene;
        let first = found.at(0.0).unwrap();
        for row in 0..num_kept {
            prop_assert_eq!(geometry(&first, row), geometry(&edited, row), "edited frame, {}", row);
            prop_assert_eq!(appearance(&first, row), appearance(&edited, row), "edited, {}", row);
        }
        for t in [0.4, 1.0] {
            let (ours, theirs) = (found.at(t).unwrap(), source.at(t).unwrap());
            for (row, &id) in order.iter().enumerate() {
                prop_assert_eq!(geometry(&ours, row), geometry(&theirs, id), "row {} at {}", row, t);
                if !recolored[id] {
                    prop_assert_eq!(appearance(&ours, row), appearance(&theirs, id), "row {}", row);
                }
            }
        }
    }
}

/// One unit in the last place of any value is noticed.
#[test]
fn a_change_of_one_bit_is_detected() {
    let frame = source().frames[0].clone();
    let changes: [fn(&mut Splats); 5] = [
        |splats| splats.means[3][1] = splats.means[3][1].next_up(),
        |splats| splats.log_scales[3][2] = splats.log_scales[3][2].next_down(),
        |splats| splats.quats[3][0] = splats.quats[3][0].next_up(),
        |splats| splats.opacity_logits[3] = splats.opacity_logits[3].next_up(),
        |splats| splats.sh[3][0] = splats.sh[3][0].next_down(),
    ];
    for (i, change) in changes.into_iter().enumerate() {
        let mut other = frame.clone();
        change(&mut other);
        let is_same = [
            geometry(&other, 3) == geometry(&frame, 3),
            appearance(&other, 3) == appearance(&frame, 3),
        ];
        assert_eq!(is_same, [i > 2, i < 3], "change {i}");
    }
}
