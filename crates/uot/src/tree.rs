//! Points in an order in which neighbours in memory are neighbours in space.
//!
//! A balanced k-d tree whose leaves have exactly [`LANES`] points (the last one may have fewer),
//! stored as one array per axis. Splits compare coordinates only, so the order does not depend on
//! the order of the input; points with identical coordinates are interchangeable.
//!
//! It is not `anchors::KdTree`: sums over the near field need whole leaves of lanes, a box per node
//! and nodes as ranges of leaves, and this crate depends on no other of the workspace.

use crate::simd::{LANES, Lane};
use std::cmp::Ordering;

/// Spatially sorted points and the boxes above them.
#[derive(Debug)]
pub(crate) struct PointTree {
    dim: usize,
    /// `order[k]` is the original id of the point at position `k`.
    pub(crate) order: Vec<u32>,
    /// One array per axis, padded with NaN to whole leaves: every comparison with a padded lane is
    /// false.
    axes: Vec<Vec<Lane>>,
    /// Preorder; the left child of node `x` is `x + 1`.
    nodes: Vec<Node>,
    /// `[node][axis][min, max]`.
    boxes: Vec<[f64; 2]>,
}

/// A contiguous range of leaves.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    pub(crate) first_leaf: u32,
    pub(crate) num_leaves: u32,
    right: u32,
}

impl PointTree {
    /// Sorts the points. They must be finite and fewer than `u32::MAX`.
    pub(crate) fn new<const D: usize>(points: &[[f64; D]]) -> Self {
        let num_leaves = points.len().div_ceil(LANES);
        let num_nodes = 2 * num_leaves - 1;
        let mut order: Vec<u32> = (0..to_u32(points.len())).collect();
        let mut nodes = vec![Node { first_leaf: 0, num_leaves: 0, right: 0 }; num_nodes];
        let mut boxes = vec![[0.0; 2]; num_nodes * D];
        build(points, &mut order, 0, 0, &mut nodes, &mut boxes);
        let axes = (0..D)
            .map(|axis| {
                let mut lanes = vec![[f64::NAN; LANES]; num_leaves];
                for (position, &id) in order.iter().enumerate() {
                    lanes[position / LANES][position % LANES] = points[id as usize][axis];
                }
                lanes
            })
            .collect();
        Self { dim: D, order, axes, nodes, boxes }
    }

    pub(crate) fn len(&self) -> usize {
        self.order.len()
    }

    pub(crate) fn num_leaves(&self) -> usize {
        self.len().div_ceil(LANES)
    }

    pub(crate) fn dim(&self) -> usize {
        self.dim
    }

    /// Coordinates along one axis, grouped by leaf.
    pub(crate) fn axis(&self, axis: usize) -> &[Lane] {
        &self.axes[axis]
    }

    /// Points under a node.
    pub(crate) fn count(&self, node: Node) -> usize {
        let first = node.first_leaf as usize * LANES;
        (first + node.num_leaves as usize * LANES).min(self.len()) - first
    }

    pub(crate) fn node(&self, id: usize) -> Node {
        self.nodes[id]
    }

    /// `[min, max]` per axis.
    pub(crate) fn bounds(&self, id: usize) -> &[[f64; 2]] {
        &self.boxes[id * self.dim..(id + 1) * self.dim]
    }

    /// Calls `visit(node id)` top-down; children follow only where it returns true. Leaves come in
    /// ascending order.
    pub(crate) fn walk(&self, mut visit: impl FnMut(usize) -> bool) {
        let mut stack = vec![0_usize];
        while let Some(id) = stack.pop() {
            if visit(id) && self.nodes[id].num_leaves > 1 {
                stack.push(self.nodes[id].right as usize);
                stack.push(id + 1);
            }
        }
    }

    /// Ids of the largest nodes with at most `max_leaves` leaves, in order.
    pub(crate) fn groups(&self, max_leaves: u32) -> Vec<usize> {
        let mut groups = Vec::new();
        self.walk(|id| {
            let small = self.nodes[id].num_leaves <= max_leaves;
            if small {
                groups.push(id);
            }
            !small
        });
        groups
    }
}

/// Minimum and maximum squared distance between two boxes.
pub(crate) fn box_distances(a: &[[f64; 2]], b: &[[f64; 2]]) -> (f64, f64) {
    let (mut near, mut far) = (0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        let gap = (y[0] - x[1]).max(x[0] - y[1]).max(0.0);
        let reach = (y[1] - x[0]).max(x[1] - y[0]);
        near += gap * gap;
        far += reach * reach;
    }
    (near, far)
}

