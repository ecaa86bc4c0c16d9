//! New geometry attached to a figure stays rigid and moves with the part to which it is attached.
use crate::common::Table;
use amg::{MotionOptions, MotionPreset, propagate};
use gs_core::{DynamicScene, Splats, quat};
use std::sync::Arc;

const FRAMES: usize = 9;

/// Distance between neighbouring splats.
const SPACING: f32 = 0.03;

/// Height of the figure.
const HEIGHT: f32 = 1.4;

/// Discs on the six faces of the box from `low` to `high`, on a slightly irregular grid.
fn cuboid(out: &mut Splats, low: [f32; 3], high: [f32; 3]) {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let count = |a: usize| ((high[a] - low[a]) / SPACING).round().max(1.0) as usize;
        for (i, j, side) in
            (0..count(u)).flat_map(|i| (0..count(v)).flat_map(move |j| [(i, j, low), (i, j, high)]))
        {
            let wobble = |n: usize| 0.25 * ((n * 37 + i * 11 + j * 17) % 13) as f32 / 13.0 - 0.125;
            let at = |a: usize, k: usize| {
                low[a] + (k as f32 + 0.5 + wobble(a)) * (high[a] - low[a]) / count(a) as f32
            };
            let mut mean = [0.0; 3];
            (mean[axis], mean[u], mean[v]) = (side[axis], at(u, i), at(v, j));
            out.means.push(mean);
            // The third axis of the disc is the thin one.
            out.quats
                .push([[half, 0.0, half, 0.0], [half, half, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]][axis]);
            out.log_scales.push([0.012_f32.ln(), 0.012_f32.ln(), 0.002_f32.ln()]);
            out.opacity_logits.push(2.0);
            out.sh.push([0.0; 3]);
        }
    }
}

fn no_splats() -> Splats {
    Splats {
        means: Vec::new(),
        quats: Vec::new(),
        log_scales: Vec::new(),
        opacity_logits: Vec::new(),
        sh: Vec::new(),
        sh_degree: 0,
    }
}

/// Rotates all splats about an axis through `pivot`.
fn rotate(splats: &mut Splats, axis: [f32; 3], angle: f32, pivot: [f32; 3]) {
    let (sin, cos) = (0.5 * angle).sin_cos();
    let q = [cos, sin * axis[0], sin * axis[1], sin * axis[2]];
    for mean in &mut splats.means {
        let turned = quat::rotate(q, [0, 1, 2].map(|a| mean[a] - pivot[a]));
        *mean = [0, 1, 2].map(|a| turned[a] + pivot[a]);
    }
    for rotation in &mut splats.quats {
        *rotation = quat::mul(q, *rotation);
    }
}

fn beat(k: usize) -> f32 {
    (std::f32::consts::TAU * k as f32 / (FRAMES - 1) as f32).sin()
}

/// Motion of the trunk.
fn sway(splats: &mut Splats, k: usize) {
    rotate(splats, [0.0, 0.0, 1.0], 0.3 * beat(k), [0.0; 3]);
    rotate(splats, [0.0, 1.0, 0.0], 0.5 * beat(k), [0.0; 3]);
}

/// Motion of the arm: rotation about its shoulder, then the motion of the trunk.
fn swing(splats: &mut Splats, k: usize) {
    rotate(splats, [1.0, 0.0, 0.0], 0.9 * beat(k), [0.33, 1.35, 0.06]);
    sway(splats, k);
}

/// A trunk that sways, and an arm next to it that also swings about its shoulder.
fn figure() -> Table {
    let frame = |k: usize| {
        let mut splats = no_splats();
        cuboid(&mut splats, [-0.25, 0.0, -0.12], [0.25, HEIGHT, 0.12]);
        let mut arm = no_splats();
        cuboid(&mut arm, [0.27, 0.7, 0.0], [0.39, HEIGHT, 0.12]);
        sway(&mut splats, k);
        swing(&mut arm, k);
        for i in 0..arm.len() {
            splats.push_from(&arm, i);
        }
        splats
    };
    Table::new((0..FRAMES).map(frame).collect())
}

/// Positions of the splats of `graft`, added to `rest`, at every frame.
fn graft_positions(
    source: &Table,
    rest: &Splats,
    graft: &Splats,
    preset: MotionPreset,
) -> impl Iterator<Item = Vec<[f32; 3]>> {
    let mut edited = rest.clone();
    for i in 0..graft.len() {
        edited.push_from(graft, i);
    }
    let options = MotionOptions::preset(preset);
    let found =
        propagate(Arc::new(source.clone()), Arc::new(edited), &options, &|_, _| {}).unwrap();
    let first = rest.len();
    (0..FRAMES).map(move |k| {
        let mut at = found.scene.at(k as f32 / (FRAMES - 1) as f32).unwrap();
        at.means.split_off(first)
    })
}

