//! Neighbourhoods against a naive greedy; partition, features, predicate, malformed parts.

use std::collections::BTreeSet;

use anchors::{AnchorError, AnchorParams, Grouping, Neighborhoods, normal_feature};
use proptest::prelude::*;

use crate::scenes::{Vec3, cube, distance2, figure, lattice};

fn params(k: usize) -> AnchorParams {
    AnchorParams { k, ..AnchorParams::default() }
}

/// The documented rule without search structures. Works on ranks, returns coordinates.
fn naive_disjoint(points: &[Vec3], k: usize, max_ratio: f64) -> Vec<Vec<Vec3>> {
    let size = (k + 1).min(points.len());
    let mut ranked = points.to_vec();
    ranked.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
    let edge = |set: &[usize]| mean_edge(&set.iter().map(|j| ranked[*j]).collect::<Vec<_>>());
    let all: Vec<usize> = (0..ranked.len()).collect();
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut free: Vec<usize> = Vec::new();
    for run in all.chunk_by(|a, b| ranked[*a] == ranked[*b]) {
        let whole = run.chunks_exact(size);
        free.extend(whole.remainder());
        groups.extend(whole.map(<[usize]>::to_vec));
    }
    let mut limit = None;
    while free.len() >= size {
        let mut proposals: Vec<(f64, Vec<usize>)> = free
            .iter()
            .map(|i| {
                let mut others: Vec<usize> = free.iter().copied().filter(|j| j != i).collect();
                let key = |j: &usize| distance2(&ranked[*i], &ranked[*j]);
                others.sort_by(|a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
                let mut set: Vec<usize> = others[..size - 1].to_vec();
                set.push(*i);
                set.sort_unstable();
                (edge(&set), set)
            })
            .collect();
        proposals.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
        let edges: Vec<f64> = proposals.iter().map(|p| p.0).filter(|e| *e > 0.0).collect();
        let limit = *limit.get_or_insert_with(|| match edges.len() {
            0 => 0.0,
            n if n % 2 == 1 => max_ratio * edges[n / 2],
            n => max_ratio * 0.5 * (edges[n / 2 - 1] + edges[n / 2]),
        });
        let mut taken = BTreeSet::new();
        for (edge, set) in proposals {
            if edge <= limit && set.iter().all(|j| !taken.contains(j)) {
                taken.extend(set.iter().copied());
                groups.push(set);
            }
        }
        if taken.is_empty() {
            break;
        }
        free.retain(|j| !taken.contains(j));
    }
    groups.sort();
    groups.iter().map(|set| set.iter().map(|j| ranked[*j]).collect()).collect()
}

fn mean_edge(set: &[Vec3]) -> f64 {
    let mut sum = 0.0;
    for (i, a) in set.iter().enumerate() {
        for b in &set[i + 1..] {
            sum += distance2(a, b).sqrt();
        }
    }
    sum / (set.len() * (set.len() - 1) / 2).max(1) as f64
}

fn coordinates(points: &[Vec3], groups: &Neighborhoods) -> Vec<Vec<Vec3>> {
    groups.iter().map(|g| g.iter().map(|id| points[*id as usize]).collect()).collect()
}

#[test]
fn disjoint_equals_the_naive_greedy() {
    for k in [1, 2, 3, 5] {
        for (what, points) in [
            ("cube", cube(300, 1)),
            ("figure", figure(400, 2)),
            ("lattice", lattice(300, 5, 3)),
            ("duplicates", lattice(300, 2, 4)),
            ("three", cube(3, 5)),
        ] {
            let groups = Neighborhoods::build(&points, None, &params(k)).unwrap();
            let found = coordinates(&points, &groups);
            assert_eq!(found, naive_disjoint(&points, k, 4.0), "{what}, k = {k}");
        }
    }
}

#[test]
fn the_naive_greedy_distinguishes_rules() {
    let points = cube(300, 1);
    let (two, three) = (naive_disjoint(&points, 2, 4.0), naive_disjoint(&points, 2, 1.0));
    assert_ne!(two, three, "the rejection has no effect, so the comparison above is meaningless");
}

#[test]
fn overlapping_groups_are_points_with_their_nearest() {
    for (what, points) in [("figure", figure(300, 2)), ("lattice", lattice(200, 5, 3))] {
        let groups = Neighborhoods::build(
            &points,
            None,
            &AnchorParams { grouping: Grouping::Overlapping, ..params(2) },
        )
        .unwrap();
        let mut sorted = points.clone();
        sorted.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
        let mut expected: Vec<Vec<usize>> = (0..sorted.len())
            .map(|i| {
                let mut others: Vec<usize> = (0..sorted.len()).filter(|j| *j != i).collect();
                let key = |j: &usize| distance2(&sorted[i], &sorted[*j]);
                others.sort_by(|a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
                let mut set = vec![i, others[0], others[1]];
                set.sort_unstable();
                set
            })
            .collect();
        expected.sort();
        expected.dedup();
        let expected: Vec<Vec<Vec3>> =
            expected.iter().map(|set| set.iter().map(|j| sorted[*j]).collect()).collect();
        assert_eq!(coordinates(&points, &groups), expected, "{what}");
    }
}

#[test]
fn most_points_are_grouped_and_none_twice() {
    let points = figure(20_000, 6);
    let groups = Neighborhoods::build(&points, None, &params(2)).unwrap();
    let unique: BTreeSet<u32> = groups.indices().iter().copied().collect();
    assert_eq!(unique.len(), groups.indices().len(), "a point is in two triples");
    let share = unique.len() as f64 / points.len() as f64;
    assert!(share > 0.93, "only {share} of the points are in a triple");
    assert!(groups.iter().all(|g| g.len() == 3), "a neighbourhood is not a triple");
}

#[test]
fn with_zero_neighbors_every_point_is_a_neighborhood() {
    let points = lattice(50, 3, 1);
    for grouping in [Grouping::Disjoint, Grouping::Overlapping] {
        let p = AnchorParams { grouping, ..params(0) };
        let groups = Neighborhoods::build(&points, None, &p).unwrap();
        let mut ids = groups.indices().to_vec();
        ids.sort_unstable();
        assert_eq!(ids, (0..50).collect::<Vec<u32>>(), "{grouping:?}");
        assert!(groups.iter().all(|g| g.len() == 1), "{grouping:?}");
    }
}

#[test]
fn features_separate_surfaces() {
    // Two sheets crossing at a right angle.
    let sheet = cube(4000, 3);
    let points: Vec<Vec3> = sheet
        .iter()
        .enumerate()
        .map(|(i, p)| if i % 2 == 0 { [p[0], p[1], 0.5] } else { [0.5, p[1], p[2]] })
        .collect();
    let normal = |i: usize| if i.is_multiple_of(2) { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let features: Vec<[f64; 6]> =
        (0..points.len()).map(|i| normal_feature(normal(i), 1.0)).collect();
    let mixed = |groups: &Neighborhoods| {
        groups.iter().filter(|g| g.iter().any(|id| id % 2 != g[0] % 2)).count()
    };
    let plain = mixed(&Neighborhoods::build(&points, None, &params(2)).unwrap());
    let joint = Neighborhoods::build(&points, Some(&features), &params(2)).unwrap();
    let share = joint.indices().len() as f64 / points.len() as f64;
    assert!(
        plain > 20 && mixed(&joint) * 5 < plain,
        "mixed: {plain} plain, {} joint",
        mixed(&joint)
    );
    assert!(share > 0.93, "only {share} of the points are in a triple");
    let unweighted = AnchorParams { feature_weight: 0.0, ..params(2) };
    assert_eq!(
        Neighborhoods::build(&points, Some(&features), &unweighted).unwrap(),
        Neighborhoods::build(&points, None, &params(2)).unwrap(),
        "weight 0 is no feature"
    );
}

#[test]
fn retain_filters_by_members() {
    let points = cube(100, 1);
    let mut groups = Neighborhoods::build(&points, None, &params(2)).unwrap();
    let expected: Vec<Vec<u32>> =
        groups.iter().filter(|g| !g.contains(&7)).map(<[u32]>::to_vec).collect();
    assert_eq!(expected.len() + 1, groups.len(), "point 7 is in one triple");
    groups.retain(|members| !members.contains(&7));
    assert_eq!(groups.iter().map(<[u32]>::to_vec).collect::<Vec<_>>(), expected, "the others stay");
    groups.retain(|_| false);
    assert!(groups.is_empty() && groups.num_points() == 100, "all dropped");
}

#[test]
fn malformed_parts_are_rejected() {
    let ok = Neighborhoods::from_parts(vec![0, 2, 3], vec![4, 0, 4], 5).unwrap();
    assert_eq!((ok.len(), ok.get(0), ok.get(1)), (2, &[4, 0][..], &[4][..]), "well formed");
    for (offsets, indices, why) in [
        (vec![], vec![], "no offsets"),
        (vec![1, 2], vec![0, 1], "start"),
        (vec![0, 3], vec![0, 1], "end"),
        (vec![0, 2, 1, 3], vec![0, 1, 2], "decreasing"),
        (vec![0, 0, 1], vec![0], "empty neighbourhood"),
        (vec![0, 1], vec![5], "out of range"),
        (vec![0, 3], vec![1, 2, 1], "twice"),
    ] {
        let result = Neighborhoods::from_parts(offsets, indices, 5);
        assert!(matches!(result, Err(AnchorError::BadNeighborhoods { .. })), "{why}: {result:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn small_clouds_full_of_ties_equal_the_naive_greedy(
        raw in prop::collection::vec(prop::array::uniform3(-3_i8..3), 1..40),
        k in 0_usize..5,
    ) {
        let points: Vec<Vec3> = raw.iter().map(|p| p.map(f64::from)).collect();
        let groups = Neighborhoods::build(&points, None, &params(k)).unwrap();
        prop_assert_eq!(coordinates(&points, &groups), naive_disjoint(&points, k, 4.0));
    }
}
