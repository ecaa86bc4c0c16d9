//! The fused kernels agree with a double-precision implementation of the field's definition, for
//! random networks of many shapes and all flags; finite input gives finite output.

use gs_core::{DynamicScene, Real, Splats, quat};
use gs_deform::{
    Component, EmptyVoxel, Head, Heads, HexPlane, HexPlaneField, HexPlaneNetwork, HexPlaneScene,
    Linear, Mask, PLANE_AXES, Plane,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use test_support::compare::assert_close;

fn values(rng: &mut Pcg64, count: usize) -> Vec<f32> {
    (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
}

fn linear(rng: &mut Pcg64, inputs: usize, outputs: usize) -> Linear {
    let bound = (6.0 / (inputs + outputs) as f32).sqrt();
    let weight = values(rng, inputs * outputs).into_iter().map(|v| v * bound).collect();
    Linear { weight, bias: values(rng, outputs) }
}

fn head(rng: &mut Pcg64, width: usize, outputs: usize) -> Head {
    Head { hidden: linear(rng, width, width), out: linear(rng, width, outputs) }
}

#[derive(Debug, Clone, Copy)]
struct Case {
    width: usize,
    depth: usize,
    channels: usize,
    levels: usize,
    heads: [bool; 5],
    /// 0 none, 1 static MLP, 2 voxel.
    mask: usize,
    grid_pe: u32,
    apply_rotation: bool,
}

fn network(case: &Case, rng: &mut Pcg64) -> HexPlaneNetwork {
    let mut levels = Vec::new();
    for level in 0..case.levels {
        levels.push(PLANE_AXES.map(|(first, second)| {
            let resolution = |axis: usize| if axis == 3 { 5 } else { (3 + axis) << level };
            let (columns, rows) = (resolution(first), resolution(second));
            Plane { columns, rows, texels: values(rng, rows * columns * case.channels) }
        }));
    }
    let aabb = [[1.2, 1.0, 0.8], [-1.0, -1.1, -1.3]];
    let planes = HexPlane { aabb, channels: case.channels, levels };
    let inputs = planes.num_features() * if case.grid_pe > 0 { 3 } else { 1 };
    let trunk = (0..case.depth)
        .map(|layer| linear(rng, if layer == 0 { inputs } else { case.width }, case.width))
        .collect();
    let mut optional = |component: Component| {
        case.heads[component as usize].then(|| head(rng, case.width, component.num_outputs()))
    };
    let heads = Heads {
        means: optional(Component::Means),
        log_scales: optional(Component::LogScales),
        quats: optional(Component::Quats),
        opacity_logits: optional(Component::OpacityLogits),
        sh: optional(Component::Sh),
    };
    let mask = match case.mask {
        0 => Mask::One,
        1 => Mask::StaticMlp(head(rng, case.width, 1)),
        _ => Mask::EmptyVoxel(EmptyVoxel {
            grid: values(rng, 64),
            resolution: 4,
            xyz_min: [-0.9; 3],
            xyz_max: [1.1; 3],
        }),
    };
    let (grid_pe, apply_rotation) = (case.grid_pe, case.apply_rotation);
    HexPlaneNetwork { planes, trunk, heads, mask, grid_pe, apply_rotation }
}

fn canonical(rng: &mut Pcg64, n: usize) -> Splats {
    fn rows<const D: usize>(rng: &mut Pcg64, n: usize) -> Vec<[f32; D]> {
        (0..n).map(|_| std::array::from_fn(|_| rng.random_range(-1.5..1.5))).collect()
    }
    Splats {
        means: rows(rng, n),
        quats: rows(rng, n),
        log_scales: rows(rng, n),
        opacity_logits: rows::<1>(rng, n).into_flattened(),
        sh: rows(rng, 16 * n),
        sh_degree: 3,
    }
}

fn apply(layer: &Linear, input: &[f64]) -> Vec<f64> {
    (0..layer.num_outputs())
        .map(|o| {
            let row = &layer.weight[o * input.len()..(o + 1) * input.len()];
            let sum: f64 = row.iter().zip(input).map(|(&w, x)| f64::from(w) * x).sum();
            sum + f64::from(layer.bias[o])
        })
        .collect()
}

fn relu(values: &[f64]) -> Vec<f64> {
    values.iter().map(|v| v.max(0.0)).collect()
}

fn run(head: &Head, hidden: &[f64]) -> Vec<f64> {
    apply(&head.out, &relu(&apply(&head.hidden, &relu(hidden))))
}

/// Position on an axis, clamped, and its fraction.
fn tap(u: f64, resolution: usize) -> (usize, usize, f64) {
    let last = resolution - 1;
    let position = ((u + 1.0) * 0.5 * last as f64).clamp(0.0, last as f64);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the axis"
    )]
    let low = position as usize;
    (low, (low + 1).min(last), position - low as f64)
}

