//! The JSON header, which contains the absolute offsets of all following parts.

use super::WriteOptions;
use super::value::{Attribute, Steps};
use super::value_ranges::Order;
use crate::clip::Clip;
use crate::content::magic::SPLAT4D;
use serde_json::{Value, json};

/// A compressed group of frames.
#[derive(Debug)]
pub(super) struct Chunk {
    /// First frame.
    pub(super) first: usize,
    /// Last frame.
    pub(super) last: usize,
    pub(super) bytes: Vec<u8>,
}

/// Contents of the header.
#[derive(Debug)]
pub(super) struct Header<'a> {
    pub(super) clip: &'a Clip<'a>,
    pub(super) options: &'a WriteOptions,
    pub(super) steps: &'a Steps,
    pub(super) order: &'a Order,
    /// Bounding box of the positions of all frames.
    pub(super) aabb: [f32; 6],
}

impl Header<'_> {
    /// The bytes before the static section: magic, version, flags and the
    /// JSON, given the lengths of the following parts.
    pub(super) fn bytes(&self, fixed: usize, chunks: &[Chunk]) -> Vec<u8> {
        const FRONT: usize = 12;
        // The length depends on the number of digits of the offsets, which depend on the length.
        // The length only grows with each iteration, so the loop ends.
        let mut length = 0;
        loop {
            let json = self.json(FRONT + length, fixed, chunks).to_string();
            if json.len() == length {
                let mut bytes = [&SPLAT4D[..], &[1, 0, 0, 0]].concat();
                bytes.extend_from_slice(&u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes());
                bytes.extend_from_slice(json.as_bytes());
                return bytes;
            }
            length = json.len();
        }
    }

    /// `pos_m` is in scene units despite its name; steps that are integers are written as integers.
    fn json(&self, start: usize, fixed: usize, chunks: &[Chunk]) -> Value {
        let Self { clip, options, steps, order, aabb } = self;
        let odd = |bound: u8| 2 * u32::from(bound) + 1;
        let count = |attribute| order.dynamic_count(attribute);
        let mut offset = start + fixed;
        let gops: Vec<Value> = chunks
            .iter()
            .map(|chunk| {
                let here = offset;
                offset += chunk.bytes.len();
                json!({
                    "offset": here, "len": chunk.bytes.len(),
                    "f0": chunk.first, "f1": chunk.last,
                    "t0": chunk.first as f64 / clip.fps, "t1": chunk.last as f64 / clip.fps,
                })
            })
            .collect();
        let groups: Vec<Value> = order
            .groups()
            .into_iter()
            .map(|(mask, count)| json!({ "mask": mask, "count": count }))
            .collect();
        let mut json = json!({
            "n": order.rows.len(), "t": clip.times.len(), "fps": clip.fps, "gop": options.gop,
            "bounds": {
                "pos_m": steps.bound(Attribute::Pos), "scale_rel": options.scale,
                "rgb": options.rgb, "alpha": options.alpha, "rot": options.rot,
            },
            "steps": {
                "pos": steps.moving(Attribute::Pos), "scale_log": steps.moving(Attribute::Scale),
                "rgb": odd(options.rgb), "alpha": odd(options.alpha), "rot": odd(options.rot),
                "base_pos": steps.fixed(Attribute::Pos), "base_scale_log": steps.fixed(Attribute::Scale),
            },
            "dyn": {
                "pos": count(Attribute::Pos), "rot": count(Attribute::Rot), "rgb": count(Attribute::Rgb),
                "alpha": count(Attribute::Alpha), "scale": count(Attribute::Scale),
            },
            "groups": groups,
            "aabb": aabb,
            "denoised": false,
            "static_section": { "offset": start, "len": fixed },
            "gops": gops,
        });
        if let Some(up) = options.up {
            json["c4d_up"] = json!(up);
        }
        json
    }
}
