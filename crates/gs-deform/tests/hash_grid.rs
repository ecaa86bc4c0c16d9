//! Full-size hash grids, filled by a formula, reproduce the vectors of `fixtures/swift4d` under
//! both index rules: every lattice index, every encoding and every head output.

#![allow(clippy::unwrap_used, reason = "shared functions of tests fail by panicking, as tests do")]

use gs_core::{DynamicScene, Splats};
use gs_deform::{
    Component, FieldBox, FieldError, GridShape, HashGrid, HashGridField, HashGridNetwork,
    HashGridScene, IndexRule, Linear, Trace,
};
use test_support::compare::{assert_close, max_abs_diff, widen};
use test_support::fixture;
use test_support::golden::Golden;

const RULES: [(IndexRule, &str); 2] =
    [(IndexRule::Current, "current"), (IndexRule::Older, "older")];
const WIDTH: usize = 128;

fn unsigned(value: i64) -> u32 {
    u32::try_from(value).unwrap()
}

#[test]
fn lattice_indices_of_both_rules() {
    let golden = Golden::open(fixture("swift4d/grid_index_vectors.safetensors"));
    let column = |name: &str| golden.i64s(name);
    let (log2_table, base, level) = (column("log2_table"), column("base"), column("level"));
    let (res, size, corner) = (column("res"), column("size"), column("corner"));
    let mut apart = 0;
    for i in 0..level.len() {
        let index = usize::try_from(level[i]).unwrap();
        let shape = GridShape {
            levels: index + 1,
            features: 4,
            log2_table: unsigned(log2_table[i]),
            base: unsigned(base[i]),
        };
        shape.check().unwrap();
        let q = std::array::from_fn(|d| unsigned(corner[4 * i + d]));
        let found = RULES.map(|(rule, name)| {
            let level = &shape.levels(rule)[index];
            let of_level = (level.resolution, level.size);
            assert_eq!(of_level, (unsigned(res[i]), unsigned(size[i])), "layout, vector {i}");
            let found = level.index(q);
            let expected = golden.i64s(&format!("index_{name}"))[i];
            assert_eq!(i64::from(found), expected, "{name} rule, vector {i}: {shape:?}, {q:?}");
            found
        });
        apart += usize::from(found[0] != found[1]);
    }
    assert!(apart > 40, "the rules differ on {apart} of {} vectors", level.len());
}

/// The formula of the fixture's README, rounded to half precision as in the reference.
fn value(i: u32, seed: u32, amplitude: f64) -> f32 {
    let mut x = i.wrapping_mul(2_654_435_761).wrapping_add(seed);
    x = (x ^ (x >> 16)).wrapping_mul(2_246_822_519);
    x = (x ^ (x >> 13)).wrapping_mul(3_266_489_917);
    x ^= x >> 16;
    let value = (f64::from(x) / 4_294_967_296.0 * 2.0 - 1.0) * amplitude;
    #[expect(clippy::cast_possible_truncation, reason = "rounded to single, then to half")]
    let single = value as f32;
    half::f16::from_f32(single).to_f32()
}

fn values(first: usize, count: usize, seed: u32, amplitude: f64) -> Vec<f32> {
    (first..first + count).map(|i| value(u32::try_from(i).unwrap(), seed, amplitude)).collect()
}

fn layer(first: usize, inputs: usize, outputs: usize, seed: u32) -> Linear {
    Linear { weight: values(first, inputs * outputs, seed, 0.2), bias: vec![0.0; outputs] }
}

fn field(grid: HashGrid, trunk_relu: bool) -> HashGridField {
    let square = WIDTH * WIDTH;
    let inputs = grid.shape().num_features();
    let mut seed = 2;
    let heads = Component::ALL.map(|component| {
        seed += 1;
        [
            layer(0, WIDTH, WIDTH, seed),
            layer(square, WIDTH, WIDTH, seed),
            layer(2 * square, WIDTH, component.num_outputs(), seed),
        ]
    });
    HashGridField::new(HashGridNetwork {
        bounds: FieldBox { min: [0.0; 3], max: [1.0; 3] },
        trunk: [layer(0, inputs, WIDTH, 1), layer(WIDTH * inputs, WIDTH, WIDTH, 1)],
        grid,
        trunk_relu,
        heads,
    })
    .unwrap()
}

fn check(golden: &Golden, prefix: &str, trace: &Trace, tolerance: f64) {
    let close = |name: &str, found: &[f32]| {
        let name = format!("{prefix}.{name}");
        assert_close(&name, &widen(found), &golden.f64s(&name), tolerance, 0.0);
    };
    close("encoding", &trace.features);
    close("hidden", &trace.hidden);
    let heads = ["xyz", "scales", "rotations", "opacity", "shs"];
    for (name, values) in heads.into_iter().zip(&trace.heads) {
        close(&format!("{name}_deform"), values.as_ref().unwrap());
    }
}

