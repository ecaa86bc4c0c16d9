//! `K = c·11ᵀ + S` with the near field S stored as dense 8×8 blocks.
//!
//! Both products read the same blocks in the same order: rows accumulate across a row of blocks,
//! columns are scattered into one buffer per chunk of rows, and the buffers are added in chunk
//! order. There is no transpose, no index per entry, and the result does not depend on the number
//! of threads.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

use super::gibbs::{Kernel, chunk_len, largest};
use crate::UotError;
use crate::near::{Block, NearField};
use crate::simd::{LANES, Lane, dispatch, exp, exp_shifted, fold, sum};
use rayon::prelude::*;

/// Maximum number of entries of S.
pub(crate) const MAX_NEAR_ENTRIES: usize = 1 << 31;

/// Stored number format; arithmetic is always f64.
pub(crate) trait Entry: Copy + Send + Sync {
    fn pack(value: f64) -> Self;
    fn widen(self) -> f64;
}

impl Entry for f64 {
    #[inline(always)]
    fn pack(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn widen(self) -> f64 {
        self
    }
}

impl Entry for f32 {
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "f32 storage was requested")]
    fn pack(value: f64) -> Self {
        value as Self
    }
    #[inline(always)]
    fn widen(self) -> f64 {
        f64::from(self)
    }
}

type Packed<T> = [[T; LANES]; LANES];

/// The blocks of consecutive row leaves.
#[derive(Debug)]
struct Chunk<T> {
    first_leaf: usize,
    /// Blocks of row leaf `first_leaf + k` are `starts[k]..starts[k + 1]`.
    starts: Vec<usize>,
    /// Column leaf of each block.
    col_leaves: Vec<u32>,
    blocks: Vec<Packed<T>>,
    /// First column leaf that any block touches, and sums for it and the following ones.
    first_touched: usize,
    scattered: Vec<Lane>,
}

/// The structured kernel, in the order of the two trees.
#[derive(Debug)]
pub(crate) struct BlockKernel<T> {
    chunks: Vec<Chunk<T>>,
    /// Value of a far pair, `e^{−1/λ0}`.
    background: f64,
    leaves_per_chunk: usize,
    row_lanes: Vec<Lane>,
    col_lanes: Vec<Lane>,
}

impl<T: Entry> BlockKernel<T> {
    pub(crate) fn new(field: &NearField<'_>, lambda_ent: f64) -> Result<Self, UotError> {
        let num_leaves = field.rows.num_leaves();
        let leaves_per_chunk = chunk_len(num_leaves, 4);
        let leaf_nodes = field.rows.groups(1);
        let chunk_nodes: Vec<&[usize]> = leaf_nodes.chunks(leaves_per_chunk).collect();
        let counts: Vec<usize> = chunk_nodes
            .par_iter()
            .map(|nodes| {
                let mut near = Vec::new();
                let mut count = 0;
                for &node in *nodes {
                    field.col_leaves_near(field.rows.bounds(node), &mut near);
                    count += near.len();
                }
                count
            })
            .collect();
        let needed = counts.iter().sum::<usize>() * LANES * LANES;
        if needed > MAX_NEAR_ENTRIES {
            let what = "the near field (lower the cutoff or the bandwidth)";
            return Err(UotError::TooLarge { what, needed, limit: MAX_NEAR_ENTRIES });
        }
        let background = (-1.0 / lambda_ent).exp();
        let chunks = chunk_nodes
            .par_iter()
            .zip(&counts)
            .enumerate()
            .map(|(k, (nodes, &count))| {
                Chunk::new(
                    field,
                    k * leaves_per_chunk,
                    nodes,
                    count,
                    lambda_ent.recip(),
                    background,
                )
            })
            .collect();
        let row_lanes = vec![[0.0; LANES]; num_leaves];
        let col_lanes = vec![[0.0; LANES]; field.cols.num_leaves()];
        Ok(Self { chunks, background, leaves_per_chunk, row_lanes, col_lanes })
    }

    /// Stored entries, zeros inside blocks included.
    pub(crate) fn num_entries(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.blocks.len() * LANES * LANES).sum()
    }
}

impl<T: Entry> Chunk<T> {
    fn new(
        field: &NearField<'_>,
        first_leaf: usize,
        nodes: &[usize],
        capacity: usize,
        inverse_lambda: f64,
        background: f64,
    ) -> Self {
        let mut chunk = Self {
            first_leaf,
            starts: vec![0],
            col_leaves: Vec::with_capacity(capacity),
            blocks: Vec::with_capacity(capacity),
            first_touched: 0,
            scattered: Vec::new(),
        };
        let mut near = Vec::new();
        for (k, &node) in nodes.iter().enumerate() {
            field.col_leaves_near(field.rows.bounds(node), &mut near);
            dispatch(
                #[inline(always)]
                || chunk.push_row(field, first_leaf + k, &near, inverse_lambda, background),
            );
            chunk.starts.push(chunk.blocks.len());
        }
        let first = chunk.col_leaves.iter().min().map_or(0, |&leaf| leaf as usize);
        let end = chunk.col_leaves.iter().max().map_or(0, |&leaf| leaf as usize + 1);
        chunk.first_touched = first;
        chunk.scattered = vec![[0.0; LANES]; end - first];
        chunk
    }

