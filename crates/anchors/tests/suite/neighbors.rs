//! Nearest neighbours against brute force: on a point, near one, far outside; ties and duplicates.

use anchors::{KdTree, Neighbor, Neighbors, median_spacing, normal_feature};

use crate::scenes::{Rng, cube, distance2, figure, lattice};

fn brute<const D: usize>(points: &[[f64; D]], query: &[f64; D], k: usize) -> Vec<Neighbor> {
    let mut all: Vec<Neighbor> = points
        .iter()
        .zip(0..)
        .map(|(p, id)| {
            let distance_squared =
                (0..D).fold(0.0, |s, d| s + (query[d] - p[d]) * (query[d] - p[d]));
            Neighbor { distance_squared, id }
        })
        .collect();
    all.sort_by(|a, b| a.distance_squared.total_cmp(&b.distance_squared).then(a.id.cmp(&b.id)));
    all.truncate(k);
    all
}

fn check<const D: usize>(points: &[[f64; D]], what: &str) {
    let tree = KdTree::new(points);
    assert_eq!(tree.len(), points.len(), "{what}");
    let mut rng = Rng::new(3);
    let mut found = Vec::new();
    let mut queries = Vec::new();
    for case in 0..150 {
        let on = points[rng.below(points.len())];
        let query = match case % 3 {
            0 => on,
            1 => on.map(|x| x + 0.01 * (rng.uniform() - 0.5)),
            _ => on.map(|x| x + 20.0 * (rng.uniform() - 0.5)),
        };
        for k in [0, 1, 2, 7, 40, 41, 160] {
            tree.nearest(&query, k, &mut found);
            assert_eq!(found, brute(points, &query, k), "{what}, case {case}, k {k}");
        }
        queries.push(query);
    }
    for (k, distance) in [(1, f64::INFINITY), (7, 0.3), (3, 2.0), (41, 5.0), (2, 0.0)] {
        let all = tree.map_within(&queries, k, distance, |i, near| (i, near.to_vec()));
        for ((i, near), query) in all.into_iter().zip(&queries) {
            let mut expected = brute(points, query, k);
            expected.retain(|n| n.distance_squared <= distance * distance);
            assert_eq!((query, near), (&queries[i], expected.clone()), "{what}, {k} in {distance}");
            assert_eq!(tree.any_within(query, distance), !expected.is_empty(), "{what}: any");
        }
    }
}

#[test]
fn neighbors_of_all_points_are_the_others() {
    let points = figure(700, 4);
    let near = Neighbors::of(&points, 9);
    for (i, point) in (0..).zip(&points) {
        let mut expected = brute(&points, point, 10);
        expected.retain(|n| n.id != i);
        assert_eq!(near.get(i as usize).collect::<Vec<_>>(), expected, "point {i}");
    }
}

#[test]
fn nearest_equals_brute_force() {
    for n in [1, 2, 7, 8, 9, 16, 17, 500] {
        check(&cube(n, n as u64), &format!("cube of {n}"));
    }
    check(&figure(2000, 1), "figure");
}

#[test]
fn ties_and_duplicates_go_to_the_lowest_id() {
    check(&lattice(400, 4, 2), "lattice with replacement");
    check(&[[1.5; 3]; 100], "coincident");
}

#[test]
fn joint_space_equals_brute_force() {
    let mut rng = Rng::new(8);
    let joint: Vec<[f64; 9]> = cube(400, 6)
        .iter()
        .map(|p| {
            let f = normal_feature(rng.on_sphere(), rng.uniform());
            [p[0], p[1], p[2], f[0], f[1], f[2], f[3], f[4], f[5]]
        })
        .collect();
    check(&joint, "positions and normals");
}

#[test]
fn empty_trees_have_no_neighbors() {
    let tree = KdTree::<3>::new(&[]);
    let mut found = vec![Neighbor { distance_squared: 0.0, id: 0 }];
    tree.nearest(&[0.0; 3], 4, &mut found);
    assert!(tree.is_empty() && found.is_empty(), "{found:?}");
}

#[test]
fn distances_of_normal_features_are_sines() {
    let mut rng = Rng::new(4);
    for _ in 0..100 {
        let (a, b) = (rng.on_sphere(), rng.on_sphere());
        let cosine: f64 = (0..3).map(|d| a[d] * b[d]).sum();
        let (fa, fb) = (normal_feature(a, 1.0), normal_feature(b, 1.0));
        let apart: f64 = fa.iter().zip(fb).map(|(x, y)| (x - y) * (x - y)).sum();
        assert!((apart - (1.0 - cosine * cosine)).abs() < 1e-12, "{apart} for cosine {cosine}");
        assert_eq!(fa, normal_feature(a.map(|x| -x), 1.0), "normals are unoriented");
    }
}

#[test]
fn spacing_is_the_median_third_neighbor_distance() {
    let points = figure(501, 2);
    let mut thirds: Vec<f64> =
        points.iter().map(|p| brute(&points, p, 4)[3].distance_squared.sqrt()).collect();
    thirds.sort_by(f64::total_cmp);
    let found = median_spacing(&points).unwrap();
    assert!((found - thirds[250]).abs() < 1e-15, "{found} for {}", thirds[250]);
    let pair = [[0.0_f32; 3], [3.0, 4.0, 0.0]];
    assert!((median_spacing(&pair).unwrap() - 5.0).abs() < 1e-15, "two points");
    assert!(median_spacing(&pair[..1]).unwrap().abs() < 1e-300, "one point");
    let line: Vec<[f64; 3]> = (0..4).map(|i| [f64::from(i), 0.0, 0.0]).collect();
    let even = median_spacing(&line).unwrap();
    assert!((even - 2.5).abs() < 1e-15, "midpoint of 2 and 3, found {even}");
    assert!(distance2(&line[0], &line[3]) > 8.0, "the lattice is as long as it should be");
}