#[test]
fn full_size_fields_of_both_rules() {
    let golden = Golden::open(fixture("swift4d/procedural_vectors.safetensors"));
    let inputs = golden.f32s("input").as_chunks::<4>().0.to_vec();
    for log2_table in [15, 16, 19] {
        let shape = GridShape { levels: 16, features: 4, log2_table, base: 16 };
        let table = values(0, shape.num_entries() * 4, 2, 0.5);
        let traces = RULES.map(|(rule, name)| {
            let grid = HashGrid::new(shape, rule, table.clone()).unwrap();
            let trace = field(grid, log2_table != 15).trace(&inputs);
            check(&golden, &format!("T{log2_table}.{name}"), &trace, 4e-7);
            trace
        });
        // Negative control: the other rule gives very different features where
        // the rules differ, and equal ones elsewhere.
        let apart = max_abs_diff(&widen(&traces[0].features), &widen(&traces[1].features));
        assert_eq!(apart > 0.05, log2_table > 15, "2^{log2_table} entries: {apart}");
    }
}

/// Two small levels, width 8.
fn small() -> HashGridField {
    let shape = GridShape { levels: 2, features: 2, log2_table: 6, base: 2 };
    let table = values(0, shape.num_entries() * 2, 2, 0.5);
    let grid = HashGrid::new(shape, IndexRule::Current, table).unwrap();
    let layer = |inputs, outputs, seed| layer(0, inputs, outputs, seed);
    HashGridField::new(HashGridNetwork {
        bounds: FieldBox { min: [-1.0; 3], max: [1.0; 3] },
        grid,
        trunk: [layer(4, 8, 1), layer(8, 8, 2)],
        trunk_relu: false,
        heads: Component::ALL.map(|component| {
            [layer(8, 8, 3), layer(8, 8, 4), layer(8, component.num_outputs(), 5)]
        }),
    })
    .unwrap()
}

fn splats(means: &[[f32; 3]]) -> Splats {
    let n = means.len();
    Splats {
        means: means.to_vec(),
        quats: vec![[1.0, 0.0, 0.0, 0.0]; n],
        log_scales: vec![[-3.0; 3]; n],
        opacity_logits: vec![0.5; n],
        sh: vec![[0.1; 3]; n * 16],
        sh_degree: 3,
    }
}

#[test]
fn only_dynamic_splats_in_the_box_move() {
    let inside = [0.1, 0.2, 0.3];
    let beyond = [1.0_f32.next_up() + 1e-6, 0.0, 0.0];
    let canonical = splats(&[inside, inside, beyond, [1.0, -1.0, 1.0], [f32::NAN; 3]]);
    let dynamic = vec![true, false, true, true, true];
    let scene = HashGridScene::new(canonical.clone(), dynamic.clone(), small()).unwrap();
    assert_eq!(scene.moving_rows(), [0, 3], "faces belong to the box, NaN does not");
    assert_eq!(scene.dynamic_mask(), Some(&dynamic[..]), "as declared");
    let now = scene.at(0.3).unwrap();
    for row in [0, 3] {
        assert_ne!(now.means[row], canonical.means[row], "row {row} moves");
        assert_ne!(now.sh_of(row), canonical.sh_of(row), "row {row} changes colour");
    }
    for row in [1, 2] {
        assert_eq!(
            now.select(&[row]),
            canonical.select(&[row]),
            "row {row} is unchanged, bit for \
            bit"
        );
    }
    let mut geometry = Splats::default();
    scene.geometry_into(0.3, &mut geometry).unwrap();
    assert_eq!(geometry.means[..4], now.means[..4], "geometry alone");
    assert!(geometry.sh.is_empty(), "leaves colour");
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(
            pool.install(|| scene.at(0.3).unwrap()).means[..4],
            now.means[..4],
            "{threads} threads"
        );
    }
}

#[test]
fn frame_times_are_those_of_the_training_video() {
    let scene = HashGridScene::new(splats(&[[0.0; 3]]), vec![true], small()).unwrap();
    assert_eq!((scene.time_range().end, scene.num_frames()), (1.0, None), "unknown");
    assert!(scene.clone().with_frames(0, 300).is_err(), "none");
    assert!(scene.clone().with_frames(302, 300).is_err(), "beyond time 1");
    assert!(scene.clone().with_frames(usize::MAX, 0).is_err(), "no divisor");
    let framed = scene.with_frames(300, 300).unwrap();
    assert_eq!(framed.num_frames(), Some(300), "frames");
    for (i, t) in (0_u16..).zip(framed.time_range().frames(300)) {
        assert!((f64::from(t) - f64::from(i) / 300.0).abs() < 1e-7, "frame {i} is at {t}");
    }
    assert!(framed.at(1.0).is_err(), "never trained");
    let mut out = Splats::default();
    assert!(framed.deform_into(1.0, &mut out).is_ok(), "but defined");
    assert!(framed.deform_into(f32::NAN, &mut out).is_err(), "NaN");
}

#[test]
fn inconsistent_parts_are_refused() {
    let mask = HashGridScene::new(splats(&[[0.0; 3]]), vec![true; 2], small()).unwrap_err();
    assert!(mask.to_string().contains("dynamic"), "{mask}");
    let plain = splats(&[[0.0; 3]]).with_sh_degree(1);
    let degree = HashGridScene::new(plain, vec![true], small()).unwrap_err();
    assert!(degree.to_string().contains("degree 1"), "{degree}");
    for max in [[1.0, 1.0, -1.0], [1.0, f32::INFINITY, 1.0], [1.0, f32::NAN, 1.0]] {
        let bounds = FieldBox { min: [-1.0; 3], max };
        assert!(matches!(bounds.check(), Err(FieldError::Box { .. })), "{max:?}");
    }
}
