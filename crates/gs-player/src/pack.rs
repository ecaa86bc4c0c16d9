//! Converts streams of integers to bytes that compress well: differences,
//! signs in the lowest bit, one plane per byte.

use crate::tracks::{Knot, Tracks};
use serde::Serialize;

/// One attribute in the payload's header.
#[derive(Debug, Serialize)]
pub(crate) struct Entry<'a> {
    pub(crate) name: &'a str,
    /// Table of the rows: `geometry` or `appearance`.
    pub(crate) table: &'static str,
    pub(crate) channels: usize,
    /// Channels stored for the first frame; the others are computed from them.
    pub(crate) base_channels: usize,
    pub(crate) step: f64,
    pub(crate) base_planes: usize,
    /// Whether the first frame is stored as differences to the previous row.
    pub(crate) base_delta: bool,
    pub(crate) moving_rows: usize,
    pub(crate) gap_bytes: usize,
    pub(crate) knots: usize,
    pub(crate) knot_planes: usize,
    /// Whether knots are stored as differences to the motion of the previous moving row.
    pub(crate) knot_delta: bool,
}

/// Name, table and step of an attribute.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Label<'a> {
    pub(crate) name: &'a str,
    pub(crate) table: &'static str,
    /// Leading channels not stored for the first frame.
    pub(crate) implied: usize,
    pub(crate) step: f64,
}

impl<'a> Label<'a> {
    pub(crate) fn of(name: &'a str, table: &'static str, implied: usize, step: f64) -> Self {
        Self { name, table, implied, step }
    }
}

/// Moves the sign to the lowest bit, so that small magnitudes become small numbers.
fn zigzag(value: i32) -> u32 {
    ((value << 1) ^ (value >> 31)).cast_unsigned()
}

/// Bytes needed for the largest number; 1 to 4.
fn planes_of(values: &[u32]) -> usize {
    let largest = values.iter().copied().max().unwrap_or(0);
    (4 - largest.leading_zeros() as usize / 8).max(1)
}

/// Bits needed by an ideal coder of single bytes.
fn entropy(values: &[u32], planes: usize) -> f64 {
    (0..planes)
        .map(|plane| {
            let mut counts = [0_u64; 256];
            for value in values {
                counts[(value >> (8 * plane)) as usize & 0xFF] += 1;
            }
            let total = values.len().max(1) as f64;
            let bits = |&count: &u64| match count {
                0 => 0.0,
                _ => -(count as f64) * (count as f64 / total).log2(),
            };
            counts.iter().map(bits).sum::<f64>()
        })
        .sum()
}

/// `[rows, channels]` numbers as `[channels, planes, rows]` bytes.
fn write_planes(values: &[u32], channels: usize, planes: usize, out: &mut Vec<u8>) {
    for channel in 0..channels {
        for plane in 0..planes {
            let column = values.iter().skip(channel).step_by(channels);
            out.extend(column.map(|value| value.to_le_bytes()[plane]));
        }
    }
}

/// The encoding with the lower entropy of two: whether it is the
/// second, its numbers and number of planes.
fn shorter(plain: Vec<u32>, other: Vec<u32>) -> (bool, Vec<u32>, usize) {
    let (plain_planes, other_planes) = (planes_of(&plain), planes_of(&other));
    if entropy(&other, other_planes) < entropy(&plain, plain_planes) {
        (true, other, other_planes)
    } else {
        (false, plain, plain_planes)
    }
}

/// Appends finished tracks with the rows in the given order, and returns their header entry.
pub(crate) fn write<'a>(
    label: Label<'a>,
    tracks: &Tracks,
    order: &[usize],
    out: &mut Vec<u8>,
) -> Entry<'a> {
    let channels = tracks.channels;
    let base_channels = channels - label.implied;
    let stored = |row: usize| &tracks.base[row * channels + label.implied..(row + 1) * channels];
    let plain = order.iter().flat_map(|&row| stored(row).iter().map(|&v| zigzag(v))).collect();
    let mut before = vec![0; base_channels];
    let mut delta = Vec::with_capacity(order.len() * base_channels);
    for &row in order {
        for (last, &value) in before.iter_mut().zip(stored(row)) {
            delta.push(zigzag(value.wrapping_sub(*last)));
            *last = value;
        }
    }
    let (base_delta, base, base_planes) = shorter(plain, delta);
    write_planes(&base, base_channels, base_planes, out);

    let spans = spans(tracks);
    let moving_rows: Vec<usize> =
        order.iter().copied().filter(|&row| !spans[row].is_empty()).collect();
    if !moving_rows.is_empty() {
        let mut mask = vec![0_u8; order.len().div_ceil(8)];
        for (position, &row) in order.iter().enumerate() {
            mask[position / 8] |= u8::from(!spans[row].is_empty()) << (position % 8);
        }
        out.extend(mask);
    }
    let gaps = gaps(tracks, &moving_rows, &spans);
    out.extend(&gaps);
    let (knot_delta, values, knot_planes) = knot_values(tracks, &moving_rows, &spans);
    write_planes(&values, channels, knot_planes, out);
    Entry {
        name: label.name,
        table: label.table,
        channels,
        base_channels,
        step: label.step,
        base_planes,
        base_delta,
        moving_rows: moving_rows.len(),
        gap_bytes: gaps.len(),
        knots: values.len() / channels,
        knot_planes,
        knot_delta,
    }
}

