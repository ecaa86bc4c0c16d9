//! Writing glTF.

use super::container::{CHUNK_BIN, CHUNK_JSON};
use super::extension::{EXTENSION, harmonic_name};
use crate::axes::{self, Axes};
use crate::bytes8::{channel_of, unorm8};
use crate::content::magic::GLB;
use crate::format_losses::FormatLosses;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gs_core::{Splats, quat, sh};
use serde_json::{Map, Value, json};
use std::io::{self, Write};

/// Component types.
const U8: u32 = 5121;
const F32: u32 = 5126;
/// Target of a buffer view with attributes.
const ARRAY_BUFFER: u32 = 34_962;

/// Options for writing glTF.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct WriteOptions {
    /// SH degree of the file, at most that of the splats; `None` keeps theirs.
    pub sh_degree: Option<usize>,
    /// Write one text file (`.gltf`) with base64 data instead of binary (`.glb`); a third larger.
    pub text: bool,
    /// Notes for `asset.extras.comments`.
    pub comments: Vec<String>,
}

/// Attributes written so far.
#[derive(Default)]
struct Attributes {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    names: Map<String, Value>,
}

impl Attributes {
    /// Adds an attribute. `size` is the type with the number of its values.
    fn push(&mut self, name: &str, component: u32, shape: &str, count: usize, data: &[u8]) {
        self.names.insert(name.to_owned(), json!(self.accessors.len()));
        self.accessors.push(json!({
            "bufferView": self.views.len(),
            "componentType": component,
            "normalized": component != F32,
            "count": count,
            "type": shape,
        }));
        self.views.push(json!({
            "buffer": 0,
            "byteOffset": self.bytes.len(),
            "byteLength": data.len(),
            "target": ARRAY_BUFFER,
        }));
        self.bytes.extend_from_slice(data);
    }
}

fn floats<'a>(values: impl Iterator<Item = &'a f32>) -> Vec<u8> {
    values.flat_map(|value| value.to_le_bytes()).collect()
}

/// Writes one frame as glTF 2.0 with `KHR_gaussian_splatting`, in the axes of the specification
/// (left, up, front), and returns the losses. Centres and SH are exact; scales and opacities are
/// stored after activation. A colour per point supports viewers without splats.
///
/// # Errors
/// If the arrays of `splats` have inconsistent lengths, no row is finite, or a binary file would
/// exceed 4 GiB ([`io::ErrorKind::InvalidInput`]); if writing fails.
pub fn write(
    splats: &Splats,
    options: &WriteOptions,
    out: &mut impl Write,
) -> io::Result<FormatLosses> {
    let invalid = |what: String| io::Error::new(io::ErrorKind::InvalidInput, what);
    splats.check_shapes().map_err(|error| invalid(error.to_string()))?;
    let valid: Vec<usize> = (0..splats.len()).filter(|&row| splats.is_finite(row)).collect();
    if valid.is_empty() {
        return Err(invalid("no splat is finite".to_owned()));
    }
    let degree = options.sh_degree.map_or(splats.sh_degree, |degree| degree.min(splats.sh_degree));
    let mut converted = splats.select(&valid).with_sh_degree(degree);
    axes::convert(&mut converted, Axes::PLY, Axes::LUF);
    let attributes = attributes(&converted);
    let text = options.text;
    let bytes = &attributes.bytes;
    let mut buffer = json!({ "byteLength": bytes.len() });
    if text {
        let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes));
        buffer["uri"] = json!(uri);
    }
    let document = json!({
        "asset": {
            "version": "2.0",
            "generator": concat!("c4d ", env!("CARGO_PKG_VERSION")),
            "extras": { "comments": options.comments },
        },
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "splats", "mesh": 0 }],
        "meshes": [{ "primitives": [{
            "mode": 0,
            "attributes": attributes.names,
            "extensions": { EXTENSION: {
                "kernel": "ellipse",
                "colorSpace": "srgb_rec709_display",
                "projection": "perspective",
                "sortingMethod": "cameraDistance",
            } },
        }] }],
        "accessors": attributes.accessors,
        "bufferViews": attributes.views,
        "buffers": [buffer],
    });
    let mut json = serde_json::to_vec(&document)?;
    if text {
        out.write_all(&json)?;
    } else {
        // Chunks are padded to multiples of four bytes.
        json.resize(json.len().next_multiple_of(4), b' ');
        let padding = bytes.len().next_multiple_of(4) - bytes.len();
        let word = |value: usize| {
            u32::try_from(value).map(u32::to_le_bytes).map_err(|_too_large| {
                invalid(format!("{} splats need more than 4 GiB", converted.len()))
            })
        };
        let total = word(28 + json.len() + bytes.len() + padding)?;
        out.write_all(&GLB)?;
        out.write_all(&2_u32.to_le_bytes())?;
        out.write_all(&total)?;
        out.write_all(&word(json.len())?)?;
        out.write_all(&CHUNK_JSON.to_le_bytes())?;
        out.write_all(&json)?;
        out.write_all(&word(bytes.len() + padding)?)?;
        out.write_all(&CHUNK_BIN.to_le_bytes())?;
        out.write_all(bytes)?;
        out.write_all(&[0; 3][..padding])?;
    }
    Ok(losses(splats, degree, splats.len() - valid.len()))
}