/// One Gaussian by the definition of the field, in double precision.
fn by_definition(network: &HexPlaneNetwork, splats: &Splats<f64>, i: usize, t: f64) -> Splats<f64> {
    let planes = &network.planes;
    let mut u = [t; 4];
    for axis in 0..3 {
        let (a0, a1) = (f64::from(planes.aabb[0][axis]), f64::from(planes.aabb[1][axis]));
        u[axis] = (splats.means[i][axis] - a0) * (2.0 / (a1 - a0)) - 1.0;
    }
    let mut features = Vec::new();
    for level in &planes.levels {
        for c in 0..planes.channels {
            let mut product = 1.0;
            for (plane, (first, second)) in level.iter().zip(PLANE_AXES) {
                let (i0, i1, fi) = tap(u[first], plane.columns);
                let (j0, j1, fj) = tap(u[second], plane.rows);
                let texel = |j: usize, i: usize| {
                    f64::from(plane.texels[(j * plane.columns + i) * planes.channels + c])
                };
                product *= (1.0 - fj) * ((1.0 - fi) * texel(j0, i0) + fi * texel(j0, i1))
                    + fj * ((1.0 - fi) * texel(j1, i0) + fi * texel(j1, i1));
            }
            features.push(product);
        }
    }
    if network.grid_pe > 0 {
        let k = f64::from(network.grid_pe);
        let sines: Vec<f64> = features.iter().map(|g| (k * g).sin()).collect();
        let cosines: Vec<f64> = features.iter().map(|g| (k * g).cos()).collect();
        features = [features, sines, cosines].concat();
    }
    let mut hidden = apply(&network.trunk[0], &features);
    for layer in &network.trunk[1..] {
        hidden = apply(layer, &relu(&hidden));
    }
    let m = match &network.mask {
        Mask::One => 1.0,
        Mask::StaticMlp(head) => run(head, &hidden)[0],
        Mask::EmptyVoxel(voxel) => f64::from(voxel.at(splats.means[i].map(Real::as_f32))),
    };
    let mut out = splats.select(&[i]);
    let heads = &network.heads;
    let masked = |row: &mut [f64; 3], head: &Head| {
        let delta = run(head, &hidden);
        for k in 0..3 {
            row[k] = row[k] * m + delta[k];
        }
    };
    if let Some(head) = &heads.means {
        masked(&mut out.means[0], head);
    }
    if let Some(head) = &heads.log_scales {
        masked(&mut out.log_scales[0], head);
    }
    if let Some(head) = &heads.quats {
        let delta: [f64; 4] = run(head, &hidden).try_into().expect("four outputs");
        let q = out.quats[0];
        out.quats[0] = if network.apply_rotation {
            quat::normalize(quat::mul(q, delta))
        } else {
            std::array::from_fn(|k| q[k] + delta[k])
        };
    }
    if let Some(head) = &heads.opacity_logits {
        out.opacity_logits[0] = out.opacity_logits[0] * m + run(head, &hidden)[0];
    }
    if let Some(head) = &heads.sh {
        let delta = run(head, &hidden);
        for (k, row) in out.sh.iter_mut().enumerate() {
            for channel in 0..3 {
                row[channel] = row[channel] * m + delta[3 * k + channel];
            }
        }
    }
    out
}

fn flatten<F: Real>(splats: &Splats<F>) -> Vec<f64> {
    let rows = splats.means.as_flattened().iter().chain(splats.log_scales.as_flattened());
    let rows = rows.chain(splats.quats.as_flattened()).chain(&splats.opacity_logits);
    rows.chain(splats.sh.as_flattened()).map(|value| value.as_f64()).collect()
}

const ALL: [bool; 5] = [true; 5];

const CASES: [Case; 6] = [
    Case {
        width: 64,
        depth: 1,
        channels: 32,
        levels: 2,
        heads: [true, true, true, false, false],
        mask: 0,
        grid_pe: 0,
        apply_rotation: false,
    },
    Case {
        width: 128,
        depth: 1,
        channels: 16,
        levels: 2,
        heads: ALL,
        mask: 0,
        grid_pe: 0,
        apply_rotation: false,
    },
    Case {
        width: 20,
        depth: 3,
        channels: 5,
        levels: 1,
        heads: ALL,
        mask: 1,
        grid_pe: 3,
        apply_rotation: true,
    },
    Case {
        width: 16,
        depth: 2,
        channels: 4,
        levels: 4,
        heads: ALL,
        mask: 2,
        grid_pe: 0,
        apply_rotation: false,
    },
    Case {
        width: 9,
        depth: 1,
        channels: 1,
        levels: 3,
        heads: [false, true, false, true, false],
        mask: 1,
        grid_pe: 0,
        apply_rotation: false,
    },
    Case {
        width: 8,
        depth: 1,
        channels: 16,
        levels: 1,
        heads: [false; 5],
        mask: 2,
        grid_pe: 2,
        apply_rotation: false,
    },
];

