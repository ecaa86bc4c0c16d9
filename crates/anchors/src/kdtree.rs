//! Exact nearest neighbours, ties by id.
//!
//! A balanced tree: every node halves its points at the median of its widest axis, so coincident
//! points cost no depth. Nodes lie in preorder, the two subtrees of a node are equal in shape, and
//! leaves are ranges of one array, so nothing but the split planes is stored.

use rayon::prelude::*;
use std::cmp::Ordering;

use crate::points::distance_squared;

/// A neighbour found by a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor {
    /// Squared distance from the query, in the square of the points' unit.
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
    splits: Vec<Split>,
    /// Levels of inner nodes.
    depth: u32,
}

#[derive(Clone, Copy, Debug, Default)]
struct Split {
    value: f64,
    axis: u32,
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
        let mut splits = vec![Split::default(); (1 << depth) - 1];
        build(&mut points, &mut splits);
        let (points, ids) = points.into_iter().unzip();
        Self { points, ids, splits, depth }
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
        self.nearest_except(query, k, u32::MAX, out);
    }

    /// [`Self::nearest`] without the point `except`.
    pub(crate) fn nearest_except(
        &self,
        query: &[f64; D],
        k: usize,
        except: u32,
        out: &mut Vec<Neighbor>,
    ) {
        out.clear();
        if k == 0 {
            return;
        }
        let mut search = Search { tree: self, query, k, except, best: out, limit: f64::INFINITY };
        search.visit(0, self.depth, 0, self.points.len(), [0.0; D], 0.0);
        if k > ORDERED {
            search.drop_farther();
            out.sort_unstable_by(Neighbor::order);
        }
    }

    /// Calls `each` with the number of every query and the `k` points nearest to it, as
    /// [`Self::nearest`] finds them, and collects what it returns in the order of `queries`.
    /// Queries that lie together run together, so that they share cache lines.
    pub fn map<R: Send>(
        &self,
        queries: &[[f64; D]],
        k: usize,
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
                    self.nearest(&queries[i as usize], k, found);
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

    /// Number of the leaf in whose region `x` lies, in preorder.
    fn leaf(&self, x: &[f64; D]) -> u32 {
        let mut node = 0;
        for depth in (0..self.depth).rev() {
            let Split { value, axis } = self.splits[node];
            node += if x[axis as usize] < value { 1 } else { 1 << depth };
        }
        node as u32
    }

    /// The `k` nearest others of every point, `[N,k]`, each list in ascending order of (distance,
    /// id). There must be more than `k` points.
    pub(crate) fn all_nearest(&self, k: usize) -> Vec<Neighbor> {
        let query = |found: &mut Vec<Neighbor>, (points, ids): (&[[f64; D]], &[u32])| {
            let mut lists = Vec::with_capacity(k * points.len());
            for (point, id) in points.iter().zip(ids) {
                self.nearest_except(point, k, *id, found);
                lists.extend_from_slice(found);
            }
            lists
        };
        let blocks = self.points.par_chunks(QUERY_BLOCK).zip(self.ids.par_chunks(QUERY_BLOCK));
        let blocks: Vec<Vec<Neighbor>> = blocks.map_init(Vec::new, query).collect();
        let mut by_id = vec![Neighbor { distance_squared: 0.0, id: 0 }; k * self.points.len()];
        if k > 0 {
            let lists = blocks.iter().flat_map(|block| block.chunks_exact(k));
            for (id, list) in self.ids.iter().zip(lists) {
                by_id[*id as usize * k..][..k].copy_from_slice(list);
            }
        }
        by_id
    }

    /// Calls `each` with the id of every point of the tree and its `k` nearest others, and
    /// collects what it returns by id. Runs in leaf order, so that queries share cache lines.
    pub(crate) fn map_nearest<R: Send + Default + Clone>(
        &self,
        k: usize,
        each: impl Fn(u32, &[Neighbor]) -> R + Sync,
    ) -> Vec<R> {
        let query = |found: &mut Vec<Neighbor>, (points, ids): (&[[f64; D]], &[u32])| {
            let one = |(point, id): (&[f64; D], &u32)| {
                self.nearest_except(point, k, *id, found);
                each(*id, found)
            };
            points.iter().zip(ids).map(one).collect()
        };
        let blocks = self.points.par_chunks(QUERY_BLOCK).zip(self.ids.par_chunks(QUERY_BLOCK));
        let blocks: Vec<Vec<R>> = blocks.map_init(Vec::new, query).collect();
        let mut by_id = vec![R::default(); self.points.len()];
        for (id, value) in self.ids.iter().zip(blocks.into_iter().flatten()) {
            by_id[*id as usize] = value;
        }
        by_id
    }
}

