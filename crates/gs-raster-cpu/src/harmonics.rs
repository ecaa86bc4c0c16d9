//! Spherical harmonics of a group of splats: colours, and gradients of coefficients and directions.

use crate::lanes::Lane;
use crate::vector::{Quad, Vector};
use crate::view::{dot, each};
use gs_core::{Ring, Splats, sh};
use pulp::Simd;

/// Number of terms whose values in three channels fill whole quads.
const BLOCK: usize = 4;

/// Prefetches the coefficients of the splats `first + i`: in a loop
/// without other work, the cache misses overlap.
#[inline(always)]
pub(crate) fn touch<F: Lane>(splats: &Splats<F>, first: usize, list: &[usize]) {
    let coeffs = splats.sh_coeffs();
    let mut sum = [F::zero(); 3];
    for &i in list {
        let row = &splats.sh[(first + i) * coeffs..(first + i + 1) * coeffs];
        // Approximately one value per cache line.
        for (line, sum) in sum.iter_mut().enumerate() {
            *sum += row[line * coeffs / 3][0];
        }
    }
    std::hint::black_box(sum);
}

/// Coefficients of a group of splats, or their gradients, side by side: each splat's row of `[K,3]`
/// values, four at a time, padded with zeros.
#[derive(Debug, Clone)]
pub(crate) struct Harmonics<F> {
    degree: usize,
    quads: [Quad<F>; 12],
}

impl<F: Lane> Harmonics<F> {
    pub(crate) fn zero(degree: usize) -> Self {
        Self { degree, quads: [Quad::zero(); 12] }
    }

    /// Blocks of terms in use.
    fn blocks(&self) -> usize {
        sh::num_coeffs(self.degree).div_ceil(BLOCK)
    }

    /// Stages the coefficients of one splat.
    #[inline(always)]
    pub(crate) fn put(&mut self, place: usize, coefficients: &[[F; 3]]) {
        let (chunks, rest) = coefficients.as_flattened().as_chunks::<4>();
        for (quad, &chunk) in self.quads.iter_mut().zip(chunks) {
            quad.0[place] = chunk;
        }
        if let Some(quad) = self.quads.get_mut(chunks.len()) {
            quad.0[place][..rest.len()].copy_from_slice(rest);
        }
    }

    /// The values of one splat.
    #[inline(always)]
    pub(crate) fn take(&self, place: usize, coefficients: &mut [[F; 3]]) {
        let (chunks, rest) = coefficients.as_flattened_mut().as_chunks_mut::<4>();
        let full = chunks.len();
        for (chunk, quad) in chunks.iter_mut().zip(&self.quads) {
            *chunk = quad.0[place];
        }
        if let Some(quad) = self.quads.get(full) {
            rest.copy_from_slice(&quad.0[place][..rest.len()]);
        }
    }

    /// The terms of a block, registers `k`.
    #[inline(always)]
    fn load<S: Simd>(&self, s: S, k: usize, block: usize) -> [[Vector<S, F>; 3]; BLOCK] {
        let quads = &self.quads[3 * block..3 * block + 3];
        let [r0, g0, b0, r1] = quads[0].load(s, k);
        let [g1, b1, r2, g2] = quads[1].load(s, k);
        let [b2, r3, g3, b3] = quads[2].load(s, k);
        [[r0, g0, b0], [r1, g1, b1], [r2, g2, b2], [r3, g3, b3]]
    }

    /// Colours before the clamp, in the directions of unit vectors.
    #[inline(always)]
    pub(crate) fn colors<S: Simd>(
        &self,
        s: S,
        k: usize,
        direction: [Vector<S, F>; 3],
    ) -> [Vector<S, F>; 3] {
        let mut rgb = [direction[0].like(0.5); 3];
        let basis = sh::basis(self.degree, direction);
        for block in 0..self.blocks() {
            let rows = self.load(s, k, block);
            for (row, y) in rows.iter().zip(&basis[BLOCK * block..]) {
                rgb = each!(c => y.mul_add(row[c], rgb[c]));
            }
        }
        rgb
    }

    /// Gradient of the means through the viewing direction of their colours, given the gradients of
    /// the colours, the unit directions and the distances.
    #[inline(always)]
    pub(crate) fn mean_gradient<S: Simd>(
        &self,
        s: S,
        k: usize,
        v_rgb: [Vector<S, F>; 3],
        (direction, distance): ([Vector<S, F>; 3], Vector<S, F>),
    ) -> [Vector<S, F>; 3] {
        let mut v_direction = [distance.like(0.0); 3];
        let basis = sh::basis_gradient(self.degree, direction);
        for block in 0..self.blocks() {
            let rows = self.load(s, k, block);
            for (row, gradient) in rows.iter().zip(&basis[BLOCK * block..]) {
                let v_y = dot(*row, v_rgb);
                v_direction = each!(axis => gradient[axis].mul_add(v_y, v_direction[axis]));
            }
        }
        let along = dot(direction, v_direction);
        each!(axis => (v_direction[axis] - direction[axis] * along) / distance)
    }

    /// Overwrites registers `k` with the gradients of the coefficients.
    #[inline(always)]
    pub(crate) fn store_gradient<S: Simd>(
        &mut self,
        s: S,
        k: usize,
        v_rgb: [Vector<S, F>; 3],
        direction: [Vector<S, F>; 3],
    ) {
        let [r, g, b] = v_rgb;
        let basis = sh::basis(self.degree, direction);
        for block in 0..self.blocks() {
            let [y0, y1, y2, y3] = [
                basis[4 * block],
                basis[4 * block + 1],
                basis[4 * block + 2],
                basis[4 * block + 3],
            ];
            let quads = &mut self.quads[3 * block..3 * block + 3];
            quads[0].store(s, k, [y0 * r, y0 * g, y0 * b, y1 * r]);
            quads[1].store(s, k, [y1 * g, y1 * b, y2 * r, y2 * g]);
            quads[2].store(s, k, [y2 * b, y3 * r, y3 * g, y3 * b]);
        }
    }
}
