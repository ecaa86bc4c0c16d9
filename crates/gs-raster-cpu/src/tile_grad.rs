//! Gradients of one tile's pixels with respect to its list entries (`tile` is the forward pass).
//!
//! Back to front, as the scalar form of the chain rule wants it: with `σ = Σ_ch g_ch f_ch` and the running sum `R` of everything behind,
//! `∂L/∂α = T σ − R / (1 − α)`. A splat's sums over the tile's pixels stay in registers, one lane per column, until its rows are done:
//! one addition per list entry and quantity, no atomics, a fixed order.

use crate::bins::TileList;
use crate::lanes::Lane;
use crate::tile::{
    BATCH, Batch, MAX_ROW, Pass, Plane, Tests, columns, live_rows, offsets, row_registers,
};
use crate::view::{MAX_ALPHA, TRANSMITTANCE_THRESHOLD};
use gs_core::GradientConvention;
use pulp::Simd;

/// Sums per item before its channels: of `γ`, `γ dx`, `γ dy`, `γ dx²`, `γ dx dy`, `γ dy²` with `γ = ∂L/∂(exponent)`.
pub(crate) const MOMENTS: usize = 6;

/// What the loss says about one tile.
#[derive(Debug)]
pub(crate) struct TileUpstream<'a, F, const C: usize> {
    /// Gradients of this pass's channels.
    pub channels: &'a [Plane<F>; C],
    /// Transmittance after the last splat; consumed.
    pub transmittance: &'a mut Plane<F>,
    /// `R` behind the last splat: `T_final · (background·g_rgb − g_alpha)`; consumed.
    pub behind: &'a mut Plane<F>,
    /// List index at which the pixel stopped.
    pub stops: &'a [u32],
}

/// Where the sums go: `stride` values per item of the macro tile, the pass's channels at `MOMENTS + first_channel`.
#[derive(Debug)]
pub(crate) struct Sums<'a, F> {
    pub values: &'a mut [F],
    pub stride: usize,
}

/// Adds the tile's share to the sums of the items in its list.
#[inline(always)]
pub(crate) fn differentiate<S: Simd, F: Lane, const C: usize>(
    s: S,
    pass: &Pass<'_, F>,
    list: &TileList,
    origin: [F; 2],
    upstream: TileUpstream<'_, F, C>,
    convention: GradientConvention,
    sums: &mut Sums<'_, F>,
) {
    let tests = Tests::<S, F>::new(s);
    let columns = columns::<F>();
    let (zero, one) = (F::vsplat(s, F::zero()), F::vsplat(s, F::one()));
    // Where alpha is capped, the reference lets the gradient through; the true derivative is zero.
    let open = match convention {
        GradientConvention::Reference => F::vsplat(s, F::infinity()),
        GradientConvention::Exact => F::vsplat(s, F::of(MAX_ALPHA)),
    };
    let per_row = row_registers::<S, F>();
    let TileUpstream { channels: v_channels, transmittance, behind, stops } = upstream;
    let mut batch = Batch::<F, C>::new();
    let mut ends = Plane::<F>::zero();

    let mut end = stops.iter().copied().max().map_or(0, |stop| stop as usize).min(list.items.len());
    while end > 0 {
        let start = end.saturating_sub(BATCH);
        let count = pass.stage(list, origin, start..end, &mut batch);
        for (end, &stop) in ends.0.iter_mut().zip(stops) {
            *end = small::<F>((stop as usize).saturating_sub(start).min(count));
        }
        let live = live_rows(&ends.0);
        for e in (0..count.min(BATCH)).rev() {
            let rows = batch.rows_within(e, live);
            if rows.is_empty() {
                continue;
            }
            let dx = offsets::<S, F>(s, batch.x[e], &columns);
            let a = F::vsplat(s, batch.a[e]);
            let log2_opacity = F::vsplat(s, batch.log2_opacity[e]);
            let index = F::vsplat(s, small::<F>(e));
            let channels = batch.channels.each_ref().map(|values| F::vsplat(s, values[e]));
            // Sums of γ, γ dy and γ dy² down the columns; dx is the same in every row and comes in afterwards.
            let mut down = [[zero; 3]; MAX_ROW];
            let mut v_entry = [zero; C];
            let lanes = rows.start * per_row..rows.end * per_row;
            // Slices of one known length each: the loop below needs no bounds checks.
            let t_rows = transmittance.lanes_mut::<S>(&lanes);
            let r_rows = behind.lanes_mut::<S>(&lanes);
            let ends = ends.lanes::<S>(&lanes);
            let v_rows = v_channels.each_ref().map(|plane| plane.lanes::<S>(&lanes));
            for (row, &row_number) in columns[rows].iter().enumerate() {
                let dy = batch.y[e] - row_number;
                let b_dy = F::vsplat(s, batch.b[e] * dy);
                let rest = F::vsplat(s, batch.c[e] * dy * dy + batch.log2_opacity[e]);
                let dy = F::vsplat(s, dy);
                for k in 0..per_row {
                    let at = row * per_row + k;
                    let alpha = tests.alpha(dx[k], a, b_dy, rest, log2_opacity);
                    let drawn = F::vand(s, alpha.passes, F::vlt(s, index, ends[at]));
                    let inverse = F::vdiv(s, one, F::vsub(s, one, alpha.capped));
                    let after = t_rows[at];
                    let before = F::vmul(s, after, inverse);
                    let weight = F::vselect(s, drawn, F::vmul(s, alpha.capped, before), zero);
                    t_rows[at] = F::vselect(s, drawn, before, after);

                    let mut sigma = zero;
                    for c in 0..C {
                        let v = v_rows[c][at];
                        sigma = F::vfma(s, channels[c], v, sigma);
                        v_entry[c] = F::vfma(s, weight, v, v_entry[c]);
                    }
                    let r = r_rows[at];
                    let v_alpha = F::vfnma(s, r, inverse, F::vmul(s, before, sigma));
                    r_rows[at] = F::vfma(s, weight, sigma, r);

                    let flows = F::vand(s, drawn, F::vle(s, alpha.raw, open));
                    let gamma = F::vselect(s, flows, F::vmul(s, alpha.raw, v_alpha), zero);
                    let gamma_y = F::vmul(s, gamma, dy);
                    let [sum, sum_y, sum_yy] = down[k];
                    down[k] = [
                        F::vadd(s, sum, gamma),
                        F::vadd(s, sum_y, gamma_y),
                        F::vfma(s, gamma_y, dy, sum_yy),
                    ];
                }
            }
            let mut moments = [zero; MOMENTS];
            for k in 0..per_row {
                let [sum, sum_y, sum_yy] = down[k];
                let sum_x = F::vmul(s, sum, dx[k]);
                moments[0] = F::vadd(s, moments[0], sum);
                moments[1] = F::vadd(s, moments[1], sum_x);
                moments[2] = F::vadd(s, moments[2], sum_y);
                moments[3] = F::vfma(s, sum_x, dx[k], moments[3]);
                moments[4] = F::vfma(s, sum_y, dx[k], moments[4]);
                moments[5] = F::vadd(s, moments[5], sum_yy);
            }
            let target = &mut sums.values[batch.item[e] as usize * sums.stride..][..sums.stride];
            for (target, moment) in target.iter_mut().zip(moments) {
                *target += F::vsum(s, moment);
            }
            for (target, v) in target[MOMENTS + pass.first_channel..].iter_mut().zip(v_entry) {
                *target += F::vsum(s, v);
            }
        }
        end = start;
    }
}

