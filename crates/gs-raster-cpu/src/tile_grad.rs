//! Gradients of one tile's pixels with respect to its list entries (`tile` is the forward pass).
//!
//! Back to front, as in the scalar form of the chain rule: with `σ = Σ_ch g_ch f_ch` and the
//! running sum `R` of everything behind, `∂L/∂α = T σ − R / (1 − α)`. A splat's sums over the
//! tile's pixels stay in registers, one lane per column, until all its rows are done: one addition
//! to memory per list entry and quantity, without atomics and in a fixed order.

use crate::bins::TileList;
use crate::lanes::Lane;
use crate::shade::HEAD;
use crate::tile::{
    BATCH, MAX_ROW, Pass, Tests, TilePlane, columns, live_rows, offsets, row_registers,
};
use crate::view::TILE;
use gs_core::GradientConvention;
use gs_core::image_formation::{MAX_ALPHA, TRANSMITTANCE_THRESHOLD};
use pulp::Simd;
use std::ops::Range;

/// Sums per item before its channels: of `γ`, `γ dx`, `γ dy`, `γ dx²`, `γ dx dy`, `γ dy²` with
/// `γ = ∂L/∂(exponent)`.
pub(crate) const MOMENTS: usize = 6;

/// Upstream gradients of one tile.
#[derive(Debug)]
pub(crate) struct TileUpstream<'a, F, const C: usize> {
    /// Gradients of this pass's channels.
    pub channels: &'a [TilePlane<F>; C],
    /// Transmittance after the last splat; consumed.
    pub transmittance: &'a mut TilePlane<F>,
    /// `R` behind the last splat: `T_final · (background·g_rgb − g_alpha)`; consumed.
    pub behind: &'a mut TilePlane<F>,
    /// List index at which the pixel stopped.
    pub stops: &'a [u32],
}

/// Output of the sums: `stride` values per item of the macro tile, the
/// pass's channels at `MOMENTS + first_channel`.
#[derive(Debug)]
pub(crate) struct Sums<'a, F> {
    pub values: &'a mut [F],
    pub stride: usize,
}

/// A list entry relative to one tile.
struct Entry<'a, F, const C: usize> {
    /// Index into the macro tile's items.
    item: usize,
    /// Centre relative to the tile's first pixel.
    x: F,
    a: F,
    log2_opacity: F,
    channels: &'a [F],
    /// Offset of the splat from each row, and the terms of the exponent that do not depend on the
    /// column.
    dy: [F; TILE],
    b_dy: [F; TILE],
    rest: [F; TILE],
}

impl<'a, F: Lane, const C: usize> Entry<'a, F, C> {
    /// Entry `e` of a list; `rows` are the row numbers.
    #[inline(always)]
    fn new(
        pass: &Pass<'a, F>,
        list: &TileList,
        e: usize,
        origin: [F; 2],
        rows: &[F; TILE],
    ) -> Self {
        let item = list.items[e] as usize;
        let record = &pass.records[item * pass.length..][..pass.length];
        let (b, c, log2_opacity) = (record[3], record[4], record[5]);
        let y = record[1] - origin[1];
        let zeros = [F::zero(); TILE];
        let (mut dy, mut b_dy, mut rest) = (zeros, zeros, zeros);
        for row in 0..TILE {
            dy[row] = y - rows[row];
            b_dy[row] = b * dy[row];
            rest[row] = c * dy[row] * dy[row] + log2_opacity;
        }
        let first = HEAD + pass.first_channel;
        let (x, channels) = (record[0] - origin[0], &record[first..first + C]);
        Self { item, x, a: record[2], log2_opacity, channels, dy, b_dy, rest }
    }
}

/// Rows of entry `e` that lie in `live`.
#[inline(always)]
fn rows_within(list: &TileList, e: usize, live: (usize, usize)) -> Range<usize> {
    let rows = list.rows[e];
    usize::from(rows & 15).max(live.0)..(usize::from(rows >> 4) + 1).min(live.1)
}

