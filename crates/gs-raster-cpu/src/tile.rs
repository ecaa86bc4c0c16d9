//! The pixel stage of one tile: staging of list entries, alpha of a row of pixels, front-to-back compositing.
//!
//! A tile's state lies in planes of 16×16 values, row by row, one row being one to sixteen registers. Lanes take no branches: skips, caps
//! and stops are selects. A pixel that has stopped has the sign of its transmittance set, which makes every later test fail.

use crate::bins::TileList;
use crate::lanes::Lane;
use crate::shade::HEAD;
use crate::view::{ALPHA_THRESHOLD, MAX_ALPHA, TILE, TILE_PIXELS, TRANSMITTANCE_THRESHOLD};
use pulp::Simd;
use std::ops::Range;

/// Entries staged at once.
pub(crate) const BATCH: usize = 32;
/// Registers per row when a register holds one lane.
const MAX_ROW: usize = TILE;

/// A splat relative to one tile, ready for the lanes. Logarithms have base 2, the base of the exponential.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Entry<F, const C: usize> {
    /// Centre relative to the tile's first pixel.
    pub x: F,
    pub y: F,
    /// `log2 α = a dx² + b dx dy + c dy² + log2_opacity`.
    pub a: F,
    pub b: F,
    pub c: F,
    pub log2_opacity: F,
    /// Pixel rows that can be reached, end exclusive.
    pub rows: (usize, usize),
    /// Index into the macro tile's items.
    pub item: usize,
    pub channels: [F; C],
}

impl<F: Lane, const C: usize> Entry<F, C> {
    pub(crate) const fn empty(zero: F) -> Self {
        Self {
            x: zero,
            y: zero,
            a: zero,
            b: zero,
            c: zero,
            log2_opacity: zero,
            rows: (0, 0),
            item: 0,
            channels: [zero; C],
        }
    }
}

/// What all tiles of a macro tile read in one pass.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pass<'a, F> {
    /// Records of the macro tile's items.
    pub records: &'a [F],
    /// Values per record.
    pub length: usize,
    /// First channel of this pass.
    pub first_channel: usize,
}

impl<F: Lane> Pass<'_, F> {
    /// Stages the entries `range` of a list into `batch`, as many as fit; returns their number.
    #[inline(always)]
    pub(crate) fn stage<const C: usize>(
        &self,
        list: &TileList,
        origin: [F; 2],
        range: Range<usize>,
        batch: &mut [Entry<F, C>; BATCH],
    ) -> usize {
        let first_channel = HEAD + self.first_channel;
        let count = range.len().min(BATCH);
        for ((entry, &item), &rows) in
            batch.iter_mut().zip(&list.items[range.clone()]).zip(&list.rows[range])
        {
            let item = item as usize;
            let record = &self.records[item * self.length..(item + 1) * self.length];
            entry.x = record[0] - origin[0];
            entry.y = record[1] - origin[1];
            entry.a = record[2];
            entry.b = record[3];
            entry.c = record[4];
            entry.log2_opacity = record[5];
            entry.item = item;
            entry.rows = (usize::from(rows & 15), usize::from(rows >> 4) + 1);
            entry.channels.copy_from_slice(&record[first_channel..first_channel + C]);
        }
        count
    }
}

/// One value per pixel of a tile, row by row, aligned so that no register straddles a cache line.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Plane<F>(pub [F; TILE_PIXELS]);

impl<F: Lane> Plane<F> {
    pub(crate) fn zero() -> Self {
        Self([F::zero(); TILE_PIXELS])
    }

    /// The registers `lanes`.
    #[inline(always)]
    pub(crate) fn lanes<S: Simd>(&self, lanes: &Range<usize>) -> &[F::Vector<S>] {
        &F::vectors::<S>(&self.0)[lanes.clone()]
    }

    /// The registers `lanes`, mutable.
    #[inline(always)]
    pub(crate) fn lanes_mut<S: Simd>(&mut self, lanes: &Range<usize>) -> &mut [F::Vector<S>] {
        &mut F::vectors_mut::<S>(&mut self.0)[lanes.clone()]
    }
}

/// The constants of the pixel tests, as registers.
#[derive(Clone, Copy)]
pub(crate) struct Tests<S: Simd, F: Lane> {
    s: S,
    faintest: F::Vector<S>,
    cap: F::Vector<S>,
}

/// Alpha of some pixels of a row.
#[derive(Clone, Copy)]
pub(crate) struct Alpha<S: Simd, F: Lane> {
    /// Before the cap.
    pub raw: F::Vector<S>,
    /// After the cap.
    pub capped: F::Vector<S>,
    /// Neither too faint nor with a positive exponent.
    pub passes: F::Mask<S>,
}

impl<S: Simd, F: Lane> Tests<S, F> {
    #[inline(always)]
    pub(crate) fn new(s: S) -> Self {
        // The skip test compares logarithms, so that whatever the exponential makes of arguments far below it is never looked at.
        let faintest = F::from_double(f64::from(ALPHA_THRESHOLD).log2());
        Self { s, faintest: F::vsplat(s, faintest), cap: F::vsplat(s, F::of(MAX_ALPHA)) }
    }

    #[inline(always)]
    pub(crate) fn alpha(
        &self,
        dx: F::Vector<S>,
        a: F::Vector<S>,
        b_dy: F::Vector<S>,
        rest: F::Vector<S>,
        log2_opacity: F::Vector<S>,
    ) -> Alpha<S, F> {
        let s = self.s;
        let exponent = F::vfma(s, dx, F::vfma(s, a, dx, b_dy), rest);
        let raw = F::vexp2(s, exponent);
        let passes =
            F::vand(s, F::vle(s, exponent, log2_opacity), F::vle(s, self.faintest, exponent));
        Alpha { raw, capped: F::vmin(s, raw, self.cap), passes }
    }
}

