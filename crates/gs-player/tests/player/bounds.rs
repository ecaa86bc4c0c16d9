//! Every splat of both scenes is decoded at every frame within the error bounds of the options.

use crate::decoder::{Payload, decode};
use gs_core::{DynamicScene, Splats, quat, rotation_matrix, sh};
use gs_player::{EncodeOptions, encode};
use gs_synth::{DemoParams, apply_edits, demo, demo_edits};

/// Whether row `(geometry, appearance)` of the payload is splat `i` at every frame. Steps: half one in
/// the first frame, the tolerance later.
fn is(
    payload: &Payload,
    (geometry, appearance): (usize, usize),
    truth: &[Splats],
    i: usize,
    tolerance: f64,
) -> bool {
    let gets = |name: &str, row: usize, frame: usize| payload.attributes[name].value(row, frame);
    truth.iter().enumerate().all(|(frame, splats)| {
        let steps = if frame == 0 { 0.5 } else { tolerance } + 1e-4;
        let near = |name: &str, row: usize, expected: &[f64]| {
            let bound = steps * payload.attributes[name].step;
            gets(name, row, frame).iter().zip(expected).all(|(a, b)| (a - b).abs() <= bound)
        };
        let place = [0, 1, 2].map(|k| f64::from(splats.means[i][k]) - payload.origin[k]);
        let opacity = gs_core::activation::sigmoid(f64::from(splats.opacity_logits[i]));
        let color = splats.sh_of(i)[0].map(|dc| 0.5 + f64::from(sh::C0) * f64::from(dc));
        let rest: Vec<f64> = splats.sh_of(i)[1..].iter().flatten().map(|&v| f64::from(v)).collect();
        near("position", geometry, &place)
            && near("opacity", appearance, &[opacity])
            && near("color", appearance, &color)
            && (payload.sh_degree == 0 || near("shading", appearance, &rest))
            && {
                // The same ellipsoid with permuted axes.
                let found = gets("rotation", geometry, frame);
                let found =
                    rotation_matrix(quat::normalize([found[0], found[1], found[2], found[3]]));
                let expected = rotation_matrix(quat::normalize(splats.quats[i].map(f64::from)));
                let sizes = gets("scale", geometry, frame);
                let angle = 4.0 * (tolerance + 0.6) * payload.attributes["rotation"].step;
                (0..3).all(|column| {
                    let along = |axis: usize| {
                        (0..3).map(|k| expected[k][axis] * found[k][column]).sum::<f64>().abs()
                    };
                    let axis = (0..3).max_by(|&a, &b| along(a).total_cmp(&along(b))).unwrap();
                    let size = f64::from(splats.log_scales[i][axis]);
                    (0..3).all(|other| other == axis || along(other) <= angle)
                        && (sizes[column] - size).abs() <= steps * payload.attributes["scale"].step
                })
            }
    })
}

/// Splats of `truth` without a matching row in the payload.
fn missing(payload: &Payload, second: bool, truth: &[Splats], tolerance: f64) -> usize {
    let mut rows = payload.rows(second);
    // Sorted by one coordinate, so that few pairs are compared.
    let x = |row: &(usize, usize)| {
        payload.attributes["position"].value(row.0, 0)[0] + payload.origin[0]
    };
    rows.sort_by(|p, q| x(p).total_cmp(&x(q)));
    let mut used = vec![false; rows.len()];
    let step = payload.attributes["position"].step;
    (0..truth[0].len())
        .filter(|&i| {
            let place = f64::from(truth[0].means[i][0]);
            let start = rows.partition_point(|row| x(row) < place - step);
            let found = (start..rows.len())
                .take_while(|&at| x(&rows[at]) <= place + step)
                .find(|&at| !used[at] && is(payload, rows[at], truth, i, tolerance));
            found.inspect(|&at| used[at] = true).is_none()
        })
        .count()
}

#[test]
fn both_scenes_are_decoded_within_the_bounds() {
    let original = demo(&DemoParams { num_splats: 1_500, ..DemoParams::default() }).unwrap();
    let edited = apply_edits(&original, &demo_edits(), 3).unwrap().truth;
    let times = original.time_range().frames(13);
    let all =
        |scene: &dyn DynamicScene| times.iter().map(|&t| scene.at(t).unwrap()).collect::<Vec<_>>();
    let (first, second) = (all(&original), all(&edited));
    for options in [
        EncodeOptions::default(),
        EncodeOptions { sh_degree: 3, tolerance: 3.0, ..EncodeOptions::default() },
    ] {
        let encoded = encode(&original, Some(&edited), &times, &options, &mut |_, _| {}).unwrap();
        let payload = decode(&encoded.payload);
        let [a, same_motion, shared, b] = payload.groups;
        assert_eq!(a + same_motion + shared, original.num_splats(), "the first scene");
        assert_eq!(same_motion + shared + b, edited.num_splats(), "the second scene");
        assert!(
            shared > 500 && same_motion > 50,
            "equal rows are stored once: {:?}",
            payload.groups
        );
        for (name, attribute) in &payload.attributes {
            assert_eq!(
                attribute.table == "appearance",
                ["opacity", "color", "shading"].contains(&name.as_str()),
                "{name}"
            );
        }
        assert_eq!(
            missing(&payload, false, &first, options.tolerance),
            0,
            "splats of the first scene"
        );
        assert_eq!(
            missing(&payload, true, &second, options.tolerance),
            0,
            "splats of the second scene"
        );
        // Negative control: the same comparison fails with the wrong frames.
        let mut wrong = first.clone();
        wrong[6] = first[7].clone();
        assert!(
            missing(&payload, false, &wrong, options.tolerance) > 300,
            "other frames are detected"
        );
    }
}

#[test]
fn coarser_steps_make_smaller_payloads() {
    let scene = demo(&DemoParams { num_splats: 1_500, ..DemoParams::default() }).unwrap();
    let times = scene.time_range().frames(13);
    let size = |options: EncodeOptions| {
        encode(&scene, None, &times, &options, &mut |_, _| {}).unwrap().payload.len()
    };
    let coarse = size(EncodeOptions {
        sh_degree: 0,
        position_steps: 2048.0,
        rotation_step: 1.0 / 128.0,
        ..EncodeOptions::default()
    });
    let fine =
        size(EncodeOptions { sh_degree: 3, position_steps: 65_536.0, ..EncodeOptions::default() });
    assert!(3 * coarse < 2 * fine, "{coarse} bytes against {fine}");
}
