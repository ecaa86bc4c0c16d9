//! Clouds without extent, tiny clouds, huge runs of coincident points, hostile input.

use std::time::Instant;

use anchors::{
    AnchorError, AnchorParams, AnchorSet, BoundingSphere, Grouping, Lines, NO_ANCHOR, NO_LINE,
    Neighborhoods, Radius, median_spacing,
};

use crate::scenes::{Vec3, figure};

fn params() -> AnchorParams {
    AnchorParams { num_lines: 5000, ..AnchorParams::default() }
}

#[test]
fn one_point_is_its_own_anchor() {
    for k in [0, 2, 5] {
        let set = AnchorSet::of(&[[1.0_f32, 2.0, 3.0]], &AnchorParams { k, ..params() }).unwrap();
        assert_eq!(set.positions, [[1.0, 2.0, 3.0]], "k = {k}");
        assert_eq!((&set.lines[..], &set.owners[..]), (&[NO_LINE][..], &[0][..]), "k = {k}");
        assert_eq!((set.delta.to_bits(), set.num_uncovered()), (0, 0), "k = {k}");
    }
}

#[test]
fn two_points_are_one_neighborhood() {
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
    let set = AnchorSet::of(&points, &params()).unwrap();
    assert_eq!((set.len(), set.members.get(0)), (1, &[0, 1][..]), "one pair");
    assert!((set.delta - 0.75_f64.sqrt()).abs() < 1e-15, "δ = √3/2 of the distance");
    let [x, y, z] = set.positions[0];
    assert!((0.0..=1.0).contains(&x) && y.abs() + z.abs() < 1e-15, "on the segment: {x} {y} {z}");
}

#[test]
fn coincident_points_are_anchors_without_lines() {
    for n in [2, 3, 7, 1000] {
        let points = vec![[0.1_f32, -5.0, 3.0]; n];
        for radius in [Radius::Global, Radius::Local] {
            let set = AnchorSet::of(&points, &AnchorParams { radius, ..params() }).unwrap();
            let size = 3.min(n);
            assert_eq!(set.len(), n / size, "{n} points");
            assert_eq!(set.num_ungrouped, n % size, "{n} points");
            assert!(set.positions.iter().all(|p| *p == points[0].map(f64::from)), "{n} points");
            assert!(set.lines.iter().all(|line| *line == NO_LINE), "{n} points");
        }
    }
    let sphere = BoundingSphere::of(&[[2.0; 3]; 4]).unwrap();
    assert_eq!(sphere, BoundingSphere { center: [2.0; 3], radius: 0.0 }, "no extent");
    let lines = Lines::sample(&sphere, 100, 0);
    assert!(lines.as_slice().iter().all(|l| l.point == [2.0; 3]), "lines through the one place");
}

#[test]
fn collinear_points_are_tested_with_lines() {
    let points: Vec<Vec3> = (0..300).map(|i| [0.0, (f64::from(i) * 0.7).sin(), 0.0]).collect();
    let set = AnchorSet::of(&points, &AnchorParams { num_lines: 100_000, ..params() }).unwrap();
    assert!(set.len() > 30, "{} anchors", set.len());
    for p in &set.positions {
        assert!(p[0].abs() + p[2].abs() < 1e-15, "{p:?} left the line");
    }
}

#[test]
fn members_on_the_line_have_equal_weights() {
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [5.0, 0.0, 0.0]];
    let groups = Neighborhoods::build(&points, None, &params()).unwrap();
    let line = anchors::Line { point: [9.0, 0.0, 0.0], direction: [1.0, 0.0, 0.0] };
    let lines = Lines::from_lines(vec![line]).unwrap();
    let set = AnchorSet::build(&points, &groups, &lines, &params()).unwrap();
    assert_eq!(set.positions, [[2.0, 0.0, 0.0]], "0/0 is the uniform mean");
}

#[test]
fn with_k_of_zero_every_point_is_an_anchor() {
    let points = figure(200, 1);
    for radius in [Radius::Global, Radius::Local, Radius::Fixed(0.1)] {
        let p = AnchorParams { k: 0, radius, num_lines: 0, ..params() };
        let set = AnchorSet::of(&points, &p).unwrap();
        assert_eq!((set.len(), set.num_uncovered()), (200, 0), "{radius:?}");
        for (id, owner) in set.owners.iter().enumerate() {
            assert_eq!(set.positions[*owner as usize], points[id], "point {id}");
        }
    }
}

#[test]
fn without_lines_there_are_no_anchors() {
    let points = figure(200, 1);
    let set = AnchorSet::of(&points, &AnchorParams { num_lines: 0, ..params() }).unwrap();
    assert!(set.is_empty() && set.num_uncovered() == 200, "{} anchors", set.len());
    assert_eq!(set.owners_or_nearest(&points).unwrap(), vec![NO_ANCHOR; 200], "nobody to go to");
}

