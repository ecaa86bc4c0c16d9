//! Lines: their distribution, counter-based growth, the expected number of hits.

use anchors::{AnchorError, AnchorParams, BoundingSphere, Line, Lines, Neighborhoods};
use anchors::{expected_hits, lines_for_hits};

use crate::scenes::{Vec3, figure};

const SPHERE: BoundingSphere = BoundingSphere { center: [1.0, -2.0, 0.5], radius: 3.0 };

#[test]
fn growing_the_count_keeps_earlier_lines() {
    let long = Lines::sample(&SPHERE, 50_000, 7);
    let short = Lines::sample(&SPHERE, 1234, 7);
    assert_eq!(long.as_slice()[..1234], *short.as_slice(), "the first lines moved");
    let other = Lines::sample(&SPHERE, 1234, 8);
    let same = short.as_slice().iter().zip(other.as_slice()).filter(|(a, b)| a == b).count();
    assert_eq!(same, 0, "lines shared by two seeds");
}

#[test]
fn lines_are_isotropic_and_uniform() {
    let n = 200_000;
    let lines = Lines::sample(&SPHERE, n, 1);
    let mut second = [[0.0; 3]; 3];
    let mut inner = 0;
    let mut mean: Vec3 = [0.0; 3];
    for Line { point, direction } in lines.as_slice() {
        let length: f64 = direction.iter().map(|x| x * x).sum();
        assert!((length - 1.0).abs() < 1e-12, "direction {direction:?} is not of unit length");
        let foot: Vec3 = [0, 1, 2].map(|d| point[d] - SPHERE.center[d]);
        let along: f64 = (0..3).map(|d| foot[d] * direction[d]).sum();
        assert!(along.abs() < 1e-9, "the point is not the middle of the chord: off by {along}");
        for i in 0..3 {
            mean[i] += foot[i] / n as f64;
            for j in 0..3 {
                second[i][j] += direction[i] * direction[j] / n as f64;
            }
        }
        inner +=
            usize::from(foot.iter().map(|x| x * x).sum::<f64>() < (SPHERE.radius / 2.0).powi(2));
    }
    for i in 0..3 {
        assert!(mean[i].abs() < 0.02, "the lines are off centre: {mean:?}");
        for j in 0..3 {
            let expected = if i == j { 1.0 / 3.0 } else { 0.0 };
            assert!(
                (second[i][j] - expected).abs() < 0.005,
                "directions prefer an axis: {second:?}"
            );
        }
    }
    // Convex bodies are hit in proportion to area: a concentric ball of half the radius by 1/4.
    let share = f64::from(u32::try_from(inner).unwrap()) / n as f64;
    assert!((share - 0.25).abs() < 0.004, "a quarter should hit the half ball, found {share}");
}

#[test]
fn hit_counts_agree_with_the_formula() {
    for (n, num_lines) in [(5000, 40_000), (20_000, 80_000)] {
        let points = figure(n, 11);
        let params = AnchorParams::default();
        let sphere = BoundingSphere::of(&points).unwrap();
        let lines = Lines::sample(&sphere, num_lines, 3);
        let groups = Neighborhoods::build(&points, None, &params).unwrap();
        // Counted by definition; a cloud of centroids keeps the product small.
        let edges: f64 = groups
            .iter()
            .map(|g| {
                let [a, b, c] = [0, 1, 2].map(|i| points[g[i] as usize]);
                [(a, b), (a, c), (b, c)]
                    .iter()
                    .map(|(p, q)| crate::scenes::distance2(p, q).sqrt() / 3.0)
                    .sum::<f64>()
            })
            .sum();
        let delta = params.radius_factor * edges / groups.len() as f64;
        let sample: Vec<&[u32]> = groups.iter().step_by(groups.len() / 300).collect();
        let hits: usize = sample
            .iter()
            .map(|members| {
                let hit = |line: &&Line| {
                    let near =
                        |id: &u32| line.distance_squared(&points[*id as usize]) <= delta * delta;
                    members.iter().all(near)
                };
                lines.as_slice().iter().filter(hit).count()
            })
            .sum();
        let found = hits as f64 / sample.len() as f64;
        let expected = expected_hits(num_lines, delta, sphere.radius);
        assert!(
            (found / expected - 1.0).abs() < 0.1,
            "{n} points: {found} hits per triple, expected {expected}"
        );
        let enough = lines_for_hits(found, delta, sphere.radius) as f64;
        assert!((enough / num_lines as f64 - 1.0).abs() < 0.1, "inverse law: {enough} lines");
    }
}

#[test]
fn invalid_lines_are_rejected() {
    let good = Line { point: [0.0; 3], direction: [0.0, 0.0, 1.0] };
    for bad in [
        Line { point: [f64::NAN, 0.0, 0.0], ..good },
        Line { direction: [0.0; 3], ..good },
        Line { direction: [0.0, 2.0, 0.0], ..good },
        Line { direction: [f64::INFINITY, 0.0, 0.0], ..good },
    ] {
        let result = Lines::from_lines(vec![good, bad]);
        assert_eq!(result, Err(AnchorError::BadLine { line: 1 }), "{bad:?}");
    }
    assert_eq!(Lines::from_lines(vec![good]).unwrap().len(), 1, "a good line");
}
