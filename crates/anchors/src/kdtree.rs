//! Exact nearest neighbours, ties by id.
//!
//! A balanced tree: every node halves its points at the median of its widest axis, so coincident
//! points cost no depth. Nodes lie in preorder, the two subtrees of a node are equal in shape, and
//! leaves are ranges of one array.
//!
//! A search skips a node by its split planes, which costs one comparison, or else by its bounding
//! box: if points lie on a surface, a query next to it is near the planes of many nodes but near
//! the boxes of few.

use rayon::prelude::*;
use std::cmp::Ordering;

use crate::points::distance_squared;

/// A neighbour found by a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor {
    /// Squared distance from the query, square of the points' unit.
    pub distance_squared: f64,
    /// Index of the point in the slice the tree was built from.
    pub id: u32,
}

impl Neighbor {
    #[inline]
    fn before(&self, other: &Self) -> bool {
        self.distance_squared < other.distance_squared
            || (self.distance_squared == other.distance_squared && self.id < other.id)
    }

    #[inline]
    fn order(&self, other: &Self) -> Ordering {
        self.distance_squared.total_cmp(&other.distance_squared).then(self.id.cmp(&other.id))
    }
}

/// A k-d tree over points `[N,D]`, immutable; queries may run on many threads.
#[derive(Clone, Debug)]
pub struct KdTree<const D: usize> {
    /// Points in leaf order.
    points: Vec<[f64; D]>,
    /// Their ids.
    ids: Vec<u32>,
    /// Inner nodes and leaves.
    nodes: Vec<Node<D>>,
    /// Levels of inner nodes.
    depth: u32,
}

#[derive(Clone, Copy, Debug)]
struct Node<const D: usize> {
    bounds: Bounds<D>,
    /// Where an inner node is split, and the axis.
    split: f64,
    axis: usize,
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
struct Bounds<const D: usize> {
    low: [f64; D],
    high: [f64; D],
}

impl<const D: usize> Bounds<D> {
    /// The smallest box around `points`.
    fn of<'a>(points: impl Iterator<Item = &'a [f64; D]>) -> Self {
        let mut bounds = Self { low: [f64::INFINITY; D], high: [f64::NEG_INFINITY; D] };
        for point in points {
            for d in 0..D {
                bounds.low[d] = bounds.low[d].min(point[d]);
                bounds.high[d] = bounds.high[d].max(point[d]);
            }
        }
        bounds
    }

    /// Squared distance from a point. In the order of [`distance_squared`], so that rounding never
    /// pushes it above the distance of a point in the box.
    #[inline]
    fn distance_squared(&self, x: &[f64; D]) -> f64 {
        let mut sum = 0.0;
        for d in 0..D {
            let gap = (self.low[d] - x[d]).max(x[d] - self.high[d]).max(0.0);
            sum += gap * gap;
        }
        sum
    }

    fn widest_axis(&self) -> usize {
        let width = |d: usize| self.high[d] - self.low[d];
        (0..D).fold(0, |widest, d| if width(d) > width(widest) { d } else { widest })
    }
}

/// Maximum number of points of a leaf.
const LEAF: usize = 8;

/// Subtrees below this many points are built on one thread.
const PARALLEL_BUILD: usize = 8192;

/// Largest `k` for which neighbours are kept sorted while searching. For larger `k`, twice as many
/// are collected before the farther half is dropped, which costs O(1) per neighbour instead of
/// O(k).
const ORDERED: usize = 40;

/// Queries per task.
const QUERY_BLOCK: usize = 512;