fn build<const D: usize>(points: &mut [([f64; D], u32)], splits: &mut [Split]) {
    let Some((root, rest)) = splits.split_first_mut() else { return };
    let axis = widest_axis(points);
    let mid = points.len() / 2;
    points.select_nth_unstable_by(mid, |a, b| a.0[axis].total_cmp(&b.0[axis]));
    *root = Split { value: points[mid].0[axis], axis: axis as u32 };
    let (low, high) = points.split_at_mut(mid);
    let (left, right) = rest.split_at_mut(rest.len() / 2);
    if low.len() < PARALLEL_BUILD {
        build(low, left);
        build(high, right);
    } else {
        rayon::join(|| build(low, left), || build(high, right));
    }
}

fn widest_axis<const D: usize>(points: &[([f64; D], u32)]) -> usize {
    let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
    for (p, _) in points {
        for d in 0..D {
            low[d] = low[d].min(p[d]);
            high[d] = high[d].max(p[d]);
        }
    }
    (0..D).fold(0, |best, d| if high[d] - low[d] > high[best] - low[best] { d } else { best })
}

struct Search<'a, const D: usize> {
    tree: &'a KdTree<D>,
    query: &'a [f64; D],
    k: usize,
    except: u32,
    /// Best neighbours so far: in ascending order, or up to twice the requested number in any
    /// order.
    best: &'a mut Vec<Neighbor>,
    /// Squared distance beyond which nothing is among the `k` nearest.
    limit: f64,
}

impl<const D: usize> Search<'_, D> {
    /// Visits the subtree at `node` with `depth` inner levels over `points[from..to]`. `offset` is
    /// the vector from the query to the node's region, `bound` its squared length.
    fn visit(
        &mut self,
        node: usize,
        depth: u32,
        from: usize,
        to: usize,
        offset: [f64; D],
        bound: f64,
    ) {
        // At a bound equal to the worst distance, there may still be a point with a lower id.
        if bound > self.limit {
            return;
        }
        if depth == 0 {
            self.scan(from, to);
            return;
        }
        let Split { value, axis } = self.tree.splits[node];
        let axis = axis as usize;
        let mid = from + (to - from) / 2;
        let (left, right) = (node + 1, node + (1 << (depth - 1)));
        let gap = self.query[axis] - value;
        let mut far_offset = offset;
        far_offset[axis] = gap;
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
                self.best.push(found);
                continue;
            }
            if self.best.len() < self.k {
                self.best.push(found);
            } else if !found.before(&self.best[self.k - 1]) {
                continue;
            }
            let mut place = self.best.len() - 1;
            while place > 0 && found.before(&self.best[place - 1]) {
                self.best[place] = self.best[place - 1];
                place -= 1;
            }
            self.best[place] = found;
            if self.best.len() == self.k {
                self.limit = self.best[self.k - 1].distance_squared;
            }
        }
        if self.best.len() >= 2 * self.k {
            self.drop_farther();
        }
    }

    /// Keeps the `k` nearest of the collected neighbours.
    fn drop_farther(&mut self) {
        if self.best.len() >= self.k {
            let (_, last, _) = self.best.select_nth_unstable_by(self.k - 1, Neighbor::order);
            self.limit = last.distance_squared;
            self.best.truncate(self.k);
        }
    }
}