/// Range of each row's knots.
fn spans(tracks: &Tracks) -> Vec<std::ops::Range<usize>> {
    let rows = tracks.base.len() / tracks.channels;
    let mut spans = vec![0..0; rows];
    let mut start = 0;
    for group in tracks.knots.chunk_by(|a, b| a.row == b.row) {
        spans[group[0].row as usize] = start..start + group.len();
        start += group.len();
    }
    spans
}

/// Numbers of frames between knots; 0 ends a row.
fn gaps(tracks: &Tracks, moving_rows: &[usize], spans: &[std::ops::Range<usize>]) -> Vec<u8> {
    let mut gaps = Vec::new();
    for &row in moving_rows {
        let mut frame = 0;
        for knot in &tracks.knots[spans[row].clone()] {
            let gap = u8::try_from(knot.frame - frame);
            gaps.push(gap.expect("segments have at most 255 frames"));
            frame = knot.frame;
        }
        gaps.push(0);
    }
    gaps
}

/// Differences between knots, or those minus the differences of the
/// previous moving row (neighbours have similar motion).
fn knot_values(
    tracks: &Tracks,
    moving_rows: &[usize],
    spans: &[std::ops::Range<usize>],
) -> (bool, Vec<u32>, usize) {
    let channels = tracks.channels;
    let frames = tracks.knots.iter().map(|knot| knot.frame as usize + 1).max().unwrap_or(0);
    let (mut plain, mut other) = (Vec::new(), Vec::new());
    let (mut before, mut dense) = (vec![0; frames * channels], vec![0; frames * channels]);
    for &row in moving_rows {
        let base = &tracks.base[row * channels..][..channels];
        let span = spans[row].clone();
        let knots = &tracks.knots[span.clone()];
        let values = &tracks.values[span.start * channels..span.end * channels];
        let (mut frame, mut last) = (0, base);
        for (knot, value) in knots.iter().zip(values.chunks_exact(channels)) {
            let next = knot.frame as usize;
            for channel in 0..channels {
                let moved = value[channel].wrapping_sub(last[channel]);
                let theirs = before[next * channels + channel] - before[frame * channels + channel];
                plain.push(zigzag(moved));
                other.push(zigzag(moved.wrapping_sub(theirs)));
            }
            (frame, last) = (next, value);
        }
        every_frame(base, knots, values, &mut dense);
        std::mem::swap(&mut before, &mut dense);
    }
    shorter(plain, other)
}

/// Values of a row at every frame, rounded: `[frames, channels]`.
fn every_frame(base: &[i32], knots: &[Knot], values: &[i32], out: &mut [i32]) {
    let channels = base.len();
    let (mut frame, mut last) = (0, base);
    for (knot, value) in knots.iter().zip(values.chunks_exact(channels)) {
        let next = knot.frame as usize;
        for at in frame..next {
            for channel in 0..channels {
                let (from, to) = (f64::from(last[channel]), f64::from(value[channel]));
                let moved = (to - from) * (at - frame) as f64 / (next - frame) as f64;
                out[at * channels + channel] = crate::tracks::round(from + moved);
            }
        }
        (frame, last) = (next, value);
    }
    for at in out[frame * channels..].chunks_exact_mut(channels) {
        at.copy_from_slice(last);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_become_planes() {
        assert_eq!(
            [0, -1, 1, -2, i32::MAX, i32::MIN].map(zigzag),
            [0, 1, 2, 3, u32::MAX - 1, u32::MAX]
        );
        assert_eq!(planes_of(&[255]), 1, "a byte");
        assert_eq!(planes_of(&[256]), 2, "more than a byte");
        assert_eq!(planes_of(&[]), 1, "at least one");
        let mut out = Vec::new();
        write_planes(&[1, 2, 0x0103, 4], 2, 2, &mut out);
        assert_eq!(out, [1, 3, 0, 1, 2, 4, 0, 0], "channels, planes, rows");
    }

    #[test]
    fn the_encoding_with_lower_entropy_is_chosen() {
        let noise: Vec<u32> = (0..1000).map(|i| i * 7919 % 251).collect();
        assert!(shorter(noise.clone(), vec![3; 1000]).0, "constant has lower entropy than noise");
        assert!(!shorter(vec![3; 1000], noise).0, "and the other way round");
    }
}
