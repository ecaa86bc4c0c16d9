//! The cylinder test and Eq. 6 against the full product of lines and neighbourhoods.

use anchors::{
    AnchorParams, AnchorSet, BoundingSphere, Grouping, Line, Lines, NO_ANCHOR, NO_LINE,
    Neighborhoods, Radius,
};

use crate::scenes::{Rng, Vec3, cube, distance2, figure, lattice};

fn line_distance(line: &Line, p: &Vec3) -> f64 {
    let v: Vec3 = [0, 1, 2].map(|d| p[d] - line.point[d]);
    let u = line.direction;
    let c = [v[1] * u[2] - v[2] * u[1], v[2] * u[0] - v[0] * u[2], v[0] * u[1] - v[1] * u[0]];
    distance2(&c, &[0.0; 3]).sqrt()
}

fn mean_edge(points: &[Vec3], members: &[u32]) -> f64 {
    let mut edges = Vec::new();
    for (i, a) in members.iter().enumerate() {
        for b in &members[i + 1..] {
            edges.push(distance2(&points[*a as usize], &points[*b as usize]).sqrt());
        }
    }
    edges.iter().sum::<f64>() / edges.len().max(1) as f64
}

/// (neighbourhood, line, position) of every anchor, by the definition.
fn brute(
    points: &[Vec3],
    groups: &Neighborhoods,
    lines: &Lines,
    params: &AnchorParams,
) -> Vec<(usize, u32, Vec3)> {
    let edges: Vec<f64> = groups.iter().map(|g| mean_edge(points, g)).collect();
    let positive: Vec<f64> = edges.iter().copied().filter(|e| *e > 0.0).collect();
    let global = positive.iter().sum::<f64>() / positive.len().max(1) as f64;
    let mut anchors = Vec::new();
    for (i, members) in groups.iter().enumerate() {
        let delta = match params.radius {
            Radius::Global => params.radius_factor * global,
            Radius::Local => params.radius_factor * edges[i],
            Radius::Fixed(delta) => delta,
        };
        let corners: Vec<Vec3> = members.iter().map(|id| points[*id as usize]).collect();
        if delta <= 0.0 || corners.len() == 1 {
            anchors.push((i, NO_LINE, corners[0]));
            continue;
        }
        let mut best: Option<(f64, u32)> = None;
        for (line, id) in lines.as_slice().iter().zip(0..) {
            let far2 = corners.iter().map(|p| line.distance_squared(p)).fold(0.0, f64::max);
            if far2 <= delta * delta && best.is_none_or(|b| far2 < b.0) {
                best = Some((far2, id));
            }
        }
        if let Some((_, id)) = best {
            let line = &lines.as_slice()[id as usize];
            let mut weights: Vec<f64> = corners.iter().map(|p| line_distance(line, p)).collect();
            if weights.iter().sum::<f64>() < 1e-12 * delta {
                weights.fill(1.0);
            }
            let total: f64 = weights.iter().sum();
            let sum = |d: usize| corners.iter().zip(&weights).map(|(p, w)| w * p[d]).sum::<f64>();
            anchors.push((i, id, [0, 1, 2].map(|d| sum(d) / total)));
        }
    }
    anchors
}

fn differs(
    set: &AnchorSet,
    groups: &Neighborhoods,
    expected: &[(usize, u32, Vec3)],
) -> Option<String> {
    if set.len() != expected.len() {
        return Some(format!("{} anchors, expected {}", set.len(), expected.len()));
    }
    for (anchor, (group, line, position)) in expected.iter().enumerate() {
        if set.members.get(anchor) != groups.get(*group) || set.lines[anchor] != *line {
            return Some(format!(
                "anchor {anchor} has line {}, expected {line}",
                set.lines[anchor]
            ));
        }
        // The oracle sums raw coordinates and therefore loses precision far from the origin.
        let rounding = 1e-14 * position.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        if distance2(&set.positions[anchor], position).sqrt() > 1e-12 * set.delta + rounding {
            return Some(format!(
                "anchor {anchor} at {:?}, expected {position:?}",
                set.positions[anchor]
            ));
        }
    }
    None
}