    #[inline(always)]
    fn push_row(
        &mut self,
        field: &NearField<'_>,
        row_leaf: usize,
        near: &[u32],
        inverse_lambda: f64,
        background: f64,
    ) {
        let mut block: Block = [[0.0; LANES]; LANES];
        for &col_leaf in near {
            if !field.exponents(row_leaf, col_leaf as usize, &mut block) {
                continue;
            }
            // two flat loops: nested ones would be unrolled before they could be vectorised
            for value in block.as_flattened_mut() {
                *value = exp(-*value);
            }
            let mut packed = [[T::pack(0.0); LANES]; LANES];
            for (entry, &w) in packed.as_flattened_mut().iter_mut().zip(block.as_flattened()) {
                // the difference is as exact, relative to K, as the exponential itself
                let value = exp((w - 1.0) * inverse_lambda) - background;
                *entry = T::pack(if w > 0.0 { value.max(0.0) } else { 0.0 });
            }
            self.col_leaves.push(col_leaf);
            self.blocks.push(packed);
        }
    }

    /// Lanes of `S x` for the rows of this chunk, not yet summed: summing here would make the
    /// compiler transpose every block.
    #[inline(always)]
    fn rows(&self, x: &[Lane], sums: &mut [Block]) {
        for (k, sums) in sums.iter_mut().enumerate() {
            let range = self.starts[k]..self.starts[k + 1];
            let mut acc = [[0.0; LANES]; LANES];
            for (block, &leaf) in self.blocks[range.clone()].iter().zip(&self.col_leaves[range]) {
                let x = x[leaf as usize];
                for (acc, row) in acc.iter_mut().zip(block) {
                    *acc = std::array::from_fn(|j| row[j].widen().mul_add(x[j], acc[j]));
                }
            }
            *sums = acc;
        }
    }

    /// `scattered = Sᵀ x` over the rows of this chunk.
    #[inline(always)]
    fn cols(&mut self, x: &[Lane]) {
        self.scattered.fill([0.0; LANES]);
        for k in 0..self.starts.len() - 1 {
            let x = x[self.first_leaf + k];
            let range = self.starts[k]..self.starts[k + 1];
            for (block, &leaf) in self.blocks[range.clone()].iter().zip(&self.col_leaves[range]) {
                let out = &mut self.scattered[leaf as usize - self.first_touched];
                let mut acc = *out;
                for i in 0..LANES {
                    for j in 0..LANES {
                        acc[j] = block[i][j].widen().mul_add(x[i], acc[j]);
                    }
                }
                *out = acc;
            }
        }
    }
}

impl<T: Entry> Kernel for BlockKernel<T> {
    fn rows(&mut self, x: &[f64], out: &mut [f64]) {
        let shift = largest(x);
        exp_shifted(x, shift, &mut self.col_lanes.as_flattened_mut()[..x.len()]);
        let lanes = &self.col_lanes;
        let constant = self.background * sum(lanes.as_flattened());
        out.par_chunks_mut(self.leaves_per_chunk * LANES).zip(&self.chunks).for_each(
            |(out, chunk)| {
                let mut sums = vec![[[0.0; LANES]; LANES]; chunk.starts.len() - 1];
                dispatch(
                    #[inline(always)]
                    || chunk.rows(lanes, &mut sums),
                );
                for (value, &lanes) in out.iter_mut().zip(sums.as_flattened()) {
                    *value = (fold(lanes) + constant).ln() + shift;
                }
            },
        );
    }

    fn cols(&mut self, x: &[f64], out: &mut [f64]) {
        let shift = largest(x);
        exp_shifted(x, shift, &mut self.row_lanes.as_flattened_mut()[..x.len()]);
        let lanes = &self.row_lanes;
        let constant = self.background * sum(lanes.as_flattened());
        self.chunks.par_iter_mut().for_each(|chunk| {
            dispatch(
                #[inline(always)]
                || chunk.cols(lanes),
            );
        });
        let chunks = &self.chunks;
        let stripe = chunk_len(out.len().div_ceil(LANES), 16);
        out.par_chunks_mut(stripe * LANES).enumerate().for_each(|(k, out)| {
            let first = k * stripe;
            let end = first + out.len().div_ceil(LANES);
            let mut total = vec![[constant; LANES]; end - first];
            for chunk in chunks {
                let from = first.max(chunk.first_touched);
                let to = end.min(chunk.first_touched + chunk.scattered.len());
                for leaf in from..to.max(from) {
                    let add = chunk.scattered[leaf - chunk.first_touched];
                    for lane in 0..LANES {
                        total[leaf - first][lane] += add[lane];
                    }
                }
            }
            for (value, &total) in out.iter_mut().zip(total.as_flattened()) {
                *value = total.ln() + shift;
            }
        });
    }
}
