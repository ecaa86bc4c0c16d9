//! The pixel stage of one tile: staging of list entries, alpha of a row of pixels, front-to-back
//! compositing.
//!
//! A tile's state is stored in planes of 16×16 values, row by row; one row takes one to sixteen
//! registers. Lanes do not branch: skips, caps and stops are selects. The transmittance of a
//! stopped pixel has its sign bit set.

use crate::bins::TileList;
use crate::lanes::Lane;
use crate::shade::HEAD;
use crate::view::{TILE, TILE_PIXELS};
use gs_core::image_formation::{ALPHA_THRESHOLD, MAX_ALPHA, TRANSMITTANCE_THRESHOLD};
use pulp::Simd;
use std::ops::Range;

/// Entries staged at once.
pub(crate) const BATCH: usize = 32;
/// Registers per row when a register holds one lane.
pub(crate) const MAX_ROW: usize = TILE;

/// Splats relative to one tile, as a structure of arrays. Logarithms
/// have base 2, the base of the exponential.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct Batch<F, const C: usize> {
    /// Centre relative to the tile's first pixel.
    x: [F; BATCH],
    y: [F; BATCH],
    /// `log2 α = a dx² + b dx dy + c dy² + log2_opacity`.
    a: [F; BATCH],
    b: [F; BATCH],
    c: [F; BATCH],
    log2_opacity: [F; BATCH],
    channels: [[F; BATCH]; C],
    /// First and last pixel row that the splat can affect.
    rows: [(u8, u8); BATCH],
}

impl<F: Lane, const C: usize> Batch<F, C> {
    fn new() -> Self {
        let zeros = [F::zero(); BATCH];
        Self {
            x: zeros,
            y: zeros,
            a: zeros,
            b: zeros,
            c: zeros,
            log2_opacity: zeros,
            channels: [zeros; C],
            rows: [(0, 0); BATCH],
        }
    }

    /// For every row, a bit per entry that can affect it.
    #[inline(always)]
    fn entries_of_rows(&self, count: usize) -> [u32; TILE] {
        let mut rows = [0_u32; TILE];
        for (e, &(first, last)) in self.rows[..count].iter().enumerate() {
            // Loops over all rows, so that it vectorises.
            for (number, row) in (0_u8..).zip(&mut rows) {
                *row |= u32::from(first <= number && number <= last) << e;
            }
        }
        rows
    }
}

/// Input of all tiles of a macro tile in one pass.
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
    fn stage<const C: usize>(
        &self,
        list: &TileList,
        origin: [F; 2],
        range: Range<usize>,
        batch: &mut Batch<F, C>,
    ) -> usize {
        let first_channel = HEAD + self.first_channel;
        let count = range.len().min(BATCH);
        let range = range.start..range.start + count;
        let entries = list.items[range.clone()].iter().zip(&list.rows[range]);
        for (e, (&item, &rows)) in entries.enumerate().take(BATCH) {
            let at = item as usize;
            let record = &self.records[at * self.length..(at + 1) * self.length];
            batch.x[e] = record[0] - origin[0];
            batch.y[e] = record[1] - origin[1];
            batch.a[e] = record[2];
            batch.b[e] = record[3];
            batch.c[e] = record[4];
            batch.log2_opacity[e] = record[5];
            batch.rows[e] = (rows & 15, rows >> 4);
            let channels = &record[first_channel..first_channel + C];
            for (target, &channel) in batch.channels.iter_mut().zip(channels) {
                target[e] = channel;
            }
        }
        count
    }
}

/// One value per pixel of a tile, row by row, aligned so that no register crosses a cache line.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct TilePlane<F>(pub [F; TILE_PIXELS]);

impl<F: Lane> TilePlane<F> {
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
    /// Neither below the alpha threshold nor with a positive exponent.
    pub passes: F::Mask<S>,
}

