//! Invariance to point order and thread count; equivariance to rigid motion and scale.

use std::collections::BTreeMap;

use anchors::{
    AnchorParams, AnchorSet, BoundingSphere, Grouping, Line, Lines, NO_ANCHOR, Neighborhoods,
    Radius, normal_feature,
};
use proptest::prelude::*;

use crate::scenes::{Rng, Similarity, Vec3, cube, distance2, figure, lattice, permutation};

fn variants() -> [AnchorParams; 4] {
    let base = AnchorParams { num_lines: 20_000, ..AnchorParams::default() };
    [
        base.clone(),
        AnchorParams { radius: Radius::Local, k: 3, ..base.clone() },
        AnchorParams { grouping: Grouping::Overlapping, ..base.clone() },
        AnchorParams { k: 0, ..base },
    ]
}

fn bits(p: &Vec3) -> [u64; 3] {
    p.map(f64::to_bits)
}

/// The content of a set without ids of points: coincident points are interchangeable.
fn content(points: &[Vec3], set: &AnchorSet) -> impl PartialEq + std::fmt::Debug + use<> {
    let members: Vec<Vec<[u64; 3]>> = set
        .members
        .iter()
        .map(|g| g.iter().map(|id| bits(&points[*id as usize])).collect())
        .collect();
    let positions: Vec<[u64; 3]> = set.positions.iter().map(bits).collect();
    let mut owners = BTreeMap::new();
    for (point, owner) in points.iter().zip(&set.owners) {
        *owners.entry((bits(point), *owner)).or_insert(0) += 1;
    }
    let counts = (set.num_ungrouped, set.num_unhit, set.delta.to_bits());
    (members, positions, set.lines.clone(), owners, counts)
}

#[test]
fn point_order_does_not_matter() {
    for (seed, points) in [figure(1500, 1), cube(700, 2), lattice(800, 6, 3)].iter().enumerate() {
        let order = permutation(points.len(), seed as u64);
        let shuffled: Vec<Vec3> = order.iter().map(|i| points[*i]).collect();
        for params in variants() {
            let (a, b) = (AnchorSet::of(points, &params), AnchorSet::of(&shuffled, &params));
            let (a, b) = (content(points, &a.unwrap()), content(&shuffled, &b.unwrap()));
            assert!(a == b, "cloud {seed}, {params:?}");
        }
    }
}

#[test]
fn point_order_does_not_matter_with_features() {
    let points = figure(1200, 4);
    let mut rng = Rng::new(2);
    let features: Vec<[f64; 6]> =
        points.iter().map(|_| normal_feature(rng.on_sphere(), 0.7)).collect();
    let order = permutation(points.len(), 6);
    let shuffled: Vec<Vec3> = order.iter().map(|i| points[*i]).collect();
    let shuffled_features: Vec<[f64; 6]> = order.iter().map(|i| features[*i]).collect();
    let params = AnchorParams::default();
    let a = Neighborhoods::build(&points, Some(&features), &params).unwrap();
    let b = Neighborhoods::build(&shuffled, Some(&shuffled_features), &params).unwrap();
    let b: Vec<Vec<usize>> =
        b.iter().map(|g| g.iter().map(|id| order[*id as usize]).collect()).collect();
    let a: Vec<Vec<usize>> = a.iter().map(|g| g.iter().map(|id| *id as usize).collect()).collect();
    assert_eq!(a, b, "triples in feature space");
}

#[test]
fn thread_count_does_not_change_a_bit() {
    let points = figure(12_000, 5);
    for params in variants() {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| AnchorSet::of(&points, &params).unwrap())
        };
        let one = run(1);
        for threads in [2, 3, 7] {
            let many = run(threads);
            assert_eq!(many, one, "{threads} threads, {params:?}");
            assert!(content(&points, &many) == content(&points, &one), "{threads} threads: bits");
        }
    }
}

#[test]
fn anchors_are_equivariant_to_rigid_motion_and_scale() {
    let points = figure(2000, 6);
    for (case, motion) in [
        Similarity::new([1.0, 2.0, -0.5], 1.1, 1.0, [0.3, -0.2, 0.9]),
        Similarity::new([-1.0, 0.2, 0.3], 2.7, 37.0, [5.0, 0.0, -4.0]),
        Similarity::new([0.0, 1.0, 0.0], -0.4, 0.01, [0.0, 0.0, 0.0]),
    ]
    .iter()
    .enumerate()
    {
        let moved: Vec<Vec3> = points.iter().map(|p| motion.point(p)).collect();
        for params in variants() {
            let lines = Lines::sample(&BoundingSphere::of(&points).unwrap(), params.num_lines, 0);
            let moved_lines = lines
                .as_slice()
                .iter()
                .map(|l| Line {
                    point: motion.point(&l.point),
                    direction: motion.direction(&l.direction),
                })
                .collect();
            let a = anchors_by_members(&points, &lines, &params);
            let b = anchors_by_members(&moved, &Lines::from_lines(moved_lines).unwrap(), &params);
            assert_eq!(a.len(), b.len(), "case {case}: number of anchors, {params:?}");
            let size = BoundingSphere::of(&moved).unwrap().radius;
            for ((members, (line, p)), (other, (other_line, q))) in a.iter().zip(&b) {
                assert_eq!((members, line), (other, other_line), "case {case}: triple and line");
                let off = distance2(&motion.point(p), q).sqrt() / size;
                assert!(off < 1e-10, "case {case}: anchor of {members:?} off by {off}");
            }
        }
    }
}

