//! The sphere is the smallest one, for any order and any degeneracy.

use anchors::BoundingSphere;

use crate::scenes::{Rng, Vec3, cube, distance2, figure, lattice, permutation};

/// Radius of the smallest ball by definition: the smallest of all spheres through two to four
/// points that contains every point.
fn brute_radius(points: &[Vec3]) -> f64 {
    let n = points.len();
    let mut best = f64::INFINITY;
    for mask in 1_u32..1 << n {
        if mask.count_ones() > 4 {
            continue;
        }
        let subset: Vec<Vec3> = (0..n).filter(|i| mask >> i & 1 == 1).map(|i| points[i]).collect();
        let Some(center) = circumcenter(&subset) else { continue };
        let radius = distance2(&center, &subset[0]).sqrt();
        if farthest(points, &center).0 <= radius * (1.0 + 1e-11) {
            best = best.min(radius);
        }
    }
    best
}

/// Centre of the smallest sphere through the points: Gram system by Gauss elimination with pivots.
fn circumcenter(points: &[Vec3]) -> Option<Vec3> {
    let edges: Vec<Vec3> =
        points[1..].iter().map(|p| [0, 1, 2].map(|d| p[d] - points[0][d])).collect();
    let m = edges.len();
    let dot = |a: &Vec3, b: &Vec3| (0..3).map(|d| a[d] * b[d]).sum::<f64>();
    let mut rows: Vec<Vec<f64>> = (0..m)
        .map(|i| {
            let gram = (0..m).map(|j| 2.0 * dot(&edges[i], &edges[j]));
            gram.chain([dot(&edges[i], &edges[i])]).collect()
        })
        .collect();
    for i in 0..m {
        let pivot = (i..m).max_by(|a, b| rows[*a][i].abs().total_cmp(&rows[*b][i].abs()))?;
        rows.swap(i, pivot);
        if rows[i][i].abs() < 1e-12 {
            return None;
        }
        for r in (0..m).filter(|r| *r != i) {
            let factor = rows[r][i] / rows[i][i];
            for c in 0..=m {
                let x = rows[i][c];
                rows[r][c] -= factor * x;
            }
        }
    }
    let weight = |i: usize| rows[i][m] / rows[i][i];
    Some([0, 1, 2].map(|d| points[0][d] + (0..m).map(|i| weight(i) * edges[i][d]).sum::<f64>()))
}

fn farthest(points: &[Vec3], center: &Vec3) -> (f64, Vec3) {
    let far = points.iter().max_by(|a, b| distance2(a, center).total_cmp(&distance2(b, center)));
    let far = *far.expect("a point");
    (distance2(&far, center).sqrt(), far)
}

/// Whether a ball is the smallest: its centre lies in the convex hull of the points on its surface.
fn is_optimal(points: &[Vec3], sphere: &BoundingSphere) -> bool {
    let on: Vec<Vec3> = points
        .iter()
        .filter(|p| distance2(p, &sphere.center).sqrt() >= sphere.radius * (1.0 - 1e-9))
        .map(|p| [0, 1, 2].map(|d| (p[d] - sphere.center[d]) / sphere.radius))
        .collect();
    // Frank-Wolfe with exact line search for the point of the hull nearest to the origin.
    let mut nearest = on[0];
    for _ in 0..200_000 {
        let dot = |a: &Vec3, b: &Vec3| (0..3).map(|d| a[d] * b[d]).sum::<f64>();
        let towards = *on
            .iter()
            .min_by(|a, b| dot(a, &nearest).total_cmp(&dot(b, &nearest)))
            .expect("something is on the surface");
        let step: Vec3 = [0, 1, 2].map(|d| towards[d] - nearest[d]);
        let length2 = dot(&step, &step);
        if dot(&nearest, &nearest) < 1e-8 || length2 < 1e-30 {
            break;
        }
        let t = (-dot(&nearest, &step) / length2).clamp(0.0, 1.0);
        nearest = [0, 1, 2].map(|d| nearest[d] + t * step[d]);
    }
    distance2(&nearest, &[0.0; 3]).sqrt() < 2e-3
}

fn check(points: &[Vec3], what: &str) {
    let sphere = BoundingSphere::of(points).unwrap();
    let reach = farthest(points, &sphere.center).0;
    assert!(reach <= sphere.radius * (1.0 + 1e-15), "{what}: {reach} outside {sphere:?}");
    assert!(is_optimal(points, &sphere), "{what}: {sphere:?} is not the smallest");
}