fn build<const D: usize>(
    points: &[[f64; D]],
    order: &mut [u32],
    first_leaf: usize,
    id: usize,
    nodes: &mut [Node],
    boxes: &mut [[f64; 2]],
) {
    let num_leaves = order.len().div_ceil(LANES);
    let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; D];
    for &point in order.iter() {
        for (bound, &x) in bounds.iter_mut().zip(&points[point as usize]) {
            *bound = [bound[0].min(x), bound[1].max(x)];
        }
    }
    boxes[id * D..(id + 1) * D].copy_from_slice(&bounds);
    let left_leaves = num_leaves.div_ceil(2);
    nodes[id] = Node {
        first_leaf: to_u32(first_leaf),
        num_leaves: to_u32(num_leaves),
        right: to_u32(id + 2 * left_leaves),
    };
    if num_leaves == 1 {
        order.sort_unstable_by(|&p, &q| lexicographic(points, 0, p, q));
        return;
    }
    let mut axis = 0;
    for candidate in 1..D {
        if bounds[candidate][1] - bounds[candidate][0] > bounds[axis][1] - bounds[axis][0] {
            axis = candidate;
        }
    }
    let middle = left_leaves * LANES;
    order.select_nth_unstable_by(middle, |&p, &q| lexicographic(points, axis, p, q));
    let (left, right) = order.split_at_mut(middle);
    build(points, left, first_leaf, id + 1, nodes, boxes);
    build(points, right, first_leaf + left_leaves, id + 2 * left_leaves, nodes, boxes);
}

/// Compares from `axis` on, cyclically, then by id.
fn lexicographic<const D: usize>(points: &[[f64; D]], axis: usize, p: u32, q: u32) -> Ordering {
    let (x, y) = (&points[p as usize], &points[q as usize]);
    for step in 0..D {
        let k = (axis + step) % D;
        let order = x[k].total_cmp(&y[k]);
        if order != Ordering::Equal {
            return order;
        }
    }
    p.cmp(&q)
}

pub(crate) fn to_u32(value: usize) -> u32 {
    u32::try_from(value).expect("sizes are checked at the entry points")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(n: usize) -> Vec<[f64; 3]> {
        (0..n)
            .map(|i| [(i * 7919 % 101) as f64, (i * 104_729 % 97) as f64, (i % 3) as f64])
            .collect()
    }

    #[test]
    fn every_point_occurs_once_and_inside_its_boxes() {
        for n in [1, 7, 8, 9, 17, 64, 65, 1000] {
            let points = cloud(n);
            let tree = PointTree::new(&points);
            let mut ids = tree.order.clone();
            ids.sort_unstable();
            assert!(
                ids.iter().enumerate().all(|(k, &id)| k == id as usize),
                "a permutation, n = {n}"
            );
            let mut total = 0;
            for group in tree.groups(1) {
                let node = tree.node(group);
                total += tree.count(node);
                let first = node.first_leaf as usize * LANES;
                for &id in &tree.order[first..first + tree.count(node)] {
                    for (axis, bound) in tree.bounds(group).iter().enumerate() {
                        let x = points[id as usize][axis];
                        assert!(bound[0] <= x && x <= bound[1], "point {id} leaves its box");
                    }
                }
            }
            assert_eq!(total, n, "leaves partition the points");
        }
    }

    #[test]
    fn order_of_the_input_does_not_matter() {
        let mut points: Vec<[f64; 3]> = (0..500)
            .map(|i| [(f64::from(i) * 0.7).sin(), (f64::from(i) * 1.3).cos(), f64::from(i) * 0.01])
            .collect();
        let sorted = |points: &[[f64; 3]]| -> Vec<[f64; 3]> {
            PointTree::new(points).order.iter().map(|&id| points[id as usize]).collect()
        };
        let before = sorted(&points);
        points.reverse();
        points.swap(3, 77);
        assert_eq!(before, sorted(&points), "same spatial order");
    }

    #[test]
    fn box_distances_bracket_point_distances() {
        let (near, far) = box_distances(&[[0.0, 1.0], [0.0, 1.0]], &[[2.0, 3.0], [0.5, 4.0]]);
        assert!((near - 1.0).abs() < 1e-15 && (far - 25.0).abs() < 1e-15, "{near} {far}");
    }
}