impl<S: Simd, F: Lane> Tests<S, F> {
    #[inline(always)]
    pub(crate) fn new(s: S) -> Self {
        // The skip test compares logarithms, so that exponentials of
        // very negative arguments are never used.
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

/// Results of compositing one tile; previous contents are overwritten.
#[derive(Debug)]
pub(crate) struct TileState<'a, F, const C: usize> {
    /// Sums of the channels.
    pub planes: &'a mut [[F; TILE_PIXELS]; C],
    /// Negative where the pixel stopped.
    pub transmittance: &'a mut [F; TILE_PIXELS],
    /// List index after the last entry that may draw, `u32::MAX` if the pixel did not stop.
    pub stops: &'a mut [u32; TILE_PIXELS],
}

/// Transmittance before the first splat: 1 inside the image, −1 outside, for the tile whose first
/// pixel is `origin` in an image of `size`.
#[inline(always)]
pub(crate) fn clear<F: Lane>(
    transmittance: &mut [F; TILE_PIXELS],
    origin: [usize; 2],
    size: [usize; 2],
) {
    transmittance.fill(-F::one());
    let inside = [0, 1].map(|axis| (size[axis] - origin[axis]).min(TILE));
    for row in 0..inside[1] {
        transmittance[row * TILE..row * TILE + inside[0]].fill(F::one());
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
///
/// One register of pixels at a time takes all entries of a batch that reach its row: transmittance
/// and sums stay in registers.
#[inline(always)]
pub(crate) fn composite<S: Simd, F: Lane, const C: usize>(
    s: S,
    pass: &Pass<'_, F>,
    list: &TileList,
    (first, size): ([usize; 2], [usize; 2]),
    origin: [F; 2],
    state: TileState<'_, F, C>,
) -> u64 {
    let tests = Tests::<S, F>::new(s);
    let columns = columns::<F>();
    let numbers = numbers::<F>();
    let threshold = F::vsplat(s, F::of(TRANSMITTANCE_THRESHOLD));
    let (zero, one) = (F::vsplat(s, F::zero()), F::vsplat(s, F::one()));
    let never = F::vsplat(s, F::infinity());
    let per_row = row_registers::<S, F>();
    let TileState { planes, transmittance, stops } = state;
    planes.as_flattened_mut().fill(F::zero());
    clear(transmittance, first, size);
    for (stop, &t) in stops.iter_mut().zip(transmittance.iter()) {
        *stop = if t < F::zero() { 0 } else { u32::MAX };
    }
    let mut batch = Batch::<F, C>::new();
    let mut evaluated = 0;

    let mut start = 0;
    while start < list.items.len() {
        let live = live_rows(transmittance);
        if live.0 >= live.1 {
            break;
        }
        let count = pass.stage(list, origin, start..list.items.len(), &mut batch);
        let entries_of_rows = batch.entries_of_rows(count);
        for row in live.0..live.1 {
            let entries = entries_of_rows[row];
            if entries == 0 {
                continue;
            }
            evaluated += u64::from(entries.count_ones()) * TILE as u64;
            let (mut b_dy, mut rest) = ([F::zero(); BATCH], [F::zero(); BATCH]);
            for e in 0..BATCH {
                let dy = batch.y[e] - columns[row];
                b_dy[e] = batch.b[e] * dy;
                rest[e] = batch.c[e] * dy * dy + batch.log2_opacity[e];
            }
            for k in 0..per_row {
                let at = row * per_row + k;
                let column = F::vectors::<S>(&columns)[k];
                let mut sums = planes.each_ref().map(|plane| F::vectors::<S>(plane)[at]);
                let first = F::vectors::<S>(transmittance)[at];
                // Where a pixel stops, this continues below the threshold, so that no later splat
                // passes the test: from one splat to the next there is a single multiply-add to
                // wait for.
                let mut running = F::vmax(s, first, zero);
                let (mut last, mut stop) = (first, zero);
                let mut left = entries;
                while left != 0 {
                    let e = left.trailing_zeros() as usize % BATCH;
                    left &= left - 1;
                    let dx = F::vsub(s, F::vsplat(s, batch.x[e]), column);
                    let (a, b_dy) = (F::vsplat(s, batch.a[e]), F::vsplat(s, b_dy[e]));
                    let log2_opacity = F::vsplat(s, batch.log2_opacity[e]);
                    let rest = F::vsplat(s, rest[e]);
                    let alpha = tests.alpha(dx, a, b_dy, rest, log2_opacity);
                    let drawn = F::vselect(s, alpha.passes, alpha.capped, zero);
                    let after = F::vfnma(s, drawn, running, running);
                    let goes_on = F::vle(s, threshold, after);
                    let weight = F::vselect(s, goes_on, F::vmul(s, drawn, running), zero);
                    for c in 0..C {
                        let channel = F::vsplat(s, batch.channels[c][e]);
                        sums[c] = F::vfma(s, channel, weight, sums[c]);
                    }
                    last = F::vselect(s, goes_on, after, last);
                    stop = F::vselect(s, goes_on, F::vsplat(s, numbers[e]), stop);
                    running = after;
                }
                let stopped = F::vlt(s, running, threshold);
                let before = F::vselect(s, stopped, F::vnegative(s, last), last);
                F::vectors_mut::<S>(transmittance)[at] = before;
                for (plane, sum) in planes.iter_mut().zip(sums) {
                    F::vectors_mut::<S>(plane)[at] = sum;
                }
                if F::any_flip(s, F::mark_flips(s, one, first, before)) {
                    let mut ends = [F::zero(); TILE];
                    let now = F::vand(s, F::vlt(s, zero, first), stopped);
                    F::vectors_mut::<S>(&mut ends)[0] = F::vselect(s, now, stop, never);
                    let width = TILE / per_row;
                    for (stop, &end) in stops[at * width..(at + 1) * width].iter_mut().zip(&ends) {
                        *stop = (*stop).min(stop_number(start, end));
                    }
                }
            }
        }
        start += count;
    }
    evaluated
}

/// List index of `end` in the batch that begins at `start`; `u32::MAX` for infinity.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "below BATCH, and list indices are below 2^32"
)]
fn stop_number<F: Lane>(start: usize, end: F) -> u32 {
    if end < F::infinity() { start as u32 + end.as_f32() as u32 } else { u32::MAX }
}

/// Numbers 1 to `BATCH`: the position after each entry of a batch.
#[inline(always)]
fn numbers<F: Lane>() -> [F; BATCH] {
    let mut numbers = [F::one(); BATCH];
    for i in 1..BATCH {
        numbers[i] = numbers[i - 1] + F::one();
    }
    numbers
}