#[test]
fn long_runs_of_coincident_points_take_linear_time() {
    let mut points = figure(2000, 2);
    points.extend(std::iter::repeat_n([0.5, 0.5, 0.5], 60_000));
    points.extend(std::iter::repeat_n(points[0], 60_000));
    let start = Instant::now();
    for grouping in [Grouping::Disjoint, Grouping::Overlapping] {
        let groups = Neighborhoods::build(&points, None, &AnchorParams { grouping, ..params() });
        assert!(groups.unwrap().len() > 500, "{grouping:?}");
    }
    assert!(median_spacing(&points).unwrap().abs() < 1e-300, "most points coincide");
    let secs = start.elapsed().as_secs_f64();
    assert!(secs < 5.0, "{secs} s: quadratic in the length of the run");
}

#[test]
fn a_distant_point_and_a_dense_cluster_have_a_finite_result() {
    let mut points = figure(5000, 3);
    points.push([1e12, 0.0, 0.0]);
    let set = AnchorSet::of(&points, &params()).unwrap();
    assert!(set.positions.iter().flatten().all(|x| x.is_finite()), "finite positions");
    let huge: Vec<Vec3> = figure(500, 4).iter().map(|p| p.map(|x| x * 1e49)).collect();
    let set = AnchorSet::of(&huge, &params()).unwrap();
    assert!(set.len() > 50 && set.positions.iter().flatten().all(|x| x.is_finite()), "large units");
}

#[test]
fn invalid_points_are_rejected() {
    let empty: [[f32; 3]; 0] = [];
    assert_eq!(BoundingSphere::of(&empty), Err(AnchorError::EmptyCloud), "sphere");
    assert_eq!(
        BoundingSphere::of_union(&[&empty[..], &empty]),
        Err(AnchorError::EmptyCloud),
        "union"
    );
    assert_eq!(
        Neighborhoods::build(&empty, None, &params()),
        Err(AnchorError::EmptyCloud),
        "groups"
    );
    assert_eq!(AnchorSet::of(&empty, &params()), Err(AnchorError::EmptyCloud), "anchors");
    assert_eq!(median_spacing(&empty), Err(AnchorError::EmptyCloud), "spacing");
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e51] {
        let points = [[0.0; 3], [1.0, 2.0, bad]];
        let result = AnchorSet::of(&points, &params());
        let located = matches!(result, Err(AnchorError::BadPoint { point: 1, axis: 2, .. }));
        assert!(located, "{bad}: {result:?}");
        let features = [[0.0; 6], [0.0, bad, 0.0, 0.0, 0.0, 0.0]];
        let result = Neighborhoods::build(&[[0.0; 3], [1.0; 3]], Some(&features), &params());
        let located = matches!(result, Err(AnchorError::BadFeature { point: 1, entry: 1, .. }));
        assert!(located, "{bad}: {result:?}");
    }
}

#[test]
fn inputs_of_different_sizes_are_rejected() {
    let points = figure(10, 1);
    let count = Neighborhoods::build(&points, Some(&[[0.0; 6]; 9]), &params());
    assert_eq!(count, Err(AnchorError::FeatureCount { expected: 10, found: 9 }), "features");
    let groups = Neighborhoods::build(&points, None, &params()).unwrap();
    let lines = Lines::sample(&BoundingSphere::of(&points).unwrap(), 10, 0);
    let fewer = AnchorSet::build(&points[..9], &groups, &lines, &params());
    assert!(matches!(fewer, Err(AnchorError::BadNeighborhoods { .. })), "{fewer:?}");
    let set = AnchorSet::build(&points, &groups, &lines, &params()).unwrap();
    assert!(set.owners_or_nearest(&points[..9]).is_err(), "owners of a different cloud");
}

#[test]
fn parameters_out_of_range_are_rejected() {
    let d = AnchorParams::default;
    for (name, bad) in [
        ("k", AnchorParams { k: 65, ..d() }),
        ("max_edge_ratio", AnchorParams { max_edge_ratio: 0.5, ..d() }),
        ("max_edge_ratio", AnchorParams { max_edge_ratio: f64::NAN, ..d() }),
        ("feature_weight", AnchorParams { feature_weight: -1.0, ..d() }),
        ("feature_weight", AnchorParams { feature_weight: f64::NAN, ..d() }),
        ("radius_factor", AnchorParams { radius_factor: 0.0, ..d() }),
        ("radius", AnchorParams { radius: Radius::Fixed(f64::INFINITY), ..d() }),
        ("radius", AnchorParams { radius: Radius::Fixed(-1.0), ..d() }),
        ("num_lines", AnchorParams { num_lines: usize::MAX, ..d() }),
    ] {
        let result = AnchorSet::of(&[[0.0_f64; 3]], &bad);
        let named = matches!(&result, Err(AnchorError::BadParam { name: n, .. }) if *n == name);
        assert!(named, "{name}: {result:?}");
    }
    assert_eq!(d().validate(), Ok(()), "the defaults");
}
