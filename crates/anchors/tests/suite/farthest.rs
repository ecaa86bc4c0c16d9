//! Farthest-point sampling against its definition.

use anchors::{AnchorError, AnchorSet, NO_ANCHOR};

use crate::scenes::figure;

fn distance2(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

#[test]
fn every_anchor_is_the_farthest_point() {
    let points = figure(1500, 3);
    let set = AnchorSet::farthest(&points, 200).unwrap();
    assert_eq!(set.len(), 200, "the requested number");
    let to_set = |point: &[f64; 3], anchors: &[[f64; 3]]| {
        anchors.iter().map(|anchor| distance2(anchor, point)).fold(f64::INFINITY, f64::min)
    };
    for k in 1..set.len() {
        let before = &set.positions[..k];
        let largest = points.iter().map(|p| to_set(p, before)).fold(0.0, f64::max);
        assert!(to_set(&set.positions[k], before) >= largest, "anchor {k}");
    }
    let covering = points.iter().map(|p| to_set(p, &set.positions)).fold(0.0, f64::max);
    assert!((set.delta - covering.sqrt()).abs() < 1e-12, "covering radius");
    for (point, &owner) in points.iter().zip(&set.owners) {
        assert!(owner != NO_ANCHOR, "every point is covered");
        let own = distance2(point, &set.positions[owner as usize]);
        assert!(own <= to_set(point, &set.positions), "by its nearest anchor");
    }
    assert_eq!(set.members.indices().len(), points.len(), "every point is a member once");
}

#[test]
fn order_of_the_points_does_not_matter() {
    let points = figure(700, 5);
    let reversed: Vec<[f64; 3]> = points.iter().rev().copied().collect();
    let (x, y) =
        (AnchorSet::farthest(&points, 90).unwrap(), AnchorSet::farthest(&reversed, 90).unwrap());
    assert_eq!(x.positions, y.positions, "the same anchors in the same order");
}

#[test]
fn degenerate_clouds_have_results() {
    let coincident = [[1.0, 2.0, 3.0]; 70];
    let set = AnchorSet::farthest(&coincident, 9).unwrap();
    assert_eq!((set.len(), set.delta), (1, 0.0), "one place, one anchor");
    let two = AnchorSet::farthest(&[[0.0; 3], [1.0, 0.0, 0.0]], 9).unwrap();
    assert_eq!(two.len(), 2, "no more anchors than points");
    let empty: [[f64; 3]; 0] = [];
    assert_eq!(AnchorSet::farthest(&empty, 1).unwrap_err(), AnchorError::EmptyCloud, "no points");
    let error = AnchorSet::farthest(&coincident, 0).unwrap_err().to_string();
    assert!(error.contains("count"), "{error}");
    let error = AnchorSet::farthest(&[[f64::NAN; 3]], 1).unwrap_err().to_string();
    assert!(error.contains("NaN"), "{error}");
}
