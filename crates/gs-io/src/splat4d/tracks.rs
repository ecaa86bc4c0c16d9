//! The binary parts: the static section, and the chunks of changing values.

use super::symbols::{Kind, Stream, Symbols, zigzag};
use super::value::{Attribute, Steps, values};
use super::value_ranges::{Order, ValueRanges};
use crate::clip::Hemispheres;
use gs_core::Splats;
use rayon::prelude::*;
use std::io;

/// Ten streams: by attribute, a bit map of the static splats, and values; changing splats have the
/// value of the first frame, so that this section alone is sufficient to show it.
pub(super) fn static_section(
    order: &Order,
    ranges: &ValueRanges,
    first: &Splats,
    hemispheres: &Hemispheres,
    steps: &Steps,
) -> io::Result<Vec<u8>> {
    let mut streams: Vec<(Attribute, Symbols)> =
        Attribute::ALL.iter().map(|&attribute| (attribute, static_map(order, attribute))).collect();
    let base = [Attribute::Pos, Attribute::Scale, Attribute::Rgb, Attribute::Alpha, Attribute::Rot];
    for attribute in base {
        let bins = |position: usize| {
            let row = order.rows[position];
            ranges
                .constant_bins(attribute, row, steps)
                .filter(|_| !order.changes(position, attribute))
                .unwrap_or_else(|| {
                    values(attribute, first, hemispheres, row)
                        .map(|value| Steps::bin(value, steps.fixed(attribute)))
                })
        };
        let channels = attribute.channels();
        let mut before = [0; 4];
        let mut symbols = Symbols::default();
        for position in 0..order.rows.len() {
            let bins = bins(position);
            for k in 0..channels {
                symbols.push(match attribute {
                    Attribute::Pos | Attribute::Scale => zigzag(bins[k] - before[k]),
                    Attribute::Rot => (bins[k] + 128).cast_unsigned(),
                    Attribute::Rgb | Attribute::Alpha => bins[k].cast_unsigned(),
                });
            }
            before = bins;
        }
        streams.push((attribute, symbols));
    }
    let packed: Vec<io::Result<Stream>> = streams
        .par_iter_mut()
        .map(|(attribute, symbols)| symbols.take(attribute.id(), Kind::Static))
        .collect();
    let mut bytes = Vec::new();
    for stream in packed {
        stream?.append_to(&mut bytes);
    }
    Ok(bytes)
}

/// One bit per splat, set if the attribute is static, first splat in the highest bit.
fn static_map(order: &Order, attribute: Attribute) -> Symbols {
    let places: Vec<usize> = (0..order.rows.len()).collect();
    places
        .chunks(8)
        .map(|eight| {
            eight.iter().enumerate().fold(0, |byte, (bit, &position)| {
                byte | u32::from(!order.changes(position, attribute)) << (7 - bit)
            })
        })
        .collect()
}

/// Changing values of the current group of frames.
#[derive(Debug)]
pub(super) struct Tracks {
    tracks: Vec<Track>,
    steps: Steps,
}

/// One attribute of the splats for which it changes.
#[derive(Debug)]
struct Track {
    attribute: Attribute,
    rows: Vec<usize>,
    /// Grid points as last written, by row.
    last_bins: Vec<[i32; 4]>,
    key: Symbols,
    delta: Symbols,
}

impl Tracks {
    pub(super) fn new(order: &Order, steps: Steps) -> Self {
        let track = |attribute| {
            let rows: Vec<usize> = order.dynamic_rows(attribute).collect();
            let last_bins = Vec::with_capacity(rows.len());
            Track { attribute, rows, last_bins, key: Symbols::default(), delta: Symbols::default() }
        };
        let tracks =
            Attribute::ALL.into_iter().map(track).filter(|track| !track.rows.is_empty()).collect();
        Self { tracks, steps }
    }

    /// Adds a frame; `key` if it begins a group.
    pub(super) fn push(&mut self, splats: &Splats, hemispheres: &Hemispheres, key: bool) {
        let steps = self.steps;
        self.tracks.par_iter_mut().for_each(|track| track.push(splats, hemispheres, &steps, key));
    }

    /// The chunk of the frames since the last chunk: number of streams, all heads, all payloads;
    /// keys first, so that a partial chunk is sufficient to show its first frame.
    pub(super) fn take_chunk(&mut self) -> io::Result<Vec<u8>> {
        let mut queues: Vec<(&mut Symbols, u8, Kind)> = Vec::new();
        let mut deltas: Vec<(&mut Symbols, u8, Kind)> = Vec::new();
        for track in &mut self.tracks {
            queues.push((&mut track.key, track.attribute.id(), Kind::Key));
            if track.delta.len() > 0 {
                deltas.push((&mut track.delta, track.attribute.id(), Kind::Delta));
            }
        }
        queues.append(&mut deltas);
        let streams = queues
            .into_par_iter()
            .map(|(symbols, attribute, kind)| symbols.take(attribute, kind))
            .collect::<Vec<_>>()
            .into_iter()
            .collect::<io::Result<Vec<Stream>>>()?;
        #[expect(clippy::cast_possible_truncation, reason = "at most ten")]
        let mut bytes = (streams.len() as u16).to_le_bytes().to_vec();
        for stream in &streams {
            bytes.extend_from_slice(&stream.head);
        }
        for stream in &streams {
            bytes.extend_from_slice(&stream.payload);
        }
        Ok(bytes)
    }
}

impl Track {
    fn push(&mut self, splats: &Splats, hemispheres: &Hemispheres, steps: &Steps, key: bool) {
        let (step, bound) = (steps.moving(self.attribute), steps.bound(self.attribute));
        let channels = self.attribute.channels();
        let first = self.last_bins.is_empty();
        for (i, &row) in self.rows.iter().enumerate() {
            let values = values(self.attribute, splats, hemispheres, row);
            let fresh = || values.map(|value| Steps::bin(value, step));
            if first {
                self.last_bins.push(fresh());
            }
            let before = self.last_bins[i];
            let holds = (0..channels)
                .all(|k| (f64::from(values[k]) - f64::from(before[k]) * step).abs() <= bound);
            let now = if holds { before } else { fresh() };
            self.last_bins[i] = now;
            for k in 0..channels {
                if key {
                    self.key.push(zigzag(now[k]));
                } else {
                    self.delta.push(zigzag(now[k] - before[k]));
                }
            }
        }
    }
}