fn check(points: &[Vec3], lines: &Lines, params: &AnchorParams, what: &str) -> AnchorSet {
    let groups = Neighborhoods::build(points, None, params).unwrap();
    let set = AnchorSet::build(points, &groups, lines, params).unwrap();
    let difference = differs(&set, &groups, &brute(points, &groups, lines, params));
    assert_eq!(difference, None, "{what}, {:?}, k = {}", params.radius, params.k);
    check_bookkeeping(points, &groups, &set);
    set
}

fn check_bookkeeping(points: &[Vec3], groups: &Neighborhoods, set: &AnchorSet) {
    let mut uncovered = 0;
    for (id, owner) in (0_u32..).zip(&set.owners) {
        let mut holders = (0..set.len()).filter(|i| set.members.get(*i).contains(&id)).peekable();
        if *owner == NO_ANCHOR {
            uncovered += 1;
            assert_eq!(holders.peek(), None, "point {id} has an anchor but no owner");
            continue;
        }
        let distance = |i: &usize| distance2(&points[id as usize], &set.positions[*i]);
        let nearest = holders.min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)));
        assert_eq!(nearest, Some(*owner as usize), "owner of point {id}");
    }
    assert_eq!(uncovered, set.num_uncovered(), "count of uncovered points");
    let grouped =
        (0..points.len()).filter(|i| groups.indices().iter().any(|id| *id as usize == *i));
    assert_eq!(points.len() - grouped.count(), set.num_ungrouped, "count of ungrouped points");
}

fn sampled(points: &[Vec3], n: usize) -> Lines {
    Lines::sample(&BoundingSphere::of(points).unwrap(), n, 5)
}

#[test]
fn equals_the_full_product() {
    let points = figure(900, 1);
    let lines = sampled(&points, 4000);
    for radius in [Radius::Global, Radius::Local, Radius::Fixed(0.02), Radius::Fixed(0.3)] {
        for (k, grouping) in
            [(2, Grouping::Disjoint), (4, Grouping::Disjoint), (2, Grouping::Overlapping)]
        {
            let params = AnchorParams { k, grouping, radius, ..AnchorParams::default() };
            let set = check(&points, &lines, &params, "figure");
            assert!(set.len() > 10, "{radius:?}: {} anchors prove little", set.len());
        }
    }
}

#[test]
fn equals_the_full_product_for_awkward_clouds() {
    let mut outliers = figure(600, 2);
    outliers.extend([[50.0, 0.0, 0.0], [50.1, 0.0, 0.0], [50.0, 0.1, 0.0], [-1e4, 3.0, 7.0]]);
    let far: Vec<Vec3> = figure(600, 3).iter().map(|p| p.map(|x| x + 1e5)).collect();
    let tiny: Vec<Vec3> = figure(600, 3).iter().map(|p| p.map(|x| x * 1e-20)).collect();
    let sheet: Vec<Vec3> = cube(600, 3).iter().map(|p| [p[0], p[1], 0.0]).collect();
    let mut dense = cube(300, 4);
    dense.extend(cube(300, 5).iter().map(|p| p.map(|x| 0.5 + 1e-6 * x)));
    for (what, points) in [
        ("lattice", lattice(500, 6, 1)),
        ("outliers", outliers),
        ("far from the origin", far),
        ("tiny", tiny),
        ("sheet", sheet),
        ("two densities", dense),
    ] {
        let lines = sampled(&points, 3000);
        for radius in [Radius::Global, Radius::Local] {
            let unrefused =
                AnchorParams { max_edge_ratio: f64::INFINITY, radius, ..AnchorParams::default() };
            check(&points, &lines, &unrefused, what);
            check(&points, &lines, &AnchorParams { radius, ..AnchorParams::default() }, what);
        }
    }
}

#[test]
fn equals_the_full_product_for_lines_along_the_axes() {
    // Lattice points and axis-parallel lines: every walk runs along faces of cells.
    let points = lattice(700, 7, 2);
    let mut rng = Rng::new(6);
    let lines = (0..3000)
        .map(|i| {
            let mut direction = [0.0; 3];
            direction[i % 3] = if i % 2 == 0 { 1.0 } else { -1.0 };
            let point = [0, 1, 2].map(|_| 0.5 * rng.below(15) as f64 - 0.5);
            Line { point, direction }
        })
        .collect();
    let lines = Lines::from_lines(lines).unwrap();
    let set = check(&points, &lines, &AnchorParams::default(), "axes");
    assert!(set.len() > 50, "{} anchors prove little", set.len());
}

