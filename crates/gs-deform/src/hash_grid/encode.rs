//! Features of a panel of points: sixteen lattice corners per level, interpolated.
//!
//! Per level, indices and weights of all points are computed first, in vectorised loops; then table
//! entries are gathered and summed point by point.

use super::grid::HashGrid;
use super::level::Level;
use crate::linear::PANEL;

/// Corners of a lattice cell.
const CORNERS: usize = 16;

/// Points of a panel, one array per coordinate; columns without a point hold zeros.
#[derive(Debug, Clone)]
pub(super) struct Points {
    axes: [[f32; PANEL]; 3],
    len: usize,
}

impl Points {
    #[inline(always)]
    pub(super) fn new(coords: &[[f32; 3]]) -> Self {
        let mut axes = [[0.0; PANEL]; 3];
        for (i, point) in coords.iter().enumerate() {
            for d in 0..3 {
                axes[d][i] = point[d];
            }
        }
        Self { axes, len: coords.len() }
    }
}

/// Both neighbours of every point along one coordinate: their terms of the index, and their
/// weights.
#[derive(Debug, Clone, Copy)]
struct Taps<const P: usize> {
    terms: [[u32; P]; 2],
    weights: [[f32; P]; 2],
}

impl<const P: usize> Taps<P> {
    #[inline(always)]
    fn new(level: &Level, d: usize, xs: &[f32; P]) -> Self {
        let mut taps = Self { terms: [[0; P]; 2], weights: [[0.0; P]; 2] };
        for i in 0..P {
            let (cell, frac) = level.locate(xs[i]);
            taps.terms[0][i] = level.term(d, cell);
            taps.terms[1][i] = level.term(d, cell.wrapping_add(1));
            taps.weights[0][i] = 1.0 - frac;
            taps.weights[1][i] = frac;
        }
        taps
    }
}

/// Entries and weights of the corners of every point on one level.
struct Corners {
    indices: [[u32; PANEL]; CORNERS],
    weights: [[f32; PANEL]; CORNERS],
}

impl Corners {
    /// Corners in the order of the reference: x fastest, t slowest.
    #[inline(always)]
    fn fill(&mut self, level: &Level, points: &Points, t: f32) {
        let x = Taps::new(level, 0, &points.axes[0]);
        let y = Taps::new(level, 1, &points.axes[1]);
        let z = Taps::new(level, 2, &points.axes[2]);
        let time = Taps::new(level, 3, &[t]);
        for k in 0..CORNERS {
            let (a, b, c, d) = (k & 1, (k >> 1) & 1, (k >> 2) & 1, k >> 3);
            let (term, weight) = (time.terms[d][0], time.weights[d][0]);
            let (indices, weights) = (&mut self.indices[k], &mut self.weights[k]);
            for i in 0..PANEL {
                let spatial = level.join(level.join(x.terms[a][i], y.terms[b][i]), z.terms[c][i]);
                indices[i] = level.reduce(level.join(spatial, term));
                weights[i] = x.weights[a][i] * y.weights[b][i] * z.weights[c][i] * weight;
            }
        }
    }
}

/// Writes the feature-major panel `[L·F, PANEL]` of points of the unit box at time `t`. Columns
/// without a point are left unchanged.
#[inline(always)]
pub(super) fn encode(grid: &HashGrid, points: &Points, t: f32, out: &mut [f32]) {
    match grid.shape().features {
        1 => body::<1>(grid, points, t, out),
        2 => body::<2>(grid, points, t, out),
        4 => body::<4>(grid, points, t, out),
        _ => body::<8>(grid, points, t, out),
    }
}

#[inline(always)]
fn body<const F: usize>(grid: &HashGrid, points: &Points, t: f32, out: &mut [f32]) {
    let mut corners = Corners { indices: [[0; PANEL]; CORNERS], weights: [[0.0; PANEL]; CORNERS] };
    for (level, out) in grid.levels().iter().zip(out.chunks_exact_mut(F * PANEL)) {
        let (entries, _) = grid.entries(level).as_chunks::<F>();
        corners.fill(level, points, t);
        for i in 0..points.len {
            let mut sum = [0.0; F];
            for k in 0..CORNERS {
                let entry = &entries[corners.indices[k][i] as usize];
                let weight = corners.weights[k][i];
                for f in 0..F {
                    sum[f] += weight * entry[f];
                }
            }
            for f in 0..F {
                out[f * PANEL + i] = sum[f];
            }
        }
    }
}