#[test]
fn agrees_with_the_definition() {
    for (seed, case) in CASES.iter().enumerate() {
        let mut rng = Pcg64::seed_from_u64(seed as u64);
        let network = network(case, &mut rng);
        // One more than two panels: a last panel with a single Gaussian.
        let splats = canonical(&mut rng, 97);
        let field = HexPlaneField::new(network.clone()).unwrap();
        let scene = HexPlaneScene::new(splats.clone(), field).unwrap();
        let wide: Splats<f64> = splats.cast();
        for t in [0.0, 0.31, 1.0] {
            let out = scene.at(t).unwrap();
            for i in 0..splats.len() {
                let expected = by_definition(&network, &wide, i, f64::from(t));
                let what = format!("case {seed}, Gaussian {i}, time {t}");
                assert_close(&what, &flatten(&out.select(&[i])), &flatten(&expected), 2e-5, 1e-5);
            }
        }
    }
}

#[test]
fn output_memory_is_reused_for_any_previous_content() {
    let mut rng = Pcg64::seed_from_u64(9);
    let field = HexPlaneField::new(network(&CASES[1], &mut rng)).unwrap();
    let small = HexPlaneScene::new(canonical(&mut rng, 50), field.clone()).unwrap();
    let large = HexPlaneScene::new(canonical(&mut rng, 200), field).unwrap();
    let mut out = large.at(0.2).unwrap();
    small.at_into(0.7, &mut out).unwrap();
    assert_eq!(out, small.at(0.7).unwrap(), "shrinks");
    large.at_into(0.7, &mut out).unwrap();
    assert_eq!(out, large.at(0.7).unwrap(), "grows");
}

#[test]
fn concurrent_evaluations_of_a_new_scene_agree() {
    let mut rng = Pcg64::seed_from_u64(14);
    let field = HexPlaneField::new(network(&CASES[0], &mut rng)).unwrap();
    let splats = canonical(&mut rng, 5000);
    let times: Vec<f32> = (0..32_u8).map(|i| f32::from(i) / 31.0).collect();
    let scene = HexPlaneScene::new(splats, field).unwrap();
    let at_once: Vec<Splats> = times.par_iter().map(|&t| scene.at(t).unwrap()).collect();
    for (t, splats) in times.into_iter().zip(at_once) {
        assert_eq!(splats, scene.at(t).unwrap(), "time {t}");
    }
}

#[test]
fn static_rows_keep_their_stored_values() {
    let mut rng = Pcg64::seed_from_u64(12);
    let field = HexPlaneField::new(network(&CASES[1], &mut rng)).unwrap();
    let splats = canonical(&mut rng, 5);
    let free = HexPlaneScene::new(splats.clone(), field.clone()).unwrap().at(0.4).unwrap();
    let scene = HexPlaneScene::new(splats.clone(), field.clone()).unwrap();
    let held = scene.with_moving(&[true, false, true, true, false]).unwrap();
    let out = held.at(0.4).unwrap();
    assert_eq!(out.select(&[1, 4]), splats.select(&[1, 4]), "still");
    assert_eq!(out.select(&[0, 2, 3]), free.select(&[0, 2, 3]), "moving");
    let scene = HexPlaneScene::new(splats, field).unwrap();
    assert!(scene.with_moving(&[true]).is_err(), "one entry per Gaussian");
}

#[test]
fn invalid_rows_do_not_affect_other_rows() {
    let mut rng = Pcg64::seed_from_u64(10);
    let field = HexPlaneField::new(network(&CASES[3], &mut rng)).unwrap();
    let empty = HexPlaneScene::new(canonical(&mut rng, 0), field.clone()).unwrap();
    assert!(empty.at(0.5).unwrap().is_empty(), "no Gaussians");
    let mut splats = canonical(&mut rng, 3);
    splats.means[1] = [f32::NAN, f32::INFINITY, 1e30];
    let scene = HexPlaneScene::new(splats.clone(), field.clone()).unwrap();
    let out = scene.at(0.5).unwrap();
    assert!(out.is_finite(0) && out.is_finite(2), "an invalid row does not affect other rows");
    assert!(scene.at(f32::NAN).is_err() && scene.at(-0.1).is_err(), "times outside");
    assert!(field.deform_into(&splats, f32::NAN, &mut Splats::default()).is_err(), "no time");
    splats.quats.pop();
    assert!(HexPlaneScene::new(splats, field.clone()).is_err(), "shapes");
    let flat = canonical(&mut rng, 3).with_sh_degree(1);
    let error = HexPlaneScene::new(flat, field).unwrap_err().to_string();
    assert!(error.contains("degree 3") && error.contains("degree 1"), "{error}");
}