/// Adds the tile's contribution to the sums of the items in its list.
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
    // Where alpha is capped, the reference passes the gradient on; the true derivative is zero.
    let open = match convention {
        GradientConvention::Reference => F::vsplat(s, F::infinity()),
        GradientConvention::Exact => F::vsplat(s, F::of(MAX_ALPHA)),
    };
    let per_row = row_registers::<S, F>();
    let TileUpstream { channels: v_channels, transmittance, behind, stops } = upstream;
    let mut ends = TilePlane::<F>::zero();

    let mut end = stops.iter().copied().max().map_or(0, |stop| stop as usize).min(list.items.len());
    while end > 0 {
        let start = end.saturating_sub(BATCH);
        let count = end - start;
        for (end, &stop) in ends.0.iter_mut().zip(stops) {
            *end = small::<F>((stop as usize).saturating_sub(start).min(count));
        }
        let live = live_rows(&ends.0);
        for e in (start..end).rev() {
            let rows = rows_within(list, e, live);
            if rows.is_empty() {
                continue;
            }
            let entry = Entry::<F, C>::new(pass, list, e, origin, &columns);
            let dx = offsets::<S, F>(s, entry.x, &columns);
            let a = F::vsplat(s, entry.a);
            let log2_opacity = F::vsplat(s, entry.log2_opacity);
            let index = F::vsplat(s, small::<F>(e - start));
            let mut channels = [zero; C];
            for (channel, &value) in channels.iter_mut().zip(entry.channels) {
                *channel = F::vsplat(s, value);
            }
            // Sums of γ, γ dy and γ dy² down the columns; dx is the same
            // in every row and is applied afterwards.
            let mut down = [[zero; 3]; MAX_ROW];
            let mut v_entry = [zero; C];
            let lanes = rows.start * per_row..rows.end * per_row;
            // Slices of known length, so that the loop below has no bounds checks.
            let t_rows = transmittance.lanes_mut::<S>(&lanes);
            let r_rows = behind.lanes_mut::<S>(&lanes);
            let ends = ends.lanes::<S>(&lanes);
            let v_rows = v_channels.each_ref().map(|plane| plane.lanes::<S>(&lanes));
            let dy_rows = entry.dy[rows.clone()].iter();
            let rows = dy_rows.zip(&entry.b_dy[rows.clone()]).zip(&entry.rest[rows]);
            for (row, ((&dy, &b_dy), &rest)) in rows.enumerate() {
                let (b_dy, rest) = (F::vsplat(s, b_dy), F::vsplat(s, rest));
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
            let target = &mut sums.values[entry.item * sums.stride..][..sums.stride];
            let (target_moments, target) = target.split_at_mut(MOMENTS);
            let [s0, sx, sy, sxx, sxy, syy] = moments;
            let [first, second] = [v_entry[0], if C > 1 { v_entry[1] } else { zero }];
            let low = F::vsums(s, [s0, sx, sy, sxx]);
            let [sxy, syy, first, second] = F::vsums(s, [sxy, syy, first, second]);
            for (target, moment) in
                target_moments.iter_mut().zip([low[0], low[1], low[2], low[3], sxy, syy])
            {
                *target += moment;
            }
            let target = &mut target[pass.first_channel..];
            for (target, v) in target.iter_mut().zip([first, second]).take(C) {
                *target += v;
            }
            for (target, v) in target.iter_mut().zip(v_entry).skip(2) {
                *target += F::vsum(s, v);
            }
        }
        end = start;
    }
}

/// Adds `Σ_p α T g` per channel to the sums of the items in the list, front to back;
/// `transmittance` starts as 1 inside the image, −1 outside.
#[inline(always)]
pub(crate) fn differentiate_colors<S: Simd, F: Lane, const C: usize>(
    s: S,
    pass: &Pass<'_, F>,
    list: &TileList,
    origin: [F; 2],
    v_channels: &[TilePlane<F>; C],
    transmittance: &mut TilePlane<F>,
    sums: &mut Sums<'_, F>,
) {
    let tests = Tests::<S, F>::new(s);
    let columns = columns::<F>();
    let zero = F::vsplat(s, F::zero());
    let threshold = F::vsplat(s, F::of(TRANSMITTANCE_THRESHOLD));
    let per_row = row_registers::<S, F>();
    let mut start = 0;
    while start < list.items.len() {
        // The transmittance of a stopped pixel keeps falling below
        // the threshold; zero prevents denormals.
        for t in &mut transmittance.0 {
            *t = if *t < F::of(TRANSMITTANCE_THRESHOLD) { F::zero() } else { *t };
        }
        let live = live_rows(&transmittance.0);
        if live.0 >= live.1 {
            break;
        }
        let end = list.items.len().min(start + BATCH);
        for e in start..end {
            let rows = rows_within(list, e, live);
            if rows.is_empty() {
                continue;
            }
            let entry = Entry::<F, C>::new(pass, list, e, origin, &columns);
            let dx = offsets::<S, F>(s, entry.x, &columns);
            let a = F::vsplat(s, entry.a);
            let log2_opacity = F::vsplat(s, entry.log2_opacity);
            let mut v_entry = [zero; C];
            let lanes = rows.start * per_row..rows.end * per_row;
            let t_rows = transmittance.lanes_mut::<S>(&lanes);
            let v_rows = v_channels.each_ref().map(|plane| plane.lanes::<S>(&lanes));
            let rows = entry.b_dy[rows.clone()].iter().zip(&entry.rest[rows]);
            for (row, (&b_dy, &rest)) in rows.enumerate() {
                let (b_dy, rest) = (F::vsplat(s, b_dy), F::vsplat(s, rest));
                for k in 0..per_row {
                    let at = row * per_row + k;
                    let alpha = tests.alpha(dx[k], a, b_dy, rest, log2_opacity);
                    let before = t_rows[at];
                    let drawn = F::vselect(s, alpha.passes, alpha.capped, zero);
                    let after = F::vfnma(s, drawn, before, before);
                    let goes_on = F::vle(s, threshold, after);
                    let weight = F::vselect(s, goes_on, F::vmul(s, drawn, before), zero);
                    for c in 0..C {
                        v_entry[c] = F::vfma(s, weight, v_rows[c][at], v_entry[c]);
                    }
                    t_rows[at] = after;
                }
            }
            let target = &mut sums.values[entry.item * sums.stride..][..sums.stride];
            for (target, v) in target[MOMENTS + pass.first_channel..].iter_mut().zip(v_entry) {
                *target += F::vsum(s, v);
            }
        }
        start = end;
    }
}

/// A count of at most a batch as a float.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "at most BATCH")]
fn small<F: Lane>(count: usize) -> F {
    F::of(f32::from(count as u16))
}