#[test]
fn the_comparison_detects_a_single_change() {
    let points = figure(300, 1);
    let (params, lines) = (AnchorParams::default(), sampled(&points, 3000));
    let groups = Neighborhoods::build(&points, None, &params).unwrap();
    let set = AnchorSet::build(&points, &groups, &lines, &params).unwrap();
    let expected = brute(&points, &groups, &lines, &params);
    assert_eq!(differs(&set, &groups, &expected), None, "the set itself");
    let mut moved = set.clone();
    moved.positions[3][1] += 1e-9;
    assert!(differs(&moved, &groups, &expected).is_some(), "a moved anchor");
    let mut other = set.clone();
    other.lines[5] += 1;
    assert!(differs(&other, &groups, &expected).is_some(), "a different line");
}

#[test]
fn retained_triples_lie_in_their_cylinder() {
    let points = figure(5000, 4);
    let set =
        AnchorSet::of(&points, &AnchorParams { num_lines: 50_000, ..Default::default() }).unwrap();
    let lines = sampled(&points, 50_000);
    let lines_of_set = Lines::sample(&BoundingSphere::of(&points).unwrap(), 50_000, 0);
    assert_ne!(lines, lines_of_set, "seeds differ");
    assert!(set.len() > 1000, "{} anchors", set.len());
    for (anchor, members) in set.members.iter().enumerate() {
        let line = &lines_of_set.as_slice()[set.lines[anchor] as usize];
        let far =
            members.iter().map(|id| line_distance(line, &points[*id as usize])).fold(0.0, f64::max);
        assert!(far <= set.delta * (1.0 + 1e-12), "anchor {anchor}: {far} beyond {}", set.delta);
        // The anchor lies in the hull of the triple, so within the largest edge of every member.
        let p = &set.positions[anchor];
        let spread = |id: &u32| distance2(p, &points[*id as usize]).sqrt();
        let widest = members.iter().map(spread).fold(0.0, f64::max);
        assert!(
            widest <= 3.0 * mean_edge(&points, members),
            "anchor {anchor} lies outside its triple"
        );
    }
}

#[test]
fn outliers_have_no_anchor_with_the_global_radius() {
    let mut points = figure(3000, 7);
    let mut rng = Rng::new(9);
    points.extend((0..90).map(|_| [0, 1, 2].map(|_| 2.0 * rng.uniform() - 1.0)));
    let params = AnchorParams { num_lines: 200_000, ..AnchorParams::default() };
    let set = AnchorSet::of(&points, &params).unwrap();
    let covered = |range: std::ops::Range<usize>| {
        let n = range.len() as f64;
        set.owners[range].iter().filter(|owner| **owner != NO_ANCHOR).count() as f64 / n
    };
    let (surface, floaters) = (covered(0..3000), covered(3000..3090));
    assert!(surface > 0.85 && floaters < 0.3, "covered: surface {surface}, floaters {floaters}");
}

#[test]
fn uncovered_points_belong_to_the_nearest_anchor() {
    let points = figure(1500, 8);
    let params = AnchorParams { num_lines: 3000, ..AnchorParams::default() };
    let set = AnchorSet::of(&points, &params).unwrap();
    assert!(
        set.num_unhit > 50 && set.num_ungrouped > 5,
        "nothing is uncovered: {}",
        set.num_uncovered()
    );
    let owners = set.owners_or_nearest(&points).unwrap();
    for (id, (owner, own)) in owners.iter().zip(&set.owners).enumerate() {
        let distance = |i: &u32| distance2(&points[id], &set.positions[*i as usize]);
        let nearest = (0..u32::try_from(set.len()).unwrap())
            .min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)));
        let expected = if *own == NO_ANCHOR { nearest.unwrap() } else { *own };
        assert_eq!(*owner, expected, "point {id}");
    }
}