/// Adds `Σ_p α T g` per channel to the sums of the items in the list, front to back; `transmittance` starts as 1 on the image, −1 off it.
#[inline(always)]
pub(crate) fn differentiate_colors<S: Simd, F: Lane, const C: usize>(
    s: S,
    pass: &Pass<'_, F>,
    list: &TileList,
    origin: [F; 2],
    v_channels: &[Plane<F>; C],
    transmittance: &mut Plane<F>,
    sums: &mut Sums<'_, F>,
) {
    let tests = Tests::<S, F>::new(s);
    let columns = columns::<F>();
    let zero = F::vsplat(s, F::zero());
    let threshold = F::vsplat(s, F::of(TRANSMITTANCE_THRESHOLD));
    let per_row = row_registers::<S, F>();
    let mut batch = Batch::<F, C>::new();
    let mut start = 0;
    while start < list.items.len() {
        let live = live_rows(&transmittance.0);
        if live.0 >= live.1 {
            break;
        }
        let count = pass.stage(list, origin, start..list.items.len(), &mut batch);
        for e in 0..count.min(BATCH) {
            let rows = batch.rows_within(e, live);
            if rows.is_empty() {
                continue;
            }
            let dx = offsets::<S, F>(s, batch.x[e], &columns);
            let a = F::vsplat(s, batch.a[e]);
            let log2_opacity = F::vsplat(s, batch.log2_opacity[e]);
            let mut v_entry = [zero; C];
            let lanes = rows.start * per_row..rows.end * per_row;
            let t_rows = transmittance.lanes_mut::<S>(&lanes);
            let v_rows = v_channels.each_ref().map(|plane| plane.lanes::<S>(&lanes));
            for (row, &row_number) in columns[rows].iter().enumerate() {
                let dy = batch.y[e] - row_number;
                let b_dy = F::vsplat(s, batch.b[e] * dy);
                let rest = F::vsplat(s, batch.c[e] * dy * dy + batch.log2_opacity[e]);
                for k in 0..per_row {
                    let at = row * per_row + k;
                    let alpha = tests.alpha(dx[k], a, b_dy, rest, log2_opacity);
                    let before = t_rows[at];
                    let after = F::vfnma(s, alpha.capped, before, before);
                    let goes_on = F::vle(s, threshold, after);
                    let draws = F::vand(s, alpha.passes, goes_on);
                    let weight = F::vselect(s, draws, F::vmul(s, alpha.capped, before), zero);
                    for c in 0..C {
                        v_entry[c] = F::vfma(s, weight, v_rows[c][at], v_entry[c]);
                    }
                    let next = F::vselect(s, goes_on, after, F::vnegative(s, before));
                    t_rows[at] = F::vselect(s, alpha.passes, next, before);
                }
            }
            let target = &mut sums.values[batch.item[e] as usize * sums.stride..][..sums.stride];
            for (target, v) in target[MOMENTS + pass.first_channel..].iter_mut().zip(v_entry) {
                *target += F::vsum(s, v);
            }
        }
        start += count;
    }
}

/// A count of at most a batch as a float.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "at most BATCH")]
fn small<F: Lane>(count: usize) -> F {
    F::of(f32::from(count as u16))
}
