//! Gradients of one tile's pixels with respect to its list entries (`tile` is the forward pass).
//!
//! Back to front, as the scalar form of the chain rule wants it: with `σ = Σ_ch g_ch f_ch` and the running sum `R` of everything behind,
//! `∂L/∂α = T σ − R / (1 − α)`. A splat's sums over the tile's pixels stay in registers, one lane per column, until its rows are done:
//! one addition per list entry and quantity, no atomics, a fixed order.

use crate::bins::TileList;
use crate::lanes::Lane;
use crate::tile::{BATCH, Entry, Pass, Plane, Tests, columns, live_rows, offsets, row_registers};
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
    let mut batch = [Entry::<F, C>::empty(F::zero()); BATCH];
    let mut ends = Plane::<F>::zero();

    let mut end = stops.iter().copied().max().map_or(0, |stop| stop as usize).min(list.items.len());
    while end > 0 {
        let start = end.saturating_sub(BATCH);
        let count = pass.stage(list, origin, start..end, &mut batch);
        for (end, &stop) in ends.0.iter_mut().zip(stops) {
            *end = small::<F>((stop as usize).saturating_sub(start).min(count));
        }
        let live = live_rows(&ends.0);
        for (index, entry) in batch[..count].iter().enumerate().rev() {
            let rows = entry.rows.0.max(live.0)..entry.rows.1.min(live.1);
            if rows.is_empty() {
                continue;
            }
            let dx = offsets::<S, F>(s, entry.x, &columns);
            let a = F::vsplat(s, entry.a);
            let log2_opacity = F::vsplat(s, entry.log2_opacity);
            let index = F::vsplat(s, small::<F>(index));
            let channels = entry.channels.map(|channel| F::vsplat(s, channel));
            let mut moments = [zero; MOMENTS];
            let mut v_entry = [zero; C];
            let lanes = rows.start * per_row..rows.end * per_row;
            // Slices of one known length each: the loop below needs no bounds checks.
            let t_rows = transmittance.lanes_mut::<S>(&lanes);
            let r_rows = behind.lanes_mut::<S>(&lanes);
            let ends = ends.lanes::<S>(&lanes);
            let v_rows = v_channels.each_ref().map(|plane| plane.lanes::<S>(&lanes));
            for (row, &row_number) in columns[rows].iter().enumerate() {
                let dy = entry.y - row_number;
                let b_dy = F::vsplat(s, entry.b * dy);
                let rest = F::vsplat(s, entry.c * dy * dy + entry.log2_opacity);
                let dy = F::vsplat(s, dy);
                for k in 0..per_row {
                    let at = row * per_row + k;
                    let dx = dx[k];
                    let alpha = tests.alpha(dx, a, b_dy, rest, log2_opacity);
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
                    let gamma_x = F::vmul(s, gamma, dx);
                    let gamma_y = F::vmul(s, gamma, dy);
                    moments[0] = F::vadd(s, moments[0], gamma);
                    moments[1] = F::vadd(s, moments[1], gamma_x);
                    moments[2] = F::vadd(s, moments[2], gamma_y);
                    moments[3] = F::vfma(s, gamma_x, dx, moments[3]);
                    moments[4] = F::vfma(s, gamma_x, dy, moments[4]);
                    moments[5] = F::vfma(s, gamma_y, dy, moments[5]);
                }
            }
            let target = &mut sums.values[entry.item * sums.stride..][..sums.stride];
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
    let mut batch = [Entry::<F, C>::empty(F::zero()); BATCH];
    let mut start = 0;
    while start < list.items.len() {
        let live = live_rows(&transmittance.0);
        if live.0 >= live.1 {
            break;
        }
        let count = pass.stage(list, origin, start..list.items.len(), &mut batch);
        for entry in &batch[..count] {
            let rows = entry.rows.0.max(live.0)..entry.rows.1.min(live.1);
            if rows.is_empty() {
                continue;
            }
            let dx = offsets::<S, F>(s, entry.x, &columns);
            let a = F::vsplat(s, entry.a);
            let log2_opacity = F::vsplat(s, entry.log2_opacity);
            let mut v_entry = [zero; C];
            let lanes = rows.start * per_row..rows.end * per_row;
            let t_rows = transmittance.lanes_mut::<S>(&lanes);
            let v_rows = v_channels.each_ref().map(|plane| plane.lanes::<S>(&lanes));
            for (row, &row_number) in columns[rows].iter().enumerate() {
                let dy = entry.y - row_number;
                let b_dy = F::vsplat(s, entry.b * dy);
                let rest = F::vsplat(s, entry.c * dy * dy + entry.log2_opacity);
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
            let target = &mut sums.values[entry.item * sums.stride..][..sums.stride];
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