fn attributes(splats: &Splats) -> Attributes {
    let count = splats.len();
    let rows = 0..count;
    let mut attributes = Attributes::default();
    attributes.push("POSITION", F32, "VEC3", count, &floats(splats.means.iter().flatten()));
    let (min, max) = splats.bounds().unwrap_or_default();
    if let Some(position) = attributes.accessors.last_mut() {
        (position["min"], position["max"]) = (json!(min), json!(max));
    }
    let linear = |channel: f32| {
        let value = channel.clamp(0.0, 1.0);
        if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    };
    let colors: Vec<u8> = rows
        .clone()
        .flat_map(|i| {
            let [r, g, b] = splats.sh_of(i)[0].map(|dc| unorm8(linear(channel_of(dc))));
            [r, g, b, unorm8(splats.opacity(i))]
        })
        .collect();
    attributes.push("COLOR_0", U8, "VEC4", count, &colors);
    let own = |name: &str| format!("{EXTENSION}:{name}");
    let rotations: Vec<f32> = rows
        .clone()
        .flat_map(|i| {
            let [w, x, y, z] = quat::normalize(splats.quats[i]);
            [x, y, z, w]
        })
        .collect();
    attributes.push(&own("ROTATION"), F32, "VEC4", count, &floats(rotations.iter()));
    let scales: Vec<f32> = rows.clone().flat_map(|i| splats.scale(i)).collect();
    attributes.push(&own("SCALE"), F32, "VEC3", count, &floats(scales.iter()));
    let opacities: Vec<f32> = rows.clone().map(|i| splats.opacity(i)).collect();
    attributes.push(&own("OPACITY"), F32, "SCALAR", count, &floats(opacities.iter()));
    for k in 0..sh::num_coeffs(splats.sh_degree) {
        let values: Vec<u8> = floats(rows.clone().flat_map(|i| &splats.sh_of(i)[k]));
        attributes.push(&harmonic_name(k), F32, "VEC3", count, &values);
    }
    attributes
}

fn losses(splats: &Splats, degree: usize, broken: usize) -> FormatLosses {
    let mut losses = FormatLosses::none();
    if degree < splats.sh_degree {
        losses.push(format!("SH degree {} becomes {degree}", splats.sh_degree));
    }
    losses.push(
        "scales and opacities are stored after activation, exact to a few parts in 10 million",
    );
    let flat = splats.log_scales.iter().filter(|row| row.iter().any(|value| value.exp() == 0.0));
    let flat = flat.count();
    if flat > 0 {
        losses.push(format!("scales of {flat} splats underflow and become 0"));
    }
    if broken > 0 {
        losses.push(format!("{broken} damaged splats are omitted"));
    }
    losses
}
