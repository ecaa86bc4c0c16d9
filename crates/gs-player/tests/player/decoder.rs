//! A decoder written from the layout in the crate's README, sharing no code with the encoder.

use serde_json::Value;
use std::collections::BTreeMap;
use std::io::Read;

/// One attribute: integers as stored, in steps.
#[derive(Debug)]
pub(crate) struct Attribute {
    pub(crate) channels: usize,
    pub(crate) step: f64,
    pub(crate) table: String,
    /// `[rows, channels]`.
    pub(crate) base: Vec<i32>,
    /// Per row: frames and values of its knots, the first frame included for rows that move.
    pub(crate) knots: Vec<Vec<(u32, Vec<i32>)>>,
}

#[derive(Debug)]
pub(crate) struct Payload {
    pub(crate) frames: usize,
    pub(crate) groups: [usize; 4],
    pub(crate) sh_degree: usize,
    pub(crate) origin: [f64; 3],
    pub(crate) attributes: BTreeMap<String, Attribute>,
}

struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> &'a [u8] {
        let (taken, rest) = self.0.split_at(count);
        self.0 = rest;
        taken
    }

    /// `[channels, planes, rows]` bytes as `[rows, channels]` integers whose lowest bit is the
    /// sign.
    fn integers(&mut self, rows: usize, channels: usize, planes: usize) -> Vec<i32> {
        let mut words = vec![0_u32; rows * channels];
        for channel in 0..channels {
            for plane in 0..planes {
                for (row, &byte) in self.take(rows).iter().enumerate() {
                    words[row * channels + channel] += u32::from(byte) << (8 * plane);
                }
            }
        }
        let signed = |word: u32| {
            if word.is_multiple_of(2) { (word / 2) as i32 } else { -1 - (word / 2) as i32 }
        };
        words.into_iter().map(signed).collect()
    }
}