#[test]
fn the_sphere_is_equivariant_to_rigid_motion_and_scale() {
    let points = figure(3000, 7);
    let motion = Similarity::new([1.0, 2.0, -0.5], 1.1, 12.0, [3.0, -2.0, 9.0]);
    let moved: Vec<Vec3> = points.iter().map(|p| motion.point(p)).collect();
    let (a, b) = (BoundingSphere::of(&points).unwrap(), BoundingSphere::of(&moved).unwrap());
    assert!((b.radius / a.radius / 12.0 - 1.0).abs() < 1e-12, "{a:?} became {b:?}");
    let off = distance2(&motion.point(&a.center), &b.center).sqrt() / b.radius;
    assert!(off < 1e-10, "the centre is off by {off}");
}

fn anchors_by_members(
    points: &[Vec3],
    lines: &Lines,
    params: &AnchorParams,
) -> BTreeMap<Vec<u32>, (u32, Vec3)> {
    let groups = Neighborhoods::build(points, None, params).unwrap();
    let set = AnchorSet::build(points, &groups, lines, params).unwrap();
    let keyed = set.members.iter().zip(set.lines.iter().zip(&set.positions));
    keyed
        .map(|(members, (line, position))| {
            let mut members = members.to_vec();
            members.sort_unstable();
            (members, (*line, *position))
        })
        .collect()
}

#[test]
fn single_and_double_precision_agree_on_single_precision_input() {
    let single: Vec<[f32; 3]> =
        figure(1000, 8).iter().map(|p| p.map(|x| format!("{x:.5}").parse().unwrap())).collect();
    let double: Vec<Vec3> = single.iter().map(|p| p.map(f64::from)).collect();
    let params = AnchorParams { num_lines: 5000, ..AnchorParams::default() };
    let (a, b) = (AnchorSet::of(&single, &params), AnchorSet::of(&double, &params));
    assert_eq!(a.unwrap(), b.unwrap(), "f32 input is widened, nothing else");
}

#[test]
fn a_pair_shares_its_lines() {
    let (src, edit) = (figure(900, 1), figure(700, 2));
    let params = AnchorParams { num_lines: 8000, seed: 4, ..AnchorParams::default() };
    let (a, b) = AnchorSet::of_pair(&src, &edit, &params).unwrap();
    let lines = Lines::sample(&BoundingSphere::of_union(&[&src, &edit]).unwrap(), 8000, 4);
    for (cloud, set) in [(&src, a), (&edit, b)] {
        let groups = Neighborhoods::build(cloud, None, &params).unwrap();
        let expected = AnchorSet::build(cloud, &groups, &lines, &params).unwrap();
        assert_eq!(set, expected, "built from the same lines");
    }
}

#[test]
fn with_more_lines_all_anchors_remain() {
    let points = figure(2000, 9);
    let few =
        AnchorSet::of(&points, &AnchorParams { num_lines: 5000, ..Default::default() }).unwrap();
    let many =
        AnchorSet::of(&points, &AnchorParams { num_lines: 20_000, ..Default::default() }).unwrap();
    assert!(many.len() > few.len(), "{} then {}", few.len(), many.len());
    for (id, owner) in few.owners.iter().enumerate() {
        assert!(*owner == NO_ANCHOR || many.owners[id] != NO_ANCHOR, "point {id} lost its anchor");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn order_does_not_matter_for_clouds_full_of_ties(
        raw in prop::collection::vec(prop::array::uniform3(-4_i8..4), 1..60),
        k in 0_usize..4,
        seed in 0_u64..1000,
        overlap in prop::bool::ANY,
    ) {
        let points: Vec<Vec3> = raw.iter().map(|p| p.map(f64::from)).collect();
        let shuffled: Vec<Vec3> = permutation(points.len(), seed).iter().map(|i| points[*i]).collect();
        let grouping = if overlap { Grouping::Overlapping } else { Grouping::Disjoint };
        let params = AnchorParams { k, grouping, num_lines: 300, ..AnchorParams::default() };
        let (a, b) = (AnchorSet::of(&points, &params).unwrap(), AnchorSet::of(&shuffled, &params).unwrap());
        prop_assert!(content(&points, &a) == content(&shuffled, &b));
    }
}