impl<const D: usize> KdTree<D> {
    /// Builds the tree in O(N log N). Coordinates must be finite for meaningful results.
    ///
    /// # Panics
    /// If there are more points than 32-bit ids can represent.
    pub fn new(points: &[[f64; D]]) -> Self {
        assert!(u32::try_from(points.len()).is_ok(), "{} points: ids are 32 bits", points.len());
        let mut depth = 0;
        while points.len() > LEAF << depth {
            depth += 1;
        }
        let mut points: Vec<([f64; D], u32)> = points.iter().copied().zip(0..).collect();
        let empty = Node { bounds: Bounds::of([].iter()), split: 0.0, axis: 0 };
        let mut nodes = vec![empty; (2 << depth) - 1];
        build(&mut points, &mut nodes);
        let (points, ids) = points.into_iter().unzip();
        Self { points, ids, nodes, depth }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether the tree has no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The `k` points nearest to `query` (all, if there are fewer), in ascending order of
    /// (distance, id); `out` is cleared first. Ties at the last place go to the lowest ids.
    pub fn nearest(&self, query: &[f64; D], k: usize, out: &mut Vec<Neighbor>) {
        self.search(query, k, (u32::MAX, f64::INFINITY), out);
    }

    /// [`Self::nearest`] without the point `except`, and within the squared distance `limit`.
    fn search(
        &self,
        query: &[f64; D],
        k: usize,
        (except, limit): (u32, f64),
        out: &mut Vec<Neighbor>,
    ) {
        out.clear();
        if k == 0 {
            return;
        }
        let mut search = Search { tree: self, query, k, except, found: out, limit };
        search.visit(0, self.depth, 0, self.points.len(), [0.0; D], 0.0);
        if k > ORDERED {
            search.drop_farther();
            out.sort_unstable_by(Neighbor::order);
        }
    }

    /// Calls `each` with the index of every query and the `k` points nearest to it, as
    /// [`Self::nearest`] finds them. Returns the results in the order of `queries`. Queries that
    /// are close to each other run together, so that they share cache lines.
    pub fn map<R: Send>(
        &self,
        queries: &[[f64; D]],
        k: usize,
        each: impl Fn(usize, &[Neighbor]) -> R + Sync,
    ) -> Vec<R> {
        self.map_within(queries, k, f64::INFINITY, each)
    }

    /// [`Self::map`] with neighbours up to `distance` (inclusive) only, unit of the points. Shorter
    /// distances are faster.
    pub fn map_within<R: Send>(
        &self,
        queries: &[[f64; D]],
        k: usize,
        distance: f64,
        each: impl Fn(usize, &[Neighbor]) -> R + Sync,
    ) -> Vec<R> {
        let mut order: Vec<(u32, u32)> = queries
            .par_iter()
            .zip(0_u32..queries.len() as u32)
            .map(|(x, i)| (self.leaf(x), i))
            .collect();
        order.par_sort_unstable();
        let blocks: Vec<Vec<(u32, R)>> = order
            .par_chunks(QUERY_BLOCK)
            .map_init(Vec::new, |found, block| {
                let query = |&(_, i): &(u32, u32)| {
                    self.search(&queries[i as usize], k, (u32::MAX, distance * distance), found);
                    (i, each(i as usize, found))
                };
                block.iter().map(query).collect()
            })
            .collect();
        let mut in_order: Vec<Option<R>> = (0..queries.len()).map(|_| None).collect();
        for (i, value) in blocks.into_iter().flatten() {
            in_order[i as usize] = Some(value);
        }
        in_order.into_iter().flatten().collect()
    }

    /// Whether a point is within `distance` (inclusive) of `query`, in the points' unit.
    pub fn any_within(&self, query: &[f64; D], distance: f64) -> bool {
        let limit = distance * distance;
        let mut subtrees = vec![(0, self.depth, 0, self.points.len())];
        while let Some((node, depth, from, to)) = subtrees.pop() {
            let Node { bounds, split, axis } = &self.nodes[node];
            if bounds.distance_squared(query) > limit {
                continue;
            }
            if depth == 0 {
                if self.points[from..to].iter().any(|x| distance_squared(query, x) <= limit) {
                    return true;
                }
                continue;
            }
            let mid = from + (to - from) / 2;
            let left = (node + 1, depth - 1, from, mid);
            let right = (node + (1 << depth), depth - 1, mid, to);
            // The child on the query's side is popped first.
            let order = if query[*axis] < *split { [right, left] } else { [left, right] };
            subtrees.extend(order);
        }
        false
    }

    /// Index of the leaf of the half-spaces that contain `x`, in preorder.
    fn leaf(&self, x: &[f64; D]) -> u32 {
        let mut node = 0;
        for depth in (1..=self.depth).rev() {
            let Node { split, axis, .. } = self.nodes[node];
            node += if x[axis] < split { 1 } else { 1 << depth };
        }
        node as u32
    }

    /// Ids of the points in leaf order, `[N]`.
    pub(crate) fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Ids of the `k` nearest others of every point in leaf order, `[N,k]`, each list in ascending
    /// order of (distance, id). There must be more than `k` points.
    pub(crate) fn all_nearest(&self, k: usize) -> Vec<u32> {
        let mut lists = vec![0; k * self.points.len()];
        if k > 0 {
            let points = self.points.par_iter().zip(&self.ids).zip(lists.par_chunks_mut(k));
            points.with_min_len(QUERY_BLOCK).for_each_init(
                Vec::new,
                |found, ((point, id), list)| {
                    self.search(point, k, (*id, f64::INFINITY), found);
                    for (slot, neighbor) in list.iter_mut().zip(found) {
                        *slot = neighbor.id;
                    }
                },
            );
        }
        lists
    }

    /// Calls `each` with the `k` nearest others of every point of the tree, and returns the results
    /// in the order of ids. Runs in leaf order, so that queries share cache lines.
    pub(crate) fn map_nearest<R: Send + Default + Clone>(
        &self,
        k: usize,
        each: impl Fn(&[Neighbor]) -> R + Sync,
    ) -> Vec<R> {
        let points = self.points.par_iter().zip(&self.ids).with_min_len(QUERY_BLOCK);
        let results: Vec<R> = points
            .map_init(Vec::new, |found, (point, id)| {
                self.search(point, k, (*id, f64::INFINITY), found);
                each(found)
            })
            .collect();
        let mut by_id = vec![R::default(); self.points.len()];
        for (id, value) in self.ids.iter().zip(results) {
            by_id[*id as usize] = value;
        }
        by_id
    }
}

/// Orders `points` and fills `nodes`, as many as a tree of their depth has.
fn build<const D: usize>(points: &mut [([f64; D], u32)], nodes: &mut [Node<D>]) {
    let Some((root, rest)) = nodes.split_first_mut() else { return };
    root.bounds = Bounds::of(points.iter().map(|(point, _)| point));
    if rest.is_empty() {
        return;
    }
    let axis = root.bounds.widest_axis();
    let mid = points.len() / 2;
    points.select_nth_unstable_by(mid, |a, b| a.0[axis].total_cmp(&b.0[axis]));
    (root.split, root.axis) = (points[mid].0[axis], axis);
    let (low, high) = points.split_at_mut(mid);
    let (left, right) = rest.split_at_mut(rest.len() / 2);
    if low.len() < PARALLEL_BUILD {
        build(low, left);
        build(high, right);
    } else {
        rayon::join(|| build(low, left), || build(high, right));
    }
}

struct Search<'a, const D: usize> {
    tree: &'a KdTree<D>,
    query: &'a [f64; D],
    k: usize,
    except: u32,
    /// Nearest neighbours so far: in ascending order, or up to twice the requested number in any
    /// order.
    found: &'a mut Vec<Neighbor>,
    /// Squared distance beyond which nothing is among the `k` nearest.
    limit: f64,
}