pub(crate) fn decode(gzip: &[u8]) -> Payload {
    let mut raw = Vec::new();
    flate2::read::GzDecoder::new(gzip).read_to_end(&mut raw).unwrap();
    let mut bytes = Bytes(&raw);
    assert_eq!(bytes.take(8), b"C4DPLAY1", "magic");
    let length = u32::from_le_bytes(bytes.take(4).try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(bytes.take(length)).unwrap();
    let number = |value: &Value, key: &str| value[key].as_u64().unwrap() as usize;
    let groups = [0, 1, 2, 3].map(|i| header["groups"][i].as_u64().unwrap() as usize);
    let [a, same_motion, shared, b] = groups;
    let frames = number(&header, "frames");
    let mut attributes = BTreeMap::new();
    for entry in header["attributes"].as_array().unwrap() {
        let table = entry["table"].as_str().unwrap().to_owned();
        let rows =
            a + same_motion + shared + b + if table == "appearance" { same_motion } else { 0 };
        let attribute = attribute(entry, table, rows, frames, &mut bytes);
        attributes.insert(entry["name"].as_str().unwrap().to_owned(), attribute);
    }
    assert!(bytes.0.is_empty(), "no trailing bytes");
    let origin = [0, 1, 2].map(|axis| header["origin"][axis].as_f64().unwrap());
    Payload { frames, groups, sh_degree: number(&header, "sh_degree"), origin, attributes }
}

fn attribute(
    entry: &Value,
    table: String,
    rows: usize,
    frames: usize,
    bytes: &mut Bytes<'_>,
) -> Attribute {
    let number = |key: &str| entry[key].as_u64().unwrap() as usize;
    let channels = number("channels");
    let stored_channels = number("base_channels");
    let step = entry["step"].as_f64().unwrap();
    let mut stored = bytes.integers(rows, stored_channels, number("base_planes"));
    if entry["base_delta"].as_bool().unwrap() {
        for i in stored_channels..stored.len() {
            stored[i] += stored[i - stored_channels];
        }
    }
    let base: Vec<i32> = if stored_channels == channels {
        stored
    } else {
        let full = |xyz: &[i32]| {
            let squares: f64 = xyz.iter().map(|&v| f64::from(v).powi(2)).sum();
            let real = (step.recip().powi(2) - squares).sqrt();
            [(real + 0.5).floor() as i32, xyz[0], xyz[1], xyz[2]]
        };
        stored.chunks(3).flat_map(full).collect()
    };
    let moving_rows = number("moving_rows");
    let mut moving = Vec::new();
    if moving_rows > 0 {
        let mask = bytes.take(rows.div_ceil(8));
        moving.extend((0..rows).filter(|row| mask[row / 8] >> (row % 8) & 1 == 1));
    }
    assert_eq!(moving.len(), moving_rows, "as many as declared");
    let mut frames_of: Vec<Vec<u32>> = vec![vec![0]];
    for &gap in bytes.take(number("gap_bytes")) {
        match gap {
            0 => frames_of.push(vec![0]),
            gap => {
                let row = frames_of.last_mut().unwrap();
                row.push(row.last().unwrap() + u32::from(gap));
            }
        }
    }
    frames_of.pop();
    assert_eq!(frames_of.len(), moving_rows, "every moving row's gaps end");
    let differences = bytes.integers(number("knots"), channels, number("knot_planes"));
    let mut differences = differences.chunks(channels);
    let mut knots = vec![Vec::new(); rows];
    let mut before = vec![vec![0; channels]; frames];
    for (&row, times) in moving.iter().zip(frames_of) {
        let first = base[row * channels..][..channels].to_vec();
        let mut track = vec![(0, first)];
        for pair in times.windows(2) {
            let difference = differences.next().unwrap();
            let (last, knot_delta) =
                (&track.last().unwrap().1, entry["knot_delta"].as_bool().unwrap());
            let value = (0..channels)
                .map(|c| {
                    let theirs = before[pair[1] as usize][c] - before[pair[0] as usize][c];
                    last[c] + difference[c] + if knot_delta { theirs } else { 0 }
                })
                .collect();
            track.push((pair[1], value));
        }
        for (frame, out) in before.iter_mut().enumerate() {
            *out = at(&track, frame as f64).iter().map(|v| (v + 0.5).floor() as i32).collect();
        }
        knots[row] = track;
    }
    assert!(differences.next().is_none(), "every knot has a frame");
    Attribute { channels, step, table, base, knots }
}

/// Linear between knots, then constant.
fn at(track: &[(u32, Vec<i32>)], time: f64) -> Vec<f64> {
    let next = track.iter().position(|knot| f64::from(knot.0) > time);
    let values = |knot: &(u32, Vec<i32>)| knot.1.iter().map(|&v| f64::from(v)).collect::<Vec<_>>();
    let Some(next) = next else { return values(track.last().unwrap()) };
    let (from, to) = (&track[next - 1], &track[next]);
    values(from)
        .iter()
        .zip(values(to))
        .map(|(a, b)| a + (b - a) * (time - f64::from(from.0)) / f64::from(to.0 - from.0))
        .collect()
}

impl Attribute {
    /// Value of a row at a frame, in its own units.
    pub(crate) fn value(&self, row: usize, frame: usize) -> Vec<f64> {
        let track = &self.knots[row];
        let steps = if track.is_empty() {
            self.base[row * self.channels..][..self.channels]
                .iter()
                .map(|&v| f64::from(v))
                .collect()
        } else {
            at(track, frame as f64)
        };
        steps.iter().map(|value| value * self.step).collect()
    }

    /// FNV-1a of the first frames, and of frames and values of all knots, as in the page's report.
    pub(crate) fn fingerprints(&self) -> [u32; 3] {
        let hash = |integers: &mut dyn Iterator<Item = i32>| {
            integers.flat_map(i32::to_le_bytes).fold(0x811c_9dc5_u32, |hash, byte| {
                (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
            })
        };
        let knots = || self.knots.iter().flatten();
        [
            hash(&mut self.base.iter().copied()),
            hash(&mut knots().map(|knot| knot.0 as i32)),
            hash(&mut knots().flat_map(|knot| knot.1.iter().copied())),
        ]
    }
}

impl Payload {
    /// Rows of geometry and appearance of the first (`false`) or second scene.
    pub(crate) fn rows(&self, second: bool) -> Vec<(usize, usize)> {
        let [a, same_motion, shared, b] = self.groups;
        if !second {
            return (0..a + same_motion + shared).map(|row| (row, row)).collect();
        }
        let same_motion_rows = (a..a + same_motion).map(|row| (row, row + same_motion + shared));
        let same = (a + same_motion..a + same_motion + shared).map(|row| (row, row));
        let own = (a + same_motion + shared..a + same_motion + shared + b)
            .map(|row| (row, row + same_motion));
        same_motion_rows.chain(same).chain(own).collect()
    }
}