/// Largest error of splats of `graft` against the motion `truth`, over splats and times, as a share
/// of the figure's height.
fn worst(
    graft_positions: impl Iterator<Item = Vec<[f32; 3]>>,
    graft: &Splats,
    truth: impl Fn(&mut Splats, usize),
    which: impl Fn([f32; 3]) -> bool,
) -> f32 {
    let mut worst = 0.0_f32;
    for (k, means) in graft_positions.enumerate() {
        let mut expected = graft.clone();
        truth(&mut expected, k);
        for (i, mean) in means.iter().enumerate().filter(|(i, _)| which(graft.means[*i])) {
            let d = [0, 1, 2].map(|a| mean[a] - expected.means[i][a]);
            worst = worst.max(d.iter().map(|c| c * c).sum::<f32>().sqrt() / HEIGHT);
        }
    }
    worst
}

/// `splats`, each moved by up to `size` in a pseudo-random direction.
fn shaken(splats: &Splats, size: f32) -> Splats {
    let mut out = splats.clone();
    for (i, mean) in out.means.iter_mut().enumerate() {
        for (a, c) in mean.iter_mut().enumerate() {
            *c += size * (((i * 29 + a * 71) % 101) as f32 / 50.0 - 1.0);
        }
    }
    out
}

/// A block on the front of the trunk; one of its edges touches the arm. Nearest neighbours tear it
/// apart, which is the negative control.
#[test]
fn a_block_attached_to_a_moving_trunk_stays_rigid() {
    let source = figure();
    for depth in [0.10, 0.15, 0.30] {
        let mut block = no_splats();
        cuboid(&mut block, [-0.20, 0.9, 0.13], [0.34, 1.25, 0.13 + depth]);
        for rest in [source.frames[0].clone(), shaken(&source.frames[0], 0.003)] {
            let [knn, best] = [MotionPreset::Knn, MotionPreset::Regions].map(|preset| {
                worst(graft_positions(&source, &rest, &block, preset), &block, sway, |_| true)
            });
            assert!(knn > 0.2, "depth {depth}: {knn}");
            assert!(best < 1e-3, "depth {depth}: {best}");
        }
    }
}

/// A block with similar contact to trunk and arm is a graft of neither: each end moves with the
/// part that it touches.
#[test]
fn a_block_with_two_equal_contacts_bends() {
    let source = figure();
    let rest = &source.frames[0];
    let mut block = no_splats();
    cuboid(&mut block, [0.10, 0.9, 0.13], [0.39, 1.25, 0.28]);
    let ends = [
        worst(graft_positions(&source, rest, &block, MotionPreset::Regions), &block, sway, |x| {
            x[0] < 0.18 && x[2] < 0.14
        }),
        worst(graft_positions(&source, rest, &block, MotionPreset::Regions), &block, swing, |x| {
            x[0] > 0.33 && x[2] < 0.14
        }),
    ];
    assert!(ends[0] < 0.01 && ends[1] < 0.01, "{ends:?}");
}

/// The arm of [`figure`] swings next to a static trunk.
fn swing_alone(splats: &mut Splats, k: usize) {
    rotate(splats, [1.0, 0.0, 0.0], 0.9 * beat(k), [0.33, 1.35, 0.06]);
}

fn still(_: &mut Splats, _: usize) {}

fn standing() -> Table {
    let frame = |k: usize| {
        let mut splats = no_splats();
        cuboid(&mut splats, [-0.25, 0.0, -0.12], [0.25, HEIGHT, 0.12]);
        let mut arm = no_splats();
        cuboid(&mut arm, [0.27, 0.7, 0.0], [0.39, HEIGHT, 0.12]);
        swing_alone(&mut arm, k);
        for i in 0..arm.len() {
            splats.push_from(&arm, i);
        }
        splats
    };
    Table::new((0..FRAMES).map(frame).collect())
}