impl<const D: usize> Search<'_, D> {
    /// Visits the subtree at `node` with `depth` inner levels over `points[from..to]`. `offset` is
    /// the vector from the query to the part of space that the split planes leave to it, `bound`
    /// its squared length.
    fn visit(
        &mut self,
        node: usize,
        depth: u32,
        from: usize,
        to: usize,
        offset: [f64; D],
        bound: f64,
    ) {
        let Node { bounds, split, axis } = &self.tree.nodes[node];
        // At a bound equal to the worst distance, there may still be a point with a lower id.
        if bound > self.limit || (bound > 0.0 && bounds.distance_squared(self.query) > self.limit) {
            return;
        }
        if depth == 0 {
            self.scan(from, to);
            return;
        }
        let mid = from + (to - from) / 2;
        let (left, right) = (node + 1, node + (1 << depth));
        let gap = self.query[*axis] - split;
        let mut far_offset = offset;
        far_offset[*axis] = gap;
        // Recomputed in the order of `distance_squared`, so that rounding never pushes the bound of
        // a region above the distance of a point in it.
        let far_bound = far_offset.iter().fold(0.0, |sum, x| sum + x * x);
        if gap < 0.0 {
            self.visit(left, depth - 1, from, mid, offset, bound);
            self.visit(right, depth - 1, mid, to, far_offset, far_bound);
        } else {
            self.visit(right, depth - 1, mid, to, offset, bound);
            self.visit(left, depth - 1, from, mid, far_offset, far_bound);
        }
    }

    fn scan(&mut self, from: usize, to: usize) {
        for (point, id) in self.tree.points[from..to].iter().zip(&self.tree.ids[from..to]) {
            let distance_squared = distance_squared(self.query, point);
            if distance_squared > self.limit || *id == self.except {
                continue;
            }
            let found = Neighbor { distance_squared, id: *id };
            if self.k > ORDERED {
                self.found.push(found);
                continue;
            }
            if self.found.len() < self.k {
                self.found.push(found);
            } else if !found.before(&self.found[self.k - 1]) {
                continue;
            }
            let mut place = self.found.len() - 1;
            while place > 0 && found.before(&self.found[place - 1]) {
                self.found[place] = self.found[place - 1];
                place -= 1;
            }
            self.found[place] = found;
            if self.found.len() == self.k {
                self.limit = self.found[self.k - 1].distance_squared;
            }
        }
        if self.found.len() >= 2 * self.k {
            self.drop_farther();
        }
    }

    /// Keeps the `k` nearest of the collected neighbours.
    fn drop_farther(&mut self) {
        if self.found.len() >= self.k {
            let (_, last, _) = self.found.select_nth_unstable_by(self.k - 1, Neighbor::order);
            self.limit = last.distance_squared;
            self.found.truncate(self.k);
        }
    }
}