#[test]
fn spheres_of_random_clouds_are_minimal() {
    for seed in 0..40 {
        let n = 2 + Rng::new(seed).below(60);
        check(&cube(n, seed), &format!("cube of {n}, seed {seed}"));
    }
    check(&figure(5000, 3), "figure");
}

#[test]
fn small_clouds_equal_brute_force() {
    for seed in 0..60 {
        let n = 2 + Rng::new(seed).below(11);
        for (what, points) in [("cube", cube(n, seed)), ("lattice", lattice(n, 3, seed))] {
            let expected =
                if points.iter().all(|p| *p == points[0]) { 0.0 } else { brute_radius(&points) };
            let found = BoundingSphere::of(&points).unwrap().radius;
            let close = (found - expected).abs() <= 1e-12 * expected;
            assert!(close, "{what} of {n}, seed {seed}: {found}, expected {expected}");
        }
    }
}

#[test]
fn spheres_of_degenerate_clouds_are_minimal() {
    let mut rng = Rng::new(5);
    check(&lattice(200, 4, 1), "lattice");
    let collinear: Vec<Vec3> =
        (0..50).map(|_| [1.0, 2.0, -1.0].map(|x| x * rng.uniform())).collect();
    check(&collinear, "collinear");
    let coplanar: Vec<Vec3> = (0..50).map(|_| [rng.uniform(), rng.uniform(), 0.25]).collect();
    check(&coplanar, "coplanar");
    let circle: Vec<Vec3> =
        (0..64).map(|i| (f64::from(i) * 0.3).sin_cos()).map(|(s, c)| [s, c, 7.0]).collect();
    check(&circle, "circle");
    let shell: Vec<Vec3> = (0..500).map(|_| rng.on_sphere()).collect();
    check(&shell, "shell");
    let sliver: Vec<Vec3> = (0..100).map(|_| [rng.uniform(), 1e-9 * rng.uniform(), 0.0]).collect();
    check(&sliver, "sliver");
    let far: Vec<Vec3> = cube(100, 9).iter().map(|p| p.map(|x| x + 1e6)).collect();
    check(&far, "far from the origin");
}

#[test]
fn spheres_of_known_shapes() {
    let sphere = BoundingSphere::of(&[[0.0_f32, 0.0, 0.0], [2.0, 0.0, 0.0]]).unwrap();
    assert_eq!(sphere, BoundingSphere { center: [1.0, 0.0, 0.0], radius: 1.0 }, "two points");
    let corners: Vec<Vec3> = (0..8).map(|i| [0, 1, 2].map(|d| f64::from(i >> d & 1))).collect();
    let sphere = BoundingSphere::of(&corners).unwrap();
    assert!((sphere.radius - 0.75_f64.sqrt()).abs() < 1e-15, "cube: {sphere:?}");
    // The smallest sphere of an obtuse triangle is that of its longest side.
    let sphere = BoundingSphere::of(&[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 0.5, 0.0]]).unwrap();
    assert_eq!(sphere, BoundingSphere { center: [2.0, 0.0, 0.0], radius: 2.0 }, "obtuse triangle");
    // Regular tetrahedron of edge √8.
    let tetrahedron = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let sphere = BoundingSphere::of(&tetrahedron).unwrap();
    assert!((sphere.radius - 3.0_f64.sqrt()).abs() < 1e-15, "tetrahedron: {sphere:?}");
}

#[test]
fn the_optimality_check_rejects_a_larger_ball() {
    let points = figure(500, 1);
    let mut sphere = BoundingSphere::of(&points).unwrap();
    sphere.center[0] += 0.01 * sphere.radius;
    sphere.radius = farthest(&points, &sphere.center).0;
    assert!(!is_optimal(&points, &sphere), "an off-centre ball passed as the smallest");
}

#[test]
fn order_does_not_change_bits() {
    for (seed, points) in [cube(300, 1), lattice(300, 4, 2), figure(40_000, 3)].iter().enumerate() {
        let sphere = BoundingSphere::of(points).unwrap();
        let order = permutation(points.len(), seed as u64);
        let shuffled: Vec<Vec3> = order.iter().map(|i| points[*i]).collect();
        assert_eq!(BoundingSphere::of(&shuffled).unwrap(), sphere, "cloud {seed}");
    }
}

#[test]
fn the_sphere_of_a_union_contains_all_points() {
    let all = figure(1000, 4);
    let (a, b) = all.split_at(300);
    let whole = BoundingSphere::of(&all).unwrap();
    assert_eq!(BoundingSphere::of_union(&[a, &[], b]).unwrap(), whole, "two parts and nothing");
}