/// Grafts on static parts stay static.
#[test]
fn a_block_attached_to_a_static_trunk_is_static() {
    let source = standing();
    for depth in [0.04, 0.10, 0.30] {
        let mut block = no_splats();
        cuboid(&mut block, [-0.20, 0.9, 0.13], [0.34, 1.25, 0.13 + depth]);
        for rest in [source.frames[0].clone(), shaken(&source.frames[0], 0.003)] {
            let [knn, best] = [MotionPreset::Knn, MotionPreset::Regions].map(|preset| {
                worst(graft_positions(&source, &rest, &block, preset), &block, still, |_| true)
            });
            assert!(knn > 0.2, "depth {depth}: {knn}");
            assert!(best < 1e-3, "depth {depth}: {best}");
        }
    }
}

/// A stick thinner than any limb, held at the end of the arm; its other half is next to the trunk.
#[test]
fn a_stick_moves_with_the_hand() {
    for (name, source, truth) in [
        ("swaying", figure(), swing as fn(&mut Splats, usize)),
        ("standing", standing(), swing_alone as fn(&mut Splats, usize)),
    ] {
        for (low, high) in
            [([0.31, 0.3, 0.125], [0.35, 1.0, 0.155]), ([0.30, 0.60, 0.125], [0.36, 1.3, 0.145])]
        {
            let mut stick = no_splats();
            cuboid(&mut stick, low, high);
            for rest in [source.frames[0].clone(), shaken(&source.frames[0], 0.003)] {
                let [knn, best] = [MotionPreset::Knn, MotionPreset::Regions].map(|preset| {
                    worst(graft_positions(&source, &rest, &stick, preset), &stick, truth, |_| true)
                });
                assert!(knn > 0.2, "{name}, from {low:?}: {knn}");
                assert!(best < 1e-3, "{name}, from {low:?}: {best}");
            }
        }
    }
}

/// A ring that hovers over the trunk without contact.
#[test]
fn a_detached_ring_moves_rigidly_with_the_nearest_part() {
    let source = figure();
    for gap in [0.03, 0.06, 0.15] {
        let mut ring = no_splats();
        for i in 0..120_u16 {
            let (sin, cos) = (std::f32::consts::TAU * f32::from(i) / 120.0).sin_cos();
            for d in [[0.0, 0.0], [0.02, 0.0], [0.0, 0.02]] {
                let radius = 0.20 + d[0];
                ring.means.push([radius * cos, HEIGHT + gap + d[1], radius * sin]);
                ring.quats.push([1.0, 0.0, 0.0, 0.0]);
                ring.log_scales.push([0.01_f32.ln(); 3]);
                ring.opacity_logits.push(2.0);
                ring.sh.push([0.0; 3]);
            }
        }
        for rest in [source.frames[0].clone(), shaken(&source.frames[0], 0.003)] {
            let [knn, best] = [MotionPreset::Knn, MotionPreset::Regions].map(|preset| {
                worst(graft_positions(&source, &rest, &ring, preset), &ring, sway, |_| true)
            });
            assert!(knn > 0.03, "gap {gap}: {knn}");
            assert!(best < 1e-3, "gap {gap}: {best}");
        }
    }
}

/// A sleeve over both halves of an arm that bends at the elbow is thin like a stick, but must bend.
#[test]
fn a_sleeve_bends_with_the_elbow() {
    let bend = |splats: &mut Splats, k: usize| {
        rotate(splats, [0.0, 0.0, 1.0], 0.9 * beat(k), [0.0, 0.7, 0.0]);
    };
    let frame = |k: usize| {
        let (mut upper, mut lower) = (no_splats(), no_splats());
        cuboid(&mut upper, [-0.08, 0.72, -0.08], [0.08, HEIGHT, 0.08]);
        cuboid(&mut lower, [-0.08, 0.0, -0.08], [0.08, 0.68, 0.08]);
        bend(&mut lower, k);
        sway(&mut lower, k);
        sway(&mut upper, k);
        for i in 0..lower.len() {
            upper.push_from(&lower, i);
        }
        upper
    };
    let source = Table::new((0..FRAMES).map(frame).collect());
    let mut sleeve = no_splats();
    cuboid(&mut sleeve, [-0.11, 0.3, -0.11], [0.11, 1.1, 0.11]);
    let rest = &source.frames[0];
    let at = |truth: &dyn Fn(&mut Splats, usize), which: &dyn Fn([f32; 3]) -> bool| {
        worst(graft_positions(&source, rest, &sleeve, MotionPreset::Regions), &sleeve, truth, which)
    };
    let ends = [
        at(&sway, &|x| x[1] > 0.85),
        at(
            &|splats, k| {
                bend(splats, k);
                sway(splats, k);
            },
            &|x| x[1] < 0.55,
        ),
    ];
    assert!(ends[0] < 0.01 && ends[1] < 0.01, "{ends:?}");
}