/// Registers per row.
#[inline(always)]
pub(crate) const fn row_registers<S: Simd, F: Lane>() -> usize {
    TILE * size_of::<F>() / size_of::<F::Vector<S>>()
}

/// Column numbers 0 to 15.
#[inline(always)]
pub(crate) fn columns<F: Lane>() -> [F; TILE] {
    let mut columns = [F::zero(); TILE];
    for i in 1..TILE {
        columns[i] = columns[i - 1] + F::one();
    }
    columns
}

/// `x − column` for the registers of a row.
#[inline(always)]
pub(crate) fn offsets<S: Simd, F: Lane>(
    s: S,
    x: F,
    columns: &[F; TILE],
) -> [F::Vector<S>; MAX_ROW] {
    let x = F::vsplat(s, x);
    let mut dx = [x; MAX_ROW];
    for (dx, &column) in dx.iter_mut().zip(F::vectors::<S>(columns)) {
        *dx = F::vsub(s, x, column);
    }
    dx
}

/// What compositing leaves of one tile.
#[derive(Debug)]
pub(crate) struct TileState<F, const C: usize> {
    /// Sums of the channels.
    pub planes: [Plane<F>; C],
    /// Negative where the pixel stopped. Pixels off the image start as −1.
    pub transmittance: Plane<F>,
    /// List index at which the pixel stopped, `u32::MAX` if it did not.
    pub stops: [u32; TILE_PIXELS],
}

impl<F: Lane, const C: usize> TileState<F, C> {
    /// Before the first splat, for the tile whose first pixel is `origin` in an image of `size`.
    #[inline(always)]
    pub(crate) fn new(origin: [usize; 2], size: [usize; 2]) -> Self {
        let mut state = Self {
            planes: [Plane::zero(); C],
            transmittance: Plane([-F::one(); TILE_PIXELS]),
            stops: [0; TILE_PIXELS],
        };
        let inside = [0, 1].map(|axis| (size[axis] - origin[axis]).min(TILE));
        for row in 0..inside[1] {
            let pixels = row * TILE..row * TILE + inside[0];
            state.transmittance.0[pixels.clone()].fill(F::one());
            state.stops[pixels].fill(u32::MAX);
        }
        state
    }
}

/// Rows of the tile in which some pixel has not stopped.
#[inline(always)]
pub(crate) fn live_rows<F: Lane>(transmittance: &[F]) -> (usize, usize) {
    let live =
        |row: usize| transmittance[row * TILE..(row + 1) * TILE].iter().any(|&t| t > F::zero());
    let first = (0..TILE).find(|&row| live(row)).unwrap_or(TILE);
    let end = (first..TILE).rev().find(|&row| live(row)).map_or(first, |row| row + 1);
    (first, end)
}

/// Composites one tile; returns the number of evaluated pixel–splat samples.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "list indices are below 2^32")]
pub(crate) fn composite<S: Simd, F: Lane, const C: usize>(
    s: S,
    pass: &Pass<'_, F>,
    list: &TileList,
    origin: [F; 2],
    state: &mut TileState<F, C>,
) -> u64 {
    let tests = Tests::<S, F>::new(s);
    let columns = columns::<F>();
    let threshold = F::vsplat(s, F::of(TRANSMITTANCE_THRESHOLD));
    let (zero, one) = (F::vsplat(s, F::zero()), F::vsplat(s, F::one()));
    let per_row = row_registers::<S, F>();
    let TileState { planes, transmittance, stops } = state;
    let mut batch = [Entry::<F, C>::empty(F::zero()); BATCH];
    let mut evaluated = 0;

    let mut start = 0;
    while start < list.items.len() {
        let live = live_rows(&transmittance.0);
        if live.0 >= live.1 {
            break;
        }
        let count = pass.stage(list, origin, start..list.items.len(), &mut batch);
        for (index, entry) in batch[..count].iter().enumerate() {
            let rows = entry.rows.0.max(live.0)..entry.rows.1.min(live.1);
            if rows.is_empty() {
                continue;
            }
            evaluated += (rows.len() * TILE) as u64;
            let dx = offsets::<S, F>(s, entry.x, &columns);
            let a = F::vsplat(s, entry.a);
            let log2_opacity = F::vsplat(s, entry.log2_opacity);
            let channels = entry.channels.map(|channel| F::vsplat(s, channel));
            let mut flips = one;
            let lanes = rows.start * per_row..rows.end * per_row;
            // Slices of one known length each: the loop below needs no bounds checks.
            let t_rows = transmittance.lanes_mut::<S>(&lanes);
            let sums = planes.each_mut().map(|plane| plane.lanes_mut::<S>(&lanes));
            for (row, &row_number) in columns[rows.clone()].iter().enumerate() {
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
                        sums[c][at] = F::vfma(s, channels[c], weight, sums[c][at]);
                    }
                    let next = F::vselect(s, goes_on, after, F::vnegative(s, before));
                    let next = F::vselect(s, alpha.passes, next, before);
                    flips = F::mark_flips(s, flips, before, next);
                    t_rows[at] = next;
                }
            }
            if F::any_flip(s, flips) {
                let pixels = rows.start * TILE..rows.end * TILE;
                let number = (start + index) as u32;
                for (stop, &t) in stops[pixels.clone()].iter_mut().zip(&transmittance.0[pixels]) {
                    // Without a branch, so that it vectorises. Stopped pixels keep the smaller, earlier number.
                    *stop = (*stop).min(if t < F::zero() { number } else { u32::MAX });
                }
            }
        }
        start += count;
    }
    evaluated
}
